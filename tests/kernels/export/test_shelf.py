"""The shelf is what its command writes: golden text of each language, and an index that names every file."""

from __future__ import annotations

from pathlib import Path

from wamnet.compiler.model_file import load_model
from wamnet.kernels.export import shelf

ROOT = Path(__file__).resolve().parents[3]
"""The repository's root folder."""

WAY_OUT = "run python -m wamnet.kernels.export.shelf -o kernels/shelf MODELS, read git diff, and commit it"
"""What to do when a kernel has changed on purpose."""


def models(folder):
    """Return the models whose kernels stand in a folder: one of random weights, or those that come along."""
    names = sorted(path.name for path in folder.iterdir() if path.is_dir())
    assert names, f"kernels/shelf is empty: {WAY_OUT}"
    return {
        name: shelf.random_model()
        if name == shelf.SMALL
        else load_model(ROOT / f"cli/models/{name}.safetensors")
        for name in names
    }


def test_the_shelf_is_what_the_compiler_writes():
    """But for the speeds in the index, which are measurements."""
    folder = ROOT / "kernels/shelf"
    wanted = shelf.contents(models(folder))
    paths = [path for path in folder.rglob("*") if path.is_file()]
    held = {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
    assert set(held) == set(wanted), WAY_OUT
    changed = [name for name in wanted if name != shelf.INDEX and held[name] != wanted[name]]
    assert changed == [], WAY_OUT
    both = (files[shelf.INDEX].decode().splitlines() for files in (held, wanted))
    lines = zip(*both, strict=True)
    assert all(a.rpartition(" | ")[0] == b.rpartition(" | ")[0] for a, b in lines), WAY_OUT


def test_the_command_replaces_a_shelf(tmp_path):
    out = tmp_path / "shelf"
    shelf.write(out, {"old.txt": b"x"})
    shelf.main(["-o", str(out), "--measure", "8"])
    assert not (out / "old.txt").exists()
    index = (out / "README.md").read_text()
    assert all(f"{target}](small/{target}/" in index for target in shelf.KEPT)
    lines = {target: line for line in index.splitlines() for target in shelf.KEPT if f"[{target}]" in line}
    assert all(line.endswith("| not measured |") for t, line in lines.items() if t not in shelf.TIMED)
    assert any(line.endswith(" ms, 8x8 |") for line in lines.values())
