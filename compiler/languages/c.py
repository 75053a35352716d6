"""C99: headers of `static inline` functions, to be pasted; images, weights, sums and result are arrays.

Contraction (a product fused with a sum) is off in the text itself: by the standard's pragma, which GCC
ignores, and by GCC's own. An option of the compiler that allows more than the standard does, such as
-ffast-math, voids the bound: where a bound is stated, the text refuses to compile with it.

A header is C++ as well, leaves no macro behind but its guard and those named WAMNET_, and shares no name with
the header of a denoiser's other kernel [`C.finished`, `C.apart`].
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..core.profiles import SineContract
from ..kernel.instructions import (
    C_TILE,
    CLONED,
    CLONED_IMAGE,
    FUSED,
    PRAGMAS,
    RESTRICT,
    STRAIGHT,
    TRANSFORMS,
    UNFUSED,
    c_vectors,
)
from ..kernel.interface import DENOISE, ENCODE, INTEGERS, PATH, UNSIGNED, Array, Interface
from ..kernel.kernel import Kernel, operations
from ..kernel.sizes import integer, item_bytes
from .c_path import HELPERS, MASKS, NUMBERS_OF_PATHS, OPERATIONS, PATHS, TYPES
from .dialect import Dialect
from .openings import Arguments

POPPED = """\
}

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif
#endif"""
"""The last lines of a header."""

DEFINED = re.compile(r"^ *# *define (?!WAMNET_)(\w+)", re.MULTILINE)
"""Macros of a text, but the guard and other names that nobody else has."""

TABLES = re.compile(r"^static const \w+ (\w+)\[", re.MULTILINE)
"""Tables outside of functions."""

GUARD, GUARDED = "#ifndef WAMNET_", "\n#endif"
"""What the first line below a header's comment begins with, and its last line."""

IGNORED = """\
/* What only planes need that are not asked for is computed all the same; compilers leave it out. */
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-variable"
#pragma GCC diagnostic ignored "-Wunused-but-set-variable"
#endif
"""
"""Around a path kernel: its programs are the same whatever planes it adds up."""

RESTORED = """\
}

#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif"""
"""What ends [`IGNORED`]."""

STACK = "fewer than 2^31 floats an image; stack: {stack} bytes at most, without optimisation too"
"""What a denoiser's text says of the thread that calls it."""

CLAMP = """\
static inline int wamnet_clamp(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}
"""
"""The function that clamps a coordinate to the image."""

ALL_PIXELS = "/* All pixels, one after another. */"
"""What the function is for that calls the one of a pixel."""


def whole(entry: str) -> str:
    """Return the name of the function of all pixels, by that of a pixel's."""
    return entry.replace("_trace_pixel", "_trace").replace("_pixel", "_image")


def stack_bytes(arrays: int) -> int:
    """Return the most bytes of stack of a call whose arrays have so many.

    Next to them are the scalars of a pixel and of the transforms, which compilers keep in memory where they
    do not optimise; a test compares with the compilers' own count.
    """
    return arrays + arrays // 2 + 8192


def includes(role: str, *names: str) -> list[str]:
    """Return the guard of a header, and what it includes."""
    guard = f"WAMNET_{'TRACE' if role == PATH else role.upper()}_H"
    return [f"#ifndef {guard}", f"#define {guard}", *(f"#include <{name}.h>" for name in names), RESTRICT]


Two = tuple[str, str]
"""What is said of columns, and of rows."""


