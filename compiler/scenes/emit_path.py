"""From the programs of a path to the text of a kernel, for any dialect.

    for each sample
        start: the path at the camera
        for depth = 0, 1, ... MAX_DEPTH
            arrive: the next surface; radiance of the paths that are alive
            depth 0: look, add the features of the first surface
            while the path is followed: see, add the features of what is seen past mirrors and glass
            depth MAX_DEPTH: done
            scatter: the path continues; done when no path is alive, or followed if that is all
        add the path's radiance
    for each ray of the features beyond the first sample's [`_Kernel._rays`]
        ray: the path at the camera; arrive; look

1. Each program is a block of statements, one a node, on variables that have the names of its inputs
   [`_Kernel.block`]; its outputs are assigned at the block's end. A loop over the rows of tables is a loop
   on a counter that all paths share, so that a row is read once for all of them [`_Kernel._loop`].
2. What is added up over the samples are planes, in groups [`GROUPS`]; a kernel writes the requested ones.
3. With an encoding, sums stay variables, and become channels of images at the end [`_Kernel._images`].
4. A path that has ended is computed on with the others of its work item, and changes nothing: radiance is
   assigned where it is alive.
5. `see` is in a kernel that has a plane of it, and no other [`asked`].
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError, choice
from ..core.ir import Image, Node, Program, Type, attributes
from ..core.lines import Lines
from ..core.loops import Loop, Part, Walk, is_walk, loops
from ..core.weights import tables
from ..kernel import interface
from ..kernel.interface import ENCODE
from ..languages.dialect import Dialect, Parts
from ..languages.renderer import framed
from .lower_scene import LAYERS, PATH, SEEN, SURFACE, WAY, PathPrograms, kinds, names

FIRST = {layer: names({layer: value}) for layer, value in LAYERS.items()}
"""Planes of the first surface: outputs of `look`, by group."""

PAST = {layer: names({layer: value}) for layer, value in SEEN.items()}
"""Planes of what is seen past mirrors and glass: outputs of `see`, by group."""

END = {
    "alive": ["alive"],
    **{f"last_{name}": names({name: value}) for name, value in {**SURFACE, **PATH}.items()},
}
"""Planes of the path's state after its last arrival, by group: for comparing paths."""

COLOR = ["color_r", "color_g", "color_b"]
"""Planes of the radiance."""

DEVIATION = ["deviation_r", "deviation_g", "deviation_b"]
"""Planes of the sum of squared differences from the mean radiance."""

GROUPS: Mapping[str, Sequence[str]] = {
    "color": COLOR,
    "deviation": DEVIATION,
    **FIRST,
    **PAST,
    **{group: [f"last_{n}" if n != "alive" else n for n in members] for group, members in END.items()},
}
"""What a kernel can add up: groups of planes, by name."""

TRIP = "i"
"""Name of the counter of a loop over the rows of tables."""

BRANCH = "node"
"""Name of the number of a tree's node, where a loop walks along one."""

FRAME_GROUPS = ("color", "deviation", *LAYERS)
"""What a rendered frame needs."""

WHOLE = {"color", "deviation", *END}
"""What needs paths to their end."""


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


def emit_path(
    programs: PathPrograms,
    dialect: Dialect,
    groups: Sequence[str],
    header: Sequence[str],
    encoding: Encoding | None = None,
) -> str:
    """Return the kernel's source; `header` are the lines of the comment at its top."""
    return _Kernel(asked(programs, groups), dialect, groups, encoding).text(header)


def asked(programs: PathPrograms, groups: Sequence[str]) -> PathPrograms:
    """Return the programs that groups of planes need: `see` only for its own, which it must be there for."""
    wanted = [group for group in groups if group in PAST]
    if wanted and "see" not in programs.parts:
        raise CompileError(f"planes {wanted[0]!r} need the program 'see': lower the scene with seen=True")
    parts = {name: part for name, part in programs.parts.items() if wanted or name != "see"}
    return replace(programs, parts=parts)


