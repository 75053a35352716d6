"""Model and checkpoint files: round trips to the bit, equal bytes, one line for everything that is wrong."""

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors import safe_open

from wamnet.models import model_file
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import siren, train, whole
from wamnet.refimpl.network.dataset import FEATURES, Normalization, n_inputs
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.train import Recipe
from wamnet.refimpl.network.window import Window


def model_of(features: tuple[str, ...] = ("color", "depth"), size: int = 2, dtype: Any = np.float32) -> Model:
    """Return an untrained model with awkward numbers in its scales."""
    window = Window(size, "zero")
    network = siren.init((n_inputs(features, window), 4, 3), 3.3, 0.1, seed=2, dtype=dtype)
    scales = Normalization(0.1, 1 / 3, (1e-300, -0.1, 3.0), 2.0**-40)
    return Model(network, features, window, scales, {"recipe": "{}", "scene": 'mini "cubes" \u2603\n'})


def same(one: Model, other: Model) -> bool:
    """Tell whether two models are equal to the bit."""
    arrays = zip(one.siren.weights + one.siren.biases, other.siren.weights + other.siren.biases, strict=True)
    bits = all(a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes() for a, b in arrays)
    return bits and replace(one, siren=other.siren) == other


# ---- models ----------------------------------------------------------------------------------------------


@given(
    features=st.lists(st.sampled_from(sorted(FEATURES)), min_size=1, unique=True).map(tuple),
    size=st.integers(1, 3),
    dtype=st.sampled_from([np.float32, np.float64]),
)
def test_a_model_comes_back_to_the_bit(
    tmp_path_factory: pytest.TempPathFactory, features: tuple[str, ...], size: int, dtype: Any
) -> None:
    path = tmp_path_factory.mktemp("models") / "model.safetensors"
    model = model_of(features, size, dtype)
    model_file.save_model(path, model)
    assert same(model_file.load_model(path), model)


def test_a_model_names_its_activation_unless_it_is_the_sine(tmp_path: Path) -> None:
    """A reader of version 1, for which all are sines, refuses version 2."""
    path, model = tmp_path / "model.safetensors", model_of()
    model = replace(model, siren=replace(model.siren, activation="relu"))
    model_file.save_model(path, model)
    assert same(model_file.load_model(path), model)
    with safe_open(path, framework="numpy") as file:
        assert (file.metadata()["version"], file.metadata()["activation"]) == ("2", "relu")
    model_file.save_model(path, model_of())
    with safe_open(path, framework="numpy") as file:
        assert file.metadata()["version"] == "1"
        assert "activation" not in file.metadata()


def test_equal_models_are_equal_bytes_whatever_the_order_of_their_facts(tmp_path: Path) -> None:
    facts = {f"fact{n}": str(n) for n in range(20)}
    backwards = dict(reversed(facts.items()))
    for name, info in (("a", facts), ("b", backwards)):
        model_file.save_model(tmp_path / name, replace(model_of(), info=info))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_broken_model_is_not_saved(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    with pytest.raises(InputError, match="features '': must be at least one"):
        model_file.save_model(path, replace(model_of(), features=()))
    assert list(tmp_path.iterdir()) == []


# ---- writing ---------------------------------------------------------------------------------------------


def test_a_failed_or_interrupted_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """MOD-5."""
    path = tmp_path / "model.safetensors"
    model_file.save_model(path, model_of())
    before = path.read_bytes()

    def interrupted(self: Path, target: Path) -> Path:
        raise KeyboardInterrupt

    def full(self: Path, target: Path) -> Path:
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr(Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        model_file.save_model(path, model_of(size=3))
    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match=r"output file .*cannot be written: No space left on device"):
        model_file.save_model(path, model_of(size=3))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_a_missing_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"output file '.*': cannot be written: No such file or directory"):
        model_file.save_model(tmp_path / "missing" / "model.safetensors", model_of())


# ---- reading ---------------------------------------------------------------------------------------------


def without(name: str) -> Callable[[Any, Any], None]:
    """Return an edit that removes a tensor or a text."""

    def edit(tensors: Any, texts: Any) -> None:
        (tensors if name in tensors else texts).pop(name)

    return edit


def with_text(name: str, text: str, **others: str) -> Callable[[Any, Any], None]:
    """Return an edit that sets a text, and others."""
    return lambda tensors, texts: texts.update({name: text, **others})


def with_tensor(name: str, values: Any) -> Callable[[Any, Any], None]:
    """Return an edit that sets a tensor."""
    return lambda tensors, texts: tensors.update({name: values})


