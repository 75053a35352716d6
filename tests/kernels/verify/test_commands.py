"""How programs are asked, how they fail, and what formats cannot say (VRF-9, VRF-10)."""

import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.materials import Mirror
from wamnet.refimpl.light.scene import Scene, Sphere, from_json
from wamnet.refimpl.light.scenes import daylight, empty
from wamnet_verify import renderers as R
from wamnet_verify import report, run
from wamnet_verify.cases import Shot, chosen, questions
from wamnet_verify.command import read_layers
from wamnet_verify.judgement import DEVIATES, FAILED, PASS, UNTESTED, Missing, Verdict
from wamnet_verify.parts import NotExpressed, parts_of
from wamnet_verify.programs import printed, running

SHOT = Shot("a shot", empty(), size=4, spp=1)
WRITES = "import sys; import numpy as np; np.savez(sys.argv[2], color=np.full((4, 4, 3), 0.25))"


def by(program, *words, **more):
    """Return a renderer that runs a Python program."""
    command = (sys.executable, "-c", program, *(words or ("{scene}", "{output}")))
    return R.ByCommand("test", "wamnet", command, lambda path: {}, more.pop("output", R.NPZ), **more)


@pytest.mark.needs("programs")
def test_a_program_that_answers():
    found = by(WRITES).pictures(SHOT, [3, 4])
    assert [picture["color"].shape for picture in found] == [(4, 4, 3)] * 2


@pytest.mark.needs("programs")
def test_one_process_for_all_pictures():
    """{seeds} and {outputs} are lists, and placeholders within words are filled."""
    program = (
        "import sys, numpy as np\n"
        "for seed, output in zip(sys.argv[1][6:].split(','), sys.argv[2].split(',')):\n"
        "    np.savez(output, color=np.full((int(sys.argv[3]), 4, 3), float(seed)))"
    )
    found = by(program, "seeds={seeds}", "{outputs}", "{height}").pictures(SHOT, [3, 4])
    assert [picture["color"][0, 0, 0] for picture in found] == [3.0, 4.0]


@pytest.mark.needs("programs")
@pytest.mark.parametrize(
    ("program", "note"),
    [
        ("import sys; print('first'); sys.exit('no such shape')", "exit status 1: no such shape"),
        ("import sys; sys.exit(3)", "exit status 3: nothing said"),
        ("pass", "it ended well, and wrote no .npz where {output} said"),
        ("import sys; open(sys.argv[2], 'w').write('no')", "its picture cannot be read"),
        ("import sys; print('x' * 10**7); print('last'); sys.exit(2)", "exit status 2: last"),
        ("import os, shutil; shutil.rmtree(os.getcwd())", "its scene cannot be written (No such file"),
        (
            "import os\nfor _ in range(1100): os.makedirs('d', exist_ok=True); os.chdir('d')",
            "it ended well, and wrote no .npz",
        ),
    ],
)
def test_failures_are_told(program, note):
    found = by(program).pictures(SHOT, [1, 2])
    assert isinstance(found, Missing)
    assert found.state == FAILED
    assert note in found.note


@pytest.mark.needs("programs")
def test_a_program_that_never_ends():
    found = by("import time; time.sleep(60)", limit_s=0.5).pictures(SHOT, [1])
    assert found == Missing(FAILED, "no answer in 0.5 s")


@pytest.mark.needs("programs")
def test_a_child_in_the_background_does_not_hold_a_finished_picture():
    """It kept the pipe, which was read to its end: no answer, though the picture was there."""
    child = "import subprocess; subprocess.Popen(['sleep', '600'])\n"
    (found,) = by(child + WRITES, limit_s=60.0).pictures(SHOT, [3])
    assert found["color"].shape == (4, 4, 3)


@pytest.mark.needs("programs")
def test_a_program_that_is_not_there():
    found = R.ByCommand("x", "wamnet", ("/no/such/program", "{scene}"), lambda path: {}).pictures(SHOT, [1])
    assert isinstance(found, Missing)
    assert "cannot be run" in found.note


def test_what_a_format_cannot_say_is_not_tested():
    renderer = R.ByCommand("x", "povray", ("never", "run"), lambda path: {})
    verdicts = run.verify(renderer, chosen(["albedo-matte", "metal-1-0"]))
    assert {v.state for v in verdicts} == {UNTESTED}
    assert [v.note for v in verdicts] == [
        "format povray has no layers beside the colour",
        "format povray has no rough metal",
    ]


def test_what_a_format_means_is_expected():
    """A tinted mirror in glTF fades to white: its plain colour, 7 per cent off, deviates."""

    class Shows(R.ByCommand):
        def pictures(self, shot, seeds):
            return [{"color": np.broadcast_to(self.words, (shot.size, shot.size, 3))} for _ in seeds]

    def shows(*color):
        asked = [each for each in chosen(["mirror"]) if each.name == "mirror"]
        (verdict,) = run.verify(Shows("test", "gltf", color, lambda path: {}), asked, pictures=4)
        return verdict

    fades = [2.0 * (r + (1.0 - r) / 32.0) for r in (0.9, 0.6, 0.3)]
    found = shows(*fades)
    assert (found.state, found.profile, found.answer) == (PASS, "schlick-metals", tuple(fades))
    found = shows(1.8, 1.2, 0.6)
    assert (found.state, found.confirmed) == (DEVIATES, True)


