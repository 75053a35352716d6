"""The filter's programs are the reference, its bound is small, and its text is what a device gets."""

import numpy as np
import pytest
from errors_at import smoothing_error
from rough import rough_layers

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.scenes.smooth_kernel import (
    GUIDED,
    HERE,
    LAYERS_READ,
    LIGHT_PLANES,
    SPLINE,
    SUMS,
    THERE,
    WEIGHTS,
    compile_smoothing,
    lower_smooth,
)
from wamnet.compiler.targets import language_named
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import smoothing
from wamnet.refimpl.network.dataset import Normalization

SCALES = Normalization(exposure_stops=-1.5)

A_PRIORI = 13 * smoothing.WHITES * 283 * 2.0**-24 + 2.0**-18
"""SMO-5: the largest error of a number of the feature image, and 2^-18 for the encoding."""


def guided(programs, layers, dtype):
    """Return the planes that `guide` writes, by name."""
    given = {
        f"{i.name}_{c}": layers[i.name][..., c].astype(dtype) for i in LAYERS_READ for c in range(i.channels)
    }
    return interpret(programs.guide, given, dtype)


def one_level(programs, planes, light, gap, dtype):
    """Return the light after a level, by the programs."""
    height, width = light[LIGHT_PLANES[0]].shape
    sums = dict.fromkeys((*SUMS, WEIGHTS), np.zeros((height, width), dtype))
    here = {f"{HERE}{name}": planes[name] for name in programs.guides}
    for spline, rows, columns in smoothing.taps(height, width, gap):
        at = np.ix_(rows, columns)
        there = {f"{THERE}{name}": planes[name][at] for name in GUIDED}
        taken = {name: plane[at] for name, plane in light.items()}
        given = {**here, **there, **taken, **sums, SPLINE: dtype(spline)}
        sums = interpret(programs.tap, given, dtype)
    return interpret(programs.mean, sums, dtype)


@pytest.mark.parametrize("gap", [1, 4])
def test_the_programs_are_the_reference(gap):
    """To the bit in float64: the sum of nine squares has NumPy's order."""
    programs, layers = lower_smooth(SCALES), rough_layers(9, 11)
    wide = {name: values.astype(np.float64) for name, values in layers.items()}
    planes = guided(programs, layers, np.float64)
    light = {name: planes[name] for name in LIGHT_PLANES}
    dim = smoothing.dimmed(wide["color"], SCALES.exposure_stops)
    assert np.array_equal(np.stack(list(light.values()), axis=-1), dim)
    wanted = smoothing.smooth_once(dim, *smoothing.guides_of(wide), gap)
    found = one_level(programs, planes, light, gap, np.float64)
    assert np.array_equal(np.stack([found[name] for name in LIGHT_PLANES], axis=-1), wanted)


def test_equal_factors_are_one_plane_and_constants_none():
    programs = lower_smooth(SCALES)
    assert programs.guides == (*GUIDED, "factor_position_x")
    constants = {node["value"] for node in programs.tap.nodes if node.op == "constant"}
    assert {1 / 0.5, 1 / 0.2} <= constants


def test_the_bound_is_small_and_below_that_of_all_layers():
    """At ordinary layers a hundredth of the clause's number, and never above it."""
    kernels = compile_smoothing(SCALES, "numpy")
    for seed in range(3):
        found = smoothing_error(kernels, rough_layers(8, 9, seed))
        assert found.max() <= A_PRIORI
        assert np.median(found) <= A_PRIORI / 100


@pytest.mark.parametrize(("target", "lanes"), [("opencl", 16), ("c", 1)])
def test_golden_source(golden, target, lanes):
    """SMO-6: arguments, loops over taps, rows that are read beyond their ends."""
    kernels = compile_smoothing(SCALES, target, lanes=lanes)
    for made in (kernels.guide, kernels.smooth):
        golden(f"ieee.{made.source_name}", made.source)


def test_manifests_name_what_was_made():
    kernels = compile_smoothing(SCALES, "opencl", lanes=8)
    for made, entry in ((kernels.guide, "wamnet_guide"), (kernels.smooth, "wamnet_smooth")):
        assert made.manifest["entry_point"] == made.entry_point == entry
        assert f"void {entry}(" in made.source
        assert list(made.contents()) == list(made.manifest["files"]) == [made.source_name]
    assert (kernels.guide.lanes, kernels.smooth.lanes) == (1, 8)
    assert kernels.encode.planes == LIGHT_PLANES


@pytest.mark.parametrize(
    ("target", "profile", "lanes", "match"),
    [
        ("wgsl", "ieee", 1, r"target wgsl, 1 pixels .* for none; smooth by"),
        ("opencl", "ieee", 3, r"target opencl, 3 pixels .* for 1, 4, 8, 16;"),
        ("opencl", "exact", 1, r"profile exact was removed"),
    ],
)
def test_what_has_no_kernel_is_refused(target, profile, lanes, match):
    with pytest.raises(CompileError, match=match):
        compile_smoothing(SCALES, language_named(target).under(profile), lanes)
