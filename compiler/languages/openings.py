"""How a kernel on buffers opens: its arrays and integers are declared, an item finds its place, or ends.

Three binding styles share it: arguments of a function [`Arguments`: C, OpenCL, CUDA], arguments with numbers
(Metal), and declarations with numbers (GLSL for Vulkan and OpenGL 4.3, WGSL). Integers that are arguments are
read by their names; those of a structure by `size` and their names.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy

from ..kernel.interface import BLOCK, DENOISE, PATH, READ, RESULT, UNSIGNED, WEIGHTS, Array, Interface
from ..kernel.kernel import Expr, Kernel, Launch, Type
from .dialect import Dialect

OWN = (("y", "x"), ("row", "column"))
"""Texts of an item's own row and column [`Interface.place`]."""


class Buffers(Dialect):
    """Kernels whose arrays are buffers; `item` are the texts of an item's column and row.

    `size`: what is before the name of an integer. `long`: the type of a place in memory, if it is not that
    of other integers. `space`: what is before the type of weights in memory, where pointers have types.
    `declares_above`: a group's memory is declared above the function. `reads`, `writes`, `block`: an argument
    that is an array, by what the kernel does with it, or one in a uniform block.
    """

    item: tuple[str, str]
    reads: str
    writes: str
    block: str = ""
    pixel = "image_{image}[({row} * width + {column}) * {channels} + {c}]"
    weight = "weights[{index}]"
    store = "result[({row} * width + {column}) * {channels} + {i}] = {value};"
    max_output_channels = 2**16
    declares_memory = True
    size: str = ""
    long: str = ""
    space: str | None = None
    are_aligned = True
    declares_above = False

    def begin(self, kernel: Kernel, top: str, bounded: bool) -> str:
        """Return the text of a kernel up to its first statement."""
        interface, above = kernel.interface, self.top(kernel, top)
        if kernel.launches:
            return "\n".join(above)
        sizes = [f"    {self.index(n, f'{self.size}{n}')}" for n in interface.integers if self.size]
        vectors = self.weights_as_vectors(kernel.weights)
        if interface.role == PATH:
            opening = self.opening(interface)
        elif kernel.group is None:
            guard = self.guard(kernel.place, ("width", "height"), [self.step(each) for each in kernel.step])
            opening = [*sizes, *guard, *vectors, *self.strides(interface)]
        else:
            memory = [] if self.declares_above else [f"    {line}" for line in self.group_memory(kernel)]
            opening = [*memory, *vectors, *sizes, *self.item_place()]
        return "\n".join([*above, *self.head(interface), *opening])

    def launched(self, kernel: Kernel, launch: Launch, counts: Sequence[str]) -> list[str]:
        """Return the first lines of a launch of a denoiser, of which no item is beyond the grid."""
        own, taken = copy(self), kernel.interface
        own.entries = {DENOISE: self.launch_entry(kernel.launches.index(launch))}
        integers = [self.index(n, f"{self.size}{n}") for n in taken.integers if self.size]
        items = zip(launch.place, self.item, strict=True)
        places = [self.index(name, self.cast("int32", text)) for name, text in items]
        vectors = self.weights_as_vectors(kernel.weights)
        return [*own.head(taken), *vectors, *(f"    {line}" for line in (*integers, *places))]

    @staticmethod
    def step(step: Expr) -> str:
        """Return the text of how far an item's first pixel is from its neighbour's."""
        return "" if step.value == 1 else f" * {' * '.join(str(e.value) for e in (step.args or (step,)))}"

    def weights_as_vectors(self, kind: Type) -> list[str]:
        """Return the declaration of the weights as vectors, where they are some."""
        if kind.lanes == 1 or self.space is None:
            return []
        vector = f"{self.space}const {self.vector_kind(kind.dtype, kind.lanes)}"
        return [f"    {vector} *w = ({vector} *)weights;"]

    def top(self, kernel: Kernel, top: str) -> list[str]:
        """Return the lines above the function."""
        return [top] if top or kernel.interface.role == DENOISE else []

    def head(self, kernel: Interface) -> list[str]:
        """Return the lines of the function up to its brace."""
        raise NotImplementedError

    def opening(self, kernel: Interface) -> list[str]:
        """Return the first statements of a path kernel: the item's place, the guard, the place in planes."""
        limits = [self.integer(kernel, name) for name in ("width", kernel.rows)]
        return [*self.guard(kernel.place, limits), *self.places_of_planes(kernel)]

    def guard(
        self, names: Sequence[str], limits: Sequence[str], steps: Sequence[str] = ("", "")
    ) -> list[str]:
        """Return the item's place, of so many steps, and the end of an item outside of the picture."""
        texts = [f"{self.cast('int32', text)}{step}" for text, step in zip(self.item, steps, strict=True)]
        places = [f"    {self.index(name, text)}" for name, text in zip(names, texts, strict=True)]
        outside = " || ".join(f"{name} >= {limit}" for name, limit in zip(names, limits, strict=True))
        return [*places, f"    if ({outside}) {{", "        return;", "    }"]

    def integer(self, kernel: Interface, name: str) -> str:
        """Return the text of an integer that the kernel is given."""
        return f"{self.size}{name}"

    # ---- places in memory --------------------------------------------------------------------------------

    def offset(self, name: str, value: str) -> str:
        """Return the declaration of a place in memory."""
        return f"{self.long} {name} = {value};" if self.long else self.index(name, value)

    def factor(self, text: str) -> str:
        """Return a number as a factor of a place in memory."""
        return f"({self.long}){text}" if self.long else text

    def places_of_planes(self, kernel: Interface) -> list[str]:
        """Return the first statements of a path kernel: its place in the planes."""
        rows, width = (self.factor(self.integer(kernel, name)) for name in ("rows", "width"))
        column, row = (self.factor(name) for name in kernel.place)
        return [
            f"    {self.offset('plane', f'{rows} * {width}')}",
            f"    {self.offset('at', f'{row} * {width} + {column}')}",
        ]

    def strides(self, kernel: Interface) -> list[str]:
        """Return the declarations of how far rows of planes, and planes, are apart, and of an item's place.

        The place comes first: the filter took a tenth longer on PoCL where its stores computed it.
        """
        if not any(array.planes for array in kernel.arrays):
            return []
        column, row, width, height = map(self.factor, (*kernel.place, "width", "height"))
        places = {"stride": self.factor("row_stride") if "row_stride" in kernel.integers else width}
        strided = "plane_stride" in kernel.integers
        places["plane"] = self.factor("plane_stride") if strided else f"{height} * stride"
        places["at"] = f"{row} * stride + {column}"
        places |= {"place": f"{row} * {width} + {column}"} if kernel.images else {}
        return [f"    {self.offset(name, value)}" for name, value in places.items()]

    def about(self, array: Array) -> str:
        """Return what an array is that a kernel is given, by its name."""
        if array.is_image or (array.name == RESULT and not array.planes):
            size = f"width * height * {array.shape[-1]} floats"
            encoded = ", encoded as `output` says" if array.name == RESULT else ""
            return f"{array.name}: {size}, rows from the top, channels interleaved{encoded}"
        kind, vectors = f"{array.shape[-1]} floats", self.vectors if array.name == WEIGHTS else None
        if array.home == BLOCK:
            kind += ", a uniform block, or constant memory, of vectors of 4"
        elif self.are_aligned and vectors is not None and vectors.lanes > 1:
            kind += f", at an address that is a multiple of {4 * vectors.lanes}"
        if array.planes:
            kind = f"planes of {array.shape[-2]} rows of {kind}"
        elif len(array.shape) > 1:
            kind = f"rows of {kind}"
        return f"{array.name}: {kind}"

    def read(self, array: Array, index: Sequence[str], lanes: int) -> str:
        """Return an element of an array that a kernel is given."""
        place = index[-1]
        if array.planes:
            row, column = map(self.factor, index[1:])
            own = tuple(index[1:]) in OWN
            place = f"{index[0]} * plane + {'at' if own else f'{row} * stride + {column}'}"
        elif array.is_image:
            assert index[1] in ("x", "column"), "an item uses its own pixel of an image"
            place = f"place * {array.shape[-1]} + {place}"
        elif len(index) == 2:
            place = f"{index[0]} * {array.shape[-1]} + {place}"
        return f"{array.name}[{place}]"

    def typed(self, name: str) -> str:
        """Return the declaration of an integer, without what ends it."""
        return f"{self.scalars['uint32' if name in UNSIGNED else 'int32']} {name}"

    def array_argument(self, array: Array) -> str:
        """Return an argument that is an array."""
        kind = self.scalars[array.dtype] if array.lanes == 1 else self.vector_kind(array.dtype, array.lanes)
        form = self.block if array.home == BLOCK else self.reads if array.access == READ else self.writes
        return form.format(kind=kind, name=array.name, array=array)


