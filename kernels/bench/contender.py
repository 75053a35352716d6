"""What takes part in the benchmark: a contender is data until it is opened for a model and a size.

A contender that computes the network's function says which program it computes ([`Variant`]); its error is
against the full network in float64, whatever it leaves out. Another denoiser has no error, only a quality.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler import variants
from ...compiler.core import profiles, sine
from ...compiler.core.ir import Program
from ...compiler.core.lower import lower
from ...compiler.variants import parse, vary
from ...refimpl.errors import ExecutorUnavailable
from ...refimpl.network.denoise import Model
from ..devices.executor import Executor
from ..devices.registry import open_executor
from .cost import Stage
from .workload import Given

Array = NDArray[Any]

NO_CACHE = "nothing is kept"
"""What stays on disk of code that a contender compiles, if it compiles any."""

IEEE = "ieee"
"""Profile of kernels, unless a variant has another."""

MACHINE = "machine"
"""Name of the rates of contenders that have none of their own: those of the machine."""


@dataclass(frozen=True, eq=False)
class Variant:
    """A form of the network that trades accuracy for speed: a rank, a profile, a model trained as the form.

    `model` None: the benchmark's own; `steps`: how many steps the model was trained on from that one. `made`:
    the variant that is made of it [compiler/variants.py].
    """

    name: str
    text: str
    rank: int = 0
    profile: str = IEEE
    model: Model | None = None
    steps: int = 0
    made: str = variants.FULL

    def of(self, model: Model) -> Model:
        """Return the network that is run when `model` is the benchmark's."""
        found = self.model or model
        return found if self.made == variants.FULL else vary(parse(self.made), found).model

    def program(self, model: Model) -> Program:
        """Return what the form computes when `model` is the benchmark's, without its rank."""
        return lower(self.of(model))

    def facts(self, model: Model) -> dict[str, Any]:
        """Return profile, degree of the sine, rank, window, parameters and steps of training."""
        found = self.of(model)
        return {
            "profile": self.profile,
            "degree": degree_of(self.profile),
            "rank": self.rank or None,
            "window": found.window.size,
            "parameters": parameters_of(found, self.rank),
            "trained_steps": self.steps or None,
        }


def degree_of(profile: str) -> int | None:
    """Return the degree of a profile's sine; None for the target's own."""
    if profiles.profile_named(profile).sine is None:
        return None
    return int(profile.partition(profiles.DEGREE_WORD)[2] or sine.DEGREE)


def activation_in(library: str, table: Mapping[str, Any], model: Model) -> Any:
    """Return what a library has for the model's activation, from a table by the names of activations."""
    name = model.siren.activation
    if name not in table:
        raise ExecutorUnavailable(f"{library} has no implementation of {name}, only of {', '.join(table)}")
    return table[name]


def parameters_of(model: Model, rank: int = 0) -> int:
    """Return how many numbers a network has; of a first layer of a rank those of its two factors."""
    weights, biases = model.siren.weights, model.siren.biases
    others = sum(array.size for array in (*weights[1:], *biases))
    rows, columns = weights[0].shape
    size = model.window.size
    return int(others + (rank * (columns // size + size * rows) if rank else rows * columns))


FULL = Variant("full", "the whole network")
"""The network as it is."""


@dataclass(frozen=True)
class Opened:
    """A contender that is ready to be given frames; `run` returns the picture (H, W, 3).

    `display` turns what `run` returns into display-encoded colours, outside of what is timed. `stages` are
    what it does for a pixel [cost.py], `rates` the name of the rates that it has [`MACHINE` or its own].
    `kernel_seconds`: without copies to and from the device. `schedule`: the one that was picked,
    `bound`: what is proven for all images, `certified`: whether the proof is written out.
    """

    run: Callable[[Given], Array]
    device: str
    stages: tuple[Stage, ...] = ()
    source_bytes: int | None = None
    rates: str = MACHINE
    kernel_seconds: Callable[[Given], float] | None = None
    display: Callable[[Array], Array] = np.asarray
    close: Callable[[], None] = lambda: None
    schedule: str = ""
    bound: float | None = None
    certified: bool = False


@dataclass(frozen=True)
class Contender:
    """A way to denoise: its name, what it is in words, and how it is opened for a model and a size (px).

    `packages` must be installed; `variant` is None for another
    denoiser. `executor` names the kernels' executor, None for peers. `caches` says where compiled code stays.
    """

    name: str
    text: str
    open: Callable[[Tools, Model, int], Opened]
    variant: Variant | None = FULL
    executor: str | None = None
    schedule: str = ""
    packages: tuple[str, ...] = ()
    caches: str = NO_CACHE

    def missing(self) -> str:
        """Return what is missing for it and how to get it, or nothing."""
        absent = [name for name in self.packages if find_spec(name) is None]
        if not absent:
            return ""
        return f"not installed: {', '.join(absent)}; pip install {' '.join(absent)}"

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
