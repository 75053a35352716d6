"""A data set's folder: its manifest, its pictures, and what an interrupted run leaves for the next one.

1. The manifest, `manifest.json`, is written first: the request and every picture, without checksums. When all
   pictures are there it is written again, with them [`Store.open`]. Reading it refuses what is not a
   manifest [`read_manifest`].
2. A rendered band is a file in `unfinished/` whose name ends in its checksum, so that it and its checksum
   appear in one step [`Store.put`]. A picture whose bands are all there is joined, noted in a journal with
   its checksum and bytes, and moved to its place. Each step can be the last one of a run: what was done
   stays.
3. Every file is compared with its checksum before it counts as done [`verify`]; one that is damaged or
   missing is made again.
4. One process at a time works in a folder [alone.py]; another data set's folder is refused [`Store.open`].
5. What is removed is a regular file of a name that is given here. Folders that are links, and other files in
   `unfinished/`, are refused before anything is written or removed [`check_work_folders`].
"""

import hashlib
import json
import os
import re
import stat
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...models.blender import plan as film_plan
from ...models.data import frame_plan
from ...models.data.frame_plan import KINDS, SPLITS, Rows, join
from ...models.writing import TEMPORARY_NAME, is_regular, remove_temporaries
from ...refimpl.errors import InputError
from ...refimpl.frame import Frame
from ...refimpl.reading import BROKEN, parse_json, read_file, refusing
from ..common.terminal import progress
from . import exr
from .alone import working_in
from .outputs import check_real_folder, visible, write_text

SCHEMA = "wamnet-dataset-2"
"""Name and version of the manifest's form; described in spec/dataset_files.md."""

MANIFEST = "manifest.json"
"""The file that says what a data set is; a folder that has one is a data set."""

UNFINISHED = "unfinished"
"""Folder of an unfinished data set's bands and journal; a finished one has none."""

JOURNAL = "journal.jsonl"
"""File in UNFINISHED: a line of JSON for each picture since the manifest was written."""

NEW = "new.exr"
"""Band in UNFINISHED whose checksum is not known yet."""

NAME = re.compile(r"(train|test|outside)/\d{5}-(noisy|target)\.exr")
"""What a picture's file may be called; nothing that leads out of the folder."""

BAND = re.compile(r"(train|test|outside)-(\d{5}-(?:noisy|target))\.(\d+)-(\d+)\.([0-9a-f]{64})\.exr")
"""What a band's file is called: its picture, its rows [first, last), its SHA-256."""


@dataclass(frozen=True)
class Sum:
    """What a file is known by: its length in bytes and its SHA-256 in hexadecimal."""

    bytes: int
    sha256: str


Sums = Mapping[str, Sum]
"""Pictures that were finished once, by name."""


Asked = frame_plan.Request | film_plan.Request
Planned = frame_plan.FramePlan | film_plan.FilmFrame
Pictured = frame_plan.Picture | film_plan.Shot
Band = frame_plan.Task | film_plan.Shot

Look = Callable[[int], None]
"""Called with a number of bytes that were just compared."""


def sum_of(path: Path, stated: int | None = None) -> Sum:
    """Return what a file is known by; one of another length than the stated one is not read."""
    digest, length = hashlib.sha256(), 0
    # A pipe of this name must not make us wait, nor a device give bytes without end.
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(handle, "rb") as file:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise InputError("file", str(path), "is not a regular file", "remove it")
        if stated not in (None, found.st_size):
            return Sum(found.st_size, "")
        # It may grow while it is read.
        while length <= found.st_size and (block := file.read(1 << 20)):
            digest.update(block)
            length += len(block)
    return Sum(length, digest.hexdigest())


def verify(folder: Path, manifest: Mapping[str, Any], on_look: Look | None = None) -> dict[str, str]:
    """Return the pictures that are not as the manifest says, by name, and what is wrong with each."""
    sums = _sums_of(manifest) | _read_journal(folder / UNFINISHED / JOURNAL)
    return _wrong(folder, _names(manifest), sums, on_look)


def _wrong(folder: Path, names: Sequence[str], sums: Sums, on_look: Look | None) -> dict[str, str]:
    """Return what is wrong with the named pictures, by name."""
    wrong = {}
    for name in names:
        path, known = folder / name, sums.get(name)
        if known is None:
            wrong[name] = "not made yet"
        elif not path.is_file():
            wrong[name] = "missing"
        elif sum_of(path, known.bytes) != known:
            wrong[name] = "damaged"
        if on_look is not None and known is not None:
            on_look(known.bytes)
    return wrong