DAMAGE = {
    "no tensors": (
        lambda tensors, texts: tensors.clear(),
        "list of tensors 'empty': 'layer0.weight' must be",
    ),
    "no bias": (without("layer1.bias"), "list of tensors '.*': 'layer1.bias' must be among them"),
    "a layer left out": (
        with_tensor("layer3.weight", np.zeros((3, 3), np.float32)),
        "'layer2.weight' must be",
    ),
    "no features": (without("features"), "list of header entries '.*': 'features' must be among them"),
    "features unknown": (with_text("features", '["glow"]'), "model: feature 'glow': unknown"),
    "features no list": (with_text("features", '"color"'), "features 'color': must be a list"),
    "features no JSON": (with_text("features", "color"), "features 'color': is not acceptable JSON"),
    "other features": (
        with_text("features", '["color"]'),
        "inputs of the first layer 16: 2 x 2 pixels of color",
    ),
    "window": (with_text("window", '{"size": 0, "border": "zero"}'), "window size 0"),
    "window no JSON": (with_text("window", "12"), "window 12: must be a JSON object"),
    "window parts": (with_text("window", '{"width": 12}'), "window.width 12: Window has no such key"),
    "window without a border": (with_text("window", '{"size": 2}'), "window.border: missing"),
    "omega": (with_text("omega_0_first", "0.0"), "omega_0_first 0.0: must be positive"),
    "omega of Python": (
        with_text("omega_0_first", "1_0"),
        "1_0': cannot be read: a decimal number is needed",
    ),
    "omega no decimal": (with_text("omega_0_first", "nan"), "omega_0_first 'nan': cannot be read"),
    "omega no number": (with_text("omega_0_hidden", "big"), "omega_0_hidden 'big': cannot be read"),
    "scales": (with_text("normalization", "{}"), "model: normalization.exposure_stops: missing"),
    "not finite": (
        with_tensor("layer1.bias", np.array([0, np.nan, np.inf], np.float32)),
        "layer 1: number of NaN, infinite or huge parameters 2",
    ),
    "shape": (with_tensor("layer1.weight", np.zeros((3, 5), np.float32)), r"layer 1 'weights \(3, 5\)"),
    "type": (with_tensor("layer1.bias", np.zeros(3, np.int64)), "types of the parameters 'float32, int64"),
    "format": (with_text("format", "other"), "format 'other': must be wamnet-model"),
    "version": (with_text("version", "5"), "version '5': this program reads version 1 and 2 and 3 and 4"),
    "activation missing": (with_text("version", "2"), "'activation' must be among them"),
    "activation in version 1": (
        with_text("activation", "relu"),
        r"model: activation 'relu': a model of version 1 has the sine \(train again",
    ),
    "activation unknown": (
        with_text("activation", "tanh", version="2"),
        r"model: activation 'tanh': unknown \(choose one of sine, relu",
    ),
}


@pytest.mark.parametrize("case", DAMAGE)
def test_a_damaged_model_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    path = tmp_path / "model"
    edit, message = DAMAGE[case]
    model_file.save_model(path, model_of())
    tensors, texts = model_file._read(path, model_file.MODEL_FORMAT)
    edit(tensors, texts)
    path.write_bytes(model_file._encode("ignored", tensors, texts))
    with pytest.raises(InputError, match=message) as refusal:
        model_file.load_model(path)
    assert str(refusal.value).startswith(str(path)[:20])
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"P6 1 1", b"\xff" * 64, (8).to_bytes(8, "little") + b"notjson!"])
def test_a_file_of_another_kind_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"wamnet-model file '.*': is not a safetensors file"):
        model_file.load_model(path)


def of_container(path: Path, entry: Any, before: bytes = b"", name: str = "more") -> None:
    """Write a model's file with one tensor more, of 8 bytes at its end, and bytes before its header."""
    model_file.save_model(path, model_of())
    content = path.read_bytes()
    length = int.from_bytes(content[:8], "little")
    header, data = json.loads(content[8 : 8 + length]), content[8 + length :]
    span = [len(data), len(data) + 8]
    # MORE stands for the place, which the caller does not know.
    text = json.dumps({**header, name: entry}).replace('"MORE"', json.dumps(span))
    raw = before + text.encode()
    path.write_bytes(len(raw).to_bytes(8, "little") + raw + data + bytes(8))


ENTRY = {"dtype": "F32", "shape": [2], "data_offsets": "MORE"}
"""A tensor's entry."""


