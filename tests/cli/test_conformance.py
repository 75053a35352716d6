"""`wamnet conformance`: what it prints and writes, its exit status, and every refusal."""

import json
import re
import shlex
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from wamnet.spec.conformance import report, run
from wamnet.spec.conformance.run import Verdict

CHAPTER = Path(__file__).parents[2] / "spec" / "conformance.md"
VECTORS = CHAPTER.parent / "vectors"


@pytest.fixture
def program(tmp_path):
    """Give a function that writes the spec's example with one piece replaced, and returns its command."""
    (text,) = re.findall(r"^```python\n(.*?)^```$", CHAPTER.read_text(), re.MULTILINE | re.DOTALL)

    def write(old="", new=""):
        assert old in text
        path = tmp_path / "program.py"
        path.write_text(text.replace(old, new) if old else text)
        return shlex.join([sys.executable, str(path)])

    return write


def test_a_program_that_passes(wamnet, program):
    cases = run.chosen(run.read_vectors(VECTORS), ["random.block", "metric.mse"])
    known, foreign = len(cases["random.block"]), len(cases["metric.mse"])
    done = wamnet("conformance", "--program", program(), "-k", "random.block", "-k", "metric.mse")
    assert (done.status, done.err) == (0, "")
    assert f"{known} of {known + foreign} cases passed, 0 failed, {foreign} unsupported" in done.out


def test_an_executor_and_the_reference_pass(wamnet):
    for name in ("numpy", "reference"):
        done = wamnet("conformance", "--executor", name, "-k", "PRO-4")
        assert (done.status, done.err) == (0, "")
        assert "14 of 14 cases passed" in done.out


def test_a_kind_that_is_not_supported_has_no_error(wamnet, program):
    done = wamnet("conformance", "--program", program(), "-k", "random.block", "-k", "metric.mse")
    rows = {words[0]: words for words in map(str.split, done.out.splitlines()) if words}
    assert (rows["random.block"][-1], rows["metric.mse"][-1]) == ("0.00", "-")


def test_a_program_that_is_not_found_is_named_by_a_path(refused):
    assert "give a path such as ./mine" in refused("conformance", "--program", "mine", "-k", "sine")


def test_a_failure_tells_everything_and_how_to_repeat_it(wamnet, program):
    command = program("1 / 2.4", "1 / 2.2")
    done = wamnet("conformance", "--program", command, "-k", "display")
    assert done.status == 1
    first = done.out.partition("FAIL ")[2].splitlines()
    assert first[0] == "encoding.display/4, clause ENC-5: where the line meets the curve, below"
    assert re.fullmatch(r"  encoded: error \S+, bound \S+", first[1])
    assert re.fullmatch(r"  expected 0x1\S+, got 0x1\S+", first[2])
    assert first[3].startswith('  input {"linear": "0x1')
    assert first[4].startswith("  bound: range of single precision")
    again = shlex.split(first[5].removeprefix("  again: "))
    assert again[:4] == ["wamnet", "conformance", "--program", command]
    repeated = wamnet(*again[1:])
    assert repeated.status == 1
    assert "0 of 1 cases passed, 1 failed" in repeated.out


def test_reports(wamnet, program, tmp_path):
    crash = program('{"words": words,', '{"words": words if words[0] % 2 else sys.exit("\\x01 odd"),')
    files = ["--json", str(tmp_path / "a.json"), "--junit", str(tmp_path / "a.xml")]
    done = wamnet("conformance", "--program", crash, "-k", "random.block", "-k", "sine/1", *files)
    assert done.status == 1
    report = json.loads((tmp_path / "a.json").read_text())
    found = report["kinds"]["random.block"]
    assert found["cases"] == 22 == found["pass"] + found["crash"]
    assert [v["verdict"] for v in report["verdicts"] if v["kind"] == "sine"] == ["unsupported"]
    suites = {suite.get("name"): suite for suite in ElementTree.parse(tmp_path / "a.xml").getroot()}
    assert suites["random.block"].get("errors") == str(found["crash"])
    assert len(suites["random.block"].findall("testcase/error")) == found["crash"]
    assert suites["sine"].get("skipped") == "1"
    (ended, *_) = (v for v in report["verdicts"] if v["verdict"] == "crash")
    assert ended["again"].endswith(f"-k {ended['id']}")
    assert report["look_first_at"] == ended["id"]
    assert suites["random.block"].find("testcase/error").text == ended["again"]


