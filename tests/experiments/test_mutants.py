"""Mutants by machine: which changes there are, how reasons are read, and that vectors notice a sample."""

from __future__ import annotations

import ast
import shutil

import mutant
import mutants
import pytest
from lab import mutation, mutation_c, trial, trial_c
from lab.blame import Clauses
from lab.trial import Outcome
from lab.users import Users

pytestmark = pytest.mark.nightly  # it runs with the experiments

SOURCE = '''"""Words."""

LIMIT = 0.5
"""More words."""


def clamp(x: float, seed: int = 3) -> float:
    """Return x, a limit at most."""
    assert x == x
    if x > LIMIT and not seed:
        raise ValueError(f"{x + 1}")
    x = x * 2.0
    return min(x, LIMIT) - draw(seed, x, 1, 2)
'''
"""A module."""

ELEMENTARY = ("random.", "vector", "sampling.", "camera.", "intersection.", "material.", "sky.", "encoding.")
"""Kinds of the sample: quick ones."""

SAMPLED = ("refimpl/rng.py", "refimpl/light/sampling.py", "refimpl/light/materials/", "refimpl/vectors.py")
"""Modules of the sample, which these kinds reach."""

COUNT, SEED = 100, 11
"""Mutants of the sample, and the seed that draws them."""


def details(operator):
    return [m.detail for m in mutation.mutants("m.py", SOURCE) if m.operator == operator]


def test_changes_are_those_of_a_programmer():
    assert details("constant")[:4] == ["0.5 -> (1.0)", "0.5 -> (0.5005)", "3 -> (4)", "3 -> (2)"]
    assert details("comparison") == ["x > LIMIT -> (x >= LIMIT)"]
    assert details("dropped") == ['raise ValueError(f"{x + 1}") -> pass', "x = x * 2.0 -> pass"]
    assert details("condition") == ["x > LIMIT and not seed -> (not (x > LIMIT and (not seed)))"]
    assert "draw(seed, x, 1, 2) -> (draw(seed & 65535, x, 1, 2))" in details("width")
    assert details("function") == ["min(x, LIMIT) -> (max(x, LIMIT))"]
    assert details("arguments")[0] == "draw(seed, x, 1, 2) -> (draw(x, seed, 1, 2))"


def test_every_mutant_is_another_program_with_the_same_lines():
    found = mutation.mutants("m.py", SOURCE)
    assert len({m.name for m in found}) == len(found)
    texts = [mutation.mutated(m, SOURCE) for m in found]
    assert {text.count("\n") for text in texts} == {SOURCE.count("\n")}
    assert ast.dump(ast.parse(SOURCE)) not in {ast.dump(ast.parse(text)) for text in texts}


def test_mutants_of_the_c_program_change_one_line():
    (source,) = mutants.texts(c99=True).values()
    found = mutation_c.mutants(mutants.C99, source)
    assert len(found) > 2000
    for m in found[::50]:
        lines = zip(source.splitlines(), mutation.mutated(m, source).splitlines(), strict=True)
        assert sum(a != b for a, b in lines) == 1, m.name


def test_changes_are_named_by_the_place_that_they_are_in_not_by_lines():
    found = mutation.mutants("m.py", SOURCE)
    moved = mutation.mutants("m.py", SOURCE.replace("LIMIT = 0.5", "\n\nLIMIT = 0.5"))
    assert [m.change for m in moved] == [m.change for m in found]
    assert [m.name for m in moved] != [m.name for m in found]
    assert len({m.change for m in found}) == len(found)
    places = {m.change.split(":")[1] for m in found}
    assert places == {"LIMIT", "clamp()", "clamp"}


def test_changes_in_a_class_are_named_by_its_fields():
    source = "class Job:\n    seed: int = 7\n    kind = -1.0\n\n    def f(self, a=2): return a + 3\n"
    found = [m.change for m in mutation.mutants("m.py", source)]
    assert "m.py:Job.seed:constant:7 -> (8)" in found
    assert "m.py:Job.kind:sign:-1.0 -> (1.0)" in found
    assert "m.py:Job.f:operand dropped:a + 3 -> (a)" in found