def test_a_tensor_of_a_type_that_numpy_lacks_counts_as_a_layer(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    of_container(path, {**ENTRY, "dtype": "BF16", "shape": [1, 4]}, name="layer2.weight")
    with pytest.raises(InputError, match=r"list of tensors '.*': 'layer2.bias' must be among them"):
        model_file.load_model(path)


@pytest.mark.parametrize(
    ("entry", "rule"),
    [
        (["F32", [2], "MORE"], "more .*: must be an object with the keys data_offsets, dtype, shape"),
        ({**ENTRY, "strides": [1]}, "more .*: must be an object with the keys .* and no others"),
        ({**ENTRY, "dtype": "C64", "shape": [1]}, "more.dtype 'C64': must be one of BOOL"),
    ],
)
def test_an_entry_of_another_form_is_refused(entry: Any, rule: str, tmp_path: Path) -> None:
    """The library takes the first two, and from some version on the third."""
    path = tmp_path / "model.safetensors"
    of_container(path, entry)
    with pytest.raises(InputError, match=f"{rule}|not a safetensors file: .*unknown variant"):
        model_file.load_model(path)


def test_a_header_that_begins_with_a_space_is_refused(tmp_path: Path) -> None:
    """The library has taken it since a version; the format's own page says that it must not."""
    path = tmp_path / "model.safetensors"
    of_container(path, ENTRY, b" ")
    with pytest.raises(InputError, match=r"header .*: its first byte must be \{|not a safetensors file"):
        model_file.load_model(path)


def test_a_file_without_texts_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    path.write_bytes((2).to_bytes(8, "little") + b"{}")
    with pytest.raises(InputError, match="format 'missing': must be wamnet-model"):
        model_file.load_model(path)


def test_a_truncated_file_is_refused_at_every_length(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    model_file.save_model(path, model_of(size=1))
    content = path.read_bytes()
    for length in range(0, len(content), 7):
        path.write_bytes(content[:length])
        with pytest.raises(InputError, match="not a safetensors file"):
            model_file.load_model(path)


def test_a_missing_file_and_a_folder_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"not found \(check the path"):
        model_file.load_model(tmp_path / "none")
    with pytest.raises(InputError, match=r"wamnet-model file '.*is a folder"):
        model_file.load_model(tmp_path)


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "model"
    model_file.save_model(path, model_of())
    with path.open("ab") as file:
        file.truncate(2**40)
    rule = rf"size of .*model in bytes {2**40}: at most {2**28} bytes are read"
    with pytest.raises(InputError, match=rule):
        model_file.load_model(path)


# ---- checkpoints -----------------------------------------------------------------------------------------

RECIPE = Recipe(("color",), Window(2), (4,), 3.0, 3.0, 0, 8, 20, 1e-2, "cosine", log_every=2)
"""A run of twenty tiny steps."""


def pairs() -> list[tuple[Frame, Frame]]:
    """Return one pair of random frames."""
    rng = np.random.default_rng(0)
    noisy, reference = (Frame({"color": rng.random((5, 6, 3)).astype(np.float32)}) for _ in range(2))
    return [(noisy, reference)]


CHECKPOINT_DAMAGE = {
    "no moments": (without("adam.v3"), "list of entries '.*': 'adam.v3' must be among them"),
    "no step": (without("step"), "list of entries '.*': 'step' must be among them"),
    "step": (with_text("step", "ten"), "content '.*ten.*': cannot be read"),
    "step too large": (with_text("step", "21"), "run: step 21: must be from 0 to 20"),
    "recipe": (with_text("recipe", "{}"), "run: recipe.features: missing"),
    "shape": (with_tensor("layer0.bias", np.zeros(3, np.float32)), r"run: parameter 2 'float32 \(3,\)"),
    "history": (with_tensor("history.step", np.zeros(1, np.int64)), "content '.*': cannot be read"),
    "model": (with_text("format", "wamnet-model"), "format 'wamnet-model': must be wamnet-checkpoint"),
}


@pytest.mark.parametrize("case", CHECKPOINT_DAMAGE)
def test_a_damaged_checkpoint_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    path = tmp_path / "run"
    edit, message = CHECKPOINT_DAMAGE[case]
    model_file.save_checkpoint(path, train.train(RECIPE, pairs(), until=3))
    tensors, texts = model_file._read(path, model_file.CHECKPOINT_FORMAT)
    edit(tensors, texts)
    path.write_bytes(model_file._encode("ignored", tensors, texts))
    with pytest.raises(InputError, match=message) as refusal:
        model_file.load_checkpoint(path)
    assert "\n" not in str(refusal.value)


# ---- models of integers ------------------------------------------------------------------------------------


def whole_model() -> Model:
    """Return a model in integers."""
    model = model_of(size=2)
    return replace(model, siren=whole.rounded(model.siren, 2))


def test_a_model_of_integers_comes_back_to_the_bit(tmp_path: Path) -> None:
    model = whole_model()
    path = tmp_path / "model.safetensors"
    model_file.save_model(path, model)
    with safe_open(path, "numpy") as file:
        kinds = {name: file.get_tensor(name).dtype.name for name in file.keys()}  # noqa: SIM118 - not a dict
        assert file.metadata()["version"] == "3"
    assert kinds["layer0.weight"] == "int8"
    assert {kinds[f"layer{i}.{name}"] for i in (0, 1) for name in ("bias", "factor")} == {"int32"}
    found = model_file.load_model(path)
    assert same(found, model)
    assert isinstance(found.siren, whole.Whole)
    assert isinstance(model.siren, whole.Whole)
    assert (found.siren.amplitude, found.siren.fraction) == (model.siren.amplitude, model.siren.fraction)
    assert all(np.array_equal(a, b) for a, b in zip(found.siren.factors, model.siren.factors, strict=True))


@pytest.mark.parametrize(
    ("field", "value", "message"), [("amplitude", 100, "amplitude"), ("fraction", 20, "fraction")]
)
def test_a_model_of_integers_that_breaks_a_rule_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, field: str, value: int, message: str
) -> None:
    model = whole_model()
    broken = replace(model, siren=replace(model.siren, **{field: value}))  # type: ignore[arg-type]
    monkeypatch.setattr(model_file, "check_model", lambda model: None)
    model_file.save_model(tmp_path / "model.safetensors", broken)
    monkeypatch.undo()
    with pytest.raises(InputError, match=message):
        model_file.load_model(tmp_path / "model.safetensors")


