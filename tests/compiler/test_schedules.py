"""Schedules: what each holds, what it says when it does not, and where the tiled ones put the weights."""

from __future__ import annotations

import re

import numpy as np
import pytest

from wamnet.compiler.artifact import schedule_text
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.languages.glsl_es import GLSLES
from wamnet.compiler.schedules.names import FORMER, parse, split
from wamnet.compiler.schedules.plain import WEIGHTS_A_TEXEL, Packed
from wamnet.compiler.schedules.schedules import LARGEST_PRIVATE
from wamnet.compiler.schedules.straight import LARGEST_WEIGHTS
from wamnet.compiler.targets import TARGETS, language_named
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.denoise import denoise_pixel
from wamnet.refimpl.network.window import Window


def gathered(function, channels=(3,), size=1, border="clamp"):
    images = tuple(Image(f"i{number}", count, -1.0, 1.0) for number, count in enumerate(channels))
    gather = Gather(Window(size, border), images)
    return trace(function, {"window": Type(shape=(gather.n_inputs,))}, gather)


def rounded(d_out, d_in, seed=1):
    """Return a matrix of multiples of 1/64, which no platform rounds differently."""
    return np.random.default_rng(seed).integers(-32, 32, (d_out, d_in)).astype(np.float32) / 64


def small(border="zero"):
    first, second = rounded(5, 4 * 3), rounded(2, 5, 2)
    function = lambda x: np.clip(np.sin(x @ first.T + rounded(5, 1)[:, 0]) @ second.T, 0.0, 1.0)  # noqa: E731
    return gathered(function, (2, 1), 2, border)


W = rounded(3, 3)
"""A square matrix, which fits the window and a layer."""

SHARED = gathered(lambda x: np.sin(x @ W.T) @ W.T)
"""A program that applies one matrix to the window and to a layer."""


@pytest.mark.parametrize(
    ("target", "profile", "name", "border"),
    [
        ("opencl", "ieee", "vector:16", "clamp"),
        ("opencl", "ieee", "tile:16", "zero"),
        ("c", "ieee", "tile:16", "zero"),
        ("c", "ieee", "tile:4", "clamp"),
    ],
)
def test_golden_tiles(golden, target, profile, name, border):
    found = compile_program(small(border), language_named(target).under(profile), name)
    golden(f"{name.replace(':', '')}.{found.source_name}", found.source)


@pytest.mark.parametrize(
    ("target", "name", "border"),
    [
        ("opencl", "group:1", "clamp"),
        ("opencl", "group:4", "zero"),
        ("opengl", "group:1", "zero"),
        ("opengl", "group:4", "clamp"),
    ],
)
def test_golden_groups(golden, target, name, border):
    found = compile_program(small(border), target, name)
    golden(f"{name.replace(':', '')}.{found.source_name}", found.source)


def test_a_compute_shader_says_what_it_is():
    found = compile_program(small(), "opengl", "group:4")
    assert found.source_name == "denoise.comp"
    assert found.manifest["language"] == "GLSL 4.30, compute shader"
    assert found.manifest["files"].keys() == {"denoise.comp", "weights.bin"}
    assert found.manifest["schedule"]["group"] == [16, 8]
    # The tile of 16 * 4 + 1 columns and 8 + 1 rows holds an image's two channels at most.
    assert found.manifest["schedule"]["shared_bytes"] == 4 * 65 * 9 * 2
    assert "GLSL 4.30, compute shader. Generated" in found.source
    assert compile_program(small(), "opengl").source_name == "denoise.frag"


def wide(hidden, channels=(3,), size=1):
    layers = [size * size * sum(channels), *hidden, 1]
    network = siren.init(layers, 3.0, 3.0, seed=1, dtype=np.float32)
    return gathered(lambda x: denoise_pixel(network, x), channels, size)


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        (wide([200, 100]), r"two layers of 4 pixels are 1200 numbers, of at most 1024: no registers"),
        (wide([120] * 12), r"it unrolls to \d+ products, of at most 32768: drivers take minutes"),
        (wide([4], (4,), 33), r"its tile takes 61440 bytes that a group shares, of at most 32768"),
        (SHARED, "a matrix is applied to the window and to a layer, which need it in two orders"),
    ],
)
def test_what_a_group_does_not_hold_is_plain_with_the_reason(program, reason):
    found = compile_program(program, "opencl", "group:4").manifest["schedule"]
    assert found["name"] in ("plain", "group:1")
    assert found["asked"] == "group:4"
    assert re.match(reason, found["reason"])
    assert ("group" in found) == (found["name"] == "group:1")


