"""The filter on executors: within its bound of the reference, on hard frames too, and only where it may."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from errors_at import smoothing_error
from rough import rough_layers

from wamnet.compiler.scenes.smooth_kernel import compile_smoothing
from wamnet.kernels.devices.passes import Filter
from wamnet.kernels.run.denoise_on import Denoiser, denoise_on, images_of
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import FIRST_HIT, Frame
from wamnet.refimpl.network import dataset, smoothing
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

SCALES = Normalization(exposure_stops=-1.5)

SIZES = [(1, 1), (1, 37), (33, 1), (5, 16), (19, 35)]
"""Heights and widths: one pixel wide or high, whole vectors and parts of them, taps beyond both ends."""


BOUNDS: dict[bytes, np.ndarray] = {}
"""Bounds by the bytes of the layers: they are those of all executors, and take half a second."""


def bound_of(kernels, layers):
    """Return the bound (H, W, 3) at layers, in which NaN is 0."""
    key = b"".join(values.tobytes() for values in layers.values())
    if key not in BOUNDS:
        BOUNDS[key] = smoothing_error(kernels, layers)
    return BOUNDS[key]


def excess(kernels, found, layers, scales=SCALES):
    """Return the largest error of a feature image (H, W, 3), in units of its bound."""
    clean = {name: dataset.known(values) for name, values in layers.items()}
    wide = {name: values.astype(np.float64) for name, values in clean.items()}
    light = smoothing.dimmed(wide.pop("color"), scales.exposure_stops)
    wanted = dataset.encode_color(smoothing.smooth(light, wide, smoothing.LEVELS), scales)
    return float((np.abs(found - wanted) / bound_of(kernels, clean)).max())


@pytest.fixture(params=["numpy", "opencl", "c", "opengl"])
def device(request, executor_named):
    return executor_named(request.param)


def lanes_of(device):
    return (1, device.lanes) if device.lanes > 1 else (1,)


@pytest.mark.parametrize("size", SIZES)
def test_frames_are_within_the_bound(device, size):
    for lanes in lanes_of(device):
        kernels = compile_smoothing(SCALES, device.name, lanes=lanes)
        layers = rough_layers(*size)
        assert excess(kernels, Filter(device, kernels).image(layers), layers) <= 1


@pytest.mark.product
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan, 3e38, -3e38, 1e-42])
@pytest.mark.parametrize("name", ["color", "normal", "albedo", "position", "depth"])
def test_hard_numbers_are_within_the_bound(device, name, value):
    """Ends of what float32 holds and beyond, NaN, denormals; in one pixel, in a row, in half of a frame."""
    kernels = compile_smoothing(SCALES, device.name, lanes=lanes_of(device)[-1])
    layers = rough_layers(6, 18)
    for place in (np.s_[4, 4], np.s_[1], np.s_[:, 10:]):
        layers[name][place] = value
    found = Filter(device, kernels).image(layers)
    assert np.isfinite(found).all()
    assert excess(kernels, found, layers) <= 1


def test_a_frame_of_misses_is_within_the_bound(device):
    """All guides are 0: the filter is the spline, also across the border of the picture."""
    layers = {name: np.zeros_like(values) for name, values in rough_layers(6, 21).items()}
    layers["color"] = rough_layers(6, 21)["color"]
    kernels = compile_smoothing(SCALES, device.name, lanes=lanes_of(device)[-1])
    assert excess(kernels, Filter(device, kernels).image(layers), layers) <= 1


# ---- where it is used ---------------------------------------------------------------------------------


def model_of(kit, features):
    """Return an untrained model of some features."""
    return kit.model((6,), features, scales=SCALES)


def whole_frame(layers, dtype=np.float32):
    """Return a frame in which other surfaces are seen past mirrors and glass."""
    seen = {name: -layers[first][::-1] for name, first in FIRST_HIT.items()}
    return Frame({name: values.astype(dtype) for name, values in {**layers, **seen}.items()})


def test_a_device_smooths_the_features_that_are_smoothed(executor_named, kit):
    """In the model's order; others are the reference's to the bit."""
    device, frame = executor_named("opencl"), whole_frame(rough_layers(9, 20))
    model = model_of(kit, ("normal", "seen_smoothed", "color", "smoothed"))
    found, wanted = Denoiser(device, model).images(frame), images_of(model, frame)
    assert list(found) == list(model.features)
    kernels = compile_smoothing(SCALES, "opencl")
    for name in ("normal", "color"):
        assert np.array_equal(found[name], wanted[name])
    for name, past in (("smoothed", ""), ("seen_smoothed", "seen_")):
        layers = {"color": frame["color"]}
        layers |= {guide: frame[past + guide] for guide in ("normal", "albedo", "position", "depth")}
        assert excess(kernels, found[name], layers) <= 1
        assert not np.array_equal(found[name], wanted[name])  # another order of sums
    picture = denoise_on(device, model, frame).image
    assert np.array_equal(picture, denoise_on(device, model, frame, images=found).image)
    assert not np.array_equal(picture, denoise_on(device, model, frame, images=wanted).image)


def test_images_made_in_blocks_of_rows_have_no_seams(kit, monkeypatch):
    """A pixel that is smoothed reads others; one that is encoded by itself may be in any block."""
    frame, model = whole_frame(rough_layers(9, 20)), model_of(kit, ("normal", "color", "smoothed"))
    wanted = images_of(model, frame)
    monkeypatch.setattr("wamnet.kernels.run.denoise_on.BLOCK_PIXELS", 2 * frame.width)
    for name, image in images_of(model, frame).items():
        assert np.array_equal(image, wanted[name]), name


def test_the_reference_smooths_where_bits_count(executor_named, kit, monkeypatch):
    """SMO-7: other executors, integers, layers of float64, and models without such features."""
    device, frame = executor_named("opencl"), whole_frame(rough_layers(4, 5))
    model = model_of(kit, ("color", "smoothed"))
    assert Denoiser(device, model).filter(frame) is not None
    assert Denoiser(executor_named("numpy"), model).filter(frame) is None
    assert Denoiser(device, model).filter(whole_frame(rough_layers(4, 5), np.float64)) is None
    assert Denoiser(device, model_of(kit, ("color",))).filter(frame) is None
    monkeypatch.setattr(Model, "is_whole", True)
    assert Denoiser(device, model).filter(frame) is None


def test_a_frame_that_lacks_a_guide_is_refused_as_ever(executor_named, kit):
    layers = whole_frame(rough_layers(3, 4)).layers
    frame = Frame({name: values for name, values in layers.items() if name != "depth"})
    with pytest.raises(InputError, match="layer 'depth' is missing"):
        denoise_on(executor_named("opencl"), model_of(kit, ("smoothed",)), frame)


def test_frames_are_encoded_beside_each_other_with_the_same_bits():
    pairs = [(frame, frame) for frame in (Frame(rough_layers(9, 12, seed)) for seed in range(5))]
    given = (pairs, ("smoothed", "normal"), Window(3, "clamp"), SCALES)
    with ThreadPoolExecutor(3) as pool:
        assert dataset.build(*given, pool.map).digest == dataset.build(*given).digest
