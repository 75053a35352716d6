"""Tests of what is printed: texts appear as they are, and an interrupt tells how to go on."""

from __future__ import annotations

import pytest

from wamnet.cli import terminal

NAME = "out[bold]/[/]:smile:[red].exr"
"""A file name that rich would read as markup and emoji."""


def test_names_are_no_markup(capsys, monkeypatch) -> None:
    """In lines and in tables' titles, headers and cells."""
    monkeypatch.setenv("COLUMNS", "200")
    terminal.say(NAME)
    assert capsys.readouterr().out == f"{NAME}\n"
    terminal.table(NAME, ("metric", NAME), [(NAME, "1")])
    assert capsys.readouterr().out.count(NAME) == 3


def test_descriptions_of_progress_are_no_markup(capsys, monkeypatch) -> None:
    """On a terminal, where they are shown."""
    monkeypatch.setattr(terminal.Console, "is_terminal", True)
    monkeypatch.setenv("COLUMNS", "200")
    with terminal.progress(NAME, 1) as advance:
        advance(1)
    assert NAME in capsys.readouterr().err


def test_the_hint_is_said_on_interrupt(capsys) -> None:
    """And the interrupt goes on."""

    def interrupted() -> None:
        with terminal.hint_on_interrupt(lambda: "go on so"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert capsys.readouterr().err == "wamnet: go on so\n"
