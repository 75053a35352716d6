"""Wrong answers to the extra on a pass: old text, new text, the mistake, words of the explanation."""

WRONG = {
    "(args, args[::-1])": [
        ("(args,)", "only one side", "first operand too"),
        ("(node.args, node.args[::-1])", "old operands", "args, not node.args|not node.args|operands are"),
    ],
    'if node.op != "add"': [
        ('if node.op not in ("add", "subtract")', "subtractions too", "not subtractions"),
        ('if node.op not in ("add", "multiply")', "products too", "not products"),
    ],
    "(kept, builder.nodes[other].args[0])": [
        ("(builder.nodes[other].args[0], kept)", "operands exchanged", "exchanged"),
    ],
    '            if builder.nodes[other].op == "negative":\n': [
        ("            if builder.nodes[other].args:\n", "any operand",
         "only additions of a negation|operands"),
    ],
    "return rewrite(program, rule)": [("return rule", "no rewriting", "return rewrite")],
    'Node("subtract"': [('Node("add"', "an addition again", "becomes a subtraction")],
    'builder.nodes[other].op == "negative"': [
        ('builder.nodes[kept].op == "negative"', "the other operand", "index beyond"),
    ],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
