"""Paths as programs: the reference's bits, and nothing of what a scene lacks."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.loops import LISTS, STATEMENTS, USUAL
from wamnet.compiler.core.loops import loops as loops_of
from wamnet.compiler.scenes.lower_scene import LAYERS, LIT, PATH, SEEN, SURFACE, lower_scene
from wamnet.compiler.scenes.values import names
from wamnet.refimpl import rng
from wamnet.refimpl.light import following, scenes, transport
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light.camera import camera_basis
from wamnet.refimpl.light.materials import Conductor, Dielectric, Lambertian, Mirror
from wamnet.refimpl.light.scene import Box, Camera, Light, Quad, Room, Scene, Sphere
from wamnet.refimpl.light.transport import Settings

GREY = (0.5, 0.6, 0.7)
LIGHT = Light((-1.0, 3.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.9, 0.8), 30.0)
TURNED = ((0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))
EVERYTHING = Scene(
    "everything",
    Camera((0.2, 0.5, 2.5), (0.0, 0.0, 0.0), vertical_fov_deg=70.0),
    Room((-3.0, -2.0, -3.0), (3.0, 4.0, 3.0), (GREY,) * 6, (0.1, 0.0, 0.0)),
    boxes=(
        Box((-1.0, 0.0, 0.0), (0.3, 0.4, 0.5), (0.2, 0.3, 0.4)),
        Box((1.0, 0.0, 0.0), (0.3, 0.4, 0.5), (0.9, 0.3, 0.4), TURNED),
        Box((1.0, 1.0, 0.5), (0.2, 0.2, 0.2), (0.9, 0.3, 0.9), TURNED, (0.5, 0.5, 0.5)),
    ),
    spheres=(Sphere((0.0, 0.5, 0.0), 0.4, (0.9, 0.8, 0.1)), Sphere((0.5, -1.0, 1.0), 0.7, (0.3, 0.8, 0.5))),
    quads=(Quad((-2.0, -1.0, -2.0), (0.5, 0.0, 2.0), (2.0, 0.1, 0.0), (0.7, 0.2, 0.2)),),
    lights=(LIGHT, replace(LIGHT, corner=(-2.5, 1.0, -1.0), edge_u=(0.0, 0.0, 1.0), edge_v=(0.0, -1.0, 0.0))),
    background=(0.1, 0.2, 0.3),
)
"""One of each kind of primitive and two of most, axis-parallel and turned."""

MATERIALS = replace(
    EVERYTHING,
    room=replace(EVERYTHING.room, materials=(Mirror(), None, Conductor(0.5), None, None, None)),
    boxes=tuple(
        replace(b, material=m)
        for b, m in zip(EVERYTHING.boxes, (Dielectric(1.5), Dielectric(1.3), Conductor(0.1)), strict=True)
    ),
    spheres=tuple(replace(ball, material=Dielectric(1.8)) for ball in EVERYTHING.spheres),
)
"""Every kind of material, on every kind of surface that takes it, with different numbers."""

DAY = replace(
    EVERYTHING, room=None, background=(0.0, 0.0, 0.0), environment=scenes.canonical("daylight").environment
)
"""Lamps under a sky."""

SCENES = {
    **{name: scenes.canonical(name) for name in scenes.CANONICAL},
    "everything": EVERYTHING,
    "materials": MATERIALS,
    "day": DAY,
}
SETTINGS = [
    Settings(max_depth=3),
    Settings(max_depth=2, roulette_depth=1, heuristic="balance"),
    Settings(max_depth=2, strategy="light"),
    Settings(max_depth=1, sampler="sobol"),
    Settings(max_depth=2, strategy="bsdf"),
    Settings(max_depth=0, sampler="net"),
]


def components(values, *tuples):
    """Return the components (...) of the fields of named tuples, by the names that programs use."""
    fields = {name: value for t in tuples for name, value in t._asdict().items()}
    return {
        name + end: fields[name][..., i] if len(ends) > 1 else fields[name]
        for name, (ends, _) in values.items()
        for i, end in enumerate(ends)
    }


@pytest.mark.product
@pytest.mark.parametrize("settings", SETTINGS, ids=lambda s: f"{s.strategy}-{s.roulette_depth}-{s.sampler}")
@pytest.mark.parametrize("name", SCENES)
def test_programs_give_the_reference_s_bits(name, settings):
    """All programs at each depth, on the reference's own states, in float32, the same sine in both."""
    follow(SCENES[name], settings, STATEMENTS)


