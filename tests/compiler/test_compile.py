"""From a program to an artifact: generated text, manifest, bound, refusals, files."""

import json
import re
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from wamnet.compiler import artifact as artifacts
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import ir
from wamnet.compiler.core.enclosure import round_up
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.profiles import PROFILES
from wamnet.compiler.core.trace import trace
from wamnet.compiler.languages.glsl_es import ShadertoyDenoise
from wamnet.compiler.plan import analysed
from wamnet.compiler.schedules.plain import Packed
from wamnet.compiler.targets import DENOISERS, language_named
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import dataset, siren
from wamnet.refimpl.network.denoise import Model, denoise_pixel
from wamnet.refimpl.network.window import Window


def model(widths=(24, 4, 3), window=None, omega_0=3.0):
    """Return a small model; its weights are multiples of 1/64, which no platform rounds differently."""
    drawn = siren.init(widths, omega_0, 2.0, seed=1, dtype=np.float64)
    weights = tuple((np.round(w * 64) / 64).astype(np.float32) for w in drawn.weights)
    biases = tuple((np.round(b * 64) / 64).astype(np.float32) for b in drawn.biases)
    network = siren.Siren(weights, biases, omega_0, 2.0)
    return Model(network, ("color", "normal"), window or Window(2, "zero"), dataset.Normalization())


def gathered(function, channels=3, low=-1.0, high=1.0):
    gather = Gather(Window(1, "clamp"), (Image("a", channels, low, high),))
    return trace(function, {"window": Type(shape=(channels,))}, gather)


def test_golden_program(golden):
    golden("denoise.lowered.ir.txt", ir.text(lower(model())))
    golden("denoise.analysed.ir.txt", ir.text(analysed(lower(model()))))


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("target", DENOISERS)
def test_golden_source(golden, target, profile):
    artifact = compile_program(lower(model()), language_named(target).under(profile))
    golden(f"{profile}.{artifact.source_name}", artifact.source)


def test_golden_manifest(golden):
    golden("ieee.opencl.manifest.json", artifacts.manifest_text(compile_program(lower(model()), "opencl")))


def test_lowered_model_is_the_reference():
    small = model()
    x = np.random.default_rng(0).random((7, 24), dtype=np.float32)
    assert np.array_equal(interpret(lower(small), {"window": x})["color"], denoise_pixel(small.siren, x))


def test_written_artifact_carries_its_hashes(tmp_path):
    artifact = compile_program(lower(model()), "opencl")
    written = artifacts.write(artifact, tmp_path / "new")
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == sorted(path.name for path in written)
    manifest = json.loads((tmp_path / "new" / "manifest.json").read_text())
    for name, digest in manifest["files"].items():
        content = (tmp_path / "new" / name).read_bytes()
        assert ir.sha256(content) == digest
        assert len(content) == manifest["file_bytes"][name]
    assert manifest["file_bytes"].keys() == manifest["files"].keys()
    raw = np.fromfile(tmp_path / "new" / "weights.bin", "<f4")
    assert raw.size == manifest["weights"]["count"]


# ---- refusals ------------------------------------------------------------------------------------------


def test_unknown_target_and_profile():
    with pytest.raises(
        CompileError, match=r"target 'abacus': unknown \(choose one of numpy, opencl, opengl, c"
    ):
        compile_program(lower(model()), "abacus")
    with pytest.raises(CompileError, match=r"profile 'fast': unknown \(choose one of ieee, native"):
        language_named("opencl").under("fast")


def test_sine_that_may_leave_its_domain_is_refused():
    with pytest.raises(
        CompileError,
        match=r"sine 2 of 2 \(layer 1, %\d+\) may get arguments from -20000 to 20000: the sine \(.*\) "
        r"is proven for \|x\| <= 12800; use a smaller omega_0",
    ):
        compile_program(gathered(lambda x: np.sin(2e4 * np.sin(x * 100.0))), "opencl")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: x * 1e30 * 1e30 * 1e-38, r"multiply \(%\d\) may reach 1e\+60"),
        (
            lambda x: np.sin(np.matmul(x, np.full((2, 3), 3e38, np.float32).T) * 1e-38),
            r"affine \(layer 0, %1\) may reach 9e\+38: the float32 maximum is 3.4e\+38; use",
        ),
        (lambda x: np.maximum(x * 3e38 + 3e38, 0.0), r"add \(%3\) may reach 6e\+38"),
    ],
)
@pytest.mark.parametrize("target", DENOISERS)
def test_numbers_that_may_overflow_are_refused(target, function, message):
    with pytest.raises(CompileError, match=message):
        compile_program(gathered(function), target)
    assert (
        compile_program(gathered(function), language_named(target).under("native")).manifest["bound"][
            "output"
        ]
        is None
    )


