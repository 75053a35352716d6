"""Other programs that are measured too: the distribution `wamnet-peers` hands them over by an entry point."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Protocol

from ...refimpl.errors import ExecutorUnavailable
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings

if TYPE_CHECKING:
    from .pipelines import Maker

GROUP = "wamnet.peers"
"""Group of the entry point, whose value is a module with the names of [`Table`]."""

Renderer = Callable[[Scene, int, int, Settings], Callable[[int, int], Any]]
"""From a scene, width, height and settings to what renders it, by the number of samples and a seed."""


class Table(Protocol):
    """All peers: denoisers, renderers, makers of whole pictures from a scene and a size, and a trainer."""

    contenders: tuple[Any, ...]
    renderers: Mapping[str, Renderer]
    makers: Mapping[str, Callable[[Scene, int], Maker]]
    trainer: Callable[..., Callable[[int], None]]


def table() -> Table:
    """Return the peers; ExecutorUnavailable says that they are not installed."""
    for entry in entry_points(group=GROUP):
        found: Table = entry.load()
        return found
    raise ExecutorUnavailable("the baselines are not installed: pip install wamnet-peers")


def contenders() -> tuple[Any, ...]:
    """Return the denoisers among the peers [`contenders.Contender`]; none where they are not installed."""
    try:
        return table().contenders
    except ExecutorUnavailable:
        return ()
