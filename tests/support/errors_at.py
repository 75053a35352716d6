"""Bounds of the errors of image kernels at the numbers that they are given, by the rules of PRO-6.

1. The encoding: each number of its images, at sums over samples [`encoding_errors`].
2. The filter: each number of the feature image, at a frame's layers, tap by tap and level by level
   [`smoothing_error`].
"""

from functools import partial

import numpy as np

from wamnet.compiler.proof.bounds import Enclosure, enclose
from wamnet.compiler.scenes.encode_kernel import SAMPLES, planes_of
from wamnet.compiler.scenes.smooth_kernel import (
    FEATURE,
    GUIDED,
    HERE,
    LAYERS_READ,
    LIGHT_PLANES,
    SPLINE,
    SUMS,
    THERE,
    WEIGHTS,
)
from wamnet.compiler.targets import language_named
from wamnet.refimpl.network import smoothing


def encoding_errors(artifact, sums, samples):
    """Return the bound (H, W, C) of each image's error against float64, at planes of sums (H, W) by name."""
    given = {each: exactly(sums[each]) for each in planes_of([i.name for i in artifact.images])}
    given[SAMPLES] = exactly(np.full(next(iter(given.values())).low.shape, float(samples)))
    return encoded_errors(artifact, given)


def encoded_errors(artifact, given):
    """Return the bound (H, W, C) of each image's error, of planes that have errors themselves."""
    found = enclosed(artifact, artifact.programs, given)
    return {
        image.name: np.stack([found[f"{image.name}_{c}"].read for c in range(image.channels)], axis=-1)
        for image in artifact.images
    }


def smoothing_error(kernels, layers):
    """Return the bound (H, W, 3) of a feature image's error against float64, at layers (H, W, C) by name."""
    programs, of = kernels.smooth.programs, partial(enclosed, kernels.smooth)
    given = {
        f"{layer.name}_{c}": exactly(layers[layer.name][..., c])
        for layer in LAYERS_READ
        for c in range(layer.channels)
    }
    planes = of(programs.guide, given)
    height, width = layers[FEATURE].shape[:2]
    here = {f"{HERE}{name}": planes[name] for name in programs.guides}
    light = {name: planes[name] for name in LIGHT_PLANES}
    for level in range(smoothing.LEVELS):
        sums = dict.fromkeys((*SUMS, WEIGHTS), exactly(np.zeros((height, width))))
        for spline, rows, columns in smoothing.taps(height, width, 2**level):
            there = np.ix_(rows, columns)
            seen = {f"{THERE}{name}": _moved(planes[name], there) for name in GUIDED}
            lit = {name: _moved(light[name], there) for name in LIGHT_PLANES}
            share = {SPLINE: exactly(np.full((height, width), spline))}
            sums = of(programs.tap, {**here, **seen, **lit, **share, **sums})
        light = of(programs.mean, sums)
    return encoded_errors(kernels.encode, {**light, SAMPLES: exactly(np.ones((height, width)))})[FEATURE]


def _moved(found, there):
    """Return the enclosures (H, W) of a plane at the pixels of a tap."""
    return Enclosure(found.low[there], found.high[there], found.error[there])


def exactly(values):
    """Return the enclosure of numbers (H, W) that a kernel is given."""
    exact = np.asarray(values, np.float64)
    return Enclosure(exact, exact, np.zeros_like(exact))


def enclosed(kernel, program, given):
    """Return the enclosures of the outputs of a kernel's program, of inputs that have errors."""
    known = {i: given[str(node["name"])] for i, node in enumerate(program.nodes) if node.op == "input"}
    contract = language_named(kernel.target).under(kernel.profile).sine
    found = enclose(program, {}, contract, known=known, local=False)
    return {name: found[index] for name, index in program.outputs}
