"""Numbers of a scene as inputs: the same bits as the kernel of constants, for every scene that moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.core.ir import Node, attributes
from wamnet.compiler.core.passes.rewrite import rewrite
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.scenes.scene_inputs import SceneInputs, lay_out, varying
from wamnet.kernels.devices.executor import Part
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings

SETTINGS = Settings(max_depth=1)
PART = Part(10, 8, 0, 8, 0, 1, 7)


def bind(programs, values):
    """Return the programs with constants instead of the inputs that have values."""

    def rule(builder, node, args):
        if node.op != "input" or node["name"] not in values:
            return None
        return builder.add(Node("constant", (), node.type, attributes(value=float(values[node["name"]]))))

    return replace(
        programs, inputs=(), **{name: rewrite(part, rule) for name, part in programs.parts().items()}
    )


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


def test_another_number_gives_another_picture():
    """The rotation, the camera and the lights do reach the picture."""
    inputs, scene = inputs_of("minicubes"), at("minicubes", 0.05)
    programs, executor = lower_scene(scene, SETTINGS, moving=inputs), NumpyExecutor()
    values = dict(zip(inputs.names, inputs.values(scene), strict=True))
    still = executor.trace(compile_path(bind(programs, values), "numpy"), PART)
    for name, value in values.items():
        moved = bind(programs, {**values, name: value + 0.25})
        assert not np.array_equal(executor.trace(compile_path(moved, "numpy"), PART), still), name


def test_what_moves_and_what_stays():
    """The mini cubes: six numbers of a rotation, the camera, and the colours; equal numbers are shared."""
    inputs = inputs_of("minicubes")
    firsts = [places[0] for places in inputs.places]
    groups = {path.partition(".")[0] + "." + path.partition(".")[2].split(".")[0] for path, _ in firsts}
    assert groups == {"world.geometry", "world.lights", "camera.position", "camera.right", "camera.up"} | {
        "camera.forward"
    }
    assert sum(path == "world.geometry.groups.0.rotation" for path, _ in firsts) == 6
    shared = [{path for path, _ in places} for places in inputs.places]
    assert {"world.geometry.emission", "world.lights.radiance"} in shared
    only_time = varying([at("minicubes", 0.05), at("minicubes", 0.6)], SETTINGS)
    assert len(only_time.places) == 6


def test_a_scene_of_another_form_is_refused():
    """The blocks of `glossy` are not turned at time 0: their group has no rotation."""
    with pytest.raises(CompileError, match=r"laid out in another way.*leave these out"):
        varying([at("glossy", 0.05), at("glossy", 0.0)], SETTINGS)


def test_a_language_without_scene_numbers_refuses_them():
    programs = lower_scene(at("minicubes", 0.05), SETTINGS, moving=inputs_of("minicubes"))
    with pytest.raises(CompileError, match="take no numbers of the scene"):
        compile_path(programs, "opencl")


def test_nothing_that_moves_is_nothing_that_is_given():
    scene = at("cornell", 0.0)
    assert varying([scene, scene], SETTINGS).places == ()
    plain = lower_scene(scene, SETTINGS)
    assert lower_scene(scene, SETTINGS, moving=SceneInputs(SETTINGS, ())) == plain
    assert bind(plain, {}).parts() == plain.parts()


def test_opening_leaves_the_constants_alone():
    """Inputs are put into copies."""
    scene, inputs = at("minicubes", 0.05), inputs_of("minicubes")
    laid = lay_out(scene, SETTINGS)
    opened = inputs.opened(laid, dict.fromkeys(inputs.names, 0.0))
    assert laid["camera"].position.dtype == np.float32
    assert opened["camera"].position.dtype == object
    assert opened["world"].geometry.reflectance is laid["world"].geometry.reflectance
