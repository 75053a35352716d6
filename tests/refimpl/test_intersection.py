"""Rays against primitives: the slow, obvious answer in exact or double arithmetic, and the hard cases."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from wamnet.refimpl import rng, vectors
from wamnet.refimpl.light import intersection as I
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sphere
from wamnet.refimpl.light.shapes import box

GREY = (0.5, 0.5, 0.5)
CAMERA = Camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
TYPES = [np.float32, np.float64]
SCALES = [1e-3, 1.0, 1e3]


def scene_of(**parts) -> Scene:
    return Scene("test", CAMERA, **parts)


def hit(scene: Scene, origin, direction, dtype=np.float64):
    """Return (t, surface id, Surface) of one ray; the direction is normalised here."""
    o = np.array([origin], dtype)
    d = vectors.normalize(np.array([direction], np.float64)).astype(dtype)
    geometry = I.build(scene, dtype)
    found = I.closest_hit(geometry, o, d)
    surface = I.surface_at(geometry, found, o, d)
    for part in (found.t, *surface[:4]):
        assert np.all(np.isfinite(part)), "no ray may give NaN or infinity"
    return float(found.t[0]), int(found.surface[0]), surface


COORDINATES = st.integers(-40, 40).map(lambda n: n / 8)


# -- one primitive, against exact arithmetic
# -------------------------------------------------------------------


def exact_box_distance(center, half, origin, direction):
    """The slab method in rationals: the obvious interval intersection; None for a miss (direction
    unnormalised)."""
    near, far = None, None
    for c, h, o, d in zip(center, half, origin, direction, strict=True):
        c, h, o, d = (Fraction(x) for x in (c, h, o, d))
        if d == 0:
            if abs(o - c) > h:
                return None
            continue
        a, b = sorted(((c - h - o) / d, (c + h - o) / d))
        near = a if near is None else max(near, a)
        far = b if far is None else min(far, b)
    if near > far or far <= 0:
        return None
    return near if near > 0 else far


@given(*(st.tuples(*(COORDINATES,) * 3) for _ in range(2)), st.tuples(*(st.integers(-4, 4),) * 3))
def test_box_equals_rational_arithmetic(center, origin, direction):
    """Where the rational ray clearly hits or clearly misses, so does float64, at the same distance.

    "Clearly": a box that is larger or smaller by one part in a million gives the same verdict.
    """
    assume(any(direction))
    half = (1.0, 0.75, 1.25)
    verdicts = [
        exact_box_distance(center, [h * f for h in half], origin, direction)
        for f in (1 - 1e-6, 1.0, 1 + 1e-6)
    ]
    assume(len({v is None for v in verdicts}) == 1)
    t, _, surface = hit(scene_of(boxes=(Box(center, half, GREY),)), origin, direction)
    if verdicts[1] is None:
        assert t == I.MISS
        return
    length = sum(d * d for d in direction) ** 0.5
    expected = float(verdicts[1]) * length
    # Coordinates below 16, distances below 32: normalisation, reciprocal, product, two sums: 8 ulps of 32.
    assert abs(t - expected) <= 8 * 32 * 2.0**-52
    assert np.max(np.abs(surface.normal)) == 1.0
    assert vectors.dot(surface.normal[0], np.array(direction, float)) < 0.0


@given(st.tuples(*(COORDINATES,) * 3), st.tuples(*(COORDINATES,) * 3), st.tuples(*(st.integers(-4, 4),) * 3))
def test_sphere_equals_rational_discriminant(center, origin, direction):
    """Hit or miss by the sign of the exact discriminant, and the point found lies on the sphere."""
    assume(any(direction))
    radius = 1.5
    o, c, d = ([Fraction(x) for x in v] for v in (origin, center, direction))
    f = [a - b for a, b in zip(o, c, strict=True)]
    dd, fd, ff = (sum(a * b for a, b in zip(u, v, strict=True)) for u, v in ((d, d), (f, d), (f, f)))
    discriminant = fd * fd - dd * (ff - Fraction(radius) ** 2)
    inside, ahead = ff < Fraction(radius) ** 2, fd < 0
    assume(
        abs(discriminant) > Fraction(1, 10**6) * dd and abs(ff - Fraction(radius) ** 2) > Fraction(1, 10**6)
    )
    t, _, surface = hit(scene_of(spheres=(Sphere(center, radius, GREY),)), origin, direction)
    assert (t < I.MISS) == (discriminant > 0 and (inside or ahead))
    if t < I.MISS:
        offset = surface.point[0] - np.array(center)
        # t is accurate to some ulps of 32 divided by the sine at which the ray meets the sphere (> 1e-3 by
        # the assumption).
        assert abs(np.linalg.norm(offset) - radius) <= 16 * 32 * 2.0**-52 * 1e3
        assert vectors.dot(surface.normal[0], np.array(direction, float)) < 0.0


@given(st.tuples(*(st.integers(-7, 7),) * 2), st.tuples(*(st.integers(-3, 3),) * 2), st.integers(1, 4))
def test_quad_equals_rational_arithmetic(foot, slope, height):
    """A ray from above meets the unit-spaced quad where plane geometry says; its edges belong to it."""
    quad = Quad((-2.0, 0.0, -1.0), (4.0, 0.0, 0.0), (0.0, 0.0, 2.0), GREY)
    origin = (foot[0] / 4 + slope[0] * height, height, foot[1] / 4 + slope[1] * height)
    t, surface_id, surface = hit(scene_of(quads=(quad,)), origin, (-slope[0], -1.0, -slope[1]))
    x, z = foot[0] / 4, foot[1] / 4
    assume(abs(x) != 2.0 and abs(z) != 1.0)
    if abs(x) < 2.0 and abs(z) < 1.0:
        expected = height * (1 + slope[0] ** 2 + slope[1] ** 2) ** 0.5
        assert abs(t - expected) <= 16 * 32 * 2.0**-52  # coordinates below 32, some 16 roundings
        assert surface_id == 0
        assert surface.normal[0].tolist() == [0.0, 1.0, 0.0]
    else:
        assert t == I.MISS


# -- hard cases
# ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rays_parallel_to_an_axis(dtype, scale, axis, sign):
    """ISC-5. Two zero components, of both signs: the distance is exact, and a ray beside the box misses."""
    scene = scene_of(boxes=(Box((0.0, 0.0, 0.0), (scale,) * 3, GREY),))
    direction = np.full(3, np.copysign(0.0, sign))
    direction[axis] = sign
    origin = np.zeros(3)
    origin[axis] = -3.0 * sign * scale
    t, _, surface = hit(scene, origin, direction, dtype)
    # A difference, a product, a sum.
    assert t == pytest.approx(2.0 * scale, rel=4 * float(np.finfo(dtype).eps))
    assert surface.normal[0, axis] == -sign
    origin[(axis + 1) % 3] = 1.001 * scale
    assert hit(scene, origin, direction, dtype)[0] == np.dtype(dtype).type(I.MISS)


@pytest.mark.parametrize("dtype", TYPES)
def test_ray_in_the_plane_of_a_face_is_no_nan(dtype):
    """A ray that runs along a face, or in the plane of a quad: hit or miss, but finite."""
    box = scene_of(boxes=(Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), GREY),))
    quad = scene_of(quads=(Quad((-1.0, 0.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), GREY),))
    for scene, origin in ((box, (-3.0, 1.0, 0.0)), (box, (-3.0, 1.0, 1.0)), (quad, (-3.0, 0.0, 0.0))):
        hit(scene, origin, (1.0, 0.0, 0.0), dtype)


@pytest.mark.parametrize("dtype", TYPES)
def test_ray_through_corner_and_edge(dtype):
    scene = scene_of(boxes=(Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), GREY),))
    for target in ((1.0, 1.0, 1.0), (1.0, 1.0, 0.0)):
        origin = 3.0 * np.array(target)
        _, _, surface = hit(scene, origin, -np.array(target), dtype)
        assert np.sum(np.abs(surface.normal)) == 1.0  # one face is chosen, not a mixture


def test_coincident_faces_belong_to_the_primitive_listed_first():
    lower = Box((0.0, -1.0, 0.0), (1.0, 1.0, 1.0), GREY)
    floor = Quad((-5.0, 0.0, -5.0), (10.0, 0.0, 0.0), (0.0, 0.0, 10.0), GREY)
    _, first, _ = hit(scene_of(boxes=(lower,), quads=(floor,)), (0.0, 3.0, 0.0), (0.0, -1.0, 0.0))
    assert first == 0
    twins = scene_of(quads=(floor, replace(floor, reflectance=(0.1, 0.1, 0.1))))
    assert hit(twins, (0.0, 3.0, 0.0), (0.0, -1.0, 0.0))[1] == 0


def test_room_is_there_from_inside_alone():
    room = Room(
        (-1.0, -1.0, -1.0),
        (1.0, 1.0, 1.0),
        ((0.1,) * 3, (0.2,) * 3, (0.3,) * 3, (0.4,) * 3, (0.5,) * 3, (0.6,) * 3),
    )
    scene = scene_of(room=room)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            direction = np.zeros(3)
            direction[axis] = sign
            for start in (0.0, -3.0):  # from inside, and from outside through the opposite wall
                t, wall, surface = hit(scene, start * direction, direction)
                assert t == 1.0 - start
                assert wall == 2 * axis + (sign > 0)
                # One rounding.
                assert surface.reflectance[0, 0] == pytest.approx(0.1 * (wall + 1), rel=2.0**-52)
                assert surface.normal[0, axis] == -sign
    assert hit(scene, (3.0, 3.0, 0.0), (-1.0, 0.0, 0.0))[0] == I.MISS


@pytest.mark.parametrize("dtype", TYPES)
def test_ray_from_inside_a_box_meets_the_face_that_it_leaves_by(dtype):
    """From inside, the normal is that of the exit: the axis with the least (half extent -+ origin) /
    |direction|."""
    scene = scene_of(boxes=(Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), GREY),))
    origin = (0.5, -0.25, 1.0)
    # Along (-1, 1, 1): exits x at 1.5, y at 2.25, z at 2; along (1, -4, 1): 0.5, 0.4375, 2; along (0.1, 0.1,
    # -1): 5, 22.5, 4.
    for direction, axis in (((-1.0, 1.0, 1.0), 0), ((1.0, -4.0, 1.0), 1), ((0.1, 0.1, -1.0), 2)):
        _, _, surface = hit(scene, origin, direction, dtype)
        expected = np.zeros(3)
        expected[axis] = -np.sign(direction[axis])
        assert np.array_equal(surface.normal[0], expected)


def test_light_is_black_behind():
    scene = scene_of(
        lights=(Light((-1.0, 0.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.5, 0.25), 4.0),)
    )
    # edge_u x edge_v points down: the light shines downwards.
    below = hit(scene, (0.0, -1.0, 0.0), (0.0, 1.0, 0.0))[2]
    above = hit(scene, (0.0, 1.0, 0.0), (0.0, -1.0, 0.0))[2]
    # power color / (pi area) with area 4
    assert below.emission[0] == pytest.approx(
        np.array([1.0, 0.5, 0.25]) / np.pi, rel=4 * 2.0**-52
    )  # four roundings
    assert np.all(above.emission == 0.0)
    assert below.light[0] == above.light[0] == 0


# -- many primitives
# -------------------------------------------------------------------------------------------


def random_rays(count: int, reach: float, dtype) -> tuple[np.ndarray, np.ndarray]:
    """Return origins in a cube and directions through another point of it."""
    u = [
        np.stack(
            rng.uniforms(
                rng.counter(5), rng.counter(np.arange(count)), rng.counter(k), rng.counter(0), dtype
            )[:3],
            -1,
        )
        for k in range(2)
    ]
    a, b = (reach * (2.0 * v - 1.0) for v in u)
    return a, vectors.normalize(b - a)


def turned(angle: float):
    c, s = np.cos(angle), np.sin(angle)
    return ((c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c))


def many_boxes(angles: list[float]) -> Scene:
    """Return boxes turned by the given angles, which overlap in part."""
    random = np.random.default_rng(4)
    places, sizes = random.uniform(-1.5, 1.5, (len(angles), 3)), random.uniform(0.2, 0.6, (len(angles), 3))
    rotations = [turned(angle) if angle else box.IDENTITY for angle in angles]
    return scene_of(boxes=tuple(Box(p, h, GREY, r) for p, h, r in zip(places, sizes, rotations, strict=True)))


SHARING = [0.3] * 4 + [0.0, 0.5, 0.7, 0.7, 0.3, 0.9] + [1.1] * 4 + [1.3] * 3
"""Angles of boxes: two groups that share theirs, one parallel to the axes, and small groups around them."""


def test_many_boxes_are_grouped_in_one_look():
    """Each box was compared with all others, which took a hundred thousand of them an hour."""
    looks = []

    class Rotation(tuple):
        def __hash__(self):
            looks.append(self)
            return super().__hash__()

    boxes = tuple(replace(each, rotation=Rotation(each.rotation)) for each in many_boxes(SHARING).boxes * 10)
    Box.parts(scene_of(boxes=boxes))
    assert len(looks) == len(boxes)


@pytest.mark.parametrize("dtype", TYPES)
def test_boxes_that_share_a_rotation_are_hit_like_those_that_do_not(dtype, monkeypatch):
    """Distances, surfaces and normals to the bit, whether rays are turned for a group or for each box."""
    scene, (o, d) = many_boxes(SHARING), random_rays(3000, 1.9, dtype)
    answers = []
    for fewest in (1, box.LEAST_SHARED, 100):
        monkeypatch.setattr(box, "LEAST_SHARED", fewest)
        geometry = I.build(scene, dtype)
        found = I.closest_hit(geometry, o, d)
        answers.append((len(geometry.groups), *found, I.surface_at(geometry, found, o, d).normal))
    assert [answer[0] for answer in answers] == [7, 5, 3]
    assert len(np.unique(answers[0][2])) == len(SHARING) + 1
    for answer in answers[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(answer[1:], answers[0][1:], strict=True))


@pytest.mark.parametrize("name", ["minicubes", "cornell"])
def test_closest_hit_is_the_least_of_single_primitives(name):
    """The scene's answer equals the least of the answers of scenes with one primitive each, to the bit."""
    scene = scenes.canonical(name)
    o, d = random_rays(2000, 1.9, np.float64)
    whole = I.closest_hit(I.build(scene, np.float64), o, d)
    empty = replace(scene, room=None, boxes=(), lights=())
    singles = [replace(empty, room=scene.room)]
    singles += [replace(empty, boxes=(box,)) for box in scene.boxes]
    singles += [replace(empty, lights=(light,)) for light in scene.lights]
    distances = np.stack([I.closest_hit(I.build(s, np.float64), o, d).t for s in singles])
    assert np.array_equal(whole.t, distances.min(axis=0))
    owner, hits = np.where(whole.surface < 6, 0, whole.surface - 5), whole.t < I.MISS
    assert np.array_equal(owner[hits], np.argmin(distances, axis=0)[hits])


