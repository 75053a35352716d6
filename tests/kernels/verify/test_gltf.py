"""glTF files: their form, what they say, and what they cannot say (VRF-14)."""

import base64
import json
import math
from functools import lru_cache

import numpy as np
import pytest
from triangles import U32, U64, ReadFile, ReadSurface, areas, differences, volume

from wamnet.refimpl.light.materials import Dielectric
from wamnet.refimpl.light.scene import Scene, Sphere
from wamnet.refimpl.light.scenes import empty
from wamnet_verify.cases import Shot, questions
from wamnet_verify.parts import NotExpressed, written
from wamnet_verify.run import shots_of

SHOTS = {shot.name: shot for shot in shots_of(questions())}
WRITTEN = [name for name in SHOTS if name != "layers-miss"]
SEED = 7

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""Types of components (glTF 2.0, 3.6.2.2)."""

SIZES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}

RANGES = {
    "specularFactor": (0.0, 1.0),
    "transmissionFactor": (0.0, 1.0),
    "ior": (1.0, math.inf),
    "thicknessFactor": (0.0, math.inf),
    "emissiveStrength": (0.0, math.inf),
}
"""Values that the extensions allow."""


# ---- the form of a file ---------------------------------------------------------------------------------


def data_of(buffer):
    """Return the bytes of a buffer that is inside of the file."""
    return data_at(buffer["uri"])


@lru_cache(maxsize=1)
def data_at(address):
    """Return the bytes of an address that holds them; a file has one, and is asked many times."""
    head, _, text = address.partition(",")
    assert head == "data:application/octet-stream;base64"
    return base64.b64decode(text, validate=True)


def array_of(data, number):
    """Return an accessor's array (count, n)."""
    accessor = data["accessors"][number]
    view = data["bufferViews"][accessor["bufferView"]]
    kind = np.dtype(COMPONENTS[accessor["componentType"]])
    length = accessor["count"] * SIZES[accessor["type"]]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    raw = data_of(data["buffers"][view["buffer"]])[start : start + length * kind.itemsize]
    return np.frombuffer(raw, kind).reshape(accessor["count"], -1)


def wrong(data):
    """Yield what of a file is against the specification of glTF 2.0, its sections in brackets."""
    if data["asset"].get("version") != "2.0":
        yield "version [3.2]"
    if any(value == [] for value in data.values()):
        yield "an empty list [3.3]"
    yield from wrong_buffers(data)
    if wrong_numbers := [*numbers_out_of_range(data)]:
        yield from wrong_numbers
        return
    for mesh in data["meshes"]:
        for primitive in mesh["primitives"]:
            yield from wrong_primitive(data, primitive)
    for material in data["materials"]:
        yield from wrong_material(material)
    if set(data.get("extensionsUsed", ())) != set(extensions_in(data)):
        yield "extensionsUsed [3.12]"
    for camera in data["cameras"]:
        view = camera["perspective"]
        if not (0.0 < view["yfov"] < math.pi and view["znear"] > 0.0 and view["aspectRatio"] > 0.0):
            yield "camera [3.10]"
    for node in data["nodes"]:
        yield from wrong_node(node)


def wrong_buffers(data):
    """Yield what of buffers, views and accessors is wrong."""
    for buffer in data["buffers"]:
        if len(data_of(buffer)) < buffer["byteLength"]:
            yield "a buffer is shorter than it says [3.6.1]"
    for view in data["bufferViews"]:
        end = view.get("byteOffset", 0) + view["byteLength"]
        if end > data["buffers"][view["buffer"]]["byteLength"]:
            yield "a view ends behind its buffer [3.6.1]"
    for accessor in data["accessors"]:
        if accessor["componentType"] not in COMPONENTS or accessor["count"] < 1:
            yield "type or count of an accessor [3.6.2]"
            continue
        size = np.dtype(COMPONENTS[accessor["componentType"]]).itemsize
        view = data["bufferViews"][accessor["bufferView"]]
        start = accessor.get("byteOffset", 0)
        if (view.get("byteOffset", 0) + start) % size or start % size:
            yield "alignment [3.6.2.4]"
        if start + size * SIZES[accessor["type"]] * accessor["count"] > view["byteLength"]:
            yield "an accessor ends behind its view [3.6.2.4]"


