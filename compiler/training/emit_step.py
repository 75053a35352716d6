"""From a training step to OpenCL C, scheduled for processors: matrix products in registers.

1. A work item works by itself on a part of the minibatch, TILE examples at a time. The value of a node for
   these examples is an array of vectors in memory of its own, `v<number>`; numbers are the program's.
2. An affine map is done for EXAMPLES examples at once: every weight that is loaded meets all; the sums
   stay in registers [`_affine`]. Windows are read from the images, without a copy.
3. A sum over examples of left right^T is done for some inputs at once [`_product`]: its part for these stays
   in registers while the examples go by. Sums continue from tile to tile; each work item has its own.
4. Neighbouring elementwise nodes share a loop [`_elementwise`]. One operation on a value that is kept is
   computed again in each loop that reads it: an array would cost more.
5. The second kernel adds up the work items' sums in their order, and applies Adam to whole vectors
   [`update_text`]. The order of every sum is fixed: a device gives the same bits in every run.

A loss that is not finite changes nothing from then on, and leaves its step in `failed`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from ...refimpl.errors import CompileError
from ..core.ir import Node, Program, users
from ..core.lines import Lines
from ..core.ops import OPS
from ..schedules.common import groups_of as schedule
from .emit_factors import factor_defines
from .step import SQUARES, TARGET, TRANSPOSED, WINDOW, Step, Sum
from .step_layout import LANES, Slot, slots, transposed_slots, vectors_for
from .vectors import Vectors

TILE = 64
"""Examples that a work item holds at once: their values (19 arrays of 8 KiB for the presets) stay in the
second-level cache, and the sums in registers are stored once for so many."""

EXAMPLES = 8
"""Examples of an affine map in registers: with two vectors of neurons 16 sums, enough to hide the latency."""

REGISTERS = 24
"""Vectors of sums in registers, of AVX-512's 32: the rest is for what they are made of."""

BLOCK = 4
"""Vectors of neurons in registers at once; wider layers are done block by block."""

INPUTS = 12
"""Inputs of a sum of products in registers at once; 12 divides the runs of all presets' windows."""


@dataclass(frozen=True)
class WindowForm:
    """How windows lie in memory: `size` runs of `run` numbers, the runs of one example a row apart."""

    size: int
    run: int