def test_a_track_shows_what_changed(wamnet, program, tmp_path):
    track = str(tmp_path / "track.json")

    def ask(*change):
        return wamnet("conformance", "--program", program(*change), "-k", "random.block", "--track", track)

    assert ask().status == 0
    known = json.loads(Path(track).read_text())["verdicts"]
    assert set(known.values()) == {"pass"}
    done = ask("1664525", "1664527")
    assert done.status == 1
    assert "random.block/1: pass -> fail" in done.out
    assert "15 verdicts changed since" in done.out
    assert json.loads(Path(track).read_text())["verdicts"] == known


def test_a_known_failure_is_no_failure(wamnet, program, tmp_path):
    track = tmp_path / "track.json"
    wrong = program("1664525", "1664527")
    first = wamnet("conformance", "--program", wrong, "-k", "random.block", "--track", str(track))
    assert first.status == 1
    assert set(json.loads(track.read_text())["verdicts"].values()) == {"fail", "pass"}
    done = wamnet("conformance", "--program", wrong, "-k", "random.block", "--track", str(track))
    assert done.status == 0
    assert "0 verdicts changed" in done.out
    better = wamnet("conformance", "--program", program(), "-k", "random.block/3", "--track", str(track))
    assert better.status == 0
    assert "random.block/3: fail -> pass" in better.out
    found = json.loads(track.read_text())["verdicts"]
    assert (found["random.block/3"], found["random.block/4"]) == ("pass", "fail")


def test_vectors_are_written(wamnet, tmp_path, monkeypatch):
    from wamnet.spec.conformance import vectors

    monkeypatch.setattr(vectors, "contents", lambda: {"a.json": b"{}\n", "scenes/b.json": b"{}\n"})
    done = wamnet("conformance", "--write", str(tmp_path / "new"))
    assert (done.status, done.out) == (0, f"wrote 2 files to {tmp_path / 'new'}\n")
    assert (tmp_path / "new/scenes/b.json").read_bytes() == b"{}\n"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((), "--program and --executor: one of them is needed"),
        (("--program", "a", "--executor", "numpy"), "--program and --executor: exclude each other"),
        (("--program", "'"), "is not a command: No closing quotation ("),
        (("--program", " "), "is not a command"),
        (("--program", "/no/such/program"),
         "must answer to hello (crash: /no/such/program cannot be started"),
        (("--executor", "abacus"),
         "--executor 'abacus': unknown (choose one of reference, numpy, opencl, opengl"),
        (("--executor", "numpy", "--profile", "fast"), "fast"),
        (("--executor", "numpy", "--timeout", "0"), "--timeout 0.0: must be from 0.001 to 1000000 seconds"),
        (("--executor", "numpy", "--timeout", "nan"), "--timeout nan: must be from 0.001 to 1000000 seconds"),
        (("--executor", "numpy", "-k", "nothing"), "-k 'nothing': no case has such an id, clause or flag"),
        (("--executor", "numpy", "--vectors", "/no/such/folder"), "holds no file of vectors"),
        (("--executor", "numpy", "--json", "/no/such/folder/a"), "output folder '/no/such/folder"),
        (("--write", "x", "--executor", "numpy"), "--write 'x': it makes vectors and asks nobody"),
    ],
)  # fmt: skip
def test_what_is_refused(wamnet, arguments, text):
    done = wamnet("conformance", *arguments)
    assert (done.status, done.out) == (2, "")
    assert text in done.err


@pytest.mark.parametrize("text", ["[]", "{", '{"format": "other"}', '{"format": "wamnet-conformance-track"}'])
def test_a_file_that_is_no_track_is_refused(wamnet, tmp_path, text):
    path = tmp_path / "track.json"
    path.write_text(text)
    done = wamnet("conformance", "--executor", "numpy", "-k", "sine/0", "--track", str(path))
    assert (done.status, path.read_text()) == (2, text)
    assert "error: --track " in done.err


@pytest.mark.parametrize("text", ["\ufffe", "\uffff", "\0", "\x1b", "<&>", "\U0001f600"])
def test_a_report_for_other_programs_is_xml_whatever_a_program_says(text):
    """U+FFFE and U+FFFF are characters of JSON, and none of XML."""
    verdict = Verdict("sine/0", "sine", "SIN-1", "fail", text, got=text)
    found = ElementTree.fromstring(report.to_junit(text, [verdict], text))
    assert found.findall(".//failure")
