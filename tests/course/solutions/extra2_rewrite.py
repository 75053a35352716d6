"""A right answer to this lab, for the tests of its grader."""

from wamnet.compiler.core.ir import Node
from wamnet.compiler.core.passes.rewrite import rewrite


def subtract(program):
    def rule(builder, node, args):
        if node.op != "add":
            return None
        for kept, other in (args, args[::-1]):
            if builder.nodes[other].op == "negative":
                return builder.add(Node("subtract", (kept, builder.nodes[other].args[0]), node.type))
        return None

    return rewrite(program, rule)
