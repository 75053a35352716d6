"""A right answer to this lab, for the tests of its grader."""

from wamnet.compiler.kernel.kernel import BOOL, FLOAT, For, Let, Store, apply, const, load, name

OPERATORS = {
    "add": "{0} + {1}",
    "subtract": "{0} - {1}",
    "multiply": "{0} * {1}",
    "divide": "{0} / {1}",
    "negative": "-{0}",
    "less": "{0} < {1}",
    "greater": "{0} > {1}",
    "select": "{0} ? {1} : {2}",
}

C = {
    "let": "{type} {name} = {value};",
    "for": "for (int {name} = 0; {condition}; ++{name}) {{",
    "float": "float",
    "bool": "bool",
    **OPERATORS,
    "absolute": "fabsf({0})",
    "sqrt": "sqrtf({0})",
    "floor": "floorf({0})",
    "sin": "sinf({0})",
    "cos": "cosf({0})",
    "minimum": "{1} < {0} ? {1} : {0}",
    "maximum": "{1} > {0} ? {1} : {0}",
}

OPENCL = {
    **C,
    "absolute": "fabs({0})",
    "minimum": "fmin({0}, {1})",
    "maximum": "fmax({0}, {1})",
    **{op: f"{op}({{0}})" for op in ("sqrt", "floor", "sin", "cos")},
}

LANGUAGES = {
    "c": C,
    "opencl": OPENCL,
    "cuda": {**C, "minimum": "fminf({0}, {1})", "maximum": "fmaxf({0}, {1})"},
    "wgsl": {
        **OPENCL,
        "let": "let {name}: {type} = {value};",
        "for": "for (var {name}: i32 = 0; {condition}; {name}++) {{",
        "float": "f32",
        "absolute": "abs({0})",
        "minimum": "min({0}, {1})",
        "maximum": "max({0}, {1})",
        "select": "select({2}, {1}, {0})",
    },
}


def statements(program, row, column):
    kinds = []
    for index, node in enumerate(program.nodes):
        args = [name(f"v{arg}", kinds[arg]) for arg in node.args]
        if node.op == "input":
            value = load(f"image_{node.value}", row, column, 0)
        elif node.op == "const":
            value = const(float(node.value))
        else:
            value = apply(node.op, *args)
        kinds.append(BOOL if node.op in ("less", "greater") else FLOAT)
        yield Let(f"v{index}", value)
    yield Store("result", (row, column, const(0)), name(f"v{program.output}", FLOAT))


def schedule(program):
    return tuple(statements(program, name("y"), name("x")))


def schedule_rows(program):
    column = name("x") + name("p")
    body = tuple(statements(program, name("y"), column))
    return (For("p", name("PIXELS"), body, until=column < name("width")),)


def literal(value):
    digits = f"{float(value):.9g}"
    digits += "f" if "." in digits or "e" in digits else ".0f"
    return f"({digits})" if digits.startswith("-") else digits


def place(array, index, words):
    row, column, channel = (text(each, words) for each in index)
    return f"{array}[({row} * width + {column}) * 1 + {channel}]"


def text(value, words):
    if value.op == "const":
        return literal(value.value) if value.type == FLOAT else str(value.value)
    if value.op == "name":
        return value.value
    if value.op == "load":
        return place(value.value, value.args, words)
    return words[value.op].format(
        *(f"({text(arg, words)})" if arg.args else text(arg, words) for arg in value.args)
    )


def render(body, language):
    return "\n".join(line for statement in body for line in lines(statement, LANGUAGES[language]))


def lines(statement, words):
    if isinstance(statement, Let):
        kind = words["bool" if statement.value.type == BOOL else "float"]
        return [words["let"].format(type=kind, name=statement.name, value=text(statement.value, words))]
    if isinstance(statement, Store):
        return [f"{place(statement.array, statement.index, words)} = {text(statement.value, words)};"]
    condition = f"{statement.name} < {text(statement.count, words)} && {text(statement.until, words)}"
    head = words["for"].format(name=statement.name, condition=condition)
    return [head, *(line for each in statement.body for line in lines(each, words)), "}"]
