"""What wamnet remembers of a machine between runs: one small file an entry, in the user's cache folder.

1. The folder is WAMNET_CACHE, else `wamnet` in XDG_CACHE_HOME, else `~/.cache/wamnet`; where there is no
   home, or others may write the folder, there is no cache [`folder`].
2. An entry is JSON around its data: the form's name and the data's SHA-256 [`write_json`]. It is written
   under another name and then takes its own, so that no reader sees half of one; the last writer wins.
3. An entry of what a program computed once for all [`kept`] is made once; of each kind the newest stay.
4. What cannot be read, is not of this form, or does not have its checksum is as if it were not there, with a
   line in the log `wamnet` [`read_json`]; the next write replaces it. A cache that cannot be written costs
   time, never a run.

Names hold all that an entry depends on [`key`], the program's own version included [`program_version`]:
nothing is ever brought up to date in place.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..models.writing import write_bytes
from ..refimpl.errors import InputError, shown
from ..refimpl.reading import BROKEN, parse_json, read_file
from .folders import cache_base, is_private

FOLDER_VARIABLE = "WAMNET_CACHE"
"""Environment variable that names another folder."""

SCHEMA = "wamnet-cache-1"
"""Name and version of an entry's form."""

LARGEST_BYTES = 1 << 24
"""Largest file that is taken for an entry, or written as one: 16 MiB."""

MOST_KEPT = 64
"""Entries of a kind that stay: some networks on some devices."""

_log = logging.getLogger("wamnet")


def folder() -> Path | None:
    """Return the folder of this user's entries, which need not exist yet, or None where nothing is kept."""
    chosen = os.environ.get(FOLDER_VARIABLE)
    base = cache_base()
    path = Path(chosen) if chosen else base and base / "wamnet"
    return path if path is not None and is_private(path) else None


def writable(path: Path) -> bool:
    """Make a folder of entries if it is not there, and tell whether files can be written in it."""
    with suppress(OSError):
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
    return os.access(path, os.W_OK | os.X_OK)


def key(*parts: object) -> str:
    """Return a short name for all that an entry depends on: JSON's types, in this order."""
    text = json.dumps(parts, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


@lru_cache(maxsize=1)
def program_version() -> str:
    """Return a hash of names, sizes and times of the modules: another program makes other kernels."""
    root, digest = Path(__file__).parents[1], hashlib.sha256()
    for folder in (root / name for name in ("compiler", "kernels", "models", "refimpl")):
        for path in sorted(folder.rglob("*.py")):
            facts = path.stat()
            digest.update(f"{path.relative_to(root)} {facts.st_size} {facts.st_mtime_ns}\n".encode())
    return digest.hexdigest()


def kept(kind: str, parts: Sequence[object], make: Callable[[], Any]) -> Any:
    """Return the data of the entry of a kind that depends on `parts`, made and kept where there is none.

    `make` returns data of JSON's types, or None for what is not to be kept.
    """
    name = f"{kind}-{key(*parts, program_version())}"
    if (data := read_json(name)) is None and (data := make()) is not None:
        written = write_json(name, data)
        with suppress(OSError):  # others may remove the oldest entries at the same time
            entries = written.parent.glob(f"{kind}-*.json") if written else ()
            for old in sorted(entries, key=lambda path: -path.stat().st_mtime)[MOST_KEPT:]:
                old.unlink(missing_ok=True)
    return data


def read_json(name: str) -> Any:
    """Return the data of the entry `<name>.json`, or None where there is none that can be trusted."""
    path = path_of(name)
    if path is None:
        return None
    try:
        content = read_file(path, "cache entry", "remove it", LARGEST_BYTES)
    except InputError as error:
        if os.path.lexists(path):
            _log.warning("%s: it is ignored", error)
        return None
    with suppress(*BROKEN):
        entry = parse_json(content, "cache entry", "remove it")
        if entry["schema"] == SCHEMA and entry["sha256"] == _checksum(entry["data"]):
            return entry["data"]
    _log.warning(
        "cache entry %s is damaged, or no entry of wamnet: it is ignored and written again", shown(str(path))
    )
    return None


def write_json(name: str, data: Any) -> Path | None:
    """Keep data of JSON's types as the entry `<name>.json`; return its path, or None if it cannot be kept."""
    entry = {"schema": SCHEMA, "sha256": _checksum(data), "data": data}
    content = (json.dumps(entry, indent=1, sort_keys=True) + "\n").encode()
    path = path_of(name)
    if path is None or len(content) > LARGEST_BYTES:
        return None
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_bytes(path, content)
    except OSError as error:
        _log.warning(
            "cache entry %s cannot be written (%s): nothing is kept", shown(str(path)), error.strerror
        )
        return None
    return path


def path_of(name: str) -> Path | None:
    """Return the file of an entry, or None where there is no cache."""
    assert name == Path(name).name, "names of entries are made by the program, and hold no folder"
    path = folder()
    return path and path / f"{name}.json"


def _checksum(data: Any) -> str:
    """Return the SHA-256 of data as JSON, in one form for equal data."""
    return hashlib.sha256(json.dumps(data, sort_keys=True, allow_nan=False).encode()).hexdigest()


def clean(value: Any) -> Any:
    """Return data with null in place of numbers that JSON does not know, and Python's own numbers."""
    if isinstance(value, Mapping):
        return {str(key): clean(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [clean(item) for item in value]
    if isinstance(value, bool | str | int) or value is None:
        return value
    number = float(value)
    return number if math.isfinite(number) else None