@dataclass
class _Step(Lines):
    """The text of the first kernel as it is written."""

    step: Step
    form: WindowForm
    dialect: Vectors
    lines: list[str] = field(default_factory=list)
    depth: int = 2

    def __post_init__(self) -> None:
        self.program = self.step.program
        self.places, self.transposed = slots(self.step), transposed_slots(self.step)
        self.readers = users(self.program)
        self.groups = groups_of(self.program)
        self.group_of = {index: number for number, group in enumerate(self.groups) for index in group}
        ends = dict(self.program.outputs)
        self.summed = {ends[name] for known in self.step.sums for name in (known.left, known.right) if name}
        offset = 0
        self.arrays: dict[int, int] = {}
        for index in sorted(self.group_of):
            if self._is_array(index) and not self._again(index):
                self.arrays[index] = offset
                offset += TILE * self._vectors(index)
        self.scratch_vectors = offset

    def text(self) -> list[str]:
        """Return the statements for one tile."""
        for index, offset in self.arrays.items():
            self._line(f"__global float16 *restrict v{index} = scratch + {offset};")
        for group in self.groups:
            node = self.program.nodes[group[0]]
            if node.op == "input":
                if node["name"] == TARGET:
                    self._target(group[0])
            elif node.op == "affine":
                self._affine(group[0], node)
            else:
                self._elementwise(group)
        for known in self.step.sums:
            self._sum(known)
        return self.lines

    # ---- values ------------------------------------------------------------------------------------------

    def _is_array(self, index: int) -> bool:
        """Return whether a value is kept for all examples of a tile: something outside its loop reads it."""
        node = self.program.nodes[index]
        if node.op == "input" and node["name"] == WINDOW:
            return False
        outside = any(self.group_of[reader] != self.group_of[index] for reader in self.readers[index])
        return outside or index in self.summed

    def _again(self, index: int) -> bool:
        """Return whether other loops compute a value again: one operation on one value that is kept."""
        node = self.program.nodes[index]
        read = {arg for arg in node.args if self.program.nodes[arg].op not in ("constant", "parameter")}
        cheap = OPS[node.op].elementwise and len(read) == 1 and read <= self.arrays.keys()
        return cheap and index not in self.summed

    def _vectors(self, index: int) -> int:
        """Return the vectors of a value."""
        return vectors_for(self.program.nodes[index].type.shape[0])

    def _weight_place(self, name: str) -> tuple[str, Slot]:
        """Return the array and the slot of a parameter."""
        if name.endswith(TRANSPOSED):
            return "transposed", self.transposed[name]
        return "theta", self.places[name]

    def _read(self, index: int, group: int) -> str:
        """Return the text of vector j of a value of example e, read inside `group`."""
        node = self.program.nodes[index]
        if node.op == "constant":
            return self.dialect.constant(node)
        if node.op == "parameter":
            array, slot = self._weight_place(str(node["name"]))
            return f"{array}[{slot.offset} + j]"
        if self.group_of[index] == group:
            return f"t{index}"
        if self._again(index):
            return f"({self._expression(index, group)})"
        if index not in self.arrays:
            raise CompileError(f"%{index}: only affine maps may read the window in a training kernel")
        return f"v{index}[e * {self._vectors(index)} + j]"

    # ---- nodes -------------------------------------------------------------------------------------------

    def _target(self, index: int) -> None:
        """Copy the targets of the tile's examples."""
        (width,) = self.program.nodes[index].type.shape
        self._comment(f"%{index}: the targets")
        self._open(self.dialect.loop("e", "filled"))
        self._line(f"__global float *out = (__global float *)(v{index} + e * {self._vectors(index)});")
        self._open(self.dialect.loop("i", self._vectors(index) * LANES))
        self._line(f"out[i] = i < {width} ? targets[target[e] * {width} + i] : 0.0f;")
        self._close(2)

    def _affine(self, index: int, node: Node) -> None:
        """Write v = W x + b for EXAMPLES examples at once, BLOCK vectors of neurons at a time."""
        array, slot = self._weight_place(str(node["weight"]))
        windows = self.program.nodes[node.args[0]].op == "input"
        if windows and self.program.nodes[node.args[0]]["name"] != WINDOW:
            raise CompileError(f"%{index}: an affine map of the target has no schedule")
        self._comment(f"%{index}: affine map {node['weight']} from {slot.rows} to {slot.width}")
        for first in range(0, slot.vectors, BLOCK):
            block = range(first, min(first + BLOCK, slot.vectors))
            examples = EXAMPLES if len(block) * EXAMPLES <= REGISTERS else EXAMPLES // 2
            self._open(f"for (int e = 0; e < filled; e += {examples}) {{")
            for n in range(examples):
                start = (
                    f"values + corner[e + {n}]"
                    if windows
                    else f"(__global const float *)(v{node.args[0]} + (e + {n}) * {vectors_for(slot.rows)})"
                )
                self._line(f"__global const float *x{n} = {start};")
                sums = ", ".join(f"s{n}_{j} = {self._bias(node, j)}" for j in block)
                self._line(f"float16 {sums};")
            self._line(f"__global const float16 *w = {array} + {slot.offset};")
            if windows:
                self._open(self.dialect.loop("dy", "WINDOW_SIZE"))
                self._products(slot, block, examples, "WINDOW_RUN")
                self._line(" ".join(f"x{n} += row[e + {n}];" for n in range(examples)))
                self._close()
            else:
                self._products(slot, block, examples, str(slot.rows))
            for n in range(examples):
                stores = (f"v{index}[(e + {n}) * {slot.vectors} + {j}] = s{n}_{j};" for j in block)
                self._line(" ".join(stores))
            self._close()

    def _bias(self, node: Node, j: int) -> str:
        """Return what the sums of vector j of the neurons begin with."""
        if node.get("bias") is None:
            return self.dialect.splatted(0.0, "float32")
        array, slot = self._weight_place(str(node["bias"]))
        return f"{array}[{slot.offset + j}]"

    def _products(self, slot: Slot, block: range, examples: int, count: str) -> None:
        """Write the loop over `count` inputs that follow one another, for all examples in registers."""
        self._open(self.dialect.loop("i", count))
        self._line("const float16 " + ", ".join(f"w{j} = w[{j}]" for j in block) + ";")
        self._line(f"w += {slot.vectors};")
        for n in range(examples):
            self._line(" ".join(f"s{n}_{j} += w{j} * x{n}[i];" for j in block))
        self._close()

    def _elementwise(self, group: tuple[int, ...]) -> None:
        """Write the operations of a group, in a loop over examples and vectors."""
        number = self.group_of[group[0]]
        vectors = self._vectors(group[0])
        span = f"%{group[0]}" if len(group) == 1 else f"%{group[0]} to %{group[-1]}"
        self._comment(f"{span}: elementwise on {self.program.nodes[group[0]].type.shape[0]} numbers")
        self._open(self.dialect.loop("e", "filled"))
        self._open(self.dialect.loop("j", vectors))
        for index in group:
            kind = self.dialect.types[self.program.nodes[index].type.dtype]
            self._line(f"{kind} t{index} = {self._expression(index, number)};")
            if index in self.arrays:
                self._line(f"v{index}[e * {vectors} + j] = t{index};")
        self._close(2)

    def _expression(self, index: int, group: int) -> str:
        """Return the text of an elementwise operation inside `group`."""
        node = self.program.nodes[index]
        operands = [self._read(arg, group) for arg in node.args]
        return self.dialect.expression(node, self.program.nodes[node.args[-1]].type.dtype, operands)

    # ---- sums --------------------------------------------------------------------------------------------

    def _sum(self, known: Sum) -> None:
        """Add the tile's examples to one sum."""
        ends = dict(self.program.outputs)
        left, slot = ends[known.left], self.places[known.parameter]
        if known.right is None:
            self._comment(f"sum of %{left}: {known.parameter}")
            for j in range(slot.vectors):
                self._registers(slot, range(j, j + 1), 1, "", "", left)
            return
        right = ends[known.right]
        self._comment(f"sum of %{left} x %{right}: {known.parameter}")
        windows = self.program.nodes[right].op == "input"
        run = self.form.run if windows else slot.rows
        if windows:
            self._open(self.dialect.loop("dy", "WINDOW_SIZE"))
            source, before = "values + corner[n] + dy * row[n] + k", "dy * WINDOW_RUN + k"
        else:
            source, before = f"(__global const float *)(v{right} + n * {vectors_for(slot.rows)}) + k", "k"
        for first in range(0, slot.vectors, BLOCK):
            block = range(first, min(first + BLOCK, slot.vectors))
            self._product(slot, block, run, source, before, left)
        if windows:
            self._close()

    def _product(self, slot: Slot, block: range, run: int, source: str, before: str, left: int) -> None:
        """Write the loop over the inputs of a run, as many at once as registers hold, then over the rest."""
        inputs = min(INPUTS, REGISTERS // len(block))
        whole, rest = run // inputs * inputs, run % inputs
        if whole:
            self._open(f"for (int k = 0; k < {whole}; k += {inputs}) {{")
            self._registers(slot, block, inputs, source, before, left)
            self._close()
        if rest:
            self._open("{")
            self._line(f"const int k = {whole};")
            self._registers(slot, block, rest, source, before, left)
            self._close()

    def _registers(self, slot: Slot, block: range, inputs: int, source: str, before: str, left: int) -> None:
        """Write the loop over the tile's examples for sums in registers; without a source, of `left`."""
        self._open("{")
        row = f"({before}) * {slot.vectors}" if before else "0"
        self._line(f"__global float16 *out = sums + {slot.offset} + {row};")
        zero = self.dialect.splatted(0.0, "float32")
        names = [(i, j, f"s{i}_{j}", f"out[{i * slot.vectors + j}]") for i in range(inputs) for j in block]
        for _, _, name, place in names:
            self._line(f"float16 {name} = begins ? {zero} : {place};")
        self._open(self.dialect.loop("n", "count"))
        if source:
            self._line(f"__global const float *x = {source};")
        for j in block:
            self._line(f"const float16 d{j} = v{left}[n * {slot.vectors} + {j}];")
        for i in range(inputs):
            factor = f" * x[{i}]" if source else ""
            self._line(" ".join(f"s{i}_{j} += d{j}{factor};" for j in block))
        self._close()
        for _, j, name, place in names:
            filled = range(slot.width - j * LANES, LANES) if (j + 1) * LANES > slot.width else range(0)
            zeros = "".join(f"{name}.s{lane:x} = " for lane in filled)
            self._line((f"{zeros}0.0f; " if zeros else "") + f"{place} = {name};")
        self._close()


def groups_of(program: Program) -> list[tuple[int, ...]]:
    """Return the groups of emit.py: schedule, or refuse what has no loop here: only vectors do."""
    for index, node in enumerate(program.nodes):
        held = OPS[node.op].elementwise and node.type.shape
        if not held and node.op not in ("constant", "parameter", "input", "affine"):
            raise CompileError(f"%{index} {node.op} : {node.type} has no schedule in a training kernel")
    return schedule(program)


STEP_BEGIN = """\
{defines}
{helpers}
__kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void wamnet_step(
    __global const float *restrict values,
    __global const float *restrict targets,
    __global const int *restrict places,
    __global const float16 *restrict theta,
    __global const float16 *restrict transposed,
    __global float16 *restrict scratch,
    __global float16 *restrict sums,
    __global const int *restrict failed)
{{
    if (failed[0] >= 0) {{
        return;
    }}
    const int group = (int)get_global_id(0), groups = (int)get_global_size(0);
    const int last = (int)((long)BATCH * (group + 1) / groups);
    int first = (int)((long)BATCH * group / groups);
    scratch += group * SCRATCH;
    sums += group * SUMS;
    for (int begins = 1; first < last; first += TILE, begins = 0) {{
        /* Where the examples lie; what fills up the last ones is computed, and not added up. */
        const int count = min(TILE, last - first);
        const int filled = (count + EXAMPLES - 1) / EXAMPLES * EXAMPLES;
        int corner[TILE], row[TILE], target[TILE];
        for (int e = 0; e < filled; ++e) {{
            const int n = min(first + e, last - 1);
            corner[e] = places[n];
            row[e] = places[BATCH + n];
            target[e] = places[2 * BATCH + n];
        }}
"""
"""The first kernel up to the statements of a tile."""

UPDATE_BEGIN = """\
__kernel void wamnet_update(
    __global const float16 *restrict sums,
    int groups,
    __global const float16 *restrict old,
    __global float16 *restrict moved,
    __global float *restrict transposed,
    __global float *restrict losses,
    __global int *restrict failed,
    int at,
    int step,
    float learning_rate_number,
    float grown_1_number,
    float grown_2_number)
{
    const int i = (int)get_global_id(0);
    if (i >= COUNT || failed[0] >= 0) {
        return;
    }
    /* The loss: every work item adds the same numbers in the same order. */
    float loss = 0.0f;
    for (int j = 0; j < SUMS - COUNT; ++j) {
        float16 squares = sums[COUNT + j];
        for (int n = 1; n < groups; ++n) {
            squares += sums[n * SUMS + COUNT + j];
        }
        const float8 s8 = squares.lo + squares.hi;
        const float4 s4 = s8.lo + s8.hi;
        loss += s4.s0 + s4.s1 + s4.s2 + s4.s3;
    }
    loss /= LOSS_TERMS;
    if (i == 0) {
        losses[at] = loss;
    }
    if ((as_int(loss) & 0x7f800000) == 0x7f800000) {
        if (i == 0) {
            failed[0] = step;
        }
        return;
    }
"""
"""The second kernel up to the derivative."""

UPDATE_ADAM = """\
    const float16 theta = old[i], m = old[COUNT + i], v = old[2 * COUNT + i];
    const float16 learning_rate = learning_rate_number, grown_1 = grown_1_number, grown_2 = grown_2_number;
"""
"""What follows the derivative, up to Adam."""

SLOPES = """\
    float16 g = sums[i];
    for (int n = 1; n < groups; ++n) {
        g += sums[n * SUMS + i];
    }
"""
"""The derivative: the sum over all work items."""

SLOPES_SPLIT = """\
    /* Factors move in place of their product, vectors PRODUCT to PRODUCT_END; theirs is one sum already. */
    if (i >= PRODUCT && i < PRODUCT_END) {
        return;
    }
    float16 g = sums[i];
    for (int n = 1; n < groups && i < FACTORS; ++n) {
        g += sums[n * SUMS + i];
    }
"""
"""The same where a matrix is trained through its factors [emit_factors.py]."""


def step_text(step: Step, form: WindowForm, dialect: Vectors, helpers: Sequence[str]) -> tuple[str, int]:
    """Return the first kernel, with the definitions of both, and the vectors of memory of a work item."""
    body = _Step(step, form, dialect)
    lines = body.text()
    places = slots(step)
    count = places[SQUARES].offset
    defines = {
        "TILE": TILE,
        "EXAMPLES": EXAMPLES,
        "BATCH": step.batch,
        "WINDOW_SIZE": form.size,
        "WINDOW_RUN": form.run,
        "COUNT": count,
        "SUMS": places[SQUARES].end,
        "SCRATCH": body.scratch_vectors,
        "LOSS_TERMS": f"{float(step.batch * places[SQUARES].width)!r}f",
        **factor_defines(step),
    }
    begin = STEP_BEGIN.format(
        defines="\n".join(f"#define {name} {value}" for name, value in defines.items()),
        helpers="\n".join(helpers),
    )
    return begin + "\n".join([*lines, "    }", "}"]) + "\n", body.scratch_vectors


def update_text(step: Step, adam: Program, dialect: Vectors) -> str:
    """Return the second kernel: the sums of all work items, Adam, and the copies of transposed matrices."""
    lines = []
    for index, node in enumerate(adam.nodes):
        if node.op in ("input", "constant"):
            continue
        operands = [_number(adam.nodes[arg], arg, dialect) for arg in node.args]
        kind = adam.nodes[node.args[-1]].type.dtype
        lines.append(f"const float16 t{index} = {dialect.expression(node, kind, operands)};")
    ends = dict(adam.outputs)
    for position, name in enumerate(("theta", "m", "v")):
        lines.append(f"moved[{position} * COUNT + i] = t{ends[name]};")
    places, copies = slots(step), transposed_slots(step)
    for name, copy in copies.items():
        slot = places[name.removesuffix(TRANSPOSED)]
        lines.append(f"if (i >= {slot.offset} && i < {slot.end}) {{ /* {name} */")
        lines.append(f"    const int at_row = (i - {slot.offset}) / {slot.vectors};")
        lines.append(f"    const int neuron = (i - {slot.offset}) % {slot.vectors} * {LANES};")
        target = f"transposed[({copy.offset} + (neuron + {{}}) * {copy.vectors}) * {LANES} + at_row]"
        for lane in range(LANES):
            value = f"t{ends['theta']}.s{lane:x}"
            lines.append(f"    if (neuron + {lane} < {slot.width}) {target.format(lane)} = {value};")
        lines.append("}")
    begin = UPDATE_BEGIN + (SLOPES if step.split is None else SLOPES_SPLIT) + UPDATE_ADAM
    return begin + "\n".join(f"    {line}" for line in lines) + "\n}\n"


def _number(node: Node, index: int, dialect: Vectors) -> str:
    """Return the text of a value of Adam's program."""
    if node.op == "input":
        return str(node["name"])
    return dialect.constant(node) if node.op == "constant" else f"t{index}"
