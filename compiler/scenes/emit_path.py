"""From the programs of a path to a kernel: the skeleton around them, as statements of the kernel IR.

    for each sample
        start: the path at the camera
        for depth = 0, 1, ... MAX_DEPTH
            arrive: the next surface; radiance of the paths that are alive
            depth 0: look, add the features of the first surface; its emission, and shadow, for each ray
            while the path is followed: past, for each shadow ray, and see, add the features of what is seen
            depth MAX_DEPTH: done
            scatter: the path continues; done when no path is alive, or followed if that is all
        add the path's radiance
    for each ray of the features beyond the first sample's [`_Builder._rays`]
        ray: the path at the camera; arrive; look; its emission, and shadow, for each shadow ray

1. Each program is a block of statements, one a node, on variables that have the names of its inputs
   [`_Builder.block`]; its outputs are assigned at the block's end [`common.lets`, `common.assigned`].
2. An item follows as many paths as values have lanes, those of pixels side by side. A path that has ended is
   computed on with the others of its item, and changes nothing: radiance is assigned where it is alive.
3. What is added up over the samples are planes, in groups [`GROUPS`]; a kernel writes the requested ones.
4. With an encoding, sums stay variables, and become channels of images at the end [`_Builder._images`].
5. `see`, `shadow` and `past` are in a kernel that has a plane of them, and no other [`asked`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from numpy.typing import NDArray

from ...refimpl.errors import CompileError, choice
from ..core.ir import Image, Program
from ..core.weights import tables
from ..kernel.interface import IMAGE, INTEGERS, PATH, READ, SCENE_NUMBERS, SUMS, WRITE, Interface
from ..kernel.interface import Array as Memory
from ..kernel.kernel import (
    BOOL,
    FLOAT,
    WORD,
    Array,
    Block,
    Break,
    Comment,
    Constant,
    Expr,
    For,
    If,
    Kernel,
    Let,
    Statement,
    Store,
    Type,
    any_lane,
    apply,
    const,
    expr,
    lanes,
    load,
    name,
    splat,
)
from ..schedules.common import assigned, lets
from .lower_scene import ALIVE, LAYERS, LIT, SEEN, SEEN_LIT, SURFACE, WAY, PathPrograms
from .lower_scene import PATH as STATE
from .values import RGB, Values, floats, kinds, names

END = {
    "alive": ["alive"],
    **{f"last_{each}": names({f"last_{each}": value}) for each, value in {**SURFACE, **STATE}.items()},
}
"""Planes of the path's state after its last arrival, by group: for comparing paths."""

SUMMED: Values = {**floats("color", "deviation", ends=RGB), **LAYERS, **SEEN, **LIT, **SEEN_LIT}
"""What samples add up to: colour, the squared differences from its mean, and the layers of `look`, `see`,
`shadow` and `past`."""

GROUPS: Mapping[str, Sequence[str]] = {**{g: names({g: value}) for g, value in SUMMED.items()}, **END}
"""What a kernel can add up: groups of planes, by name."""

FRAME_GROUPS = ("color", "deviation", *LAYERS)
"""What a rendered frame needs."""

WHOLE = {"color", "deviation", *END}
"""What needs paths to their end."""

N, BOUNCE, MAX_DEPTH = name("n"), name("bounce"), name("MAX_DEPTH")


def planes(groups: Sequence[str]) -> list[str]:
    """Return the names of all planes of some groups, in the order in which a kernel writes them."""
    for group in groups:
        if group not in GROUPS:
            raise CompileError(f"planes {group!r}: unknown ({choice(group, GROUPS)})")
    return [plane for group in groups for plane in GROUPS[group]]


@dataclass(frozen=True)
class Encoding:
    """What turns the sums of a pixel into the channels of images [lower_encode.py]."""

    program: Program
    images: tuple[Image, ...]


