"""Trees of bounding boxes: the list's bits for any rays and primitives (PTK-19, IR-18, SHP-4)."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.loops import LISTS, TREES
from wamnet.compiler.scenes import hierarchy
from wamnet.compiler.scenes.hierarchy import Walked, holding, plant, walked
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.scene_inputs import varying
from wamnet.refimpl.light import intersection
from wamnet.refimpl.light.scene import IDENTITY, Box, Camera, Light, Quad, Room, Scene, Sphere
from wamnet.refimpl.light.shapes import kinds
from wamnet.refimpl.light.shapes.shape import MISS
from wamnet.refimpl.light.transport import Settings
from wamnet_peers.paths import crowd

GREY = (0.5, 0.5, 0.5)
CAMERA = Camera((0.0, 0.0, 0.95), (0.0, 0.0, 0.0))
ROOM = Room((-1.0,) * 3, (1.0,) * 3, (GREY,) * 6)
LIGHT = Light((-0.3, 0.99, -0.3), (0.6, 0.0, 0.0), (0.0, 0.0, 0.6), (1.0, 1.0, 1.0), 5.0)
TURNED = ((0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))


def primitive(random, kind):
    """Return a primitive; on a coarse grid, so that some share faces, planes and places."""
    place = tuple(np.round(random.uniform(-0.8, 0.8, 3) * 4) / 4)
    size = tuple(random.choice([0.01, 0.125, 0.25], 3))
    if kind == "sphere":
        return Sphere(place, size[0], GREY)
    if kind == "quad":
        along = np.roll([size[0], 0.0, 0.0], random.integers(3))
        across = np.roll([0.0, size[1], random.choice([0.0, 1e-3, 0.25])], random.integers(3))
        if np.linalg.norm(np.cross(along, across)) < 1e-4 * size[0] * size[1]:
            across = np.roll(along, 1)
        return Quad(place, tuple(along), tuple(across), GREY)
    if kind == "turned":
        turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
        turn *= np.linalg.det(turn)
        return Box(place, size, GREY, tuple(map(tuple, turn)))
    return Box(place, size, GREY, TURNED if kind == "shared" else IDENTITY)


def scene_of(seed, count, kinds_of, room=True):
    random = np.random.default_rng(seed)
    made = [primitive(random, kinds_of[i % len(kinds_of)]) for i in range(count)]
    made += made[: count // 4]  # coincident ones
    lists = {"boxes": Box, "spheres": Sphere, "quads": Quad}
    parts = {name: tuple(p for p in made if isinstance(p, kind)) for name, kind in lists.items()}
    return Scene("crowd", CAMERA, ROOM if room else None, lights=(LIGHT,), **parts)


def rays(scene, seed, count=400):
    """Rays from all over the scene to its primitives' corners, edges and middles, some along the axes."""
    random = np.random.default_rng(seed)
    low, high = holding(scene)
    target = random.integers(len(low), size=count)
    share = random.choice([0.0, 0.5, 1.0, 0.37], size=(count, 3))
    aim = low[target] + share * (high[target] - low[target])
    origin = random.uniform(-0.9, 0.9, (count, 3))
    level = random.random((count, 3)) < 0.3
    origin = np.where(level, aim, origin)  # a direction with zeros
    towards = aim - origin
    towards[np.all(towards == 0, axis=1)] = (0.0, 0.0, 1.0)
    direction = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    return origin.astype(np.float32), direction.astype(np.float32)


def with_tree(scene, visit=60.0):
    """Return list and tree; the cheaper a visit, the more nodes there are."""
    geometry = intersection.build(scene)
    costs = [hierarchy.row_cost(group) for group in geometry.groups]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(hierarchy, "VISIT", visit)
        found = walked(geometry, scene, costs, range(len(costs)))
    assert any(isinstance(group, Walked) for group in found.groups)
    return geometry, found


