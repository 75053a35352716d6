"""Path kernels: generated text, manifest, refusals."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from second_meanings import traced

from wamnet.compiler.core import ir
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.loops import LISTS, STATEMENTS, TREES
from wamnet.compiler.kernel.interface import SCENE_NUMBERS
from wamnet.compiler.kernel.run import run_on
from wamnet.compiler.scenes.emit_path import FRAME_GROUPS, GROUPS, path_kernel, planes
from wamnet.compiler.scenes.encode_kernel import SAMPLES, encoding_of
from wamnet.compiler.scenes.lower_scene import LIT, SEEN, SEEN_LIT, FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.scenes.scene_inputs import varying
from wamnet.compiler.targets import LANGUAGES, language_named
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Sphere
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import Normalization

TRACED = [target.name for target in LANGUAGES.values() if target.paths]
"""Targets that have path kernels."""


ENCODING = encoding_of(("color",), Normalization(exposure_stops=-1.0))
"""Encoded colour."""

ALL_GROUPS = tuple(group for group in GROUPS if group not in {*SEEN, *LIT, *SEEN_LIT})
"""Groups of planes that any programs have."""


def kernel(name="furnace", target="opencl", profile="ieee", lanes=16, settings=None, **options):
    programs = lower_scene(scenes.canonical(name), settings or Settings(max_depth=3))
    return compile_path(programs, language_named(target).under(profile), lanes, **options)


@pytest.mark.parametrize(
    ("name", "target", "profile", "lanes"),
    [
        ("furnace", "opencl", "ieee", 16),
        ("lone_light", "opencl", "native", 1),
        ("furnace", "opengl", "ieee", 1),
        ("lone_light", "opengl", "native", 1),
        ("empty", "numpy", "ieee", 1),
    ],
)
def test_golden_source(golden, name, target, profile, lanes):
    made = kernel(name, target, profile, lanes)
    golden(f"path.{name}.{profile}.{lanes}.{made.source_name}", made.source)


@pytest.mark.parametrize(("target", "lanes"), [("opencl", 16), ("opengl", 1), ("numpy", 1)])
def test_golden_source_of_a_loop(golden, target, lanes):
    """Three spheres in the furnace: a table and a loop in the text, in two programs if there is a light."""
    spheres = tuple(Sphere((0.3 * i, 0.1, 0.2 - i), 0.1 + 0.1 * i, (0.2, 0.3 * i, 0.1)) for i in range(3))
    scene = replace(scenes.canonical("furnace"), name="spheres", spheres=spheres)
    programs = lower_scene(scene, Settings(max_depth=1), LISTS)
    made = compile_path(programs, language_named(target).under("native"), lanes, groups=("color",))
    golden(f"path.spheres.native.{lanes}.{made.source_name}", made.source)


@pytest.mark.parametrize(("target", "lanes"), [("opencl", 16), ("opengl", 1), ("numpy", 1)])
def test_golden_source_of_rays(golden, target, lanes):
    """Normals of four rays that are spread: a loop of three after the samples."""
    programs = lower_scene(scenes.canonical("furnace"), Settings(max_depth=1), rays=FeatureRays(4, "net"))
    made = compile_path(programs, language_named(target).under("native"), lanes, groups=("color", "normal"))
    golden(f"path.rays.native.{lanes}.{made.source_name}", made.source)


@pytest.mark.parametrize("target", TRACED)
def test_rays_of_features_in_every_language(target):
    """PTK-19: without features, or without rays of their own, nothing of them is in the text."""
    plain, own = (
        lower_scene(scenes.canonical("furnace"), Settings(max_depth=1), rays=rays)
        for rays in (None, FeatureRays(4, "net"))
    )
    made = compile_path(own, target, groups=("color", "normal"))
    assert made.manifest["feature_rays"] == {"count": 4, "sampler": "net"}
    assert "features of 4 camera rays, net" in made.source
    if target != "numpy":
        assert "/* ray: the ray at the camera */" in made.source
        assert "/* ray:" not in compile_path(own, target, groups=("color",)).source
    text = compile_path(plain, target, groups=("color", "normal"))
    assert "camera rays" not in text.source
    assert "feature_rays" not in text.manifest
    without = replace(own, parts={name: own.parts[name] for name in plain.parts}, rays=None)
    assert compile_path(without, target, groups=("color", "normal")) == text


RUN = {"width": 13, "height": 9, "first_row": 2, "rows": 6, "first_sample": 5, "samples": 2, "seed_number": 7}
"""The integers of a launch: a row is not a multiple of any number of lanes but 1."""


@pytest.mark.product
@pytest.mark.parametrize("lanes", [1, 4, 16])
@pytest.mark.parametrize(
    ("name", "forms"),
    [("minicubes", TREES), ("glossy", LISTS), ("daylight", STATEMENTS), ("furnace", STATEMENTS)],
)
def test_a_kernel_runs_in_numpy_with_the_interpreter_s_bits(name, forms, lanes):
    """PTK-5: trees, loops, features past mirrors, features' own rays; lanes beyond the end of a row."""
    rays = FeatureRays(4, "net") if name == "furnace" else None
    scene = scenes.canonical(name)
    programs = lower_scene(scene, Settings(max_depth=3), forms, seen=name == "glossy", rays=rays)
    groups = (*FRAME_GROUPS, "alive", *(SEEN if name == "glossy" else ()))
    made = compile_path(programs, "numpy", groups=groups)
    expected = traced(made, RUN)
    found = run_on(path_kernel(made.programs, lanes, groups), {}, RUN)
    assert np.array_equal(found["sums"], expected)


