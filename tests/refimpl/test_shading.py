"""Several materials in a scene: each surface has its own, inside and outside differ, and energy is kept."""

from dataclasses import replace

import numpy as np
import pytest
from statistical import assert_strategies_agree
from vertices import uniforms

from wamnet.refimpl import rng
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light import shading, transport
from wamnet.refimpl.light.camera import camera_basis
from wamnet.refimpl.light.materials import MATERIALS, Conductor, Dielectric, Lambertian, Mirror
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sphere
from wamnet.refimpl.light.transport import Settings

GREY = (0.5, 0.6, 0.7)
LIGHT = Light((-1.0, 1.9, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.9, 0.8), 30.0)
WALLS = (Mirror(), Conductor(0.5), None, Lambertian(), None, Conductor(0.2))
ALL = Scene(
    "all",
    Camera((0.2, 0.5, 1.8), (0.0, 0.0, 0.0), vertical_fov_deg=80.0),
    Room((-2.0,) * 3, (2.0,) * 3, (GREY,) * 6, materials=WALLS),
    boxes=(
        Box((-1.0, -0.5, 0.0), (0.4, 0.5, 0.4), GREY, material=Dielectric(1.5)),
        Box((1.0, -0.5, 0.0), (0.4, 0.5, 0.4), GREY, ((0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))),
    ),
    spheres=(
        Sphere((0.0, 0.5, 0.0), 0.4, GREY, material=Dielectric(1.8)),
        Sphere((0.0, -0.8, 0.3), 0.4, GREY, material=Conductor(0.1)),
    ),
    quads=(Quad((-2.0, -1.0, -1.5), (0.5, 0.0, 2.0), (2.0, 0.1, 0.0), GREY, material=Mirror()),),
    lights=(LIGHT,),
)
"""Surfaces of every kind of material, two numbers each."""


def arrived(scene, size=24, depths=1, dtype=np.float32):
    """Yield world, path, surface, hit and counters at each vertex of one path a pixel."""
    world = transport.build(scene, Settings(max_depth=depths), dtype)
    y, x = np.divmod(np.arange(size * size), size)
    counters = transport.Counters(rng.counter(3), R.pixel_counter(x, y), rng.counter(0))
    basis = camera_basis(scene.camera, dtype)
    path = R.start(basis, x.astype(dtype), y.astype(dtype), size, size, counters, dtype)
    for depth in range(depths):
        path, surface, hit = transport.arrive(world, path)
        yield world, path, surface, hit
        path, _ = transport.scatter(world, path, surface, hit, rng.counter(depth), counters)


METAL_FIRST = replace(
    ALL,
    room=None,
    boxes=(),
    quads=(),
    spheres=(Sphere((0.0, -0.8, 0.3), 0.4, GREY, material=Conductor(0.1)),),
)
"""A scene whose first kind of material is a metal, which at grazing angles mirrors even where it is black."""


@pytest.mark.parametrize("others", [(), (Sphere((0.0, 0.5, 0.0), 0.4, GREY),)])
def test_a_lamp_never_scatters(others):
    """SHD-1: light that meets a lamp, however flat, ends there, and no light sample is taken on it."""
    second = Light((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0), 5.0)
    scene = replace(METAL_FIRST, spheres=METAL_FIRST.spheres + others, lights=(LIGHT, second))
    world = transport.build(scene, Settings(), np.float64)
    height = 10.0 ** -np.arange(4.0)
    direction = np.stack([np.ones(4), -height, np.zeros(4)], axis=-1)
    direction /= np.sqrt(np.sum(direction**2, axis=-1, keepdims=True))
    middle = np.array([0.5, 0.0, 0.5])
    path = transport.camera_path(middle - 0.3 * direction, direction)
    path, surface, hit = transport.arrive(world, path)
    assert np.all(surface.light == 1)
    counters = transport.Counters(rng.counter(3), rng.counter(0), rng.counter(0))
    left, alive = transport.scatter(world, path, surface, hit, rng.counter(0), counters)
    assert not np.any(alive)
    assert np.array_equal(left.radiance, path.radiance)


