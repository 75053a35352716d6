"""How statements are run and expressions evaluated, whatever values are: names, blocks, functions.

The interpreter's values are NumPy's [run.py], those of the source check terms [reading/values.py].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from . import kernel as tree


class Walker:
    """One run: what names stand for; a subclass has a `_run_` or `_value_` method for all else."""

    functions: dict[str, tree.Function]
    constants: dict[str, int]
    names: dict[str, Any]
    memory: dict[str, Any]
    evaluators: dict[str, Callable[[tree.Expr], Any]]

    # ---- statements --------------------------------------------------------------------------------------

    def body(self, body: tree.Body) -> None:
        """Run statements."""
        for statement in body:
            self.statement(statement)

    def statement(self, statement: tree.Statement) -> None:
        """Run a statement."""
        getattr(self, f"_run_{type(statement).__name__.lower()}")(statement)

    def _run_comment(self, statement: tree.Statement) -> None:
        """Skip a comment."""

    def _run_let(self, statement: tree.Let) -> None:
        """Name a value."""
        self.names[statement.name] = self.value(statement.value)

    def _run_block(self, statement: tree.Block) -> None:
        """Run statements whose names end with them."""
        self.body(statement.body)

    def _inside(self, function: tree.Function, names: dict[str, Any], memory: dict[str, Any]) -> Any:
        """Run a function, and return its result."""
        outer = self.names, self.memory
        self.names, self.memory = {**self.constants, **names}, memory
        self.body(function.body)
        result = None if function.result is None else self.value(function.result)
        self.names, self.memory = outer
        return result

    # ---- values ------------------------------------------------------------------------------------------

    def value(self, value: tree.Expr) -> Any:
        """Return the values of an expression."""
        evaluate = self.evaluators.get(value.op)
        if evaluate is not None:
            return evaluate(value)
        return self._operation(value, [self.value(each) for each in value.args])

    def _operation(self, value: tree.Expr, args: list[Any]) -> Any:
        """Return an operation on values."""
        raise NotImplementedError

    def _value_name(self, value: tree.Expr) -> Any:
        """Return a named value, or that of a variable."""
        if value.value in self.names:
            return self.names[value.value]
        return self.value(tree.Expr("load", (), value.type, value.value))

    def _value_splat(self, value: tree.Expr) -> Any:
        """Return a value in all lanes: it is the same array, which NumPy repeats."""
        return self.value(value.args[0])

    def _value_call(self, value: tree.Expr) -> Any:
        """Return the result of a function of values."""
        function = self.functions[value.value]
        names = {key: self.value(each) for (key, _), each in zip(function.takes, value.args, strict=True)}
        return self._inside(function, names, {})
