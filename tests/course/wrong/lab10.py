"""Wrong answers to lab 10: by the old text the new one, the mistake, and words of the explanation."""

WRONG = {
    'name("y"), name("x")))': [
        ('name("x"), name("y")))', "row and column exchanged", "row, column, channel"),
    ],
    'f"image_{node.value}", row': [('"image_a", row', "one image for all inputs", "image of its own")],
    "row, column, 0)\n": [("row, 0, column)\n", "another order of indices", "row, column, channel")],
    "const(float(node.value))": [("const(-float(node.value))", "another sign", "const\\(float")],
    "for arg in node.args]": [("for arg in node.args[::-1]]", "operands exchanged", "order of the operands")],
    'BOOL if node.op in ("less", "greater") else FLOAT)': [("FLOAT)", "booleans as floats", "BOOL")],
    'name(f"v{program.output}", FLOAT)': [
        ('name(f"v{len(program.nodes) - 1}", FLOAT)', "the last node", "program.output"),
    ],
    '        yield Let(f"v{index}", value)': [
        ('        yield Let("v0", value)', "one name for all", "each node has a name"),
    ],
    '    yield Store("result", (row': [
        ('    yield Store("result", (column', "stored elsewhere", "row, column, channel"),
    ],
    'column = name("x") + name("p")': [('column = name("x")', "one pixel for all turns", "column x \\+ p")],
    ', until=column < name("width")': [("", "no end at the border", "until")],
    "until=column < name": [("until=column <= name", "an end too late", "until")],
    'until=column < name("width")': [('until=column + 1 < name("width")', "an end too early", "stored once")],
    'name("PIXELS"), body': [("const(3), body", "a number for PIXELS", "PIXELS")],
    'f"{float(value):.9g}"': [
        ('f"{float(value):f}"', "six places", "nine digits"),
        ('f"{float(value):.6g}"', "six digits", "nine digits"),
        ('f"{float(value):.8g}"', "eight digits", "nine digits"),
    ],
    ' else ".0f"': [(' else "f"', "integers", "point")],
    'digits += "f" if': [('digits += "" if', "doubles", "2.0 is a double")],
    'return f"({digits})" if digits.startswith("-") else digits': [
        ('return digits.lstrip("-")', "no sign", "sign is lost"),
    ],
    '"absolute": "fabsf({0})"': [('"absolute": "abs({0})"', "abs in C", "fabsf in C")],
    '    "absolute": "fabs({0})"': [('    "absolute": "fabsf({0})"', "fabsf in OpenCL", "fabs in OpenCL")],
    '"absolute": "abs({0})"': [('"absolute": "fabs({0})"', "fabs in WGSL", "abs in WGSL")],
    '"minimum": "fmin({0}, {1})"': [('"minimum": "fmax({0}, {1})"', "maximum for minimum", "fmin in OpenCL")],
    '"minimum": "{1} < {0} ? {1} : {0}"': [('"minimum": "{1} < {0} ? {0} : {1}"', "branches of C", "in C")],
    '"select": "select({2}, {1}, {0})"': [
        ('"select": "select({0}, {1}, {2})"', "C's order in WGSL", "in WGSL"),
    ],
    '"less": "{0} < {1}"': [('"less": "{1} < {0}"', "exchanged", "where true|less is <")],
    '"subtract": "{0} - {1}"': [
        ('"subtract": "{1} - {0}"', "operands of a difference", "order of the operands"),
    ],
    '(f"({text(arg, words)})" if arg.args else text(arg, words) for arg in value.args)': [
        ("(text(arg, words) for arg in value.args)", "no parentheses", "parentheses"),
    ],
    "{condition}; {name}++) {{": [("{condition}; ++{name}) {{", "C's step in WGSL", "p\\+\\+")],
    "{text(statement.count, words)} && {text(statement.until, words)}": [
        ("{text(statement.count, words)}", "no end at the border in the source", "count and until"),
    ],
    '"{type} {name} = {value};"': [('"{type} {name} = {value}"', "no semicolon", "semicolon")],
    'return f"{array}[({row} * width': [
        ('return f"{array}[({row} * height', "rows of another length", "row, width"),
    ],
    '"float": "f32"': [('"float": "float"', "C's types in WGSL", "other names")],
}  # fmt: skip
"""New text, the mistake in words, and a pattern of the explanation, by the old text."""
