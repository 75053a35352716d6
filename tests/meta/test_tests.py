"""House rules about tests: they can fail, say how exact they are, and do not depend on speed."""

import ast
import re

CLOCK = re.compile(r"\b(perf_counter|monotonic|process_time|time\.time|seconds\w*|elapsed\w*)\b")
"""What an asserted time is made of."""

CHECK = re.compile(r"\b(assert|raises\(|warns\(|refuse\(|fail\(|check\w*\(|assert_\w+\(|golden\()")
"""What makes a function one that can fail."""

TOLERANCE_BELOW = 0.05
"""A literal float between 0 and this on the bounding side is a tolerance; larger ones are values."""


def comparisons(source):
    """Yield (assert statement, comparison) of all asserts."""
    for node in source.nodes:
        if isinstance(node, ast.Assert):
            for part in ast.walk(node.test):
                if isinstance(part, ast.Compare):
                    yield node, part


def called(node: ast.Call) -> str:
    """Return the last name of what is called."""
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def orders(compare: ast.Compare) -> bool:
    return any(isinstance(op, ast.Lt | ast.LtE | ast.Gt | ast.GtE) for op in compare.ops)


def test_no_asserted_times(house):
    wrong = [
        source.at(node, ast.unparse(compare))
        for source in house.python("tests")
        for node, compare in comparisons(source)
        if orders(compare) and asserts_a_time(compare)
    ]
    house.refuse(wrong, "No test asserts a wall-clock time: measure it with wamnet bench and report it.")


def asserts_a_time(compare: ast.Compare) -> bool:
    """Tell whether a clock's value is compared with something other than 0."""
    sides = [ast.unparse(side) for side in [compare.left, *compare.comparators]]
    return any(CLOCK.search(side) for side in sides) and not any(side in {"0", "0.0"} for side in sides)


def test_literal_tolerances_are_derived(house):
    wrong = []
    for source in house.python("tests"):
        explained = [f for f in source.functions if re.search(r"\d", ast.get_docstring(f) or "")]
        for node, compare in comparisons(source):
            beside = source.lines[node.lineno - 2 : node.end_lineno]
            in_docstring = any(f.lineno <= node.lineno <= (f.end_lineno or 0) for f in explained)
            if has_tolerance(compare) and not in_docstring and not any("#" in line for line in beside):
                wrong.append(source.at(node, ast.unparse(compare)))
    house.refuse(
        wrong, "A literal tolerance has its derivation beside it: compute it, or say in a comment why."
    )


def has_tolerance(compare: ast.Compare) -> bool:
    """Tell whether the bounding side of an ordering has a small literal float."""
    bounds = []
    for op, left, right in zip(
        compare.ops, [compare.left, *compare.comparators], compare.comparators, strict=False
    ):
        bounds += (
            [right]
            if isinstance(op, ast.Lt | ast.LtE)
            else [left]
            if isinstance(op, ast.Gt | ast.GtE)
            else []
        )
    constants = [n.value for bound in bounds for n in ast.walk(bound) if isinstance(n, ast.Constant)]
    return any(isinstance(value, float) and 0.0 < abs(value) < TOLERANCE_BELOW for value in constants)


STATED = {"abs", "rel", "atol", "rtol", "abs_tol", "rel_tol"}
"""Parameters of tolerances."""


def test_tolerances_are_stated_and_comparisons_fail_on_nan(house):
    wrong = []
    for source in house.python("tests"):
        for node in source.nodes:
            if isinstance(node, ast.Call):
                close = called(node) in {"approx", "allclose", "isclose", "assert_allclose"}
                found = close and not {k.arg for k in node.keywords} & STATED
            else:
                negated = isinstance(node, ast.Assert) and isinstance(node.test, ast.UnaryOp)
                found = negated and isinstance(node.test.op, ast.Not)
                found = found and isinstance(node.test.operand, ast.Compare) and orders(node.test.operand)
            wrong += [source.at(node, ast.unparse(node))] if found else []
    house.refuse(
        wrong,
        "Write assert abs(a - b) <= bound with a derived bound, never assert not err > bound: NaN fails.",
    )


def test_errors_of_several_kinds_are_matched(house):
    """Those of one kind too: ruff's PT011, for the names in pyproject.toml."""
    wrong = []
    for source in house.python("tests"):
        calls = [n for n in source.nodes if isinstance(n, ast.Call) and called(n) == "raises" and n.args]
        several = [call for call in calls if isinstance(call.args[0], ast.Tuple)]
        wrong += [source.at(n, ast.unparse(n)) for n in several if "match" not in {k.arg for k in n.keywords}]
    house.refuse(wrong, "A test of an error checks its sentence: pytest.raises(InputError, match=...).")


def test_tests_can_fail(house):
    wrong = []
    for source in house.python("tests"):
        text = {f: "\n".join(source.lines[f.lineno - 1 : f.end_lineno]) for f in source.functions}
        checking = {f.name for f in source.functions if CHECK.search(text[f])}
        for function in source.functions:
            calls = {*re.findall(r"\w+(?=\()", text[function]), function.name}
            if function.name.startswith("test_") and not calls & checking:
                wrong.append(source.at(function, function.name))
    house.refuse(
        wrong, "A test asserts something, itself or through a helper of its file: complete or remove it."
    )
