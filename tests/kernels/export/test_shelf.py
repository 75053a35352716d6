"""The shelf is what its command writes."""

from pathlib import Path

import pytest
import shelf

from wamnet.compiler.artifact import CERTIFICATE_NAME
from wamnet.compiler.proof.checker import check
from wamnet.kernels.bench.workload import random_model
from wamnet.models.model_file import load_model
from wamnet.refimpl.errors import InputError

ROOT = Path(__file__).resolve().parents[3]
"""The repository's root folder."""

LARGEST_PROOFS = 500_000
"""Most bytes of all certificates and manifests of the shelf: whoever clones the repository has them."""

WAY_OUT = "run python experiments/shelf.py -o kernels/shelf MODELS, read git diff, and commit it"
"""What to do when a kernel has changed on purpose."""


def models(folder):
    """Return the models whose kernels are in a folder: one of random weights, or those that are shipped."""
    names = sorted(path.name for path in folder.iterdir() if path.is_dir())
    assert names, f"kernels/shelf is empty: {WAY_OUT}"
    return {
        name: random_model() if name == shelf.SMALL else load_model(ROOT / f"models/{name}.safetensors")
        for name in names
    }


def test_the_shelf_is_what_the_compiler_writes():
    """Golden text of each language, with manifest, certificate and index."""
    folder = ROOT / "kernels/shelf"
    wanted = shelf.contents(models(folder))
    paths = [path for path in folder.rglob("*") if path.is_file()]
    held = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
    assert set(held) == set(wanted), WAY_OUT
    assert [name for name in wanted if held[name] != wanted[name]] == [], WAY_OUT
    proofs = sum(len(data) for name, data in held.items() if name.endswith(".json"))
    assert proofs <= LARGEST_PROOFS


def test_the_command_replaces_a_shelf(tmp_path):
    out = tmp_path / "shelf"
    shelf.write(out, {"old/weights.bin": b"x", "old/c/denoise.h": b"y"})
    shelf.main(["-o", str(out)])
    assert not (out / "old").exists()
    index = (out / "README.md").read_text()
    assert all(f"{target}](small/{target}/" in index for target in shelf.KEPT)
    assert all(check(out / f"small/{target}" / CERTIFICATE_NAME) for target in shelf.KEPT)


@pytest.mark.parametrize(
    "name",
    ["thesis.txt", "small/thesis.txt", "small/c/notes.h", "small/c/notes.json", "linked", "small/linked"],
)
def test_a_folder_with_anything_else_is_refused_and_stays(tmp_path, name):
    """The whole folder that -o named was removed, whatever lay in it."""
    (tmp_path / "victim").mkdir()
    (tmp_path / "victim/weights.bin").write_bytes(b"x")
    out = tmp_path / "shelf"
    shelf.write(out, {"small/weights.bin": b"x", "small/c/denoise.h": b"y"})
    if name.endswith("linked"):
        (out / name).symlink_to(tmp_path / "victim")
    else:
        (out / name).write_bytes(b"x")
    before = sorted(path for path in tmp_path.rglob("*"))
    with pytest.raises(InputError, match=rf"is not a shelf: it holds {name} \(name another"):
        shelf.write(out, {"README.md": b"new"})
    assert sorted(path for path in tmp_path.rglob("*")) == before


def test_a_link_to_a_folder_is_no_shelf(tmp_path):
    (tmp_path / "victim").mkdir()
    (tmp_path / "shelf").symlink_to("victim")
    with pytest.raises(InputError, match="is not a shelf: a link or a file"):
        shelf.write(tmp_path / "shelf", {"README.md": b"new"})
    assert not list((tmp_path / "victim").iterdir())


def test_an_error_is_one_line(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(SystemExit, match=r"shelf: error: output folder '.*': is not a shelf"):
        shelf.main(["-o", str(tmp_path / "file")])
