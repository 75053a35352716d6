"""A training run's numbers on an OpenCL device, and its steps one after another.

1. Pictures and targets are copied once; parameters and moments when a run begins [`OpenCLTrainer.load`].
2. A block of steps is put into the queue with its minibatches [`OpenCLTrainer.enqueue`]; the host may draw
   the next block meanwhile. Waiting for it gives the losses [`OpenCLTrainer.finish`].
3. Parameters and moments have two copies: a step reads one and writes the other. After a loss that is
   not finite nothing is written any more, so that the last two states remain [`OpenCLTrainer.state`].
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyopencl as cl
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.core.passes.gradient import TRANSPOSED
from ...compiler.kernel.kernel import Kernel, Launch, const, substituted
from ...compiler.kernel.sizes import integer
from ...compiler.training.step import SQUARES
from ...compiler.training.step_kernel import TILE
from ...compiler.training.step_layout import LANES, pack, slots, transposed_slots, unpack
from ...refimpl.errors import InputError
from .executor import INDEX_LIMIT

Arrays = Mapping[str, NDArray[np.float32]]
Size = tuple[int, ...]

LEAST_GROUPS = 8
"""Work items of the first kernel: more than most processors have cores, so that one that is disturbed by
other work does less; each has sums of its own, which cost memory and are added up in the end."""

MANY, GROUP_SIZE = 256, 16
"""A launch of so many work items has groups of so many; all others have groups of one."""


class OpenCLTrainer:
    """One training run on a device; `program` is the built source of `kernel`."""

    def __init__(
        self, queue: Any, program: Any, kernel: Artifact, values: NDArray[Any], targets: NDArray[Any]
    ) -> None:
        self._queue, self._context = queue, queue.context
        self._places, self._copies = slots(kernel.programs), transposed_slots(kernel.programs)
        device = queue.device
        if values.size >= INDEX_LIMIT or values.nbytes > device.max_mem_alloc_size:
            raise InputError(
                "values of all training images",
                values.size,
                f"the device takes fewer than {INDEX_LIMIT}, in at most {device.max_mem_alloc_size} bytes",
                "train on fewer or smaller frames, or with executor numpy",
            )
        self._groups = min(max(LEAST_GROUPS, device.max_compute_units), -(-kernel.programs.batch // TILE))
        self._trained = {name: slot for name, slot in self._places.items() if name != SQUARES}
        shared, sizes = [each for each in kernel.kernel.interface.both if each.name != "losses"], {}
        for array in shared:
            count = math.prod(self._groups if n == "groups" else int(n) for n in array.shape)
            sizes[array.name] = 4 * array.lanes * count
        self._states = [self._empty(sizes["moved"]) for _ in range(2)]
        self._arrays = {"values": self._upload(values), "targets": self._upload(targets)}
        self._arrays |= {name: self._empty(size) for name, size in sizes.items() if name != "moved"}
        self._launches = [self._launch(program, kernel.kernel, each) for each in kernel.kernel.launches]
        # The block in the queue: its first step, its losses, the minibatches of the steps put there so far.
        self._block: tuple[int, Any, list[Any]] = (0, self._empty(4), [])

    def _launch(self, program: Any, kernel: Kernel, launch: Launch) -> tuple[Any, Size, Size, Sequence[str]]:
        """Return a launch's function, its items in all and in a group, and the names of its arguments."""
        interface, groups = kernel.interface_of(launch), {"groups": const(self._groups)}
        counts = [integer(kernel, substituted(count, groups)) for count in launch.counts]
        size = GROUP_SIZE if math.prod(counts) >= MANY else 1
        every = -(-counts[0] // size) * size, *counts[1:]
        arguments = (*(array.name for array in interface.arrays), *interface.integers)
        return getattr(program, f"wamnet_{launch.name}"), every, (size, *(1 for _ in counts[1:])), arguments

    def load(self, step: int, theta: Arrays, m: Arrays, v: Arrays) -> None:
        """Put parameters and moments by name on the device, as they are before `step`."""
        numbers = np.concatenate([pack(self._trained, arrays) for arrays in (theta, m, v)])
        cl.enqueue_copy(self._queue, self._states[step % 2], numbers)
        copied = {name: theta[name.removesuffix(TRANSPOSED)].T for name in self._copies}
        if copied:
            cl.enqueue_copy(self._queue, self._arrays["transposed"], pack(self._copies, copied))
        cl.enqueue_copy(self._queue, self._arrays["failed"], np.array([-1], np.int32))
        self._block = (step, self._empty(4), [])

    def enqueue(
        self, step: int, places: NDArray[np.int32], numbers: Sequence[tuple[float, float, float]]
    ) -> None:
        """Put steps into the queue: places (steps, 3, batch), and each step's rate and growths."""
        losses, drawn_so_far = self._empty(4 * len(numbers)), list[Any]()
        # One assignment: an interrupt finds the old block or the new one, never a part of both.
        self._block = (step, losses, drawn_so_far)
        block = {"losses": losses, "rates": self._upload(np.array(numbers, np.float32))}
        for at, minibatch in enumerate(places):
            old, moved = self._states[(step + at) % 2], self._states[(step + at + 1) % 2]
            drawn = {**block, "places": self._upload(minibatch), "old": old, "moved": moved}
            integers = {"groups": self._groups, "at": at, "step": step + at}
            values = {**self._arrays, **drawn, **{key: np.int32(value) for key, value in integers.items()}}
            for function, every, group, arguments in self._launches:
                function(self._queue, every, group, *(values[name] for name in arguments))
            drawn_so_far.append(drawn)
        self._queue.flush()

    def finish(self) -> tuple[int, NDArray[np.float32], int | None]:
        """Wait; return first step and losses of the last block, and the step whose loss is not finite.

        May be called again: an interrupt in the wait loses nothing.
        """
        step, buffer, drawn = self._block
        losses, failed = np.zeros(max(len(drawn), 1), np.float32), np.zeros(1, np.int32)
        cl.enqueue_copy(self._queue, losses, buffer)
        cl.enqueue_copy(self._queue, failed, self._arrays["failed"])
        return step, losses[: len(drawn)], None if failed[0] < 0 else int(failed[0])

    def state(self, step: int) -> tuple[Arrays, Arrays, Arrays]:
        """Return parameters and moments by name before `step`: the one reached, or the one before it."""
        numbers = np.empty(3 * self._places[SQUARES].offset * LANES, np.float32)
        cl.enqueue_copy(self._queue, numbers, self._states[step % 2])
        theta, m, v = (unpack(self._trained, part) for part in np.split(numbers, 3))
        return theta, m, v

    def _upload(self, array: NDArray[Any]) -> Any:
        """Return a device buffer with the array's content."""
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        return cl.Buffer(self._context, flags, hostbuf=np.ascontiguousarray(array))

    def _empty(self, count: int) -> Any:
        """Return a device buffer of so many bytes."""
        return cl.Buffer(self._context, cl.mem_flags.READ_WRITE, max(count, 4))
