"""Exported languages (EXP-3, EXP-5): denoiser, paths and encoding of each, run and checked against bounds.

A runner whose tools are missing skips its tests and says so; `make test` names those that must be there.
"""

import subprocess
from dataclasses import asdict, replace

import numpy as np
import pytest
from errors_at import encoding_errors
from kit import encoded

from wamnet import kernels
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.scenes.encode_kernel import compile_encode, layers_of
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.scenes.scene_inputs import varying
from wamnet.compiler.targets import DENOISERS, LANGUAGES, language_named
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.export import check, targets, tools
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization, encode_sums
from wamnet.refimpl.network.whole import check_whole, forward_whole, rounded
from wamnet.refimpl.network.window import Window, all_windows, pad

pytestmark = pytest.mark.apart  # drivers of many targets stay in memory

FEATURES = ("color", "normal")
"""What paths add up here."""


@pytest.fixture(
    scope="module", params=[pytest.param(n, marks=pytest.mark.needs("devices")) for n in targets.RUNNERS]
)
def runner(request):
    try:
        opened = targets.RUNNERS[request.param]()
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    with opened:
        yield opened


@pytest.fixture(scope="module")
def case(kit):
    program = kit.denoiser(kit.network([100, 7, 5, 3], (3.0, 5.0)), {"a": 3, "b": 1}, 5, "zero")
    random = np.random.default_rng(1)
    images = {name: random.uniform(-2, 2, (6, 9, n)).astype(np.float32) for name, n in (("a", 3), ("b", 1))}
    return program, images


@pytest.fixture(scope="module")
def traced():
    """Programs of a scene, a part of its picture, and the interpreter's sums."""
    programs, part = (
        lower_scene(canonical("minicubes", time=1.0), Settings(max_depth=2)),
        Part(12, 9, 1, 8, 0, 1, 7),
    )
    with kernels.open_executor("numpy") as executor:
        sums = executor.trace(compile_path(programs, "numpy", groups=layers_of(FEATURES)), part)
    return programs, part, sums


def test_denoiser_keeps_its_bound(runner, kit, case):
    """EXP-3, and by way of SPIR-V and HLSL EXP-4."""
    assert kit.excess(runner, *case, compile_program(case[0], runner.name)) <= 1


@pytest.mark.product
@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("schedule", ["tile:4", "group:1", "group:4"])
def test_tiles_and_groups_keep_their_bound(runner, kit, schedule, border):
    """KER-18 in every language that has them: pictures of several groups, none of them whole.

    A channel more than a tile holds at once, so that the tile is filled twice.
    """
    if schedule not in LANGUAGES[runner.name].schedules:
        pytest.skip("its language has no such schedule")
    program = kit.denoiser(kit.network([45, 7, 5, 3], (3.0, 5.0)), {"a": 4, "b": 1}, 3, border)
    artifact = compile_program(program, runner.name, schedule)
    assert artifact.manifest["schedule"]["name"] == schedule
    width, height = artifact.manifest["schedule"].get("group", (1, 1))
    random = np.random.default_rng(2)
    size = (height + 3, artifact.manifest["schedule"]["pixels"] * width + 5)
    for shape in (size, (1, 1)):
        images = {
            name: random.uniform(-2, 2, (*shape, n)).astype(np.float32) for name, n in (("a", 4), ("b", 1))
        }
        assert kit.excess(runner, program, images, artifact) <= 1


@pytest.mark.product
@pytest.mark.parametrize("border", ["clamp", "zero"])
@pytest.mark.parametrize("schedule", ["plain", "group:1", "group:4", "groupdot:4"])
def test_integers_have_the_reference_s_digest(runner, schedule, border):
    """WHO-10: the SHA-256 of the picture is the same in every language."""
    if schedule not in LANGUAGES[runner.name].schedules:
        pytest.skip("its language has no groups, or no products of bytes")
    network = rounded(siren.init([45, 7, 5, 3], 3.0, 5.0, seed=1), 3)
    numbers = np.random.default_rng(3).integers(-127, 128, (11, 37, 5)).astype(np.float32)
    found, held = denoised(runner, schedule, network, Window(3, border), {"a": 4, "b": 1}, numbers)
    assert len(np.unique(held)) > 50
    assert check.digest_of(found) == check.digest_of(held)