def test_reasons_have_a_sort_and_fit_changes(tmp_path):
    known = mutants.reasons()
    some = mutants.chosen(["dielectric.py:fresnel:exchanged:ratio"], None, 0)
    assert {mutants.excuse(m, known) for m in some} == {"equal"}
    other = tmp_path / "reasons.txt"
    other.write_text("dielectric.py:* | 3 | boring | nobody asks\n", encoding="utf-8")
    with pytest.raises(AssertionError, match="a reason is one of"):
        mutants.reasons(other)


def test_each_reason_fits_as_many_mutants_as_it_says():
    every = mutants.chosen([], None, 0) + mutants.chosen([], None, 0, c99=True)
    assert mutants.faults(every, mutants.reasons()) == []


def test_reasons_that_fit_nothing_more_than_they_say_or_what_has_one_are_wrong(tmp_path):
    path = tmp_path / "reasons.txt"
    rows = ("m.py:gone:* | 1", "m.py:clamp:comparison:* | 1", "m.py:LIMIT:* | 1", "m.py:LIMIT:*(1.0) | 1")
    path.write_text("".join(f"{row} | equal | words\n" for row in rows), encoding="utf-8")
    wrong = mutants.faults(mutation.mutants("m.py", SOURCE), mutants.reasons(path))
    assert len(wrong) == 3
    assert "fits 0 mutants, not 1" in wrong[0]
    assert "fits 2 mutants, not 1" in wrong[1]
    assert wrong[2] == "m.py:LIMIT:constant:0.5 -> (1.0) has more than one reason"


def test_a_reason_may_hold_the_sign_between_columns(tmp_path):
    path = tmp_path / "reasons.txt"
    path.write_text("m.py:f:operand dropped:a | b -> (a) | 1 | equal | b is 0\n", encoding="utf-8")
    (mutant, *_) = mutation.mutants("m.py", "def f(a, b):\n    return a | b\n")[1:]
    assert mutants.excuse(mutant, mutants.reasons(path)) == "equal"


def test_blame_is_right_near_or_neither():
    mutant, *_ = mutants.chosen(["rng.py:uniform_floats:exchanged"], None, 0)
    clauses = Clauses()
    assert clauses.broken(mutant) == {"RNG-5"}
    assert clauses.near(mutant, "RNG-3")
    assert not clauses.near(mutant, "SMP-1")


def test_a_table_counts_what_came(monkeypatch):
    some = mutants.chosen(["refimpl/rng.py:uniform_floats:"], 3, 0)
    came = (Outcome(2, "random.block/0", "RNG-5", "", "fail"), Outcome(2), Outcome(0))
    kept = {m.name: outcome for m, outcome in zip(some, came, strict=True)}
    monkeypatch.setattr(mutants, "reasons", list)
    last = mutants.table("module", {"rng": some}, kept).splitlines()[-1]
    assert last == "| all | 3 | 2 | 1 | 0 | 0 | 1 | 50.0 | 100.0 | 100.0 |"


@pytest.mark.needs("programs")
def test_a_sample_of_mutants_of_the_reference_is_caught():
    cases = [(kind, case) for kind, case in trial.in_order() if kind.startswith(ELEMENTARY)]
    reached, sources, known = trial.reach(cases), mutants.texts(c99=False), mutants.reasons()
    some = [m for m in mutants.chosen(SAMPLED, None, SEED) if m.function and "invert_" not in m.function][::7]
    came = {m: trial.trial(m, sources[m.module], cases, reached) for m in some}
    asked = [m for m in some if came[m].asked and not mutants.excuse(m, known)]
    missed = [m.name for m in asked if not came[m].verdict]
    assert len(asked) >= COUNT
    assert len(missed) <= mutants.MOST_MISSED * len(asked), missed


