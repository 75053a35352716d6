"""three.js' JSON: what we and three's own ObjectLoader find in it, and what it cannot say (VRF-16)."""

import base64
import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from triangles import U64, ReadFile, ReadSurface, differences

from wamnet.refimpl.encoding import srgb_decode
from wamnet.refimpl.light.materials import Dielectric
from wamnet.refimpl.light.scene import Scene, Sphere
from wamnet.refimpl.light.scenes import empty
from wamnet_verify.cases import Shot, questions
from wamnet_verify.parts import LEVEL_SLACK, NotExpressed, levels_of, written
from wamnet_verify.run import shots_of

SHOTS = {shot.name: shot for shot in shots_of(questions())}
WRITTEN = [name for name in SHOTS if name != "glass-ball-2.4"]
SEED = 7

THREE_SLACK = 1e-9
"""three.js' constant of dark levels has ten digits."""


def linear(color):
    """Return the linear channels of three levels in one number, red first."""
    return tuple(float(srgb_decode(np.float64((color >> shift & 255) / 255.0))) for shift in (16, 8, 0))


def read(data):
    """Return what a file says by the manual of ObjectLoader, and the radiance of its sky."""
    assert data["metadata"]["type"] == "Object"
    assert 4.0 <= data["metadata"]["version"] < 5.0
    named = {
        name: {each["uuid"]: each for each in data.get(name, ())} for name in ("geometries", "materials")
    }
    scene = data["object"]
    parts = [part for part in scene["children"] if part["type"] == "Mesh"]
    (camera,) = (part for part in scene["children"] if part["type"] == "PerspectiveCamera")
    assert (camera["aspect"], camera["zoom"]) == (1.0, 1.0)
    frame = np.array(camera["matrix"]).reshape(4, 4).T[:3]
    surfaces = []
    for part in parts:
        geometry = named["geometries"][part["geometry"]]["data"]
        arrays = {
            name: np.float32(each["array"]).reshape(-1, 3) for name, each in geometry["attributes"].items()
        }
        index = np.array(geometry["index"]["array"], np.uint32)
        material = named["materials"][part["material"]]
        assert (material["color"], material["vertexColors"]) == (0xFFFFFF, True)
        emission = [material["emissiveIntensity"] * channel for channel in linear(material["emissive"])]
        surfaces.append(surface_of(arrays, index, material, emission))
    return ReadFile(surfaces, frame, camera["fov"], scene["userData"]), sky_of(data)


def surface_of(arrays, index, material, emission):
    """Return a surface by the rules of MeshPhysicalMaterial."""
    kind, number = "something", 0.0
    if material["metalness"] == 1.0:
        alpha = material["roughness"] ** 2
        kind, number = ("metal", alpha) if alpha else ("mirror", 0.0)
    elif material.get("transmission", 0.0) == 1.0:
        kind, number = "glass" if material["roughness"] == 0.0 else "rough glass", index_of(material)
    elif material["specularIntensity"] == 0.0:
        kind = "matte"
    (color,) = np.unique(arrays["color"], axis=0)
    points, normals = arrays["position"].astype(float), arrays["normal"].astype(float)
    front, thick = {0: True, 2: False}[material["side"]], material.get("thickness", 0.0)
    return ReadSurface(
        points,
        normals,
        index.reshape(-1, 3),
        kind,
        tuple(map(float, color)),
        tuple(emission),
        number,
        front,
        thick,
    )


def index_of(material):
    """Return the index that three.js has, or makes of a file's reflectivity."""
    share = 0.4 * material.get("reflectivity", 0.5)
    return material["ior"] if "ior" in material else (1.0 + share) / (1.0 - share)


def sky_of(data):
    """Return the radiance of a sky that is the same everywhere, or black."""
    scene = data["object"]
    assert scene.get("background") == scene.get("environment")
    if "background" not in scene:
        return (0.0, 0.0, 0.0)
    (texture,), (image,) = data["textures"], data["images"]
    assert (texture["uuid"], texture["image"]) == (scene["background"], image["uuid"])
    # Equirectangular, floats, linear.
    assert (texture["mapping"], texture["type"], texture["colorSpace"]) == (303, 1015, "srgb-linear")
    texels = np.array(image["url"]["data"]).reshape(image["url"]["height"], image["url"]["width"], 4)
    assert np.all(texels == texels[0, 0])
    return tuple(texels[0, 0, :3])


@pytest.mark.parametrize("name", WRITTEN)
def test_a_shot_reads_back(name):
    shot = SHOTS[name]
    found, sky = read(json.loads(written("three", shot, SEED)))
    assert [*differences(found, shot, SEED, 8 * U64)] == []
    assert sky == shot.scene.background


# ---- three.js itself ------------------------------------------------------------------------------------

THREE = "three/build/three.module.js"
"""The module within a folder of packages."""