def bytes_of(manifest: Mapping[str, Any]) -> int:
    """Return the length of all finished pictures together."""
    return sum(known.bytes for known in _sums_of(manifest).values())


# ---- the manifest ----------------------------------------------------------------------------------------


def manifest_of(
    request: Asked,
    frames: Sequence[Planned],
    sums: Sums,
    nearest: Mapping[str, Mapping[str, float]] | None = None,
) -> dict[str, Any]:
    """Return the manifest of a data set of which these pictures are finished.

    `nearest` says of each split of test frames how far the nearest training frame is.
    """
    facts = [frame.describe() for frame in frames]
    for frame in facts:
        for kind in KINDS:
            known = sums.get(frame[kind]["file"])
            frame[kind] |= {"bytes": known and known.bytes, "sha256": known and known.sha256}
    head = {"schema": SCHEMA, "wamnet": frame_plan.version(), "request": request.as_data()}
    complete = all(frame[kind]["sha256"] for frame in facts for kind in KINDS)
    return {**head, "complete": complete, "nearest": dict(nearest or {}), "frames": facts}


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return a data set's manifest; refuse a folder that is not a data set, and a damaged manifest."""
    path = folder / MANIFEST
    if not path.is_file():
        raise InputError("data set", str(folder), f"has no {MANIFEST}", "make one: wamnet dataset")
    rule = "is not a manifest of a data set, or damaged"
    with refusing("manifest", str(path), rule, "restore it, or make the data set in another folder"):
        manifest: dict[str, Any] = parse_json(read_file(path), "manifest", "restore it")
        if (schema := manifest["schema"]) != SCHEMA:
            rule = f"must be {SCHEMA}"
            raise InputError(f"{path}: schema", str(schema), rule, "use that version of wamnet")
        good = isinstance(manifest["request"], dict) and isinstance(manifest["wamnet"], str)
        good &= all(NAME.fullmatch(name) for name in _names(manifest)) and bool(manifest["frames"])
        good &= all(frame["split"] in SPLITS for frame in manifest["frames"])
        _sums_of(manifest)
        if not good:
            raise ValueError("something in it has another form")
    return manifest


def _names(manifest: Mapping[str, Any]) -> list[str]:
    """Return the names of all pictures."""
    return [frame[kind]["file"] for frame in manifest["frames"] for kind in KINDS]


def _sums_of(manifest: Mapping[str, Any]) -> dict[str, Sum]:
    """Return what the manifest knows of its finished pictures."""
    pictures = [frame[kind] for frame in manifest["frames"] for kind in KINDS]
    return {p["file"]: _sum_in(p) for p in pictures if p["sha256"] is not None}


def _sum_in(entry: Mapping[str, Any]) -> Sum:
    """Return what an entry of a manifest or a journal states of a file."""
    length, digest = entry["bytes"], entry["sha256"]
    if type(length) is not int or length < 0 or not re.fullmatch("[0-9a-f]{64}", digest):
        raise ValueError("it states no length and SHA-256 of a file")
    return Sum(length, digest)


# ---- using a data set ------------------------------------------------------------------------------------


def read_pairs(
    folder: Path, split: str = "train", tell: Callable[[str], None] | None = None
) -> list[tuple[Frame, Frame]]:
    """Read the pairs (noisy frame, target's colour) of a split; refuse one with a picture that is wrong.

    Nothing but its colour is learnt from a target, so the other layers do not stay in memory. `tell` is given
    what was said of pictures of another program [exr.read_frame], each sentence once.
    """
    manifest = read_manifest(folder)
    frames = [frame for frame in manifest["frames"] if frame["split"] == split]
    refuse_wrong(folder, verify(folder, {**manifest, "frames": frames}))
    pairs, said = [], Counter[str]()

    def count(text: str) -> None:
        said[text.partition(": ")[2]] += 1

    for frame in frames:
        noisy, target = (exr.read_frame(folder / frame[kind]["file"], tell=count) for kind in KINDS)
        pairs.append((noisy, Frame({"color": target["color"]}, target.info)))
    for text, times in said.items():
        if tell is not None:
            tell(f"{folder}, {times} of {2 * len(frames)} images: {text}")
    return pairs


def refuse_wrong(folder: Path, wrong: Mapping[str, str]) -> None:
    """Refuse a data set that has wrong pictures; name the first."""
    if wrong:
        name, what = next(iter(wrong.items()))
        rule = f"{len(wrong)} of its images do not match {MANIFEST}, first {name}: {what}"
        way_out = "make them: run the command wamnet dataset that began it"
        raise InputError("data set", str(folder), rule, way_out)