@pytest.mark.parametrize("name", ["minicubes", "everything"])
def test_loops_give_the_reference_s_bits(name):
    """As above, with every table of two primitives and more as a loop."""
    programs = follow(SCENES[name], Settings(max_depth=2), LISTS)
    loops = {"minicubes": [27, 2], "everything": [2, 2, 3]}[name]
    for program, results in ((programs.parts["arrive"], 2), (programs.parts["scatter"], 1)):
        found = [node["trips"] for node in program.nodes if node.op == "loop"]
        assert found == [trips for trips in loops for _ in range(results)]


@pytest.mark.parametrize("name", ["glossy", "daylight"])
def test_what_is_seen_past_mirrors_has_the_reference_s_bits(name):
    """PTK-20: at each vertex, with the paths that are alive; all ways end."""
    follow(SCENES[name], Settings(max_depth=4), STATEMENTS, seen=True)


@pytest.mark.parametrize("forms", [STATEMENTS, LISTS])
@pytest.mark.parametrize("name", ["minicubes", "glossy", "lone_light", "daylight"])
def test_shadow_rays_have_the_reference_s_bits(name, forms):
    """PTK-22: both shadow rays of the first hits."""
    follow(SCENES[name], Settings(max_depth=1), forms, shadow_rays=2)


def follow(scene, settings, forms, **asked):
    """Check all programs of a scene, and return them."""
    programs = lower_scene(scene, settings, forms, **asked)
    world = transport.build(scene, settings, np.float32)
    y, x = np.divmod(np.arange(16 * 12), 16)
    counters = transport.Counters(rng.counter(7), R.pixel_counter(x, y), rng.counter(3))
    basis = camera_basis(scene.camera, np.float32)
    path = R.start(
        basis, *(a.astype(np.float32) for a in (x, y)), 16, 12, counters, np.float32, settings.sampler
    )
    given = {"x": x.astype(np.uint32), "y": y.astype(np.uint32), "width": 16, "height": 12}
    given |= {"seed": counters.seed, "sample_number": counters.sample}
    check(interpret(programs.parts["start"], given), {**components(PATH, path), "pixel": counters.pixel})
    given |= {"pixel": counters.pixel}
    way, going_on = following.begin(path.direction), np.ones(len(x), bool)
    # Paths that have ended are computed on, in both.
    with np.errstate(all="ignore"):
        for depth in range(settings.max_depth + ("see" in programs.parts)):
            given |= components(PATH, path)
            path, surface, hit = transport.arrive(world, path)
            arrived = {**components(PATH, path), **components(SURFACE, surface, hit)}
            found = interpret(programs.parts["arrive"], given)
            check(found, {name: arrived[name] for name in found})
            given |= arrived
            layers = R.first_hit_layers(world, surface, hit, path.direction)
            looked = interpret(programs.parts["look"], given)
            assert list(looked) == names(LAYERS)
            check(
                looked,
                {n: v for k in LAYERS for n, v in zip(names({k: LAYERS[k]}), layers[k].T, strict=True)},
            )
            given["depth"] = rng.counter(depth)
            if "shadow" in programs.parts and not depth:
                check_shadows(programs, world, given, surface, hit, counters)
            if "see" in programs.parts:
                given |= {"alive": going_on, "way_going": way.going, "way_length": way.length}
                seen = interpret(programs.parts["see"], given)
                on, most = way._replace(going=way.going & going_on), following.most_followed(world)
                way, layers = following.see(world, on, path, surface, hit, given["depth"], most)
                wanted = dict(zip(names(SEEN), np.vstack([layers[k].T for k in SEEN]), strict=True))
                check(seen, {**wanted, "way_going": way.going, "way_length": way.length})
            path, alive = transport.scatter(world, path, surface, hit, given["depth"], counters)
            found, expected = (
                interpret(programs.parts["scatter"], given),
                {**components(PATH, path), "alive": alive},
            )
            if len(programs.parts["scatter"].nodes) == 1 + sum(
                n.op == "input" for n in programs.parts["scatter"].nodes
            ):
                # Where nothing is ever met: the state of paths that have all ended says nothing.
                found, expected = ({"alive": values["alive"]} for values in (found, expected))
            check(found, expected)
            going_on &= alive
    assert "see" not in programs.parts or not way.going.any()
    return programs


