"""The kernels of a training step for OpenCL: source, layout, and what they promise [`compile_step`].

1. Lower the reference's step and Adam [`lower_step.py`]; put the emitted sine and cosine in.
2. Emit both kernels [`emit_step.py`], and those of a first layer of low rank [`emit_factors.py`].

Profile `ieee`: any order of summation, fused multiply-add, emitted sine. What the derivatives of one step may
be off is computed at given examples [`step.sum_errors`]. There is no bound for all weights that training may
reach: sine and cosine are proven only up to their domains, and beyond them the result means nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from ...refimpl.network.activation import SINE
from ..core import ir
from ..core.ir import Program
from ..core.passes import pipeline
from ..core.profiles import PROFILES
from .emit_factors import factors_text
from .emit_step import WindowForm, step_text, update_text
from .lower_step import lower_adam, lower_step
from .step import Split, Step
from .step_layout import LANES, Slot, slots, transposed_slots
from .vectors import Vectors

FIRST = "W0"
"""Name of the first layer's matrix in a step."""


@dataclass(frozen=True)
class StepKernel:
    """All kernels; `step` is the analysed one, `adam` the program of one number.

    `places` are the slots of parameters, `copies` those of transposed matrices; `scratch_vectors` is the
    memory of a work item.
    """

    source: str
    step: Step
    adam: Program
    places: Mapping[str, Slot]
    copies: Mapping[str, Slot]
    scratch_vectors: int

    @property
    def digest(self) -> str:
        """Return the hash that names the kernels."""
        return ir.sha256(self.source.encode())


def compile_step(
    widths: tuple[int, ...],
    omegas: tuple[float, float],
    batch: int,
    size: int,
    rank: int = 0,
    activation: str = SINE,
) -> StepKernel:
    """Return the kernels that train layers of `widths` on windows of `size` x `size` pixels.

    With a `rank` the factors of the first layer are what is trained.
    """
    step = lower_step(widths, *omegas, batch, activation)
    if rank:
        step = replace(step, split=Split(FIRST, size, rank))
    return compile_lowered(step, size)


def compile_lowered(step: Step, size: int) -> StepKernel:
    """Return the kernels of a step; its window has `size` runs."""
    dialect = Vectors(LANES)
    emitted = replace(step, program=pipeline.run(step.program, PROFILES["ieee"].passes))
    operations = {node.op for node in emitted.program.nodes}
    helpers = list(dict.fromkeys(text for op, text in dialect.helpers.items() if op in operations))
    (n_in,) = next(node.type.shape for node in step.program.nodes if node.op == "input")
    form = WindowForm(size, n_in // size)
    text, scratch_vectors = step_text(emitted, form, dialect, helpers)
    adam = lower_adam()
    header = (
        "/*\n * wamnet training step, OpenCL C 1.2. Generated: change the compiler, not this text.\n"
        f" * program   {ir.digest(step.program)[:32]}\n */\n"
    )
    source = header + text + "\n" + update_text(step, adam, dialect)
    if step.split is not None:
        source += "\n" + factors_text()
    return StepKernel(source, step, adam, slots(step), transposed_slots(step), scratch_vectors)
