"""A history on executors: the reference's, to the bit where arithmetic is that of IEEE 754."""

import numpy as np
import pytest

from wamnet.compiler.scenes.history_kernel import MOTION, PAST, compile_history
from wamnet.kernels.run.before import first_hits_on, follow_on
from wamnet.kernels.run.render_on import Frames
from wamnet.refimpl.errors import CompileError, InputError
from wamnet.refimpl.light import history as H
from wamnet.refimpl.light.camera import Camera, camera_basis
from wamnet.refimpl.light.history import First, History, Limits, Motion
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.variation import Variation, varied

HEIGHT, WIDTH = 19, 35
"""No multiple of anything that a device has."""

DECIDED_OTHERWISE = 1 / 50
"""Most pixels of a picture whose ray, or whose place a picture ago, may pass an edge by a rounding: of 665
pixels a film of these scenes has none on PoCL and GCC, and each row of a silhouette could have one."""


EXACT = ("numpy", "c")
"""Executors whose divisions and roots are rounded correctly; others may have errors of 2.5 or 3 ulp."""


def moment(name: str, k: int) -> Scene:
    """Return a scene after k pictures; the fourth shows what the third does."""
    k = min(k, 3)
    return varied(canonical(name, time=0.3 + k / 24), Variation(yaw_deg=0.7 * k))


def color_of(seed: int, *shape: int) -> np.ndarray:
    return 3 * np.random.default_rng(seed).random((*(shape or (HEIGHT, WIDTH)), 3), np.float32)


def job(seed: int = 0) -> Job:
    return Job(WIDTH, HEIGHT, seed=seed)


@pytest.fixture(params=["numpy", "opencl", "c", "opengl"])
def device(request, executor_named):
    return executor_named(request.param)


def by_definition(past: History | None, *picture) -> History:
    return H.begin(*picture[:3]) if past is None else H.follow(past, *picture)


@pytest.mark.product
@pytest.mark.parametrize("name", ["minicubes", "glossy", "cornell", "daylight", "empty"])
def test_a_film_has_the_history_of_the_definition(device, name):
    """Five pictures, the last at rest. Decisions aside, two histories of the same samples are each within
    HIS-6 of the exact one, and a count within 16 u L n of the exact one by its proof."""
    scenes = [moment(name, k) for k in range(5)]
    frames, past, wanted = Frames(scenes), None, None
    same = np.ones((HEIGHT, WIDTH), bool)
    for k, scene in enumerate(scenes):
        color = color_of(k)
        past = follow_on(device, past, scene, job(k), color, frames=frames)
        wanted = by_definition(wanted, scene, job(k), color)
        assert np.mean(past.number != wanted.number) <= DECIDED_OTHERWISE
        same &= np.abs(past.count - wanted.count) <= 2 * 32 * H.LIMITS.rest * np.finfo(np.float32).eps
        bound = 2 * H.error_bound(H.LIMITS.rest, 3.0)
        same &= (np.abs(past.color - wanted.color) <= bound).all(axis=-1)
        assert np.mean(~same) <= DECIDED_OTHERWISE
        if device.name in EXACT:
            assert np.array_equal(past.color, wanted.color)
            assert np.array_equal(past.count, wanted.count)
    assert 3 < past.count.max() <= 5 * (1 + 16 * H.LIMITS.rest * np.finfo(np.float32).eps)
    assert past.count.min() < 5 or name == "empty"


@pytest.mark.nightly(but=("numpy", "opengl"))
def test_who_begins_a_history_may_leave_it_to_another(device):
    scenes = [moment("glossy", k) for k in range(3)]
    past = H.begin(scenes[0], job(), color_of(0))
    past = follow_on(device, past, scenes[1], job(1), color_of(1))
    found = H.follow(past, scenes[2], job(2), color_of(2))
    first = H.begin(scenes[0], job(), color_of(0))
    wanted = H.follow(H.follow(first, scenes[1], job(1), color_of(1)), scenes[2], job(2), color_of(2))
    near = np.abs(found.color - wanted.color).max(axis=-1) <= 2 * H.error_bound(H.LIMITS.rest, 3.0)
    assert np.mean(~near) <= DECIDED_OTHERWISE


@pytest.mark.nightly(but=("numpy", "opencl"))
def test_limits_are_those_given(device):
    scene, limits = canonical("cornell"), Limits(3, 2, 4)
    past = None
    for k in range(6):
        past = follow_on(device, past, scene, job(k), color_of(k), limits)
    assert (past.count == 4).all()


# ---- the kernel by itself --------------------------------------------------------------------------------


def rough(seed: int, count: int = 4):
    """Return a past, motions of `count` primitives and nothing, and first hits: in no scene, and wild.

    Points were up to some pictures' widths away; some are NaN or infinite; a third of the primitives rest.
    """
    rng = np.random.default_rng(seed)
    shape = (HEIGHT, WIDTH)

    def vectors(scale: float = 1.0) -> np.ndarray:
        return (scale * rng.standard_normal((*shape, 3))).astype(np.float32)

    def units() -> np.ndarray:
        found = vectors()
        return found / np.linalg.norm(found, axis=-1, keepdims=True).astype(np.float32)

    normals = units()
    past_normals = np.where(rng.random(shape)[..., None] < 0.7, normals, units())
    color = np.exp(vectors(3.0))
    past = History(
        Scene("", Camera((0.1, 0.2, 0.3), (0.0, 0.0, -1.0))),
        rng.integers(0, count + 1, shape, np.int32),
        past_normals,
        color,
        rng.integers(1, 9, shape).astype(np.float32),
    )
    rests = np.append(rng.random(count) < 1 / 3, True)
    turn = (0.1 * rng.standard_normal((count + 1, 3, 3))).astype(np.float32)
    shift = (0.3 * rng.standard_normal((count + 1, 3))).astype(np.float32)
    turn[rests], shift[rests] = 0.0, 0.0
    moves = Motion(turn, np.zeros((count + 1, 3), np.float32), shift, rests, rng.random(count + 1) < 0.5)
    points = vectors() + np.array([0.0, 0.0, -4.0], np.float32)
    points[rng.random(shape) < 0.05] = np.nan
    points[rng.random(shape) < 0.05, 0] = np.inf
    points[rng.random(shape) < 0.1, 2] += 8.0  # behind the camera
    return past, moves, First(rng.integers(0, count + 1, shape, np.int32), points, normals, units())