class C(Arguments):
    """The dialect's table."""

    target = "c"
    language = "C99"
    suffix = ".h"
    entries = {
        **{role: f"wamnet_{role}_pixel" for role in INTEGERS},
        DENOISE: "wamnet_pixel",
        PATH: "wamnet_trace_pixel",
        ENCODE: "wamnet_encode",
    }
    ends = {**dict.fromkeys(INTEGERS, POPPED), PATH: f"{RESTORED}{POPPED[1:]}"}
    heading = "static inline void {entry}"
    reads = "const float *restrict {name}"
    writes = "float *restrict {name}"
    long = "size_t"
    native_sine = SineContract("sinf() of C99, which promises nothing", None)
    calls_vectors = True
    casts = True
    byte = "uint8_t"
    own = "wamnet_"
    tiles = (16, 8, 4)
    dot_of_bytes = "wamnet_dot(&{total}, &{weights}, {place});"
    weight_vector = "*(const wamnet_vector *)(weights + ({index}) * LANES)"
    wide = False
    are_aligned = False
    unroll = "WAMNET_UNROLL"
    clamp = "wamnet_clamp"
    unordered = (
        "",
        """\
#if defined(__FAST_MATH__) || !defined(FLT_EVAL_METHOD) || (FLT_EVAL_METHOD != 0 && FLT_EVAL_METHOD != 16)
#error the error bound needs float arithmetic as in IEEE 754: no -ffast-math, and on x86 -msse2 -mfpmath=sse
#endif""",
    )
    vector_kinds = {"float32": "wamnet_vector", "int32": "wamnet_sums"}
    linkage = "static "
    mixed = (
        "float {name}[{count} * LANES];",
        "{name} + ({index}) * LANES",
        "({kind} *)({name} + {index} * LANES)",
    )
    mixed_number = "{name}[{index}]"
    at_once = "as many paths as a vector register of the compiler's target holds"
    path_lanes = 16
    paints = True
    scalars = {**Dialect.scalars, "int32": "int32_t", "uint32": "uint32_t"}
    table = "static const {type} {name}[{count}] = {{{values}}};"
    operations = {
        **Dialect.operations,
        "absolute": "fabsf({0})",
        "floor": "floorf({0})",
        "sqrt": "sqrtf({0})",
        "power": "powf({0}, {1})",
        "exp": "expf({0})",
        "sin": "sinf({0})",
        "cos": "cosf({0})",
        "minimum": "{1} < {0} ? {1} : {0}",
        "maximum": "{1} > {0} ? {1} : {0}",
        "convert": "({type}){0}",
    }

    def finished(self, text: str) -> str:
        """Return a header that drops its macros at its end, before the end of its guard."""
        dropped = [f"#undef {name}" for name in sorted(set(DEFINED.findall(text)))]
        return "\n".join([text.removesuffix(GUARDED), *dropped]) + GUARDED

    def apart(self, source: str, part: str) -> str:
        """Return a header whose functions, types, tables and guard are named after a part of a denoiser."""
        tables = "|".join(TABLES.findall(source)) or "(?!)"
        place = source.find(GUARD)  # what is above is a comment, or the source is a name
        above, text = source[: max(place, 0)], source[max(place, 0) :]
        text = re.sub(r"\bWAMNET_DENOISE_H\b", f"WAMNET_{part.upper()}_H", text)
        text = re.sub(rf"\b({tables})\b", r"wamnet_\1", text)
        return re.sub(r"\bwamnet_(?=[a-z])", f"wamnet_{part}_", above + text)

    def integer(self, kernel: Interface, name: str) -> str:
        """Return the text of an integer that the kernel is given: a path's are in one structure."""
        return f"part->{name}" if kernel.role == PATH else name

    def top(self, kernel: Kernel, top: str) -> list[str]:
        """Return the lines above the functions of a path kernel."""
        head = [*includes(PATH, "float", "math", "stdbool", "stddef", "stdint"), PRAGMAS]
        fields = [f"    {self.typed(name)};" for name in kernel.interface.integers]
        said = "/* What all pixels of a launch share. */"
        part = [said, "typedef struct {", *fields, "} wamnet_part;", ""]
        return [*head, IGNORED, PATHS + NUMBERS_OF_PATHS + top, *part]

    def typed(self, name: str) -> str:
        """Return the declaration of an integer, without what ends it."""
        return f"{'uint32_t' if name in UNSIGNED else 'int'} {name}"

    def head(self, kernel: Interface) -> list[str]:
        """Return the lines of the functions: of paths one for some pixels, and one that calls it for all."""
        said = "Pixels of row first_row + `row` from column `column` on: WAMNET_PATHS, or fewer at its end."
        return self.functions(kernel, said, kernel.place, ("column += WAMNET_PATHS", "++row"))

    def begin(self, kernel: Kernel, top: str, bounded: bool) -> str:
        """Return the text of a kernel up to its first statement."""
        interface = kernel.interface
        if interface.role == PATH:
            return super().begin(kernel, top, bounded)
        names = ("float", "math", "stdbool", *(["stddef"] if interface.role != DENOISE else []), "stdint")
        head = [*includes(interface.role, *names), self.unordered[bounded]]
        if kernel.weights.dtype == "int32":
            above = [*includes(DENOISE, *names, "string"), FUSED, top, STRAIGHT, C_TILE]
        elif kernel.weights.lanes == 1:
            above = [*head, UNFUSED, top]
        else:
            vectors = [c_vectors(str(kernel.weights.lanes)), *([TRANSFORMS] if kernel.functions else [])]
            above = [*head, FUSED, STRAIGHT, *vectors, top, CLONED]
        said = "One pixel (x, y): its channels are written to `result`, the whole picture's array."
        said = said if interface.role == DENOISE else "One pixel (x, y)."
        if kernel.step[0].value != 1:
            said = (
                "Pixels (x, y), (x + 1, y), ..., PIXELS of them or to the end of the row: their channels are "
                "written\n   to `result`, the whole image's array."
            )
        unused = "    (void)weights;" if interface.named("weights") else ""
        along, down = (self.step(each).removeprefix(" * ") for each in kernel.step)
        steps = (f"x += {along}" if along else "++x", f"y += {down}" if down else "++y")
        clamps = interface.role == DENOISE or "clamp" in operations(kernel)
        limit = CLAMP.replace(C.clamp, self.clamp) if clamps else ""
        functions_of = "\n".join(self.functions(interface, said, kernel.place, steps, limit))
        if above[-1] == CLONED:
            functions_of = functions_of.replace(ALL_PIXELS, f"{ALL_PIXELS}\n{CLONED_IMAGE}")
        return "\n".join([*above, functions_of, unused, *self.strides(interface)])

    def listed(self, kernel: Interface) -> list[str]:
        """Return all arguments: the integers of a path kernel are in one structure."""
        if kernel.role != PATH:
            return super().listed(kernel)
        return ["const wamnet_part *part", *map(self.array_argument, kernel.arrays)]

    def functions(self, kernel: Interface, said: str, item: Two, steps: Two, limit: str = "") -> list[str]:
        """Return the function of all pixels, and the head of that of a work item's, which has its place."""
        name, listed = f"{self.entries[kernel.role].removesuffix('_pixel')}_pixel", self.listed(kernel)
        given = ", ".join([*(each.split()[-1].lstrip("*") for each in listed), *kernel.place])
        width, rows = self.integer(kernel, "width"), self.integer(kernel, kernel.rows)
        (column, row), (along, down) = kernel.place, steps
        call = [
            f"    for (int {row} = 0; {row} < {rows}; {down}) {{",
            f"        for (int {column} = 0; {column} < {width}; {along}) {{",
            f"            {name}({given});",
            "        }",
            "    }",
        ]
        all_pixels = "wamnet_image" if kernel.role == DENOISE else name.removesuffix("_pixel")
        one = self.function(name, [*listed, *(f"int {place}" for place in item)])
        declared = [f"/* {said} */", *one[:-1], f"{one[-1]};", "", ALL_PIXELS]
        every = [*self.function(all_pixels, listed), "{", *call, "}", ""]
        return [*declared, *every, *([limit] if limit else []), *one, "{"]

    def launch(self, kernel: Kernel) -> str:
        """Return which function does what, and what a denoiser takes of the stack."""
        name, role = self.entries[kernel.interface.role].removesuffix("_pixel"), kernel.interface.role
        columns, rows = (integer(kernel, each) for each in kernel.step)
        one, own, stack = "one", "call that from your own loops", ""
        if role == PATH:
            one = "WAMNET_PATHS of a row from a column on, or fewer at its end"
        elif columns > 1 or rows > 1:
            multiples = f"for each x that is a\nmultiple of {columns} and each y of {rows}"
            one = f"{columns} x {rows} from (x, y) on, {multiples}"
            own += "" if kernel.weights.dtype == "int32" else "\n(with clang, compile for your processor)"
        if role == DENOISE:
            stack = "\n" + STACK.format(stack=stack_bytes(item_bytes(kernel)))
        every = "wamnet_image" if role == DENOISE else name
        return f"{every} does all pixels, {name}_pixel {one}: {own}{stack}"

    def fitted(self, kernel: Kernel) -> Dialect:
        """Return the dialect for a kernel: vectors of floats have operations in expressions.

        Headers of several roles may be in one source, and share no name.
        """
        found, role = super().fitted(kernel), kernel.interface.role
        found.calls_vectors = kernel.weights.dtype == "int32" and role != PATH
        if not found.calls_vectors:
            found.mixed = (self.mixed[0], f"*(wamnet_vector *)({self.mixed[1]})", self.mixed[2])
            named = {"add": "wamnet_sum", "subtract": "wamnet_difference", "multiply": "wamnet_scaled"}
            found.vector_operations = {op: f"{name}({{0}}, {{1}})" for op, name in named.items()}
        found.clamp = self.clamp if role == DENOISE else f"wamnet_{role}_clamp"
        if role == PATH:
            vars(found).update(vector_kinds=TYPES, vector_operations=OPERATIONS, helpers=HELPERS)
        return found

    def vector_of(self, kind: str, values: Sequence[str]) -> str:
        """Return a vector of one value in all lanes, which is that value where a vector is scaled by it."""
        if kind in TYPES.values():
            return f"wamnet_all({kind}, {MASKS.get(values[0], values[0])})"
        return "wamnet_zero()" if values[0] == "0.0f" else values[0]

    def opening(self, kernel: Interface) -> list[str]:
        """Return the first statements: the functions have the place of a pixel already."""
        return [
            "    const int left = part->width - column;",
            "    const size_t line = (size_t)(row + part->first_row);",
            "    const size_t place = line * (size_t)part->width + (size_t)column;",
            *self.places_of_planes(kernel),
        ]

    def written(self, array: Array, index: Sequence[str], value: str, lanes: int) -> str:
        """Return the statement that writes an element, or those of pixels that are left of a row."""
        if lanes == 1:
            return super().written(array, index, value, lanes)
        step = 1 if array.planes else array.shape[-1]
        return f"wamnet_write(&{self.read(array, index, lanes)}, {step}, {value}, left);"
