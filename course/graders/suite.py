"""Grades the extra on the suite: who is blamed for each fault, what is hidden, and a case that finds it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from wamnet.refimpl import encoding, vectors
from wamnet.refimpl.light import intersection, transport
from wamnet.refimpl.light.shapes.sphere import sphere_distance
from wamnet.spec.conformance.case import Case
from wamnet.spec.conformance.kinds import FUNCTIONS
from wamnet.spec.conformance.numbers import to_json
from wamnet.spec.conformance.program import of_reference
from wamnet.spec.conformance.report import first_blamed
from wamnet.spec.conformance.run import Verdict, judge
from wamnet_verify import judgement, run
from wamnet_verify.cases import questions
from wamnet_verify.renderers import Own

from ..frame import Check, Wrong, cases_of, equal, hold

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


def _packages() -> list[Any]:
    """Return the modules in which the reference and what asks it look names up."""
    rooms = ("wamnet.refimpl.", "wamnet.spec.conformance.")
    return [module for name, module in list(sys.modules.items()) if name.startswith(rooms)]


def _forget() -> None:
    """Empty the caches: they hold what was made of the function that was there before."""
    for module in _packages():
        for value in list(vars(module).values()):
            if hasattr(value, "cache_clear"):
                value.cache_clear()


@contextmanager
def planted(right: Any, wrong: Callable[..., Any]) -> Iterator[None]:
    """Replace a right function by a wrong one, wherever it is looked up, until the block ends."""
    _forget()
    changed = [
        (module, name)
        for module in _packages()
        for name, value in list(vars(module).items())
        if value is right
    ]
    try:
        for module, name in changed:
            setattr(module, name, lambda *given: wrong(right, *given))
        yield
    finally:
        for module, name in changed:
            setattr(module, name, right)
        _forget()


def verdict(kind: str, case: Case) -> Verdict:
    """Return the verdict about the reference as it is now; an exception ends the check."""
    return judge(kind, case, {"output": to_json(dict(of_reference(kind, case.inputs, "ieee")))})


def asked(kinds: Sequence[str] = SUITE, most: int | None = MOST_CASES) -> list[Verdict]:
    """Return the verdicts of some kinds."""
    return [verdict(kind, case) for kind in kinds for case in cases_of(kind)[:most]]


def failures(verdicts: Sequence[Verdict], kind: str) -> int:
    """Return how many cases of a kind fail."""
    return sum(v.failed for v in verdicts if v.kind == kind)


def blamed(verdicts: Sequence[Verdict], clause: str, likely: str) -> None:
    """Refuse a fault that no case sees, or that is blamed on another clause."""
    first = first_blamed(verdicts)
    if first is None:
        text = "the numbers are still right where cases look: break them there"
        raise Wrong("CNF-11", "the clause that is blamed", clause, "none: no case sees a fault", text)
    if first.clause != clause:
        raise Wrong("CNF-11", "the clause that is blamed", clause, f"{first.clause}, by {first.id}", likely)


def break_sphere(student: Any) -> None:
    """ISC-6 is blamed, by at most four cases of the sphere."""
    with planted(sphere_distance, student.break_sphere):
        found = asked()
    text = "another kind fails too, and it is more elementary: distances only, and of the right shape"
    blamed(found, "ISC-6", text)
    seen, text = failures(found, "intersection.sphere"), "break less: one sort of ray"
    hold("CNF-3", "cases of intersection.sphere that fail", seen <= 4, "at most 4", seen, text)


def break_surface(student: Any) -> None:
    """ISC-8 is blamed."""
    with planted(intersection.surface_at, student.break_surface):
        blamed(asked(), "ISC-8", "the normal or the point of a surface, and not what comes before it")


def break_camera(student: Any) -> None:
    """Cases of the camera fail, and VEC-3 is blamed."""
    with planted(vectors.normalize, student.break_camera):
        found = asked()
    text = "vectors of another length or direction: cases of the vectors have to see it as well"
    blamed(found, "VEC-3", text)
    text = "the vectors that the camera makes are right: break all of them, not single ones"
    hold("CNF-11", "cases of camera.ray that fail", failures(found, "camera.ray") > 0, "some", "none", text)


def break_path(student: Any) -> None:
    """LTR-2 is blamed."""
    with planted(transport.emission_weight, student.break_path):
        blamed(asked(), "LTR-2", "weights (...) of what a path meets by chance, and nothing else")


@cache
def right_pictures() -> tuple[Any, dict[str, Any]]:
    """Return questions about layers, and the reference's pictures by the scene's name."""
    few = [q for q in questions() if q.shot.layers and q.rule in RULES]
    return few, {shot.name: Own().pictures(shot, range(PICTURES)) for shot in run.shots_of(few)}


def break_picture(student: Any) -> None:
    """The rule `depth` is blamed, and the layer is one over the distance."""
    few, right = right_pictures()
    found = {name: [student.break_picture(p) for p in pictures] for name, pictures in right.items()}
    first = judgement.first_blamed(judgement.judge(few, found))
    told = "none" if first is None else first.rule
    text = "a rule that comes before: where nothing is met depth is 0, and every number is finite"
    text = "the layer `depth` is as it was" if first is None else text
    equal("CNF-13", "the rule that is blamed", told, "depth", text)
    for before, after in zip(right["layers-wall"], found["layers-wall"], strict=True):
        # One rounding of a quotient, in either float type.
        off = float(np.abs(after["depth"] * before["depth"] - 1.0).max())
        hold("CNF-13", "depth times distance - 1", off <= 2.0**-22, "0", off, "one over the distance")


def hides(student: Any) -> None:
    """No case of encoding.display sees what is hidden."""
    linear = np.linspace(0.0, 1.0, LEAST_OFF)
    off = np.abs(student.hide(encoding.to_display, linear) - encoding.to_display(linear))
    count = int(np.count_nonzero(off >= LEAST_SEEN))
    what = f"values of {LEAST_OFF} that are off by {LEAST_SEEN}"
    text = "a wider range, or a larger fault"
    hold("CNF-3", what, count >= LEAST_SHARE, f"at least {LEAST_SHARE}", count, text)
    with planted(encoding.to_display, student.hide):
        seen = [v.id for v in asked([DISPLAY], None) if v.failed]
    text = "look where no case is, in the folder of the vectors"
    hold("CNF-3", "cases that see what is hidden", not seen, "none", ", ".join(seen[:3]), text)


def new_case(student: Any) -> None:
    """The answer and its bound are computed from the reference; single precision must be within it."""
    inputs = {"linear": np.float64(np.float32(student.new_case()["linear"]))}
    outputs = {
        name: replace(output, value=to_json(output.value), bound=to_json(output.bound))
        for name, output in FUNCTIONS[DISPLAY].bounded(inputs).items()
    }
    case = Case("ENC-5", to_json(inputs), outputs, id=f"{DISPLAY}/new")
    single = encoding.to_display(np.asarray(inputs["linear"], np.float32))
    found = judge(DISPLAY, case, {"output": {"encoded": to_json(float(single))}})
    what = f"the case linear = {inputs['linear']:g}"
    hold("CNF-3", what, not found.failed, "accepts a right program", "refuses it", "choose another value")
    with planted(encoding.to_display, student.hide):
        found = verdict(DISPLAY, case)
    hold(
        "CNF-3", what, found.failed, "sees what is hidden", "does not", "choose a value in the range of hide"
    )


CHECKS = (
    Check("vectors blame the sphere", break_sphere),
    Check("vectors blame the normal", break_surface),
    Check("vectors blame what the camera is made of", break_camera),
    Check("vectors blame the path", break_path),
    Check("pictures blame the depth", break_picture),
    Check("vectors do not see what is hidden", hides),
    Check("a new case joins the vectors", new_case),
)
"""One for each function."""
