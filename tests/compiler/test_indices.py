"""Indices of the emitted texts, evaluated in 32 bits at the largest picture of each language (KER-2).

The texts are read, not the tables that they are made of: each subscript that contains `width` is evaluated
at the corners of pictures of just below 2^31 numbers. No step of it may leave 32 bits, and no two corners may
meet. What reads textures has no such subscript; its coordinates are those of the texture.
"""

import re
from itertools import product

import pytest
from targets import tiny_model

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.targets import LANGUAGES, language_named
from wamnet.refimpl.errors import CompileError

LIMIT = 2**31
"""First number that `int` does not hold; KER-2: no image may hold as many."""

SUBSCRIPT = re.compile(r"\[([^\[\];=]*\bwidth\b[^\[\];=]*)\]")
"""A subscript that depends on the picture's width."""


class Int32:
    """A number of 32 bits whose arithmetic must not overflow."""

    def __init__(self, value):
        assert -LIMIT <= value < LIMIT, f"{value} is not an int"
        self.value = value

    def __add__(self, other):
        return Int32(self.value + Int32.of(other))

    def __mul__(self, other):
        return Int32(self.value * Int32.of(other))

    __radd__, __rmul__ = __add__, __mul__

    @staticmethod
    def of(value):
        return value.value if isinstance(value, Int32) else value


def largest_pictures(channels):
    """Return (height, width) of pictures of a line, a column and a square, just below the limit."""
    most = (LIMIT - 1) // channels
    side = int(most**0.5)
    return [(1, most), (most, 1), (side, side), (2, most // 2), (most // 3, 3)]


def subscripts(source):
    """Return the subscripts of a text with the number of channels by which each multiplies."""
    found = {}
    for text in SUBSCRIPT.findall(source):
        words = re.fullmatch(r"\((y|row) \* width \+ ([\w *+]+)\) \* (\d+) \+ (\w+)", text)
        assert words, f"a subscript of a form that this test does not know: {text}"
        found[text] = words
    return found


CASES = [
    (target, schedule)
    for target in LANGUAGES
    if target != "numpy"
    for schedule in language_named(target).schedules
]


@pytest.mark.parametrize(("target", "schedule"), CASES)
def test_no_index_leaves_32_bits(target, schedule):
    try:
        kernel = compile_program(lower(tiny_model()), target, schedule)
    except CompileError as error:
        pytest.fail(f"the tiny model does not compile: {error}")
    found = {text: words for part in kernel.kernels for text, words in subscripts(part.source).items()}
    if not found:
        texts = ("texelFetch", "imageLoad", "textureSize", "sampler", "Texture2D")
        assert any(word in kernel.source for word in texts), "neither subscripts nor textures"
        return
    for words in found.values():
        channels, last = int(words[3]), words[4]
        for height, width in largest_pictures(channels):
            # Whatever names the column: clamps and guards keep it in the picture.
            columns = {0, width - 1}
            parts = (int(last),) if last.isdecimal() else (0, channels - 1)
            corners = {
                ((Int32(y) * width + x) * channels + c).value
                for y, x, c in product({0, height - 1}, columns, parts)
            }
            assert max(corners) < height * width * channels
            assert len(corners) == len({0, height - 1}) * len(columns) * len(set(parts))


def test_texts_say_the_limit():
    assert "fewer than 2^31 floats an image" in compile_program(lower(tiny_model()), "c").source
