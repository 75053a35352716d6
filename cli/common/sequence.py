"""Frames in sequence: which files they are, where their results go, and work that overlaps.

1. A name with `*`, `?` or `[` stands for the files that match, one with `%04d` for those with a number in its
   place; a shell may have expanded the first kind already [`frames_of`].
2. Results go to a file, to files of a pattern with the number of each frame, or to a folder under the frame's
   name [`outputs_of`].
3. One thread reads ahead and another writes behind while the device works; a frame that fails is left out,
   and the others are done [`overlapped`].
"""

import re
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from glob import has_magic
from itertools import islice
from pathlib import Path
from typing import TypeVar

from ...refimpl.errors import InputError, WamnetError

AHEAD = 2
"""Frames that are read before they are needed, and results that wait to be written: more would only take
memory."""

NUMBER = re.compile(r"%0?([1-9]?)d")
"""The place of a frame's number in a pattern, as in C: `%04d` has at least four digits."""

Item = TypeVar("Item")
Loaded = TypeVar("Loaded")
Result = TypeVar("Result")


def frames_of(names: Sequence[Path]) -> list[Path]:
    """Return the files that names and patterns stand for, in order; refuse a pattern without any."""
    frames: list[Path] = []
    for name in names:
        text = str(name)
        if name.exists() or not (NUMBER.search(text) or has_magic(text)):
            frames.append(name)
            continue
        root = Path(name.anchor)
        matching = _numbered(name) if NUMBER.search(text) else sorted(root.glob(str(name.relative_to(root))))
        if not matching:
            raise InputError("input frames", text, "not found", "check the pattern")
        frames.extend(matching)
    return list(dict.fromkeys(frames))


def _numbered(pattern: Path) -> list[Path]:
    """Return the files whose names are that of a pattern with a number in it, by number."""
    place = NUMBER.search(pattern.name)
    if place is None or len(NUMBER.findall(str(pattern))) > 1:
        rule = "its file name must have one number"
        raise InputError("input frames", str(pattern), rule, "for example shot.%04d.exr")
    digits = place[1] or "1"
    before, after = re.escape(pattern.name[: place.start()]), re.escape(pattern.name[place.end() :])
    name = re.compile(f"{before}([0-9]{{{digits},}}){after}")
    folder = pattern.parent
    files = folder.iterdir() if folder.is_dir() else ()
    numbers = {path: int(match[1]) for path in files if (match := name.fullmatch(path.name))}
    return sorted(numbers, key=lambda path: (numbers[path], path.name))


def is_many(frames: Sequence[Path], output: Path) -> bool:
    """Tell whether results are those of a sequence: several, or of a pattern, or in a folder."""
    return len(frames) > 1 or NUMBER.search(output.name) is not None or _is_folder(output)


def _is_folder(output: Path) -> bool:
    """Tell whether an output names a folder, which may be there or not."""
    return not output.suffix or (output.suffix.lower() not in (".exr", ".png") and output.is_dir())


def outputs_of(frames: Sequence[Path], output: Path) -> list[Path]:
    """Return the file of each frame's result; refuse names that meet each other or a frame."""
    if not is_many(frames, output):
        return [output]
    if NUMBER.search(output.name):
        digits = int(NUMBER.findall(output.name)[0] or "1")
        texts = [str(number).rjust(digits, "0") for number in _frame_numbers(frames, output)]
        outputs = [output.with_name(NUMBER.sub(text, output.name, count=1)) for text in texts]
    elif _is_folder(output):
        outputs = [output / f"{frame.stem}.exr" for frame in frames]
    else:
        rule = f"{len(frames)} frames need a folder, or a pattern with their numbers"
        raise InputError("output", str(output), rule, f"for example -o out or -o out/{output.stem}.%04d.exr")
    first: dict[Path, Path] = {}
    for frame, result in zip(frames, outputs, strict=True):
        other = first.setdefault(result.resolve(), frame)
        if other is not frame:
            rule = f"both {other} and {frame} would be written there"
            raise InputError("output file", str(result), rule, "rename a frame, or choose another with -o")
    for frame in frames:
        if frame.resolve() in first:
            rule = "is one of the input frames"
            raise InputError("output file", str(frame), rule, "choose another folder or pattern with -o")
    return outputs


def _frame_numbers(frames: Sequence[Path], pattern: Path) -> list[int]:
    """Return each frame's number: the last digits of its name that are not the same in all frames.

    `a.0001_v2.exr` and `a.0002_v2.exr` are 1 and 2.
    """
    names = [re.findall("[0-9]+", frame.stem) for frame in frames]
    for frame, digits in zip(frames, names, strict=True):
        if not digits:
            rule = f"its name has no number, which -o {pattern} needs"
            raise InputError("input frame", str(frame), rule, "rename it, or give a folder with -o")
    shortest = min(map(len, names))
    # Counted from the end, so that a folder of takes with other prefixes has numbers too.
    varying = (at for at in range(1, shortest + 1) if len({digits[-at] for digits in names}) > 1)
    place = next(varying, 1)
    return [int(digits[-place]) for digits in names]


def overlapped(
    items: Sequence[Item],
    read: Callable[[Item], Loaded],
    work: Callable[[Loaded], Result],
    write: Callable[[Item, Result], None],
    advance: Callable[[float], None],
) -> list[tuple[Item, Exception]]:
    """Read, work on and write each item; return those that failed, and why.

    Only the work is done in the caller's thread.
    """
    failed: list[tuple[Item, Exception]] = []
    writing: deque[tuple[Item, Future[None]]] = deque()

    def finish(count: int) -> None:
        """Wait until at most `count` results are being written."""
        while len(writing) > count:
            item, written = writing.popleft()
            try:
                written.result()
            except (WamnetError, OSError) as error:
                failed.append((item, error))
            advance(1)

    with ThreadPoolExecutor(1) as reader, ThreadPoolExecutor(1) as writer:
        coming = ((item, reader.submit(read, item)) for item in items)
        reading = deque(islice(coming, AHEAD))
        while reading:
            item, loaded = reading.popleft()
            try:
                result = work(loaded.result())
            except (WamnetError, OSError) as error:
                failed.append((item, error))
                advance(1)
            else:
                writing.append((item, writer.submit(write, item, result)))
            finish(AHEAD)
            reading.extend(islice(coming, 1))
        finish(0)
    return failed
