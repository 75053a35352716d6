"""The list of passes, and the way they run: in a named order, with the verifier before and after each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from functools import partial
from typing import TypeVar

from ....refimpl.errors import CompileError, choice
from ..ir import Program
from ..profiles import EXPAND_SINE
from ..sine import POLYNOMIALS
from ..verify import verify
from .fold import fold, fold_float32
from .rewrite import eliminate_dead, expand_sine, expand_tables, fuse_bias, scalarize

PASSES: Mapping[str, Callable[[Program], Program]] = {
    "fold": fold,
    "fold_float32": fold_float32,
    "scalarize": scalarize,
    "expand_tables": expand_tables,
    "fuse_bias": fuse_bias,
    EXPAND_SINE: expand_sine,
    **{f"{EXPAND_SINE}_{degree}": partial(expand_sine, degree=degree) for degree in POLYNOMIALS},
    "eliminate_dead": eliminate_dead,
}
"""All passes, by name."""

COMMON = ("fold", "fuse_bias", "eliminate_dead")
"""What every program goes through; error bounds speak about the result, where a sine is one node."""


def run(program: Program, names: Sequence[str], when: str = "before the passes") -> Program:
    """Return the program after the named passes, verified after each that changes it."""
    verify(program, when)
    for name in names:
        if name not in PASSES:
            raise CompileError(f"pass {name!r}: unknown ({choice(name, PASSES)})")
        changed = PASSES[name](program)
        if changed is not program:
            program = verify(changed, f"after pass {name}")
    return program


Programs = TypeVar("Programs")


def run_each(programs: Programs, names: Sequence[str]) -> Programs:
    """Return an object whose fields are programs, with these after the named passes."""
    found = copy(programs)
    held = {key: run(each, names) for key, each in vars(programs).items() if isinstance(each, Program)}
    vars(found).update(held)
    return found
