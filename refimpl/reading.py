"""Reading untrusted files: nothing is believed before it is checked.

1. A file must be a regular one of at most a stated length. It is looked at before it is opened, opened
   without waiting, and no more than that length is read [`read_file`].
2. JSON is UTF-8 with limits on nesting, on the number of values and on the length of a number; a key appears
   once in an object, and every number is finite [`parse_json`].
3. A dataclass is made from JSON's values by the annotations of its fields [`to_dataclass`].
4. What else goes wrong while content becomes values is one error of ours [`refusing`].

Whatever these functions are given, they return a value or raise [`InputError`].
"""

from __future__ import annotations

import json
import math
import os
import re
import resource
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from .errors import NO_VALUE, InputError, choice

LARGEST_FILE_BYTES = 256 * 2**20
"""Longest file that is read whole: thousands of times a usual model."""

LARGEST_JSON_BYTES = 64 * 2**20
"""Longest JSON text: a scene of 100,000 boxes has half of it."""

MOST_DEPTH = 64
"""Deepest nesting of lists and objects; the project's own files have 6."""

MOST_VALUES = 4_000_000
"""Most commas and opening brackets of a JSON text: 100,000 boxes have 3,000,103. The smallest object
is two of them, and takes 232 bytes."""

LONGEST_NUMBER = 1_000
"""Most characters of a number: the largest double, written out, has 309."""

BROKEN = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)
"""What Python raises while content of another form than expected is taken apart."""

_HALF_CHARACTER = re.compile(r"\\u[dD][89a-fA-F]")
"""Where half a character (a surrogate) may be in a JSON text."""

_Built = TypeVar("_Built")


# ---- files ------------------------------------------------------------------------------------------------


def read_file(
    path: str | os.PathLike[str],
    what: str = "input file",
    way_out: str = "check the path",
    most: int = LARGEST_FILE_BYTES,
    stated: int | None = None,
) -> bytes:
    """Return the content of a regular file of at most `most` bytes; `what` names it in an error.

    `stated`: the length that a manifest states; a file of another one is refused and not read.
    """
    shown = os.fspath(path)
    try:
        check_regular(Path(path).stat(), what, shown)
        # Between the two looks the name may have come to stand for a pipe, which must not make us wait.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            found = os.fstat(handle)
            check_regular(found, what, shown)
            wanted = found.st_size <= most and stated in (None, found.st_size)
            content = file.read(most + 1 if stated is None else stated) if wanted else b""
            size = max(found.st_size, len(content))
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        rule = "not found" if isinstance(error, FileNotFoundError) else f"cannot be read: {reason}"
        raise InputError(what, shown, rule, way_out) from None
    if size > most:
        raise InputError(f"size of {shown} in bytes", size, f"at most {most} bytes are read", way_out)
    if stated is not None and not size == len(content) == stated:
        raise InputError(f"size of {shown} in bytes", size, f"must be the stated one, {stated}", way_out)
    return content


def check_regular(found: os.stat_result, what: str, shown: str) -> None:
    """Refuse what is not a regular file."""
    if stat.S_ISDIR(found.st_mode):
        raise InputError(what, shown, "is a folder", "give the name of a file in it")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(what, shown, "is a pipe or a device, not a regular file", "give a file on a disk")


def check_room(needed: int, what: str, shown: object, way_out: str) -> None:
    """Refuse what would take more memory, in bytes, than this process can get; nothing is allocated yet."""
    free = _free_bytes()
    if needed > free:
        rule = f"it would take {needed / 2**20:,.0f} MiB of memory, and {free / 2**20:,.0f} MiB are free"
        raise InputError(what, shown, rule, way_out)