def test_golden_inlined(golden):
    golden("inlined.denoise.frag", compile_program(small(), "opengl", "inlined").source)


def test_inlined_weights_are_in_the_source_alone():
    found = compile_program(small(), "opengl", "inlined")
    assert found.weights.size == found.manifest["weights"]["count"] == 0
    assert found.manifest["weights"]["layout"] == []
    assert "weight_texture" not in found.source
    assert found.manifest["arguments"] in found.source.replace("\n *           ", "\n")


def test_too_many_weights_to_inline_are_plain():
    program = gathered(lambda x: np.sin(x @ rounded(16000, 3).T) @ rounded(2, 16000).T)
    found = compile_program(program, "opengl", "inlined").manifest["schedule"]
    assert (found["name"], found["asked"]) == ("plain", "inlined")
    assert found["reason"].startswith(f"it has 80000 weights, of at most {LARGEST_WEIGHTS}:")


def test_the_manifest_says_what_was_picked():
    found = compile_program(small(), "opencl", "tile:8").manifest
    assert found["schedule"]["name"] == "tile:8"
    assert found["schedule"]["pixels"] == 6
    assert "block by block" in found["weights"]["order"]
    assert schedule_text(found["schedule"]).startswith("tile:8: the same for 16 registers of 8 numbers")
    plain = compile_program(small(), "opencl").manifest
    assert plain["schedule"] == {"name": "plain", "idea": OPENCL_PLAIN.idea, "pixels": 1}
    assert plain["bound"] == found["bound"]


OPENCL_PLAIN = language_named("opencl").schedules["plain"]
"""The first rung."""


def test_unknown_schedule_is_told_with_the_known_ones():
    known = (
        "plain, vector:16, tile:16, tile:8, tile:4, fft:16, fft:8, fft:4, dot:16, group:1, group:2, group:4"
    )
    with pytest.raises(
        CompileError, match=rf"schedule 'fast': unknown .*choose one of {known}, groupdot:4\)$"
    ):
        compile_program(small(), "opencl", schedule="fast")
    of_tiles = r"did you mean 'tile:8'\? choose one of tile:16, tile:8, tile:4\)$"
    for name in ("tile:3", "tile"):
        with pytest.raises(CompileError, match=rf"schedule '{name}': unknown .*{of_tiles}"):
            compile_program(small(), "opencl", schedule=name)
    with pytest.raises(CompileError, match=r"schedule 'tile:16': unknown .*choose one of plain\)"):
        compile_program(small(), "numpy", schedule="tile:16")


@pytest.mark.parametrize(("former", "present"), FORMER.items())
def test_a_former_name_is_told_with_the_present_one(former, present):
    target = "opengl" if former.startswith("compute") else "opencl"
    with pytest.raises(CompileError, match=rf"schedule '{former}': unknown .*its name is {present} now\)$"):
        compile_program(small(), target, schedule=former)
    assert language_named(target).schedules[present].name == present


def test_names_are_families_with_their_parameter():
    names = {name for target in TARGETS for name in language_named(target).schedules}
    assert {parse(name) for name in names} > {("plain", None), ("inlined", None), ("tile", 8), ("group", 1)}
    for name in names:
        for form in ("", "whole8", "window6+rank12"):
            kernel = f"opencl:{name}:{form}" if form else f"opencl:{name}"
            assert split(kernel) == ("opencl", name, form)


