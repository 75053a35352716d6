"""Tests of a data set's folder: every place where a run can end, damage, other requests, other folders."""

import contextlib
import json
import os
from dataclasses import replace
from pathlib import Path

import pytest

from wamnet.cli.files import dataset_files as files
from wamnet.cli.files.alone import LOCK
from wamnet.kernels.run import before
from wamnet.models.data import frame_plan
from wamnet.models.data.frame_plan import Request, plan
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame

REQUEST = Request("cornell", frames=2, test_frames=1, size_px=6, spp=2)


MADE: dict[str, Frame] = {}
"""Bands by their tasks: each is rendered once, and needed dozens of times."""


def carry_out(task: frame_plan.Task) -> Frame:
    """Return a band as a worker renders it."""
    if repr(task) not in MADE:
        MADE[repr(task)] = before.carry_out(task)
    return MADE[repr(task)]


@pytest.fixture(autouse=True)
def three_bands(monkeypatch) -> None:
    """Cut each picture of six rows into three bands."""
    monkeypatch.setattr(frame_plan, "TASK_SAMPLES", 1)
    monkeypatch.setattr(frame_plan, "TILE_PIXELS", 12)


def make(folder: Path, request: Request = REQUEST) -> tuple[int, list[str]]:
    """Make what is missing; return how many bands were rendered and which pictures changed."""
    with files.Store.open(folder, request, plan(request)) as store:
        tasks = store.tasks()
        for task in tasks:
            store.put(task, carry_out(task))
    return len(tasks), store.changed


