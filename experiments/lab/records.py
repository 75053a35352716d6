"""Records in git: what an experiment has found, rounded, checked and complete, beside the texts that show it.

1. A record is a file of results as [`results.Results`] writes it, or that of `wamnet bench` [`of_bench`] or
   `wamnet demo` [`of_demo`] brought into this form, under experiments/records.
2. Only what can be trusted becomes one: its command is known, it has records, all numbers are finite, each
   configuration has the same seeds, and nothing in it names a place of one machine [`checked`]. The check
   comes before the writing, numbers have six digits [`rounded`].
3. A record may name pictures of frames, and plots whose code is gone, with their digests; other plots are
   drawn from records [`pictures`].
4. A text that shows a record which is still to be made is listed in `pending.txt`, with the command that
   makes it [`pending`]; figures that need no record in `quoted.txt`, with the reason [`quoted`].
"""

import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wamnet.refimpl.errors import NO_VALUE, InputError

from .command import HIDDEN_SCALE
from .results import SCHEMA, Results

ROOT = Path(__file__).resolve().parents[2]
"""The repository's root folder."""

FOLDER = ROOT / "experiments/records"
"""The records."""

DIGITS = 6
"""Significant digits of a number in a record: more than any measurement here has."""

BENCH = "wamnet-bench-2"
"""The form of a result of `wamnet bench`."""

BENCH_SETTINGS = ("size_px", "repeats", "budget_s", "network", "frames", "unseen_frames", "front")
"""What of it holds for all contenders."""

DEMO = "wamnet-demo-2"
"""The form of a report of `wamnet demo`."""

PLACE = re.compile(r"(?<![\w.}>:/])/(?:work|home|root|Users|tmp|mnt|opt|var)/\w")
"""A path of one machine."""


class Missing(InputError):
    """A record that is not there yet."""


@dataclass(frozen=True)
class Records:
    """The records of a folder, by name."""

    folder: Path = FOLDER

    def __getitem__(self, name: str) -> Results:
        """Return a record's results, or say which one is missing."""
        path = self.folder / f"{name}.json"
        if not path.exists():
            raise Missing("record", name, "not found", "make it, and run experiments/publish.py")
        return Results.read(path)

    def __contains__(self, name: str) -> bool:
        return (self.folder / f"{name}.json").exists()

    def names(self) -> list[str]:
        """Return the names of all records."""
        return sorted(path.stem for path in self.folder.glob("*.json"))


def checked(data: Mapping[str, Any], partial: bool = False) -> dict[str, Any]:
    """Return results as a record holds them; refuse what would not be one. `partial`: seeds may differ."""
    what, records = f"results of {data.get('experiment')}", data["records"]
    if not records:
        raise InputError(what, NO_VALUE, "have no records", "run the experiment")
    if not data.get("commands"):
        raise InputError(what, NO_VALUE, "do not state their command", "give it with --command")
    if data["settings"].get("scale") == HIDDEN_SCALE or f"--scale {HIDDEN_SCALE}" in str(data["commands"]):
        raise InputError(what, NO_VALUE, "are of scale toy and mean nothing", "run it with --scale small")
    if strange := [where for where, number in numbers(records) if not math.isfinite(number)]:
        raise InputError(what, strange[0], "every number must be finite", "measure it again, or leave it out")
    if not partial and (fewer := incomplete(records)):
        raise InputError(what, fewer[0], "it lacks seeds that others have", "finish it, or give --partial")
    made: dict[str, Any] = rounded({**data, "schema": SCHEMA})
    if place := PLACE.search(json.dumps(made)):
        raise InputError(
            what, place[0], "a record names no place of one machine", "run it in the root folder"
        )
    return made


def incomplete(records: list[dict[str, Any]]) -> list[str]:
    """Return the configurations that lack a seed which another one has."""
    seeds: dict[str, set[int]] = {}
    for record in records:
        seeds.setdefault(record["configuration"], set()).add(record["seed"])
    every = set().union(*seeds.values())
    return [name for name, found in seeds.items() if found != every]


def numbers(value: Any, where: str = "") -> Iterator[tuple[str, float]]:
    """Yield every number in data, with the keys that lead to it."""
    if isinstance(value, Mapping):
        name = str(value.get("configuration", where))
        for key, item in value.items():
            yield from numbers(item, f"{name} {key}".strip())
    elif isinstance(value, list):
        for item in value:
            yield from numbers(item, where)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield where, float(value)


