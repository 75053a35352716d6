"""Numbers of a scene as inputs: the same bits as the kernel of constants, for every scene that moves."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.core.ir import Node, attributes
from wamnet.compiler.core.passes.rewrite import rewrite
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import can_move, compile_path, feature_pass
from wamnet.compiler.scenes.scene_inputs import SceneInputs, lay_out, tables_of, varying
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.refimpl.errors import CompileError, InputError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Sphere
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import Normalization

SETTINGS = Settings(max_depth=1)
PART = Part(10, 8, 0, 8, 0, 1, 7)


def bind(programs, values):
    """Return the programs with constants instead of the inputs that have values."""

    def rule(builder, node, args):
        if node.op != "input" or node["name"] not in values:
            return None
        return builder.add(Node("constant", (), node.type, attributes(value=float(values[node["name"]]))))

    parts = {name: rewrite(part, rule) for name, part in programs.parts.items()}
    return replace(programs, inputs=(), parts=parts)


def at(name, time):
    """Return a canonical scene."""
    return scenes.canonical(name, time=time)


def other(scene, seed):
    """Return the scene with other light colours, seen from elsewhere."""
    drawn = np.random.default_rng(seed)
    place = tuple(np.add(scene.camera.position, drawn.uniform(-0.5, 0.5, 3)))
    lights = tuple(replace(light, color=tuple(drawn.uniform(0.1, 1.0, 3))) for light in scene.lights)
    return replace(scene, lights=lights, camera=replace(scene.camera, position=place))


def inputs_of(name):
    """Return the inputs that time, camera and light colours need."""
    first = at(name, 0.05)
    return varying([first, at(name, 0.6), at(name, 3.3), other(first, 1), other(first, 2)], SETTINGS)


@pytest.mark.nightly(but=("furnace", "daylight"))
@pytest.mark.parametrize("name", scenes.CANONICAL)
def test_a_kernel_with_inputs_gives_the_bits_of_one_of_constants(name):
    """At a time, from a place and in colours that the inputs were not found with."""
    inputs, wanted = inputs_of(name), other(at(name, 1.7), 3)
    programs = lower_scene(at(name, 0.05), SETTINGS, moving=inputs)
    assert programs.inputs == inputs.names
    bound = bind(programs, dict(zip(inputs.names, inputs.values(wanted), strict=True)))
    executor = NumpyExecutor()
    found = executor.trace(compile_path(bound, "numpy"), PART)
    expected = executor.trace(compile_path(lower_scene(wanted, SETTINGS), "numpy"), PART)
    assert np.array_equal(found, expected)
    assert np.ptp(expected) > 0 or name == "empty"


def test_a_scene_of_another_form_is_refused():
    """The blocks of `glossy` are not turned at time 0: their group has no rotation."""
    with pytest.raises(CompileError, match=r"its layout differs.*leave these out"):
        varying([at("glossy", 0.05), at("glossy", 0.0)], SETTINGS)


@pytest.mark.parametrize("host", ["shadertoy", "godot"])
def test_a_host_without_a_place_for_numbers_refuses_them(host):
    programs = lower_scene(at("minicubes", 0.05), SETTINGS, moving=inputs_of("minicubes"))
    with pytest.raises(CompileError, match=r"take at most 0 scene parameters, and \d+ move"):
        feature_pass(programs, "color", Normalization(), host, [])


def moved(count, by):
    """Return the empty scene with balls, each of which moves in its own way."""
    balls = tuple(
        Sphere((0.1 * i + by, by * i, -0.2 * i), 0.05 + 0.01 * by * i, (0.2, 0.5, 0.1))
        for i in range(1, count + 1)
    )
    return replace(at("empty", 0.0), spheres=balls)


def test_which_numbers_one_kernel_should_take():
    """Not more than a fragment shader has uniforms for, and no rows of a table that would be a loop.

    The mini cubes, ten of which more make them a loop, share their rotation: it moves nothing but itself.
    """
    for count, takes in {5: {"opencl", "opengl", "c"}, 40: {"opengl"}, 210: set()}.items():
        some = [moved(count, by) for by in (0.0, 0.1, 0.25)]
        inputs, tables = varying(some, SETTINGS), tables_of(some[0], SETTINGS)
        assert len(inputs.places) >= 3 * count
        found = {name for name in ("opencl", "opengl", "c") if can_move(name, some[0], tables, inputs)}
        assert found == takes
    cubes = [at("minicubes", time) for time in (0.05, 0.6)]
    more = [replace(scene, boxes=scene.boxes + scene.boxes[:10]) for scene in cubes]
    inputs, tables = varying(more, SETTINGS), tables_of(more[0], SETTINGS)
    assert len(inputs.places) == 6
    assert can_move("opencl", more[0], tables, inputs)


def test_what_fits_and_what_widens():
    """Scenes that differ in inputs only fit; others widen them, and shared numbers part if they differ."""
    first, later = at("minicubes", 0.05), at("minicubes", 0.6)
    inputs = varying([first, later], SETTINGS)
    tables, red = tables_of(first, SETTINGS), tables_of(other(later, 1), SETTINGS)
    assert inputs.fits(tables, tables_of(at("minicubes", 5.5), SETTINGS))
    assert not inputs.fits(tables, red)
    assert not inputs.fits(tables, tables_of(at("cornell", 0.1), SETTINGS))
    wide = inputs.widened([tables, red])
    assert wide.fits(tables, red)
    assert wide.fits(tables, tables_of(at("minicubes", 2.5), SETTINGS))
    assert {place for places in inputs.places for place in places} < {p for each in wide.places for p in each}
    (light,) = (places for places in wide.places if ("world.lights.radiance", 0) in places)
    assert len(light) > 1
    parted = {path: table.copy() for path, table in red.items()}
    parted["world.lights.radiance"].reshape(-1)[0] += 1.0
    assert not wide.fits(tables, parted)
    assert wide.widened([tables, parted]).fits(tables, parted)


@pytest.mark.nightly(but="opengl-egl-1")
@pytest.mark.parametrize(("name", "lanes"), [("opencl", 16), ("opencl", 1), ("c", 1), ("opengl-egl", 1)])
@pytest.mark.needs("devices")
def test_a_kernel_with_inputs_draws_what_the_constant_one_draws(executor_named, name, lanes):
    """PTK-18: to the bit, where a device folds constants as the compiler does: each operation in float32."""
    executor, inputs = executor_named(name), inputs_of("minicubes")
    wanted, settings = other(at("minicubes", 1.7), 3), SETTINGS
    programs = lower_scene(at("minicubes", 0.05), settings, moving=inputs)
    kernel = compile_path(programs, executor.name, lanes=lanes)
    constant = compile_path(lower_scene(wanted, settings), executor.name, lanes=lanes)
    part = Part(37, 21, 1, 17, 2, 3, 9)
    found, expected = executor.trace(kernel, part, inputs.values(wanted)), executor.trace(constant, part)
    assert np.ptp(expected) > 0
    assert np.array_equal(found, expected)
    own = compile_path(lower_scene(at("minicubes", 0.05), settings), executor.name, lanes=lanes)
    assert np.array_equal(executor.trace(kernel, part), executor.trace(own, part))
    with pytest.raises(InputError, match=r"scene parameters 'float32 of shape \(1,\)': must be float32"):
        executor.trace(kernel, part, np.zeros(1, np.float32))


def test_the_manifest_lists_the_numbers():
    """PTK-18: index, places and value of each; a scene that does not move has no such entry."""
    scene, inputs = at("minicubes", 0.05), inputs_of("minicubes")
    made = compile_path(lower_scene(scene, SETTINGS, moving=inputs), "c")
    listed, tables = made.manifest["numbers"], tables_of(scene, SETTINGS)
    assert [each["index"] for each in listed] == list(range(len(inputs.places)))
    for each in listed:
        for place in each["places"]:
            assert np.float32(each["value"]) == tables[place["table"]].reshape(-1)[place["index"]]
    assert np.array(made.programs.values, np.float32).tobytes() == inputs.values(scene).tobytes()
    assert f"scene_numbers: {len(listed)} floats" in made.manifest["arguments"]
    assert f"all of the scene but {len(listed)} numbers" in made.source
    assert "numbers" not in compile_path(lower_scene(scene, SETTINGS), "c").manifest


def test_nothing_that_moves_is_nothing_that_is_given():
    scene = at("cornell", 0.0)
    assert varying([scene, scene], SETTINGS).places == ()
    plain = lower_scene(scene, SETTINGS)
    assert lower_scene(scene, SETTINGS, moving=SceneInputs(SETTINGS, ())) == plain
    assert bind(plain, {}).parts == plain.parts


def test_opening_leaves_the_constants_alone():
    """Inputs are put into copies."""
    scene, inputs = at("minicubes", 0.05), inputs_of("minicubes")
    laid = lay_out(scene, SETTINGS)
    opened = inputs.opened(laid, dict.fromkeys(inputs.names, 0.0))
    assert laid["camera"].position.dtype == np.float32
    assert opened["camera"].position.dtype == object
    assert opened["world"].geometry.reflectance is laid["world"].geometry.reflectance