def denoised(runner, schedule, network, window, channels, numbers):
    """Return a runner's picture and the reference's, of numbers (H, W, C) that are images side by side."""
    images = tuple(Image(name, n, -127.0, 127.0, whole=True) for name, n in channels.items())
    gather = Gather(window, images)
    types = {"window": Type(shape=(gather.n_inputs,))}
    program = trace(lambda window: forward_whole(network, window), types, gather)
    artifact = compile_program(program, language_named(runner.name).under("native"), schedule)
    assert artifact.manifest["schedule"]["name"] == schedule
    pieces = np.split(numbers, np.cumsum(list(channels.values()))[:-1], axis=-1)
    found = runner.run(artifact, {name: piece.copy() for name, piece in zip(channels, pieces, strict=True)})
    held = forward_whole(network, all_windows(pad(numbers, window), window))
    return found, held.astype(np.float32)


@pytest.mark.product
@pytest.mark.parametrize("shape", [(1, 1), (9, 35)])
@pytest.mark.parametrize("border", ["clamp", "zero"])
def test_bytes_at_the_ends_of_their_range(runner, shape, border):
    """WHO-12: all numbers and weights are 127 or -127, in 21 channels, so that a tile is filled twice.

    A byte that is taken for one without a sign, or that carries into the next one, is found by each product.
    """
    if "groupdot:4" not in LANGUAGES[runner.name].schedules:
        pytest.skip("its language has no products of bytes")
    random = np.random.default_rng(4)
    network = rounded(siren.init([4 * 21, 9, 6, 3], 3.0, 5.0, seed=1), 2)
    ends = [np.where(random.random(w.shape) < 0.5, -127, 127).astype(w.dtype) for w in network.weights[:-1]]
    middle = np.full(3, 2.0 ** (15 + network.fraction), np.float32)
    biases, weights = (*network.biases[:-1], middle), (*ends, network.weights[-1])
    network = replace(network, weights=weights, biases=biases)
    check_whole(network)
    numbers = random.choice(np.float32([-127, 127]), (*shape, 21))
    channels = {"a": 4, "b": 1, "c": 16}
    found, held = denoised(runner, "groupdot:4", network, Window(2, border), channels, numbers)
    assert len(np.unique(held)) >= min(50, held.size)
    assert found.tobytes() == held.tobytes()


@pytest.mark.nightly(but=("cuda", "wgsl", "glsl-compute"))
def test_a_first_layer_in_two_passes(runner, kit, case):
    """The bound of both passes is against the program that was cut."""
    from wamnet.compiler.core.interpret import interpret
    from wamnet.compiler.plan import analysed

    program, images = case
    if runner.name == "godot":
        pytest.skip("it has one pass for the denoiser")
    artifact = compile_program(program, runner.name, rank=3)
    (value,) = interpret(analysed(program), {"window": kit.windows(program, images)}, np.float64).values()
    error = np.abs(runner.run(artifact, images) - value)
    assert (error <= artifact.manifest["bound"]["output"]).all()


def test_paths_are_the_interpreter_s(runner, traced):
    """All decisions fall alike here: a number of a path of three surfaces is then off only by rounding.

    Some 8,000 operations of float32, each wrong by 2^-24 of values near 1: 8000 * 2^-24 = 5e-4.
    """
    if runner.name == "godot":
        pytest.skip("its paths are passes that write features: test_exports.py runs them")
    programs, part, sums = traced
    found = runner.trace(compile_path(programs, runner.name, groups=layers_of(FEATURES)), part)
    assert found.shape == sums.shape
    assert np.abs(found - sums).max() <= 8000 * 2.0**-24


@pytest.mark.nightly(but=("c99", "wgsl", "glsl-vulkan"))
def test_paths_of_two_moments(runner):
    """PTK-18: each language reads the numbers of the moment that it is given, by one kernel."""
    if runner.name == "godot":
        pytest.skip("its passes have no place for numbers of a scene")
    programs, rows, part, wanted = moments()
    kernel = compile_path(programs, runner.name, groups=layers_of(FEATURES))
    for row, sums in zip(rows, wanted, strict=True):
        assert np.abs(runner.trace(kernel, part, row) - sums).max() <= 8000 * 2.0**-24
    assert np.array_equal(runner.trace(kernel, part), runner.trace(kernel, part, rows[0]))


