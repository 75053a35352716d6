"""Tests of messages: one line of a stated length that no terminal obeys, whatever the text in it."""

import pickle
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.refimpl.errors import (
    LONGEST_MESSAGE,
    NO_VALUE,
    CompileError,
    ExecutorUnavailable,
    InputError,
    TrainingError,
    WamnetError,
    choice,
    escaped,
    shown,
)

CONTROLS = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Categories of what must not reach a terminal."""

HOSTILE = "\x00\x07\x1b[2J\x7f\x9b31m\u200b\u202e\u2066\ufeff\u2028\u2029\ud800\U000e0041\r\n\t"
"""Clear the screen, ring, turn the writing around, hide, half a character, a tag, ends of lines."""

ANY_TEXT = st.one_of(
    st.text(st.integers(0, 0x10FFFF).map(chr)),
    st.text(st.sampled_from(HOSTILE + "abc")),
    st.text(min_size=400),
)
"""Texts of all code points, of controls mostly, and long ones."""


def controls_of(text: str) -> list[str]:
    """Return the control characters of a text."""
    return [character for character in text if unicodedata.category(character) in CONTROLS]


@given(ANY_TEXT)
def test_escaped_texts_have_no_controls(text):
    """And are the same where a terminal has a sign for each character."""
    assert controls_of(escaped(text)) == []
    if text.isprintable():
        assert escaped(text) == text


@given(ANY_TEXT, st.integers(8, 400))
def test_shown_texts_are_one_short_line(text, most):
    found = shown(text, most)
    assert controls_of(found) == []
    assert len(found) <= most
    assert shown(found, most) == found


@given(ANY_TEXT, ANY_TEXT, ANY_TEXT, ANY_TEXT)
def test_no_part_of_an_error_reaches_a_terminal_raw(what, value, rule, way_out):
    error = InputError(what, value, rule, way_out)
    assert controls_of(str(error)) == []
    assert len(str(error)) <= LONGEST_MESSAGE
    assert (error.what, error.value) == (what, value), "programs get what was given"


@pytest.mark.parametrize("kind", [WamnetError, TrainingError, CompileError, ExecutorUnavailable])
def test_errors_of_one_sentence_are_shown_so_too(kind):
    error = kind(f"a driver says: {HOSTILE}" + 5000 * "x")
    assert controls_of(str(error)) == []
    assert len(str(error)) == LONGEST_MESSAGE
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_long_parts_keep_their_ends_and_leave_room_for_the_others():
    """A file's name is at the end of its path."""
    path = f"/{'folder/' * 1000}frame.exr"
    error = InputError(f"{path}: layers", path, 5000 * "r", 5000 * "w")
    first, _, second = str(error).partition(" '")
    assert first.startswith("/folder/")
    assert first.endswith("frame.exr: layers")
    assert "frame.exr': rrr" in second
    assert str(error).count("r" * 100) > 0
    assert str(error).endswith("www)")


@pytest.mark.parametrize(
    ("value", "line"),
    [
        ("x.exr", "thing 'x.exr': rule (remedy)"),
        (3, "thing 3: rule (remedy)"),
        (None, "thing None: rule (remedy)"),
        (NO_VALUE, "thing: rule (remedy)"),
    ],
)
def test_the_template_quotes_text_and_leaves_out_what_has_no_value(value, line):
    error = InputError("thing", value, "rule", "remedy")
    assert str(error) == str(pickle.loads(pickle.dumps(error))) == line


def test_a_choice_suggests_a_similar_name_and_lists_all():
    assert choice("minicbes", ["glossy", "minicubes"]) == (
        "did you mean 'minicubes'? choose one of glossy, minicubes"
    )
    assert choice("attic", {"glossy": 1, "minicubes": 2}) == "choose one of glossy, minicubes"
