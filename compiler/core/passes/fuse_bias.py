"""Let an affine node add its bias itself: add(affine(x), b) becomes affine(x) with bias b."""

from __future__ import annotations

from dataclasses import replace

from ..ir import Builder, Node, Program, attributes, users
from .rewrite import rewrite


def fuse_bias(program: Program) -> Program:
    """Return the program with every vector parameter that is added to one affine node moved into it."""
    readers = users(program)

    def rule(builder: Builder, node: Node, args: tuple[int, ...]) -> int | None:
        if node.op != "add":
            return None
        for product, vector, old in ((args[0], args[1], node.args[0]), (args[1], args[0], node.args[1])):
            affine, bias = builder.nodes[product], builder.nodes[vector]
            fits = affine.op == "affine" and affine.get("bias") is None and bias.op == "parameter"
            # A product that is read elsewhere too would be computed twice: leave it.
            if fits and len(readers[old]) == 1:
                named = attributes(**dict(affine.attributes), bias=bias["name"])
                return builder.add(replace(affine, attributes=named))
        return None

    return rewrite(program, rule)
