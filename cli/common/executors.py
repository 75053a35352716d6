"""The executor that a command runs on: the one that is named, or the fastest available."""

from ...kernels.devices import registry
from .terminal import say


def chosen(executor: str = "auto", *, because: str = "", trains: bool = False, work: str = "executor") -> str:
    """Return the name of an executor; of `auto` the fastest, printed with why others are passed over.

    `because`: why NumPy must do the work, if it must. `trains`: the executor has to train.
    """
    if executor != "auto":
        return executor
    name, passed = ("numpy", []) if because else registry.fastest(trains)
    for reason in passed:
        say(f"not {reason}")
    say(f"{work} {name}: {because or 'the fastest available'}")
    return name
