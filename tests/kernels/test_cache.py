"""The cache folder: where it is, what survives damage, and that writers cannot harm readers."""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit import untrained

from wamnet.compiler import compile as compiling
from wamnet.compiler.scenes import smooth_kernel
from wamnet.compiler.variants import plan_model
from wamnet.kernels import cache, denoise_on
from wamnet.kernels.run.denoise_on import data_of, kernel_of
from wamnet.refimpl import frame
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import dataset

DATA = {"winner": "tile:16", "ms": [1.5, 2.25], "none": None}
"""Some data."""


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path / "deep" / "cache"))


def test_the_folder_is_the_user_s(monkeypatch):
    monkeypatch.delenv(cache.FOLDER_VARIABLE)
    monkeypatch.setenv("HOME", "/h")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert cache.folder() == Path("/h/.cache/wamnet")
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache.folder() == Path("/h/.cache/wamnet")
    monkeypatch.setenv("XDG_CACHE_HOME", "/x")
    assert cache.folder() == Path("/x/wamnet")
    monkeypatch.setenv(cache.FOLDER_VARIABLE, "mine")
    assert cache.folder() == Path("mine")


def test_what_is_written_is_read(caplog):
    assert cache.read_json("a") is None
    path = cache.write_json("a", DATA)
    assert path == cache.folder() / "a.json"
    assert cache.read_json("a") == DATA
    cache.write_json("a", [1])
    assert cache.read_json("a") == [1]
    assert [file.name for file in cache.folder().iterdir()] == ["a.json"], "no unfinished file is left"
    assert cache.folder().stat().st_mode & 0o077 == 0
    assert not caplog.records


DAMAGES = {
    "empty": lambda text: "",
    "half": lambda text: text[: len(text) // 2],
    "number": lambda text: text.replace("1.5", "0.5"),
    "winner": lambda text: text.replace("tile:16", "tile:8"),
    "checksum": lambda text: text.replace('"sha256": "', '"sha256": "0'),
    "form": lambda text: text.replace(cache.SCHEMA, "wamnet-cache-0"),
    "foreign": lambda text: json.dumps({"data": DATA}),
    "list": lambda text: "[]",
    "constant": lambda text: text.replace("1.5", "NaN"),
    "deep": lambda text: "[" * 100_000,
    "binary": lambda text: "\0\xff",
}
"""What may have happened to a file."""


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_entry_is_ignored_with_a_line_and_rewritten(caplog, damage):
    path = cache.write_json("a", DATA)
    text = path.read_text()
    assert DAMAGES[damage](text) != text
    path.write_text(DAMAGES[damage](text), encoding="latin-1")
    assert cache.read_json("a") is None
    assert [record.getMessage() for record in caplog.records] == [
        f"cache entry {path} is damaged, or no entry of wamnet: it is ignored and written again"
    ]
    cache.write_json("a", DATA)
    assert cache.read_json("a") == DATA


def test_a_file_that_is_too_large_is_no_entry(monkeypatch, caplog):
    cache.write_json("a", DATA)
    monkeypatch.setattr(cache, "LARGEST_BYTES", 20)
    assert cache.read_json("a") is None
    assert "at most 20 bytes are read (remove it): it is ignored" in caplog.text


def test_what_cannot_be_read_or_written_costs_no_run(caplog):
    cache.folder().mkdir(parents=True)
    (cache.folder() / "a.json").mkdir()
    assert cache.read_json("a") is None
    assert "is a folder (give the name of a file in it): it is ignored" in caplog.text
    assert cache.write_json("a", DATA) is None
    assert "cannot be written" in caplog.text
    assert [file.name for file in cache.folder().iterdir()] == ["a.json"]


def test_a_folder_that_cannot_be(tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path / "file" / "cache"))
    assert cache.read_json("a") is None
    assert cache.write_json("a", DATA) is None
    assert "is not used: Not a directory" in caplog.text


def test_names_hold_no_folder():
    with pytest.raises(AssertionError, match="hold no folder"):
        cache.read_json("../a")


def test_keys_tell_parts_and_their_order_apart():
    keys = [cache.key("a", "b"), cache.key("b", "a"), cache.key("ab"), cache.key(["a"], "b"), cache.key("a")]
    assert len(set(keys)) == len(keys)
    assert cache.key({"a": 1, "b": 2}) == cache.key({"b": 2, "a": 1})
    assert cache.key("a", 1.0) != cache.key("a", 1)


# ---- kernels that are kept -------------------------------------------------------------------------------


def model(seed=1, features=("color", "normal")):
    return untrained(features=features, omegas=(3.0, 3.0), seed=seed)


def noisy(features=("color", "normal")):
    random = np.random.default_rng(5)
    names = {layer for name in features for layer in dataset.FEATURES[name].layers}
    shapes = {name: (19, 23, frame.LAYERS[name].channels) for name in sorted(names)}
    return frame.Frame({name: random.random(shape, np.float32) for name, shape in shapes.items()})