def check_shadows(programs, world, given, surface, hit, counters):
    """Check the program of shadow rays at first hits."""
    counters = counters._replace(sample=np.full_like(counters.pixel, counters.sample))
    lit = False
    for number in range(programs.shadow_rays):
        found = interpret(programs.parts["shadow"], {**given, "shadow_number": rng.counter(number)})
        wanted = transport.direct(world, surface, hit, counters, programs.shadow_rays, np.uint32(number))
        check(found, dict(zip(names(LIT), wanted.T, strict=True)))
        lit |= bool(wanted.any())
    assert lit


def check(found, expected):
    assert set(found) == set(expected)
    for name, values in expected.items():
        assert np.array_equal(np.broadcast_to(found[name], values.shape), values, equal_nan=True), name


def ops(program, op):
    return sum(node.op == op for node in program.nodes)


def from_input(program, op, prefix):
    """Count operations between a constant and an input whose name starts with `prefix`."""
    kinds = Counter()
    for node in program.nodes:
        operands = [program.nodes[arg] for arg in node.args]
        named = any(o.op == "input" and str(o["name"]).startswith(prefix) for o in operands)
        kinds[node.op] += named and any(o.op == "constant" for o in operands)
    return kinds[op]


def room_with(**parts):
    return Scene("room", Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0)), SCENES["furnace"].room, **parts)


def boxes(count, *rotation):
    return tuple(
        Box((0.01 * i, 0.02 * i * i, -0.3), (0.1 + 0.01 * i, 0.1, 0.1), GREY, *rotation) for i in range(count)
    )


@pytest.mark.parametrize("count", [1, 2, 20])
def test_a_rotation_that_boxes_share_is_applied_once(count):
    """TURNED times a vector: x and z times 0.8, 0 and +-0.6, y times 0 (twice, made once) and times 1 (y)."""
    arrive = lower_scene(room_with(boxes=boxes(count, TURNED)), Settings()).parts["arrive"]
    assert from_input(arrive, "multiply", "direction") == 7
    assert from_input(arrive, "multiply", "origin") == 7


@pytest.mark.parametrize("forms", [LISTS, USUAL, STATEMENTS])
def test_a_rotation_that_boxes_share_is_outside_of_their_loop(forms):
    """The same seven products: none of them depends on the row."""
    arrive = lower_scene(room_with(boxes=boxes(20, TURNED)), Settings(), forms).parts["arrive"]
    assert ops(arrive, "loop") == (2 if forms == LISTS else 0)
    inside = loops_of(arrive)[1]
    for prefix in ("direction", "origin"):
        assert from_input(arrive, "multiply", prefix) == 7
    read = [arrive.nodes[arg] for i in inside for arg in arrive.nodes[i].args]
    assert not [node for node in read if node.op == "input"]


def test_boxes_that_are_parallel_to_the_axes_are_not_rotated():
    arrive = lower_scene(room_with(boxes=boxes(5)), Settings()).parts["arrive"]
    assert from_input(arrive, "multiply", "direction") == from_input(arrive, "multiply", "origin") == 0


