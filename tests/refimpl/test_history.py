"""Histories: surfaces found where they were, nothing taken from others, a mean whose error is bounded."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.refimpl import vectors
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import history as H
from wamnet.refimpl.light.camera import camera_basis, camera_ray
from wamnet.refimpl.light.intersection import build as lay_out
from wamnet.refimpl.light.intersection import closest_hit
from wamnet.refimpl.light.materials import Mirror
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Box, Camera, Quad, Scene, Sphere
from wamnet.refimpl.light.scenes import _about_y, canonical
from wamnet.refimpl.light.variation import Variation, varied

U = {name: float(np.finfo(name).eps) / 2 for name in ("float32", "float64")}
STEP_S = 1 / 24
MOVING, SHOWN, REST = vars(H.LIMITS).values()
CAMERA = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0), vertical_fov_deg=90.0)
WHITE = (0.5,) * 3


def job(size: int = 24, seed: int = 0, dtype: str = "float32") -> Job:
    return Job(size, size, seed=seed, dtype=dtype)


def moment(name: str, k: int, turning: float = 0.7) -> Scene:
    """Return a scene after k pictures, its camera turned by so many degrees a picture."""
    return varied(canonical(name, time=0.3 + k * STEP_S), Variation(yaw_deg=turning * k))


def noise(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).random((*shape, 3), np.float32)


def displacement(moves: H.Motion, cameras, first: H.First, size: int):
    found = first.number < len(moves.rests) - 1
    return H.displacement(H.row_of(moves, first.number), found, cameras, first, size, size)


# ---- primitives and their motion -------------------------------------------------------------------------


POSES = {
    "box": lambda t: Box((t, 0.5 * t, -4.0), (1.0, 0.5, 0.25 + t), WHITE, _about_y(0.3 + 2.0 * t)),
    "sphere": lambda t: Sphere((t, 0.0, -4.0 + t), 0.5 + t, WHITE),
    "quad": lambda t: Quad((t, -1.0, -4.0), (1.0, t, 0.0), (0.0, 1.0, 0.5 * t), WHITE),
}


@pytest.mark.parametrize("kind", POSES)
def test_a_point_of_a_primitive_was_where_the_primitive_was(kind):
    """HIS-2: points given in the primitive's own frame at both moments. Each coordinate is made of some ten
    products of numbers up to 5, and an inverse of axes whose lengths differ at most 20-fold."""
    pose, listed = POSES[kind], {"box": "boxes", "sphere": "spheres", "quad": "quads"}[kind]
    now, before = (Scene(kind, CAMERA, **{listed: (pose(t),)}) for t in (0.2, 0.0))
    own = np.random.default_rng(1).uniform(-1.0, 1.0, (500, 3))
    placed = [own @ axes.T + origin for axes, origin in (H._pose(pose(t)) for t in (0.2, 0.0))]
    moves = H.motion(now, before, np.float64)
    number = np.zeros(500, np.int32)
    first = H.First(number, placed[0], np.zeros((500, 3)), np.zeros((500, 3)))
    point, _ = H.point_before(H.row_of(moves, first.number), first)
    assert np.abs(point - placed[1]).max() <= 10 * 5 * 20 * U["float64"]
    assert not moves.rests[0]


def test_scenes_of_other_primitives_are_refused():
    """HIS-2."""
    with pytest.raises(InputError, match=r"primitives of the previous scene 33: .*counterpart"):
        H.motion(canonical("cornell"), replace(canonical("minicubes"), lights=()))


# ---- where a pixel was -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["minicubes", "glossy", "cornell", "daylight", "empty"])
def test_what_rests_has_no_displacement_to_the_bit(name):
    """HIS-3."""
    scene = canonical(name, time=0.7)
    first, moves = H.first_hits(scene, job()), H.motion(scene, canonical(name, time=0.7))
    basis = camera_basis(scene.camera, np.float32)
    x, y, ahead = displacement(moves, (basis, basis), first, 24)
    assert not x.any()
    assert not y.any()
    assert ahead.all()
    assert moves.rests.all()


@pytest.mark.parametrize("name", ["minicubes", "glossy", "cornell"])
def test_the_camera_before_sees_the_point_where_the_displacement_says(name):
    """HIS-3: a ray of the camera before, through the displaced place in the image, passes through the point.
    In float64; the ray's direction has an error of some ten u, and 200 pixels cancel in the difference."""
    now, before = moment(name, 1), moment(name, 0)
    first, moves = H.first_hits(now, job(24, 3, "float64")), H.motion(now, before, np.float64)
    basis, basis_before = (camera_basis(scene.camera) for scene in (now, before))
    dx, dy, _ = displacement(moves, (basis, basis_before), first, 24)
    x, y, _ = H.projected(basis, first.point - basis.position, 24, 24)
    zero = np.zeros_like(x)
    origin, direction = camera_ray(basis_before, x + dx, y + dy, zero, zero, 24, 24)
    point, _ = H.point_before(H.row_of(moves, first.number), first)
    found = first.number < len(moves.rests) - 1
    away = vectors.cross(direction, point - origin)[found]
    assert np.abs(away).max() <= 10 * 200 * U["float64"] * 10
    # and where nothing hides it, that is what the ray meets
    hit = closest_hit(lay_out(before, np.float64), origin, direction)
    same = vectors.look_up(H.surface_numbers(before), hit.surface) == first.number
    assert np.mean(same[found]) >= 0.8
    distance = np.sqrt(vectors.dot(point - origin, point - origin))
    assert np.mean(np.abs(hit.t - distance)[same & found] <= 1e-9) >= 0.95
    assert np.abs(dx).max() > 0.1