def content(folder: Path) -> dict[str, bytes]:
    """Return every file."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> dict[str, bytes]:
    """Return all files of a data set that was made without an interruption, and without bands."""
    folder = tmp_path_factory.mktemp("whole") / "set"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frame_plan, "TILE_PIXELS", 8192)
        assert make(folder)[0] == 6
    return content(folder)


def test_bands_give_the_same_bytes(tmp_path, whole) -> None:
    """Six pictures and a manifest, nothing else; again, nothing is done."""
    assert make(tmp_path / "a") == (18, [])
    assert content(tmp_path / "a") == whole
    assert set(whole) == {files.MANIFEST} | {
        f"{name}-{kind}.exr" for name in ("train/00000", "train/00001", "test/00000") for kind in files.KINDS
    }
    assert make(tmp_path / "a") == (0, [])
    assert files.verify(tmp_path / "a", files.read_manifest(tmp_path / "a")) == {}


class Killed(BaseException):
    """Ends a run as SIGKILL does: nothing is tidied up."""


def steps_that_change_files(monkeypatch, last: int) -> None:
    """Let the process be killed before the `last`-th renaming or removal of a file."""
    done = 0

    def counted(function):
        def call(*arguments, **options):
            nonlocal done
            if done == last:
                raise Killed
            done += 1
            return function(*arguments, **options)

        return call

    monkeypatch.setattr(Path, "replace", counted(Path.replace))
    monkeypatch.setattr(Path, "unlink", counted(Path.unlink))


def test_a_run_that_is_killed_anywhere_loses_nothing(tmp_path) -> None:
    """Killed before each change of a file in turn: the next run renders only the bands that were not kept."""
    request = replace(REQUEST, frames=1, test_frames=0)
    make(tmp_path / "whole", request)
    for last in range(1000):
        folder, kept, ended = tmp_path / str(last), 0, False
        with pytest.MonkeyPatch.context() as patch:
            steps_that_change_files(patch, last)
            with contextlib.suppress(Killed):
                with files.Store.open(folder, request, plan(request)) as store:
                    for task in store.tasks():
                        store.put(task, carry_out(task))
                        kept += 1
                ended = True
        rendered, changed = make(folder, request)
        # The band that was being kept when the run was killed may be there or not.
        assert 6 - kept - 1 <= rendered <= 6 - kept
        assert changed == []
        assert content(folder) == content(tmp_path / "whole")
        if ended:
            break
    assert (last > 20, kept, rendered) == (True, 6, 0)


def test_a_journal_that_is_cut_short(tmp_path, whole) -> None:
    """A picture whose line is not whole is made again; those before it are kept."""
    with contextlib.suppress(Killed), files.Store.open(tmp_path, REQUEST, plan(REQUEST)) as store:
        for task in store.tasks()[:6]:
            store.put(task, carry_out(task))
        raise Killed
    journal = tmp_path / files.UNFINISHED / files.JOURNAL
    journal.write_text(journal.read_text()[:-10])
    assert set(files.verify(tmp_path, files.read_manifest(tmp_path)).values()) == {"not made yet"}
    assert make(tmp_path) == (15, [])
    assert content(tmp_path) == whole


def test_damage_is_found_and_mended(tmp_path, whole) -> None:
    """A bit that flipped, a file that was cut, one that is gone; a band that is damaged counts as none."""
    make(tmp_path)
    first, second, third = (
        tmp_path / f"train/0000{n}-{kind}.exr" for n, kind in ((0, "noisy"), (0, "target"), (1, "noisy"))
    )
    bits = bytearray(first.read_bytes())
    bits[200] ^= 1
    first.write_bytes(bits)
    second.write_bytes(second.read_bytes()[:-1])
    third.unlink()
    wrong = files.verify(tmp_path, files.read_manifest(tmp_path))
    assert list(wrong.values()) == ["damaged", "damaged", "missing"]
    with pytest.raises(InputError, match=r"3 of its images .*, first train/00000-noisy.exr: damaged \(make"):
        files.read_pairs(tmp_path)
    assert len(files.read_pairs(tmp_path, "test")) == 1
    with contextlib.suppress(Killed), files.Store.open(tmp_path, REQUEST, plan(REQUEST)) as store:
        store.put(store.tasks()[0], carry_out(store.tasks()[0]))
        raise Killed
    (band,) = (tmp_path / files.UNFINISHED).glob("*.exr")
    band.write_bytes(b"damaged")
    assert make(tmp_path) == (9, [])
    assert content(tmp_path) == whole


def test_other_bytes_are_told(tmp_path, whole) -> None:
    """What another machine had made is made again here, and named."""
    make(tmp_path)
    manifest = json.loads((tmp_path / files.MANIFEST).read_text())
    manifest["frames"][0]["noisy"]["sha256"] = "0" * 64
    (tmp_path / files.MANIFEST).write_text(json.dumps(manifest))
    assert make(tmp_path) == (3, ["train/00000-noisy.exr"])
    assert content(tmp_path) == whole


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"spp": 3}, r"holds another data set: spp 2 \(now 3\) \(choose another with -o"),
        ({"scene": "empty", "seed": 5}, r"scene cornell \(now empty\), seed 0 \(now 5\)"),
    ],
)
def test_another_request_is_refused(tmp_path, change, text) -> None:
    """Nothing is overwritten, nor by another version."""
    make(tmp_path)
    before = content(tmp_path)
    with pytest.raises(InputError, match=text):
        make(tmp_path, replace(REQUEST, **change))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frame_plan, "version", lambda: "99")
        with pytest.raises(InputError, match=r"another data set: wamnet .* \(now 99\)"):
            make(tmp_path)
    assert content(tmp_path) == before


@pytest.mark.nightly(but=("train", "unfinished"))
@pytest.mark.parametrize("name", ["unfinished", "train", "test", "outside", "unfinished/journal.jsonl"])
def test_links_in_a_data_set_are_refused_before_anything_changes(tmp_path, name) -> None:
    """A link of a work folder's name once led to the removal of all files in another folder."""
    folder, victim = tmp_path / "a", tmp_path / "victim"
    with files.Store.open(folder, REQUEST, plan(REQUEST)):
        pass
    victim.mkdir()
    (victim / "thesis.txt").write_text("precious")
    link = folder / name
    if link.is_dir():
        for path in link.iterdir():
            path.unlink()
        link.rmdir()
    link.unlink(missing_ok=True)
    link.symlink_to(victim if link.suffix == "" else victim / "thesis.txt")
    before = content(tmp_path)
    with pytest.raises(InputError, match=r"is a symbolic link|one of the files that wamnet writes"):
        make(folder)
    assert content(tmp_path) == before
    link.unlink()
    assert make(folder)[0] == 18