# ---- making a data set -----------------------------------------------------------------------------------


class Store:
    """An open folder of a data set that is being made; made by [`Store.open`]."""

    def __init__(
        self,
        folder: Path,
        request: Asked,
        frames: Sequence[Planned],
        before: Sums,
        nearest: Mapping[str, Mapping[str, float]],
    ) -> None:
        """Keep what is to be made, how its frames compare, and the sums of an earlier run."""
        self.folder, self.request, self.frames, self.nearest = folder, request, frames, nearest
        self.unfinished = folder / UNFINISHED
        self.pictures = {p.name: p for frame in frames for p in frame.pictures.values()}
        self.before, self.sums = before, dict(before)
        self.changed: list[str] = []
        self.missing: dict[str, str] = {}
        self._bands: dict[str, dict[Rows, Path]] = defaultdict(dict)

    @classmethod
    @contextmanager
    def open(
        cls,
        folder: Path,
        request: Asked,
        frames: Sequence[Planned],
        nearest: Mapping[str, Mapping[str, float]] | None = None,
    ) -> Iterator["Store"]:
        """Yield the store of a new data set, or of the same one begun before; refuse every other folder.

        When the block ends well and nothing is missing, the data set is finished.
        """
        # A run that was killed at its start leaves hidden files.
        if visible(folder) and not (folder / MANIFEST).exists():
            rule = "holds something else"
            raise InputError("output folder", str(folder), rule, "choose a new or empty one with -o")
        check_work_folders(folder)
        before = _known_before(folder, request, frames) if (folder / MANIFEST).exists() else {}
        with working_in(folder, "making a data set"):
            # It was another process's until now.
            check_work_folders(folder)
            store = cls(folder, request, frames, before, nearest or {})
            with progress("checking", sum(known.bytes for known in before.values()), "bytes") as look:
                store._begin(look)
            yield store
            if not store.missing and store.unfinished.exists():
                store._finish()

    def _begin(self, on_look: Look) -> None:
        """Find what is there; write down what is not, before any of it is made."""
        for name in self.pictures:
            path = self.folder / name
            if path.is_dir() and not path.is_symlink():
                raise InputError("image", str(path), "is a folder", "move it, or use another -o")
        remove_temporaries(self.folder)
        names = list(self.pictures)
        self.sums = dict(self.before) | _read_journal(self.unfinished / JOURNAL)
        self.before = dict(self.sums)
        self.missing = _wrong(self.folder, names, self.sums, on_look)
        if not self.missing:
            return
        for name in self.missing:
            self.sums.pop(name, None)
        # First of all the manifest: a folder with anything else and none is not a data set.
        self._write_manifest()
        for path in {self.unfinished, *((self.folder / name).parent for name in self.missing)}:
            path.mkdir(exist_ok=True)
        for path in sorted(self.unfinished.iterdir()):
            self._find_band(path)
        for name in list(self.missing):
            self._join_if_whole(self.pictures[name])

    def _find_band(self, path: Path) -> None:
        """Keep a band of a missing picture that is what its name says; remove every other file of ours."""
        match = BAND.fullmatch(path.name)
        name = f"{match[1]}/{match[2]}.exr" if match else ""
        if match and name in self.missing and sum_of(path).sha256 == match[5]:
            self._bands[name][int(match[3]), int(match[4])] = path
        elif _is_own(path):
            path.unlink()

    def tasks(self) -> list[Any]:
        """Return the tasks that are left."""
        return [
            task
            for name in self.missing
            for task in self.pictures[name].tasks()
            if task.rows not in self._bands[name]
        ]

    def summary(self, made: int) -> list[str]:
        """Return a line per picture with other bytes than an earlier run's, and the number of pictures."""
        reason = "differs from the earlier run's; another NumPy or processor wrote it"
        count = f"{len(self.pictures)} images of {len(self.frames)} frames"
        changed = [f"{self.folder / name}: {reason}" for name in self.changed]
        return [*changed, f"{self.folder}: {count}, {made} of them rendered now"]

    def put(self, task: Band, band: Frame) -> None:
        """Keep a rendered band; when it is its picture's last one, finish the picture."""
        self._publish(task.picture, task.rows, band)
        self._join_if_whole(task.picture)

    def _publish(self, picture: Pictured, rows: Rows, band: Frame) -> None:
        """Write a band under a name that ends in its checksum."""
        new = self.unfinished / NEW
        exr.write_frame(new, band)
        first, last = rows
        stem = picture.name.replace("/", "-").removesuffix(".exr")
        path = self.unfinished / f"{stem}.{first}-{last}.{sum_of(new).sha256}.exr"
        self._bands[picture.name][rows] = new.replace(path)

    def _join_if_whole(self, picture: Pictured) -> None:
        """Finish a picture whose bands are all there; one that covers all rows is the picture."""
        bands, whole = self._bands[picture.name], (0, picture.height)
        if whole not in bands:
            if not all(task.rows in bands for task in picture.tasks()):
                return
            parts = [exr.read_frame(path) for _, path in sorted(bands.items())]
            self._publish(picture, whole, join(parts))
        path = bands[whole]
        known = Sum(path.stat().st_size, path.suffixes[-2][1:])
        flags = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        with os.fdopen(os.open(self.unfinished / JOURNAL, flags, 0o666), "a", encoding="utf-8") as journal:
            line = {"file": picture.name, "bytes": known.bytes, "sha256": known.sha256}
            journal.write(json.dumps(line) + "\n")
        path.replace(self.folder / picture.name)
        for rows, part in bands.items():
            if rows != whole:
                part.unlink()
        if self.before.get(picture.name, known) != known:
            self.changed.append(picture.name)
        self.sums[picture.name] = known
        del self.missing[picture.name], self._bands[picture.name]

    def _finish(self) -> None:
        """Write the manifest with all checksums, and remove what an unfinished data set has."""
        self._write_manifest()
        for path in self.unfinished.iterdir():
            if _is_own(path):
                path.unlink()
        with suppress(OSError):
            self.unfinished.rmdir()

    def _write_manifest(self) -> None:
        """Write the manifest, all of it or nothing."""
        manifest = manifest_of(self.request, self.frames, self.sums, self.nearest)
        write_text(self.folder / MANIFEST, json.dumps(manifest, indent=1, allow_nan=False) + "\n")


