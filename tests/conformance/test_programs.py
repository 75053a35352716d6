"""Programs that are wrong in one way each: every one gets the verdict that it deserves, none a traceback."""

import sys
from collections import Counter

import pytest

from wamnet.refimpl.errors import InputError
from wamnet.spec.conformance import run
from wamnet.spec.conformance.case import Case, Output
from wamnet.spec.conformance.protocol import NoAnswerError, Session
from wamnet.spec.conformance.report import first_blamed
from wamnet.spec.conformance.run import Verdict, judge

ANSWER = '{"id": request["id"], "output": KINDS[request["kind"]](request["input"])}'
"""The example's answer, which wrong programs change."""

WRONG = {
    "a wrong multiplier": ("1664525", "1664527", "random.block", "RNG-3", "fail"),
    "NaN": ('{"encoded": 12.92', '{"encoded": float("nan") * 12.92', "encoding.display", "ENC-5", "garbage"),
    "another shape": ('"words": words', '"words": [words]', "random.block", "RNG-3", "fail"),
    "one number too few": ('"words": words', '"words": words[:3]', "random.block", "RNG-3", "fail"),
    "texts for numbers": ('"words": words', '"words": ["a"] * 4', "random.block", "RNG-3", "fail"),
    "null for numbers": ('"words": words', '"words": None', "random.block", "RNG-3", "fail"),
    "an object for numbers": ('"words": words', '"words": {"file": 3}', "random.block", "RNG-3", "fail"),
    "integers of a thousand digits": ('"words": words', '"words": [10**999] * 4', "random.block", "RNG-3",
        "garbage"),
    "lists of lists of lists": ("print(json.dumps(answer)",
        'print(json.dumps(answer).replace("words\\": [", "words\\": [" + "[" * 500 + "]" * 500 + ",")',
        "random.block", "RNG-3", "garbage"),
    "an output left out": ('"words": words, ', "", "random.block", "RNG-3", "fail"),
    "a valid input refused": (ANSWER, '{"id": request["id"], "refused": "no"}', "random.block", "RNG-3",
        "fail"),
    "no answer to this case": (ANSWER, '{"id": request["id"], "unsupported": "no"}', "random.block", "RNG-3",
        "unsupported"),
    "neither output nor refusal": (ANSWER, '{"id": request["id"]}', "random.block", "RNG-3", "garbage"),
    "another id": ('request["id"]', '"mine"', "random.block", "RNG-3", "garbage"),
    "an id that is a list": ('request["id"]', "[1]", "random.block", "RNG-3", "garbage"),
    "no JSON": (ANSWER, '"words"', "random.block", "RNG-3", "garbage"),
    "words of greeting": ('answer = {"id"', 'print("computing ..."); answer = {"id"', "random.block", "RNG-3",
        "garbage"),
    "a crash": (ANSWER, '{} if sys.exit("out of memory") else {}', "random.block", "RNG-3", "crash"),
}  # fmt: skip
"""By name: what is replaced, by what, chosen cases, the clause blamed, the worst verdict."""


@pytest.mark.nightly(
    but=("a crash", "no JSON", "an id that is a list", "integers of a thousand digits", "another id")
)
@pytest.mark.parametrize("name", WRONG)
def test_wrong_program(program, verdicts, name):
    old, new, word, clause, verdict = WRONG[name]
    found = verdicts(program((old, new)), [word])
    count = Counter(v.verdict for v in found)
    assert count[verdict] > 0, count
    assert set(count) <= {verdict, "pass"}
    # Where no answer is right, those that must be refused are not either (CNF-9).
    assert {clause} <= {v.clause for v in found if v.verdict == verdict} <= {clause, "CNF-9"}
    assert all(v.failed == (v.verdict not in ("pass", "unsupported")) for v in found)


def test_a_crash_tells_the_status_and_the_last_words(program, verdicts):
    old, new, *_ = WRONG["a crash"]
    (found,) = verdicts(program((old, new)), ["random.block/1"])
    assert found.text == "it ended with status 1; it said: out of memory"


def test_a_program_that_crashes_is_started_again(program, verdicts):
    crash = 'KINDS[request["kind"]](request["input"]) if request["id"][-1] != "3" else sys.exit(7)'
    found = verdicts(program(('KINDS[request["kind"]](request["input"])', crash)), ["random.block"])
    assert Counter(v.verdict for v in found) == {"pass": 20, "crash": 2}


def test_a_program_that_hangs_is_given_up(program, verdicts):
    hang = (ANSWER, '__import__("time").sleep(60)')
    found = verdicts(program(hang), ["random.block"], 0.5)
    assert Counter(v.verdict for v in found) == {"timeout": 22}
    assert found[0].text == "no answer within 0.5 s"
    assert found[3].text == "not asked: 3 cases of this kind had no answer in time"


def test_output_without_end_fills_no_memory(program, verdicts):
    endless = ("print(json.dumps(answer), flush=True)", 'print(json.dumps(answer) + "x" * 2**25, flush=True)')
    greeting = (
        '"kinds": list(KINDS)}',
        '"kinds": list(KINDS)}; print(json.dumps(answer), flush=True); continue',
    )
    found = verdicts(program(endless, greeting), ["random.block/0"], 20.0)
    assert [v.verdict for v in found] == ["garbage"]


@pytest.mark.needs("programs")
def test_a_program_that_does_not_read(tmp_path):
    """A request larger than a pipe's buffer of 64 KiB must not stop the runner."""
    request = {"id": "a", "input": "x" * 2**20}
    with Session(["sleep", "60"], 0.5) as session, pytest.raises(NoAnswerError, match="no answer within"):
        session.ask(request)