def check(scene, origin, direction, visit=1.0):
    """Insist that list and tree find the same, all rays together, some together and one by one."""
    listed, grown = with_tree(scene, visit)
    expected = intersection.closest_hit(listed, origin, direction)
    distance = np.random.default_rng(5).uniform(0.0, 2.0, len(origin)).astype(np.float32)
    distance[::3] = expected.t[::3]  # exactly as far as what is hit
    dark = intersection.occluded(listed, origin, direction, distance)
    for size in (len(origin), 16, 1):
        for start in range(0, len(origin), size)[:24]:
            some = slice(start, start + size)
            hit = intersection.closest_hit(grown, origin[some], direction[some])
            assert np.array_equal(hit.t, expected.t[some])
            assert np.array_equal(hit.surface, expected.surface[some])
            found = intersection.occluded(grown, origin[some], direction[some], distance[some])
            assert np.array_equal(found, dark[some])


@pytest.mark.parametrize("seed", range(3))
def test_rays_from_surfaces(seed):
    """Origins where paths really start: lifted off what was hit, in directions along it and off it."""
    scene = scene_of(seed, 80, ["sphere", "turned", "quad"])
    geometry = intersection.build(scene)
    origin, direction = rays(scene, seed)
    hit = intersection.closest_hit(geometry, origin, direction)
    surface = intersection.surface_at(geometry, hit, origin, direction)
    lifted = intersection.spawn_origin(surface.point, surface.normal, hit.t)
    random = np.random.default_rng(seed)
    away = random.normal(size=(len(origin), 3)).astype(np.float32)
    along = away - np.sum(away * surface.normal, axis=1, keepdims=True) * surface.normal
    for towards in (away, along, along + np.float32(1e-4) * surface.normal):
        check(scene, lifted, towards / np.linalg.norm(towards, axis=1, keepdims=True).astype(np.float32))


def test_a_walk_that_enters_every_node_reads_all_rows():
    """Ranges are of all rows: of the first part 0, then 1 and 2; of the second 0 and 1."""
    walk = hierarchy.Walk(0, (), "first", "skip", (hierarchy.Part((0,), ()), hierarchy.Part((1,), ())))
    parameters = {"first": np.array([0, 1, 3, 0, 2, 2]), "skip": np.array([2, 2])}
    first, second = walk.parts
    assert [*walk.all_rows(parameters)] == [*((first, row) for row in range(3)), (second, 0), (second, 1)]
    assert sorted(walk.rows(parameters, lambda _: True), key=lambda row: row[0].body) == [
        *walk.all_rows(parameters)
    ]


def test_a_tree_is_a_loop_of_the_program_and_may_be_walked_one_by_one():
    """Interpreted for one lane or many, with the bits of the list's program."""
    scene = scene_of(3, 60, ["sphere", "quad", "turned"])
    listed, grown = (lower_scene(scene, Settings(), f).parts["arrive"] for f in (LISTS, TREES))
    assert not any(node.op == "branch" for node in listed.nodes)
    assert {"branch", "loop"} <= {node.op for node in grown.nodes}
    origin, direction = rays(scene, 3, 40)
    inputs = {f"origin_{c}": origin[:, i] for i, c in enumerate("xyz")}
    inputs |= {f"direction_{c}": direction[:, i] for i, c in enumerate("xyz")}
    names = [str(node["name"]) for node in grown.nodes if node.op == "input"]
    inputs = {name: inputs.get(name, np.full(40, 0.25, np.float32)) for name in names}
    expected = interpret(listed, inputs)
    for lanes in (slice(0, 40), slice(3, 4), slice(17, 20)):
        found = interpret(grown, {name: value[lanes] for name, value in inputs.items()})
        for name, value in expected.items():
            assert np.array_equal(found[name], value[lanes]), name


# ---- the builder ------------------------------------------------------------------------------------------


def boxes_of(scene, count_of_parts=None):
    low, high = holding(scene)
    return low, high, np.full(len(low), 60.0), count_of_parts or [len(low)]


def test_each_row_is_in_one_leaf_and_in_all_boxes_around_it():
    scene = scene_of(7, 100, ["sphere", "quad"])
    low, high, costs, _ = boxes_of(scene)
    parts = [50, len(low) - 50]
    tree = plant(low, high, costs, parts)
    assert [sorted(order) for order in tree.orders] == [list(range(count)) for count in parts]
    assert tree.first.shape == (2, len(tree.skip) + 1)
    box_low = tree.centers.astype(np.float64) - tree.halves
    box_high = tree.centers.astype(np.float64) + tree.halves
    for k, start in enumerate((0, 50)):
        for node, (begin, end) in enumerate(pairwise(tree.first[k])):
            members = tree.orders[k][begin:end] + start
            around = [i for i in range(node + 1) if node < tree.skip[i]]
            assert node in around
            for i in around:
                assert (box_low[i] <= low[members]).all()
                assert (box_high[i] >= high[members]).all()