def test_a_camera_that_moves_sideways_displaces_by_distance():
    """HIS-3, by hand: 90 degrees over 16 pixels at depth 4 are 2 pixels a unit; half a unit is one pixel."""
    wall = Quad((-50.0, -50.0, -4.0), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0), WHITE)
    now = Scene("wall", CAMERA, quads=(wall,))
    before = replace(now, camera=Camera((0.5, 0.25, 0.0), (0.5, 0.25, -1.0), vertical_fov_deg=90.0))
    bases = [camera_basis(scene.camera, np.float32) for scene in (now, before)]
    first = H.first_hits(now, job(16))
    x, y, _ = displacement(H.motion(now, before), bases, first, 16)
    assert np.abs(x + 1.0).max() <= 64 * 16 * U["float32"]
    assert np.abs(y - 0.5).max() <= 64 * 16 * U["float32"]


def test_what_was_behind_the_camera_is_not_known():
    """HIS-4: the camera before looked the other way, where it would see the point mirrored at itself; and a
    pixel is not taken from there, though all else agrees."""
    wall = Quad((-50.0, -50.0, -4.0), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0), WHITE)
    scene = Scene("wall", CAMERA, quads=(wall,))
    turned = replace(scene, camera=replace(CAMERA, look_at=(0.0, 0.0, 1.0)))
    first = H.first_hits(scene, job())
    bases = [camera_basis(each.camera, np.float32) for each in (scene, turned)]
    assert not displacement(H.motion(scene, turned), bases, first, 24)[2].any()
    past, moves, first = by_hand()
    nowhere = (*shifted(0.0, 0.0)[:2], np.zeros((2, 2), bool))
    assert not H.gathered(past, moves, first, nowhere).count.any()


def test_what_is_shown_has_the_number_of_its_primitive():
    """HIS-1, HIS-5: the second of three boxes is a mirror; the first and the last share a rotation."""
    angles, materials = (0.1, 0.2, 0.1), (None, Mirror(), None)
    boxes = tuple(
        Box((0.0, 0.0, -4.0), (1.0,) * 3, WHITE, _about_y(angle), material=material)
        for angle, material in zip(angles, materials, strict=True)
    )
    scene = Scene("boxes", CAMERA, boxes=boxes)
    assert H.motion(scene, scene).shows.tolist() == [False, True, False, False]


# ---- what is taken from where ----------------------------------------------------------------------------


