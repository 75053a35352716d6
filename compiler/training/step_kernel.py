"""The kernel of a training step: its launches as data, their source, and what they promise [`compile_step`].

1. Lower the reference's step and Adam [`lower_step.py`]; put the emitted sine and cosine in.
2. Build the launches: derivatives [derivatives.py], loss, factors and Adam [update.py].

Profile `ieee`: any order of summation, fused multiply-add, emitted sine. What the derivatives of one step may
be off is computed at given examples [`step.sum_errors`]. There is no bound for all weights that training may
reach: sine and cosine are proven only up to their domains, and beyond them the result means nothing.
"""

from __future__ import annotations

from dataclasses import replace

from ...refimpl.network.activation import SINE
from ..artifact import Artifact
from ..compile import Draft, assemble
from ..core import ir
from ..core.passes import pipeline
from ..core.profiles import PROFILES
from ..kernel.interface import BOTH, INTEGERS, READ, TRAIN, Array, Interface
from ..kernel.kernel import Constant, Kernel, const
from ..languages.renderer import Renderer
from ..targets import language_named
from .derivatives import Derivatives
from .lower_step import lower_step
from .step import SQUARES, Split, Step
from .step_layout import LANES, slots, transposed_slots
from .update import factors, loss, update

FIRST = "W0"
"""Name of the first layer's matrix in a step."""


def compile_step(
    widths: tuple[int, ...],
    omegas: tuple[float, float],
    batch: int,
    size: int,
    rank: int = 0,
    activation: str = SINE,
) -> Artifact:
    """Return the kernel that trains layers of `widths` on windows of `size` x `size` pixels.

    With a `rank` the factors of the first layer are what is trained.
    """
    split = Split(FIRST, size, rank) if rank else None
    return compile_lowered(replace(lower_step(widths, *omegas, batch, activation), split=split), size)


def compile_lowered(step: Step, size: int) -> Artifact:
    """Return the kernel of a step; its window has `size` runs. Its `programs` are the step, analysed."""
    dialect, profile, digest = language_named("opencl").dialect, PROFILES["ieee"], ir.digest(step.program)
    renderer = Renderer(dialect, step_kernel(step, size), False)
    draft = Draft(
        "training step",
        profile,
        renderer,
        [("", step.program)],
        [("program", [digest[:32]])],
        "by the launches of the kernel: see spec/train_kernel.md",
        {"program": digest, "passes": profile.passes},
        step,
    )
    return assemble(draft)


def step_kernel(step: Step, size: int) -> Kernel:
    """Return the kernel of a step; its window has `size` runs."""
    first = Derivatives(replace(step, program=pipeline.run(step.program, PROFILES["ieee"].passes)), size)
    copies = max((slot.end for slot in transposed_slots(step).values()), default=1)
    count, end = slots(step)[SQUARES].offset, slots(step)[SQUARES].end
    integers = {"BATCH": step.batch, "COUNT": count, "SUMS": end, "SCRATCH": first.vectors}
    launches = first.launch(), *factors(step)[:2], loss(step), update(step), *factors(step)[2:]
    arrays = (
        Array("values", READ, ("values",)),
        Array("targets", READ, ("targets",)),
        Array("places", READ, (3 * step.batch,), dtype="int32"),
        Array("rates", READ, ("rates",)),
        Array("old", READ, (3 * count,), lanes=LANES),
        Array("moved", BOTH, (3 * count,), lanes=LANES),
        Array("transposed", BOTH, (copies,), lanes=LANES),
        Array("scratch", BOTH, ("groups", first.vectors), lanes=LANES),
        Array("sums", BOTH, ("groups", end), lanes=LANES),
        Array("losses", BOTH, ("losses",)),
        Array("failed", BOTH, (1,), dtype="int32"),
    )
    constants = tuple(Constant(key, const(value)) for key, value in integers.items())
    interface = Interface(TRAIN, arrays, INTEGERS[TRAIN])
    return Kernel(interface, launches, constants, step=(const(LANES), const(1)))