def path_kernel(
    programs: PathPrograms, width: int, groups: Sequence[str], encoding: Encoding | None = None
) -> Kernel:
    """Return the kernel that follows `width` paths at once and adds up groups of planes."""
    return _Builder(asked(programs, groups), width, groups, encoding).built()


def asked(programs: PathPrograms, groups: Sequence[str]) -> PathPrograms:
    """Return the programs that groups of planes need: some only for their own, which must be there then."""
    parts = dict(programs.parts)
    for part, own, how in (
        ("see", {**SEEN, **SEEN_LIT}, "seen=True"),
        ("shadow", LIT, "shadow_rays=N"),
        ("past", SEEN_LIT, "seen=True and shadow_rays=N"),
    ):
        wanted = [group for group in groups if group in own]
        if wanted and part not in parts:
            raise CompileError(f"planes {wanted[0]!r} need the program {part!r}: lower the scene with {how}")
        if not wanted:
            parts.pop(part, None)
    return replace(programs, parts=parts)


# ---- the skeleton ------------------------------------------------------------------------------------------


@dataclass
class _Builder:
    """Builds one kernel of `width` paths at once."""

    programs: PathPrograms
    width: int
    groups: Sequence[str]
    encoding: Encoding | None

    def built(self) -> Kernel:
        """Return the kernel."""
        self.planes = planes(self.groups)
        self.tables: dict[tuple[str, bytes], tuple[str, NDArray[Any]]] = {}  # equal ones have one name
        images = self.encoding.images if self.encoding else ()
        count, numbers = len(self.planes), len(self.programs.inputs)
        written = [Memory(f"{IMAGE}{i.name}", WRITE, ("rows", "width", i.channels)) for i in images]
        written = written or [Memory(SUMS, WRITE, (count, "rows", "width"))]
        moving = [Memory(SCENE_NUMBERS, READ, (numbers,))] if numbers else []
        bound = Interface(PATH, (*written, *moving), INTEGERS[PATH])
        self.column, self.row = map(name, bound.place)
        depth = self.programs.settings.max_depth if self.followed or not self.short else 0
        body = (*self._begin(), self._samples(), *self._rays(), *self._end())
        return Kernel(
            bound,
            body,
            (Constant("MAX_DEPTH", const(depth), "scatterings of a path"),),
            step=(const(self.width), const(1)),
            place=bound.place,
            tables=tuple(self.tables.values()),
        )

    @property
    def short(self) -> bool:
        """Whether paths may end with what is seen: nothing else is requested, and something of that."""
        return "see" in self.programs.parts and not WHOLE & set(self.groups)

    @property
    def followed(self) -> bool:
        """Whether the way to what is seen is state of a path."""
        return "see" in self.programs.parts and self.programs.most_followed > 0

    def of(self, variable: str, kind: Type = FLOAT) -> Expr:
        """Return the variable of all paths."""
        return name(variable, kind.of(self.width))

    def all(self, value: Expr | float) -> Expr:
        """Return a value that all paths share."""
        return splat(expr(value), self.width)

    def variables(self, kinds_of: Mapping[str, str]) -> list[Statement]:
        """Return the declarations of variables of all paths."""
        return [Array(each, Type(kind, self.width)) for each, kind in kinds_of.items()]

    def _begin(self) -> list[Statement]:
        """Return the pixel, the image's size in lanes, and the sums."""
        shared = {
            "y": apply("convert", self.row + name("first_row"), value="uint32"),
            "seed": name("seed_number", WORD),
            **{f"image_{n}": apply("convert", name(n), value="float32") for n in ("width", "height")},
        }
        x = self.all(apply("convert", self.column, value="uint32"))
        return [
            Let("x", apply("add", x, lanes(self.width)) if self.width > 1 else x),
            *(Let(each, self.all(value)) for each, value in shared.items()),
            *(Array(f"sum_{plane}", FLOAT.of(self.width), value=self.all(0.0)) for plane in self.planes),
        ]

    def _sample(self) -> Let:
        """Return the number of a sample or of a ray."""
        first, n = name("first_sample", WORD), apply("convert", N, value="uint32")
        return Let("sample_number", self.all(apply("add", first, n)))

    def _samples(self) -> For:
        """Return the loop over the samples."""
        true = Array("alive", BOOL.of(self.width), value=self.all(True))
        way = [
            replace(true, name="way_going"),
            Array("way_length", FLOAT.of(self.width), value=self.all(0.0)),
        ]
        body = [
            self._sample(),
            *self.variables({"pixel": "uint32", **kinds({**STATE, **SURFACE})}),
            true,
            *(way if self.followed else []),
            *self.block("start", "the path at the camera"),
            self._bounces(),
            *self._gathered(),
        ]
        return For("n", name("samples"), tuple(body))

    def _bounces(self) -> For:
        """Return the loop over a path's surfaces."""
        alive, going = self.of("alive", BOOL), self.of("way_going", BOOL)
        first, radiance = apply("equal", BOUNCE, 0), names({"radiance": STATE["radiance"]})
        body: list[Statement] = [Let("depth", self.all(apply("convert", BOUNCE, value="uint32")))]
        body += self.block("arrive", "the next surface", masked=radiance)
        if found := self._features("the features of the first surface"):
            when = first & apply("equal", N, 0) if self.programs.rays else first
            body.append(If(when, found))
        if "see" in self.programs.parts:
            when = any_lane(going) if self.followed else first
            lit = self._shadows("past", "light on what is seen, if nothing is in between")
            seen = self.block("see", "what is seen past mirrors and glass", summed=True)
            body.append(If(when, (*lit, *seen)))
        body.append(Break(apply("equal", BOUNCE, MAX_DEPTH)))
        body += self.block("scatter", "the path goes on", masked=radiance)
        left = any_lane(alive & going if self.short and self.followed else alive)
        body.append(Break(apply("logical_not", left)))
        return For("bounce", MAX_DEPTH + 1, tuple(body))

    def _features(self, comment: str) -> tuple[Statement, ...]:
        """Return what adds up the features of a camera ray's surface, the loop over shadow rays last."""
        found: tuple[Statement, ...] = ()
        if set(self.groups) & set(LAYERS):
            found = self.block("look", comment, summed=True)
        program = self.programs.parts.get("shadow")
        if program:  # the radiance so far is what the first surface emits
            found += tuple(self._added(f"direct_{c}", self.of(f"radiance_{c}")) for c in "rgb")
        return found + self._shadows("shadow", "a lamp's light, if nothing is in between")

    def _shadows(self, part: str, comment: str) -> tuple[Statement, ...]:
        """Return the loop over shadow rays, if there is light."""
        program = self.programs.parts.get(part)
        if program is None or all(program.nodes[index].op == "constant" for _, index in program.outputs):
            return ()
        number = Let("shadow_number", self.all(apply("convert", name("shadow"), value="uint32")))
        body = (number, *self.block(part, comment, summed=True))
        return (For("shadow", const(self.programs.shadow_rays), body),)

    def _rays(self) -> list[Statement]:
        """Return the loop over the features' own rays; the path of the first sample has been one of them."""
        rays = self.programs.rays
        if rays is None or not (found := self._features("its features")):
            return []
        # The rays of most features draw no further numbers; a compiler may refuse what nothing reads.
        parts = (self.programs.parts.get(part) for part in ("arrive", "look", "shadow"))
        nodes = (node for program in parts if program for node in program.nodes)
        unread = () if any(n.op == "input" and n["name"] == "pixel" for n in nodes) else ("pixel",)
        known = {"pixel": "uint32", **kinds({**STATE, **SURFACE})}
        body = (
            self._sample(),
            *self.variables({each: kind for each, kind in known.items() if each not in unread}),
            *self.block("ray", "the ray at the camera", unread=unread),
            *self.block("arrive", "the first surface"),
            *found,
        )
        return [
            Comment("the features of further camera rays"),
            For("n", const(rays.count), body, start=const(1)),
        ]

    def _gathered(self) -> list[Statement]:
        """Return what adds what a path has gathered."""
        found: list[Statement] = [Comment("what the path has gathered")]
        if "deviation" in self.groups:
            count, weight = name("count", FLOAT), name("weight", FLOAT)
            share = apply("divide", 1.0, apply("multiply", count, apply("add", count, 1.0)))
            found.append(Let("count", apply("convert", N, value="float32")))
            found.append(Let("weight", apply("select", apply("greater", N, 0), share, 0.0)))
            for c in "rgb":
                scaled = apply("multiply", self.of(f"radiance_{c}"), self.all(count))
                found.append(Let(f"difference_{c}", apply("subtract", scaled, self.of(f"sum_color_{c}"))))
                square = apply("multiply", *[self.of(f"difference_{c}")] * 2)
                found.append(self._added(f"deviation_{c}", apply("multiply", square, self.all(weight))))
        for group in self.groups:
            for plane in GROUPS[group]:
                if group == "color":
                    found.append(self._added(plane, self.of(plane.replace("color", "radiance"))))
                elif group in END:
                    found.append(self._added(plane, self._as_float(plane.removeprefix("last_"))))
        return found

    def _added(self, plane: str, value: Expr) -> Store:
        """Return the statement that adds to a sum."""
        return Store(f"sum_{plane}", (), value, add=True)

    def _as_float(self, variable: str) -> Expr:
        """Return a state variable as a float."""
        kind = kinds({**STATE, **SURFACE, **ALIVE})[variable]
        value = self.of(variable, Type(kind))
        if kind == "bool":
            return apply("select", value, self.all(1.0), self.all(0.0))
        return value if kind == "float32" else apply("convert", value, value="float32")

    def _end(self) -> list[Statement]:
        """Return what writes the sums out, or the channels of their encoding."""
        if self.encoding is None:
            sums = enumerate(self.of(f"sum_{plane}") for plane in self.planes)
            return [Store(SUMS, (const(number), self.row, self.column), value) for number, value in sums]
        given = {plane: self.of(f"sum_{plane}") for plane in self.planes}
        given["samples"] = self.of("encoded_samples")
        samples = self.all(apply("convert", name("samples"), value="float32"))
        lines, outputs = lets(self.encoding.program, given, self.width)
        place = self.row + name("first_row"), self.column
        stores = [
            Store(f"{IMAGE}{image.name}", (*place, const(c)), outputs[f"{image.name}_{c}"])
            for image in self.encoding.images
            for c in range(image.channels)
        ]
        return [Comment("the features, encoded"), Let("encoded_samples", samples), *lines, *stores]

    def block(
        self,
        part: str,
        comment: str,
        masked: Sequence[str] = (),
        summed: bool = False,
        unread: Sequence[str] = (),
    ) -> tuple[Statement, ...]:
        """Return the statements of a program, which assign its outputs or add them up.

        Outputs in `masked` are assigned where a path is alive, those that are `unread` are not.
        """
        program = self.programs.parts[part]
        numbers = enumerate(self.programs.inputs)
        given = {each: self.all(load(SCENE_NUMBERS, number)) for number, each in numbers}
        given |= {each: self.of(f"image_{each}") for each in ("width", "height")}
        own = {}
        for table, array in tables(program).items():
            key = str(array.dtype), array.tobytes()
            own[table], _ = self.tables.setdefault(key, (f"table_{len(self.tables)}", array))
        lines, values = lets(program, given, self.width, tables=own)
        sums = [self._added(each, value) for each, value in values.items() if summed and each in self.planes]
        kept = {e: value for e, value in values.items() if (e in WAY if summed else e not in unread)}
        inputs = {str(node["name"]) for node in program.nodes if node.op == "input"}
        body = (*lines, *sums, *assigned(kept, inputs, masked))
        return Comment(f"{part}: {comment}"), Block(body)
