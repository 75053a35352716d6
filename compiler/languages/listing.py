"""The IR itself as a language: what the interpreter runs is printed, one program after another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core import ir
from ..core.ir import Program
from ..core.profiles import SineContract
from ..kernel.interface import INTEGERS
from ..kernel.kernel import Kernel
from .dialect import NOTHING, Dialect

PRINTED = "the program's inputs and parameters, by name"
"""How a program is called that is not compiled."""


class Listing(Dialect):
    """The dialect's table: nothing is bound, and nothing has a limit."""

    target = "numpy"
    language = "wamnet IR"
    suffix = ".ir.txt"
    is_listing = True
    entries = dict.fromkeys(INTEGERS, "program")
    max_output_channels = 2**16
    native_sine = SineContract("np.sin, whose documentation promises nothing", None)

    def arguments(
        self, kernel: Kernel, lists: Mapping[str, Sequence[str]] = NOTHING, notes: Mapping[str, str] = NOTHING
    ) -> str:
        """Return how a program is called."""
        return PRINTED


def listed(lines: Sequence[str], programs: Sequence[tuple[str, Program]]) -> str:
    """Return programs as text, each under its name if it has one, and all under the lines of a comment."""
    parts = [f"# {line}".rstrip() + "\n" for line in lines]
    for name, program in programs:
        parts += [f"# {name}\n" if name else "", ir.text(program)]
    return "".join(parts)
