"""What a target's language looks like: templates and a table of operations, no logic.

emit.py fills the templates in. Names in braces: `image` and `channels` of a feature image, `entry`,
`images` and `defines` of the whole kernel, `unordered` (what stands where the language cannot keep operations
in order: without an error bound, with one), `index` into the weights, `i` and `value` of an output channel,
`0` and `1` the operands of an operation. The text between is the language's own, its braces doubled.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .profiles import SineContract


class Dialect:
    """One language; a subclass sets every attribute that has no value here."""

    target: str
    language: str
    suffix: str
    entry: str
    image_declaration: str
    image_separator: str
    begin: str
    end = "}}"
    pixel: str
    weight: str
    store: str
    arguments: str
    max_output_channels: int
    native_sine: SineContract
    temporary = "float"
    unordered: tuple[str, str] = ("", "")
    operations: Mapping[str, str] = {
        "add": "{0} + {1}",
        "subtract": "{0} - {1}",
        "multiply": "{0} * {1}",
        "divide": "{0} / {1}",
        "negative": "-{0}",
        "floor": "floor({0})",
        "sqrt": "sqrt({0})",
        "sin": "sin({0})",
    }

    @staticmethod
    def literal(value: float) -> str:
        """Return a float32 constant: nine digits name it, also for a reader that goes through double."""
        digits = f"{float(np.float32(value)):.9g}"
        text = digits + ("f" if "." in digits or "e" in digits else ".0f")
        return f"({text})" if text.startswith("-") else text