@pytest.mark.parametrize("lanes", [1, 16])
def test_scene_parameters_and_images_of_a_kernel_in_numpy(lanes):
    """PTK-16, PTK-18: inputs are those of another frame; sums become an encoded image, at their pixels."""
    shots = [scenes.canonical("cornell", time=time) for time in (0.0, 2.0)]
    settings, given = Settings(max_depth=1), {**RUN, "first_row": 0, "rows": 9}
    moving = varying(shots, settings)
    kernel = path_kernel(lower_scene(shots[0], settings, moving=moving), lanes, ("color",), ENCODING)
    found = run_on(kernel, {SCENE_NUMBERS: moving.values(shots[1])}, given)["image_color"]
    own = compile_path(
        lower_scene(shots[1], settings), language_named("numpy").under("native"), groups=("color",)
    )
    sums = dict(zip(own.planes, NumpyExecutor().trace(own, Part(*given.values())), strict=True))
    encoded = interpret(ENCODING.program, {**sums, SAMPLES: np.full((9, 13), 2, np.float32)})
    expected = np.stack([encoded[f"color_{channel}"] for channel in range(3)], axis=-1)
    assert np.array_equal(found, expected)


def test_golden_manifest(golden):
    manifest = json.dumps(kernel().manifest, indent=2, sort_keys=True, allow_nan=False)
    golden("path.furnace.ieee.16.manifest.json", manifest + "\n")


def test_the_manifest_names_what_was_made():
    made = kernel("cornell", "opengl", lanes=1)
    assert made.manifest["files"] == {"path.frag": ir.sha256(made.source.encode())}
    assert made.manifest["file_bytes"] == {"path.frag": len(made.source.encode())}
    assert made.digest == ir.sha256(made.source.encode())
    assert made.manifest["planes"] == planes(
        ("color", "deviation", "albedo", "normal", "depth", "position", "direction", "unshadowed")
    )
    assert made.manifest["bound"] is None
    assert made.manifest["settings"]["max_depth"] == 3


@pytest.mark.parametrize(("target", "lanes"), [("opencl", 16), ("opencl", 1), ("opengl", 1)])
def test_a_scene_s_text_has_nothing_that_it_lacks(target, lanes):
    """Tables for many materials, cosine and roulette: by the words that they need."""
    furnace, cubes = (kernel(name, target, "native", lanes).source for name in ("furnace", "minicubes"))
    assert "table_" not in furnace
    assert "table_" in cubes
    arrivals = [text.partition("/* scatter:")[0].partition("/* arrive:")[2] for text in (furnace, cubes)]
    assert "sqrt" not in arrivals[0]
    # Only the room's walls need an equality; each box and light is one more "nearer than".
    nearer = [len(re.findall(r"= t\d+ < t\d+;", text)) for text in arrivals]
    assert nearer == [0, 27 + 2]


def test_roulette_is_absent_when_off():
    off, on = (kernel(settings=Settings(max_depth=3, roulette_depth=d)).source for d in (None, 1))
    assert "0.949999988f" not in off
    assert "0.949999988f" in on


def test_features_are_absent_when_nobody_wants_them():
    _, source = kernel(groups=("color",)).source.split("*/", 1)
    assert "look" not in source
    assert "deviation" not in source
    assert "sum_albedo" not in source


def test_emitted_sine_replaces_the_target_s():
    own, emitted = (kernel(profile=profile).source for profile in ("native", "ieee"))
    assert "sin(" in own
    assert "cos(" in own
    assert "sin(" not in emitted
    assert "cos(" not in emitted


def test_interpreter_s_text_holds_all_programs():
    text = kernel(target="numpy", lanes=1).source
    assert [line for line in text.splitlines() if re.fullmatch("# [a-z]+", line)] == [
        "# start",
        "# arrive",
        "# look",
        "# scatter",
    ]


@pytest.mark.parametrize("target", TRACED)
def test_a_scene_s_name_is_no_code(target):
    """Ends of comments, of lines, and escapes: the text differs from that of a plain name in one line."""
    evil = "a */ evil\n#error\r\\ ??/ \u2028 " + 200 * "x"
    plain, found = (
        compile_path(
            lower_scene(replace(scenes.canonical("empty"), name=name), Settings(max_depth=0)),
            target,
            groups=("color",),
        ).source.split("\n")
        for name in ("a", evil)
    )
    assert len(plain) == len(found)
    (changed,) = ((a, b) for a, b in zip(plain, found, strict=True) if a != b)
    expected = "a __ evil__error__ ___ _ " + 35 * "x"
    assert changed[1].split(", digest")[0] == changed[0].split("a, digest")[0] + expected


@pytest.mark.parametrize("target", TRACED)
def test_wrong_number_of_lanes(target):
    with pytest.raises(
        CompileError, match=rf"target {target} cannot trace 3 paths at once \(choose one of 1"
    ):
        kernel(target=target, lanes=3)


def test_unknown_group_of_planes():
    with pytest.raises(
        CompileError, match=r"planes 'heat': unknown \(choose one of color, deviation, albedo"
    ):
        kernel(groups=("heat",))


def test_more_planes_than_a_fragment_writes():
    """PTK-8, EXP-2."""
    for target, words in (
        ("opengl", r"GLSL 3\.30, .* writes at most 32"),
        ("glsl-es", r"GLSL ES 3\.00, .* at most"),
    ):
        with pytest.raises(CompileError, match=rf"adds up \d+ planes: {words}"):
            kernel(target=target, lanes=1, groups=ALL_GROUPS)
    assert len(kernel(lanes=1, groups=ALL_GROUPS).planes) > 32


def test_unknown_target_and_profile():
    with pytest.raises(CompileError, match="target 'abacus': unknown"):
        kernel(target="abacus")
    with pytest.raises(CompileError, match="profile 'fast': unknown"):
        kernel(profile="fast")