def numbers_out_of_range(data):
    """Yield references to what is not there."""
    places = [("scenes", [data["scene"]]), ("nodes", data["scenes"][data["scene"]]["nodes"])]
    for node in data["nodes"]:
        places += [
            (f"{kind}s" if kind == "camera" else "meshes", [node[kind]])
            for kind in ("camera", "mesh")
            if kind in node
        ]
    for mesh in data["meshes"]:
        for primitive in mesh["primitives"]:
            places.append(("accessors", [*primitive["attributes"].values(), primitive["indices"]]))
            places.append(("materials", [primitive["material"]]))
    for name, numbers in places:
        if not all(0 <= number < len(data[name]) for number in numbers):
            yield f"a number of {name} that is not there [3.3]"


def wrong_primitive(data, primitive):
    """Yield what of triangles is wrong."""
    points, normals = (array_of(data, primitive["attributes"][n]) for n in ("POSITION", "NORMAL"))
    place = data["accessors"][primitive["attributes"]["POSITION"]]
    given = data["accessors"][primitive["indices"]]
    for name in ("POSITION", "NORMAL"):
        accessor = data["accessors"][primitive["attributes"][name]]
        if (accessor["type"], accessor["componentType"]) != ("VEC3", 5126):
            yield f"{name} is not made of three floats [3.7.2.1]"
            return
        if data["bufferViews"][accessor["bufferView"]].get("target") != 34962:
            yield "target of a view [3.6.1]"
    if len(points) != len(normals):
        yield "attributes of unequal count [3.7.2.1]"
    if place.get("min") != points.min(axis=0).tolist() or place.get("max") != points.max(axis=0).tolist():
        yield "min or max [3.6.2.5]"
    if np.abs(np.linalg.norm(normals.astype(float), axis=1) - 1.0).max() > 4 * U32:
        yield "a normal that is not a unit vector [3.7.2.1]"
    if given["type"] != "SCALAR" or given["componentType"] not in (5121, 5123, 5125):
        yield "type of indices [3.7.2.1]"
        return
    corners = array_of(data, primitive["indices"]).ravel()
    most = np.iinfo(corners.dtype).max
    if len(corners) % 3 or np.any(corners >= len(points)) or np.any(corners == most):
        yield "indices of triangles [3.7.2.1]"
    if primitive.get("mode", 4) != 4 or data["bufferViews"][given["bufferView"]].get("target") != 34963:
        yield "mode, or target of indices [3.7.2.1]"


def wrong_material(material):
    """Yield numbers that a material may not have."""
    rough = material["pbrMetallicRoughness"]
    numbers = [*rough["baseColorFactor"], rough["metallicFactor"], rough["roughnessFactor"]]
    numbers += material.get("emissiveFactor", [])
    if len(rough["baseColorFactor"]) != 4 or not all(0.0 <= number <= 1.0 for number in numbers):
        yield "a factor outside [0, 1] [5.19, 5.22]"
    for words in material.get("extensions", {}).values():
        for name, value in words.items():
            low, high = RANGES[name]
            if not low <= value <= high:
                yield f"{name} [its extension]"


def wrong_node(node):
    """Yield whether a matrix is not one of a node, or a camera's not a rotation with a place."""
    if "matrix" not in node:
        return
    matrix = np.array(node["matrix"], float)
    if matrix.shape != (16,) or matrix[[3, 7, 11, 15]].tolist() != [0.0, 0.0, 0.0, 1.0]:
        yield "matrix [3.5.3]"
        return
    axes = matrix.reshape(4, 4)[:3, :3]
    # Rows of three products; some roundings each.
    if np.abs(axes @ axes.T - np.eye(3)).max() > 64 * 2.0**-53 or np.linalg.det(axes) <= 0.0:
        yield "axes of a camera [3.10.2]"


