"""Tests of what is printed: texts appear as they are, and an interrupt says how to resume."""

import io
import unicodedata
from contextlib import redirect_stderr, redirect_stdout
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.cli import main
from wamnet.cli.common import terminal

NAME = "out[bold]/[/]:smile:[red].exr"
"""A file name that rich would read as markup and emoji."""


def test_names_are_no_markup(capsys, monkeypatch) -> None:
    """In lines and in tables' titles, headers and cells."""
    monkeypatch.setenv("COLUMNS", "200")
    terminal.say(NAME)
    assert capsys.readouterr().out == f"{NAME}\n"
    terminal.table(NAME, ("metric", NAME), [(NAME, "1")])
    assert capsys.readouterr().out.count(NAME) == 3


@pytest.mark.parametrize(
    ("title", "shown"), [(NAME, NAME), ("rendering \x07\u202ehome", "rendering \\x07\\u202ehome")]
)
def test_titles_of_progress_are_escaped_and_no_markup(capsys, monkeypatch, title, shown) -> None:
    """On a terminal, where the bar is shown; its own colours and movements are rich's."""
    monkeypatch.setattr(terminal.Console, "is_terminal", True)
    monkeypatch.setenv("COLUMNS", "200")
    with terminal.progress(title, 1) as advance:
        advance(1)
    assert shown in capsys.readouterr().err


@pytest.mark.parametrize(
    ("unit", "task", "text"),
    [
        ("samples", (2e6, 16_777_216, 3.25e6), "2.0M of 16.8M samples, 3.2M samples/s,"),
        ("steps", (1200, 12_000, 1234.56), "1,200 of 12,000 steps, 1,234.6 steps/s,"),
        ("frames", (0, 8, None), "0 of 8 frames,"),
        ("", (0.25, 1, None), "25 %,"),
    ],
)
def test_progress_has_one_form(unit, task, text) -> None:
    """The count of the total, and the rate; the title before it is a verb, the time left follows."""
    done, total, speed = task
    now = SimpleNamespace(completed=done, total=total, speed=speed, percentage=100 * done / total)
    assert str(terminal._Work(unit).render(now)) == text


def test_the_hint_is_said_on_interrupt(capsys) -> None:
    """And the interrupt is raised again."""

    def interrupted() -> None:
        with terminal.hint_on_interrupt(lambda: "resume so"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert capsys.readouterr().err == "wamnet: resume so\n"


def controls_of(text: str) -> list[str]:
    """Return the control characters of a text, without the ends of its lines."""
    return [c for c in text if c != "\n" and unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")]


ANY_TEXT = st.one_of(
    st.text(st.integers(0, 0x10FFFF).map(chr)),
    st.text(st.sampled_from("\x00\x07\x1b[2J\x9b\u200b\u202e\u2028\ud800\r\n\tab")),
)
"""Texts of all code points, and of controls mostly."""


@given(ANY_TEXT)
def test_no_control_character_reaches_the_terminal(text) -> None:
    """Whatever a file or a name has said: in lines, tables, errors and hints."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        terminal.say(text)
        assert out.getvalue().count("\n") == 1
        terminal.table(text, ("a", text), [(text, text)], texts=2)
        terminal.tell(text)
        main._fail(text)
    assert controls_of(out.getvalue()) == []
    assert controls_of(err.getvalue()) == []
    assert err.getvalue().count("\n") == 2


def test_keys_of_files_do_not_clear_the_screen(wamnet, tmp_path) -> None:
    """Nor do names of files."""
    (tmp_path / "s.json").write_text(
        '{"format": "wamnet-scene", "version": 1, "x\\u001b[2J\\u202e": 1}', encoding="utf-8"
    )
    outcome = wamnet("render", "s.json")
    assert outcome.status == 2
    assert controls_of(outcome.err) == []
    assert "x\\x1b[2J\\u202e" in outcome.err
    assert controls_of(wamnet("render", "a\x1b[2J.json").err) == []
