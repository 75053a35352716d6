"""The wheel holds the package, the whole package and nothing but the package."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile

import pytest

pytestmark = pytest.mark.needs("programs")

PARTS = ("wamnet", "models", "refimpl", "compiler", "kernels", "cli")
"""The folders that become `wamnet.refimpl` and so on."""

OF_SPEC = ("spec/conformance", "spec/vectors")
"""What of the spec is installed, as `wamnet.spec`: the texts are not."""

SHELF = "kernels/shelf/"
"""Kernels to be read and pasted: no program needs them, `wamnet export` writes them again."""

NOT_DATA = {".pyc"}
"""Suffixes of files in these folders that are not part of the package."""


@pytest.fixture(scope="module")
def wheel(house, tmp_path_factory) -> zipfile.ZipFile:
    """Give the wheel built from a copy of the tree, with the setuptools of this environment."""
    folder = tmp_path_factory.mktemp("wheel")
    tree = folder / "tree"
    (tree / "spec").mkdir(parents=True)
    shutil.copy(house.root / "spec/__init__.py", tree / "spec")
    for part in (*PARTS, *OF_SPEC):
        shutil.copytree(house.root / part, tree / part, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "LICENSE", "README.md"):
        shutil.copy(house.root / name, tree / name)
    command = "pip wheel --quiet --no-deps --no-build-isolation --disable-pip-version-check --wheel-dir"
    subprocess.run(
        [sys.executable, "-m", *command.split(), folder, tree], check=True, stdin=subprocess.DEVNULL
    )
    return zipfile.ZipFile(next(folder.glob("*.whl")))


def test_wheel_equals_the_tree(house, wheel):
    wanted = {
        f"wamnet/{name.removeprefix('wamnet/')}"
        for name in (path.relative_to(house.root).as_posix() for path in house.files())
        if name.startswith(("spec/__init__.py", *(f"{part}/" for part in (*PARTS, *OF_SPEC))))
        and not name.startswith(SHELF)
        and not name.endswith(tuple(NOT_DATA))
    }
    found = {name for name in wheel.namelist() if ".dist-info/" not in name}
    differences = [f"{name}: in the tree, not in the wheel" for name in sorted(wanted - found)]
    differences += [f"{name}: in the wheel, not in the tree" for name in sorted(found - wanted)]
    house.refuse(
        differences, "The wheel installs what the tree holds: list packages and data in pyproject.toml."
    )


def test_wheel_brings_one_top_level_name(wheel):
    names = {name.partition("/")[0] for name in wheel.namelist() if ".dist-info/" not in name}
    assert names == {"wamnet"}, f"site-packages would get {sorted(names)}: everything belongs under wamnet"


def test_wheel_has_the_command_and_the_licence(wheel):
    texts = {
        name.rpartition("/")[2]: wheel.read(name).decode()
        for name in wheel.namelist()
        if ".dist-info/" in name
    }
    assert "wamnet = wamnet.cli.entry:run" in texts["entry_points.txt"]
    assert "Apache License" in texts["LICENSE"]


def test_base_install_needs_numpy_and_safetensors_alone(wheel):
    metadata = next(
        wheel.read(name).decode() for name in wheel.namelist() if name.endswith(".dist-info/METADATA")
    )
    needs = [
        line.removeprefix("Requires-Dist: ")
        for line in metadata.splitlines()
        if line.startswith("Requires-Dist:")
    ]
    base = sorted(need for need in needs if "extra ==" not in need)
    assert [need.rstrip("0123456789.").rstrip(">=") for need in base] == ["numpy", "safetensors"]