@pytest.mark.parametrize(
    ("command", "text"),
    [
        (["/no/such/program"], r"crash: /no/such/program cannot be started: No such file"),
        ([sys.executable, "-c", "print(1)"], "garbage: the line is not a JSON object"),
        ([sys.executable, "-c", "print({})"], "garbage: the answer to hello has no list of kinds"),
        ([sys.executable, "-c", "raise SystemExit(3)"], "crash: it ended with status 3"),
        (["sleep", "60"], "timeout: no answer within"),
    ],
)
def test_programs_that_do_not_introduce_themselves_are_refused(verdicts, command, text):
    with pytest.raises(InputError, match=rf"^--program '.*': must answer to hello \({text}.* \(see spec"):
        verdicts(command, ["random.block"], 1.0)


@pytest.mark.needs("programs")
def test_a_program_that_has_answered_ends_by_itself(tmp_path):
    """Also where its answer is there before it has read the request: it was killed then."""
    code = "import sys; print('{\"id\": 1}', flush=True); sys.stdin.read(); open('ended', 'w').close()"
    (tmp_path / "program.py").write_text(f"import os; os.chdir({str(tmp_path)!r}); {code}")
    with Session([sys.executable, str(tmp_path / "program.py")], 60.0) as session:
        session.ask({"id": 1, "input": "x" * 2**20})
    assert (tmp_path / "ended").exists()


ACCEPTS = (
    'KINDS = {**dict.fromkeys(("metric.mse", "file.model", "file.scene"), lambda given: {"value": 0.0}), '
)
"""A program that takes everything."""


@pytest.mark.parametrize(
    ("kind", "clause"), [("metric.mse", "MET-1"), ("file.model", "MOD-6"), ("file.scene", "SCN-7")]
)
def test_a_program_that_takes_what_is_invalid(program, verdicts, kind, clause):
    found = verdicts(program(("KINDS = {", ACCEPTS)), [kind])
    wrong = [v for v in found if v.text == "the input is invalid and must be refused"]
    assert clause in {v.clause for v in wrong}
    assert {v.verdict for v in wrong} == {"fail"}


# ---- judgement --------------------------------------------------------------------------------------------


def judged(output, **expected):
    case = Case("RNG-3", {"x": 1}, {"y": Output(**expected)}, id="k/0")
    return run.judge("k", case, {"output": {"y": output}})


def test_the_bound_is_met_or_not():
    assert judged("0x1p+0", value="0x1.8p+0", bound="0x1p-1").verdict == "pass"
    found = judged(["0x1p+0", "0x1p+1"], value=["0x1p+0", "0x1p+0"], bound="0x1.cp-1")
    assert (found.verdict, found.stage, found.expected, found.got) == ("fail", "y[1]", "0x1p+0", "0x1p+1")
    assert found.text == "error 1, bound 0.875"


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_what_is_no_number_is_within_no_bound(value):
    assert judged(value, value="0x1p+0", bound="0x1p+9").verdict == "fail"
    assert judged("nan", value=value, bound="inf").verdict == "fail"


# ---- what to look at first --------------------------------------------------------------------------------


def test_of_a_path_the_earliest_vertex_that_deviates_is_told():
    """The worst number is a later one, of an output that is looked at before."""
    expected = {"t": Output([1.0, 2.0, 3.0], 0.5), "point": Output([[0.0] * 3] * 3, 0.5)}
    answer = {"output": {"t": [1.0, 2.0, 300.0], "point": [[0, 0, 0], [0, 2, 1], [9, 9, 9]]}}
    case = Case("LTR-8", {}, expected, id="path.whole/0")
    verdict = judge("path.whole", case, answer)
    assert (verdict.stage, verdict.expected, verdict.got) == ("point[1][1]", "0x0p+0", "0x1p+1")
    elsewhere = judge("metric.mse", case, answer)
    assert elsewhere.stage == "t[2]"


def test_a_deviation_is_blamed_on_the_clause_of_its_output():
    expected = {"a": Output(1.0, 0.5), "b": Output(1.0, 0.5, clause="RNG-4")}
    case = Case("CAM-3", {}, expected, id="path.start/0")
    assert judge("path.start", case, {"output": {"a": 1, "b": 1}}).clause == "CAM-3"
    assert judge("path.start", case, {"output": {"a": 1, "b": 2}}).clause == "RNG-4"
    assert judge("path.start", case, {"output": {"a": 1}}).clause == "RNG-4"


def test_what_others_are_made_of_comes_first():
    found = [
        Verdict(f"{kind}/0", kind, clause, verdict)
        for kind, clause, verdict in (
            ("adam.step", "ADM-1", "fail"),
            ("path.whole", "LTR-8", "fail"),
            ("path.start", "CAM-3", "crash"),
            ("random.block", "RNG-3", "pass"),
        )
    ]
    first = first_blamed(found)
    assert first is not None
    assert first.clause == "CAM-3"
    assert first_blamed(found[3:]) is None


def test_what_a_program_has_started_ends_with_it(verdicts, tmp_path):
    """The grandchild holds the program's output open: the session must not wait for it."""
    script = 'sleep 60 & while read line; do echo \'{"kinds": ["random.block"]}\'; done'
    found = verdicts(["sh", "-c", script], ["random.block/0"])
    assert [v.verdict for v in found] == ["garbage"]


def test_infinity_is_met_by_infinity_alone():
    assert judged("inf", value="inf", bound="0x0p+0").verdict == "pass"
    assert judged(1e300, value="inf", bound="0x0p+0").verdict == "fail"
