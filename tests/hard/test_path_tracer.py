"""Scenes that break careless path tracers: each step of each path of every executor, within its range.

Pictures of such scenes prove little, being noise; `compare_paths` starts each step from the kernel's own
state and has a range for every number of the result.
"""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.kernels.judge import compare_paths
from wamnet.kernels.judge.compare_paths import View
from wamnet.refimpl.light import render
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sphere, validate
from wamnet.refimpl.light.transport import Settings

VIEW = View(24, 16, seed=3)

GREY = (0.6, 0.6, 0.6)

CAMERA = Camera((0.0, 0.4, 3.0), (0.0, 0.0, 0.0), vertical_fov_deg=50.0)


def room(albedo: float = 0.7, half: float = 1.0) -> Room:
    """Return a cube-shaped room around the origin."""
    return Room((-half,) * 3, (half,) * 3, ((albedo,) * 3,) * 6)


def ceiling(y: float, edge: float = 0.6, power: float = 8.0) -> Light:
    """Return a square light at height y that shines down."""
    low = -edge / 2
    return Light((low, y, low), (edge, 0.0, 0.0), (0.0, 0.0, edge), (1.0, 0.9, 0.8), power)


def at(scale: float, far: float = 0.0) -> Scene:
    """Return a room with a ball, a box and a light, `scale` units large, `far` units from the origin."""

    def place(x: float, y: float, z: float) -> tuple[float, float, float]:
        return (far + scale * x, scale * y, far + scale * z)

    low, high = place(-1, -1, -1), place(1, 1, 1)
    lamp = Light(
        place(-0.3, 0.98, -0.3),
        (0.6 * scale, 0.0, 0.0),
        (0.0, 0.0, 0.6 * scale),
        (1.0, 1.0, 1.0),
        8.0 * scale**2,
    )
    return Scene(
        "placed",
        Camera(place(0.0, 0.4, 3.0), place(0, 0, 0), vertical_fov_deg=50.0),
        Room(low, high, (GREY,) * 6),
        boxes=(Box(place(0.4, -0.7, 0.2), (0.3 * scale,) * 3, GREY),),
        spheres=(Sphere(place(-0.4, -0.6, 0.0), 0.4 * scale, GREY),),
        lights=(lamp,),
    )


ALONG_AN_AXIS = Camera((0.25, 0.0, 3.0), (0.25, 0.0, 0.0), vertical_fov_deg=40.0)
"""Rays in the planes of faces at x = 0.25 and y = 0, through corners, and parallel to the axes."""

SCENES = {
    "a thousandth": at(1e-3),
    "a thousand": at(1e3),
    "far from the origin": at(1.0, far=500.0),
    "rays in planes, through edges and corners": Scene(
        "planes",
        ALONG_AN_AXIS,
        room(half=2.0),
        boxes=(Box((0.0, -0.25, 0.0), (0.25, 0.25, 0.25), GREY), Box((0.5, 0.25, 0.0), (0.25,) * 3, GREY)),
        quads=(Quad((-1.0, 0.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 1.0), GREY),),
        lights=(ceiling(1.9),),
    ),
    "thin boxes": Scene(
        "thin",
        CAMERA,
        room(half=2.0),
        boxes=tuple(Box((0.0, -0.5 + 0.2 * i, 0.0), (0.8, 1e-4 / 3**i, 0.8), GREY) for i in range(4)),
        lights=(ceiling(1.9),),
    ),
    "a light that touches the ceiling": Scene("touching", CAMERA, room(), lights=(ceiling(1.0),)),
    "a tiny bright light": Scene(
        "tiny", CAMERA, room(), spheres=(Sphere((0.0, -0.5, 0.0), 0.3, GREY),), lights=(ceiling(0.9, 1e-3),)
    ),
    "a closed room that is nearly white": Scene(
        "white", Camera((0.0, 0.1, 0.8), (0.0, 0.0, 0.0)), room(0.999), lights=(ceiling(0.98),)
    ),
    "touching and coincident surfaces": Scene(
        "coincident",
        CAMERA,
        room(),
        boxes=(Box((0.0, -0.75, 0.0), (0.25,) * 3, GREY), Box((0.5, -0.75, 0.0), (0.25,) * 3, GREY)),
        quads=(Quad((-0.25, -0.5, -0.25), (0.0, 0.0, 0.5), (0.5, 0.0, 0.0), (0.2, 0.8, 0.2)),),
        spheres=(Sphere((-0.5, -0.8, 0.2), 0.2, GREY),),
        lights=(ceiling(0.98),),
    ),
}
"""Hard scenes by what is hard about them."""


@pytest.mark.product
@pytest.mark.parametrize("name", SCENES)
def test_every_step_is_within_its_range(executor, name):
    """Nothing is unexplained; where many decisions lie on their threshold, they are counted, not hidden."""
    report = compare_paths.compare_paths(executor, validate(SCENES[name]), Settings(max_depth=3), VIEW)
    assert report.passed, [str(example) for example in report.examples]
    assert report.depths[0].paths == 24 * 16
    assert sum(depth.unexplained for depth in report.depths) == 0


@pytest.mark.nightly(but="numpy")
def test_a_long_run_of_roulette(executor):
    """Ten scatterings in a nearly white room, most of them under roulette, on a few paths."""
    settings = Settings(max_depth=10, roulette_depth=2)
    scene = validate(SCENES["a closed room that is nearly white"])
    report = compare_paths.compare_paths(executor, scene, settings, View(4, 2, seed=1))
    assert report.passed, [str(example) for example in report.examples]
    assert len(report.depths) == 11
    assert report.depths[-1].paths > 0


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_pictures_are_numbers(name, dtype):
    """Every layer is finite, radiance not negative, normals at most of length 1 up to rounding."""
    found = render.render(validate(SCENES[name]), Job(16, 12, spp=4, seed=2, dtype=dtype)).frame
    for values in found.layers.values():
        assert np.isfinite(values).all()
    assert found["color"].min() >= 0.0
    # A normal is a rounded unit vector: three squares, two sums, a root and a division of it, and a mean.
    assert np.linalg.norm(found["normal"], axis=-1).max() <= 1.0 + 16 * 2.0**-24


@pytest.mark.parametrize("far", [0.0, 500.0])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_light_does_not_leak(scale, far):
    """A box around the camera is black inside, whatever the units: nothing shines through its walls."""
    world = at(scale, far if scale == 1.0 else 0.0)
    shell = Box(world.camera.position, (0.2 * scale,) * 3, GREY)
    found = render.render(validate(replace(world, boxes=(shell,))), Job(16, 12, spp=4, seed=4)).frame
    np.testing.assert_array_equal(found["color"], 0.0)
