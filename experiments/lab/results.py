"""What an experiment has found, as JSON: one record for each configuration and seed.

1. A file belongs to one experiment with one set of settings; another one's is refused [`Results.open`].
2. A record is added in one step of the file system, under a lock: an interrupted run loses what it was at
   work on and nothing else, and two runs may share a file [`Results.put`].
3. Configurations and seeds without a record are worked on, in order [`fill`].
4. The records of one configuration have a mean and a standard deviation over the seeds [`Summary`].
"""

from __future__ import annotations

import fcntl
import json
import math
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wamnet.cli import machine
from wamnet.cli.outputs import write_text
from wamnet.cli.terminal import hint_on_interrupt, progress
from wamnet.refimpl.errors import InputError

SCHEMA = "wamnet-experiment-1"
"""Name and version of the form of a file of results."""

Values = Mapping[str, Any]
"""What was found for one configuration and seed, by name: numbers, texts, lists of them."""


@dataclass(frozen=True)
class Summary:
    """The mean of a number over seeds, and the standard deviation of one of them; NaN for a lone one."""

    mean: float
    deviation: float
    count: int

    def text(self, digits: int = 2) -> str:
        """Return `mean ± deviation` with so many digits after the point."""
        if not math.isfinite(self.deviation):
            return f"{self.mean:.{digits}f}"
        return f"{self.mean:.{digits}f} ± {self.deviation:.{digits}f}"


def summary(values: Sequence[float]) -> Summary:
    """Return the mean of some numbers, and their sample standard deviation."""
    spread = statistics.stdev(values) if len(values) > 1 else math.nan
    return Summary(statistics.fmean(values), spread, len(values))


@dataclass(frozen=True)
class Results:
    """A file of results and what it was made with."""

    path: Path
    experiment: str
    settings: Mapping[str, Any]

    @classmethod
    def open(cls, path: Path, experiment: str, settings: Mapping[str, Any]) -> Results:
        """Return the file's results, a new file if there is none; refuse one of something else."""
        found = cls(path, experiment, json.loads(json.dumps(settings)))
        path.parent.mkdir(parents=True, exist_ok=True)
        with found._locked():
            if not path.exists():
                found._write([])
            found._records()
        return found

    def records(self) -> list[dict[str, Any]]:
        """Return all records: `configuration`, `seed`, and `values`."""
        return self._records()

    def get(self, configuration: str, seed: int) -> Values | None:
        """Return what was found, or None."""
        for record in self._records():
            if (record["configuration"], record["seed"]) == (configuration, seed):
                values: Values = record["values"]
                return values
        return None

    def put(self, configuration: str, seed: int, values: Values) -> None:
        """Add a record, in place of an older one of this configuration and seed."""
        with self._locked():
            key = (configuration, seed)
            kept = [r for r in self._records() if (r["configuration"], r["seed"]) != key]
            self._write([*kept, {"configuration": configuration, "seed": seed, "values": dict(values)}])

    def configurations(self) -> list[str]:
        """Return the configurations that have a record, in the order of their first ones."""
        return list(dict.fromkeys(record["configuration"] for record in self._records()))

    def of(self, configuration: str, name: str) -> list[Any]:
        """Return a value of all records of a configuration that have it, by seed."""
        found = sorted(self._records(), key=lambda record: record["seed"])
        mine = [r["values"] for r in found if r["configuration"] == configuration]
        return [values[name] for values in mine if name in values]

    def summary(self, configuration: str, name: str) -> Summary | None:
        """Return mean and deviation of a number over the seeds, or None without a record of it."""
        found = [float(value) for value in self.of(configuration, name) if value is not None]
        return summary(found) if found else None

    def text(self, configuration: str, name: str, digits: int = 2) -> str:
        """Return `mean ± deviation`, or nothing where there is no number."""
        found = self.summary(configuration, name)
        return found.text(digits) if found else ""

    def _records(self) -> list[dict[str, Any]]:
        """Read the file, or refuse it."""
        way_out = "choose another folder with -o, or remove the file"
        try:
            data = json.loads(self.path.read_text(encoding="utf-8"))
            head = {name: data[name] for name in ("schema", "experiment", "settings")}
            records: list[dict[str, Any]] = data["records"]
        except (OSError, ValueError, KeyError, TypeError) as error:
            rule = f"it is no file of results ({type(error).__name__})"
            raise InputError("file of results", str(self.path), rule, way_out) from None
        if head != {"schema": SCHEMA, "experiment": self.experiment, "settings": self.settings}:
            rule = f"it belongs to {head['experiment']} with settings {json.dumps(head['settings'])}"
            raise InputError("file of results", str(self.path), rule, way_out)
        return records

    def _write(self, records: Sequence[Mapping[str, Any]]) -> None:
        """Write the file in one step."""
        head = {"schema": SCHEMA, "experiment": self.experiment, "settings": self.settings}
        facts = {"machine": machine.describe(), "versions": machine.versions()}
        write_text(self.path, json.dumps({**head, **facts, "records": records}, indent=1) + "\n")

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Let one process at a time change the file."""
        lock = self.path.with_name(f".{self.path.name}.lock")
        with lock.open("w") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            yield


def fill(
    results: Results,
    work: Mapping[str, Callable[[int], Values]],
    seeds: Sequence[int],
    title: str = "measuring",
) -> None:
    """Find what has no record yet: each configuration by its function of the seed, all seeds of one first."""
    left = [(name, seed) for name in work for seed in seeds if results.get(name, seed) is None]
    with (
        hint_on_interrupt(lambda: f"the same command goes on where it was, in {results.path}"),
        progress(title, len(left)) as advance,
    ):
        for name, seed in left:
            results.put(name, seed, work[name](seed))
            advance(1)
