"""Mesa's software renderer: where it computes something else than a shader says.

It ends loops, without an error, after 65535 iterations of all loops of a shader together
(LP_MAX_TGSI_LOOP_ITERATIONS of gallivm): the kernel of a wide network then lacks some of its products.
Innermost loops of up to 32 iterations are unrolled before, and do not count.
"""

from __future__ import annotations

import re

NAME = "llvmpipe"
"""What the renderer's name holds."""

MOST_ITERATIONS = 60_000
"""Iterations that surely run: 64 499, by [`iterations`], gave right pixels and 65 308 wrong ones."""

UNROLLED = 32
"""Most iterations of a loop that is unrolled."""

CONSTANT = re.compile(r"#define (\w+) (\d+)")
"""A number with a name."""

LOOP = re.compile(r"\s*for \(int \w+ = \w+; \w+ < (\w+); \+\+\w+\) \{")
"""The first line of a loop; its body ends with a bracket on a line."""


def iterations(source: str) -> int:
    """Return how often the loops of a shader that is emitted here test their conditions."""
    constants = dict(CONSTANT.findall(source))
    inside, blocks = 0, list[tuple[int, int]]()
    for line in source.splitlines():
        if line.rstrip().endswith("{"):
            loop = LOOP.match(line)
            limit = str(constants.get(loop[1], loop[1])) if loop else ""
            blocks.append((int(limit) if limit.isdigit() else 0, inside))
            inside = 0
        elif line.strip() == "}" and blocks:
            count, before = blocks.pop()
            counts = inside or count > UNROLLED
            inside = before + inside * max(count, 1) + (count + 1 if count and counts else 0)
    return inside
