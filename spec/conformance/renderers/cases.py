"""All cases: a new one is a generator of questions in one of the modules' `GROUPS`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from wamnet.refimpl.errors import InputError

from . import layer_cases, light_cases
from .case import RULES, Question


@cache
def questions() -> tuple[Question, ...]:
    """Return every question, in the order of rules."""
    found = [question for group in (*light_cases.GROUPS, *layer_cases.GROUPS) for question in group()]
    order = list(RULES)
    return tuple(sorted(found, key=lambda question: order.index(question.rule)))


def chosen(words: Sequence[str]) -> tuple[Question, ...]:
    """Return the questions whose name holds one of these words or whose rule it is; all without words."""
    every = questions()
    if not words:
        return every
    for word in words:
        if not any(word in question.name or word == question.rule for question in every):
            rule = "no case's name holds it, and no rule is called so"
            raise InputError("-k", word, rule, f"rules are {', '.join(RULES)}")
    return tuple(q for q in every if any(word in q.name or word == q.rule for word in words))
