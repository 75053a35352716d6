"""Packages that some tests need and `make setup` leaves out; a run that requires them fails without them.

WAMNET_REQUIRE may name them beside executors, as in `.ci/run`. Else tests that need an absent one are
skipped, and the summary of the run says so [`needed`, `FOUND`].
"""

from __future__ import annotations

import importlib
import os
from importlib.metadata import version
from typing import Any

import pytest

PACKAGES = {"torch": "PyTorch", "pyoidn": "Open Image Denoise"}
"""Their names for Python and for people."""

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
        FOUND[name] = (
            f"MISSING: {PACKAGES[name]} cannot be imported ({error}); pip install 'wamnet[baselines]'"
        )
        if name in required():
            pytest.fail(f"package {name} is required and {FOUND[name]}", pytrace=False)
        pytest.skip(f"package {name} is {FOUND[name]}", allow_module_level=True)
    FOUND[name] = f"ok (version {version(name)})"
    return module
