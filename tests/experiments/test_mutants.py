"""Mutants by machine: which changes there are, how reasons are read, and that vectors notice a sample."""

import shutil

import mutant
import mutants
import pytest
from lab import mutation, mutation_c, trial, trial_c

from wamnet.spec.conformance import program, run
from wamnet.spec.conformance.case import FOLDER

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


def test_each_reason_fits_as_many_mutants_as_it_says():
    every = mutants.chosen([], None, 0) + mutants.chosen([], None, 0, c99=True)
    assert mutants.faults(every, mutants.reasons()) == []


@pytest.mark.needs("programs")
def test_a_sample_of_mutants_of_the_reference_is_caught():
    cases = [(kind, case) for kind, case in trial.in_order() if kind.startswith(ELEMENTARY)]
    reached, sources, known = trial.reach(cases), mutants.texts(c99=False), mutants.reasons()
    some = [m for m in mutants.chosen(SAMPLED, None, SEED) if m.function][::7]
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


def test_the_reference_passes_its_own_cases() -> None:
    """What asks a mutant asks the reference unchanged in the same way."""
    modules = program, run
    cases = run.read_vectors(FOLDER)["intersection.sphere"][:3]
    assert len(cases) == 3
    assert [trial.asked(modules, "intersection.sphere", case) for case in cases] == [None] * 3
