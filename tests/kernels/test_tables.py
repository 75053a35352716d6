"""Many primitives as tables, loops and trees (PTK-14, PTK-19): the unrolled kernel's image, to the bit."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.core.ir import Type
from wamnet.compiler.core.loops import LISTS, STATEMENTS, TREES, USUAL, Forms
from wamnet.compiler.core.trace import trace
from wamnet.compiler.core.verify import verify
from wamnet.compiler.scenes import hierarchy
from wamnet.compiler.scenes.hierarchy import list_cost, row_cost
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import language_named
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.run.render_on import frames_of, render_on
from wamnet.refimpl import vectors
from wamnet.refimpl.light import intersection
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light.scene import IDENTITY, Box, Camera, Light, Quad, Room, Scene, Sphere
from wamnet.refimpl.light.scenes import CANONICAL, canonical
from wamnet.refimpl.light.transport import Settings

U = 2.0**-24
"""Unit roundoff of float32."""

SETTINGS = Settings(max_depth=2)
LOOP = re.compile(r"for \(int i = 0; i < (\d+); \+\+i\) {")
"""A loop over the rows of tables, in OpenCL C and in GLSL."""

LIGHT = Light((-0.3, 0.99, -0.3), (0.6, 0.0, 0.0), (0.0, 0.0, 0.6), (1.0, 0.9, 0.8), 3.0)
CLOSED = Room((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), ((0.6, 0.7, 0.8),) * 6)


def turned(angle):
    c, s = np.cos(angle), np.sin(angle)
    return ((c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c))


def box(random, rotation):
    return Box(place(random), tuple(random.uniform(0.05, 0.2, 3)), color(random), rotation)


def place(random):
    return tuple(random.uniform(-0.7, 0.7, 3))


def color(random):
    return tuple(random.uniform(0.2, 0.9, 3))


MAKERS = {
    "shared": lambda random, i: box(random, turned(0.4)),
    "parallel": lambda random, i: box(random, IDENTITY),
    "turned": lambda random, i: box(random, turned(0.13 * i + 0.1)),
    "sphere": lambda random, i: Sphere(place(random), random.uniform(0.05, 0.2), color(random)),
    "quad": lambda random, i: Quad(place(random), (0.3, 0.1, 0.0), (0.0, 0.2, 0.3), color(random)),
}
"""One primitive of each kind that has a loop of its own."""


def crowd(*counts, lights=(LIGHT,), **parts):
    """Return a scene with so many primitives of the named kinds: ("sphere", 3), ..."""
    random = np.random.default_rng(7)
    made = [MAKERS[kind](random, i) for kind, count in counts for i in range(count)]
    kinds = {"boxes": Box, "spheres": Sphere, "quads": Quad}
    found = {name: tuple(p for p in made if isinstance(p, kind)) for name, kind in kinds.items()}
    camera = Camera((0.0, 0.1, 0.95), (0.0, 0.0, 0.0), vertical_fov_deg=80.0)
    return Scene("crowd", camera, CLOSED, lights=lights, **{**found, **parts})


EVERY_KIND = crowd(*((kind, 6) for kind in MAKERS), lights=(LIGHT, replace(LIGHT, corner=(-0.9, 0.9, -0.9))))
SCENES = {
    "mixture": EVERY_KIND,
    "one of each kind": crowd(*((kind, 1) for kind in MAKERS)),
    "no light, no room": replace(EVERY_KIND, lights=(), room=None, background=(0.4, 0.5, 0.6)),
}


def sums(executor, scene, forms, size=(24, 16), samples=2):
    """Return the kernel's text and its sums (planes, rows, width)."""
    programs = lower_scene(scene, SETTINGS, forms)
    kernel = compile_path(programs, executor.name, lanes=executor.lanes)
    return kernel.source, executor.trace(kernel, Part(*size, 0, size[1], 0, samples, 3))


@pytest.mark.product
@pytest.mark.parametrize("name", SCENES)
def test_a_loop_computes_what_statements_compute(executor, name):
    """The same operations in the same order, one a statement: no compiler contracts them, no bit differs."""
    (unrolled, expected), (looped, found) = (
        sums(executor, SCENES[name], forms) for forms in (STATEMENTS, LISTS)
    )
    assert unrolled != looped or name == "one of each kind"
    assert np.isfinite(expected).all()
    assert expected[0].std() > 0
    assert np.array_equal(found, expected)


