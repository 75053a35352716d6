"""Shapes: how a new one is added (SHP-1, SHP-2). What the kinds do: test_intersection.py."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

from wamnet.compiler.core.loops import LISTS, STATEMENTS, TREES, Forms
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels import open_executor, render_on
from wamnet.refimpl import vectors
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import intersection, scene
from wamnet.refimpl.light.materials import Material, Mirror
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scene import Camera, Light, Scene, Sphere, Vector
from wamnet.refimpl.light.shapes import SHAPES, Shape, kinds
from wamnet.refimpl.light.shapes.shape import BLACK, MISS, Met, away_from_zero, require
from wamnet.refimpl.light.transport import Settings

GREY = (0.5, 0.25, 0.125)


@dataclass(frozen=True)
class Disk(Shape):
    """A disk, which the project does not have. Place 1: a file."""

    kind = "disks"

    center: Vector
    axis: Vector
    radius: float
    reflectance: Vector
    emission: Vector = BLACK
    material: Material | None = None

    def check(self, path: str) -> None:
        """Refuse a radius of 0 and below."""
        require(self.radius > 0.0, self.radius, f"{path}.radius", "must be positive", "use another")

    @property
    def row(self) -> tuple[Any, ...]:
        """Centre, axis and radius."""
        return self.center, self.axis, self.radius

    @staticmethod
    def distance(row: tuple[Any, ...], origin: Any, direction: Any) -> Any:
        """Return the distance (...) of the plane where it is met inside the radius."""
        center, axis, radius = row
        t = vectors.dot(center - origin, axis) / away_from_zero(vectors.dot(direction, axis))
        offset = origin + vectors.scale(direction, t) - center
        inside = vectors.dot(offset, offset) <= radius * radius
        return np.where((t > 0.0) & inside, t, MISS)

    @staticmethod
    def normal(row: tuple[Any, ...], met: Met) -> Any:
        """Return the axis."""
        return row[1]


@dataclass(frozen=True)
class SceneOfDisks(Scene):
    """Place 2: a list of the scene. Place 3 is a line of the registry."""

    disks: tuple[Disk, ...] = field(default=(), metadata={"omitted at its default": True})


DISKS = (
    Disk((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 1.0, GREY),
    Disk((0.0, 0.5, 0.0), (0.0, 0.0, 1.0), 0.25, GREY, material=Mirror()),
)
SCENE = SceneOfDisks(
    "disks",
    Camera((0.0, 2.0, 4.0), (0.0, 0.0, 0.0)),
    spheres=(Sphere((0.5, 0.25, 0.0), 0.25, GREY),),
    lights=(Light((-1.0, 3.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 1.0, 1.0), 20.0),),
    disks=DISKS,
)


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SHAPES, "disks", Disk)  # type: ignore[arg-type]


def test_quads_are_numbered_last(known: None) -> None:
    """Lights follow them, and the tables of materials end before the lights."""
    assert [kind.kind for kind in kinds()] == ["boxes", "spheres", "disks", "quads"]
    assert len(intersection.materials_by_id(SCENE)) == 3


def test_a_new_shape_s_rules_are_applied(known: None) -> None:
    assert scene.validate(SCENE) is SCENE
    assert scene.primitives(SCENE) == 4
    flat = replace(SCENE, disks=(replace(DISKS[0], radius=0.0),))
    with pytest.raises(InputError, match=r"scene\.disks\[0\]\.radius 0\.0: must be positive"):
        scene.validate(flat)
    black = replace(SCENE, disks=(replace(DISKS[0], reflectance=(2.0, 0.0, 0.0)),))
    with pytest.raises(InputError, match=r"scene\.disks\[0\]\.reflectance .*: a reflectance must lie in"):
        scene.validate(black)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_rays_meet_a_new_shape(known: None, dtype: Any) -> None:
    """Straight down, once inside the radius and once beside it; up from below; at the upright one."""
    geometry = intersection.build(SCENE, dtype)
    o = np.array([[-0.5, 2, 0.5], [1.5, 2, 0], [-0.5, -1, 0.5], [0, 0.5, 2]], dtype)
    d = np.array([[0, -1, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1]], dtype)
    hit = intersection.closest_hit(geometry, o, d)
    assert hit.t.tolist() == [2.0, dtype(MISS), 1.0, 2.0]
    assert hit.surface.tolist() == [1, geometry.nothing, 1, 2]
    normal = intersection.surface_at(geometry, hit, o, d).normal
    assert normal.tolist() == [[0, 1, 0], [0, 0, 0], [0, -1, 0], [0, 0, 1]]


@pytest.mark.parametrize("forms", [STATEMENTS, LISTS, TREES])
def test_a_new_shape_compiles(known: None, forms: Forms) -> None:
    """As statements and as a loop, for both languages of paths."""
    programs = lower_scene(SCENE, Settings(), forms)
    for target in ("opencl", "opengl"):
        assert compile_path(programs, target).source


def test_kernels_show_a_new_shape_as_the_reference_does(known: None) -> None:
    """Traced programs of it are those of the reference, to the bit."""
    # Of one sample: kernels round the sum of several.
    job = Job(24, 16, 1, settings=Settings(max_depth=3))
    with open_executor("numpy") as executor:
        found = render_on(executor, SCENE, job)
    wanted = render(SCENE, job)
    for name, layer in wanted.frame.layers.items():
        assert np.array_equal(found.frame.layers[name], layer), name