def by_hand(number=(0, 0, 0, 0), color=(0.0, 4.0, 8.0, 16.0), count=(1.0, 1.0, 3.0, 3.0)):
    """Return a past of 2 x 2 pixels, and first hits of primitive 0 of a scene with two that moved."""
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0], np.float32), (2, 2, 3))
    numbers = np.array(number, np.int32).reshape(2, 2)
    colors = np.repeat(np.array(color, np.float32).reshape(2, 2, 1), 3, axis=-1)
    past = H.History(Scene("", CAMERA), numbers, up, colors, np.array(count, np.float32).reshape(2, 2))
    zero = np.zeros((2, 2, 3), np.float32)
    moves = H.Motion(
        np.zeros((3, 3, 3)), np.zeros((3, 3)), np.ones((3, 3)), np.zeros(3, bool), np.zeros(3, bool)
    )
    return past, moves, H.First(np.zeros((2, 2), np.int32), zero, up, zero)


def shifted(x: float, y: float):
    return np.full((2, 2), x, np.float32), np.full((2, 2), y, np.float32), np.ones((2, 2), bool)


def test_four_pixels_by_hand():
    """HIS-4, HIS-5: a quarter to the right and half down; then the fourth sample (of 2.5), or a limit."""
    past, moves, first = by_hand()
    known = H.gathered(past, moves, first, shifted(0.25, 0.5))
    # 3/8 0 + 1/8 4 + 3/8 8 + 1/8 16 = 5.5, and 3/8 1 + 1/8 1 + 3/8 3 + 1/8 3 = 2
    assert known.color[0, 0].tolist() == [5.5] * 3
    assert known.count[0, 0] == 2.0
    # at the right border only the left column counts, at the last pixel only itself
    assert known.color[0, 1].tolist() == [10.0] * 3
    assert known.color[1, 1].tolist() == [16.0] * 3
    assert (known.low[0, 0].tolist(), known.high[0, 0].tolist()) == ([0.0] * 3, [16.0] * 3)
    color = np.full((2, 2, 3), 2.5, np.float32)
    mean, count = H.blend(known, color, np.full((2, 2), 16.0, np.float32))
    assert (mean[0, 0].tolist(), count[0, 0]) == ([4.5] * 3, 3.0)
    mean, count = H.blend(known, color, np.full((2, 2), 2.0, np.float32))
    assert (mean[0, 0].tolist(), count[0, 0]) == ([4.0] * 3, 2.0)


def test_pixels_of_other_surfaces_have_no_weight():
    """HIS-4: of four pixels those of number 1 are left out, and so is a side that faces elsewhere."""
    past, moves, first = by_hand(number=(0, 1, 1, 0))
    known = H.gathered(past, moves, first, shifted(0.25, 0.5))
    assert known.color[0, 0].tolist() == [4.0] * 3  # (3/8 0 + 1/8 16) / (1/2)
    aside = past.normal.copy()
    aside[0, 0] = (0.75, 0.625, 0.0)  # of cosine 0.64
    known = H.gathered(replace(past, normal=aside), moves, first, shifted(0.25, 0.5))
    assert known.color[0, 0].tolist() == [16.0] * 3
    known = H.gathered(replace(past, number=np.ones_like(past.number)), moves, first, shifted(0.25, 0.5))
    assert not known.count.any()


@pytest.mark.parametrize("shift", [np.nan, np.inf, -np.inf, 1e30, 2.0, -2.0])
def test_what_is_not_in_the_picture_is_not_known(shift):
    """HIS-4: NaN and the infinite are far away."""
    past, moves, first = by_hand()
    for pair in ((shift, 0.0), (0.0, shift)):
        known = H.gathered(past, moves, first, shifted(*pair))
        assert not known.count.any()
        assert not known.color.any()


@pytest.mark.parametrize(("name", "turning"), [("cornell", 0.0), ("cornell", 0.7), ("minicubes", 0.7)])
def test_no_colour_flows_from_one_surface_to_another(name, turning):
    """HIS-4: with a colour for each face of each primitive, histories are that colour after any motion."""
    past = None
    for k in range(8):
        scene, one = moment(name, k, turning), job(32, k)
        first = H.first_hits(scene, one)
        rests = H.motion(scene, moment(name, k + 1, turning)).rests
        color = face_codes(scene, first, rests)
        past = H.begin(scene, one, color) if past is None else H.follow(past, scene, one, color)
        assert np.array_equal(past.color, color), k
    assert np.mean(past.count >= 4.0) >= 0.5


