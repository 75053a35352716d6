"""House rules about the form of the code: contracts, strings under constants, types, sizes, errors."""

import ast
import re

from wamnet.refimpl.reading import BROKEN

MAX_FILE_LINES = 600
MAX_FUNCTION_LINES = 60
CONSTANT = re.compile(r"_?[A-Z][A-Z0-9_]*")

BUILT_IN_ERRORS = {"Exception", "ValueError", "RuntimeError", "KeyError", "IndexError", "OSError"}
"""What no user should meet; TypeError, AssertionError, NotImplementedError tell a caller's mistake."""


def test_constants_carry_a_string(house):
    wrong = []
    for source in house.installed():
        for node, after in zip(source.tree.body, [*source.tree.body[1:], None], strict=True):
            name = constant_name(node)
            if name and not (isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)):
                wrong.append(source.at(node, name))
    house.refuse(
        wrong, "A constant has a string under it: say its meaning, its unit and why it has this value."
    )


def constant_name(node: ast.stmt) -> str | None:
    """Return the name of a module's constant that a statement defines; a type variable is not a constant."""
    if isinstance(node, ast.Assign) and len(node.targets) == 1:
        target, value = node.targets[0], node.value
    elif isinstance(node, ast.AnnAssign):
        target, value = node.target, node.value
    else:
        return None
    if isinstance(value, ast.Call) and ast.unparse(value.func).endswith(("TypeVar", "ParamSpec")):
        return None
    return target.id if isinstance(target, ast.Name) and CONSTANT.fullmatch(target.id) else None


def test_files_are_short(house):
    wrong = [f"{s.path}: {len(s.lines)} lines" for s in house.python() if len(s.lines) > MAX_FILE_LINES]
    house.refuse(wrong, f"A file has at most {MAX_FILE_LINES} lines: split it by idea.")


def test_functions_are_short(house):
    wrong = []
    for source in house.python():
        for node in source.functions:
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            if lines > MAX_FUNCTION_LINES:
                wrong.append(source.at(node, f"{node.name} has {lines} lines"))
    house.refuse(wrong, f"A function has at most {MAX_FUNCTION_LINES} lines: give its paragraphs names.")


def test_errors_come_from_one_module(house):
    wrong = []
    for source in house.installed():
        nodes = list(source.nodes)
        caught = " ".join(ast.unparse(n.type) for n in nodes if isinstance(n, ast.ExceptHandler) and n.type)
        # Both stand for what refimpl/reading.py lists.
        if "BROKEN" in caught or any(
            ast.unparse(n.func) == "refusing" for n in nodes if isinstance(n, ast.Call)
        ):
            caught += " ".join(error.__name__ for error in BROKEN)
        for node in nodes:
            if isinstance(node, ast.Raise) and node.exc is not None:
                name = ast.unparse(node.exc.func if isinstance(node.exc, ast.Call) else node.exc)
                if name in BUILT_IN_ERRORS and name not in caught:
                    wrong.append(source.at(node, f"raise {name}"))
    house.refuse(
        wrong, "A user meets only errors of refimpl/errors.py: raise one of them, or catch it in its module."
    )
