"""A pass of the compiler: a + (-b) becomes a - b.

A pass is a function from a program to a program that means the same, to the bit. `rewrite` copies a program
node by node; your rule says what replaces a node: the index of a node that it adds, or None for a copy.
Tutorial: page 7. Clauses: IR-1, IR-2, IR-8; an example: `compiler/core/passes/rewrite.py: fuse_bias`.

The operations are called "add", "negative" and "subtract"; `rewrite(program, rule)` is in
`wamnet.compiler.core.passes.rewrite`. A rule gets (builder, node, args): args are the node's operands in the
new program, `builder.nodes[i]` is a node of it, and `builder.add(replace(node, op=..., args=...))`, with
`dataclasses.replace`, adds one and returns its index.

IEEE's a - b is defined as a + (-b), so nothing changes; nor does the order of an addition matter. A
negation that nobody reads any more disappears by itself in a later pass.
"""

from __future__ import annotations

from typing import Any


def subtract(program: Any) -> Any:
    """Return the program with a - b instead of a + (-b) and of (-b) + a."""
    raise NotImplementedError("subtract")