def moments():
    """Return programs of a scene that moves, numbers of two moments, a part, and the interpreter's sums."""
    settings, part = Settings(max_depth=2), Part(12, 9, 1, 8, 0, 1, 7)
    shots = [canonical("minicubes", time=time) for time in (1.05, 2.6)]
    inputs = varying(shots, settings)
    programs = lower_scene(shots[0], settings, moving=inputs)
    rows = [inputs.values(scene) for scene in shots]
    with kernels.open_executor("numpy") as executor:
        kernel = compile_path(programs, "numpy", groups=layers_of(FEATURES))
        sums = [executor.trace(kernel, part, row) for row in rows]
    assert np.abs(sums[0] - sums[1]).max() > 0.1
    return programs, rows, part, sums


def test_encoding_keeps_its_bound(runner, traced):
    if runner.name == "godot":
        pytest.skip("its encodings are parts of its paths' passes: test_exports.py runs them")
    kernel, sums = compile_encode(FEATURES, Normalization(), runner.name), traced[2]
    planes = dict(zip(kernel.planes, sums, strict=True))
    bound, found = encoding_errors(kernel, planes, 1), encoded(runner, kernel, sums, 1)
    layers = {
        name: np.moveaxis(sums[3 * i : 3 * i + 3], 0, -1).astype(np.float64)
        for i, name in enumerate(FEATURES)
    }
    held = encode_sums(layers, 1.0, FEATURES, Normalization())
    for name in FEATURES:
        assert (np.abs(found[name] - held[name]) <= bound[name]).all()


@pytest.mark.nightly(but=("c99", "wgsl", "glsl-es"))
def test_pipelines_are_the_composition_of_the_kernels(runner, kit):
    """PPL-7: what one kernel returns is what the next one is given, to the bit."""
    if runner.name == "godot":
        pytest.skip("its paths are passes that write features: test_exports.py runs them")
    kit.check_composed(runner)


def test_every_exported_language_has_a_runner():
    """But Shadertoy, whose tabs have no place for weights but their text: test_exports.py runs them."""
    held = {name.partition("/")[0] for name in targets.RUNNERS}
    assert {name for name in LANGUAGES if name not in DENOISERS and ":" not in name} - {"shadertoy"} <= held


SANITIZERS = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
"""Any access outside an array and any undefined operation ends the program."""

MAIN = """
#include <stdio.h>
#include "path.h"
#include "encode.h"

static float sums[{sums}], color[{color}], normal[{color}];

int main(void)
{{
    const wamnet_part part = {{{width}, {height}, {first_row}, {rows}, 0u, 1, 7u}};
    wamnet_trace(&part, sums);
    wamnet_encode(sums, color, normal, {width}, {rows}, 1);
    for (int i = 0; i < {color}; ++i) {{
        printf("%a\\n", (double)color[i]);
    }}
    return 0;
}}
"""
"""A program that has both headers pasted in, with arrays that are just large enough."""


@pytest.mark.nightly
def test_c_is_clean_under_warnings_and_sanitizers(traced, tmp_path):
    programs, part, sums = traced
    encoder = compile_encode(FEATURES, Normalization(), "c")
    (tmp_path / "path.h").write_text(compile_path(programs, "c", groups=layers_of(FEATURES)).source)
    (tmp_path / "encode.h").write_text(encoder.source)
    sizes = {"sums": sums.size, "color": 3 * part.width * part.rows, **asdict(part)}
    (tmp_path / "main.c").write_text(MAIN.format(**sizes))
    try:
        options = ["-std=c99", "-O1", "-g", *targets.WARNINGS[1:-1], *SANITIZERS]
        tools.run("cc", *options, "-o", "main", "main.c", "-lm", folder=tmp_path)
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    printed = subprocess.run(["./main"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    found = np.array([float.fromhex(line) for line in printed.split()]).reshape(part.rows, part.width, 3)
    bound = encoding_errors(encoder, dict(zip(encoder.planes, sums, strict=True)), 1)["color"]
    color = np.moveaxis(sums[:3], 0, -1).astype(np.float64)
    held = encode_sums({"color": color}, 1.0, ("color",), Normalization())["color"]
    # The compiler keeps the interpreter's order of operations, without contraction: the sums are its bits.
    assert (np.abs(found - held) <= bound).all()
