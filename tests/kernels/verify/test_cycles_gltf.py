"""Our glTF in another program: Blender's importer and Cycles show the known answers (VRF-14, VRF-15)."""

from importlib.util import find_spec

import pytest

from wamnet_verify import gltf_process, run
from wamnet_verify import renderers as R
from wamnet_verify.cases import chosen
from wamnet_verify.command import read_layers
from wamnet_verify.judgement import DEVIATES, PASS

ASKED = (
    "sky-dim",
    "lamp-front",
    "lamp-back",
    "lamp-below",
    "lamps-two",
    "fresnel-60",
    "position",
    "albedo-matte",
)
"""Cases of each kind of material, of the sky, of lamps and of the axes of the world."""


def test_the_script_is_python():
    """What is asked is in it: the file, its pictures' size, samples and depth."""
    text = gltf_process.program(["1,2", "a.exr,b.exr", "scene.gltf", "8", "64", "16"])
    compile(text, "scene.py", "exec")
    assert "import_scene.gltf(filepath='scene.gltf')" in text
    assert "settings(8, 64, 16, True)" in text


@pytest.mark.nightly
@pytest.mark.needs("programs")
def test_cycles_shows_the_known_answers():
    """The importer makes lamps of two sides; all else is as the file says."""
    if find_spec("bpy") is None:
        pytest.skip("MISSING: Blender as a Python module; pip install --no-deps bpy")
    asked = [q for q in chosen([*ASKED, "mirror"]) if q.name in (*ASKED, "mirror", "mirrors-two", "normal")]
    found = run.verify(R.known("cycles-gltf", "", read_layers), asked, pictures=4)
    odd = {v.question.name: v.profile for v in found if v.state != PASS}
    assert odd == {"lamp-back": "two-sided-lamps"}
    assert [v.state for v in found if v.question.name == "lamp-back"] == [DEVIATES]
    assert {v.profile for v in found if v.rule == "mirror"} == {"schlick-metals"}
