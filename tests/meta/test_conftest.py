"""Policies of tests/conftest.py: what is missing fails or is reported; what takes long is left out loudly."""

import contextlib
import os
import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
import quick

pytestmark = pytest.mark.needs("programs")

pytest_plugins = ["pytester"]

STUB = """
from wamnet import kernels
from wamnet.refimpl.errors import ExecutorUnavailable

class Numpy:
    device = "this processor"
    def __enter__(self): return self
    def __exit__(self, *_): pass

def open_executor(name, **options):
    if name == "numpy":
        return Numpy()
    raise ExecutorUnavailable(f"no {name} with {options}")

kernels.open_executor = open_executor

def test_it(executor):
    assert executor.device == "this processor"
"""
"""A test file that replaces the executors: NumPy exists, nothing else does."""


@pytest.fixture
def run(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch):
    """Give a function that runs STUB, or the file made since, under a given WAMNET_REQUIRE."""
    pytester.makeconftest((Path(__file__).parents[1] / "conftest.py").read_text())
    pytester.makepyfile(STUB)
    tests = Path(__file__).parents[1]
    monkeypatch.setenv("PYTHONPATH", str(tests / "support"))

    def run_with(require: str, *options: str) -> pytest.RunResult:
        monkeypatch.setenv("WAMNET_REQUIRE", require)
        return pytester.runpytest_subprocess("-p", "no:cacheprovider", *options)

    return run_with


MISSING = {
    "test_peer": 'import sys\nsys.modules["mitsuba"] = None\ndef test_it(mitsuba):\n    assert mitsuba\n',
    "test_file": "from packages import needed\nneeded('torch')\ndef test_it():\n    assert True\n",
    "test_test": "from packages import needed\ndef test_it():\n    assert needed('torch')\n",
    "conftest_torch": 'import sys\nsys.modules["torch"] = None\n',
}
"""Files that need a program, and a package that cannot be imported, from the start or in a test."""


@pytest.fixture
def missing(run, pytester):
    """Let STUB, and tests of a peer and of a package, be there, but nothing that they need."""
    pytester.makepyfile(**MISSING)
    return lambda require, *options: run(require, "--nightly", "-p", "conftest_torch", *options)


TORCH = "MISSING: PyTorch cannot be imported (*); pip install torch"


def test_what_is_missing_is_skipped_and_told(missing):
    result = missing("", "-n", "1")
    result.assert_outcomes(passed=1, skipped=6)
    lines = ["numpy: ok (this processor)", "opengl-osmesa: MISSING: no opengl with {'context': 'osmesa'}"]
    lines += ["mitsuba: MISSING: mitsuba: the package is not installed; pip install *", f"torch: {TORCH}"]
    result.stdout.fnmatch_lines([*lines, "pyoidn: not requested by any test that ran"])


def test_what_is_missing_and_required_fails(missing):
    result = missing("opencl,mitsuba,pyoidn,torch", "--continue-on-collection-errors")
    result.assert_outcomes(passed=1, skipped=2, errors=3, failed=1)
    lines = ["executor opencl is required and MISSING: no opencl with {}; *", f"torch: {TORCH}"]
    lines += ["peer mitsuba is required and MISSING: mitsuba: the package *"]
    result.stdout.fnmatch_lines_random([*lines, *[f"*package torch is required and {TORCH}"] * 2])


TIERS = """
import pytest

@pytest.mark.nightly
def test_nightly():
    assert True

@pytest.mark.nightly("2-x", "3-x")
@pytest.mark.nightly(but=("1-x", "2-x", "3-x"))
@pytest.mark.parametrize("a", "x")
@pytest.mark.parametrize("b", [1, 2, 3, 4])
def test_some(a, b):
    assert True

@pytest.mark.product
@pytest.mark.parametrize("a", "xy")
@pytest.mark.parametrize("b", [1, 2, 3, [4]])
def test_cases(a, b):
    print(f"case {b} {a}")
"""


GROWS = """
import numpy as np

class Executor:
    forgotten = 0
    def forget(self):
        self.forgotten += 1

kept = []

def test_little(opened_executors):
    opened_executors["numpy"] = Executor()

def test_much(opened_executors):
    assert opened_executors["numpy"].forgotten == 0
    kept.append(np.ones(2**25))

def test_after(opened_executors):
    assert opened_executors["numpy"].forgotten == 1

def test_after_that(opened_executors):
    assert opened_executors["numpy"].forgotten == 1
"""
"""A file one of whose tests takes 256 MB, and keeps them."""


DRAWN = """
import pytest
from hypothesis import given, strategies

@pytest.mark.parametrize("number", range(2))
def test_it(number):
    drawn = []

    @given(strategies.integers(0, 2**64))
    def draw(value):
        drawn.append(value)

    draw()
    print("DRAWN", len(drawn), drawn[-1])
"""


