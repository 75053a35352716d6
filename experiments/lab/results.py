"""What an experiment has found, as JSON: one record for each configuration and seed.

1. A file belongs to one experiment with one set of settings; another one's is refused [`Results.open`].
2. A record is added in one step of the file system, under a lock: an interrupted run loses what it was at
   work on and nothing else, and two runs may share a file [`Results.put`].
3. Configurations and seeds without a record are worked on, in order [`fill`].
4. The records of one configuration have a mean and a standard deviation over the seeds [`Summary`], and an
   interval over seeds and poses [`Results.interval`].
5. The file says which commands made it, on which machine and with which versions, one record a line
   [`written`].
"""

from __future__ import annotations

import fcntl
import json
import math
import re
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from wamnet.cli.common.terminal import hint_on_interrupt, progress
from wamnet.cli.files.outputs import write_text
from wamnet.cli.reports import machine
from wamnet.refimpl.errors import InputError

from .command import line
from .intervals import Interval, interval

SCHEMA = "wamnet-experiment-2"
"""Name and version of the form of a file of results."""

PER_FRAME = "per_frame"
"""The value that holds lists of numbers, one for each pose, by the names of their means."""

PACKAGES = ("torch", "pyoidn", "flip-evaluator", "onnxruntime", "mitsuba", "scikit-image", "bpy", "pyluxcore")
"""Packages whose versions a file of results names too, where they are installed."""

Values = Mapping[str, Any]
"""What was found for one configuration and seed, by name: numbers, texts, lists of them; under `PER_FRAME`
the numbers of each pose."""


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


WAY_OUT = "choose another folder with -o, or remove the file"
"""What helps against a file of something else."""


def _data(path: Path) -> dict[str, Any]:
    """Return what a file says, or refuse it."""
    try:
        data: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        if data["schema"] != SCHEMA or not isinstance(data["records"], list):
            raise KeyError("schema")
        _ = data["experiment"], data["settings"], data["commands"]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        rule = f"is not a file of results ({type(error).__name__})"
        raise InputError("file of results", str(path), rule, WAY_OUT) from None
    return data


def number(value: Any) -> float:
    """Return a number, or the one that a text begins with: `1,024 spp` is 1024."""
    if isinstance(value, int | float):
        return float(value)
    if found := re.match(r"[-+]?[\d,]*\.?\d+(?:e[-+]?\d+)?", value.strip("* ")):
        return float(found[0].replace(",", ""))
    raise InputError("value", value, "does not begin with a number", "show another value")


def written(data: Mapping[str, Any]) -> str:
    """Return data as JSON, each key on a line and each record on one, so that differences can be read."""
    lines = [f" {json.dumps(key)}: {json.dumps(value)}" for key, value in data.items() if key != "records"]
    records = ",\n".join(f"  {json.dumps(record)}" for record in data["records"])
    return "{\n" + ",\n".join([*lines, f' "records": [\n{records}\n ]']) + "\n}\n"


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
    command: str = field(default_factory=line, compare=False)

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

    @classmethod
    def read(cls, path: Path) -> Results:
        """Return the results of a file as it is, whatever experiment and settings it belongs to."""
        data = _data(path)
        return cls(path, data["experiment"], data["settings"])

    def data(self) -> dict[str, Any]:
        """Return all that the file says."""
        return _data(self.path)

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
            found = self._checked()
            kept = [r for r in found["records"] if (r["configuration"], r["seed"]) != (configuration, seed)]
            kept.append({"configuration": configuration, "seed": seed, "values": dict(values)})
            commands = dict.fromkeys([*found["commands"], *([self.command] if self.command else [])])
            self._write(kept, list(commands))

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

    def per_pose(self, configuration: str, name: str) -> list[list[float]]:
        """Return a number's values (seeds, poses): of each pose where they are kept, else the means."""
        kept = [frames[name] for frames in self.of(configuration, PER_FRAME) if name in frames]
        rows = kept or [value for value in self.of(configuration, name) if value is not None]
        return [list(map(number, row)) if isinstance(row, list) else [number(row)] for row in rows]

    def interval(self, configuration: str, name: str) -> Interval | None:
        """Return mean and interval of a number over seeds and poses, or None without a record of it."""
        found = self.per_pose(configuration, name)
        return interval(found) if found else None

    def _records(self) -> list[dict[str, Any]]:
        """Return the file's records."""
        records: list[dict[str, Any]] = self._checked()["records"]
        return records

    def _checked(self) -> dict[str, Any]:
        """Return what the file says, or refuse it as that of something else."""
        data = _data(self.path)
        if (data["experiment"], data["settings"]) != (self.experiment, self.settings):
            rule = f"belongs to {data['experiment']} with settings {json.dumps(data['settings'])}"
            raise InputError("file of results", str(self.path), rule, WAY_OUT)
        return data

    def _write(self, records: Sequence[Mapping[str, Any]], commands: Sequence[str] = ()) -> None:
        """Write the file in one step."""
        head = {"schema": SCHEMA, "experiment": self.experiment, "commands": list(commands)}
        facts = {"machine": machine.describe(), "versions": machine.versions(PACKAGES)}
        write_text(self.path, written({**head, "settings": self.settings, **facts, "records": records}))

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
        hint_on_interrupt(lambda: f"the same command resumes where it was, in {results.path}"),
        progress(title, len(left)) as advance,
    ):
        for name, seed in left:
            results.put(name, seed, work[name](seed))
            advance(1)
