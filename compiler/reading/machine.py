"""A machine that runs the text of a kernel on the numbers of field.py, in all lanes at once.

Integers are Python's within 32 bits, or `Place`s where lanes differ [lanes.py]; only int32 holds a
coordinate. Loops run as often as they say. Reading what was not written, reading or writing beyond an array
or an image, and branching on a number of the image are rejected; so is what the machine does not know.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from . import together, words
from .builtins import bits, choose
from .field import (
    FOLDED,
    Number,
    Span,
    blended,
    choice,
    difference,
    expression,
    literal,
    part_of,
    product,
    stacked,
    total,
    wide,
)
from .groups import Group
from .kinds import Kinds
from .lanes import Lanes, Mask, Place, Raw, Unread, Wrong, plus, times
from .memory import Every, Memory, Pointer
from .syntax import Tree
from .tokens import Text, Type, Variable

COMPARES: dict[str, Callable[[Any], Any]] = {
    "<": lambda d: d < 0, ">": lambda d: d > 0, "<=": lambda d: d <= 0,
    ">=": lambda d: d >= 0, "==": lambda d: d == 0, "!=": lambda d: d != 0,
}  # fmt: skip
"""Comparisons by the sign of a difference."""

MOST_TURNS = 2**16
"""Most turns of a loop: no kernel comes near, and one that does not end is refused."""

MOST_CALLS = 8
"""Most functions that call each other: no kernel comes near, and no function calls itself."""

BITS = {
    "&": "bitwise_and", "|": "bitwise_or", "^": "bitwise_xor", ">>": "right_shift", "<<": "left_shift",
}  # fmt: skip
"""Operators of bits, as a program calls them."""

MOST_NUMBERS = 2**20
"""Most numbers of all arrays: no kernel comes near, and more would not fit the stack of a thread."""

MASK = ""
"""Where a frame keeps the lanes that declare its variables, which no other lane sees: no name is empty."""


class Machine(Kinds):
    """Runs one text: `call(name, arguments)`; `outside` are the names that the text does not declare."""

    def __init__(
        self,
        text: Text,
        lanes: Lanes,
        outside: dict[str, Any],
        builtins: dict[str, Callable[..., Any]],
        added: Callable[[Number], Number],
        group: Group | None = None,
        span_of: Callable[[Number, Mask], Span | None] | None = None,
    ) -> None:
        self.text, self.lanes, self.builtins, self.added = text, lanes, builtins, added
        self.group, self.span_of, self.aligned, self.mixes = group, span_of, False, 2
        names = [(name.split("_", 2), name) for name in dir(self) if name.startswith(("_run_", "_value_"))]
        self.statements, self.forms = (
            {form: getattr(self, name) for (_, group, form), name in names if group == kind}
            for kind in ("run", "value")
        )
        self.operators = {name[8:] for name in text.functions if name.startswith("operator")}
        self.constants: dict[str, Any] = {}
        self.loops: dict[int, together.Loop | None] = {}
        self.mask = None
        self.entered: Mask | None = None
        self.base, self.turns, self.numbers = 0, 1, dict[int, int]()
        self.frames: list[dict[str, Any]] = [dict(outside)]
        for variable, value in text.outside:
            if variable.name not in self.frames[0]:
                self._declare(variable, value)
        self.returned: list[Any] = []

    # ---- names ---------------------------------------------------------------------------------------------

    def _find(self, name: str) -> dict[str, Any]:
        for k in range(len(self.frames) - 1, self.base - 1, -1):
            if name in self.frames[k]:
                return self.frames[k]
        if name not in self.frames[0]:
            raise Wrong(f"{name} is not declared")
        return self.frames[0]

    def _declare(self, variable: Variable, value: Tree | None) -> None:
        type_, given = variable.type, None if value is None else self.value(value, variable.type)
        count = len(given) if isinstance(given, list) else wide(given)
        if not variable.sizes and type_.kind != "auto" and count not in (1, type_.width):
            raise Wrong(f"{variable.name} is given {count} numbers for {type_.width}")
        if variable.sizes:
            sizes = tuple(self.value(size) for size in variable.sizes)
            if not all(type(size) is int and 0 < size <= MOST_NUMBERS for size in sizes):
                raise Wrong(f"{variable.name} is an array of {sizes}")
            memory = self._memory(variable, int(np.prod(sizes)) * type_.width)
            if given is not None:
                raise Unread("an array with a value")
            given = Pointer(memory, 0, type_.width, sizes, type_)
        elif type_.width > 1 and not type_.pointer and not (isinstance(given, list) and not numbers(given)):
            memory = Memory(variable.name, type_.width, self.mask, type_.kind)
            if given is not None:
                memory.store(0, type_.width, stacked(given) if numbers(given) else given, self)
            given = Pointer(memory, 0, type_.width, (), type_)
        self.frames[-1][variable.name] = given
        self.frames[-1][f"type of {variable.name}"] = type_

    def _memory(self, variable: Variable, size: int) -> Any:
        """Return an array of a text: each lane's, or its group's."""
        self.numbers[id(variable)] = size
        if sum(self.numbers.values()) > MOST_NUMBERS:
            raise Wrong(f"{variable.name} is an array of {size} numbers: at most {MOST_NUMBERS} in all")
        if not variable.shared:
            return Memory(variable.name, size, self.mask, variable.type.kind)
        if self.group is None:
            raise Unread("memory that a group shares, without groups")
        return self.group.share(variable.name, size, variable.type.kind)

    def written(self, value: Any, name: str) -> Any:
        """Return a value that every running lane has written."""
        if value is None or (
            isinstance(value, Number) and value.held is not None and (~value.held & self.running).any()
        ):
            raise Wrong(f"{name} is read before it is written")
        return value

    @property
    def running(self) -> Mask:
        """The lanes (lanes,) in which a statement has an effect now."""
        return self.lanes.running

    @property
    def mask(self) -> Mask | None:
        """The lanes of a branch; None for all."""
        return self.lanes.mask

    @mask.setter
    def mask(self, lanes: Mask | None) -> None:
        self.lanes.mask = lanes

    # ---- statements ----------------------------------------------------------------------------------------

    def call(self, name: str, given: list[Any]) -> Any:
        """Run a function of the text, and return its value."""
        function = self.text.functions[name]
        frame: dict[str, Any] = {MASK: self.mask}
        for v, value in zip(function.takes, given, strict=True):
            frame |= {v.name: value, f"type of {v.name}": v.type}
        if len(self.returned) > MOST_CALLS:
            raise Wrong(f"{name}() calls itself")
        outer = self.base, self.entered, self.lanes.active
        self.base, self.entered = len(self.frames), self.mask
        self.frames.append(frame)
        self.returned.append(None)
        self.run(function.body)
        del self.frames[self.base :]
        self.base, self.entered, self.lanes.active = outer
        value, type_ = self.returned.pop(), function.type
        many = len(value) if isinstance(value, list) else wide(value)
        if many not in (1, type_.width):
            raise Wrong(f"{name}() returns {many} numbers, not {type_.width}")
        return self.converted(value, type_)

    def run(self, tree: Tree) -> bool:
        """Run a statement; return whether it ended the function."""
        return bool(self.statements[tree[0]](*tree[1:]))

    def _run_block(self, statements: list[Tree]) -> bool:
        self.frames.append({MASK: self.mask})
        ended = False
        for statement in statements:
            if self.run(statement):
                ended = True
                break
        self.frames.pop()
        return ended

    def _run_declare(self, variable: Variable, value: Tree | None) -> None:
        self._declare(variable, value)

    def _run_declarations(self, pairs: list[Tree]) -> None:
        for pair in pairs:
            self.run(pair)

    def _run_union(self, name: str, members: list[Variable]) -> None:
        sizes = {v.name: int(self.value(v.sizes[0])) for v in members}
        alike = {(v.type.kind, sizes[v.name] * v.type.width, len(v.sizes)) for v in members}
        if len(alike) != 1:
            raise Unread(f"{name}, a union of other numbers, or of arrays of other sizes")
        ((kind, size, _),) = alike
        memory = Memory(name, size, self.mask, kind)
        self.frames[-1][name] = {
            v.name: Pointer(memory, 0, v.type.width, (sizes[v.name],), v.type) for v in members
        }

    def _run_do(self, tree: Tree) -> None:
        self.forms[tree[0]](*tree[1:])

    def _run_return(self, value: Tree | None) -> bool:
        if value is not None:
            if self.returned[-1] is not None or self.mask is not self.entered:
                raise Wrong("a function returns a value in some lanes only")
            self.returned[-1] = self.value(value)
        if self.mask is self.entered:
            return True
        if len(self.returned) > 1:
            raise Unread("a function that some lanes leave before others")
        assert self.mask is not None
        self.lanes.active = self.lanes.active & ~self.mask
        return False

    def _run_if(self, condition: Tree, then: Tree, otherwise: Tree) -> bool:
        found = self._truth(self.value(condition))
        if isinstance(found, bool):
            return self.run(then if found else otherwise)
        outer = self.mask
        ended = []
        for part, branch in ((found, then), (~found, otherwise)):
            self.mask = part if outer is None else outer & part
            ended.append(bool((self.mask & self.lanes.active).any()) and self.run(branch))
        self.mask = outer
        return False

    def _run_for(self, start: Tree, condition: Tree, step: Tree, body: Tree) -> bool:
        if FOLDED:
            if id(body) not in self.loops:
                self.loops[id(body)] = together.read_loop(start, condition, step, body)
            loop = self.loops[id(body)]
            if loop and (turns := loop.apart(self)):
                self._run_turns(loop, turns)
                return False
        self.frames.append({MASK: self.mask})
        self.run(start)
        outer, ended, turns = self.mask, False, 0
        while not ended:
            turns += 1
            if turns > MOST_TURNS:
                raise Wrong(f"a loop runs more than {MOST_TURNS} times")
            found = self._truth(self.value(condition))
            if isinstance(found, bool):
                if not found:
                    break
            else:
                self.mask = found if self.mask is None else self.mask & found
                if not self.running.any():
                    break
            ended = self.run(body)
            mask = self.mask
            if start[0] == "declare" and step[2] == ("name", start[1].name):
                self.mask = None  # no lane that has left the loop sees its variable: it may stay one integer
            self.value(step)
            self.mask = mask
        self.mask = outer
        self.frames.pop()
        return ended

    def _run_turns(self, loop: together.Loop, turns: int) -> None:
        """Run all turns of a loop at once."""
        self.frames.append({MASK: self.mask, loop.variable: Every(turns)})
        self.turns = turns
        for statement in loop.statements:
            if statement[0] == "declare":
                self.frames[-1][statement[1].name] = self.value(statement[2], statement[1].type)
            else:
                self.run(statement)
        self.frames.pop()
        self.turns = 1

    def _truth(self, value: Any) -> Any:
        if isinstance(value, (bool, np.ndarray)):
            return value
        raise Wrong("it branches on a number of the image, or on an integer")

    # ---- expressions ---------------------------------------------------------------------------------------

    def value(self, tree: Tree, type_: Type | None = None) -> Any:
        """Return the value of an expression, as a type if one is given."""
        found = self.forms[tree[0]](*tree[1:])
        if type(found) is Pointer and found.sizes == ():
            found = found.load(self)
        if found is None:
            raise Unread("a value of type void")
        return found if type_ is None else self.converted(found, type_)

    def _value_number(self, text: str) -> Any:
        if text not in self.constants:
            self.constants[text] = self._constant(text)
        return self.constants[text]

    def _value_name(self, name: str) -> Any:
        if name in ("true", "false"):
            return name == "true"
        value = self._find(name)[name]
        return value if type(value) is int else self.written(value, name)

    def _value_list(self, values: list[Tree]) -> Any:
        return [self.value(value) for value in values]

    def _value_call(self, callee: Tree, arguments: list[Tree]) -> Any:
        if callee[0] != "name":
            raise Unread("a call of what has no name")
        name = callee[1]
        if name in self.text.functions:
            takes = self.text.functions[name].takes
            given = [self._argument(tree, v.type) for tree, v in zip(arguments, takes, strict=True)]
            return self.call(name, given)
        if name not in self.builtins:
            raise Unread(f"function {name}()")
        return self.builtins[name](self, *(self.value(tree) for tree in arguments))

    def _argument(self, tree: Tree, type_: Type) -> Any:
        if not type_.reference:
            return self.value(tree, type_)
        found = self.forms[tree[0]](*tree[1:])
        if not isinstance(found, Pointer):
            raise Unread("a reference to what has no address")
        return found.declared(type_)

    def _value_at(self, array: Tree, index: Tree) -> Any:
        at, found = self.value(index), self.forms[array[0]](*array[1:])
        if isinstance(found, Pointer) and found.sizes:
            return found.at(at)
        return self._component(found, at)

    def _component(self, found: Any, at: Any) -> Any:
        """Return one number of a vector."""
        if hasattr(found, "component"):
            return found.component(at, self)
        count = (
            found.width
            if isinstance(found, Pointer)
            else len(found)
            if isinstance(found, (list, tuple))
            else wide(found)
        )
        if type(at) is not int or not 0 <= at < count or (count == 1 and not isinstance(found, tuple)):
            raise Wrong(f"component {at} of {count}")
        if isinstance(found, Pointer):
            return Pointer(found.memory, plus(found.offset, at), 1, (), found.of)
        return found[at] if isinstance(found, (list, tuple)) else part_of(found, at)

    def _value_of(self, whole: Tree, member: str) -> Any:
        found = self.forms[whole[0]](*whole[1:])
        if isinstance(found, dict):
            return found[member]
        at = words.component(member)
        own = any(member == v.name for members in self.text.structs.values() for v in members)
        if isinstance(found, Pointer) and found.sizes in ((), (None,)) and at is None and own:
            vector = member in self.text.vectors
            width, sizes = (found.width, ()) if vector else (1, (found.width,))
            return Pointer(found.memory, found.offset, width, sizes, found.of)
        if isinstance(found, Pointer):
            found = found.load(self)
        if at is None:
            raise Unread(f"member {member}")
        return self._component(found, at)

    def _value_unary(self, op: str, tree: Tree) -> Any:
        if op == "&":
            frame = self._find(tree[1]) if tree[0] == "name" else {}
            if frame and not isinstance(frame[tree[1]], Pointer):
                return words.Slot(frame, tree[1], frame[f"type of {tree[1]}"])
            found = self.forms[tree[0]](*tree[1:])
            if not isinstance(found, Pointer):
                raise Wrong("it takes the address of what has none")
            return Pointer(found.memory, found.offset, found.width, of=found.of)
        found = self.value(tree)
        if op == "*":
            return found.at(0)
        if op == "-":
            if isinstance(found, Number):
                known = found.literal is not None
                return literal(-found.literal, found.kind) if known else expression("negative", found)  # type: ignore[operator]
            return self.whole(times(found, -1))
        if op == "!":
            found = self._truth(found)
            return not found if isinstance(found, bool) else ~found
        raise Unread(f"operator {op}")

    def _value_sizeof(self, tree: Tree) -> int:
        found = self.forms[tree[0]](*tree[1:])
        return int(np.prod(found.sizes) * found.width * words.size_of(found.memory.kind))

    def _value_binary(self, op: str, left: Tree, right: Tree) -> Any:
        a = self.value(left)
        if op == "&&" or op == "||":
            a = self._truth(a)
            if isinstance(a, bool) and a == (op == "||"):
                return a
            b = self._truth(self.value(right))
            if isinstance(a, bool):
                return b
            return a & b if op == "&&" else a | b
        return self.operate(op, a, self.value(right))

    def operate(self, op: str, a: Any, b: Any) -> Any:
        """Return what an operator makes of two values."""
        if type(a) is int and type(b) is int:
            return self.whole(self._operate_integers(op, a, b))
        if type(a) is Number and type(b) is Number and not self.operators:
            return self._operate_numbers(op, a, b)
        if op in self.operators and wide(a) > 1:
            return self._call_operator(op, a, b)
        if self.operators and max(wide(n) for n in (a, b)) > 1:
            raise Unread(f"operator {op} of vectors that have none")
        if isinstance(a, list) or isinstance(b, list):
            a, b = (stacked(one) if numbers(one) else one for one in (a, b))
        if isinstance(a, Number) or isinstance(b, Number):
            return self._operate_numbers(op, a, b)
        if isinstance(a, Pointer):
            if len(a.sizes) != 1 or op not in "+-" or not isinstance(b, (int, Place)):
                raise Unread(f"operator {op} of an address")
            return a.moved(times(b, -1) if op == "-" else b, self)
        if isinstance(a, Raw) and isinstance(b, Raw) and op in "+*" and a.counts:
            return Raw(self.whole(plus(a.place, b.place) if op == "+" else times(a.place, b.place)))
        if not all(isinstance(one, (int, Place)) and not isinstance(one, bool) for one in (a, b)):
            raise Unread(f"operator {op} of other values than integers and numbers")
        return self.whole(self._operate_integers(op, a, b))

    def _operate_integers(self, op: str, a: Any, b: Any) -> Any:
        if op in COMPARES:
            if isinstance(a, Place):
                return COMPARES[op](a.against(b))
            if isinstance(b, Place):
                return COMPARES[op](-b.against(a))
            return COMPARES[op](a - b)
        if op in "+-":
            return plus(a, b, 1 if op == "+" else -1)
        if op == "*":
            return times(a, b)
        if op not in "/%" or not isinstance(b, int):
            raise Unread(f"operator {op} of coordinates")
        if b <= 0 or (isinstance(a, int) and a < 0):
            raise Wrong("it divides a negative integer, or by one")
        if isinstance(a, int):
            return a // b if op == "/" else a % b
        if a.form.any():
            raise Unread(f"operator {op} of coordinates")
        if (a.values < 0)[self.running].any():
            raise Wrong("it divides a negative integer, or by one")
        return self.lanes.constant(a.values // b if op == "/" else a.values % b)

    def _call_operator(self, op: str, a: Any, b: Any) -> Any:
        """Return what a text's own operator makes of two values."""
        takes = [v.type.width for v in self.text.functions[f"operator{op}"].takes]
        widths = [v.width if isinstance(v, Pointer) else wide(v) for v in (a, b)]
        if takes != widths:
            raise Wrong(f"its operator {op} is of other vectors")
        return self.call(f"operator{op}", [a, b])

    def _operate_numbers(self, op: str, a: Any, b: Any) -> Number:
        shift = op in ("<<", ">>")
        a, b = self.both(a, b) if shift else self.alike(a, b)
        if shift and (b.literal is None or not 0 <= b.literal < 32):
            raise Unread("a shift by anything but a constant below 32")
        if op in BITS and a.kind not in words.LIMITS:
            raise Unread(f"operator {op} of numbers of {a.kind}")
        if (whole := words.operate(op, a, b)) is not None:
            return whole
        if op == "+":
            return self.added(total(a, b))
        if op == "-":
            return difference(a, b)
        if op == "*":
            return product(a, b)
        if op in ("<", ">", "<=", ">="):
            a, b = (a, b) if op[0] == "<" else (b, a)
            found = expression("less_equal" if "=" in op else "less", a, b, kind="bool")
            # Of equal numbers a <= b ? a : b takes the other one, which may be the other zero.
            compared = None if "=" in op else (a, b)
            return Number(found.value, found.shape, "bool", compared=compared)
        if op in BITS:
            return bits(BITS[op], a, b)
        raise Unread(f"operator {op} of numbers")

    def _value_choice(self, condition: Tree, then: Tree, otherwise: Tree) -> Any:
        found = self.value(condition)
        if not isinstance(found, Number):
            found = self._truth(found)
        if isinstance(found, bool):
            return self.value(then if found else otherwise)
        a, b = self.value(then), self.value(otherwise)
        if isinstance(a, Number) or isinstance(b, Number):
            a, b = self.alike(a, b)
        return choice(found, a, b) if isinstance(found, Number) else choose(self, found, a, b)

    def _value_assign(self, op: str, target: Tree, value: Tree) -> Any:
        place = self.forms[target[0]](*target[1:]) if target[0] != "name" else None
        new = self.value(value)
        if numbers(new):
            new = new[0] if len(new) == 1 else stacked(new)
        if target[0] == "name":
            frame = self._find(target[1])
            place = frame[target[1]]
            if not isinstance(place, Pointer) or place.sizes:
                return self._assign(frame, target[1], op, new)
        if not isinstance(place, Pointer) or place.sizes:
            raise Wrong("it assigns to what cannot be written")
        if f"{op}=" in self.operators and place.width > 1:
            return self._call_operator(f"{op}=", place, new)
        if op:
            new = self.operate(op, place.load(self), new)
        kind = getattr(place.memory, "kind", "") or "float32"
        new = self.converted(new, Type(kind, place.width))
        new = literal(new, kind) if type(new) is int else new
        place.store(new, self)
        return new

    def _assign(self, frame: dict[str, Any], name: str, op: str, new: Any) -> Any:
        """Write a variable that has no memory."""
        held = frame[name]
        if op:
            new = self.operate(op, self.written(held, name), new)
        type_ = frame[f"type of {name}"]
        if type_.kind == "auto":
            type_ = Type(held.kind if isinstance(held, Number) else "int32")
        if type_.pointer and op not in ("+", "-"):
            raise Unread("an address that is assigned")
        new = self.converted(new, type_)
        if self.mask is not None and self.mask is not frame.get(MASK):
            new = (
                blended(new, held, self.mask)
                if isinstance(new, Number)
                else choose(self, self.mask, new, held)
            )
        frame[name] = new
        return new

    def _value_step(self, op: str, target: Tree) -> Any:
        return self._value_assign(op[0], target, ("number", "1"))

    def _value_cast(self, type_: Type, tree: Tree) -> Any:
        found = self.value(tree)
        if type_.kind == "void":
            return None
        if self.mixes < 2:
            raise Unread("a cast of C")
        if type_.pointer:
            kind = getattr(found.memory, "kind", "")
            if found.of.space != type_.space:
                raise Unread(
                    f"an address of {found.of.space or 'no'} space as one of {type_.space or 'none'}"
                )
            if not self.aligned and kind not in ("", type_.kind):
                raise Unread(f"{kind} seen as {type_.kind}, which C leaves undefined")
            return words.pointed(found, type_, self.aligned)
        if isinstance(found, list):
            if found != [0] and len(found) != type_.width:
                raise Wrong(f"{len(found)} numbers for {type_.width}")
            found = self.converted(found, type_, stated=True)
            return found[0] if len(found) == 1 else stacked(found)
        if wide(found) not in (1, type_.width * self.turns):
            raise Wrong(f"{wide(found)} numbers for {type_.width}")
        return self.converted(found, type_, stated=True)


def numbers(value: Any) -> bool:
    """Return whether a value is a list of numbers, which make a vector; one of integers does not."""
    return isinstance(value, list) and bool(value) and all(isinstance(one, Number) for one in value)