class Arguments(Buffers):
    """Kernels whose arrays and integers are arguments in a list: `heading` opens it."""

    heading: str

    def head(self, kernel: Interface) -> list[str]:
        """Return the lines of the function up to its brace."""
        return [*self.function(self.entries[kernel.role], self.listed(kernel)), "{"]

    def function(self, entry: str, listed: Sequence[str]) -> list[str]:
        """Return the lines of a function's head."""
        inside = ",\n".join(f"    {each}" for each in listed)
        return [f"{self.heading.format(entry=entry)}(", f"{inside})"]

    def launched(self, kernel: Kernel, launch: Launch, counts: Sequence[str]) -> list[str]:
        """Return the first lines of a launch, which is a function; items beyond the grid end."""
        if kernel.interface.role == DENOISE:
            return super().launched(kernel, launch, counts)
        places = [*zip(launch.place, self.item, counts, strict=False)]
        outside = " || ".join(f"{place} >= {count}" for place, _, count in places)
        return [
            *self.function(f"wamnet_{launch.name}", self.listed(kernel.interface_of(launch))),
            "{",
            *(f"    {self.index(place, self.cast('int32', item))}" for place, item, _ in places),
            *(f"    if ({outside}) {{", "        return;", "    }"),
        ]

    def listed(self, kernel: Interface) -> list[str]:
        """Return all arguments."""
        arrays = [self.array_argument(array) for array in kernel.arrays]
        return [*arrays, *(self.typed(name) for name in kernel.integers)]

    def cast(self, dtype: str, text: str) -> str:
        """Return the text of a number converted to another kind."""
        return f"({self.scalars[dtype]})" + (f"({text})" if " " in text else text)