def shown(executor, scene, trips):
    """Check that the usual kernel of a scene has such loops, and shows the reference's image.

    99 pixels in 100 to 1e-5 of the layer's size (168 u: a distance with 64 u s of error, twice, and sums), as
    in test_paths.py.
    """
    job = R.Job(24, 16, 1, 3, SETTINGS)
    kernel = frames_of(scene).of(executor, scene, job).kernel
    if executor.name == "numpy":
        # Two numbers are carried to the next surface, one by shadow rays.
        found = [int(n) for n in re.findall(r"trips=(\d+)}", kernel.source)]
        assert found == [t for t in trips for _ in range(2)] + trips
    else:
        assert [int(n) for n in LOOP.findall(kernel.source)] == trips * 2
    expected, found = R.render(scene, job).frame, render_on(executor, scene, job).frame
    for layer, values in expected.layers.items():
        size = np.abs(values).max(axis=-1, keepdims=True) + np.abs(values).mean()
        near = np.abs(found[layer] - values) <= 168 * U * size
        assert near.all(axis=-1).mean() >= 0.99, layer


@pytest.mark.nightly(but=("numpy-0", "numpy-1", "opencl-0"))
@pytest.mark.parametrize("more", [0, 1])
def test_loops_begin_above_the_threshold(executor, more):
    """As many spheres, beside a light, as are statements, and one more, for which there is a loop."""
    few = language_named(executor.name).forms.few
    light, sphere = (row_cost(intersection.build(crowd(*p)).groups[0]) for p in ((), (("sphere", 2),)))
    scene = crowd(("sphere", int((few - light) // sphere) + more))
    assert (list_cost(intersection.build(scene)) > few) == bool(more)
    shown(executor, scene, [len(scene.spheres)] if more else [])


def test_thresholds():
    """What is known to be worth it: the canonical scenes are statements on every target."""
    assert language_named("numpy").forms == USUAL
    assert language_named("opencl").forms == language_named("c").forms == replace(USUAL, trees=True)
    assert language_named("opengl").forms == Forms(few=10000.0)
    for name in CANONICAL:
        programs = lower_scene(canonical(name), SETTINGS, language_named("opencl").forms).parts.values()
        assert not any(node.op == "loop" for program in programs for node in program.nodes), name


TREE = re.compile(r"for \(int visit = 0; visit < (\d+); \+\+visit\) {")
"""A walk along a tree."""

GROWN = {
    "mixture": crowd(
        *((kind, 12) for kind in MAKERS), lights=(LIGHT, replace(LIGHT, corner=(-0.9, 0.9, -0.9)))
    ),
    "no light, no room": replace(
        crowd(*((kind, 12) for kind in MAKERS)), lights=(), room=None, background=(0.4, 0.5, 0.6)
    ),
}
"""Scenes of enough primitives for a tree."""


@pytest.mark.product
@pytest.mark.parametrize("name", GROWN)
def test_a_tree_computes_what_the_list_computes(denoiser, name, monkeypatch):
    """The same bits, whichever paths go together; nodes are taken for cheap, so that each kind has a tree."""
    monkeypatch.setattr(hierarchy, "VISIT", 5.0)
    (listed, expected), (grown, found) = (sums(denoiser, GROWN[name], forms) for forms in (LISTS, TREES))
    assert listed != grown
    assert denoiser.name == "numpy" or len(TREE.findall(grown)) == 1 + bool(GROWN[name].lights)
    assert expected[0].std() > 0
    assert np.array_equal(found, expected)


@pytest.mark.nightly(but="4")
@pytest.mark.parametrize("lanes", [1, 4, 8])
def test_a_tree_is_the_same_for_any_number_of_lanes(executor_named, lanes, monkeypatch):
    monkeypatch.setattr(hierarchy, "VISIT", 5.0)
    executor, part = executor_named("opencl"), Part(24, 16, 0, 16, 0, 2, 3)
    programs = lower_scene(GROWN["mixture"], SETTINGS, TREES)
    one, other = (compile_path(programs, "opencl", lanes=n) for n in (16, lanes))
    assert np.array_equal(executor.trace(one, part), executor.trace(other, part))


def test_a_mask_of_lanes_tells_what_the_or_of_their_halves_tells(executor_named, monkeypatch):
    """PTK-19: a processor without the instruction has the same bits."""
    monkeypatch.setattr(hierarchy, "VISIT", 5.0)
    executor, part = executor_named("opencl"), Part(24, 16, 0, 16, 0, 2, 3)
    kernel = compile_path(lower_scene(GROWN["mixture"], SETTINGS, TREES), "opencl", lanes=16)
    source = kernel.source.replace("defined(__AVX512DQ__)", "0")
    assert source != kernel.source
    plain = replace(kernel, source=source, manifest={**kernel.manifest, "digest": "without masks"})
    assert np.array_equal(executor.trace(kernel, part), executor.trace(plain, part))


@pytest.mark.product
@pytest.mark.parametrize("first", [0, 2])
def test_of_coincident_faces_a_tree_takes_the_first_listed(executor, first, monkeypatch):
    """Coincident shapes in a tree: as the list does, though leaves are met in another order."""
    monkeypatch.setattr(hierarchy, "VISIT", 1.0)
    monkeypatch.setattr(hierarchy, "LEAST_ROWS", 2)
    (listed, expected), (grown, found) = (sums(executor, coincident(first), f) for f in (LISTS, TREES))
    assert listed != grown
    assert np.array_equal(found, expected)


def carried_about(surface):
    """Return three numbers after a fold: two trade places, one is what the last row makes of it."""
    rows = (np.array([0.5, -2.0, 4.0], np.float32), np.array([7, 1, 3], np.int32))

    def step(values, number, integer):
        a, b, same, _ = values
        return b + number, a, same, number * same + integer.astype(np.float32)

    return vectors.fold_rows(step, rows, (surface, surface * 0.5, surface * 2.0, surface))


def test_numbers_that_trade_places(executor):
    """A loop of our own instead of the first hit's layers; halves and small integers are exact."""
    programs = lower_scene(crowd(), Settings(max_depth=0))
    names = ("albedo_r", "albedo_g", "albedo_b", "depth")

    def look(surface):
        return dict(zip(names, carried_about(surface.astype(np.float32)), strict=True))

    program = trace(look, {"surface": Type("int32")}, most_unrolled=0)
    programs = replace(programs, parts={**programs.parts, "look": verify(program)})
    kernel = compile_path(
        programs, executor.name, lanes=executor.lanes, groups=("albedo", "depth", "last_surface")
    )
    *found, surface = executor.trace(kernel, Part(24, 16, 0, 16, 0, 1, 3))
    assert len(np.unique(surface)) >= 4
    for values, expected in zip(found, carried_about(surface), strict=True):
        assert np.array_equal(values, expected)


def coincident(first):
    """Return five boxes that are one box, with the reflectances of different ones, and quads in one face."""
    boxes = [Box((0.0, 0.0, 0.0), (0.4, 0.3, 0.2), (0.1 * (i + 1), 0.5, 0.5), turned(0.3)) for i in range(5)]
    boxes = boxes[first:] + boxes[:first]
    spheres = tuple(Sphere((0.6, 0.5, 0.1), 0.2, (0.5, 0.1 * (i + 1), 0.5)) for i in range(4))
    corner, edges = (-0.8, -0.9, 0.2), ((0.5, 0.0, 0.0), (0.0, 0.5, 0.0))
    quads = tuple(Quad(corner, *edges, (0.5, 0.5, 0.1 * (i + 1))) for i in range(4))
    return crowd(boxes=tuple(boxes), spheres=spheres, quads=quads)


@pytest.mark.parametrize("first", [0, 2])
def test_of_coincident_faces_the_first_listed_wins(executor, first):
    scene = coincident(first)
    source, found = sums(executor, scene, LISTS, samples=1)
    assert ("loop" if executor.name == "numpy" else "int i") in source
    albedo = np.moveaxis(found[6:9], 0, -1).reshape(-1, 3)
    walls = np.float32(CLOSED.reflectances[0])
    seen = {tuple(color) for color in albedo[np.any(albedo != walls, axis=-1)].tolist()}
    listed = (scene.boxes[0], scene.spheres[0], scene.quads[0])
    assert seen - {(0.0, 0.0, 0.0)} == {tuple(np.float32(p.reflectance).tolist()) for p in listed}
