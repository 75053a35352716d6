"""What a host is: a row of [table.py]; and how far off a picture may be that has been in its storage."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ....refimpl.errors import NO_VALUE, InputError

FILES = Path(__file__).parent / "files"
"""A folder for each host, and one for what several share."""

SHARED = "pages"
"""The latter."""

PYTHON = ".py"
"""Programs in Python have .txt behind their names there: they are data, and no part of this package."""


@dataclass(frozen=True)
class Storage:
    """What holds a picture before it is read: `added` is what it adds to the error of a number in [0, 1]."""

    name: str
    added: float
    why: str


FLOAT32 = Storage("32-bit floats", 0.0, "it holds what the kernel computes")
"""The check pair's own."""

HALF = Storage(
    "16-bit floats", 2.0**-11, "numbers of [1/2, 1] are 2^-11 apart, and may be rounded either way"
)
"""A viewport with HDR 2D."""

EIGHT_BITS = Storage("8 bits", 1 / 255, "numbers are 1/255 apart, and may be rounded either way")
"""What a display shows."""


def _file(folder: str, name: str) -> bytes:
    """Return a file of a host."""
    return (FILES / folder / (f"{name}.txt" if name.endswith(PYTHON) else name)).read_bytes()


Written = Callable[[Mapping[str, Any]], str]
"""A file that follows from what the manifest says."""


def page(title: str, imports: tuple[str, str] | None = None) -> Mapping[str, Written]:
    """Return the page of a host; `imports`: what its module is called, and where npm puts it."""
    named = {imports[0]: f"./node_modules/{imports[1]}"} if imports else {}

    def write(facts: Mapping[str, Any]) -> str:
        text = _file(SHARED, "index.html").decode().replace("@host@", title)
        return text.replace("@imports@", json.dumps({"imports": named}))

    return {"index.html": write}


@dataclass(frozen=True)
class Host:
    """One host. `files`: names in its folder; `shared`: names in the folder of pages; `made`: written for it.

    `run`: commands of a shell in the export's folder; `needs`: what must be there; `sees`: what it draws.
    `scenes`, `ranks`: whether it runs kernels of paths, and a first layer in two kernels. `weights`,
    `schedule`: those that it wants, where they are not the target's usual ones. `features`: those that it can
    make, where it makes them itself.
    """

    name: str
    text: str
    target: str
    files: Sequence[str]
    run: str
    needs: str
    sees: str
    shared: Sequence[str] = ()
    made: Mapping[str, Written] = field(default_factory=dict)
    storage: Storage = FLOAT32
    scenes: bool = False
    ranks: bool = True
    weights: str = ""
    schedule: str = ""
    features: Sequence[str] = ()

    def contents(self, facts: Mapping[str, Any]) -> dict[str, bytes]:
        """Return its files by name, for an export of which the manifest says `facts`."""
        found = {name: _file(self.name, name) for name in self.files}
        found |= {name: _file(SHARED, name) for name in self.shared}
        return found | {name: write(facts).encode() for name, write in self.made.items()}

    def facts(self) -> dict[str, Any]:
        """Return what a manifest says about it."""
        return {
            "name": self.name,
            "run": self.run,
            "storage": {"name": self.storage.name, "added": self.storage.added, "why": self.storage.why},
        }

    def check(
        self, scene: str | None, moving: bool, two_kernels: bool, variant: str, features: Sequence[str]
    ) -> None:
        """Refuse what it does not run."""
        lacking = [name for name in features if self.features and name not in self.features]
        if lacking:
            rule = f"are not available in host {self.name}, which has {', '.join(self.features)}"
            raise InputError("features of the model", ", ".join(lacking), rule, "train it with these")
        if scene is not None and not self.scenes:
            rule = f"is not supported by host {self.name}, which only denoises"
            raise InputError("--scene", scene, rule, "leave it out, or export with --target and no --host")
        if moving:
            rule = f"is not supported by host {self.name}, which renders one time"
            raise InputError(
                "--moving", NO_VALUE, rule, "leave it out, or export with --target and no --host"
            )
        if two_kernels and not self.ranks:
            rule = f"is not supported by host {self.name}: it has one pass, and a rank needs two"
            raise InputError("--variant", variant, rule, "leave the rank out, or choose another host")
