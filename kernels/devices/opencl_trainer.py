"""A training run's numbers on an OpenCL device, and its steps one after another.

1. Pictures and targets are copied once; parameters and moments when a run begins [`OpenCLTrainer.load`].
2. A block of steps is put into the queue with its minibatches [`OpenCLTrainer.enqueue`]; the host may draw
   the next block meanwhile. Waiting for it gives the losses [`OpenCLTrainer.finish`].
3. Parameters and moments have two copies: a step reads one and writes the other. After a loss that is
   not finite nothing is written any more, so that the last two states remain [`OpenCLTrainer.state`].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from ...compiler.training.emit_factors import KERNELS
from ...compiler.training.emit_step import TILE
from ...compiler.training.step import SQUARES, TRANSPOSED
from ...compiler.training.step_kernel import StepKernel
from ...compiler.training.step_layout import LANES, pack, unpack
from ...refimpl.errors import InputError

Arrays = Mapping[str, NDArray[np.float32]]

LEAST_GROUPS = 8
"""Work items of the first kernel: more than most processors have cores, so that one that is disturbed by
other work does less; each has sums of its own, which cost memory and are added up in the end."""

UPDATE_SIZE = 16
"""Work items in a group of the second kernel."""

INDEX_LIMIT = 2**31
"""Numbers of all pictures together must be fewer: the kernel's indices are `int`."""


