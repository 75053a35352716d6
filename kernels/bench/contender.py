"""What takes part in the benchmark: a contender is data until it is opened for a model and a size.

A contender that computes the network's function says which program it computes ([`Variant`]); its error is
against the full network in float64, whatever it leaves out. Another denoiser has no error, only a quality.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.ir import Program
from ...compiler.lower import lower
from ...refimpl.denoise import Model
from ...refimpl.errors import ExecutorUnavailable
from ..executor import Executor
from ..registry import open_executor
from .cost import Stage
from .workload import Given

Array = NDArray[Any]

NO_CACHE = "nothing is kept"
"""What stays on disk of code that a contender compiles, if it compiles any."""

MACHINE = "machine"
"""Name of the rates of contenders that have none of their own: those of the machine."""


@dataclass(frozen=True)
class Variant:
    """A form of the network that trades accuracy for speed: the program of a model, and a rank to cut it to.

    A new one is one of these in `contenders.VARIANTS`.
    """

    name: str
    text: str
    program: Callable[[Model], Program] = lower
    rank: int = 0


FULL = Variant("full", "the whole network")
"""The network as it is."""


@dataclass(frozen=True)
class Opened:
    """A contender that is ready to be given frames; `run` returns the picture (H, W, 3).

    `display` turns what `run` returns into display-encoded colours, outside of what is timed. `stages` are
    what it does for a pixel [cost.py], `rates` the name of the rates that it has [`MACHINE` or its own].
    `kernel_seconds`: the kernel alone, images and result on the device.
    """

    run: Callable[[Given], Array]
    device: str
    stages: tuple[Stage, ...] = ()
    source_bytes: int | None = None
    rates: str = MACHINE
    kernel_seconds: Callable[[Given], float] | None = None
    display: Callable[[Array], Array] = np.asarray
    close: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Contender:
    """A way to denoise: its name, what it is in words, and how it is opened for a model and a size (px).

    `packages` must be installed, and `extra` of this package brings them; `variant` is None for another
    denoiser. `executor` names the kernels' executor, None for peers. `caches` says where compiled code stays.
    """

    name: str
    text: str
    open: Callable[[Tools, Model, int], Opened]
    variant: Variant | None = FULL
    executor: str | None = None
    schedule: str = ""
    packages: tuple[str, ...] = ()
    extra: str = "peers"
    caches: str = NO_CACHE

    def missing(self) -> str:
        """Return what is missing for it and how to get it, or nothing."""
        absent = [name for name in self.packages if find_spec(name) is None]
        if not absent:
            return ""
        return f"not installed: {', '.join(absent)}; pip install 'wamnet[{self.extra}]'"

    def prepare(self, tools: Tools) -> None:
        """Import the packages and open the executor, which is not compiling; or raise ExecutorUnavailable."""
        if reason := self.missing():
            raise ExecutorUnavailable(reason)
        for package in self.packages:
            importlib.import_module(package)
        if self.executor:
            tools.executor(self.executor)


@dataclass
class Tools:
    """Executors that contenders share, each opened once; a context manager that closes them."""

    executors: dict[str, Executor] = field(default_factory=dict)
    made: ExitStack = field(default_factory=ExitStack)

    def executor(self, name: str) -> Executor:
        """Return an open executor, or raise ExecutorUnavailable."""
        if name not in self.executors:
            self.executors[name] = self.made.enter_context(open_executor(name))
        return self.executors[name]

    def __enter__(self) -> Tools:
        return self

    def __exit__(self, *_: object) -> None:
        self.made.close()


@contextmanager
def told_as_missing(name: str) -> Iterator[None]:
    """Turn what a peer's package raises while it is opened into ExecutorUnavailable: its own errors vary."""
    try:
        yield
    except (KeyboardInterrupt, ExecutorUnavailable, MemoryError):
        raise
    except Exception as error:
        lines = str(error).strip().splitlines() or [type(error).__name__]
        raise ExecutorUnavailable(f"{name} does not run here: {lines[0]}") from error
