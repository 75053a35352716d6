"""The rules of an operator: a row of the table has its handler, and the attributes that it may have."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from .fields import Field
from .graph import GraphNode
from .reader import AGAIN, MOST_AXES, Reader

Handler = Callable[[Reader, GraphNode], Field]
"""(reader, node) -> its result."""


@dataclass(frozen=True)
class Rule:
    """Which values of an attribute are right, in words, and the remedy."""

    holds: Callable[[Any], bool]
    text: str
    remedy: str = AGAIN


@dataclass(frozen=True)
class Operator:
    """A row: the handler, the attributes, the most outputs, and whether integers stay what they are."""

    handler: Handler
    attributes: Mapping[str, Rule] = field(default_factory=dict)
    outputs: int = 1
    integers: bool = False


def only(*values: Any, remedy: str = AGAIN) -> Rule:
    """Return the rule of some values."""
    return Rule(lambda value: value in values, " or ".join(str(value) for value in values), remedy)


def lists(size: int, least: int) -> Rule:
    """Return the rule of a list of so many integers."""
    text = f"{size} integers of at least {least}"
    return Rule(lambda value: len(value) == size and min(value) >= least, text)


NONE = Rule(lambda _: False, "left out: it is not supported")
"""The rule of other attributes."""

ANY = Rule(lambda _: True, "")
"""The rule of attributes that change nothing in inference."""

LISTED = Rule(lambda value: len(value) <= 2 * MOST_AXES, f"at most {2 * MOST_AXES} integers")
"""The rule of lists that the handler checks."""

NUMBER = Rule(math.isfinite, "a finite number")
"""The rule of numbers."""

INFERENCE = "export the network for inference, as after model.eval()"
"""The remedy of training modes."""