def test_no_sky_of_directions():
    with pytest.raises(NotExpressed, match="sky"):
        parts_of(daylight())


def said(form, shot):
    """Return a shot's text, or None where a format refuses it that may."""
    try:
        return R.FORMATS[form].write(shot, 7)
    except NotExpressed:
        if form in ("povray", "luxcore", "gltf", "three"):
            return None
        raise


@pytest.mark.parametrize("form", R.FORMATS)
def test_every_shot_is_written_or_refused_in_words(form):
    """What is written is well formed: JSON reads back, XML parses, and Python compiles."""
    written = 0
    for shot in run.shots_of(questions()):
        text = said(form, shot)
        if text is None:
            continue
        written += 1
        if form == "wamnet":
            assert from_json(text) == shot.scene
        elif form == "mitsuba":
            ElementTree.fromstring(text)
            assert 'name="seed" value="7"' in text
        elif form in ("blender", "luxcore"):
            compile(text, shot.name, "exec")
        elif form in ("gltf", "three"):
            assert '"seed": 7' in text
            json.loads(text)
        else:
            assert text.count("{") == text.count("}")
    assert written >= 14


def test_what_emits_and_is_no_matte_surface_is_refused():
    ball = Sphere((0.0, 0.0, 0.0), 1.0, (0.5, 0.5, 0.5), (1.0, 1.0, 1.0), Mirror())
    shot = Shot("odd", Scene("odd", empty().camera, spheres=(ball,)))
    for form in ("mitsuba", "blender", "povray", "gltf", "three"):
        with pytest.raises(NotExpressed, match="emits"):
            R.FORMATS[form].write(shot, 1)


def test_our_own_tracer_as_a_program():
    """The command's words are filled for a renderer that has its samples on the command line."""
    words = R.command_words("mine {scene} -o {output} --spp {samples} --seed {seed} --max-depth {depth}")
    made = R.ByCommand("mine", "wamnet", words, lambda path: {})
    filled = made._filled(SHOT, Path("s.json"), [(5, Path("o.exr"))])
    assert filled == ["mine", "s.json", "-o", "o.exr", "--spp", "1", "--seed", "5", "--max-depth", "16"]


@pytest.mark.parametrize(
    ("command", "rule"),
    [
        ("mine 'half", "is not a command"),
        ("", "{scene} and {output}"),
        ("mine {scene}", "{scene} and {output}"),
        ("mine {output}", "{scene} and {output}"),
        ("mine {outputs} {seeds}", "{scene} and {output}"),
        ("mine {scene} {output.exr}", "{scene} and {output}"),
        ("mine {scene} {outputs", "{scene} and {output}"),
        ("mine {scene} {seeds} {output}", "one process for all {seeds} must know where all"),
    ],
)
def test_commands_that_cannot_ask(command, rule):
    with pytest.raises(InputError, match=rule):
        R.command_words(command)


def test_a_command_of_lists_needs_no_other_output():
    """VRF-10: {outputs} stands for {output}; {seeds} may be left to the scene file."""
    for text in ("mine {scene} {seeds} {outputs}", "mine {scene} --to={outputs}"):
        assert R.command_words(text) == tuple(text.split())


def test_unknown_renderers_are_refused():
    with pytest.raises(InputError, match="it is unknown"):
        R.known("arnold", "numpy", lambda path: {})


@pytest.mark.nightly
@pytest.mark.apart
def test_mitsuba(mitsuba):
    """What Mitsuba 3 does differently is what its documentation says: product masking at grazing angles."""
    found = run.verify(R.known("mitsuba", "", read_layers), questions(), pictures=6)
    odd = {v.question.name: v for v in found if v.deviates}
    assert all(v.confirmed for v in odd.values())
    assert sum(v.state == PASS for v in found) >= 35
    assert np.all([v.state != FAILED for v in found])


def test_a_report_holds_no_control_characters():
    """A renderer's name and last words went into the Markdown as they were, with a terminal's escapes."""
    odd = "a\x1b[31m\n|\u202e\udcff"
    verdict = Verdict(chosen(["depth"])[0], FAILED, note=odd)
    page = report.to_markdown(odd, [verdict]) + report.to_json(odd, [verdict], {})
    page.encode()
    assert page.replace("\n", "").isprintable()
    assert page.count(r"\x1b[31m") == 3


@pytest.mark.needs("programs")
def test_only_the_end_of_what_a_program_prints_is_kept():
    """A flood of prints took a gigabyte of memory in a second."""
    program = "import os\nfor n in range(400): os.write(1, b'%d' % (n % 10) * 50_000)\nos.write(1, b'end')"
    with running([sys.executable, "-c", program], stdout=subprocess.PIPE) as process:
        kept = printed(process, 1000, 60.0)
    assert kept == b"9" * 997 + b"end"
