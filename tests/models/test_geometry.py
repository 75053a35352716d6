"""Tests of the comparison of frames: what is alike is found, what differs by a little is not."""

import numpy as np
import pytest

from wamnet.models.data import geometry as G
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Variation, varied

DEGREE_S = 8.0 / 360.0
"""Seconds in which the mini cubes turn by a degree."""


def shown(name: str, time: float, scene: str = "minicubes", **variation) -> G.Shown:
    return G.Shown(name, time, varied(canonical(scene, time=time), Variation(**variation)))


def test_a_quarter_turn_of_the_lattice_is_alike() -> None:
    """The fault that was found: frames two seconds apart differ in colours only."""
    one, other = (G.first_hits(canonical("minicubes", time=t)) for t in (0.7, 2.7))
    assert G.difference(one, other) < G.ALIKE
    text = "test frame 'test/00000 .2.7 s.': normals and depths are those of train/00000 .0.7 s."
    with pytest.raises(InputError, match=text):
        G.compare([shown("train/00000", 0.7)], {"test": [shown("test/00000", 2.7)]})


def test_a_degree_is_not_alike_and_a_hundredth_is() -> None:
    """A fifth of a degree is far beyond the tolerance of a tenth; a hundredth is below it."""
    at = {
        degrees: G.first_hits(canonical("minicubes", time=1.0 + degrees * DEGREE_S))
        for degrees in (0, 0.01, 0.2, 1)
    }
    assert G.difference(at[0], at[0.01]) < G.ALIKE
    assert G.difference(at[0], at[0.2]) >= G.ALIKE
    assert G.difference(at[0], at[1]) >= G.ALIKE


def test_test_frames_are_compared_among_each_other_over_splits() -> None:
    """Also a frame outside with one inside."""
    train = [shown("train/00000", 0.0)]
    with pytest.raises(InputError, match=r"test frame 'outside/00000 \(3.1 s\).*of test/00000"):
        G.compare(train, {"test": [shown("test/00000", 1.1)], "outside": [shown("outside/00000", 3.1)]})


def test_lamps_alone_do_not_make_a_frame_unseen() -> None:
    """What moves no geometry is refused; a turned camera is another picture."""
    train = [shown("train/00000", 1.0)]
    lights = ((0.3, 0.3, 1.0), (1.0, 0.3, 0.3))
    with pytest.raises(InputError, match="move the camera"):
        G.compare(train, {"test": [shown("test/00000", 1.0, lights=lights)]})
    found = G.compare(train, {"test": [shown("test/00000", 1.0, yaw_deg=1.0, lights=lights)]})
    assert found["test"].differing >= G.ALIKE


def test_the_nearest_by_hand() -> None:
    """Each number by itself, times modulo a turn."""
    train = [shown("train/00000", 7.75, yaw_deg=10.0), shown("train/00001", 3.0, distance=1.2)]
    found = G.compare(train, {"test": [shown("test/00000", 0.25, yaw_deg=-5.0, distance=1.1)]})["test"]
    assert found.time_s == 0.5  # differences of binary fractions are exact
    # The camera is 15 degrees of yaw from one and 5 from the other; at its height that is a little less.
    assert 4.9 < found.camera_deg < 5.0
    # A quotient of two distances, each the length of a sum: a dozen roundings of numbers near 1.
    assert abs(found.distance - (1.0 - 1.1 / 1.2)) <= 16 * np.finfo(float).eps
    assert found.lamps == 0.0
    counted: list[int] = []
    assert G.compare(train, {"test": []}, counted.append) == {}
    assert sum(counted) == 2


def test_cornell_moves() -> None:
    """A scene of the tables must not be one picture."""
    one, other = (G.first_hits(canonical("cornell", time=t)) for t in (0.0, 0.9))
    assert G.difference(one, other) >= G.ALIKE
