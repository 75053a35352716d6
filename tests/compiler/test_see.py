"""The program of what is seen past mirrors and glass: the reference's bits, only where it is wanted."""

from dataclasses import replace

import numpy as np
import pytest
from second_meanings import traced

from wamnet.compiler.core.loops import LISTS, STATEMENTS, TREES
from wamnet.compiler.core.passes import pipeline
from wamnet.compiler.core.profiles import profile_named
from wamnet.compiler.kernel.run import run_on
from wamnet.compiler.scenes.emit_path import path_kernel
from wamnet.compiler.scenes.encode_kernel import sees
from wamnet.compiler.scenes.lower_scene import SEEN, FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.scenes.scene_inputs import varying
from wamnet.compiler.targets import language_named
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light import render, scenes
from wamnet.refimpl.light.transport import Settings

SETTINGS = Settings(max_depth=3)
PART = Part(16, 12, 0, 12, 0, 2, 7)
TARGETS = [("opencl", 1), ("opencl", 16), ("opengl", 1), ("c", 1)]


@pytest.mark.parametrize("profile", ["ieee", "native"])
def test_all_programs_go_through_the_passes_of_the_profile(profile):
    """PTK-3: `see` and `ray` too."""
    rays = FeatureRays(4, "net")
    programs = lower_scene(scenes.canonical("glossy"), SETTINGS, seen=True, rays=rays)
    made = compile_path(programs, language_named("numpy").under(profile), groups=("color", *SEEN)).programs
    passes = profile_named(profile).passes
    expected = {name: pipeline.run(part, passes) for name, part in programs.parts.items()}
    assert list(made.parts) == ["start", "arrive", "look", "scatter", "see", "ray"]
    assert made.parts == expected
    assert (made.parts["see"] == programs.parts["see"]) == (profile == "native")


@pytest.mark.nightly(but="c-1")
@pytest.mark.parametrize(("target", "lanes"), TARGETS)
def test_a_kernel_that_is_not_asked_has_no_word_of_it(target, lanes):
    scene = scenes.canonical("glossy")
    plain, more = (lower_scene(scene, SETTINGS, seen=seen) for seen in (False, True))
    first, second = (compile_path(programs, target, lanes=lanes) for programs in (plain, more))
    assert (first.source, first.manifest) == (second.source, second.manifest)
    assert "way_going" not in first.source
    with pytest.raises(CompileError, match="planes 'seen_albedo' need the program 'see': lower the scene wi"):
        compile_path(plain, target, lanes=lanes, groups=("color", "seen_albedo"))
    asked = compile_path(more, target, lanes=lanes, groups=("color", "seen_albedo"))
    assert "way_going" in asked.source
    assert list(asked.manifest["programs"]) == ["start", "arrive", "look", "scatter", "see"]
    assert "seen_*" in asked.manifest["sums"]


@pytest.mark.parametrize(("target", "lanes"), TARGETS)
def test_a_scene_of_matte_surfaces_has_no_way(target, lanes):
    """FOL-4: no state, the first surface again; and of features only the first surface is traced."""
    programs = lower_scene(scenes.canonical("cornell"), SETTINGS, seen=True)
    made = compile_path(programs, target, lanes=lanes, groups=("color", "albedo", *SEEN))
    assert programs.most_followed == 0
    assert "way_" not in made.source
    features = compile_path(programs, target, lanes=lanes, groups=("albedo", *SEEN))
    assert made.source.count("MAX_DEPTH 3") == features.source.count("MAX_DEPTH 0") == 1


def sums(programs, numbers=None):
    kernel = compile_path(programs, "numpy", groups=("color", "albedo", *SEEN))
    return kernel.planes, NumpyExecutor().trace(kernel, PART, numbers)


def test_planes_are_the_first_hit_s_where_nothing_is_followed():
    planes, found = sums(lower_scene(scenes.canonical("cornell"), SETTINGS, seen=True))
    by_name = dict(zip(planes, found, strict=True))
    for channel in "rgb":
        assert np.array_equal(by_name[f"seen_albedo_{channel}"], by_name[f"albedo_{channel}"])


def test_a_roughness_may_move_across_the_limit():
    """PTK-16: with one kernel of both scenes, each has the sums of its own kernel."""
    shots = [scenes.glossy(0.5, roughness=roughness) for roughness in (0.05, 0.5)]
    inputs = varying(shots, SETTINGS)
    programs = lower_scene(shots[1], SETTINGS, moving=inputs, seen=True)
    apart = [sums(lower_scene(shot, SETTINGS, seen=True))[1] for shot in shots]
    assert not np.array_equal(*apart)
    for shot, expected in zip(shots, apart, strict=True):
        assert np.array_equal(sums(programs, inputs.values(shot))[1], expected)


