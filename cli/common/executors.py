"""The executor that a command runs on: the one that is named, or the fastest available."""

from ...kernels.devices import registry
from .terminal import say


def chosen(executor: str, *, because: str = "", trains: bool = False, work: str = "executor") -> str:
    """Return the name of an executor; of `auto` the fastest one, which is printed with the reason.

    `because`: why NumPy must do the work, if it must. `trains`: the executor has to train.
    """
    return fastest(because=because, trains=trains, work=work) if executor == "auto" else executor


def fastest(*, because: str = "", trains: bool = False, work: str = "executor") -> str:
    """Return the fastest executor; print it, and why each faster one is passed over."""
    name, passed = ("numpy", []) if because else registry.fastest(trains)
    for reason in passed:
        say(f"not {reason}")
    say(f"{work} {name}: {because or 'the fastest available'}")
    return name
