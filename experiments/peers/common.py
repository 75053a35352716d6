"""What peers share: errors, the stages of a network that runs layer by layer, and makers of pictures."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Protocol

from wamnet.kernels.bench.contenders import Contender, Tools
from wamnet.kernels.bench.rates import FLOAT_BYTES, Stage
from wamnet.kernels.measure import Entry, begin, take_turns
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.network.activation import SINE
from wamnet.refimpl.network.dataset import channels_of
from wamnet.refimpl.network.denoise import Model


@dataclass(frozen=True)
class Peer(Contender):
    """A denoiser of others, whose `packages` must be installed."""

    packages: tuple[str, ...] = ()

    def missing(self) -> str:
        """Return what is missing for it and how to get it, or nothing."""
        absent = [name for name in self.packages if find_spec(name) is None]
        if not absent:
            return ""
        return f"not installed: {', '.join(absent)}; pip install {' '.join(absent)}"

    def prepare(self, tools: Tools) -> None:
        """Import the packages, which is not compiling."""
        if reason := self.missing():
            raise ExecutorUnavailable(reason)
        for package in self.packages:
            importlib.import_module(package)


@contextmanager
def told_as_missing(name: str) -> Iterator[None]:
    """Turn what a peer's package raises while it is opened into ExecutorUnavailable: its own errors vary."""
    try:
        yield
    except (KeyboardInterrupt, ExecutorUnavailable, MemoryError):
        raise
    except Exception as error:
        lines = str(error).strip().splitlines() or [type(error).__name__]
        raise ExecutorUnavailable(f"{name} cannot run here: {lines[0]}") from error


def activation_in(library: str, table: Mapping[str, Any], model: Model) -> Any:
    """Return what a library has for the model's activation, from a table by the names of activations."""
    name = model.siren.activation
    if name not in table:
        raise ExecutorUnavailable(f"{library} has no implementation of {name}, only of {', '.join(table)}")
    return table[name]


def layered(model: Model, fuses: bool) -> tuple[Stage, ...]:
    """Return the stages of a library that runs a network layer by layer, each reading and writing memory.

    `fuses`: factor and sine are one pass over the numbers of a layer, and not two.
    """
    widths, stages = model.siren.widths, []
    read = channels_of(model.features)
    for layer, weight in enumerate(model.siren.weights):
        neurons = widths[layer + 1]
        stages.append(Stage(weight.size, 0, FLOAT_BYTES * (read + neurons)))
        elementwise = Stage(0, 0, FLOAT_BYTES * 2 * neurons)
        if layer < len(model.siren.weights) - 1:
            stages += [] if fuses else [elementwise]
            sines = neurons if model.siren.activation == SINE else 0
            stages.append(Stage(0, sines, elementwise.bytes))
        else:
            stages.append(elementwise)
        read = neurons
    return tuple(stages)


Ways = Mapping[str, Callable[[], Any]]
"""What is measured, by name; a float that is returned is the seconds."""


class Maker(Protocol):
    """What makes pictures of a scene that moves."""

    @property
    def about(self) -> str:
        """Return in words what it is, with versions."""

    def ways(self, shots: Sequence[Scene]) -> Ways:
        """Return what is measured, by name; pictures show the scenes one after another."""

    def close(self) -> None:
        """Give back what it holds."""


def measure(
    entries: Sequence[Entry],
    repeats: int,
    warm: int = 1,
    pause_s: float = 0.0,
    done: Callable[[], None] = lambda: None,
) -> None:
    """Open all entries, and let them work in turn; `done` is called after each."""
    begin(entries, warm, done)
    take_turns(entries, repeats, pause_s, done)