class OpenCLTrainer:
    """One training run on a device; `program` is the built source of `kernel`."""

    def __init__(
        self, queue: Any, program: Any, kernel: StepKernel, values: NDArray[Any], targets: NDArray[Any]
    ) -> None:
        self._queue, self._context, self._kernel = queue, queue.context, kernel
        self._step, self._update = program.wamnet_step, program.wamnet_update
        self._factors = [getattr(program, name) for name in KERNELS] if kernel.step.split else []
        device = queue.device
        if values.size >= INDEX_LIMIT or values.nbytes > device.max_mem_alloc_size:
            raise InputError(
                "values of all training images",
                values.size,
                f"the device takes fewer than {INDEX_LIMIT}, in at most {device.max_mem_alloc_size} bytes",
                "train on fewer or smaller frames, or with executor numpy",
            )
        self._count = kernel.places[SQUARES].offset
        batch = kernel.step.batch
        self._groups = min(max(LEAST_GROUPS, device.max_compute_units), -(-batch // TILE))
        self._values, self._targets = self._upload(values), self._upload(targets)
        vector = 4 * LANES
        self._states = [self._empty(3 * self._count * vector) for _ in range(2)]
        copies = max((slot.end for slot in kernel.copies.values()), default=1)
        self._transposed = self._empty(copies * vector)
        self._scratch = self._empty(self._groups * kernel.scratch_vectors * vector)
        self._sums = self._empty(self._groups * kernel.places[SQUARES].end * vector)
        self._failed = self._empty(4)
        # The block in the queue: its first step, its losses, the minibatches of the steps put there so far.
        self._block: tuple[int, Any, list[Any]] = (0, self._empty(4), [])
        self._trained = {name: slot for name, slot in kernel.places.items() if name != SQUARES}

    def load(self, step: int, theta: Arrays, m: Arrays, v: Arrays) -> None:
        """Put parameters and moments by name on the device, as they are before `step`."""
        numbers = np.concatenate([pack(self._trained, arrays) for arrays in (theta, m, v)])
        cl.enqueue_copy(self._queue, self._states[step % 2], numbers)
        copied = {name: theta[name.removesuffix(TRANSPOSED)].T for name in self._kernel.copies}
        if copied:
            cl.enqueue_copy(self._queue, self._transposed, pack(self._kernel.copies, copied))
        cl.enqueue_copy(self._queue, self._failed, np.array([-1], np.int32))
        self._block = (step, self._empty(4), [])

    def enqueue(
        self, step: int, places: NDArray[np.int32], numbers: Sequence[tuple[float, float, float]]
    ) -> None:
        """Put steps into the queue: places (steps, 3, batch), and each step's rate and growths."""
        losses, drawn_so_far = self._empty(4 * len(numbers)), list[Any]()
        # One assignment: an interrupt finds the old block or the new one, never a part of both.
        self._block = (step, losses, drawn_so_far)
        for at, (minibatch, rates) in enumerate(zip(places, numbers, strict=True)):
            drawn = self._upload(minibatch)
            old, moved = self._states[(step + at) % 2], self._states[(step + at + 1) % 2]
            self._step(
                self._queue, (self._groups,), (1,), self._values, self._targets, drawn, old, self._transposed,
                self._scratch, self._sums, self._failed,
            )  # fmt: skip
            self._slopes(old)
            size = -(-self._count // UPDATE_SIZE) * UPDATE_SIZE
            self._update(
                self._queue, (size,), (UPDATE_SIZE,), self._sums, np.int32(self._groups), old, moved,
                self._transposed, losses, self._failed, np.int32(at), np.int32(step + at),
                *map(np.float32, rates),
            )  # fmt: skip
            self._expand(moved)
            drawn_so_far.append(drawn)
        self._queue.flush()

    def _slopes(self, old: Any) -> None:
        """Start the kernels of the factors' derivatives, if the first weights have factors."""
        if (split := self._kernel.step.split) is not None:
            product, horizontal = (self._kernel.places[name] for name in (split.parameter, split.factors[1]))
            sizes = (split.size * product.vectors,), (horizontal.rows,)
            self._factors[0](self._queue, sizes[0], (1,), self._sums, np.int32(self._groups), old)
            self._factors[1](self._queue, sizes[1], (1,), self._sums, old)

    def _expand(self, moved: Any) -> None:
        """Start the product of the moved factors, if there are any."""
        if (split := self._kernel.step.split) is not None:
            rows = self._kernel.places[split.parameter].rows
            self._factors[2](self._queue, (rows,), (split.size,), moved, self._failed)

    def finish(self) -> tuple[int, NDArray[np.float32], int | None]:
        """Wait; return first step and losses of the last block, and the step whose loss is not finite.

        May be called again: an interrupt in the wait loses nothing.
        """
        step, buffer, drawn = self._block
        losses, failed = np.zeros(max(len(drawn), 1), np.float32), np.zeros(1, np.int32)
        cl.enqueue_copy(self._queue, losses, buffer)
        cl.enqueue_copy(self._queue, failed, self._failed)
        return step, losses[: len(drawn)], None if failed[0] < 0 else int(failed[0])

    def state(self, step: int) -> tuple[Arrays, Arrays, Arrays]:
        """Return parameters and moments by name before `step`: the one reached, or the one before it."""
        numbers = np.empty(3 * self._count * LANES, np.float32)
        cl.enqueue_copy(self._queue, numbers, self._states[step % 2])
        theta, m, v = (unpack(self._trained, part) for part in np.split(numbers, 3))
        return theta, m, v

    def sums(self) -> dict[str, NDArray[np.float32]]:
        """Return the sums of the last step, by parameter; work items are added in their order."""
        end = self._kernel.places[SQUARES].end
        found = np.empty((self._groups, end * LANES), np.float32)
        cl.enqueue_copy(self._queue, found, self._sums)
        if (split := self._kernel.step.split) is not None:
            # These are one sum already, in the first work item's slot.
            for slot in (self._kernel.places[name] for name in (split.parameter, *split.factors)):
                found[1:, slot.offset * LANES : slot.end * LANES] = 0
        return unpack(self._kernel.places, np.add.accumulate(found, axis=0)[-1])

    def _upload(self, array: NDArray[Any]) -> Any:
        """Return a device buffer with the array's content."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._context, flags, hostbuf=np.ascontiguousarray(array))

    def _empty(self, count: int) -> Any:
        """Return a device buffer of so many bytes."""
        return cl.Buffer(self._context, cl.mem_flags.READ_WRITE, max(count, 4))