def text(path: Path) -> None:
    path.write_text("precious")


def link(path: Path) -> None:
    path.symlink_to(path.parents[1])


def moved(path: Path) -> None:
    path.rename(path.parents[1] / "m.json")
    path.symlink_to(path.parents[1] / "m.json")


@pytest.mark.parametrize(
    ("name", "put", "rule"),
    [
        (f"{files.UNFINISHED}/thesis.txt", text, r"that wamnet writes there \(move it"),
        (f"{files.UNFINISHED}/train-00000-noisy.0-6.{64 * '0'}.exr", link, r"writes there \(move it"),
        (files.MANIFEST, moved, r"manifest\.json': is not one of the files"),
    ],
)
def test_other_files_in_a_data_set_are_refused(tmp_path, name, put, rule) -> None:
    """They stay: one of another name, a link of a band's, and one of the manifest's, which is replaced."""
    with files.Store.open(tmp_path / "a", REQUEST, plan(REQUEST)):
        pass
    path = tmp_path / "a" / name
    put(path)
    with pytest.raises(InputError, match=rule):
        make(tmp_path / "a")
    assert path.exists()


def test_a_pipe_is_no_picture(tmp_path) -> None:
    """It is missing, and its name does not make a reader wait."""
    make(tmp_path / "a")
    path = tmp_path / "a/train/00000-noisy.exr"
    path.unlink()
    os.mkfifo(path)
    found = files.verify(tmp_path / "a", files.read_manifest(tmp_path / "a"))
    assert found == {"train/00000-noisy.exr": "missing"}
    with pytest.raises(InputError, match="not a regular file"):
        files.sum_of(path)


def test_folders_that_are_something_else(tmp_path) -> None:
    """A file, a folder with files, a folder in which another process works."""
    (tmp_path / "file").write_text("kept")
    with pytest.raises(InputError, match=r"is a file \(choose another with -o"):
        make(tmp_path / "file")
    with pytest.raises(InputError, match=r"holds something else \(choose a new or empty one"):
        make(tmp_path)
    with (
        files.Store.open(tmp_path / "a", REQUEST, plan(REQUEST)),
        pytest.raises(InputError, match=r"another process is making a data set there \(wait for it"),
    ):
        make(tmp_path / "a")
    assert make(tmp_path / "a")[0] == 18
    assert not (tmp_path / "a" / LOCK).exists()


@pytest.mark.parametrize(
    "line", [b"\xff\x00\xfe", b'{"file": "a", "bytes": 1e999, "sha256": ""}', 50000 * b"["]
)
def test_a_journal_that_is_damaged(tmp_path, whole, line) -> None:
    """As a power cut may leave it: what can be read of it counts, and nothing else."""
    with contextlib.suppress(Killed), files.Store.open(tmp_path, REQUEST, plan(REQUEST)) as store:
        for task in store.tasks()[:6]:
            store.put(task, carry_out(task))
        raise Killed
    journal = tmp_path / files.UNFINISHED / files.JOURNAL
    journal.write_bytes(line + b"\n" + journal.read_bytes())
    assert make(tmp_path) == (12, [])
    assert content(tmp_path) == whole


