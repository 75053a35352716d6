"""Tests of colour spaces: the published matrix, white, and what is not converted."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from wamnet.cli.files import primaries

AP1_TO_REC_709 = [
    [1.7050509, -0.6217921, -0.0832589],
    [-0.1302564, 1.1408047, -0.0105485],
    [-0.0240033, -0.1289690, 1.1529724],
]
"""As the Academy publishes it, with seven digits."""


def test_the_published_matrix() -> None:
    _, space = primaries.SPACES["lin_ap1_scene"]
    # The Academy adapts between whites of five digits, as here: half of its last digit.
    assert np.abs(primaries.conversion(space, space[6:]) - AP1_TO_REC_709).max() <= 1e-6


def test_rec_709_is_not_converted() -> None:
    """Nor chromaticities that are rounded in another way: 0.31271, 0.32902 are D65 too."""
    assert primaries.conversion(primaries.REC_709, primaries.D65) is None
    assert primaries.conversion((*primaries.REC_709[:6], 0.31271, 0.32902), (0.31271, 0.32902)) is None


@given(st.sampled_from(sorted(primaries.SPACES)), st.floats(0.25, 0.3), st.floats(0.25, 0.4))
def test_white_stays_white(name: str, x: float, y: float) -> None:
    """Whatever is neutral in a space becomes equal red, green and blue, of luminance 1."""
    _, space = primaries.SPACES[name]
    white = np.array([x / y, 1, (1 - x - y) / y])
    rgb = np.linalg.solve(primaries.to_xyz(np.reshape(space, (4, 2))), white)
    # A few float64 roundings through matrices whose condition is below 100.
    assert np.abs(primaries.conversion(space, (x, y)) @ rgb - 1).max() <= 1e-12
