"""Grades lab 2: what a camera is by definition, and the spec's vectors."""

from __future__ import annotations

from typing import Any

import numpy as np

from wamnet.refimpl.light.scene import Camera
from wamnet.spec.conformance.case import Case, given

from ..frame import SINGLE, Check, alike, equal, expect, hold, near, numbers_of, results, still, vectors

CAMERA = Camera((0.5, 1.0, 4.0), (0.0, -0.2, 0.0), vertical_fov_deg=41.0)
"""The camera of the vectors; the image is 97 x 64."""

PLAIN = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), vertical_fov_deg=90.0)
"""A camera whose rays are known: the point (x, y) of an image of 4 x 2 is (x - 2, 1 - y) at a depth of 1."""

BOUND = 1e-12
"""A dozen operations on numbers below 10, in float64."""


def ray(student: Any, camera: Camera, *values: Any) -> tuple[Any, Any]:
    """Return origin and direction as arrays."""
    x, y, u, v, width, height = values
    pixels = still(x, y, u, v) if np.ndim(x) else (x, y, u, v)
    found = student.camera_ray(camera, *pixels, width, height)
    text = "there is no `return`" if found is None else "return both: origin, direction"
    results("CAM-2", "the result", found, 2, "a pair", text)
    return numbers_of("CAM-2", "the origin", found[0]), numbers_of("CAM-2", "the direction", found[1])


def unit(direction: Any) -> None:
    """Refuse the direction of one ray that has another length than 1."""
    numbers_of("CAM-2", "the direction of one ray", direction, (3,))
    length = np.linalg.norm(direction)
    text = "the direction is not divided by its length"
    if np.isnan(length):
        text = "nothing is left of it: forward, look_at - position, is one of the three terms that are added"
    hold("CAM-2", "the length of a direction", abs(length - 1.0) <= BOUND, "1", length, text)


def middle(student: Any) -> None:
    """The middle of the image looks at the point."""
    origin, direction = ray(student, CAMERA, 48.0, 31.0, 0.5, 1.0, 97, 64)
    position, target = np.array(CAMERA.position), np.array(CAMERA.look_at)
    begin = "rays begin at camera.position"
    expect("CAM-2", "the origin", np.broadcast_to(origin, (3,)), position, BOUND, [(target, begin)], begin)
    wanted = (target - position) / np.linalg.norm(target - position)
    unit(direction)
    likely = [
        (-wanted, "forward goes from position to look_at, not back"),
        (target / np.linalg.norm(target), "look_at is a point: forward is look_at - position"),
    ]
    _, other = ray(student, CAMERA, 48.5, 32.0, 0.0, 0.0, 97, 64)
    text = "the middle, x + u = width / 2 and y + v = height / 2, is not in the middle of the image plane"
    if alike(other, wanted, BOUND):
        text = "u is left out, v is left out, or both are exchanged: the point is (x + u, y + v)"
    text = SINGLE if near(direction, wanted) else text
    expect("CAM-2", "the direction of the middle", direction, wanted, BOUND, likely, text)


def _at(student: Any, x: float, y: float) -> Any:
    """Return the point at a depth of 1 that a ray of PLAIN goes to, in an image of 4 x 2."""
    _, direction = ray(student, PLAIN, x, y, 0.0, 0.0, 4, 2)
    unit(direction)
    return direction / -direction[2]


def across(student: Any) -> None:
    """The right edge of an image of 4 x 2 at 90 degrees is at x = 2 at a depth of 1."""
    likely = [
        ((-2.0, 0.0, -1.0), "left and right are exchanged: right = forward x up, made a unit vector"),
        ((1.0, 0.0, -1.0), "divided by the width: the field of view spans the height, so divide by height"),
        ((4.0, 0.0, -1.0), "a factor of 2: (2 (x + u) - width) / height"),
        ((2.0 * np.tan(np.pi / 2), 0.0, -1.0), "half of the field of view goes into the tangent"),
        ((2 * np.tan(90.0 / 2), 0.0, -1.0), "vertical_fov_deg is in degrees: np.radians"),
        ((np.pi / 2, 0.0, -1.0), "the tangent of half of the field of view is missing"),
    ]
    text = "the horizontal coordinate: (2 (x + u) - width) / height * tan(vertical_fov / 2)"
    found = _at(student, 4.0, 1.0)
    text = SINGLE if near(found, (2.0, 0.0, -1.0)) else text
    half = "half of the field of view goes into the tangent"
    hold("CAM-2", "the right edge", abs(found[0]) <= 1e6, "x = 2", found, half)
    expect("CAM-2", "the right edge at a depth of 1", found, (2.0, 0.0, -1.0), 1e-9, likely, text)


def upwards(student: Any) -> None:
    """The top edge of an image of 4 x 2 at 90 degrees is at y = 1 at a depth of 1."""
    likely = [
        ((0.0, -1.0, -1.0), "up and down are exchanged: row 0 is at the top"),
        ((0.0, 0.5, -1.0), "divided by the width: the field of view spans the height"),
        ((0.0, 2.0, -1.0), "a factor of 2: (height - 2 (y + v)) / height"),
    ]
    text = "the vertical coordinate: (height - 2 (y + v)) / height * tan(vertical_fov / 2)"
    expect(
        "CAM-2", "the top edge at a depth of 1", _at(student, 2.0, 0.0), (0.0, 1.0, -1.0), 1e-9, likely, text
    )