def _known_before(folder: Path, request: Asked, frames: Sequence[Planned]) -> dict[str, Sum]:
    """Return the sums in the manifest of a folder, or refuse it if it is another data set."""
    there, wanted = read_manifest(folder), manifest_of(request, frames, {})
    if there["wamnet"] != wanted["wamnet"]:
        different = [f"wamnet {there['wamnet']} (now {wanted['wamnet']})"]
    else:
        keys = dict.fromkeys([*there["request"], *wanted["request"]])
        pairs = [(key, there["request"].get(key), wanted["request"].get(key)) for key in keys]
        different = [f"{key} {old} (now {new})" for key, old, new in pairs if old != new]
    sums = _sums_of(there)
    if not different and manifest_of(request, frames, sums)["frames"] != there["frames"]:
        different = ["the frames themselves (now others)"]
    if different:
        rule = f"holds another data set: {', '.join(different)}"
        raise InputError("output folder", str(folder), rule, "choose another with -o, or the same request")
    return sums


def _read_journal(path: Path) -> dict[str, Sum]:
    """Return the pictures that a journal knows; a line that is cut short or damaged does not count."""
    sums = {}
    text = read_file(path, "journal").decode("utf-8", "replace") if path.exists() else ""
    for line in text.splitlines():
        try:
            entry = parse_json(line, "journal", "continue")
            sums[str(entry["file"])] = _sum_in(entry)
        except BROKEN:
            continue
    return sums


def check_work_folders(folder: Path) -> None:
    """Refuse a data set in which something is not as it is made here: nothing was touched until then.

    A link of a folder's name would lead what is written and removed to somebody else's files.
    """
    for name in (*SPLITS, UNFINISHED):
        check_real_folder(folder / name)
    unfinished = folder / UNFINISHED
    there = [*(unfinished.iterdir() if unfinished.exists() else ())]
    if (folder / MANIFEST).is_symlink():
        there.append(folder / MANIFEST)
    for path in sorted(there):
        if path.name == MANIFEST or not _is_own(path):
            what = "is not one of the files that wamnet writes there"
            raise InputError(
                "file of a data set", str(path), what, "move it elsewhere, or choose another folder with -o"
            )


def _is_own(path: Path) -> bool:
    """Tell whether a file in UNFINISHED is one that is made here: of such a name, and no link."""
    name = path.name
    known = name in (JOURNAL, NEW) or BAND.fullmatch(name) or TEMPORARY_NAME.fullmatch(name)
    return bool(known) and is_regular(path)