@pytest.mark.parametrize("time", [0.0, 0.7, 1.3, 5.9])
def test_boxes_on_a_turned_grid_share_their_coordinates(time):
    """ISC-12: 27 centres on a 3x3x3 grid have three values on each axis, turned back, in either type.

    Without the rule of noise a zero would be some 1e-17, another one for each box. The values themselves are
    the exact ones to a few roundings: u of float32 for 0.72.
    """
    for dtype in (np.float32, np.float64):
        group, _ = I.build(scenes.minicubes(time), dtype).groups
        centers = np.stack(group.centers)
        if dtype is np.float32:
            assert [len(np.unique(centers[:, k])) for k in range(3)] == [3, 3, 3]
        assert all(np.sum(centers[:, k] == 0.0) == 9 for k in range(3))
        grid = scenes.CUBE_SPACING * np.array([-1.0, 0.0, 1.0])
        assert np.abs(centers[..., np.newaxis] - grid).min(axis=-1).max() <= 2.0**-24


def test_occluded_agrees_with_closest_hit():
    geometry = I.build(scenes.canonical("minicubes"), np.float32)
    o, d = random_rays(4000, 1.9, np.float32)
    t = I.closest_hit(geometry, o, d).t
    assert not np.any(I.occluded(geometry, o, d, t))
    assert np.all(I.occluded(geometry, o, d, np.nextafter(t, np.float32(np.inf))))


