"""A data set's folder under everything that may happen to it between runs, in any order [Hypothesis].

Whatever was done to the folder, the next run ends with the bytes of an undisturbed one, or refuses the folder
with one error and changes nothing; and nothing outside of the folder is ever touched.
"""

import shutil
import tempfile
from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from wamnet.cli.files import dataset_files as files
from wamnet.kernels.run.before import carry_out
from wamnet.models.data import frame_plan
from wamnet.models.data.frame_plan import Request, Task, plan
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame

REQUEST = Request("cornell", frames=1, test_frames=1, size_px=4, spp=2)

PRECIOUS = b"somebody's thesis"


BANDS: dict[tuple[str, tuple[int, int]], Frame] = {}
"""Each band, rendered once."""


def band(task: Task) -> Frame:
    """Return a band."""
    key = task.picture.name, task.rows
    if key not in BANDS:
        BANDS[key] = carry_out(task)
    return BANDS[key]


def content(folder: Path) -> dict[str, bytes]:
    """Return every regular file, links not followed."""
    found = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}


def make(folder: Path, bands: int | None = None) -> None:
    """Make what is missing, or only some bands of it, as a run does that is then killed."""
    with files.Store.open(folder, REQUEST, plan(REQUEST)) as store:
        for task in store.tasks()[:bands]:
            store.put(task, band(task))


@pytest.fixture(scope="module", autouse=True)
def two_bands():
    """Cut each picture of four rows into two bands."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(frame_plan, "TASK_SAMPLES", 1)
        patch.setattr(frame_plan, "TILE_PIXELS", 8)
        yield


class DataSet(RuleBasedStateMachine):
    """The folder `set`, beside a folder that must stay as it is."""

    whole: dict[str, bytes] | None = None

    @initialize()
    def begin(self) -> None:
        self.top = Path(tempfile.mkdtemp(prefix="wamnet-machine-"))
        self.folder, self.victim = self.top / "set", self.top / "victim"
        self.victim.mkdir()
        (self.victim / "thesis.txt").write_bytes(PRECIOUS)
        if type(self).whole is None:
            make(self.top / "undisturbed")
            type(self).whole = content(self.top / "undisturbed")

    def teardown(self) -> None:
        shutil.rmtree(self.top, ignore_errors=True)

    @invariant()
    def nothing_else_is_touched(self) -> None:
        if hasattr(self, "victim"):
            assert content(self.victim) == {"thesis.txt": PRECIOUS}

    @rule(bands=st.integers(0, 5))
    def run_is_ended(self, bands: int) -> None:
        self._run(bands)

    @rule()
    def run_to_the_end(self) -> None:
        if self._run(None):
            found = content(self.folder).items()
            # A half-written picture is the project's in its work folder only; elsewhere it is left alone.
            own = {name: data for name, data in found if "stray" not in name and Path(name).name != files.NEW}
            assert own == self.whole

    def _run(self, bands: int | None) -> bool:
        """Run; a refusal leaves everything as it was."""
        before = content(self.folder)
        try:
            make(self.folder, bands)
        except InputError:
            assert content(self.folder) == before
            return False
        return True

    @rule(data=st.data(), way=st.sampled_from(["gone", "empty", "cut", "changed", "link", "folder"]))
    def a_file_is_harmed(self, data: st.DataObject, way: str) -> None:
        names = sorted(content(self.folder))
        if not names:
            return
        path = self.folder / data.draw(st.sampled_from(names))
        old = path.read_bytes()
        path.unlink()
        if way == "link":
            path.symlink_to(self.victim / "thesis.txt")
        elif way == "folder":
            path.mkdir()
        elif way != "gone":
            path.write_bytes({"empty": b"", "cut": old[: len(old) // 2], "changed": old[::-1]}[way])

    @rule(name=st.sampled_from(["unfinished", "train", "test", "outside"]))
    def a_folder_is_replaced_by_a_link(self, name: str) -> None:
        path = self.folder / name
        if self.folder.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
            path.symlink_to(self.victim)

    @rule(
        where=st.sampled_from(["", "unfinished", "train"]),
        name=st.sampled_from(["stray.txt", ".wamnet-stray", "stray.1-2.exr", "new.exr", "stray-folder"]),
    )
    def a_stray_thing_appears(self, where: str, name: str) -> None:
        place = self.folder / where
        path = place / name
        if not place.is_dir() or place.is_symlink() or path.exists() or path.is_symlink():
            return
        if name == "stray-folder":
            path.mkdir()
        elif name == ".wamnet-stray":
            path.symlink_to(self.victim / "thesis.txt")
        else:
            path.write_bytes(b"stray")

    @rule()
    def links_and_folders_are_mended(self) -> None:
        """As a user would after a refusal: what is not a file of a data set goes."""
        for path in sorted(self.folder.rglob("*"), reverse=True):
            if path.is_symlink():
                path.unlink()
            elif path.is_dir() and path.suffix:
                path.rmdir()

    @rule()
    def begun_anew(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)


DataSet.TestCase.settings = settings(max_examples=100, stateful_step_count=12)


@pytest.mark.nightly
class TestDataSet(DataSet.TestCase):
    """The machine, as a test."""