def face_codes(scene: Scene, first: H.First, rests) -> np.ndarray:
    """Return a colour for each face of each box and each wall that moves, and one for all that rests."""
    turns = np.concatenate([np.eye(3)[np.newaxis]] * 6 + [np.array([box.rotation for box in scene.boxes])])
    turns = np.concatenate([turns, np.broadcast_to(np.eye(3), (len(rests) - len(turns), 3, 3))])
    own = np.einsum("...ij,...j->...i", turns[first.number], first.normal)
    axis = np.argmax(np.abs(own), axis=-1)
    sign = np.take_along_axis(own, axis[..., np.newaxis], axis=-1)[..., 0] > 0.0
    code = 1.0 + 6.0 * first.number + 2.0 * axis + sign
    return np.repeat(np.where(rests[first.number], 0.0, code)[..., np.newaxis], 3, axis=-1).astype(np.float32)


def test_what_was_hidden_is_new():
    """HIS-4: a box moves aside by more than its width; behind it, the wall begins with the new sample."""
    wall = Quad((-50.0, -50.0, -6.0), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0), WHITE)
    before, now = (
        Scene("box", CAMERA, boxes=(Box((x, 0.0, -4.0), (1.0, 1.0, 0.5), WHITE),), quads=(wall,))
        for x in (-1.2, 1.2)
    )
    past = H.begin(before, job(32), noise(0, 32, 32))
    color = noise(1, 32, 32)
    after = H.follow(past, now, job(32, 1), color)
    was, is_now = (H.first_hits(scene, job(32, k)).number for k, scene in enumerate((before, now)))
    hidden = (was == 0) & (is_now == 1)
    assert hidden.sum() > 20
    assert (after.count[hidden] == 1.0).all()
    assert np.array_equal(after.color[hidden], color[hidden])
    # the box itself and the wall around are known
    assert np.mean(after.count[is_now == 0] == 2.0) >= 0.8
    assert (after.count[(was == 1) & (is_now == 1)] == 2.0).all()


# ---- the mean --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["minicubes", "glossy"])
def test_at_rest_a_history_is_the_running_mean_to_the_bit(name):
    """HIS-5: at edges too, where each ray may meet another surface."""
    scene, past, mean = canonical(name, time=0.7), None, None
    for k in range(REST + 10):
        one, color = job(16, k), noise(k, 16, 16)
        past = H.begin(scene, one, color) if past is None else H.follow(past, scene, one, color)
        mean = color if mean is None else mean + (color - mean) / np.float32(min(k + 1, REST))
        assert np.array_equal(past.color, mean), k
        assert (past.count == min(k + 1, REST)).all()
        if k == REST - 1:
            exact = np.mean([noise(i, 16, 16).astype(np.float64) for i in range(REST)], axis=0)
            assert np.abs(past.color - exact).max() <= H.error_bound(REST, 1.0)


def test_histories_stay_between_the_samples():
    """HIS-6: exactly, for samples that are nearly equal and at odd places; NaN fails."""
    low, high = np.float32(0.3), np.nextafter(np.float32(0.3), np.float32(1.0))
    past = None
    for k in range(60):
        scene, one = moment("minicubes", k, 0.9), job(16, k)
        color = np.where(noise(k, 16, 16) < 0.5, low, high)
        past = H.begin(scene, one, color) if past is None else H.follow(past, scene, one, color)
        assert low <= past.color.min()
        assert past.color.max() <= high


