"""The experiment on shadow rays: what its rows read, and its scores of a frame."""

from __future__ import annotations

import numpy as np
import shadows

from wamnet.refimpl.frame import Frame


def test_direct_light_takes_the_place_of_the_unshadowed_one():
    found = {name: row.layers[4:] for name, row in shadows.ROWS.items()}
    assert found["4 camera rays, no shadow ray"] == ("unshadowed",)
    assert found["4 camera rays, 16 shadow rays"] == ("direct",)
    assert found["4 camera rays, 16 shadow rays, both layers"] == ("unshadowed", "direct")
    assert set(shadows.SHOWN) <= set(shadows.ROWS)


def test_scores_are_of_the_penumbra_too():
    """A difference of 0.1 in the left half, which is in the penumbra, and none in the right half."""
    grey = np.full((32, 32, 3), 0.2, np.float32)
    half = np.where(np.arange(32) < 16, 0.5, 1.0)[None, :, None] * np.ones_like(grey)
    reference = Frame({"color": grey, "unshadowed": np.ones_like(grey), "direct": half})
    target = shadows.to_display(grey)
    found = shadows.scored(target + 0.1 * (half < 1.0), reference)
    assert abs(found["penumbra"] - 25.5) <= 255.0 * 2.0**-20  # float32 in, a tenth of 255
    assert 0.0 < found["blurred"] < found["penumbra"]
