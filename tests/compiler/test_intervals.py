"""The images of operations hold what the operations compute, and no more where they are monotone."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from wamnet.compiler.core import intervals
from wamnet.compiler.core.ir import Node, Type, attributes
from wamnet.compiler.core.ops import OPS, TypeRuleError, image

WITH_IMAGE = sorted(name for name, op in OPS.items() if op.image)
LOGIC = ("logical_and", "logical_or", "logical_not")
SLACK = 2.0**-40
"""Relative to an end: NumPy's powers and quotients are right to a few 2**-52."""

numbers = st.one_of(st.floats(-50.0, 50.0), st.sampled_from([0.0, 1.0, -1.0, 0.5])).map(lambda x: x + 0.0)
booleans = st.booleans()


def node(name, *args):
    return Node(name, args, Type(), attributes())


def operands(data, name):
    """Return ends and a member of each operand."""
    found = []
    for number in range(OPS[name].arity):
        kind = booleans if name in LOGIC or (name == "select" and not number) else numbers
        ends = sorted((data.draw(kind), data.draw(kind)))
        inside = kind.filter(lambda x, e=ends: e[0] <= x <= e[1]) if kind is booleans else st.floats(*ends)
        found.append((tuple(map(np.asarray, ends)), data.draw(inside)))
    return found


@pytest.mark.parametrize("name", WITH_IMAGE)
@given(data=st.data())
def test_members_give_members(name, data):
    """Of any members of the operands, ends among them; where the whole line comes out, there is a reason."""
    given_ = operands(data, name)
    ends, members = [pair[0] for pair in given_], [np.asarray(pair[1]) for pair in given_]
    assume(name != "sqrt" or ends[0][0] >= 0)
    assume(name != "power" or ends[0][0] > 0)
    with np.errstate(all="ignore"):
        value = OPS[name].definition(*members)
        low, high = image(node(name, *range(len(ends))), ends)
    if name in ("divide", "reciprocal") and ends[-1][0] <= 0 <= ends[-1][1]:
        assert (low, high) == (-np.inf, np.inf)
    elif np.isfinite(low) and np.isfinite(high):
        if low.dtype == bool:
            assert low <= value <= high
        else:
            room = SLACK * max(1.0, abs(low), abs(high))
            assert low - room <= value <= high + room
    else:
        assert name in ("power", "exp", "divide", "reciprocal"), "float64 overflows"


@pytest.mark.parametrize("name", WITH_IMAGE)
@settings(max_examples=settings.default.max_examples // 4)
@given(data=st.data())
def test_points_give_points(name, data):
    """Of single numbers the image is what the operation computes, except for a sine's own rounding."""
    members = [np.asarray(pair[1]) for pair in operands(data, name)]
    assume(name != "sqrt" or members[0] >= 0)
    assume(name != "power" or members[0] > 0)
    assume(name not in ("divide", "reciprocal") or members[-1] != 0)
    with np.errstate(all="ignore"):
        value = OPS[name].definition(*members)
        low, high = image(node(name, *range(len(members))), [(m, m) for m in members])
    if name in ("sin", "cos"):
        assert high - low <= 4 * intervals.RANGE_OUTWARD
        assert low <= value <= high
    else:
        assert low == high == value or not np.isfinite(value)


@given(a=numbers, b=numbers)
def test_a_square_is_not_negative(a, b):
    """Of one operand twice: both factors are the same number."""
    low, high = sorted((a, b))
    ends = (np.asarray(low), np.asarray(high))
    found = image(node("multiply", 3, 3), [ends, ends])
    wanted = 0.0 if low <= 0 <= high else min(low * low, high * high)
    assert found == (wanted, max(low * low, high * high))


def test_what_has_no_image_is_refused():
    with pytest.raises(
        TypeRuleError, match="what bitwise_xor computes is not a matter of its operands' ends"
    ):
        image(node("bitwise_xor", 0, 1), [(0, 1), (0, 1)])