def jitter(student: Any) -> None:
    """u and v count as x and y do."""
    for name, moved in (
        ("u", (2.0, 3.0, 0.25, 0.0)),
        ("v", (2.0, 3.0, 0.0, 0.25)),
        ("u", (2.0, 3.0, 0.1, 0.0)),
    ):
        _, here = ray(student, CAMERA, *moved, 97, 64)
        x, y, u, v = moved
        _, there = ray(student, CAMERA, x + u, y + v, 0.0, 0.0, 97, 64)
        text = f"{name} is left out, taken twice, or u and v are exchanged: the point is (x + u, y + v)"
        text = SINGLE if near(here, there) else text
        expect("CAM-2", f"the direction for {name} = {u + v:g}", here, there, BOUND, (), text)


def tilted(student: Any) -> None:
    """The axes of a camera that looks down are at right angles, and of length 1."""
    lying = Camera((0.0, 3.0, 1.0), (0.0, 0.0, 0.0), vertical_fov_deg=90.0)
    _, right = ray(student, lying, 2.0, 1.0, 0.0, 0.0, 2, 2)
    ahead = np.array([0.0, -3.0, -1.0]) / 10**0.5
    wanted = (ahead + np.array([1.0, 0.0, 0.0])) / 2**0.5
    text = "right is not made a unit vector: forward x up is shorter where they are not at right angles"
    long = np.array([1.0, -3.0, -1.0]) / 11**0.5
    likely = [(long, "forward is not made a unit vector before the coordinates are added to it")]
    text = SINGLE if near(right, wanted) else text
    expect("CAM-1", "the right edge of a camera that looks down", right, wanted, BOUND, likely, text)
    camera = Camera((0.0, 2.0, 2.0), (0.0, 0.0, 0.0), vertical_fov_deg=90.0)
    _, top = ray(student, camera, 1.0, 0.0, 0.0, 0.0, 2, 2)
    forward = np.array([0.0, -1.0, -1.0]) / 2**0.5
    wanted = (forward + np.array([0.0, 1.0, -1.0]) / 2**0.5) / 2**0.5
    text = "the camera's up is right x forward, not the world's up"
    expect("CAM-1", "the top edge of a camera that looks down", top, wanted, BOUND, (), text)


def turned(student: Any) -> None:
    """A camera that is turned by a quarter about its axis has its own up."""
    camera = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), up=(1.0, 0.0, 0.0), vertical_fov_deg=90.0)
    _, top = ray(student, camera, 1.0, 0.0, 0.0, 0.0, 2, 2)
    text = "camera.up is not used: up is not always (0, 1, 0)"
    wanted = np.array([1.0, 0.0, -1.0]) / 2**0.5
    expect("CAM-1", "the top edge of a camera with up = (1, 0, 0)", top, wanted, BOUND, (), text)


def arrays(student: Any) -> None:
    """Arrays of pixels."""
    x = np.arange(6.0).reshape(2, 3)
    origin, direction = ray(student, CAMERA, x, x, 0.5, 0.5, 97, 64)
    text = "make the coordinates (..., 1) before they are multiplied with vectors: a[..., None]"
    equal("CAM-2", "the shape of directions", direction.shape, (2, 3, 3), text)
    shape = np.broadcast_shapes(origin.shape, (2, 3, 3))
    hold(
        "CAM-2", "the shape of origins", shape == (2, 3, 3), "one that goes with (2, 3, 3)", str(origin.shape)
    )
    _, last = ray(student, CAMERA, 5.0, 5.0, 0.5, 0.5, 97, 64)
    text = "a length over all rays: np.linalg.norm(..., axis=-1, keepdims=True)"
    expect("CAM-2", "the last direction of an array", direction[1, 2], last, BOUND, (), text)


def the_vectors(student: Any) -> None:
    """The cases camera.ray."""

    def answer(values: Any) -> Any:
        origin, direction = ray(student, CAMERA, *(values[name] for name in "xyuv"), 97, 64)
        return {"origin": origin, "direction": direction}

    def explain(case: Case, inputs: Any, found: Any) -> str:
        if case.expected is None or not found:
            return ""
        close = all(near(found[name], given(part.value)) for name, part in case.expected.items())
        return SINGLE if close else "/ and not //: neither coordinates nor width / height are integers"

    vectors("camera.ray", answer, explain=explain)


CHECKS = (
    Check("the middle of the image", middle),
    Check("the right edge", across),
    Check("the top edge", upwards),
    Check("a point within a pixel", jitter),
    Check("a camera that looks down", tilted),
    Check("a camera that is turned", turned),
    Check("arrays of pixels", arrays),
    Check("the spec's vectors", the_vectors),
)
"""In the order in which they explain a mistake best."""