@pytest.mark.needs("programs")
@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not there")
def test_a_mutant_of_the_c_program_is_caught(tmp_path):
    (source,) = mutants.texts(c99=True).values()
    cases = [(kind, case) for kind, case in trial.in_order() if kind.startswith(("random.", "encoding."))]
    lines = trial_c.reach(source, cases, tmp_path)
    some = [m for m in mutation_c.mutants(mutants.C99, source) if m.function.startswith("RNG-3")]
    came = [trial_c.trial(m, source, cases, lines, tmp_path) for m in some]
    assert {outcome.verdict for outcome in came if outcome} == {"fail"}


def test_a_default_is_used_by_the_methods_of_its_class():
    source = (
        "FULL = 1.0\n\n\nclass Job:\n    share: float = FULL\n\n    def f(self):\n        return self.share\n"
    )
    constant = mutation.mutants("m.py", source)[0]
    assert Users({"m.py": source}).lines(constant) == {("m.py", line) for line in (1, 4, 5, 6, 7, 8)}


# ---- one mutant -----------------------------------------------------------------------------------------

BEHIND = "sphere.py:*:(discriminant > 0.0) & (t_far > 0.0) -> (discriminant > 0.0)"
"""A sphere behind the ray is met."""


@pytest.mark.needs("programs")
def test_one_mutant_is_shown_with_those_who_see_it(capsys):
    mutant.main([BEHIND, "-k", "intersection"])
    said = capsys.readouterr().out.splitlines()
    assert said[0].endswith(", governed by ISC-6")
    assert said[1].startswith("- return np.where((discriminant > 0.0) & (t_far > 0.0), ")
    assert said[2].startswith("+ return np.where((discriminant > 0.0), ")
    asked = sum(kind.startswith("intersection.") for kind, _ in trial.in_order())
    assert said[3] == f"4 of {asked} cases see it:"
    assert said[4] == "  intersection.sphere: 2 of 17 cases, blamed on ISC-6"
    assert said[5] == "  intersection.nearest: 1 of 14 cases, blamed on ISC-1"
    assert said[6] == "  intersection.occluded: 1 of 27 cases, blamed on ISC-10"
    assert said[7] == "look first at ISC-6: intersection.sphere/1 (away from it)"


@pytest.mark.needs("programs")
def test_a_survivor_is_shown_with_its_reason_or_as_missed(capsys):
    mutant.main(["sphere.py:*:b < 0.0 -> (b <= 0.0)", "-k", "intersection.sphere"])
    assert capsys.readouterr().out.splitlines()[-1].startswith("equal: at b = 0 ")
    mutant.main([BEHIND, "-k", "intersection.sphere/2"])
    assert capsys.readouterr().out.splitlines()[-2:] == [
        "0 of 1 cases see it",
        "other cases may see it: ask without -k",
    ]


@pytest.mark.needs("programs")
def test_a_mutant_that_the_whole_suite_does_not_see_is_missed():
    (some,) = mutants.chosen(["sphere.py:sphere_distance:comparison:b < 0.0 -> (b <= 0.0)"], None, 0)
    unknown = some._replace(change="m.py:f:constant:1 -> (2)")
    said = list(mutant.told(unknown, mutants.texts(c99=False)[some.module], [], [], whole=True))
    assert said[-1] == "missed: a case, or a reason, is still to be written"


@pytest.mark.needs("programs")
def test_a_mutant_that_cannot_be_imported_fails_each_case():
    (some,) = mutants.chosen(["sphere.py:Sphere.closed:constant"], None, 0)
    broken = some._replace(start=0, end=0, text="raise SystemExit\n")
    (source,) = (text for path, text in mutants.texts(c99=False).items() if path == some.module)
    asked = mutant.cases(["random.block"])
    failures = trial.failures(broken, source, asked)
    assert [failed and failed[3] for failed in failures] == ["crash"] * len(asked)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["sphere.py:*:comparison"], "not of 6 ("),
        (["sphere.py:no such"], "not of 0 (the name of a module"),
        ([BEHIND, "-k", "no-such-case"], "no case fits"),
    ],
)
def test_what_names_no_mutant_or_several_is_refused(capsys, words, said):
    with pytest.raises(SystemExit, match="2"):
        mutant.main(words)
    assert said in " ".join(capsys.readouterr().err.split())