@pytest.mark.parametrize(
    ("profile", "options", "ci", "passed", "alike"),
    [
        ("ci", ("--budget", "600"), "true", 5, True),
        ("ci", ("--budget", "0.001", "--nightly"), "true", 13, True),
        ("long", ("--budget", "0.001"), "", 13, False),
    ],
)
def test_a_tier_says_what_it_leaves_out(run, pytester, monkeypatch, profile, options, ci, passed, alike):
    """Each value of each parameter remains in some case of a product; beyond its budget CI fails.

    Long runs draw other cases each time: two numbers of 64 bits are the same by chance once in 2^64 runs.
    """
    pytester.makepyfile(TIERS, test_drawn=DRAWN, test_grows=GROWS)
    for name, value in (("PROFILE", profile), ("EXAMPLES", "30")):
        monkeypatch.setenv(f"HYPOTHESIS_{name}", value)
    monkeypatch.setenv("CI", ci)
    result = run("", "-s", *options)
    result.assert_outcomes(passed=passed + 6, deselected=13 - passed)
    ran = [line.split("case ")[1].split()[:2] for line in result.outlines if "case " in line]
    assert ({a for a, _ in map(reversed, ran)}, {b for b, _ in ran}) == ({"x", "y"}, {"1", "2", "3", "[4]"})
    if passed < 13:
        result.stdout.fnmatch_lines(["4 tests left out: nightly: *", "4 tests left out: product: *"])
    found = re.findall(r"DRAWN (\d+) (\d+)", result.stdout.str())
    assert [count for count, _ in found] == ["30" if profile == "long" else "100"] * 2
    assert (found[0] == found[1]) == alike
    exceeded = "0.001" in options
    assert result.ret == (exceeded and ci == "true")
    assert ("TOO MUCH" in result.stdout.str()) is exceeded
    if "--budget" in options:
        result.stdout.fnmatch_lines([f"processor time: * s, budget {options[1]} s*"])


APART = """
import os
import sys

import pytest

pytestmark = pytest.mark.apart

@pytest.fixture(scope="module")
def started():
    return []

def test_fails():
    assert "left" == "right"

def test_skips():
    pytest.skip("it is not there")

def test_ends():
    os._exit(7)

@pytest.mark.parametrize("number", range(2))
def test_passes(number, started, executor_named):
    started.append(number)
    assert started == list(range(number + 1)), "the file's tests share their fixtures"
    assert os.getppid() == int(os.environ["WORKER"])
    executor_named("numpy")

def test_after():
    assert True
"""
"""Tests in a process of their own, which one of them ends."""


def test_a_file_apart_has_a_process_of_its_own(run, pytester):
    """Its results are those of any file, and so are what it lacks and its peak; a crash fails one test.

    The worker takes 512 MB, which do not count as the other's.
    """
    body = (
        "import os\nimport numpy\nos.environ['WORKER'] = str(os.getpid())\n\n"
        "kept = numpy.ones(2**26)\n\ndef test_it():\n    assert kept.any()\n"
    )
    pytester.makepyfile(body, test_apart=APART)
    result = run("", "-rs", "-n", "1")
    result.assert_outcomes(passed=4, skipped=1, failed=2)
    result.stdout.fnmatch_lines_random(
        [
            "numpy: ok (*)",
            "E*assert 'left' == 'right'",
            "*the process apart ended with status 7:*",
            "SKIPPED * it is not there",
            "test_apart.py: ?? MB",
        ]
    )


QUICK = """
import subprocess
import sys

import pytest

def test_quick():
    assert True

def test_package():
    import pyopencl

def test_program():
    subprocess.run([sys.executable, "-c", ""], check=True)

@pytest.mark.needs("programs")
def test_marked():
    subprocess.run([sys.executable, "-c", ""], check=True)

def test_it(executor_named):
    executor_named("opencl")
"""
"""One test that is quick, two that ask for what a quick run lacks, two that say so."""


def test_a_quick_run_has_no_packages_devices_or_programs(run, pytester):
    pytester.makepyfile(QUICK, test_file="import moderngl")
    result = run("", "--quick", "-n", "1")
    result.assert_outcomes(passed=1, failed=2, skipped=3)
    result.stdout.fnmatch_lines_random(
        [
            "A quick run does not have pyopencl: do without, or mark the test*pytest.mark.needs(...).",
            f"A quick run does not have {sys.executable}: do without, *",
            "1 tests or files: it imports moderngl; make test runs it",
            "1 tests or files: it starts programs; make test runs it",
            "1 tests or files: it runs kernels or other renderers; make test runs it",
        ]
    )


def test_a_quick_run_works_where_nothing_else_is_installed(tmp_path):
    """A folder with links to the distributions that it brings is all that this Python can import."""
    for name in quick.brought() - {"wamnet"}:
        with contextlib.suppress(metadata.PackageNotFoundError):  # another version of Python needs it
            for top in {file.parts[0] for file in metadata.files(name) or ()} - {"..", "__pycache__"}:
                (tmp_path / top).symlink_to(metadata.distribution(name).locate_file(top))
    tests = Path(__file__).parents[1]
    (tmp_path / "wamnet").mkdir()
    parts = ("models", "refimpl", "compiler", "kernels", "cli", "spec")
    for path in (*(tests.parent / part for part in parts), *(tests.parent / "wamnet").glob("*.py")):
        (tmp_path / "wamnet" / path.name).symlink_to(path)
    files = [tests / f"{name}.py" for name in ("refimpl/test_siren", "hard/test_adam", "compiler/test_trace")]
    files.append(tests / "kernels/test_sines.py")
    done = subprocess.run(
        [sys.executable, "-S", "-m", "pytest", "--quick", "-p", "no:cacheprovider", *files],
        cwd=tmp_path,
        env={"PATH": os.environ["PATH"], "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"\d{2,} passed", done.stdout)
    assert "runs kernels or other renderers; make test runs it" in done.stdout