LOADS = """
import fs from "node:fs";
const THREE = await import(process.argv[1]);
const coded = (a) => Buffer.from(a.buffer, a.byteOffset, a.byteLength).toString("base64");
for (const file of process.argv.slice(2)) {
  const scene = new THREE.ObjectLoader().parse(JSON.parse(fs.readFileSync(file, "utf8")));
  scene.updateMatrixWorld(true);
  const found = { surfaces: [], userData: scene.userData, sky: null };
  scene.traverse((part) => {
    if (part.isPerspectiveCamera)
      found.camera = { fov: part.getEffectiveFOV(), matrix: part.matrixWorld.elements };
    if (!part.isMesh) return;
    const geometry = part.geometry.clone().applyMatrix4(part.matrixWorld), m = part.material;
    const arrays = {};
    for (const name of ["position", "normal", "color"]) arrays[name] = coded(geometry.attributes[name].array);
    const kept = ["roughness", "metalness", "transmission", "ior", "thickness", "specularIntensity", "side",
      "vertexColors", "emissiveIntensity"];
    const material = { type: m.type, color: m.color.toArray(), emissive: m.emissive.toArray() };
    for (const name of kept) material[name] = m[name];
    found.surfaces.push({ arrays, index: Array.from(geometry.index.array), material });
  });
  if (scene.background !== scene.environment) throw new Error("two skies");
  if (scene.background) {
    const { data, width, height } = scene.background.image;
    found.sky = { texels: Array.from(data), width, height, mapping: scene.background.mapping };
  }
  console.log(JSON.stringify(found));
}
"""
"""Loads files by three.js, and says what it then has, a line each."""


def loaded(files):
    """Return what three.js has loaded of files; skips loudly where Node or three is missing."""
    node, npm = shutil.which("node"), shutil.which("npm")
    if node is None or npm is None:
        pytest.skip("MISSING: Node; in Debian: apt-get install nodejs npm")
    root = subprocess.run(
        [npm, "root", "--global"], capture_output=True, text=True, check=True
    ).stdout.strip()
    folders = [*filter(None, os.environ.get("NODE_PATH", "").split(os.pathsep)), root]
    modules = [module for folder in folders if (module := Path(folder, THREE)).exists()]
    if not modules:
        pytest.skip("MISSING: three.js; npm install --global three")
    words = [node, "--input-type=module", "-e", LOADS, "--", modules[0].as_uri(), *map(str, files)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stderr == ""
    return [json.loads(line) for line in done.stdout.splitlines()]


def read_loaded(found):
    """Return what three.js has as a file is read."""
    surfaces = []
    for each in found["surfaces"]:
        arrays = {
            name: np.frombuffer(base64.b64decode(text), "<f4").reshape(-1, 3)
            for name, text in each["arrays"].items()
        }
        material = each["material"]
        assert (material["type"], material["color"]) == ("MeshPhysicalMaterial", [1.0, 1.0, 1.0])
        assert material["vertexColors"] is True
        emission = [material["emissiveIntensity"] * channel for channel in material["emissive"]]
        surfaces.append(surface_of(arrays, np.array(each["index"], np.uint32), material, emission))
    frame = np.array(found["camera"]["matrix"]).reshape(4, 4).T[:3]
    return ReadFile(surfaces, frame, found["camera"]["fov"], found["userData"])


@pytest.mark.needs("programs")
def test_three_loads_what_was_written(tmp_path):
    """All shots by three's own ObjectLoader: the same triangles, materials, camera, sky, and no warning."""
    files = [tmp_path / f"{name}.json" for name in WRITTEN]
    for file in files:
        file.write_text(written("three", SHOTS[file.stem], SEED), encoding="utf-8")
    for name, found in zip(WRITTEN, loaded(files), strict=True):
        shot = SHOTS[name]
        assert [*differences(read_loaded(found), shot, SEED, THREE_SLACK)] == [], name
        if not any(shot.scene.background):
            assert found["sky"] is None
            continue
        sky = found["sky"]
        count = sky["width"] * sky["height"]
        assert sky["texels"] == [float(np.float32(v)) for v in (*shot.scene.background, 1.0)] * count
        assert sky["mapping"] == 303


# ---- levels, and what cannot be said --------------------------------------------------------------------


@pytest.mark.parametrize(
    "emission", [(0.25, 0.5, 1.0), (0.0, 9.0, 4.5), (8.0, 8.0, 8.0), (1.0, 0.9, 0.7), (3e-5,) * 3]
)
def test_levels_are_near(emission):
    """Off by no more than a quarter of the slack of an answer, in the largest channel; black is level 0."""
    color, intensity = levels_of(emission)
    found = intensity * np.array(linear(color))
    assert np.abs(found - emission).max() <= LEVEL_SLACK * max(emission)
    assert all(f == 0.0 for f, e in zip(found, emission, strict=True) if e == 0.0)


def test_no_emission_is_black():
    assert levels_of((0.0, 0.0, 0.0)) == (0, 1.0)


def test_levels_that_are_far_are_refused():
    """One of nine colours at random has no near levels."""
    with pytest.raises(NotExpressed, match=r"emission of 0\.5943, 0\.3379, 0\.3916 in eight-bit levels"):
        levels_of((0.5943, 0.3379, 0.3916))


@pytest.mark.parametrize(
    ("shot", "words"),
    [
        (SHOTS["glass-ball-2.4"], r"index above 2\.333"),
        (
            Shot(
                "tinted",
                Scene(
                    "tinted",
                    empty().camera,
                    spheres=(Sphere((0.0,) * 3, 1.0, (0.5, 1.0, 1.0), material=Dielectric(1.5)),),
                ),
            ),
            "tinted glass",
        ),
    ],
)
def test_what_three_cannot_say(shot, words):
    with pytest.raises(NotExpressed, match=words):
        written("three", shot, SEED)
