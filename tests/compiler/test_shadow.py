"""The program of the layer `direct`: the reference's bits, only where it is wanted; its loop in kernels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from second_meanings import traced

from wamnet.compiler.core.loops import LISTS, STATEMENTS, TREES
from wamnet.compiler.kernel.run import run_on
from wamnet.compiler.scenes.emit_path import path_kernel
from wamnet.compiler.scenes.lower_scene import FeatureRays, lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.scenes.scene_inputs import varying
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light import render, scenes
from wamnet.refimpl.light.transport import Settings

SETTINGS = Settings(max_depth=1)
RUN = {"width": 13, "height": 9, "first_row": 2, "rows": 6, "first_sample": 0, "samples": 1, "seed_number": 7}
"""The integers of a launch: a row is not a multiple of any number of lanes but 1."""


@pytest.mark.parametrize("target", ["opencl", "opengl", "c", "wgsl"])
def test_a_kernel_that_is_not_asked_has_no_word_of_it(target):
    scene = scenes.canonical("lone_light")
    plain, more = (lower_scene(scene, SETTINGS, shadow_rays=rays) for rays in (0, 3))
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
    dark = lower_scene(scenes.canonical("furnace"), SETTINGS, shadow_rays=3)
    assert "shadow_number" not in compile_path(dark, target, groups=("color", "direct")).source


@pytest.mark.product
@pytest.mark.parametrize("lanes", [1, 16])
@pytest.mark.parametrize(("name", "forms"), [("minicubes", TREES), ("cornell", STATEMENTS), ("sky", LISTS)])
def test_a_kernel_runs_in_numpy_with_the_interpreter_s_bits(name, forms, lanes):
    """PTK-5, PTK-21: two shadow rays of each of four camera rays, which the path shares the first of."""
    scene = scenes.canonical("daylight" if name == "sky" else name)
    programs = lower_scene(scene, SETTINGS, forms, rays=FeatureRays(4, "net"), shadow_rays=2)
    groups = ("color", "normal", "direct")
    made = compile_path(programs, "numpy", groups=groups)
    expected = traced(made, RUN)
    assert np.array_equal(run_on(path_kernel(made.programs, lanes, groups), {}, RUN)["sums"], expected)
    alone = path_kernel(compile_path(programs, "numpy", groups=("direct",)).programs, lanes, ("direct",))
    assert np.array_equal(run_on(alone, {}, RUN)["sums"], expected[made.planes.index("direct_r") :][:3])


def test_sums_are_the_reference_s_layer():
    """Four camera rays of two shadow rays: the reference's layer, up to its sums' roundings."""
    scene = scenes.canonical("cornell")
    programs = lower_scene(scene, SETTINGS, rays=FeatureRays(4, "net"), shadow_rays=2)
    made = compile_path(programs, "numpy", groups=("direct",))
    found = NumpyExecutor().trace(made, Part(13, 9, 0, 9, 0, 1, 7)) / 4.0
    job = render.Job(13, 9, 1, 7, SETTINGS, feature_spp=4, shadow_rays=2)
    wanted = np.moveaxis(render.render(scene, job).frame["direct"], -1, 0)
    assert np.all(np.abs(found - wanted) <= 8 * 2.0**-24 * wanted)


def test_lamps_may_move():
    """PTK-16: colours and places of lamps are inputs of the program."""
    first = scenes.canonical("cornell")
    lamp = first.lights[0]
    moved = replace(lamp, color=(0.2, 0.9, 0.4), corner=tuple(x + 0.05 for x in lamp.corner))
    shots = [first, replace(first, lights=(moved, *first.lights[1:]))]
    inputs = varying(shots, SETTINGS)
    programs = lower_scene(shots[0], SETTINGS, moving=inputs, shadow_rays=2)
    made, part = compile_path(programs, "numpy", groups=("direct",)), Part(16, 12, 0, 12, 0, 2, 7)
    for shot in shots:
        own = compile_path(lower_scene(shot, SETTINGS, shadow_rays=2), "numpy", groups=("direct",))
        expected = NumpyExecutor().trace(own, part)
        assert np.array_equal(NumpyExecutor().trace(made, part, inputs.values(shot)), expected)
