"""Test of the sentence for a package that is not installed."""

from __future__ import annotations

import pytest

from wamnet.cli.packages import need
from wamnet.refimpl.errors import InputError


def test_a_missing_package_names_its_extra() -> None:
    """What, for what, and the command that brings it."""
    text = r"'no_such_package' is missing: it is needed to fly; install it: pip install 'wamnet\[x\]'"
    with pytest.raises(InputError, match=text):
        need("no_such_package", "to fly", "x")


def test_a_package_that_is_there_is_returned() -> None:
    """Also a module inside a package."""
    assert need("os.path", "to test", "x").sep == "/"