def rounded(value: Any) -> Any:
    """Return data with its fractions rounded to `DIGITS` significant digits."""
    if isinstance(value, Mapping):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(item) for item in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def of_bench(data: Mapping[str, Any], command: str) -> dict[str, Any]:
    """Return a result of `wamnet bench` as results: a configuration for each contender, one seed.

    Nested keys are joined by points, as in `error.max`; times of single rounds are `rounds`. A contender of a
    further size has its pixels after an @, machine-wide numbers are the configuration `machine`.
    """
    sizes = [("", data["contenders"])]
    sizes += [(f"@{size['size_px']}", size["contenders"]) for size in data.get("sizes") or []]
    records = [
        {"configuration": row["name"] + mark, "seed": 0, "values": flat(row)}
        for mark, rows in sizes
        for row in rows
    ]
    records.append({"configuration": "machine", "seed": 0, "values": flat(data.get("limits") or {})})
    settings = {key: data[key] for key in BENCH_SETTINGS if key in data}
    head = {"schema": SCHEMA, "experiment": "bench", "commands": [command] if command else []}
    facts = {key: data.get(key, {}) for key in ("machine", "versions")}
    return {**head, "settings": settings, **facts, "records": records}


def bench_of(found: Results) -> dict[str, Any]:
    """Return the data of `wamnet bench` that a record was made from, as far as tables and plots need it."""
    rows = []
    for record in found.records():
        name, values = record["configuration"], nested(record["values"])
        if name != "machine" and "@" not in name:
            rows.append({"name": name, "ms": None, "reason": "", **values})
    return {**found.data()["settings"], "contenders": rows}


def of_demo(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the report of `wamnet demo` as results: its frames, its executors, the seconds of each step."""
    records = []
    for frame in data["unseen"]:
        for name in ("input", "denoised"):
            scores = {key.lower(): value for key, value in frame[name]["metrics"].items()}
            records.append((f"{name}, {frame['time_s']:.2f} s", flat(scores)))
    records += [(run["executor"], flat(run)) for run in data["runs"] if run["seconds_run"] is not None]
    records.append(("seconds", {**flat(data["seconds"]), "all": sum(data["seconds"].values())}))
    head = {"schema": SCHEMA, "experiment": "demo", "commands": [data["command"]], "settings": data["plan"]}
    rows = [{"configuration": name, "seed": 0, "values": values} for name, values in records]
    return {**head, "machine": data["machine"], "versions": data["versions"], "records": rows}


def flat(values: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Return nested values with their keys joined by points, without those that are not known."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{before}{key}.")
        elif value is not None and key not in ("name", "reason"):
            found[f"{before}{key}"] = value
    return found


def nested(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values whose keys are joined by points as nested ones: what [`flat`] was given."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        *outer, last = key.split(".")
        place = found
        for part in outer:
            place = place.setdefault(part, {})
        place[last] = value
    return found


def lines_of(path: Path, parts: int) -> list[tuple[str, ...]]:
    """Return the entries of a list in git: parts between bars; what begins with # is a comment."""
    found = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        entry = tuple(part.strip() for part in line.split(" | "))
        if len(entry) != parts or not all(entry):
            rule = f"an entry has {parts} parts with ' | ' between them"
            raise InputError(f"{path.name}, line {number}", line[:60], rule, "correct it")
        found.append(entry)
    return found


def pending(folder: Path = FOLDER) -> dict[str, tuple[str, str]]:
    """Return (command, time it takes) of the records that are still to be made, by name."""
    return {name: (command, time) for name, command, time in lines_of(folder / "pending.txt", 3)}


def quoted(folder: Path = FOLDER) -> list[tuple[str, str, str]]:
    """Return (file, text, reason) of the figures that need no record."""
    return [(file, text, why) for file, text, why in lines_of(folder / "quoted.txt", 3)]


def pictures(records: Records) -> dict[str, str]:
    """Return the digests of the pictures of frames that records name, by path from the root."""
    found: dict[str, str] = {}
    for name in records.names():
        found |= records[name].data().get("pictures", {})
    return found