@pytest.mark.parametrize("limit", [1, 4, 16, 64])
def test_rounding_stays_below_the_bound_over_hundreds_of_pictures(limit):
    """HIS-6: float32 against float64, by the same displacements and decisions, of which a tenth rejects."""
    size, pictures, rng = 12, 400, np.random.default_rng(limit)
    _, moves, _ = by_hand()
    up = np.broadcast_to(np.array([0.0, 1.0, 0.0], np.float32), (size, size, 3))
    limits = np.full((size, size), limit)
    pasts = dict.fromkeys(("float32", "float64"))
    worst = 0.0
    for _ in range(pictures):
        number = (rng.random((size, size)) < 0.1).astype(np.int32)
        color = rng.random((size, size, 3), np.float32) ** 4
        shift = [rng.normal(size=(size, size)).astype(np.float32) for _ in range(2)]
        for name, past in pasts.items():
            if past is None:
                past = H.History(
                    Scene("", CAMERA), number, up, color.astype(name), np.ones(number.shape, name)
                )
            first = H.First(number, up, up, up)
            known = H.gathered(past, moves, first, (*(s.astype(name) for s in shift), number >= 0))
            mean, count = H.blend(known, color.astype(name), limits.astype(name))
            pasts[name] = H.History(past.scene, number, up, mean, count)
        error = np.abs(pasts["float32"].color - pasts["float64"].color).max()
        worst = np.maximum(worst, error)
        assert pasts["float32"].color.dtype == np.float32
    assert worst <= H.error_bound(limit, 1.0)
    assert worst >= U["float32"] / 4 or limit == 1


def test_what_mirrors_show_counts_less_while_anything_moves():
    """HIS-5."""
    mirror = Quad((-50.0, -50.0, -6.0), (100.0, 0.0, 0.0), (0.0, 50.0, 0.0), WHITE, material=Mirror())
    wall = replace(mirror, corner=(-50.0, 0.0, -6.0), material=None)
    past, scene = None, Scene("mirror", CAMERA, quads=(mirror, wall))
    for k in range(30):
        one, color = job(16, k), noise(k, 16, 16)
        # a ball behind the camera, which rests from picture 25 on
        at = replace(scene, spheres=(Sphere((0.01 * min(k, 25), 0.0, 5.0), 1.0, WHITE),))
        past = H.begin(at, one, color) if past is None else H.follow(past, at, one, color)
        shown = min(k + 1, SHOWN) if k <= 25 else SHOWN + k - 25
        plain = min(k + 1, MOVING) if k <= 25 else MOVING + k - 25
        assert (past.count[past.number == 2] == plain).all()
        assert (past.count[past.number == 1] == shown).all(), k
    assert {1, 2} == set(past.number.flat)


def test_layers_are_the_mean_and_the_share_of_the_past():
    """HIS-7."""
    past, _, _ = by_hand(count=(1.0, 2.0, 4.0, 16.0))
    layers = H.layers_of(past)
    assert layers["history"] is past.color
    assert layers["history_weight"].tolist() == [[[0.0], [0.5]], [[0.75], [0.9375]]]


# ---- what is refused -------------------------------------------------------------------------------------


def test_pictures_that_do_not_fit_are_refused():
    """HIS-5."""
    scene, color = canonical("furnace"), noise(0, 8, 8)
    past = H.begin(scene, job(8), color)
    with pytest.raises(InputError, match=r"shape of the colour \(8, 4, 3\): the job has \(8, 8, 3\)"):
        H.follow(past, scene, job(8), color[:, :4])
    with pytest.raises(InputError, match=r"shape of the colour .* the history has \(8, 8, 3\)"):
        H.follow(past, scene, job(4), color[:4, :4])
    for value in (np.nan, np.inf):
        broken = color.copy()
        broken[3, 2, 1] = value
        with pytest.raises(InputError, match="the colour at x=2, y=3"):
            H.follow(past, scene, job(8), broken)
        with pytest.raises(InputError, match="the colour at x=2, y=3"):
            H.begin(scene, job(8), broken)


@pytest.mark.parametrize("name", vars(H.LIMITS))
@pytest.mark.parametrize("value", [0, 0.5, H.MOST_LIMIT + 1, np.nan])
def test_limits_beyond_the_bound_s_reach_are_refused(name, value):
    """HIS-6."""
    with pytest.raises(InputError, match=f"^limit `{name}` .*from 1 to {H.MOST_LIMIT}"):
        H.Limits(**{name: value})
