"""Scenes as triangles, for formats that have nothing else: every part of every shot."""

from dataclasses import replace

import numpy as np
import pytest
from triangles import ReadSurface, shape_differences, volume, wanted

from wamnet.refimpl.light.materials import Conductor, Lambertian, Mirror
from wamnet.refimpl.light.scene import Room, Sphere
from wamnet.refimpl.light.scenes import empty
from wamnet_verify.cases import questions
from wamnet_verify.parts import MATTE, METAL, MIRROR, NotExpressed, meshes_of, parts_of, sky_of
from wamnet_verify.run import shots_of

SHOTS = {shot.name: shot for shot in shots_of(questions())}


def surface(mesh):
    """Return a mesh as it is read of a file."""
    points, normals = mesh.points.astype(float), mesh.normals.astype(float)
    look = (mesh.look.kind, mesh.look.reflectance, mesh.look.emission, mesh.look.number)
    return ReadSurface(points, normals, mesh.corners, *look, mesh.front, mesh.thick)


@pytest.mark.parametrize("name", SHOTS)
def test_meshes_are_the_parts(name):
    scene = SHOTS[name].scene
    found = [surface(mesh) for mesh in meshes_of(parts_of(scene))]
    for part, want in zip(found, wanted(scene), strict=True):
        assert [*shape_differences(part, want)] == []
        assert part.front == want.front


def test_walls_have_materials():
    """Walls of mirrors and of metal were written as matte ones, in silence."""
    materials = (Mirror(), None, Conductor(0.3), Lambertian(), None, Mirror())
    colors = tuple((0.1 * wall, 0.5, 1.0) for wall in range(6))
    room = Room((-1.0, 0.0, -2.0), (1.0, 2.0, 2.0), colors, materials=materials)
    looks = [mesh.look for mesh in meshes_of(parts_of(replace(empty(), room=room)))]
    assert [look.kind for look in looks] == [MIRROR, MATTE, METAL, MATTE, MATTE, MIRROR]
    assert tuple(look.reflectance for look in looks) == colors
    ball = Sphere((0.0, 1.0, 0.0), 0.5, (0.5, 0.5, 0.5), material=Conductor(0.3))
    (like,) = meshes_of(parts_of(replace(empty(), spheres=(ball,))))
    assert looks[2].number == like.look.number != 0.0
    shining = replace(room, emission=(1.0, 1.0, 1.0))
    with pytest.raises(NotExpressed, match="mirror that emits"):
        meshes_of(parts_of(replace(empty(), room=shining)))


def test_a_sky_surrounds_all():
    """A cube that faces inwards, four times as far as the farthest point; a black sky is nothing."""
    scene = SHOTS["matte-floor"].scene
    meshes = meshes_of(parts_of(scene))
    sky = [surface(mesh) for mesh in sky_of(scene, meshes)]
    assert np.abs([side.points for side in sky]).max() == 80.0
    # A mean of three points and a third are rounded, and the twelve terms of the sum.
    assert abs(sum(map(volume, sky)) / 160.0**3 + 1.0) <= 64 * 2.0**-53
    assert {(side.color, side.emission, side.front) for side in sky} == {((0.0,) * 3, (1.0,) * 3, True)}
    assert sky_of(SHOTS["lamp-below"].scene, []) == []