def test_what_a_scene_lacks_is_in_no_program():
    plain = lower_scene(room_with(), Settings()).parts
    assert ops(plain["arrive"], "sqrt") == ops(plain["arrive"], "take") == 0
    with_sphere = lower_scene(room_with(spheres=(Sphere((0.0, 0.0, 0.0), 0.1, GREY),)), Settings())
    assert ops(with_sphere.parts["arrive"], "sqrt") == 1
    # No light: one direction is sampled; its shadow ray, distance and cosines are not there.
    assert ops(plain["scatter"], "sqrt") == 1
    assert ops(plain["scatter"], "reciprocal") == 0
    assert (
        ops(lower_scene(room_with(lights=(LIGHT,)), Settings(strategy="bsdf")).parts["scatter"], "sqrt") == 1
    )
    assert ops(lower_scene(room_with(lights=(LIGHT,)), Settings()).parts["scatter"], "sqrt") == 2


def test_where_nothing_is_met_nothing_is_scattered():
    """PTK-4: the path's state is passed on, and it is not alive."""
    scatter = lower_scene(scenes.canonical("empty"), Settings()).parts["scatter"]
    (ended,) = (node for node in scatter.nodes if node.op != "input")
    assert (ended.op, ended["value"]) == ("constant", False)
    for name, index in scatter.outputs:
        node = scatter.nodes[index]
        assert node is ended if name == "alive" else (node.op, node["name"]) == ("input", name)


def test_a_sky_is_sampled_where_there_is_one():
    """Numbers: two for the direction, two and a choice for the sky."""
    scene = replace(SCENES["daylight"], spheres=(), environment=SCENES["daylight"].environment)
    assert ops(lower_scene(scene, Settings()).parts["scatter"], "convert") == 5
    assert ops(lower_scene(scene, Settings(strategy="bsdf")).parts["scatter"], "convert") == 2
    single = replace(scene, boxes=(), quads=(), spheres=SCENES["daylight"].spheres[1:])
    assert ops(lower_scene(single, Settings()).parts["scatter"], "convert") == 1


@pytest.mark.parametrize("material", [Lambertian(), Mirror(), Conductor(0.3)])
def test_one_material_needs_no_selection(material):
    """With one kind and one number nothing depends on which surface was hit, but that there is one."""
    walls = replace(SCENES["furnace"].room, materials=(material,) * 6)
    scatter = lower_scene(replace(room_with(lights=(LIGHT,)), room=walls), Settings()).parts["scatter"]
    index = next(
        i for i, node in enumerate(scatter.nodes) if node.op == "input" and node["name"] == "surface"
    )
    users = [node for node in scatter.nodes if index in node.args]
    # Two questions: is there a surface to gather light at, is the distance that of a hit? One node, by its
    # value.
    assert [user.op for user in users] == ["less"]
    assert ops(scatter, "take") == 0


def test_a_second_material_is_selected_by_surface():
    walls = SCENES["furnace"].room
    one, two = (
        lower_scene(
            replace(room_with(), room=replace(walls, materials=(material,) * 3 + (None,) * 3)), Settings()
        )
        for material in (None, Mirror())
    )
    # Three components of the direction, and the density; the throughput is the same.
    assert ops(two.parts["scatter"], "select") - ops(one.parts["scatter"], "select") >= 4
    assert one.parts["scatter"] == lower_scene(room_with(), Settings()).parts["scatter"]


@pytest.mark.parametrize(
    ("lights", "settings", "numbers"),
    [
        ((), Settings(), 2),
        ((LIGHT,), Settings(strategy="bsdf"), 2),
        ((LIGHT,), Settings(), 4),
        (EVERYTHING.lights, Settings(), 5),
        ((LIGHT,), Settings(roulette_depth=3), 5),
    ],
)
def test_only_random_numbers_that_are_used_are_made(lights, settings, numbers):
    """Two numbers for the direction, two for a point on a light, one to choose it, one for roulette."""
    scatter = lower_scene(room_with(lights=lights), settings).parts["scatter"]
    assert ops(scatter, "convert") == numbers


def test_programs_are_numbers_without_vectors_and_without_what_nothing_needs():
    for program in lower_scene(EVERYTHING, Settings()).parts.values():
        assert all(not node.type.shape for node in program.nodes)
        used = {arg for node in program.nodes for arg in node.args} | {i for _, i in program.outputs}
        assert all(i in used or node.op == "input" for i, node in enumerate(program.nodes))
        assert not {"stack", "component", "parameter"} & {node.op for node in program.nodes}
