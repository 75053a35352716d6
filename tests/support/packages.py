"""Packages that some tests need and `make setup` leaves out; a run that requires them fails without them.

WAMNET_REQUIRE may name them beside executors, as in `.ci/run`. Else tests that need an absent one are
skipped, and the summary of the run says so [`needed`, `FOUND`].
"""

import importlib
import os
from importlib.metadata import version
from typing import Any

import pytest

PACKAGES = {"torch": "PyTorch", "pyoidn": "Open Image Denoise", "onnx": "ONNX", "onnxruntime": "ONNX Runtime"}
"""Their names for Python and for people."""

SANDBOX = "bubblewrap"
"""The sandbox of students' code, a program that is required like a package."""

FOUND: dict[str, str] = {}
"""What has been found of each requested one: "ok (version)" or "MISSING: reason"."""


def required() -> frozenset[str]:
    """Return the names in WAMNET_REQUIRE, which commas separate."""
    return frozenset(name.strip() for name in os.environ.get("WAMNET_REQUIRE", "").split(",")) - {""}


def needed(name: str) -> Any:
    """Return a package, or skip the test or the file of tests that needs it; fail where it is required."""
    try:
        module = importlib.import_module(name)
    except (ImportError, OSError) as error:
        FOUND[name] = f"MISSING: {PACKAGES[name]} cannot be imported ({error}); pip install {name}"
        if name in required():
            pytest.fail(f"package {name} is required and {FOUND[name]}", pytrace=False)
        pytest.skip(f"package {name} is {FOUND[name]}", allow_module_level=True)
    FOUND[name] = f"ok (version {version(name)})"
    return module


def needed_sandbox() -> None:
    """Skip the test where students' code has no sandbox; fail where it is required."""
    from wamnet_course.sandbox import unavailable

    if reason := unavailable():
        FOUND[SANDBOX] = f"MISSING: {reason}; apt-get install bubblewrap"
        if SANDBOX in required():
            pytest.fail(f"{SANDBOX} is required and {FOUND[SANDBOX]}", pytrace=False)
        pytest.skip(f"{SANDBOX} is {FOUND[SANDBOX]}")
    FOUND[SANDBOX] = "ok"


class Late:
    """A module that is imported when a test first uses it: collecting tests imports none that is large."""

    __slots__ = ("_name", "_package")

    def __init__(self, name: str, package: str) -> None:
        object.__setattr__(self, "_name", name)
        object.__setattr__(self, "_package", package)

    def _module(self) -> Any:
        """Return the module, or skip the test where its package is missing [`needed`]."""
        if not FOUND.get(self._package, "").startswith("ok"):
            needed(self._package)
        return importlib.import_module(self._name)

    @property
    def __dict__(self) -> Any:
        """Return what the module has: a patch looks here for what it must put back."""
        return vars(self._module())

    def __getattr__(self, name: str) -> Any:
        if name.startswith(("__", "_mock", "_pytest", "pytest")):  # pytest asks all names of a file
            raise AttributeError(name)
        return getattr(self._module(), name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._module(), name, value)
