"""A shot as a glTF 2.0 file (.gltf, its buffer inside).

1. Surfaces are triangles in world space with normals. Lamps, walls and bodies have a front only
   (`doubleSided` false); other sheets have two sides. glTF has no lamps with an area: what emits is a surface
   (`emissiveFactor`, with `KHR_materials_emissive_strength` above 1).
2. Matte is the metallic-roughness material without its specular part (`KHR_materials_specular`, factor 0).
   Metal and mirrors are metallic 1; glTF's roughness is the root of alpha. Their colour fades to white at
   grazing angles by Schlick's formula, which is profile `schlick-metals`. Glass transmits all and has an
   index and a volume.
3. glTF has no sky: it is the inside of a black cube around everything that emits. Layers of what is missed
   are not expressed, for nothing is missed then; nor is tinted glass, whose reflection glTF does not tint.
4. Size, samples, depth and seed of a shot are in `extras` of the scene: glTF has no words for them. No
   extension is required: a program that lacks one shows it by the rule that it breaks.

Source: glTF 2.0 specification, sections 3.6 to 3.10 and appendix B; the extensions' specifications.
"""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Sequence
from typing import Any

from .cases import Shot
from .parts import (
    GLASS,
    MATTE,
    Mesh,
    NotExpressed,
    matrix_of,
    meshes_of,
    parts_of,
    physical,
    request_of,
    sky_of,
)

FLOAT, UINT32 = 5126, 5125
"""Types of the components of an accessor."""

VERTICES, CORNERS = 34962, 34963
"""What a view of the buffer is for: points and normals, or numbers of corners."""

ARRAYS = ("points", "normals", "corners")
"""The arrays of a mesh."""

NEAR = 1e-4
"""Distance of the near plane; there is no far one."""


def write(shot: Shot, seed: int) -> str:
    """Return the file of a shot for a seed; raises NotExpressed."""
    scene = shot.scene
    if shot.layers and any(scene.background):
        raise NotExpressed("sky that is not a surface")
    meshes = meshes_of(parts_of(scene))
    meshes += sky_of(scene, meshes)
    materials = [_material(mesh) for mesh in meshes]
    used = sorted({name for material in materials for name in material["extensions"]})
    named = {"name": "camera", "camera": 0, "matrix": matrix_of(scene.camera)}
    angle = math.radians(scene.camera.vertical_fov_deg)
    view = {"yfov": angle, "aspectRatio": 1.0, "znear": NEAR}
    # A mesh by the numbers of its arrays, of which each has three, and of its material.
    parts = [
        {"attributes": {"POSITION": 3 * i, "NORMAL": 3 * i + 1}, "indices": 3 * i + 2, "material": i}
        for i in range(len(meshes))
    ]
    data = {
        "asset": {"version": "2.0", "generator": "wamnet"},
        "extensionsUsed": used,
        "scene": 0,
        "scenes": [
            {"name": shot.name, "nodes": list(range(len(meshes) + 1)), "extras": request_of(shot, seed)}
        ],
        "nodes": [{"name": f"part {i}", "mesh": i} for i in range(len(meshes))] + [named],
        "cameras": [{"type": "perspective", "perspective": view}],
        "meshes": [{"primitives": [part]} for part in parts],
        "materials": materials,
        **_arrays(meshes),
    }
    # A list that is there has an entry.
    return json.dumps({name: value for name, value in data.items() if value != []}, allow_nan=False) + "\n"


def _arrays(meshes: Sequence[Mesh]) -> dict[str, Any]:
    """Return accessors, views and the buffer; all components have four bytes, and so are aligned."""
    accessors: list[dict[str, Any]] = []
    views, parts, start = [], [], 0
    for name, array in ((each, getattr(mesh, each)) for mesh in meshes for each in ARRAYS):
        data = array.astype(array.dtype.newbyteorder("<")).tobytes()
        target = CORNERS if name == "corners" else VERTICES
        views.append({"buffer": 0, "byteOffset": start, "byteLength": len(data), "target": target})
        accessor = {"bufferView": len(accessors), "type": "VEC3", "componentType": FLOAT, "count": len(array)}
        if name == "corners":
            accessor |= {"type": "SCALAR", "componentType": UINT32, "count": array.size}
        if name == "points":
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(accessor)
        parts.append(data)
        start += len(data)
    if not meshes:
        return {}
    text = base64.b64encode(b"".join(parts)).decode("ascii")
    buffer = {"byteLength": start, "uri": f"data:application/octet-stream;base64,{text}"}
    return {"accessors": accessors, "bufferViews": views, "buffers": [buffer]}


def _material(mesh: Mesh) -> dict[str, Any]:
    """Return a material; a body of glass says how thick it is."""
    look = mesh.look
    rough, metallic = physical(look)
    found: dict[str, Any] = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [*map(float, look.reflectance), 1.0],
            "metallicFactor": metallic,
            "roughnessFactor": rough,
        },
        "doubleSided": not mesh.front,
        "extensions": {},
    }
    if look.kind == MATTE:
        found["extensions"]["KHR_materials_specular"] = {"specularFactor": 0.0}
    if look.kind == GLASS:
        # Without a thickness it would be a film.
        found["extensions"] |= {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_ior": {"ior": look.number},
            "KHR_materials_volume": {"thicknessFactor": mesh.thick},
        }
    if look.emits:
        strength = max(1.0, *look.emission)
        found["emissiveFactor"] = [channel / strength for channel in look.emission]
        if strength > 1.0:
            found["extensions"]["KHR_materials_emissive_strength"] = {"emissiveStrength": strength}
    return found
