"""The program of what is seen past mirrors and glass: the reference's bits, only where it is wanted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.core.passes import pipeline
from wamnet.compiler.core.profiles import profile_named
from wamnet.compiler.scenes.encode_kernel import sees
from wamnet.compiler.scenes.lower_scene import SEEN, FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.scenes.scene_inputs import varying
from wamnet.compiler.targets import language_named
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light import scenes
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
