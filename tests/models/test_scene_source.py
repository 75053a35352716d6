"""Tests of the one place where scenes are loaded: any name, any file, and nobody beside it."""

import ast
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.models.data.scene_source import SCENE_FILE, scene_source
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.scene import from_json, to_json
from wamnet.refimpl.light.scenes import CANONICAL, canonical

ROOT = Path(__file__).parents[2]

LOADERS = {"canonical", "from_json"}
"""Functions of the reference that a command must not call by itself."""


@pytest.mark.parametrize("name", CANONICAL)
def test_a_file_is_the_scene_at_every_time(tmp_path, name) -> None:
    """Of each canonical scene as text; identified by its bytes, whatever the file says of itself."""
    content = to_json(canonical(name, time=1.0)).encode().replace(b'"time"', f'"{SCENE_FILE}"'.encode())
    path = tmp_path / "mine.json"
    path.write_bytes(content)
    source = scene_source(str(path))
    assert source.sha256 == sha256(content).hexdigest() == source.at().info[SCENE_FILE]
    assert source.at() == source.at(5.0) == from_json(content) == canonical(name, time=1.0)
    assert scene_source(name).sha256 == ""
    assert scene_source(name, {"time": 2.0}).at(3.0) == canonical(name, time=3.0)


@given(st.one_of(st.text(), st.text(max_size=5).map(lambda text: f"{text}.json"), st.just("n" * 300)))
def test_a_name_of_nothing_is_one_error(name) -> None:
    """Whatever its characters and its length."""
    with pytest.raises(InputError, match=r"^scene (file )?'.*': .+ \(.+\)$"):
        scene_source(name)


def test_the_example_is_a_scene() -> None:
    """Of fifteen things of all materials under two lights."""
    scene = scene_source(str(ROOT / "examples/scenes/still-life.json")).at()
    things = (*scene.boxes, *scene.spheres, *scene.quads)
    kinds = {"lambertian" if thing.material is None else thing.material.kind for thing in things}
    assert (len(things), len(scene.lights), len(kinds)) == (15, 2, 4)


def test_commands_load_scenes_here_alone() -> None:
    """A command that takes canonical names by itself would not take files."""
    wrong = [
        f"{path.relative_to(ROOT)}:{node.lineno}"
        for folder in ("cli/commands", "cli/reports", "kernels/bench")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom)
        and (node.module or "").split(".")[-1] in ("scene", "scenes")
        and LOADERS & {alias.name for alias in node.names}
    ]
    assert wrong == []