def followed(past: History, moves: Motion, first: First, color: np.ndarray, limits: Limits) -> History:
    """Return the history as history.follow makes it of first hits and motions."""
    camera = Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0))
    cameras = [camera_basis(each, np.float32) for each in (camera, past.scene.camera)]
    found, row = first.number < len(moves.rests) - 1, H.row_of(moves, first.number)
    shift = H.displacement(row, found, cameras, first, WIDTH, HEIGHT)
    limit = limits.of(moves).astype(np.float32)[first.number]
    mean, count = H.blend(H.gathered(past, moves, first, shift), color, limit)
    return History(Scene("", camera), first.number, first.normal, mean, count)


def by_kernel(monkeypatch, device, past, moves, first, color, limits) -> History:
    """Return the same by the kernel, of first hits and motions that no scene has."""
    from wamnet.kernels.run import before as module

    now = Scene("", Camera((0.0, 0.0, 0.0), (0.0, 0.0, -1.0)))
    monkeypatch.setattr(module, "first_hits_on", lambda *_: first)
    monkeypatch.setattr(module.history, "motion", lambda *_: moves)
    return follow_on(device, past, now, Job(WIDTH, HEIGHT), color, limits)


def differing(monkeypatch, device, seed: int, limits: Limits = H.LIMITS) -> float:
    """Return the share of pixels that differ by more than rounding may make them.

    HIS-6 bounds what a picture adds, (24 + 8 + 32 L) u M, by its own (60 L + 8) u M; M is the largest colour.
    """
    past, moves, first = rough(seed)
    color = np.exp(3.0 * np.random.default_rng(seed + 1).standard_normal((HEIGHT, WIDTH, 3))).astype(
        np.float32
    )
    with np.errstate(all="ignore"):
        wanted = followed(past, moves, first, color, limits)
        found = by_kernel(monkeypatch, device, past, moves, first, color, limits)
    largest = max(float(past.color.max()), float(color.max()))
    away = np.abs(found.color - wanted.color).max(axis=-1) / H.error_bound(limits.rest, largest)
    counts = np.abs(found.count - wanted.count) > 64 * limits.rest * np.finfo(np.float32).eps
    assert np.array_equal(found.number, wanted.number)
    assert np.array_equal(found.normal, wanted.normal)
    return float(np.mean(~(away <= 1) | counts))


@pytest.mark.parametrize("seed", range(4))
def test_wild_pictures_are_those_of_the_definition(monkeypatch, device, seed):
    assert differing(monkeypatch, device, seed) <= (0 if device.name in EXACT else DECIDED_OTHERWISE)


# ---- who does it -----------------------------------------------------------------------------------------


def test_first_hits_are_the_reference_s(device):
    scene = moment("glossy", 2)
    found, wanted = first_hits_on(device, scene, job(5)), H.first_hits(scene, job(5))
    same = found.number == wanted.number
    assert np.mean(~same) <= DECIDED_OTHERWISE
    # Some forty roundings of numbers up to 10, and a sphere's normal divides them by a radius of 0.2.
    for one, other in ((found.point, wanted.point), (found.normal, wanted.normal)):
        assert np.abs(one - other)[same].max() <= 40 * 10 / 0.2 * np.finfo(np.float32).eps
    assert np.abs(found.direction - wanted.direction).max() <= 40 * np.finfo(np.float32).eps


@pytest.mark.product
@pytest.mark.parametrize("wrong", ["size", "nan", "primitives"])
def test_what_the_definition_refuses_is_refused(device, wrong):
    past = follow_on(device, None, canonical("cornell"), job(), color_of(0))
    scene, color = canonical("cornell"), color_of(1)
    if wrong == "size":
        color = color_of(1, HEIGHT, WIDTH + 1)
    elif wrong == "nan":
        color[2, 3, 1] = np.nan
    else:
        scene = canonical("minicubes")
    with pytest.raises(
        InputError, match={"size": "shape", "nan": "colour", "primitives": "counterpart"}[wrong]
    ):
        follow_on(device, past, scene, job(1), color)


def test_targets_without_the_kernel_say_so():
    with pytest.raises(CompileError, match=r"wgsl, 1 pixels .* the history for none; follow pictures by"):
        compile_history("wgsl")


@pytest.mark.parametrize("target", ["opencl", "c", "opengl"])
def test_a_manifest_says_what_the_arrays_hold(target):
    kernel = compile_history(target)
    shapes = {array.name: array.shape for array in kernel.interface.arrays}
    facts = kernel.manifest
    assert facts["schema"] == "wamnet-history-kernel-1"
    assert shapes["past"] == shapes["result"] == (len(facts["past"]), "height", "row_stride")
    assert shapes["first"] == (len(facts["first"]), "height", "row_stride")
    assert shapes["motions"] == ("primitives", len(facts["motion"]))
    assert shapes["cameras"] == (len(facts["cameras"]),)
    assert facts["past"] == list(PAST)
    assert facts["motion"] == list(MOTION)
    for name in (*facts["past"], *facts["motion"]):
        assert name in kernel.source