@pytest.mark.nightly(
    but=('"frames": [-"pictures": [-or damaged', "train/00000-noisy.exr-../../00000-noisy.exr-or damaged")
)
@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("{", "[", r"manifest '.*': is not a manifest of a data set, or damaged \(restore it, or make"),
        ("wamnet-dataset-2", "wamnet-dataset-9", "schema 'wamnet-dataset-9': must be wamnet-dataset-2"),
        ('"schema"', '"schemes"', "or damaged"),
        ('"frames": [', '"pictures": [', "or damaged"),
        ("train/00000-noisy.exr", "../../00000-noisy.exr", "or damaged"),
        ('"split": "train"', '"split": "rest"', "or damaged"),
        ('"bytes": ', '"bytes": "x", "was": ', "or damaged"),
        ('"bytes": ', '"bytes": 1e999, "was": ', "or damaged"),
        ('"bytes": ', '"bytes": -1, "was": ', "or damaged"),
        ('"sha256": "', '"sha256": "A', "or damaged"),
        ("{", 50000 * "[", "or damaged"),
    ],
)
def test_manifests_that_are_none(tmp_path, old, new, text) -> None:
    """One line each; a name never leads out of the folder."""
    with pytest.raises(InputError, match=r"has no manifest.json \(make one: wamnet dataset"):
        files.read_manifest(tmp_path)
    make(tmp_path)
    path = tmp_path / files.MANIFEST
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match=text):
        files.read_manifest(tmp_path)


def test_a_picture_of_another_length_is_not_read(tmp_path, monkeypatch) -> None:
    """DSF-8: nor is one that grows while it is read."""
    path = tmp_path / "a.exr"
    path.write_bytes(bytes(5))
    assert files.sum_of(path, 5) == files.sum_of(path)
    with path.open("r+b") as file:
        file.truncate(2**40)
    assert files.sum_of(path, 5) == files.Sum(2**40, "")
    found = os.stat_result((0o100644, *[0] * 5, 5, *[0] * 3))
    monkeypatch.setattr(files.os, "fstat", lambda _handle: found)
    assert files.sum_of(path, 5).bytes == 2**20


def test_layers_of_another_program_are_told_once(tmp_path, monkeypatch) -> None:
    """`train --dataset` says so as `train -i` does; not for each picture."""
    make(tmp_path)
    said: list[str] = []
    files.read_pairs(tmp_path, tell=said.append)
    assert said == []
    monkeypatch.setattr("wamnet.cli.files.exr._attribute_notes", lambda *_: ["color is taken from a, b, c"])
    pairs = files.read_pairs(tmp_path, tell=said.append)
    assert said == [f"{tmp_path}, {2 * len(pairs)} of {2 * len(pairs)} images: color is taken from a, b, c"]


def test_other_frames_are_refused(tmp_path) -> None:
    """The scene's digest at a time is not what this version makes of the same request."""
    make(tmp_path)
    text = (tmp_path / files.MANIFEST).read_text()
    digest = json.loads(text)["frames"][0]["scene_digest"]
    (tmp_path / files.MANIFEST).write_text(text.replace(digest, "0" * 64))
    with pytest.raises(InputError, match=r"the frames themselves \(now others\)"):
        make(tmp_path)


def test_hidden_files_of_others_stay(tmp_path) -> None:
    """Only unfinished files of this project's names are removed; no folder, and no link of such a name."""
    (tmp_path / "a").mkdir()
    names = [".wamnet-notes", ".wamnet-0123456789abcdef", ".wamnet-fedcba9876543210.json"]
    (tmp_path / "a" / names[0]).write_text("mine")
    (tmp_path / "a" / names[1]).mkdir()
    (tmp_path / "a" / names[2]).symlink_to(tmp_path)
    (tmp_path / "a" / ".wamnet-0123456789abcdee.json").write_text("{")
    make(tmp_path / "a")
    assert sorted(path.name for path in (tmp_path / "a").glob(".*")) == sorted(names)


def test_a_folder_with_a_picture_s_name_is_refused_before_anything_is_made(tmp_path) -> None:
    """The last step of a picture is a renaming, which a folder of that name would stop in the middle."""
    make(tmp_path / "a")
    path = tmp_path / "a/train/00000-noisy.exr"
    path.unlink()
    path.mkdir()
    (path / "mine").write_text("kept")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(InputError, match=r"image '.*noisy\.exr': is a folder \(move it, or"):
        make(tmp_path / "a")
    assert sorted(tmp_path.rglob("*")) == before