@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("far", [0.0, 10.0])
def test_spawned_rays_do_not_meet_their_own_surface(dtype, scale, far):
    """From every hit, rays that leave at grazing to steep angles: none comes back to its own face at once.

    `far` moves the scene away from the world's origin by that many times its size, where coordinates are
    coarser. Boxes and spheres are convex, so a ray that leaves one never meets it again.
    """
    cubes = tuple(
        replace(
            box,
            center=tuple(scale * (c + far) for c in box.center),
            half_extent=tuple(scale * h for h in box.half_extent),
        )
        for box in scenes.minicubes(time=0.9).boxes
    )
    ball = Sphere((scale * (1.5 + far), scale * far, scale * far), 0.3 * scale, GREY)
    geometry = I.build(scene_of(boxes=cubes, spheres=(ball,)), dtype)
    inner, d = random_rays(20000, 1.5, np.float64)
    o = (scale * (inner - 6.0 * d + far)).astype(dtype)
    d = d.astype(dtype)
    found = I.closest_hit(geometry, o, d)
    surface = I.surface_at(geometry, found, o, d)
    hits = np.flatnonzero(found.surface < geometry.nothing)
    assert len(hits) > 10000
    point, normal, t = surface.point[hits], surface.normal[hits], found.t[hits]
    origin = I.spawn_origin(point, normal, t)
    tangent = vectors.cross(normal, np.roll(normal, 1, axis=-1) + np.array([0.3, 0.5, 0.7], dtype))
    for lift in (1e-6, 1e-3, 0.1, 1.0):
        leaving = vectors.normalize(vectors.normalize(tangent) + dtype(lift) * normal)
        again = I.closest_hit(geometry, origin, leaving)
        own = again.surface == found.surface[hits]
        assert not np.any(own), f"{own.sum()} of {own.size} rays met their own convex surface"
