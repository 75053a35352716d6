"""Tests of frames: access by name, size, and every refusal."""

import numpy as np
import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import LAYERS, Frame, validate


def full_frame(height: int = 2, width: int = 3, dtype: type = np.float32) -> Frame:
    """Return a frame with every layer, each pixel another value."""
    layers = {
        name: np.arange(height * width * layer.channels, dtype=dtype).reshape(height, width, layer.channels)
        for name, layer in LAYERS.items()
    }
    return Frame(layers, {"scene": "test"})


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_good_frame_passes(dtype: type) -> None:
    """All layers, both element types, non-square."""
    frame = full_frame(2, 3, dtype)
    validate(frame)
    assert (frame.height, frame.width) == (2, 3)
    assert frame["depth"].shape == (2, 3, 1)
    assert "depth" in frame
    assert "alpha" not in frame


def test_negative_radiance_is_data() -> None:
    """FRM-6: a filter upstream may have made it."""
    frame = Frame({"color": np.full((2, 3, 3), -0.25)})
    validate(frame)
    assert np.all(frame["color"] == -0.25)


def test_a_missing_layer_is_named() -> None:
    """The message names the wish and what there is."""
    frame = Frame({"color": np.zeros((1, 1, 3))})
    with pytest.raises(InputError, match="layers of the frame 'color': layer 'albedo' is missing"):
        frame["albedo"]
    with pytest.raises(InputError, match=r"layer 'direct' is missing \(render it: --shadow-rays 1, or"):
        frame["direct"]


def test_an_empty_frame_is_refused() -> None:
    """A frame without layers has no size."""
    with pytest.raises(InputError, match="frame: has no layers"):
        validate(Frame({}))


def test_an_unknown_layer_is_refused() -> None:
    """The known names are listed."""
    with pytest.raises(
        InputError, match=r"layer 'alpha': unknown \(choose one of color, albedo, normal, depth"
    ):
        validate(Frame({"alpha": np.zeros((1, 1, 1))}))


@pytest.mark.parametrize(
    "values", [np.zeros((1, 1, 3), np.uint8), np.zeros((1, 1, 3), np.float16), [[[0.0, 0.0, 0.0]]]]
)
def test_other_element_types_are_refused(values: object) -> None:
    """Integers, halves and lists."""
    with pytest.raises(
        InputError, match=r"element type of layer 'color' '(uint8|float16|list)': must be float32"
    ):
        validate(Frame({"color": values}))  # type: ignore[dict-item]


@pytest.mark.parametrize("shape", [(2, 2), (2, 2, 1), (2, 2, 4), (0, 2, 3), (2, 0, 3)])
def test_wrong_shapes_are_refused(shape: tuple[int, ...]) -> None:
    """Wrong number of axes, of channels, and no pixel."""
    with pytest.raises(InputError, match=r"shape of layer 'color' \(.*must be \(height, width, 3\)"):
        validate(Frame({"color": np.zeros(shape)}))


def test_different_sizes_are_refused() -> None:
    """The message gives each layer's width x height."""
    frame = Frame({"color": np.zeros((2, 3, 3)), "depth": np.zeros((3, 2, 1))})
    with pytest.raises(
        InputError, match="sizes of the layers 'color 3x2, depth 2x3': all layers must have the same size"
    ):
        validate(frame)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_pixels_that_are_not_finite_are_counted(value: float) -> None:
    """The first pixel in reading order is named by x and y, and a pixel with two bad channels counts once."""
    frame = full_frame(4, 5)
    frame.layers["normal"][2, 1, 1:] = value
    frame.layers["normal"][3, 0, 0] = value
    with pytest.raises(
        InputError, match=rf"layer 'normal' at x=1, y=2 \(first of 2 such pixels\) {value}: every"
    ):
        validate(frame)