def test_skips_nest():
    tree = plant(*boxes_of(scene_of(8, 200, ["sphere"])))
    for node, skip in enumerate(tree.skip):
        assert node < skip <= len(tree.skip)
        assert (tree.skip[node:skip] <= skip).all()


def test_a_tree_costs_less_than_a_list_where_there_are_many():
    """Linear against less than linear: ten times the primitives cost less than five times as much."""
    small, large = (plant(*boxes_of(crowd("spheres", count))) for count in (200, 2000))
    assert large.cost < 5 * small.cost
    assert large.cost < 60.0 * 2000


# ---- which form -------------------------------------------------------------------------------------------


def test_hits_are_within_their_boxes():
    """In float64: points of shapes are in their extents, and reach all six sides."""
    for kind in ("sphere", "quad", "turned", "shared", "box"):
        scene = replace(scene_of(4, 1, [kind], room=False), lights=())
        (part,) = [part for each in kinds() for part in each.parts(scene)]
        low, high, _ = part.extent
        middle, size = 0.5 * (low + high), np.max(high - low)
        random = np.random.default_rng(0)
        origin = middle + 3 * size * random.normal(size=(20000, 3))
        aim = low + random.random((20000, 3)) * (high - low)
        direction = (aim - origin) / np.linalg.norm(aim - origin, axis=1, keepdims=True)
        hit = intersection.closest_hit(intersection.build(scene, np.float64), origin, direction)
        point = (origin + hit.t[:, None] * direction)[hit.t < MISS]
        slack = 1e-12
        assert (point >= low - slack).all()
        assert (point <= high + slack).all()
        # Of 20,000 hits some are near each side: a cap of a sphere of 1/100 of its size has 1 in 100 of them.
        assert (point.min(axis=0) <= low + 0.1 * size).all()
        assert (point.max(axis=0) >= high - 0.1 * size).all()


def test_cheap_boxes_stay_out_of_the_tree():
    """100 boxes that share a rotation cost less as a list; what is beside them is in a tree."""
    alone, mixed = crowd("shared", 100), crowd("mixture", 100)
    geometry = intersection.build(alone)
    assert hierarchy.planted(geometry, alone) is geometry
    assert hierarchy.tree_cost(geometry) == 0
    listed = intersection.build(mixed)
    grown = hierarchy.planted(listed, mixed)
    assert [isinstance(group, Walked) for group in grown.groups] == [False, True, True, True]
    assert 0 < hierarchy.tree_cost(grown) < hierarchy.list_cost(listed)


def test_a_scene_that_moves_has_no_tree():
    """Boxes would have to move with what they hold: such scenes are lists."""
    scene = scene_of(6, 60, ["sphere"])
    moved = replace(scene, camera=replace(CAMERA, position=(0.1, 0.0, 0.9)))
    inputs = varying([scene, moved], Settings())
    programs = lower_scene(scene, Settings(), TREES, inputs)
    assert not any(node.op == "branch" for node in programs.parts["arrive"].nodes)
    assert any(node.op == "branch" for node in lower_scene(scene, Settings(), TREES).parts["arrive"].nodes)


def test_a_shape_without_an_extent_keeps_the_list(monkeypatch):
    scene = scene_of(6, 60, ["sphere"])
    monkeypatch.setattr(Sphere, "extent", None)
    assert holding(scene) is None
    geometry = intersection.build(scene)
    assert hierarchy.planted(geometry, scene) is geometry


@pytest.mark.nightly
@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**16),
    count=st.integers(1, 60),
    kinds_of=st.lists(st.sampled_from(["sphere", "quad", "turned", "shared", "box"]), min_size=1, max_size=4),
    room=st.booleans(),
    visit=st.sampled_from([1.0, 20.0, 60.0]),
)
def test_a_tree_finds_what_the_list_finds(seed, count, kinds_of, room, visit):
    """Bits and ids, for rays that graze, that are parallel to axes, and primitives that coincide."""
    scene = scene_of(seed, count, kinds_of, room)
    with np.errstate(all="ignore"):
        check(scene, *rays(scene, seed), visit)