def test_overflow_before_the_sine_leaves_no_bound_on_any_target():
    """A hidden layer that overflows, so that sin(inf) is NaN, before a last layer that is small.

    No model has such weights (MOD-6); a program may.
    """
    first, wide, last = (
        np.full(shape, v, np.float32) for shape, v in (((4, 3), 1), ((4, 4), 3e38), ((3, 4), 0.01))
    )

    def network(x):
        hidden = np.sin(np.matmul(x, first.T))
        return np.matmul(np.sin(np.matmul(hidden, wide.T) * 2e-38), last.T) + 0.5

    program = gathered(network)
    assert (
        compile_program(program, language_named("opencl").under("native")).manifest["bound"]["output"] is None
    )
    with pytest.raises(CompileError, match=r"affine \(layer 1, %\d+\) may reach 1.2e\+39"):
        compile_program(program, "opencl")


def test_the_target_s_own_sine_has_no_domain():
    artifact = compile_program(gathered(lambda x: np.sin(2e4 * x)), language_named("opencl").under("native"))
    assert artifact.manifest["sine_arguments"] == [[-20100.0, 20100.0]]  # widened a little, rounded up
    assert max(artifact.manifest["bound"]["output"]) < 1


@pytest.mark.parametrize("target", DENOISERS)
def test_program_without_a_window_or_with_two_outputs_is_refused(target):
    with pytest.raises(CompileError, match="has 1 outputs and no gathered window: a kernel needs one output"):
        compile_program(trace(lambda x: x, {"window": Type()}), target)
    with pytest.raises(CompileError, match="has 2 outputs and a gathered window"):
        compile_program(gathered(lambda x: {"a": x, "b": x}), target)


def test_a_bound_needs_precise_and_no_bound_does_not():
    for profile, wanted in (("ieee", "#error the error bound needs"), ("native", "#define PRECISE\n")):
        assert wanted in compile_program(lower(model()), language_named("opengl").under(profile)).source


def test_a_bound_says_what_it_assumes():
    for target, is_said in (("glsl-es", True), ("opengl", False)):
        source = compile_program(lower(model()), target).source
        assert ("assumes   the compiler keeps the order" in source) == is_said


def test_private_bytes_are_those_of_the_declared_arrays():
    for target in ("opencl", "opengl"):
        artifact = compile_program(lower(model()), target)
        declared = re.findall(r"(?:float|PRECISE float) (?:v|part)\d+\[(\d+)\];", artifact.source)
        assert artifact.manifest["private_bytes"] == 4 * sum(map(int, declared)) == 72


def test_too_many_output_channels_for_a_fragment():
    with pytest.raises(
        CompileError, match=r"output has 33 channels: GLSL .* writes at most 32; compile for another"
    ):
        compile_program(gathered(lambda x: x, channels=33), "opengl")
    assert compile_program(gathered(lambda x: x, channels=32), "opengl").manifest["output"]["channels"] == 32


def test_a_schedule_that_writes_fewer_channels_gives_way():
    """A language may have one form with several results and one without; no target has both yet."""
    w = np.ones((5, 5), np.float32)
    reason = Packed(ShadertoyDenoise()).refusal(gathered(lambda x: x @ w, channels=5))
    assert "it writes 5 channels, of at most 4" in reason


