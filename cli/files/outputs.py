"""Writing files so that nothing is ever half written or lost.

1. Before long work starts, the output's name is checked: the folder exists and can be written, the name is
   neither a folder nor one of the inputs [`check_output`].
2. The content goes into a new file of another name in the same folder; only when it is complete does it take
   the output's name, in one step of the file system [`replacing`, models/writing.py]. Whatever ends
   the writer before that (an error, Ctrl-C) removes the new file and leaves the old one.
3. A folder that a command works in is a real one, or is not there yet [`check_real_folder`].
4. A folder that is written as a whole appears in the same way [`check_new_folder`], [`making_folder`].
"""

import os
import shutil
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ...models import writing
from ...refimpl.errors import InputError, escaped


def check_output(path: Path, suffixes: Sequence[str] = (), inputs: Sequence[Path] = ()) -> None:
    """Refuse an output path that could not be written, or whose writing would destroy an input."""
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError("output file", str(path), f"must end in {' or '.join(suffixes)}", "rename it")
    try:
        path.lstat()
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        raise unwritable(path, error) from None
    if path.is_dir():
        raise InputError("output file", str(path), "is a folder", "give the name of a file")
    if path.exists() and not path.is_file():
        raise InputError("output file", str(path), "is not a regular file", "give the name of a regular file")
    check_parent(path)
    for source in inputs:
        if path.exists() and source.exists() and path.samefile(source):
            raise InputError("output file", str(path), "is an input of this command", "choose another name")


def check_parent(path: Path) -> None:
    """Refuse a path whose folder does not exist or cannot be written."""
    folder = path.parent
    if not folder.is_dir():
        raise InputError("output folder", str(folder), "not found", f"create it: mkdir -p '{folder}'")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError("output folder", str(folder), "cannot be written", "choose another with -o")


def unwritable(path: Path, error: BaseException, what: str = "output file") -> InputError:
    """Return the error for an output that cannot be written, under its own name and not a temporary one."""
    reason = getattr(error, "strerror", None) or " ".join(str(error).split()) or type(error).__name__
    return InputError(
        what, str(path), f"cannot be written: {reason}", "free space, or choose another with -o"
    )


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the name of a new file beside `path`: when the block ends well it replaces it, else it goes."""
    check_output(path)
    try:
        with writing.replacing(path) as new:
            yield new
    except OSError as error:
        raise unwritable(path, error) from None


@contextmanager
def spelled(path: Path) -> Iterator[str]:
    """Yield a name of a file for a package that takes UTF-8 only; names on Linux are any bytes."""
    if is_utf8(str(path)):
        yield str(path)
        return
    named = is_utf8(path.name)
    handle = os.open(path.parent if named else path, os.O_RDONLY)
    try:
        yield f"/proc/self/fd/{handle}/{path.name}" if named else f"/proc/self/fd/{handle}"
    finally:
        os.close(handle)


def is_utf8(name: str) -> bool:
    """Tell whether a name has no bytes that Python shows as halves of characters."""
    return name.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in name)


def write_text(path: Path, text: str) -> None:
    """Write `text` to `path`, all of it or none; names in it may hold what no terminal should be given."""
    lines = (escaped(line) for line in text.split("\n"))
    with replacing(path) as new:
        new.write_text("\n".join(lines), encoding="utf-8")


def check_real_folder(folder: Path) -> bool:
    """Tell whether a folder is there; refuse a link of its name, which would lead elsewhere, and all else."""
    try:
        found = folder.lstat().st_mode
    except FileNotFoundError:
        return False
    if not stat.S_ISDIR(found):
        kind = "a symbolic link" if stat.S_ISLNK(found) else "no folder"
        rule = f"is {kind}, and a folder of this command's own must be there, or nothing"
        raise InputError("folder", str(folder), rule, "move it elsewhere, or choose another output with -o")
    return True


def visible(folder: Path) -> list[Path]:
    """Return what is in a folder, in order, without hidden files; refuse anything else of its name."""
    if folder.exists() and not folder.is_dir():
        raise InputError("output folder", str(folder), "is a file", "choose another with -o")
    there = folder.iterdir() if folder.exists() else ()
    return sorted(path for path in there if not path.name.startswith("."))


def check_new_folder(folder: Path) -> None:
    """Refuse a folder that holds something, or could not be made."""
    if folder.is_symlink():
        raise InputError("output folder", str(folder), "is a file", "choose another with -o")
    if visible(folder) or (folder.exists() and any(folder.iterdir())):
        raise InputError("output folder", str(folder), "is not empty", "choose another with -o")
    check_parent(folder)


@contextmanager
def making_folder(folder: Path) -> Iterator[Path]:
    """Yield a new folder beside `folder`: when the block ends well it takes its name, else it goes."""
    check_new_folder(folder)
    new = writing.temporary_beside(folder)
    try:
        new.mkdir()
        yield new
        new.replace(folder)
    except OSError as error:
        raise unwritable(folder, error, "output folder") from None
    finally:
        # Of a name that nobody else has; inside, no link is followed.
        shutil.rmtree(new, ignore_errors=True)