def test_floats_in_a_model_of_integers_are_refused(tmp_path: Path) -> None:
    model = model_of(size=2)
    texts = {"version": "3", "amplitude": "127", "fraction": "8"}
    tensors = {}
    for layer, (weight, bias) in enumerate(zip(model.siren.weights, model.siren.biases, strict=True)):
        tensors |= {f"layer{layer}.weight": weight, f"layer{layer}.bias": bias, f"layer{layer}.factor": bias}
    plain = {"features": '["color"]', "window": '{"size": 2, "border": "zero"}', "normalization": "{}"}
    texts |= plain | {"omega_0_first": "1.0", "omega_0_hidden": "1.0"}
    path = tmp_path / "model.safetensors"
    path.write_bytes(model_file._encode(model_file.MODEL_FORMAT, tensors, texts))
    with pytest.raises(InputError, match="type of a tensor"):
        model_file.load_model(path)


def test_the_library_reads_what_is_written(tmp_path: Path) -> None:
    path, model = tmp_path / "model.safetensors", model_of()
    model_file.save_model(path, model)
    with safe_open(path, framework="numpy") as file:
        texts = file.metadata()
        assert (texts["format"], texts["version"]) == ("wamnet-model", "1")
        assert json.loads(texts["features"]) == ["color", "depth"]
        assert json.loads(texts["window"]) == {"size": 2, "border": "zero"}
        assert float(texts["omega_0_first"]) == 3.3
        assert texts["info.scene"] == model.info["scene"]
        assert sorted(file.keys()) == ["layer0.bias", "layer0.weight", "layer1.bias", "layer1.weight"]
        assert np.array_equal(file.get_tensor("layer1.weight"), model.siren.weights[1])
    # The container aligns data: the header's end is a multiple of 8.
    assert int.from_bytes(path.read_bytes()[:8], "little") % 8 == 0


@pytest.mark.parametrize(
    ("dtype", "count"), [("BF16", 4), ("F8_E5M2", 8), ("F8_E4M3", 8), ("BOOL", 8), ("U64", 1), ("F16", 4)]
)
def test_a_tensor_of_another_type_is_ignored(dtype: str, count: int, tmp_path: Path) -> None:
    """Some types NumPy lacks: bfloat16, and numbers of 8 bits."""
    path = tmp_path / "model.safetensors"
    of_container(path, {**ENTRY, "dtype": dtype, "shape": [count]})
    assert same(model_file.load_model(path), model_of())


def test_training_through_a_file_gives_the_same_bits(tmp_path: Path) -> None:
    path = tmp_path / "run.checkpoint"
    train.train(
        RECIPE, pairs(), until=10, on_checkpoint=lambda state: model_file.save_checkpoint(path, state)
    )
    resumed = train.train(RECIPE, pairs(), state=model_file.load_checkpoint(path))
    whole = train.train(RECIPE, pairs())
    for name, state in (("resumed", resumed), ("whole", whole)):
        model_file.save_checkpoint(tmp_path / name, state)
    assert (tmp_path / "resumed").read_bytes() == (tmp_path / "whole").read_bytes()
    assert resumed.history == whole.history