@pytest.mark.parametrize("channels", [1, 4, 5, 8, 11])
def test_a_fragment_writes_four_channels_a_buffer(channels):
    """One `result` as ever, or numbered ones: each is declared, begins as black, and is written."""
    source = compile_program(gathered(lambda x: x * 2.0, channels=channels), "opengl").source
    names = ["result"] if channels <= 4 else [f"result_{n}" for n in range(-(-channels // 4))]
    for number, name in enumerate(names):
        assert f"layout(location = {number}) out vec4 {name};" in source
        assert f"    {name} = vec4(0.0, 0.0, 0.0, 1.0);" in source
        assert f"{name}[0] = v" in source or f"{name}[i] = v" in source
    assert source.count("layout(") == len(names)


def test_division_by_what_may_be_zero_has_no_bound():
    artifact = compile_program(gathered(lambda x: 1.0 / x), "opencl")
    assert artifact.manifest["bound"]["output"] is None
    assert "bound     none" in artifact.source


def test_sine_of_anything_is_null_in_the_manifest():
    artifact = compile_program(gathered(lambda x: np.sin(1.0 / x)), language_named("opencl").under("native"))
    assert artifact.manifest["sine_arguments"] == [[None, None]]
    assert artifact.manifest["bound"]["output"] is None


def test_the_manifest_repeats_what_an_integrator_needs():
    info = {"recipe": "{}", "trained_on_scene": "minicubes", "trained_on_seed": "1, 3, 5", "note": "x"}
    manifest = compile_program(lower(replace(model(), info=info)), "opencl").manifest
    assert sorted(manifest["info"]) == ["normalization", "recipe", "trained_on_scene"]


@given(value=st.floats(1e-30, 1e30))
@example(value=0.0026200000000000004)
@example(value=float(np.nextafter(1.0, 2.0)))
def test_round_up(value):
    """Three digits: a step is at most 1/100 of the value."""
    assert value <= round_up(value) <= value + 0.0101 * value
    assert -value <= round_up(-value) <= -value + 0.0101 * value


@pytest.mark.parametrize("value", [0.0, np.inf, 3.0])
def test_round_up_of_what_is_round_already(value):
    assert round_up(value) == value


def test_header_and_manifest_say_how_every_image_and_the_output_are_encoded():
    """Whoever feeds the kernel needs no other chapter: formulas with the model's scales, as text and JSON."""
    network = siren.init((4 * 4 * 7, 8, 3), 1.0, 1.0, seed=1)
    scales = dataset.Normalization(0.5, 7.25, (1.0, -2.0, 0.5), 3.75)
    given_model = Model(network, ("color", "depth", "position"), Window(4), scales)
    kernel = compile_program(lower(given_model), "opengl")
    encodings = [image["encoding"] for image in kernel.manifest["images"]]
    wanted = ("2^0.5", "/ 7.25", "(1.0, -2.0, 0.5)) / 3.75")
    for text, formula in zip(wanted, encodings, strict=True):
        assert text in formula
        assert formula in kernel.source
    assert kernel.manifest["output"]["encoding"].startswith("sRGB")
    assert kernel.manifest["output"]["encoding"] in kernel.source
    assert kernel.manifest["info"]["normalization"]["position_center"] == [1.0, -2.0, 0.5]
    assert "flip" in kernel.source


def fill_up(monkeypatch, method, at):
    """Let a method of paths fail at its call number `at`."""
    real, calls = getattr(artifacts.Path, method), []

    def fails(self, given):
        calls.append(given)
        if len(calls) >= at:
            raise OSError("disk full")
        return real(self, given)

    monkeypatch.setattr(artifacts.Path, method, fails)


@pytest.mark.parametrize(
    ("method", "at", "changed"), [("write_bytes", 3, ()), ("replace", 1, ()), ("replace", 2, ("denoise.cl",))]
)
def test_a_disk_that_fills_up_leaves_whole_files_and_the_old_manifest(
    tmp_path, monkeypatch, method, at, changed
):
    """At the last of the files, the first name, and the second."""
    one, two = (compile_program(lower(model(omega_0=omega)), "opencl") for omega in (3.0, 2.0))
    artifacts.write(one, tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    fill_up(monkeypatch, method, at)
    with pytest.raises(OSError, match="disk full"):
        artifacts.write(two, tmp_path)
    wanted = {**before, **{name: two.contents()[name] for name in changed}}
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == wanted


def test_a_folder_that_a_full_disk_leaves_empty_goes(tmp_path, monkeypatch):
    """And those above it that were made; one that was there stays."""
    fill_up(monkeypatch, "write_bytes", 1)
    (tmp_path / "there").mkdir()
    for folder in (tmp_path / "new" / "deep", tmp_path / "there"):
        with pytest.raises(OSError, match="disk full"):
            artifacts.write(compile_program(lower(model()), "opencl"), folder)
    assert [path.name for path in tmp_path.rglob("*")] == ["there"]


def test_two_writers_at_once_leave_whole_files(tmp_path):
    """Each of 2 x 50 writes ends well, and every file is that of one writer."""
    kernels = [compile_program(lower(model(omega_0=omega)), "opencl") for omega in (3.0, 2.0)]
    with ThreadPoolExecutor(2) as pool:
        for _ in pool.map(lambda i: artifacts.write(kernels[i % 2], tmp_path), range(100)):
            assert (tmp_path / "denoise.cl").read_text() in {kernel.source for kernel in kernels}
    texts = {artifacts.manifest_text(kernel) for kernel in kernels}
    assert (tmp_path / "manifest.json").read_text() in texts
    assert len(list(tmp_path.iterdir())) == 4
