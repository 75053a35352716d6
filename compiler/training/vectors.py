"""OpenCL C on vectors of single-precision numbers, written without the kernel IR: text of operations."""

from __future__ import annotations

from typing import Any

from ..core.ir import Node
from ..kernel.instructions import BUILTINS
from ..languages.c_path import MASKS
from ..languages.opencl import OpenCL


class Vectors(OpenCL):
    """The dialect's table where every value has so many lanes."""

    def __init__(self, lanes: int) -> None:
        kinds = {"float32": "float", "int32": "int", "uint32": "uint", "bool": "int"}
        self.lanes = lanes
        self.types = {kind: f"{name}{lanes}" for kind, name in kinds.items()}
        self.operations = {
            **{name: text for name, text in OpenCL.operations.items() if "." not in name},
            **OpenCL.vector_operations,
        }
        self.helpers = dict.fromkeys(("floor", "convert"), BUILTINS)

    def loop(self, counter: str, count: int | str) -> str:
        """Return the line that opens a loop of a counter from 0 on."""
        return self.for_loop(counter, "0", str(count), "1")

    def expression(self, node: Node, kind: str, operands: list[str]) -> str:
        """Return the text of an operation on operands, the last of which is of the given kind."""
        template = self.operations.get(f"{node.op}.{kind}") or self.operations[node.op]
        return template.format(*operands, type=self.types[node.type.dtype], lanes=self.lanes)

    def constant(self, node: Node) -> str:
        """Return the text of a constant."""
        return self.splatted(node["value"], node.type.dtype)

    def splatted(self, value: Any, dtype: str) -> str:
        """Return the text of a number in all lanes."""
        text = self.number(value, dtype).strip("()")
        return f"({self.types[dtype]})({MASKS.get(text, text)})"
