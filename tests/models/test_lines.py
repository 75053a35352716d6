"""The end of a program that answers lines."""

import os
import sys

import pytest

from wamnet.models.lines import LineProcess

pytestmark = pytest.mark.needs("programs")


def test_output_that_nobody_reads_does_not_delay_the_end():
    """It is more than a pipe holds; the program ends by itself, not killed after the time that it has."""
    process = LineProcess([sys.executable, "-c", "import sys; sys.stdin.read(); print('x' * 10**6)"])
    process.end()
    assert process.status == 0


def test_the_group_is_killed_once(monkeypatch):
    """By then the number may be that of another group; `close` ends a program that has ended too."""
    process, killed = LineProcess([sys.executable, "-c", "import sys; sys.exit('no device')"]), []
    monkeypatch.setattr(os, "killpg", lambda group, _signal: killed.append(group))
    assert [process.end(), process.end()] == ["no device", "no device"]
    assert len(killed) == 1
