"""`.ci/setup` refuses what cannot work in one sentence, and touches nothing; `make` lists its targets."""

import fnmatch
import os
import re
import subprocess

import pytest

pytestmark = pytest.mark.needs("programs")


def setup(house, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [house.root / ".ci/setup", *arguments],
        env=os.environ | {"VENV": "no/such/environment"} | variables,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )


def python_that_says(folder, script: str) -> str:
    """Return the path of a stand-in for Python that answers by a shell script."""
    path = folder / "python"
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return str(path)


def test_python_that_is_not_there(house):
    done = setup(house, "all", PYTHON="no-such-python")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("set-up: no-such-python is not installed: Python 3.10 or newer is needed")


def test_python_that_is_too_old(house, tmp_path):
    old = python_that_says(tmp_path, 'case "$2" in *print*) echo 3.9;; *) exit 1;; esac')
    done = setup(house, "all", PYTHON=old)
    assert (done.returncode, done.stdout) == (1, "")
    assert (
        done.stderr
        == f"set-up: {old} is Python 3.9: 3.10 or newer is needed; set PYTHON=python3.11, for example\n"
    )


@pytest.mark.parametrize(
    ("given", "required"),
    [
        ("WAMNET_REQUIRE=c", "c"),
        ("WAMNET_REQUIRE=c ALSO=torch", "c,torch"),
        ("ALSO=torch,pyoidn", "opencl,*,pyoidn"),
    ],
)
def test_what_make_requires(house, given, required):
    """A rule of its own prints what tests are given, whatever the make that runs the tests was given."""
    handed_down = {"MAKEFLAGS", "MAKEOVERRIDES", "MAKELEVEL", "ALSO", "WAMNET_REQUIRE"}
    environment = {name: value for name, value in os.environ.items() if name not in handed_down}
    command = ["make", "-C", house.root, "--no-print-directory", *given.split()]
    rule = "--eval=shown: ; @echo $$WAMNET_REQUIRE"
    done = subprocess.run(
        [*command, rule, "shown"], capture_output=True, text=True, check=True, env=environment
    )
    assert fnmatch.fnmatch(done.stdout.strip(), required)


@pytest.mark.parametrize("script", ["setup", "lint", "run", "long"])
def test_scripts_stop_at_the_first_error(house, script):
    path = house.root / ".ci" / script
    assert "\nset -euo pipefail\n" in path.read_text()
    assert os.access(path, os.X_OK)


STATISTICS = """
    - 12 passing, 0 failing, and 3 invalid test cases
    - 5 passing, 2 failing, and 0 invalid test cases
"""
"""What Hypothesis writes of two phases."""


def long(house, tmp_path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run .ci/long with a stand-in for pytest, which writes what it is given, and fails."""
    (tmp_path / "bin").mkdir()
    python_that_says(
        tmp_path / "bin", f"echo $HYPOTHESIS_PROFILE $HYPOTHESIS_EXAMPLES $*\ncat <<'.'{STATISTICS}.\nexit 1"
    )
    return subprocess.run(
        [house.root / ".ci/long", "tests/some.py"],
        env=os.environ | {"VENV": str(tmp_path), "LOG": str(tmp_path / "log")} | variables,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_long_run_counts_its_cases_and_says_how_to_repeat_them(house, tmp_path):
    done = long(house, tmp_path, SEED="7", EXAMPLES="20")
    assert done.returncode == 1
    again = "make long SEED=7 EXAMPLES=20 TESTS='tests/some.py'"
    first, given, *_, counted, last = done.stdout.splitlines()
    assert first == f"long: to repeat: {again}"
    assert given.startswith("long 20 -m pytest --hypothesis-seed=7 --hypothesis-show-statistics")
    assert given.endswith(" tests/some.py")
    assert counted == "long: 17 cases passed, 2 failed, in 2 phases of tests"
    assert last == f"long: exit status 1; to repeat: {again}; the log is {tmp_path / 'log'}"


def test_a_seed_that_is_no_number_is_refused(house, tmp_path):
    done = long(house, tmp_path, SEED="x")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("long: SEED and EXAMPLES must be integers of at most ten digits: 'x'")


def test_make_lists_every_target(house):
    makefile = (house.root / "Makefile").read_text()
    phony = set(re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)[1].split())
    shown = subprocess.run(
        ["make", "-C", house.root, "--no-print-directory"], capture_output=True, text=True, check=True
    ).stdout
    assert {line.split()[1] for line in shown.splitlines()} == phony
