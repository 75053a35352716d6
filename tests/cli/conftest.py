"""What the tests of the commands share: a way to run one, and small frames and a model to run them on."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from browser import Tab
from small_page import NO_MOTION, SmallPage, make

from wamnet.cli.files import exr
from wamnet.cli.main import main
from wamnet.models.model_file import save_model
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window


class Outcome(NamedTuple):
    """What a command leaves behind, except for files."""

    status: int
    out: str
    err: str


Command = Callable[..., Outcome]


@pytest.fixture(scope="session", autouse=True)
def extras(needs: Callable[[str], None]) -> None:
    """Need the packages of the extras: the command prints, draws and writes pictures with them."""
    needs("packages")


@pytest.fixture
def wamnet(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Command:
    """Give a function that runs `wamnet ARGUMENTS` in an empty folder, in this process."""
    monkeypatch.chdir(tmp_path)
    # Help and tables wrap at the terminal's width.
    monkeypatch.setenv("COLUMNS", "200")

    def run(*arguments: object) -> Outcome:
        capsys.readouterr()
        status = main([str(argument) for argument in arguments])
        return Outcome(status, *capsys.readouterr())

    return run


@pytest.fixture
def refused(wamnet: Command, tmp_path: Path) -> Callable[..., str]:
    """Give a function that runs a command that must fail as stated, touch no file, and returns its line."""

    def run(*arguments: object) -> str:
        before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        outcome = wamnet(*arguments)
        assert outcome.status == 2
        assert outcome.out == ""
        assert outcome.err.startswith("wamnet: error: ")
        assert outcome.err.count("\n") == 1
        assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
        return outcome.err

    return run


@pytest.fixture(scope="session")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with noisy.exr and reference.exr (13x12 pixels) and model.safetensors (untrained)."""
    folder = tmp_path_factory.mktemp("samples")
    scene = canonical("minicubes", time=1.0)
    exr.write_frame(folder / "noisy.exr", render(scene, Job(13, 12, 1, 1)).frame)
    exr.write_frame(folder / "reference.exr", render(scene, Job(13, 12, 8, 2)).frame)
    network = siren.init((4 * 4 * 6, 8, 3), 2.0, 2.0, 5, np.float32)
    model = Model(network, ("color", "normal"), Window(4, "clamp"), Normalization(), {})
    save_model(folder / "model.safetensors", model)
    return folder


@pytest.fixture(scope="session")
def small_page(kit: Any, tmp_path_factory: pytest.TempPathFactory) -> SmallPage:
    """A page that is drawn in a moment, for the tests in a browser."""
    return make(kit, tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def path(small_page: SmallPage) -> Path:
    """The file of that page."""
    return small_page.path


@pytest.fixture(scope="module")
def still(chromium: Any, path: Path) -> Iterator[Tab]:
    """A tab whose animation stands still, ready."""
    with chromium.tab(path, **NO_MOTION) as tab:
        tab.page.evaluate("wamnet.ready")
        yield tab
