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


TYPES = [np.zeros((1, 1, 3), np.uint8), np.zeros((1, 1, 3), np.float16), [[[0.0, 0.0, 0.0]]]]
SHAPES = [(2, 2), (2, 2, 1), (2, 2, 4), (0, 2, 3), (2, 0, 3)]
"""Integers, halves and lists; a wrong number of axes, of channels, and no pixel."""


@pytest.mark.parametrize(
    ("layers", "rule"),
    [
        ({}, "frame: has no layers"),
        ({"alpha": np.zeros((1, 1, 1))}, r"layer 'alpha': unknown \(choose one of color, albedo, normal, d"),
        ({"color": np.zeros((2, 3, 3)), "depth": np.zeros((3, 2, 1))},
         "sizes of the layers 'color 3x2, depth 2x3': all layers must have the same size"),
        *(({"color": values}, r"element type of layer 'color' '(uint8|float16|list)': must be float32")
          for values in TYPES),
        *(({"color": np.zeros(shape)}, r"shape of layer 'color' \(.*must be \(height, width, 3\)")
          for shape in SHAPES),
    ],
)  # fmt: skip
def test_what_is_no_frame_is_refused(layers: dict[str, np.ndarray], rule: str) -> None:
    """Known names are listed, and sizes are given as width x height."""
    with pytest.raises(InputError, match=rule):
        validate(Frame(layers))


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