def no_compiler(monkeypatch):
    """Make compiling an error."""

    def fail(_plan):
        raise AssertionError("compiled again")

    monkeypatch.setattr(compiling, "compile_plan", fail)


@pytest.mark.parametrize("executor", ["opencl", "opengl-egl", "c"])
@pytest.mark.parametrize("variant", ["full", "rank3", "whole8"])
def test_a_second_run_compiles_nothing_and_gives_the_same_bits(
    executor_named, executor, variant, monkeypatch
):
    device = executor_named(executor)
    compiled = denoise_on(device, model(), noisy(), variant=variant)
    first = denoise_on(device, model(), noisy(), variant=variant, keeps=True)
    no_compiler(monkeypatch)
    device.forget()
    second = denoise_on(device, model(), noisy(), variant=variant, keeps=True)
    assert first.digest == second.digest == compiled.digest
    assert (first.kernel, first.schedule, first.reason) == (second.kernel, second.schedule, second.reason)


def test_another_network_schedule_profile_or_program_is_another_entry(executor_named, monkeypatch):
    device = executor_named("c")
    denoise_on(device, model(), noisy(), keeps=True)
    no_compiler(monkeypatch)
    others = {
        "weights": {"model": model(seed=2)},
        "scales": {"model": replace(model(), normalization=dataset.Normalization(exposure_stops=1.0))},
        "schedule": {"schedule": "plain"},
        "profile": {},
    }
    for name, options in others.items():
        monkeypatch.setattr(device, "profile", "native" if name == "profile" else "ieee")
        with pytest.raises(AssertionError, match="compiled again"):
            denoise_on(device, **{"model": model(), "frame": noisy(), "keeps": True, **options})
    monkeypatch.setattr(cache, "program_version", lambda: "another")
    with pytest.raises(AssertionError, match="compiled again"):
        denoise_on(device, model(), noisy(), keeps=True)


@pytest.mark.parametrize("content", ["[]", "{}", '[{"source": 1}]', "damaged"])
def test_an_entry_that_is_no_kernel_is_compiled_again(executor_named, content):
    device = executor_named("c")
    first = denoise_on(device, model(), noisy(), keeps=True)
    (entry,) = cache.folder().glob("kernel-*.json")
    if content == "damaged":
        entry.write_bytes(entry.read_bytes()[:-9])
    else:
        cache.write_json(entry.stem, json.loads(content))
    assert denoise_on(device, model(), noisy(), keeps=True).digest == first.digest


def test_what_is_refused_is_refused_again(executor_named):
    for _ in range(2):
        with pytest.raises(CompileError, match=r"schedule 'tile99': unknown to .* \(did you mean 'tile"):
            denoise_on(executor_named("c"), model(), noisy(), schedule="tile99", keeps=True)


def test_a_kernel_is_the_same_after_reading(executor_named):
    kernel = compiling.compile_plan(plan_model(model(), "opencl", variant="rank3"))
    again = kernel_of(data_of(kernel))
    assert data_of(again) == data_of(kernel)
    assert [each.digest for each in again.kernels] == [each.digest for each in kernel.kernels]
    assert again.interface == kernel.interface
    assert again.weights.tobytes() == kernel.weights.tobytes()


def test_the_launches_of_a_kernel_are_the_same_after_reading(kit):
    program = kit.denoiser(kit.network([192, 32, 3], (3.0, 3.0)), {"a": 3}, 8, "clamp")
    made = compiling.compile_program(program, "opengl", "fftpasses:32")
    read = kernel_of(json.loads(json.dumps(data_of(made))))
    assert [each.source for each in read.launches] == [each.source for each in made.launches]
    assert len({each.source for each in read.launches}) == len(made.manifest["schedule"]["launches"])


def test_only_the_newest_entries_of_a_kind_stay(monkeypatch):
    monkeypatch.setattr(cache, "MOST_KEPT", 3)
    for number in range(5):
        assert cache.kept("test", (number,), lambda number=number: number) == number
    assert len(list(cache.folder().glob("test-*.json"))) == 3
    assert cache.kept("test", (4,), lambda: None) == 4


running = sys.modules["wamnet.kernels.run.denoise_on"]


def test_the_kernels_of_the_filter_are_kept_too(executor_named, monkeypatch):
    smoothed = next(name for name, feature in dataset.FEATURES.items() if feature.guides)
    device, features = executor_named("c"), ("color", smoothed)
    network, seen = model(features=features), noisy(features)
    first = denoise_on(device, network, seen, keeps=True)
    no_compiler(monkeypatch)
    monkeypatch.setattr(smooth_kernel, "compile_smoothing", None)
    running._filter.cache_clear()
    assert denoise_on(device, network, seen, keeps=True).digest == first.digest