def test_every_surface_has_its_own_material():
    """What the selection gives are the bits of only the surface's material, with its own number."""
    numbers = uniforms(24 * 24, dtype=np.float32)[:3]
    owners = [material or Lambertian() for material, _ in shading.intersection.materials_by_id(ALL)]
    for world, path, surface, hit in arrived(ALL, depths=3):
        at = shading.site(world.materials, surface, hit, path.direction, path.beta)
        found = shading.scattered(world.materials, at, hit, *numbers)
        wi, cosine = surface.normal, np.full_like(hit.t, 0.5)
        color, factor = shading.value(world.materials, at, hit, wi, cosine)
        density = shading.pdf(world.materials, at, hit, wi, cosine)
        seen = set()
        for i, material in enumerate(owners):
            lanes = np.flatnonzero(hit.surface == i)
            number = None if material.parameter is None else np.float32(material.parameter)
            own = at._replace(parameter=np.full_like(hit.t, 0.0 if number is None else number))
            own = type(own)(*(part[lanes] for part in own))
            expected = material.sample(own, *(u[lanes] for u in numbers))
            for a, b in zip(found[:3], expected[:3], strict=True):
                assert np.array_equal(a[lanes], b)
            passes = np.zeros(len(lanes), bool) if expected.through is None else expected.through
            assert np.array_equal(found.through[lanes], passes)
            expected_color, expected_factor = material.value(own, wi[lanes], cosine[lanes])
            assert np.array_equal(
                color[lanes] * factor[lanes, None], expected_color * expected_factor[:, None]
            )
            assert np.array_equal(density[lanes], material.pdf(own, wi[lanes], cosine[lanes]))
            seen |= {material.kind} if len(lanes) else set()
        assert seen == set(MATERIALS)


def test_paths_that_pass_go_on_behind_the_surface():
    """A ray that enters a glass body starts inside it: it meets the same body next, from inside."""
    one = Scene(
        "one", Camera((0.0, 0.5, 2.0), (0.0, 0.5, 0.0), vertical_fov_deg=15.0), spheres=ALL.spheres[:1]
    )
    (_, _, front, first), (world, path, surface, hit) = arrived(one, depths=2)
    entered = (first.surface == 0) & (np.sum(front.normal * path.direction, axis=-1) < 0.0)
    assert entered.sum() > 300
    assert np.all(hit.surface[entered] == 0)
    at = shading.site(world.materials, surface, hit, path.direction, path.beta)
    assert not np.any(at.outside[entered])


def test_throughput_never_grows():
    """Whatever the materials, beta stays in [0, 1] (rounding of a weight: 16 u a scattering), directions are
    unit.
    """
    for depth, (_, path, _, _) in enumerate(arrived(ALL, depths=8)):
        assert np.all(path.beta >= 0.0)
        assert np.all(path.beta <= 1.0 + 16 * depth * 2.0**-24)
        assert np.all(np.isfinite(path.radiance))
        assert np.max(np.abs(np.sum(path.direction**2, -1) - 1.0)) <= 40 * np.finfo(np.float32).eps


def agree():
    """All strategies estimate the same image of rough metal and matte walls.

    Glass and mirrors are left out: light that they send to matte walls comes in rare bright paths, and the
    mean of 256 of them is far from normal. What they weigh is tested exactly, in the tests of each."""
    metal = Conductor(0.4)
    scene = replace(
        ALL,
        room=replace(ALL.room, materials=(None, Conductor(0.6), metal, None, metal, None)),
        boxes=ALL.boxes[1:],
        spheres=tuple(replace(ball, material=metal) for ball in ALL.spheres),
        quads=(),
    )
    assert_strategies_agree(scene, depth=3, size=32)


def test_strategies_agree():
    agree()
