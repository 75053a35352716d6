"""The wheel holds the package, the whole package and nothing but the package."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from email import message_from_string
from email.message import Message
from importlib.metadata import distribution
from pathlib import Path
from typing import Any

import pytest
import quick

pytestmark = pytest.mark.needs("programs")

PARTS = ("wamnet", "models", "refimpl", "compiler", "kernels", "cli")
"""The folders that become `wamnet.refimpl` and so on."""

OF_SPEC = ("spec/conformance", "spec/vectors")
"""What of the spec is installed, as `wamnet.spec`: the texts are not."""

SHELF = "kernels/shelf/"
"""Kernels to be read and pasted: no program needs them, `wamnet export` writes them again."""

NOT_DATA = {".pyc"}
"""Suffixes of files in these folders that are not part of the package."""


IN_WHEEL = (*PARTS, *OF_SPEC, "spec/__init__.py", "pyproject.toml", "setup.py", "LICENSE", "README.md")
"""What of the tree a wheel is built from; a source distribution has more."""


def built(kind: str, tree: Path, folder: Path) -> Path:
    """Return the `wheel` or `sdist` of a tree or an sdist, built by the setuptools of this environment."""
    pip = "-m pip wheel --quiet --no-deps --no-build-isolation --disable-pip-version-check --wheel-dir"
    sdist = "-m build --quiet --sdist --no-isolation --outdir"
    command = [sys.executable, *(pip if kind == "wheel" else sdist).split(), folder, tree]
    subprocess.run(command, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    return next(folder.glob("*.whl" if kind == "wheel" else "*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(house, tmp_path_factory) -> zipfile.ZipFile:
    """Give the wheel built from a copy of the tree."""
    folder = tmp_path_factory.mktemp("wheel")
    for name in IN_WHEEL:
        copy, source = folder / "tree" / name, house.root / name
        copy.parent.mkdir(parents=True, exist_ok=True)
        if source.is_dir():
            shutil.copytree(source, copy, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, copy)
    return zipfile.ZipFile(built("wheel", folder / "tree", folder))


@pytest.fixture(scope="module")
def from_sdist(house, tmp_path_factory) -> Path:
    """Give the wheel that is built from the source distribution."""
    folder = tmp_path_factory.mktemp("sdist")
    for path in house.files():
        copy = folder / "tree" / path.relative_to(house.root)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
    return built("wheel", built("sdist", folder / "tree", folder), folder)


def test_wheel_equals_the_tree(house, wheel):
    wanted = {
        f"wamnet/{name.removeprefix('wamnet/')}"
        for name in (path.relative_to(house.root).as_posix() for path in house.files())
        if name.startswith(("spec/__init__.py", *(f"{part}/" for part in (*PARTS, *OF_SPEC))))
        and not name.startswith((SHELF, *(f"{folder}/" for folder in house.distributions)))
        and not name.endswith(tuple(NOT_DATA))
    }
    found = {name for name in wheel.namelist() if ".dist-info/" not in name}
    differences = [f"{name}: in the tree, not in the wheel" for name in sorted(wanted - found)]
    differences += [f"{name}: in the wheel, not in the tree" for name in sorted(found - wanted)]
    house.refuse(
        differences, "The wheel installs what the tree holds: list packages and data in pyproject.toml."
    )


@pytest.mark.nightly
@pytest.mark.parametrize("folder", quick.DISTRIBUTIONS)
def test_wheels_of_other_distributions_equal_their_folders(house, tmp_path, folder):
    """And have the version of the package."""
    unbuilt = shutil.ignore_patterns("__pycache__", "build")
    shutil.copytree(house.root / folder, tmp_path / "tree", ignore=unbuilt)
    archive = built("wheel", tmp_path / "tree", tmp_path)
    top = house.distributions[folder]
    assert archive.name.startswith(f"{top}-{project()['version']}-")
    prefix, beside = f"{folder}/", ("pyproject.toml", *(f"{other}/" for other in quick.DISTRIBUTIONS))
    names = (path.relative_to(house.root).as_posix() for path in house.files())
    inside = (name.removeprefix(prefix) for name in names if name.startswith(prefix))
    wanted = {f"{top}/{name}" for name in inside if not name.startswith(beside) and not name.endswith(".pyc")}
    with zipfile.ZipFile(archive) as wheel:
        assert {name for name in wheel.namelist() if ".dist-info/" not in name} == wanted


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


@pytest.fixture(scope="module")
def metadata(wheel) -> Message:
    """Give what a package index reads of the wheel; its payload is the description."""
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return message_from_string(wheel.read(name).decode())


def test_base_install_needs_numpy_and_safetensors_alone(metadata):
    base = sorted(need for need in metadata.get_all("Requires-Dist") if "extra ==" not in need)
    assert [need.rstrip("0123456789.").rstrip(">=") for need in base] == ["numpy", "safetensors"]


def test_metadata_names_home_and_authors(house, metadata):
    """The citation names the same home, version and authors."""
    urls = dict(line.split(", ") for line in metadata.get_all("Project-URL"))
    assert set(urls) == {"Homepage", "Documentation", "Issues", "Changelog"}
    assert all(url.startswith(urls["Homepage"]) for url in urls.values())
    citation = (house.root / "CITATION.cff").read_text(encoding="utf-8")
    for line in (
        f'repository-code: "{urls["Homepage"]}"',
        f"version: {metadata['Version']}",
        f'- name: "{metadata["Author"]}"',
        f"license: {metadata['License-Expression']}",
    ):
        assert line in citation


def test_description_does_not_depend_on_files(metadata):
    assert metadata["Description-Content-Type"] == "text/markdown"
    description = metadata.get_payload()
    targets = re.findall(r"\]\(([^)]*)\)|(?:src|href)=\"([^\"]*)", description)
    assert len(targets) > 10
    assert all("".join(target).startswith("https://") for target in targets), targets
    assert "<!--" not in description


@pytest.mark.nightly
def test_source_distribution_builds_the_same_wheel(wheel, from_sdist):
    def contents(archive: zipfile.ZipFile) -> dict[str, int]:
        return {member.filename: member.CRC for member in archive.infolist()}

    assert contents(zipfile.ZipFile(from_sdist)) == contents(wheel)


def environment(folder: Path, wheel: Path | str, requirements: list[str]) -> Path:
    """Make a virtual environment of a wheel and what `requirements` install; return its programs.

    The packages are links to those of this environment: nothing is downloaded.
    """
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for name in quick.distributions(requirements):
        for top in {path.parts[0] for path in distribution(name).files or ()} - {"..", "__pycache__"}:
            if not (site / top).is_symlink():
                (site / top).symlink_to(distribution(name).locate_file(top))
    pip = "pip --disable-pip-version-check --quiet --python"
    install = [folder / "bin/python", "install", "--no-deps", "--no-index", wheel]
    subprocess.run([sys.executable, "-m", *pip.split(), *install], check=True)
    return folder / "bin"


@pytest.fixture
def outside(tmp_path, wheel):
    """Give a function that runs commands in a new environment, outside the repository."""

    def run(requirements: list[str], archive: Path | str, *commands: str) -> list[tuple[int, str]]:
        programs = environment(tmp_path / "environment", archive, requirements)
        variables = {"PATH": f"{programs}:{os.defpath}", "HOME": str(tmp_path), "OPENBLAS_NUM_THREADS": "1"}
        results = []
        for command in commands:
            done = subprocess.run(
                command.split(), cwd=tmp_path, env=variables, capture_output=True, text=True, check=False
            )
            results.append((done.returncode, done.stderr))
        return results

    return run


def project() -> dict[str, Any]:
    """Return the table `project` of pyproject.toml."""
    return quick.tomllib.loads(quick.PROJECT.read_text(encoding="utf-8"))["project"]


def test_base_installation_names_the_extra_in_one_line(wheel, outside):
    """It was a traceback."""
    ((status, error),) = outside(project()["dependencies"], wheel.filename, "wamnet demo")
    rule = "missing, and needed for the command"
    line = f"Python package 'typer': {rule} (install it: pip install 'wamnet[full]')"
    assert (status, error) == (2, f"wamnet: error: {line}\n")


@pytest.mark.nightly
def test_full_installation_runs_outside_the_repository(from_sdist, outside, tmp_path):
    """`demo`, `view` and `bench` needed extras of their own. The wheel is that of both distributions."""
    extras = [each for extra in project()["optional-dependencies"].values() for each in extra]
    requirements = project()["dependencies"] + [each for each in extras if not each.startswith("wamnet")]
    results = outside(
        requirements,
        from_sdist,
        "wamnet view minicubes -o view.html",
        "wamnet bench minicubes --only numpy:plain --size 16 --repeats 1 --budget 2 -o bench",
        "wamnet demo --quick -o demo",
        "wamnet course check 1",
    )
    assert [status for status, _ in results] == [0, 0, 0, 2], results
    assert results[-1][1] == (
        "wamnet: error: command 'course': distribution wamnet-course is not installed "
        "(install it: pip install wamnet-course)\n"
    )
    for name in ("view.html", "bench/bench.md", "demo/report.html"):
        assert (tmp_path / name).stat().st_size