def test_a_metal_may_become_nearly_a_mirror_in_a_scene_of_none():
    """Of the first scene by itself nothing is followed; the kernel of both has a way all the same."""
    plain = scenes.cornell()
    rough, smooth = (
        replace(plain, boxes=tuple(replace(box, material=metal) for box in plain.boxes))
        for metal in (scenes.Conductor(0.5), scenes.Conductor(0.05))
    )
    inputs = varying([rough, smooth], SETTINGS)
    assert lower_scene(rough, SETTINGS, seen=True).most_followed == 0
    programs = lower_scene(rough, SETTINGS, moving=inputs, seen=True)
    assert programs.most_followed == 3
    for shot in (rough, smooth):
        expected = sums(lower_scene(shot, SETTINGS, seen=True))[1]
        assert np.array_equal(sums(programs, inputs.values(shot))[1], expected)


def test_features_say_whether_they_see():
    assert sees(("color", "seen_depth"))
    assert not sees(("color", "normal", "depth"))


# ---- shadow rays -----------------------------------------------------------------------------------------

SHALLOW = Settings(max_depth=1)
RUN = {"width": 13, "height": 9, "first_row": 2, "rows": 6, "first_sample": 0, "samples": 1, "seed_number": 7}
"""The integers of a launch: a row is not a multiple of any number of lanes but 1."""


@pytest.mark.parametrize("target", ["opencl", "opengl", "c", "wgsl"])
def test_a_kernel_without_shadow_rays_has_no_word_of_them(target):
    scene = scenes.canonical("lone_light")
    plain, more = (lower_scene(scene, SHALLOW, shadow_rays=rays) for rays in (0, 3))
    first, second = (compile_path(programs, target) for programs in (plain, more))
    assert (first.source, first.manifest) == (second.source, second.manifest)
    assert "shadow_number" not in first.source
    with pytest.raises(CompileError, match="planes 'direct' need the program 'shadow': lower the scene with"):
        compile_path(plain, target, groups=("color", "direct"))
    asked = compile_path(more, target, groups=("color", "direct"))
    assert "shadow: a lamp's light, if nothing is in between" in asked.source
    assert list(asked.manifest["programs"]) == ["start", "arrive", "look", "scatter", "shadow"]
    assert asked.manifest["shadow_rays"] == 3
    assert "by 3 shadow rays of each camera ray" in asked.manifest["sums"]
    # A scene without lamps has no shadow ray: the layer stays 0.
    dark = lower_scene(scenes.canonical("furnace"), SHALLOW, shadow_rays=3)
    assert "shadow_number" not in compile_path(dark, target, groups=("color", "direct")).source


@pytest.mark.product
@pytest.mark.parametrize("lanes", [1, 16])
@pytest.mark.parametrize(("name", "forms"), [("minicubes", TREES), ("cornell", STATEMENTS), ("sky", LISTS)])
def test_a_kernel_runs_in_numpy_with_the_interpreter_s_bits(name, forms, lanes):
    """PTK-5, PTK-21: two shadow rays of each of four camera rays, which the path shares the first of."""
    scene = scenes.canonical("daylight" if name == "sky" else name)
    programs = lower_scene(scene, SHALLOW, forms, rays=FeatureRays(4, "net"), shadow_rays=2)
    groups = ("color", "normal", "direct")
    made = compile_path(programs, "numpy", groups=groups)
    expected = traced(made, RUN)
    assert np.array_equal(run_on(path_kernel(made.programs, lanes, groups), {}, RUN)["sums"], expected)
    alone = path_kernel(compile_path(programs, "numpy", groups=("direct",)).programs, lanes, ("direct",))
    assert np.array_equal(run_on(alone, {}, RUN)["sums"], expected[made.planes.index("direct_r") :][:3])


def test_sums_are_the_reference_s_layer():
    """Four camera rays of two shadow rays: the reference's layer, up to its sums' roundings."""
    scene = scenes.canonical("cornell")
    programs = lower_scene(scene, SHALLOW, rays=FeatureRays(4, "net"), shadow_rays=2)
    made = compile_path(programs, "numpy", groups=("direct",))
    found = NumpyExecutor().trace(made, Part(13, 9, 0, 9, 0, 1, 7)) / 4.0
    job = render.Job(13, 9, 1, 7, SHALLOW, feature_spp=4, shadow_rays=2)
    wanted = np.moveaxis(render.render(scene, job).frame["direct"], -1, 0)
    assert np.all(np.abs(found - wanted) <= 8 * 2.0**-24 * wanted)


def test_lamps_may_move():
    """PTK-16: colours and places of lamps are inputs of the program."""
    first = scenes.canonical("cornell")
    lamp = first.lights[0]
    moved = replace(lamp, color=(0.2, 0.9, 0.4), corner=tuple(x + 0.05 for x in lamp.corner))
    shots = [first, replace(first, lights=(moved, *first.lights[1:]))]
    inputs = varying(shots, SHALLOW)
    programs = lower_scene(shots[0], SHALLOW, moving=inputs, shadow_rays=2)
    made, part = compile_path(programs, "numpy", groups=("direct",)), Part(16, 12, 0, 12, 0, 2, 7)
    for shot in shots:
        own = compile_path(lower_scene(shot, SHALLOW, shadow_rays=2), "numpy", groups=("direct",))
        expected = NumpyExecutor().trace(own, part)
        assert np.array_equal(NumpyExecutor().trace(made, part, inputs.values(shot)), expected)
