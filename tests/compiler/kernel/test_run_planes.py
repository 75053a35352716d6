"""Kernels on images and planes in NumPy: the interpreter's bits at sizes that are multiples of nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rough import rough_layers
from second_meanings import INTERPRETED

from wamnet.compiler.kernel.kernel import FLOAT, Let, Store, const, load, name
from wamnet.compiler.kernel.run import run_on
from wamnet.compiler.kernel.verify import KernelError, verify
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.history_kernel import CAMERAS, FIRST, MOTION, PAST, compile_history
from wamnet.compiler.scenes.smooth_kernel import compile_smoothing, smooth_kernel
from wamnet.refimpl.network.dataset import Normalization

SCALES = Normalization(exposure_stops=-1.5)
SIZES = [(5, 7), (3, 17), (1, 1), (2, 33)]


def interpreted(made, arrays, integers, planes):
    """Return what the interpreter writes; `planes`: how many there are of each array that is written."""
    size = integers["height"], integers["width"]
    held = {**arrays, **{key: np.zeros((count, *size), np.float32) for key, count in planes.items()}}
    INTERPRETED[made.role](made, held, integers)
    return {key: held[key] for key in planes}


def same_bits(a, b):
    return np.array_equal(a.view(np.uint32), b.view(np.uint32))


def filled(values, lanes):
    """Return planes (P, H, W) with rows of whole work items; what is beyond the image is NaN."""
    beyond = -values.shape[-1] % lanes
    return np.pad(values, ((0, 0), (0, 0), (0, beyond)), constant_values=np.nan)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_the_filter(height, width):
    """SMO-6: a level of 1, 4 and 16 pixels in a work item reads nothing beyond the image."""
    made = compile_smoothing(SCALES, "numpy")
    layers = {f"image_{key}": values for key, values in rough_layers(height, width).items()}
    layers["image_depth"] = layers["image_depth"].reshape(height, width, 1)
    size = {"width": width, "height": height, "row_stride": width}
    guides = {"guides": len(made.guide.programs.guides), "light": 3}
    wanted = interpreted(made.guide, layers, size, guides)
    found = run_on(made.guide.kernel, layers, size)
    assert all(same_bits(found[key], wanted[key]) for key in guides)
    for lanes in (1, 4, 16):
        kernel = smooth_kernel(made.smooth.programs, lanes)
        for gap in (1, 4):
            expected = interpreted(made.smooth, wanted, {**size, "gap": gap}, {"result": 3})["result"]
            arrays = {key: filled(values, lanes) for key, values in wanted.items()}
            sizes = {**size, "gap": gap, "row_stride": arrays["light"].shape[-1]}
            assert same_bits(run_on(kernel, arrays, sizes)["result"][..., :width].copy(), expected)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_the_history(height, width):
    """HIS-8: pixels move by less and by more than the image, and some are behind the camera."""
    random, made = np.random.default_rng(height), compile_history("numpy")
    first = random.uniform(-2, 2, (len(FIRST), height, width)).astype(np.float32)
    past = random.uniform(0, 1, (len(PAST), height, width)).astype(np.float32)
    first[0], past[0] = random.integers(0, 3, (2, height, width))
    first[4:7], past[1:4] = 0.6, 0.6
    motions = np.zeros((3, len(MOTION)), np.float32)
    motions[:, [0, 4, 8, MOTION.index("rests"), MOTION.index("found")]] = 1
    motions[:, MOTION.index("limit")] = 8
    camera = [0, 0, -3, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.7]
    arrays = {
        "first": first,
        "past": past,
        "image_color": random.random((height, width, 3), np.float32),
        "motions": motions,
        "cameras": np.array([*camera, 0.1, *camera[1:]], np.float32),
    }
    assert len(arrays["cameras"]) == len(CAMERAS)
    size = {"width": width, "height": height, "row_stride": width}
    with np.errstate(all="ignore"):
        expected = interpreted(made, arrays, size, {"result": len(PAST)})["result"]
    assert same_bits(run_on(made.kernel, arrays, size)["result"], expected)


@pytest.mark.parametrize(("height", "width"), SIZES)
def test_the_encoding(height, width):
    """PPL-5: all channels of all images, of planes that are more than it reads."""
    planes = ("alive", "color_r", "color_g", "color_b", "depth", "normal_x", "normal_y", "normal_z")
    made = compile_encode(("color", "normal", "depth"), SCALES, "numpy", planes=planes)
    sums = np.random.default_rng(1).uniform(-1, 3, (len(planes), height, width)).astype(np.float32)
    size = {"width": width, "height": height, "sample_count": 3}
    written = {
        f"image_{image.name}": np.zeros((height, width, image.channels), np.float32) for image in made.images
    }
    INTERPRETED[made.role](made, {"sums": sums, **written}, size)
    found = run_on(made.kernel, {"sums": sums}, size)
    assert found.keys() == written.keys()
    assert all(same_bits(found[key], written[key]) for key in written)


def test_a_read_beyond_the_image_is_an_error():
    made = compile_smoothing(SCALES, "numpy").smooth
    kernel, row = made.kernel, load("light", 0, name("y"), name("x") + 1)
    wrong = replace(kernel, body=(*kernel.body, Let("beyond", row)))
    planes = {key: np.zeros((count, 2, 3), np.float32) for key, count in (("guides", 10), ("light", 3))}
    with pytest.raises(KernelError, match="index 3 is beyond light, which has 3, in the item of pixel"):
        run_on(wrong, planes, {"width": 3, "height": 2, "row_stride": 3, "gap": 1})


WRONG = {
    "a written plane": (Let("a", load("result", 0, name("y"), name("x"))), "the result is read"),
    "a plane to read": (Store("light", (const(0), name("y"), name("x")), const(0.0)), "which is read only"),
    "a plane too much": (Let("a", load("light", 3, name("y"), name("x"))), "index 3 is beyond light"),
    "two indices": (Let("a", load("light", name("y"), name("x"))), "light has 3 indices, not 2"),
    "a row at one index": (
        Let("a", load("light", 0, name("y"), name("x"), kind=FLOAT.of(4)).lane(4)),
        "component 4 does not exist",
    ),
}


@pytest.mark.parametrize(("statement", "message"), WRONG.values(), ids=WRONG)
def test_what_is_refused(statement, message):
    kernel = compile_smoothing(SCALES, "numpy").smooth.kernel
    with pytest.raises(KernelError, match=message):
        verify(replace(kernel, body=(*kernel.body, statement)))
