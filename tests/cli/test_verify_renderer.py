"""`wamnet verify-renderer`: what it prints and writes, its exit status, and every refusal (VRF-10, VRF-11,
VRF-12)."""

import json
import shlex
import sys

import pytest

OWN = shlex.join([sys.executable, "-m", "wamnet.cli"]) + (
    " render {scene} -o {output} --spp 1 --seed {seed} --width {width} --height {height} --workers 1"
)
"""The project's own tracer as a program."""


def test_a_renderer_that_keeps_the_rules(wamnet, tmp_path):
    page, data = tmp_path / "page.md", tmp_path / "data.json"
    words = ("-k", "radiance", "-k", "matte-ball", "--pictures", "4")
    done = wamnet("verify-renderer", "--renderer", "wamnet", *words, "--json", data, "--markdown", page)
    assert (done.status, done.err) == (0, "")
    assert "4 pass" in done.out
    report = json.loads(data.read_text())
    assert (report["schema"], report["counts"]) == ("wamnet-verify-1", {"pass": 4})
    assert page.read_text().count("| pass |") == 4


def test_a_program_that_breaks_rules(wamnet, tmp_path):
    """Half as much light: every sky is too dark, in a smaller picture too."""
    program = (
        "import sys, json, numpy as np; size = int(sys.argv[3]);"
        "sky = json.load(open(sys.argv[1]))['background'];"
        "import OpenEXR; h = {'type': OpenEXR.scanlineimage};"
        "p = {k: np.full((size, size), v / 2, np.float32) for k, v in zip('RGB', sky)};"
        "OpenEXR.File(h, p).write(sys.argv[2])"
    )
    command = shlex.join([sys.executable, "-c", program, "{scene}", "{output}", "{width}"])
    done = wamnet(
        "verify-renderer", "--format", "wamnet", "--command", command, "-k", "sky-", "--pictures", "4"
    )
    assert done.status == 1
    assert "look first at rule radiance" in done.out
    assert "2 deviates" in done.out
    assert "not confirmed" not in done.out


@pytest.mark.nightly
def test_the_own_tracer_as_a_program(wamnet):
    """Files, layers and a picture for a screen go all the way through."""
    words = ("-k", "sky-dim", "-k", "display-dark", "-k", "normal-turned", "--pictures", "4")
    done = wamnet("verify-renderer", "--format", "wamnet", "--command", OWN, *words)
    assert (done.status, done.err) == (0, "")
    assert "3 pass" in done.out


def test_scenes_are_written_with_their_answers(wamnet, tmp_path):
    folder = tmp_path / "scenes"
    done = wamnet("verify-renderer", "--format", "povray", "--write", folder, "-k", "mirror", "-k", "direct")
    assert (done.status, done.err) == (0, "")
    assert "not written: lamp-below: format povray has no" in done.out
    answers = json.loads((folder / "answers.json").read_text())
    assert {"mirror", "mirrors-two", "lamp-below"} <= {answer["name"] for answer in answers}
    assert sorted(path.name for path in folder.iterdir() if path.suffix == ".pov") == [
        "mirror.pov",
        "mirrors-two.pov",
    ]


def test_answers_are_those_that_a_form_means(wamnet, tmp_path):
    """A tinted mirror in glTF fades to white at grazing angles: 2 (0.9 + 0.1 / 32) in red."""
    folder = tmp_path / "scenes"
    done = wamnet(
        "verify-renderer", "--format", "gltf", "--write", folder, "-k", "mirror", "-k", "miss-depth"
    )
    assert (done.status, done.err) == (0, "")
    assert "not written: layers-miss: format gltf has no sky that is not a surface" in done.out
    answers = {
        answer["name"]: answer["answer"] for answer in json.loads((folder / "answers.json").read_text())
    }
    assert answers["mirror"][0] == 2.0 * (0.9 + (1.0 - 0.9) / 32.0)
    assert json.loads((folder / "mirror.gltf").read_text())["asset"]["version"] == "2.0"


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        ((), "exactly one says who is asked"),
        (("--renderer", "wamnet", "--command", "x"), "exactly one says who is asked"),
        (("--renderer", "arnold"), "unknown"),
        (("--renderer", "wamnet", "--format", "mitsuba"), "a known renderer has its own"),
        (("--command", "x {scene} {output}"), "a form of scene files must be named"),
        (("--command", "x {scene} {output}", "--format", "max"), "unknown"),
        (("--command", "x", "--format", "wamnet"), "must say where"),
        (("--renderer", "wamnet", "--profile", "fast"), "unknown"),
        (("--renderer", "wamnet", "--pictures", "3"), "must be from 4 to 1000"),
        (("--renderer", "wamnet", "--seed", "-1"), "must be from 0 to 2146434071"),
        (("--renderer", "wamnet", "--timeout", "0"), "must be from 0.001 to 1000000 seconds"),
        (("--renderer", "wamnet", "-k", "nothing"), "no case's name holds it"),
        (("--renderer", "wamnet", "--write", "x"), "it writes scenes and asks nobody"),
        (("--write", "x"), "a form of scene files must be named"),
        (("--renderer", "wamnet", "--json", "no/such/folder/x.json"), "not found"),
    ],
)
def test_refusals(wamnet, words, rule):
    done = wamnet("verify-renderer", *words)
    assert (done.status, done.out) == (2, "")
    assert rule in done.err
