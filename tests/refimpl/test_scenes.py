"""The canonical scenes: found by name, and what their descriptions promise."""

import math
from itertools import combinations

import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.materials import Conductor, Dielectric


def test_unknown_canonical_scene_lists_the_known_ones():
    known = ", ".join(scenes.CANONICAL)
    with pytest.raises(InputError, match=rf"scene 'teapot': unknown \(choose one of {known}"):
        scenes.canonical("teapot")
    with pytest.raises(
        InputError, match=r"parameter 'size': unknown to scene minicubes \(choose one of time, warm, cool"
    ):
        scenes.canonical("minicubes", size=3)


@pytest.mark.parametrize(
    ("parameters", "text"),
    [
        ({"warm": 1.0}, r"parameter warm 1.0: scene minicubes needs three numbers with commas \(for example"),
        ({"warm": (1.0, 2.0)}, r"parameter warm \(1.0, 2.0\): scene minicubes needs three numbers"),
        ({"time": (1.0, 2.0, 3.0)}, r"parameter time .*: scene minicubes needs one number \(for example 0.0"),
    ],
)
def test_numbers_in_place_of_colours_and_colours_in_place_of_numbers(parameters, text):
    with pytest.raises(InputError, match=text):
        scenes.canonical("minicubes", **parameters)


@pytest.mark.parametrize("time", [0.0, 0.3, 1.7, 5.0, 7.99])
def test_minicubes_turn_inside_their_room(time):
    """27 cubes, rigid: every corner stays in the room, distances between centres do not depend on time."""
    scene = scenes.minicubes(time=time)
    assert len(scene.boxes) == 27
    assert len({box.reflectance for box in scene.boxes}) == 27
    reach = (
        max(sum(c * c for c in box.center) ** 0.5 for box in scene.boxes) + 3**0.5 * scenes.CUBE_HALF_EXTENT
    )
    assert reach < 2.0
    first, last = scene.boxes[0].center, scene.boxes[-1].center
    distance = sum((a - b) ** 2 for a, b in zip(first, last, strict=True)) ** 0.5
    # A rotation in float64: some ulps.
    assert distance == pytest.approx(2 * scenes.CUBE_SPACING * 3**0.5, rel=1e-12)


@pytest.mark.parametrize("time", [0.0, 0.9, 2.1, 5.0])
def test_glossy_turns_inside_its_room_and_no_bodies_meet(time):
    """The bodies are above the table without touching it, and none reaches into another: the spheres around
    them are disjoint.
    """
    scene = scenes.glossy(time=time)
    table, *blocks = scene.boxes
    around = [(s.center, s.radius) for s in scene.spheres]
    around += [(b.center, math.hypot(b.half_extent[0], b.half_extent[2])) for b in blocks]
    for (a, r), (b, q) in combinations(around, 2):
        assert math.dist(a, b) > r + q
    for center, radius in around:
        assert math.hypot(center[0], center[2]) + radius < 2.0
    top = table.center[1] + table.half_extent[1]
    assert min(s.center[1] - s.radius for s in scene.spheres) > top
    assert min(b.center[1] - b.half_extent[1] for b in blocks) > top


@pytest.mark.parametrize("time", [0.1 * k for k in range(80)])
def test_vitrine_turns_inside_its_room_and_no_bodies_meet(time):
    """The spheres around the bodies, and the cylinder that the mirror turns in, are disjoint."""
    scene = scenes.vitrine(time=time)
    (block,), (coral, brass), (mirror,) = scene.boxes, scene.spheres, scene.quads
    around = [(block.center, math.hypot(*block.half_extent)), (brass.center, brass.radius)]
    half = 0.5 * math.hypot(*mirror.edge_u)
    assert math.hypot(mirror.corner[0], mirror.corner[2]) == pytest.approx(
        half, abs=1e-12
    )  # about the middle
    for center, radius in around:
        assert math.hypot(center[0], center[2]) - radius > 0.0
        assert math.hypot(center[0], center[2]) - (radius if radius < 0.5 else math.hypot(0.28, 0.28)) > half
        assert max(abs(c) for c in center) + radius < 2.0
    assert math.dist(block.center, brass.center) > around[0][1] + around[1][1]
    lowest = min(block.center[1] - block.half_extent[1], brass.center[1] - brass.radius)
    assert lowest > coral.center[1] + coral.radius
    assert mirror.corner[1] > -2.0


def test_vitrine_s_materials_move_apart():
    """An eighth of a turn later the mirror has turned against the bodies: it faces them."""
    start, later = (scenes.canonical("vitrine", time=time, roughness=0.3, ior=1.7) for time in (0.0, 1.0))
    materials = [part.material for part in (*start.boxes, *start.spheres, *start.quads)]
    assert [m.kind for m in materials if m] == ["dielectric", "conductor", "mirror"]
    assert materials[0] == Dielectric(1.7)
    assert materials[2] == Conductor(0.3)
    along, across = later.quads[0].edge_u, later.spheres[1].center
    assert along[0] * across[0] + along[2] * across[2] == pytest.approx(0.0, abs=1e-12)
    assert start.quads[0].edge_u != later.quads[0].edge_u


@pytest.mark.parametrize("name", scenes.CANONICAL)
@pytest.mark.parametrize("time", [1e308, -1e308, 1.1e9, float("inf"), float("nan")])
def test_times_that_no_turn_has_are_refused(name, time):
    """2 pi times the largest of them is not a number."""
    with pytest.raises(InputError, match=r"time .*: must be a number from -1e\+09 to 1e\+09 seconds"):
        scenes.canonical(name, time=time)


@pytest.mark.parametrize("name", scenes.CANONICAL)
def test_the_farthest_times_are_scenes(name):
    for time in (-1e9, 1e9):
        assert scenes.canonical(name, time=time).name == name


def test_a_background_beyond_float32_is_refused():
    with pytest.raises(InputError, match=r"scene.background .*: all values must be finite and at most"):
        scenes.canonical("empty", background=1e308)