REFUSED = {
    "component": (gathered(lambda x: x[..., 0] * 2.0), "%1 is component, which has no form on vectors"),
    "equal": (gathered(lambda x: np.where(x @ W.T == 0.5, 1.0, x @ W.T)), "%3 is equal, which has no form"),
    "truth": (
        gathered(lambda x: np.where((y := x @ W.T) < 0.5, np.sin(y) @ rounded(3, 3).T, y)),
        r"%\d+ is bool\[3\], which %\d+ in another loop reads",
    ),
    "window": (gathered(lambda x: x * 2.0), r"something \w+ an affine map reads the window"),
    "output": (gathered(lambda x: x), "the output is not computed"),
    "shared": (SHARED, "a matrix is applied to the window and to a layer, which need it in two orders"),
    "private": (
        gathered(lambda x: np.sin(x @ rounded(12000, 3).T) @ rounded(1, 12000).T),
        rf"its arrays take \d+ bytes a work item, of at most {LARGEST_PRIVATE}",
    ),
}
"""Programs that the tiled schedule does not hold, and the reason."""


@pytest.mark.parametrize("target", ["opencl", "c"])
@pytest.mark.parametrize("case", REFUSED)
def test_what_a_tile_does_not_hold_is_plain_with_the_reason(case, target):
    program, reason = REFUSED[case]
    found, plain = (compile_program(program, target, name) for name in ("tile:16", "plain"))
    assert found.manifest["schedule"]["name"] == "plain"
    assert found.manifest["schedule"]["asked"] == "tile:16"
    assert re.match(reason, found.manifest["schedule"]["reason"])
    assert re.search(rf"\(not tile:16: {reason}", schedule_text(found.manifest["schedule"]))
    assert found.source == plain.source


@pytest.mark.parametrize(
    ("target", "array"), [("opencl", r"float number|float16 v\d+"), ("c", r"float v\d+")]
)
def test_private_bytes_of_a_tile_are_those_of_its_arrays(target, array):
    artifact = compile_program(small(), target, "tile:16")
    sizes = {"PIXELS": 14, "LANES": 16, "WINDOW_SIZE": 2, "PATCH_WIDTH": 15}
    arrays = re.findall(rf"(float patch_\w+|{array})\[([^]]+)\];", artifact.source)
    counts = [np.prod([sizes.get(word) or int(word) for word in text.split(" * ")]) for _, text in arrays]
    numbers = [
        16 * n if kind.startswith("float16") else n for (kind, _), n in zip(arrays, counts, strict=True)
    ]
    assert len(numbers) == 2 + 4
    assert artifact.manifest["private_bytes"] == 4 * sum(numbers)


def test_products_may_be_fused_in_tiles_of_c_only():
    """KER-16, KER-22: the header states it, whatever the compiler's default is."""
    for schedule, word in (("tile:8", "fast"), ("plain", "off")):
        source = compile_program(small(), "c", schedule=schedule).source
        assert f'#pragma GCC optimize("fp-contract={word}")' in source
        assert f"#pragma STDC FP_CONTRACT {'ON' if word == 'fast' else 'OFF'}" in source


# ---- weights by four -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def program(kit):
    """Nine taps of a channel to five neurons to three."""
    return kit.denoiser(kit.network([9, 5, 3], (3.0, 3.0)), {"a": 1}, 3, "clamp")


def test_rows_of_neurons_are_filled_up_to_whole_texels(program):
    schedule = Packed(GLSLES())
    packed, slots = schedule.pack(program), schedule.layout(program)
    assert packed.size % 4 == 0
    for name, array in program.parameters.items():
        slot = slots[name]
        assert slot.offset % 4 == 0
        stored = packed[slot.offset : slot.offset + np.prod(slot.shape)].reshape(slot.shape)
        neurons = len(array)
        assert np.array_equal(stored[..., :neurons], array.T)
        assert slot.shape[-1] % 4 == 0
        assert not stored[..., neurons:].any()
    assert slots["W0"].shape == (9, 8)


def test_a_packed_kernel_says_how_its_texture_is_read(program):
    artifact = compile_program(program, "glsl-es", schedule="packed")
    assert artifact.manifest["schedule"][WEIGHTS_A_TEXEL] == 4
    assert "weight_texture: RGBA32F, 1024 texels wide" in artifact.source
    assert Packed(GLSLES()).refusal(program) == ""
    assert Packed(GLSLES()).private_bytes(program) > 0
