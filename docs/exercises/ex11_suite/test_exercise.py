"""Grades exercise 11: who is blamed for each fault, what is hidden, and whether a new case finds it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from wamnet.kernels.verify import judgement, run
from wamnet.kernels.verify.cases import questions
from wamnet.kernels.verify.renderers import Own
from wamnet.refimpl import encoding, vectors
from wamnet.refimpl.light import intersection, transport
from wamnet.refimpl.light.shapes.sphere import sphere_distance
from wamnet.spec.conformance.case import Case, load
from wamnet.spec.conformance.kinds import FUNCTIONS
from wamnet.spec.conformance.numbers import to_json
from wamnet.spec.conformance.program import of_reference
from wamnet.spec.conformance.report import first_blamed
from wamnet.spec.conformance.run import judge

VECTORS = Path(__file__).resolve().parents[3] / "spec/vectors"
"""The spec's vectors."""

SUITE = (
    *("vector", "camera.ray", "sampling.cosine_hemisphere", "intersection.sphere", "intersection.box"),
    *("intersection.nearest", "material.lambertian", "transport.mis_weight", "encoding.display"),
    *("path.start", "path.arrive", "path.scatter", "path.whole"),
)
"""The kinds that are asked."""

MOST_CASES = 30
"""Cases of a kind that are asked: of paths these are enough, and quick."""

DISPLAY = "encoding.display"
"""The kind from which a fault is hidden."""

LEAST_SEEN, LEAST_OFF, LEAST_SHARE = 0.01, 1000, 50
"""What is hidden must be off by so much, and of so many values at so many."""

RULES = ("finite", "misses", "albedo", "normals", "depth", "position")
"""Rules that pictures of layers must keep."""

PICTURES = 4
"""Pictures of each scene, the fewest that judges take."""


def packages():
    """Return the modules in which the reference and what asks it look names up."""
    rooms = ("wamnet.refimpl.", "wamnet.spec.conformance.")
    return [module for name, module in list(sys.modules.items()) if name.startswith(rooms)]


def forget():
    """Empty the caches: they hold what was made of the function that was there before."""
    for module in packages():
        for value in vars(module).values():
            if hasattr(value, "cache_clear"):
                value.cache_clear()


@pytest.fixture
def plant(monkeypatch):
    """Give a function that replaces a right function by a wrong one, wherever it is looked up."""

    def planted(right, wrong):
        forget()
        for module in packages():
            for name, value in list(vars(module).items()):
                if value is right:
                    monkeypatch.setattr(module, name, lambda *given: wrong(right, *given))

    yield planted
    monkeypatch.undo()
    forget()


def verdict(kind, case):
    """Return the verdict about the reference as it is now; an exception ends the check."""
    with np.errstate(all="ignore"):
        return judge(kind, case, {"output": to_json(dict(of_reference(kind, case.inputs, "ieee")))})


def asked(kinds=SUITE, most=MOST_CASES):
    """Return the verdicts of some kinds."""
    return [verdict(kind, case) for kind in kinds for case in load(VECTORS / f"{kind}.json")[1][:most]]


def failures(verdicts, kind):
    """Return how many cases of a kind fail."""
    return sum(v.failed for v in verdicts if v.kind == kind)


def assert_blamed(verdicts, clause):
    """Refuse a fault that no case sees, or that is blamed on another clause."""
    first = first_blamed(verdicts)
    assert first is not None, f"no case sees a fault; {clause} is to be blamed"
    assert first.clause == clause, f"{first.clause} is blamed, by {first.id}; {clause} is to be blamed"


def test_vectors_blame_the_sphere(student, plant):
    plant(sphere_distance, student.break_sphere)
    found = asked()
    assert_blamed(found, "ISC-6")
    seen = failures(found, "intersection.sphere")
    assert seen <= 4, f"{seen} cases of intersection.sphere see it: at most 4 may, so break less"


def test_vectors_blame_the_normal(student, plant):
    plant(intersection.surface_at, student.break_surface)
    assert_blamed(asked(), "ISC-8")


def test_vectors_blame_what_the_camera_is_made_of(student, plant):
    plant(vectors.normalize, student.break_camera)
    found = asked()
    assert_blamed(found, "VEC-3")
    assert failures(found, "camera.ray"), "the camera's rays are right: its cases must fail too"


def test_vectors_blame_the_path(student, plant):
    plant(transport.emission_weight, student.break_path)
    assert_blamed(asked(), "LTR-2")


def test_pictures_blame_the_depth(student):
    few = [q for q in questions() if q.shot.layers and q.rule in RULES]
    right = {shot.name: Own().pictures(shot, range(PICTURES)) for shot in run.shots_of(few)}
    with np.errstate(all="ignore"):
        found = {name: [student.break_picture(p) for p in pictures] for name, pictures in right.items()}
        first = judgement.first_blamed(judgement.judge(few, found))
    assert first is not None, "no rule is broken; depth is to be blamed"
    assert first.rule == "depth", f"the rule {first.rule} is blamed; depth is to be blamed"
    for before, after in zip(right["layers-wall"], found["layers-wall"], strict=True):
        # One rounding of a quotient, in either float type.
        off = np.abs(after["depth"] * before["depth"] - 1.0).max()
        assert off <= 2.0**-22, f"depth times distance is 1 up to {off:.2g}: write one over the distance"


def test_vectors_do_not_see_what_is_hidden(student, plant):
    linear = np.linspace(0.0, 1.0, LEAST_OFF)
    off = np.abs(student.hide(encoding.to_display, linear) - encoding.to_display(linear))
    count = int(np.count_nonzero(off >= LEAST_SEEN))
    wanted = f"at least {LEAST_SHARE} must be"
    assert count >= LEAST_SHARE, f"{count} of {LEAST_OFF} values are off by {LEAST_SEEN}: {wanted}"
    plant(encoding.to_display, student.hide)
    seen = [v.id for v in asked([DISPLAY], None) if v.failed]
    assert not seen, f"{seen[0]} sees what you hid"


def test_a_new_case_joins_the_vectors(student, plant):
    """The answer and its bound are computed from the reference; single precision must be within it."""
    inputs = {"linear": np.float64(np.float32(student.new_case()["linear"]))}
    function = FUNCTIONS[DISPLAY]
    outputs = {
        name: replace(output, value=to_json(output.value), bound=to_json(output.bound))
        for name, output in function.bounded(inputs)[0].items()
    }
    case = Case(f"{DISPLAY}/new", function.clause, to_json(inputs), outputs)
    single = encoding.to_display(np.float32(inputs["linear"]))
    found = judge(DISPLAY, case, {"output": {"encoded": to_json(float(single))}})
    assert not found.failed, f"linear = {inputs['linear']:g} refuses a right program; choose another value"
    plant(encoding.to_display, student.hide)
    found = verdict(DISPLAY, case)
    assert found.failed, f"linear = {inputs['linear']:g} does not see what you hid; choose another value"
