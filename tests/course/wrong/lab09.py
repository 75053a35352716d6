"""Wrong answers to lab 9: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    "for operand in operands)": [("for operand in operands[::-1])", "operands exchanged", "exchanged|order")],
    "return node.op, node.args, type(node.value), repr(node.value)": [
        ("return node.op, node.args, node.value", "constants by ==", "type and repr"),
        ("return node.op, tuple(sorted(node.args)), type(node.value), repr(node.value)",
         "operands without order", "operands have an order|order of the operands"),
        ("return node.args, type(node.value), repr(node.value)", "the operation does not count",
         "belongs to what is compared"),
    ],
    "        if key(known) == key(node):\n            return index\n": [
        ("        pass\n", "no value numbering", "look an operation up"),
    ],
    "if key(known) == key(node):": [
        ("if node.op != 'const' and key(known) == key(node):", "constants are not shared",
         "look a constant up"),
    ],
    'Node("const", (), value))': [
        ('Node("const", (), float(value)))', "constants become floats",
         "kept as they are given|type and repr|another kind"),
        ('Node("const", (), np.float64(value)))', "constants become float64", "float64|kept"),
    ],
    '    def __bool__(self):\n        raise TypeError("a traced value is not a boolean: use np.where")\n': [
        ("", "no __bool__", "takes one branch"),
    ],
    'if method != "__call__" or options or ufunc not in NAMES:': [
        ("if options or ufunc not in NAMES:", "methods pass", "method is not"),
        ('if method != "__call__" or ufunc not in NAMES:', "options pass", "with options"),
    ],
    "if function is not np.where or len(args) != 3 or options:": [
        ("if len(args) != 3:", "any function of three arguments", "any function but np.where"),
        ("if False:", "any function is a selection", "any function but np.where"),
    ],
    'Node("select", indices)': [
        ('Node("where", indices)', "another name", "called `select`"),
        ('Node("select", (indices[0], indices[2], indices[1]))', "branches exchanged",
         "where true, where false"),
    ],
    "output = index_of(nodes, result)": [
        ("output = result.index", "no constant output", "gone or renamed|constant then"),
    ],
    "return Program(tuple(nodes), output)": [
        ("return Program(tuple(nodes), len(nodes) - 1)", "the last node is the output", "not the last node"),
        ("return Program(tuple(nodes), result)", "a traced output", "not a traced value"),
    ],
    "return values[program.output]": [("return values[-1]", "the last value", "the output's value")],
    "values.append(given[node.value])": [
        ("values.append(np.asarray(given[node.value], np.float64))", "inputs become float64", "float64"),
    ],
    '    nodes = [Node("input", (), name) for name in names]': [
        ('    nodes = SHARED\n    nodes.extend(Node("input", (), name) for name in names)',
         "one list for all", "misspelt|not one of the module"),
    ],
    'if i in needed or node.op == "input"]': [
        ("if i in needed]", "inputs go", "inputs stay"),
        ("]", "nothing goes", "what is not reached goes"),
    ],
    "todo.extend(program.nodes[index].args)": [
        ("todo.extend(program.nodes[index].args[:1])", "only first operands",
         "operands of operands|renumbered|dictionary"),
    ],
    "nodes = [node._replace(args=tuple(place[arg] for arg in node.args)) for node in nodes]": [
        ("pass", "no new operands", "renumbered"),
    ],
    "place[program.output])": [("program.output)", "the old output", "renumbered")],
    "parts.append(repr(node.value))": [
        ("parts.append(str(int(node.value)))", "another text of constants", "repr"),
        ("parts.append(str(node.value))", "str for repr", "not str"),
    ],
    '{program.output}\\n"': [('{program.output}"', "no last line's end", "the last one too")],
    'f"output %{program.output}\\n"': [('""', "no output line", "%INDEX")],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