def renamed_tables(programs: PathPrograms) -> Mapping[tuple[str, str], str]:
    """Return one name for each table of each program: equal tables share theirs."""
    known: dict[tuple[str, bytes], str] = {}
    found = {}
    for part, program in programs.parts.items():
        for name, array in tables(program).items():
            key = (str(array.dtype), array.tobytes())
            found[part, name] = known.setdefault(key, f"table_{len(known)}")
    return found


@dataclass
class _Kernel(Lines):
    """The text of one kernel as it is written."""

    programs: PathPrograms
    dialect: Dialect
    groups: Sequence[str]
    encoding: Encoding | None
    lines: list[str] = field(default_factory=list)
    depth: int = 1

    def text(self, header: Sequence[str]) -> str:
        """Return the whole source."""
        self.tables = renamed_tables(self.programs)
        self.planes = planes(self.groups)
        integers, numbers = self.dialect.integers[interface.PATH], len(self.programs.inputs)
        images = self.encoding.images if self.encoding else ()
        self.kernel = interface.paths(len(self.planes), integers, numbers, images)
        self.shared = self.dialect.shared(self.kernel)
        if len(self.planes) > self.dialect.max_planes:
            raise CompileError(
                f"the kernel adds up {len(self.planes)} planes: {self.dialect.language} writes at most "
                f"{self.dialect.max_planes}; request fewer groups"
            )
        if len(self.programs.inputs) > self.dialect.most_numbers:
            raise CompileError(
                f"{self.dialect.language}: its path kernels take at most {self.dialect.most_numbers} scene "
                f"parameters, and {len(self.programs.inputs)} move: compile for fewer times, or one"
            )
        if images and not self.dialect.painted:
            raise CompileError(
                f"{self.dialect.language}: its path kernels write sums, not encoded images: compile the "
                "encoding as a separate kernel"
            )
        self._sums()
        self._samples()
        self._rays()
        self._stores()
        self._images()
        return framed(self.dialect, self.kernel, self._parts(), header, self.lines)

    @property
    def short(self) -> bool:
        """Whether paths may end with what is seen: nothing else is requested, and something of that."""
        return "see" in self.programs.parts and not WHOLE & set(self.groups)

    @property
    def followed(self) -> bool:
        """Whether the way to what is seen is state of a path."""
        return "see" in self.programs.parts and self.programs.most_followed > 0

    # ---- the skeleton ------------------------------------------------------------------------------------

    def _parts(self) -> Parts:
        """Return what is above the kernel's function."""
        declared: dict[str, NDArray[np.generic]] = {}
        for (part, name), table in self.tables.items():
            declared[table] = self.programs.parts[part].parameters[name]
        constants = [self.dialect.table_declaration(name, array) for name, array in declared.items()]
        operations = self._operations()
        helpers = dict.fromkeys(text for op, text in self.dialect.helpers.items() if op in operations)
        painter = [self.dialect.painter] if self.kernel.images and self.dialect.painter else []
        return Parts(
            top="\n".join([*constants, *helpers, *painter]),
            max_depth=self.programs.settings.max_depth if self.followed or not self.short else 0,
        )

    def _operations(self) -> set[str]:
        """Return the names of all operations of the programs; loops that walk along trees are of another."""
        programs = [*self.programs.parts.values(), *([self.encoding.program] if self.encoding else [])]
        nodes = [node for program in programs for node in program.nodes]
        return {"walk" if node.op == "loop" and is_walk(node) else node.op for node in nodes}

    def _sums(self) -> None:
        """Declare the image's size in lanes, and the sums."""
        zero = self.dialect.number(0.0, "float32")
        for name in ("width", "height"):
            self._line(self.dialect.let("float32", f"image_{name}", self.shared[name]))
        for plane in self.planes:
            self._line(self.dialect.var("float32", f"sum_{plane}", zero))

    def _samples(self) -> None:
        """Write the loop over the samples."""
        dialect = self.dialect
        self._open(dialect.loop("n", "samples"))
        self._line(dialect.let("uint32", "sample_number", self.shared["sample"]))
        self._line(dialect.var("uint32", "pixel"))
        for name, kind in kinds({**PATH, **SURFACE}).items():
            self._line(dialect.var(kind, name))
        self._line(dialect.var("bool", "alive", dialect.number(True, "bool")))
        if self.followed:
            self._line(dialect.var("bool", "way_going", dialect.number(True, "bool")))
            self._line(dialect.var("float32", "way_length", dialect.number(0.0, "float32")))
        self.block("start", "the path at the camera", {"width": "image_width", "height": "image_height"})
        self._open(dialect.bounces())
        self._line(dialect.let("uint32", "depth", dialect.splat("bounce", "uint32")))
        self.block("arrive", "the next surface", masked=("radiance_r", "radiance_g", "radiance_b"))
        if set(self.groups) & set(FIRST):
            self._open("if (bounce == 0u && n == 0) {" if self.programs.rays else "if (bounce == 0u) {")
            self.block("look", "the features of the first surface", summed=True)
            self._close()
        if "see" in self.programs.parts:
            going = self.dialect.any_lane.format(mask="way_going")
            self._open(f"if ({going if self.followed else 'bounce == 0u'}) {{")
            self.block("see", "what is seen past mirrors and glass", summed=True)
            self._close()
        self._open("if (bounce == MAX_DEPTH) {")
        self._line("break;")
        self._close()
        self.block("scatter", "the path goes on", masked=("radiance_r", "radiance_g", "radiance_b"))
        both = self.dialect.operations["logical_and"]
        mask = f"({both.format('alive', 'way_going')})" if self.short and self.followed else "alive"
        self._open(f"if (!{self.dialect.any_lane.format(mask=mask)}) {{")
        self._line("break;")
        self._close()
        self._close()
        self._gather()
        self._close()

    def _rays(self) -> None:
        """Write the loop over the features' own rays; the path of the first sample has been one of them."""
        rays, dialect = self.programs.rays, self.dialect
        if rays is None or not set(self.groups) & set(FIRST):
            return
        self.lines.append("")
        self._line("/* the features of further camera rays */")
        self._open(dialect.loop("n", rays.count - 1))
        number = f"{self.shared['sample']} + {dialect.number(1, 'uint32')}"
        self._line(dialect.let("uint32", "sample_number", number))
        # The rays of a feature draw no further numbers; a compiler may refuse what nothing reads.
        nodes = [*self.programs.parts["arrive"].nodes, *self.programs.parts["look"].nodes]
        unread = () if any(n.op == "input" and n["name"] == "pixel" for n in nodes) else ("pixel",)
        if not unread:
            self._line(dialect.var("uint32", "pixel"))
        for name, kind in kinds({**PATH, **SURFACE}).items():
            self._line(dialect.var(kind, name))
        size = {"width": "image_width", "height": "image_height"}
        self.block("ray", "the ray at the camera", size, unread=unread)
        self.block("arrive", "the first surface")
        self.block("look", "its features", summed=True)
        self._close()

    def _gather(self) -> None:
        """Add what a path has gathered."""
        self.lines.append("")
        self._line("/* what the path has gathered */")
        if "deviation" in self.groups:
            # Single numbers, also where paths are vectors.
            share = self.dialect.select("n > 0", "1.0f / (count * (count + 1.0f))", "0.0f")
            self._line(self.dialect.single("count", self.dialect.cast("float32", "n")))
            self._line(self.dialect.single("weight", share))
            for c in "rgb":
                difference = f"radiance_{c} * count - sum_color_{c}"
                self._line(self.dialect.let("float32", f"difference_{c}", difference))
                self._line(f"sum_deviation_{c} += difference_{c} * difference_{c} * weight;")
        for group in self.groups:
            for plane in GROUPS[group]:
                if group == "color":
                    self._line(f"sum_{plane} += {plane.replace('color', 'radiance')};")
                elif group in END:
                    self._line(f"sum_{plane} += {self._as_float(plane.removeprefix('last_'))};")

    def _as_float(self, name: str) -> str:
        """Return a state variable as a float."""
        kind = {**kinds({**PATH, **SURFACE}), "alive": "bool"}[name]
        if kind == "bool":
            one, zero = (self.dialect.number(value, "float32") for value in (1.0, 0.0))
            return "(" + self._select(name, one, zero) + ")"
        if kind == "float32":
            return name
        node = Node("convert", (0,), Type(), attributes(dtype="float32"))
        return self.dialect.expression(node, kind, [name])

    def _select(self, mask: str, yes: str, no: str) -> str:
        """Return the text of a choice between two floats of each path."""
        kind = self.dialect.types["float32"]
        return self.dialect.operations["select"].format(mask, yes, no, type=kind)

    def _stores(self) -> None:
        """Write the sums out, unless images are made of them."""
        self.lines.append("")
        if self.encoding:
            return
        for number, plane in enumerate(self.planes):
            buffer, component = divmod(number, self.dialect.planes_per_buffer)
            store = self.dialect.sum_store
            self._line(store.format(plane=number, buffer=buffer, component=component, value=f"sum_{plane}"))

    def _images(self) -> None:
        """Write the encoding of the sums, and its channels out."""
        if self.encoding is None:
            return
        program = self.encoding.program
        self._line("/* the features, encoded */")
        samples = self.dialect.splat(self.dialect.cast("float32", "samples"), "float32")
        self._line(self.dialect.let("float32", "encoded_samples", samples))
        named = {plane: f"sum_{plane}" for plane in self.planes} | {"samples": "encoded_samples"}
        outputs = dict(program.outputs)
        texts = self._statements(ENCODE, program, named)
        values = {
            image.name: [texts[outputs[f"{image.name}_{channel}"]] for channel in range(image.channels)]
            for image in self.encoding.images
        }
        self.lines += self.dialect.images_end(self.kernel, values)

    def _scene_numbers(self) -> dict[str, str]:
        """Return the text of each of the scene's numbers that are inputs, in all lanes."""
        dialect, found = self.dialect, {}
        for number, name in enumerate(self.programs.inputs):
            place = {"number": number, "vector": number // 4, "component": "xyzw"[number % 4]}
            found[name] = dialect.splat(dialect.scene_number.format(**place), "float32")
        return found

    # ---- one program -------------------------------------------------------------------------------------

    def block(
        self,
        part: str,
        comment: str,
        renamed: Mapping[str, str] | None = None,
        masked: Sequence[str] = (),
        summed: bool = False,
        unread: Sequence[str] = (),
    ) -> None:
        """Write the statements of a program, and assign its outputs or add them up.

        Inputs are variables of their names, or of those that `renamed` gives. Outputs in `masked` are
        assigned where a path is alive, those that are `unread` are not.
        """
        program = self.programs.parts[part]
        renamed = {**self._scene_numbers(), **(renamed or {})}
        self.lines.append("")
        self._line(f"/* {part}: {comment} */")
        self._open("{")
        texts = self._statements(part, program, renamed)
        for name, index in program.outputs:
            if summed and name in self.planes:
                self._line(f"sum_{name} += {texts[index]};")
        left = [name for name, _ in program.outputs if name not in unread]
        for line in self._assignments(program, texts, masked, WAY if summed else left):
            self._line(line)
        self._close()

    def _statements(self, part: str, program: Program, renamed: Mapping[str, str]) -> list[str]:
        """Write one statement for each operation; return the text of each value."""
        texts: list[str] = []
        ends, in_bodies = loops(program)
        for index, node in enumerate(program.nodes):
            if node.op == "input":
                name = str(node["name"])
                texts.append(renamed.get(name, name))
            elif node.op == "constant":
                texts.append(self.dialect.constant(node))
            elif node.op == "loop":
                if index in ends:
                    self._loop(part, program, texts, ends[index])
                texts.append(texts[node.args[int(node["index"])]])  # type: ignore[arg-type]
            else:
                texts.append(f"t{index}")
                if index not in in_bodies:
                    self._statement(part, program, texts, index)
        return texts

    def _statement(self, part: str, program: Program, texts: Sequence[str], index: int) -> None:
        """Write the statement that computes a value."""
        node = program.nodes[index]
        expression = self._expression(part, program, node, texts)
        declared = self.dialect.var if node.op == "carried" else self.dialect.let
        self._line(declared(node.type.dtype, texts[index], expression, kept=True))

    def _loop(self, part: str, program: Program, texts: Sequence[str], loop: Loop) -> None:
        """Write a loop over the rows of tables."""
        if loop.walk is not None:
            self._walk(part, program, texts, loop, loop.walk)
            return
        self._open(self.dialect.loop(TRIP, loop.trips))
        self._trip(part, program, texts, loop, Part(loop.body, loop.after))
        self._close()

    def _walk(self, part: str, program: Program, texts: Sequence[str], loop: Loop, walk: Walk) -> None:
        """Write a walk along a tree: a node is entered where any of the paths enters it."""
        first, skip = (self.tables[part, name] for name in (walk.first, walk.skip))
        nodes = len(program.parameters[walk.skip])
        self._open(self.dialect.walk(BRANCH, nodes))
        for index in walk.guard:
            self._statement(part, program, texts, index)
        entered = self.dialect.any_enters.format(mask=texts[walk.enters])
        self._open(f"if ({entered}) {{")
        for number, each in enumerate(walk.parts):
            start, end = (f"{first}[{BRANCH} + {number * (nodes + 1) + more}]" for more in (0, 1))
            self._open(self.dialect.loop(TRIP, end, start.replace(" + 0]", "]")))
            self._trip(part, program, texts, loop, each)
            self._close()
        self._line(f"++{BRANCH};")
        self._close()
        self._open("else {")
        self._line(f"{BRANCH} = {skip}[{BRANCH}];")
        self._close()
        self._close()

    def _trip(self, part: str, program: Program, texts: Sequence[str], loop: Loop, done: Part) -> None:
        """Write a trip of a loop: its body, then the assignments of what it carries."""
        for index in done.body:
            self._statement(part, program, texts, index)
        before, after = [], []
        for carried, new in zip(loop.carried, done.after, strict=True):
            value = texts[new]
            if new in loop.carried and new != carried:
                # Another carried number, which may be assigned before it is read: keep its value.
                kind, name = program.nodes[new].type.dtype, f"new_{texts[carried]}"
                before.append(self.dialect.let(kind, name, value, kept=True))
                value = name
            if new != carried:
                after.append(f"{texts[carried]} = {value};")
        for line in before + after:
            self._line(line)

    def _expression(self, part: str, program: Program, node: Node, texts: Sequence[str]) -> str:
        """Return the right side of a statement."""
        if node.op == "carried":
            return texts[node.args[0]]
        if node.op in ("take", "row", "branch"):
            table = self.tables[part, str(node["table"])]
            node = Node(node.op, node.args, node.type, attributes(table=table))
        if node.op in ("row", "branch"):
            counter = TRIP if node.op == "row" else BRANCH
            return self.dialect.expression(replace(node, op="row"), node.type.dtype, [counter])
        kind = program.nodes[node.args[-1]].type.dtype
        return self.dialect.expression(node, kind, [texts[arg] for arg in node.args])

    def _assignments(
        self, program: Program, texts: Sequence[str], masked: Sequence[str], only: Collection[str]
    ) -> list[str]:
        """Return the assignments of a program's outputs, or of some, to the variables of their names."""
        inputs = {str(node["name"]) for node in program.nodes if node.op == "input"}
        before, after = [], []
        for name, index in program.outputs:
            if name not in only:
                continue
            value = texts[index]
            if value in inputs and value != name:
                # The variable may be assigned before it is read: keep its value.
                kind = program.nodes[index].type.dtype
                before.append(self.dialect.let(kind, f"new_{name}", value, kept=True))
                value = f"new_{name}"
            if name == "alive":
                after.append(f"alive = {self.dialect.operations['logical_and'].format('alive', value)};")
            elif name in masked and value != name:
                after.append(f"{name} = {self._select('alive', value, name)};")
            elif value != name:
                after.append(f"{name} = {value};")
        return before + after