def _free_bytes() -> float:
    """Return how much memory is free by the system's and by this process's own limits, as far as is known."""
    free: float = math.inf
    # Linux tells both; elsewhere the request itself may fail.
    with suppress(OSError, ValueError, IndexError):
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free = next(float(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvailable"))
        pages = [int(field) for field in Path("/proc/self/statm").read_text(encoding="ascii").split()]
        for limit, used in ((resource.RLIMIT_AS, pages[0]), (resource.RLIMIT_DATA, pages[5])):
            most = resource.getrlimit(limit)[0]
            if most != resource.RLIM_INFINITY:
                free = min(free, float(most - used * resource.getpagesize()))
    return free


def plain_name(name: Any, what: str, way_out: str) -> str:
    """Return a name of a file that leads out of no folder, or refuse it."""
    if not isinstance(name, str) or name in ("", ".", "..") or any(sign in name for sign in "/\\\0"):
        raise InputError(what, name, "must be the plain name of a file in its own folder", way_out)
    return name


def stated_bytes(manifest: Mapping[str, Any], name: str, what: str, way_out: str) -> int | None:
    """Return the length that a manifest states of a file; None where it is an older one that states none."""
    if SIZES not in manifest:
        return None
    sizes = manifest[SIZES]
    size = sizes.get(name) if isinstance(sizes, dict) else None
    if type(size) is not int or size < 0:
        rule = "must be the file's length in bytes, an integer"
        raise InputError(f"{what}: {SIZES}: {name}", size, rule, way_out)
    return size


SIZES = "file_bytes"
"""Key of a manifest: the length of each of its files, by name."""


# ---- JSON -------------------------------------------------------------------------------------------------


def parse_json(text: str | bytes, what: str, way_out: str, most: int = LARGEST_JSON_BYTES) -> Any:
    """Return the value of a JSON text; refuse what is not JSON, or beyond the limits above."""

    def refused(rule: str) -> InputError:
        beginning = text[:_BEGINNING] if isinstance(text, str) else text[:_BEGINNING].decode(errors="replace")
        return InputError(what, beginning, f"is not acceptable JSON: {rule}", way_out)

    if len(text) > most:
        raise refused(f"more than {most} bytes")
    unusual: list[str] = []

    try:
        read = text if isinstance(text, str) else text.decode("utf-8")
        if sum(map(read.count, ",[{")) > MOST_VALUES:
            raise refused(f"more than {MOST_VALUES} values")
        value = json.loads(
            read,
            parse_int=partial(_read_number, unusual, int),
            parse_float=partial(_read_number, unusual, float),
            parse_constant=partial(_read_number, unusual, float),
            object_pairs_hook=_object,
        )
    except InputError:
        raise
    except RecursionError:
        raise refused(f"its lists and objects are nested more than {MOST_DEPTH} deep") from None
    except ValueError as error:
        raise refused(str(error)) from None
    if _deeper_than(value, MOST_DEPTH):
        raise refused(f"its lists and objects are nested more than {MOST_DEPTH} deep")
    if unusual or _HALF_CHARACTER.search(read):
        for place, shown, rule in _unusual(value, what):
            raise InputError(place, shown, rule, way_out)
    return value


_LONG = 309
"""Characters of the largest double: an integer of fewer is below it."""

_BEGINNING = 200
"""Characters of a text that an error may show; it cuts them further."""


def _read_number(unusual: list[str], kind: Callable[[str], Any], text: str) -> Any:
    """Return a number; the text of one that is not finite goes to `unusual`."""
    if len(text) > LONGEST_NUMBER:
        raise ValueError(f"a number of {len(text)} digits")
    value = kind(text)
    # Python's integers have no largest one, and JSON knows one kind of numbers only.
    if (kind is float or len(text) >= _LONG) and not math.isfinite(float(text)):
        unusual.append(text)
        return float(text)
    return value


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object whose keys stand once each."""
    made = dict(pairs)
    if len(made) != len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise ValueError(f"the key {twice[:40]!r} appears twice")
    return made


def _deeper_than(value: Any, depth: int) -> bool:
    """Tell whether lists and objects are nested deeper than `depth`."""
    level = [value]
    for _ in range(depth):
        level = [
            child
            for parent in level
            if isinstance(parent, (list, dict))
            for child in (parent if isinstance(parent, list) else parent.values())
            if isinstance(child, (list, dict))
        ]
        if not level:
            return False
    return True


def _unusual(value: Any, path: str) -> Iterator[tuple[str, str, str]]:
    """Yield path, value and rule of the invalid numbers and texts in a value that is not deep."""
    if isinstance(value, str) and _has_half_character(value):
        yield path, ascii(value), HALF
    elif isinstance(value, float) and not math.isfinite(value):
        yield path, str(value), "must be a finite number, as JSON has no other"
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _unusual(item, f"{path}[{index}]")
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _unusual(key, f"{path}: a key")
            yield from _unusual(item, f"{path}.{key}")


HALF = "half a character (a lone surrogate) cannot be written to a file"
"""The rule of a text that UTF-8 cannot hold."""


def _has_half_character(text: str) -> bool:
    """Tell whether a text has a surrogate without its other half."""
    return any("\ud800" <= character <= "\udfff" for character in text)


@contextmanager
def refusing(what: str, value: object, rule: str, way_out: str) -> Iterator[None]:
    """Turn whatever content of a wrong form raises in the block into one InputError of this text."""
    try:
        yield
    except InputError:
        raise
    except BROKEN as error:
        # A missing key says only its name.
        said = f"{error} is missing" if isinstance(error, KeyError) else str(error) or type(error).__name__
        raise InputError(what, value, f"{rule}: {said}", way_out) from None


# ---- dataclasses ------------------------------------------------------------------------------------------

Special = Mapping[Any, Callable[[Any, str], Any]]
"""Functions of (value, path) for annotations that need one of their own."""


@cache
def _hints(kind: type[Any]) -> dict[str, Any]:
    """Return a dataclass's annotations, evaluated once: a scene may have a hundred thousand boxes."""
    return get_type_hints(kind)


def to_dataclass(
    kind: type[_Built],
    data: Any,
    path: str,
    *,
    largest: float = math.inf,
    special: Special | None = None,
    whole: bool = False,
) -> _Built:
    """Make the dataclass `kind` from a JSON object, each field by its annotation.

    `path` is where the object is, `largest` the largest magnitude of its numbers. Unknown keys, missing
    ones without a default (of a `whole` record all missing ones), and values of another type are refused.
    """
    if not isinstance(data, dict):
        raise InputError(path, data, "must be a JSON object", f"give the keys of a {kind.__name__.lower()}")
    known = {f.name: f for f in fields(kind)}  # type: ignore[arg-type]
    for key in data:
        if key not in known:
            way_out = choice(key, known) if known else "remove it"
            raise InputError(f"{path}.{key}", data[key], f"{kind.__name__} has no such key", way_out)
    hints = _hints(kind)  # type: ignore[arg-type]
    convert = _Converter(largest, special or {}, whole)
    values = {}
    for name, spec in known.items():
        if name in data:
            values[name] = convert(hints[name], data[name], f"{path}.{name}")
        elif whole or (spec.default is MISSING and spec.default_factory is MISSING):
            raise InputError(f"{path}.{name}", NO_VALUE, "missing", f"add the key to {path}")
    return kind(**values)


def to_value(hint: Any, text: str | bytes, path: str, way_out: str) -> Any:
    """Return what an annotation asks for of a JSON text; its records are whole."""
    return _Converter(math.inf, {}, True)(hint, parse_json(text, path, way_out), path)


@dataclass(frozen=True)
class _Converter:
    """Turns JSON values into what annotations ask for."""

    largest: float
    special: Special
    whole: bool

    def __call__(self, hint: Any, value: Any, path: str) -> Any:
        """Convert a JSON value to what the annotation `hint` asks for."""
        if hint in self.special:
            return self.special[hint](value, path)
        if hint is float:
            return _number(value, path, self.largest)
        if hint is int:
            return _count(value, path)
        if hint is str:
            return _text(value, path)
        if hint == dict[str, str]:
            if not isinstance(value, dict):
                raise InputError(path, value, "must map strings to strings", "write {} for none")
            return {_text(key, path): _text(item, f"{path}.{key}") for key, item in value.items()}
        if is_dataclass(hint):
            return to_dataclass(hint, value, path, **vars(self))  # type: ignore[arg-type]
        arguments = get_args(hint)
        if type(None) in arguments:
            return None if value is None else self(arguments[0], value, path)
        return self._tuple(arguments, value, path)

    def _tuple(self, arguments: tuple[Any, ...], value: Any, path: str) -> Any:
        """Convert a list to a tuple, of any length where the annotation ends in dots."""
        if not isinstance(value, list):
            raise InputError(path, value, "must be a list", "write it in square brackets")
        if arguments[-1] is Ellipsis:
            return tuple(self(arguments[0], item, f"{path}[{i}]") for i, item in enumerate(value))
        if len(value) != len(arguments):
            raise InputError(path, value, f"must have {len(arguments)} entries", "add or remove entries")
        pairs = zip(arguments, value, strict=True)
        return tuple(self(hint, item, f"{path}[{i}]") for i, (hint, item) in enumerate(pairs))


def _number(value: Any, path: str, largest: float) -> float:
    """Return a JSON number as a finite float."""
    largest = min(largest, _LARGEST_DOUBLE)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= largest:
        rule = f"must be a finite number of at most {largest:g} in magnitude"
        raise InputError(path, _shortened(value), rule, "write a decimal number; choose other units")
    return float(value)


_LARGEST_DOUBLE = float.fromhex("0x1.fffffffffffffp+1023")
"""Python's integers can be larger."""


def _count(value: Any, path: str) -> int:
    """Return a JSON number that is whole, and is written so."""
    if type(value) is not int:
        raise InputError(path, _shortened(value), "must be an integer", "write it without a point")
    return value


def _shortened(value: Any) -> Any:
    """Return a value, but of an integer of thousands of digits its length."""
    if type(value) is int and abs(value) > 1e18:
        return f"an integer of {value.bit_length()} bits"
    return value


def _text(value: Any, path: str) -> str:
    """Return a JSON string that can be written to a file."""
    if not isinstance(value, str):
        raise InputError(path, value, "must be a string", "put it in quotation marks")
    if _has_half_character(value):
        raise InputError(path, ascii(value)[1:-1], HALF, "fix the string")
    return value