def extensions_in(value):
    """Yield the names of all extensions in use."""
    if isinstance(value, dict):
        yield from value.get("extensions", ())
        for inner in value.values():
            yield from extensions_in(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from extensions_in(inner)


# ---- what a file says -----------------------------------------------------------------------------------


def read(data):
    """Return what is in a file, and the surfaces of its sky."""
    places, camera = [], None
    for number in data["scenes"][data["scene"]]["nodes"]:
        node = data["nodes"][number]
        if "camera" in node:
            camera = node
        else:
            places += data["meshes"][node["mesh"]]["primitives"]
    frame = np.array(camera["matrix"]).reshape(4, 4).T[:3]
    fov = math.degrees(data["cameras"][camera["camera"]]["perspective"]["yfov"])
    surfaces = [surface_of(data, primitive) for primitive in places]
    return ReadFile(surfaces, frame, fov, data["scenes"][data["scene"]]["extras"])


def surface_of(data, primitive):
    """Return triangles with what their material says by glTF's rules."""
    points, normals = (
        array_of(data, primitive["attributes"][n]).astype(float) for n in ("POSITION", "NORMAL")
    )
    corners = array_of(data, primitive["indices"]).reshape(-1, 3)
    material = data["materials"][primitive["material"]]
    rough, more = material["pbrMetallicRoughness"], material.get("extensions", {})
    kind, number = "something", 0.0
    if rough["metallicFactor"] == 1.0:
        alpha = rough["roughnessFactor"] ** 2
        kind, number = ("metal", alpha) if alpha else ("mirror", 0.0)
    elif more.get("KHR_materials_transmission", {}).get("transmissionFactor") == 1.0:
        kind = "glass" if rough["roughnessFactor"] == 0.0 else "rough glass"
        number = more.get("KHR_materials_ior", {}).get("ior", 1.5)
    elif more.get("KHR_materials_specular", {}).get("specularFactor") == 0.0:
        kind = "matte"
    strength = more.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    emission = tuple(strength * channel for channel in material.get("emissiveFactor", (0.0, 0.0, 0.0)))
    thick = more.get("KHR_materials_volume", {}).get("thicknessFactor", 0.0)
    color = tuple(rough["baseColorFactor"][:3])
    return ReadSurface(
        points, normals, corners, kind, color, emission, number, not material["doubleSided"], thick
    )


def without_sky(found, scene):
    """Return a file without its sky, of which all is checked."""
    if not any(scene.background):
        return found
    *rest, a, b, c, d, e, f = found.surfaces
    sky = (a, b, c, d, e, f)
    points = np.concatenate([side.points for side in sky])
    half = points.max()
    inside = [scene.camera.position, *(surface.points for surface in rest)]
    assert half > max(np.abs(each).max() for each in inside)
    # A mean of three points and a third are rounded; coordinates are powers of 2 times small integers.
    assert abs(sum(map(volume, sky)) / (8.0 * half**3) + 1.0) <= 16 * U64
    assert sum(np.linalg.norm(areas(side).sum(axis=0)) for side in sky) == 24.0 * half**2
    for side in sky:
        assert (side.kind, side.color, side.front) == ("matte", (0.0, 0.0, 0.0), True)
        np.testing.assert_allclose(side.emission, scene.background, rtol=2.0**-52, atol=0.0)
    return ReadFile(rest, found.frame, found.fov, found.asked)


@pytest.mark.parametrize("name", WRITTEN)
def test_a_shot_is_well_formed_and_reads_back(name):
    """All that glTF's specification demands of what is used, and all numbers of the scene."""
    shot = SHOTS[name]
    data = json.loads(written("gltf", shot, SEED))
    assert [*wrong(data)] == []
    assert [*differences(without_sky(read(data), shot.scene), shot, SEED)] == []


# ---- what it cannot say ---------------------------------------------------------------------------------


def refused(**parts):
    return Shot("odd", Scene("odd", empty().camera, **parts))


@pytest.mark.parametrize(
    ("shot", "words"),
    [
        (SHOTS["layers-miss"], "sky that is not a surface"),
        (
            refused(spheres=(Sphere((0.0, 0.0, 0.0), 1.0, (0.5, 1.0, 1.0), material=Dielectric(1.5)),)),
            "tinted glass",
        ),
    ],
)
def test_what_gltf_cannot_say(shot, words):
    with pytest.raises(NotExpressed, match=words):
        written("gltf", shot, SEED)


def test_a_scene_without_surfaces_has_no_lists():
    """An empty list is against the specification."""
    data = json.loads(written("gltf", Shot("empty", Scene("empty", empty().camera)), SEED))
    assert set(data) == {"asset", "scene", "scenes", "nodes", "cameras"}
