"""House rule about words: a text says things plainly, and in the words of its field.

1. Each row of [`WORDS`] is a pattern, the better word, and the reason. A text that matches fails with file,
   line, word and suggestion [`test_words_are_plain`].
2. What a reader does not read as prose is blanked: code, comments, addresses, and what is written from
   records [`prose`]. Of Python, docstrings, comments and texts are prose, but not the names in them
   [`prose_of_token`].
3. What is not looked at is listed: texts that programs write [`GENERATED`] and this list [`THIS`]. Some
   sentences stay because files hold them [`KEPT`].
4. A pattern sees text whose line ends are spaces, so that two words may be on two lines.
"""

from __future__ import annotations

import io
import re
import token
import tokenize
from collections.abc import Iterator
from typing import NamedTuple

import pytest

SUFFIXES = (".md", ".py")
"""The kinds of files that are looked at [`prose`]."""

GENERATED = ("kernels/shelf/README.md", "spec/vectors/README.md")
"""Texts that programs write: their words are in the programs."""

THIS = "tests/meta/test_words.py"
"""The list of words contains them."""

KEPT = {
    "compiler/languages/c.py": (
        "unless it is told -ffp",
        "planes need that are not asked for",
    ),  # comments of kernels
    "compiler/scenes/emit_path.py": ("the path goes on",),  # a comment of kernels
    "compiler/training/emit_step.py": ("Where the examples lie;",),  # a comment of kernels
    "compiler/schedules/emit_tiled.py": (
        "something besides an affine map",  # a reason in manifests
        "what lies beyond the border",  # a comment of kernels
    ),
    "compiler/languages/glsl.py": (  # heads of kernels
        "it is read with texelFetch alone",
        "the window stands on its head",
    ),
    "compiler/languages/glsl_buffers.py": ("on [-pi, pi] alone",),  # a sine in manifests and heads of kernels
    "compiler/schedules/glsl_compute.py": ("the window stands on its head",),  # heads of kernels
    "compiler/languages/weight_homes.py": ("whatever stands above",),  # heads of kernels
    "compiler/languages/wgsl.py": ("on [-pi, pi] alone",),  # a sine in manifests and heads of kernels
    "refimpl/network/dataset.py": ("were it matt and nothing in between",),  # manifests and heads of kernels
    "spec/conformance/kinds/files.py": (  # notes of vectors
        "a header that is no JSON",
        "a header that is no object",
        "features that are no list",
    ),
    "spec/conformance/kinds/scene_files.py": (  # notes of vectors
        "whole numbers are numbers",
        "a version that is a truth value",
        "a truth value as number",
        "a matrix that is no rotation",
        "glass that is no body",
    ),
    "spec/conformance/kinds/materials.py": (  # titles of vectors
        "A matt surface sends a path on",
        "as if nothing stood in between",
    ),
}
"""Phrases in files with a version or a golden text: they change when these files change anyway."""


class Word(NamedTuple):
    """A pattern, what to write instead, and why."""

    pattern: str
    better: str
    reason: str


WORDS = (
    Word(r"told(?! (?:apart|to)\b)", "reported, said", "programs report; people tell"),
    Word(r"tells? (?:the|all|what)", "reports", "programs report; people tell"),
    Word(r"anew", "again", "nobody says it"),
    Word(r"(?<!left\s)(?<!leave\s)(?<!leaves\s)alone", "only, by itself", "after a noun it reads as lonely"),
    Word(r"(?:come|comes|came|coming) along", "ship with", "software ships"),
    Word(
        r"(?:stands|stood)(?! (?:for|in for|still)\b)|stand (?:in(?! for)|on|at|after|before|between|below|"
        r"beside|there|twice|outside|inside|near|behind|above|around)",
        "is, appears",
        "texts and cameras do not stand",
    ),
    Word(
        r"lies?(?! (?:in|on|inside|within|outside|between|strictly)\b)",
        "is",
        "points lie in a set, all else just is",
    ),
    Word(r"in the place of", "instead of", "shorter"),
    Word(r"matt", "matte", "the renderer's spelling"),
    Word(r"(?:go|goes|going|went|gone) on", "resume, continue", "a run resumes, a loop continues"),
    Word(r"held to", "checked against; clamped to", "numbers are checked or clamped"),
    Word(r"asked for", "requested", "one verb, no particle to look for"),
    Word(r"but for", "except for", "idiom that few readers know"),
    Word(r"gives? way", "is replaced by, does not apply", "idiom"),
    Word(r"at hand", "available", "idiom"),
    Word(r"(?<!there\s)(?:is|are) (?-i:none)(?!:)", "is not one", "none of what?"),
    Word(r"besides", "also, in addition", "read as beside"),
    Word(r"mend(?:s|ed|ing)?", "fix", "software is fixed"),
    Word(r"(?:that|as) there (?:can|may) be", "every possible ...", "shorter"),
    Word(r"strangers?'?", "untrusted", "the word of the field"),
    Word(r"truth values?", "boolean", "the word of the field"),
    Word(r"whole numbers?", "integer", "the word of the field"),
    Word(r"in turns", "interleaved, in turn", "turns are for dancers"),
    Word(r"(?:and|then|be) train(?:ed)? on(?= (?:for|from|with)\b|[.,;:])", "trained further", "on what?"),
    Word(
        r"(?<!there\s)(?:is|are|was|were) no "
        r"(?!longer|more|less|fewer|other|worse|better|use\b|concern\b|bound over|\w+er\b)\w+",
        "is not a ...",
        "no before a noun says that there is none of it",
    ),
    Word(r"lesser", "smaller", "numbers are smaller"),
    Word(r"but where", "unless", "shorter"),
    Word(r"likewise", "in the same way, also", "bookish"),
    Word(r"give or take", "with a tolerance of", "the word of the field"),
    Word(r"handed (?:to|out|over)", "given, sent", "nothing has hands"),
    Word(r"has a say", "affects", "idiom"),
    Word(r"(?:to|only|by|from) who", "to those who", "a relative clause needs its noun"),
)
"""What no text says, and what it says instead."""

NOT_PROSE = (
    re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL),
    re.compile(r"^(?:> )?<!-- table: .*?<!-- end -->", re.MULTILINE | re.DOTALL),
    re.compile(r"<!--.*?-->", re.DOTALL),
    re.compile(r"`[^`]+`"),
    re.compile(r"(?<=\])\([^)]*\)"),
)
"""What nobody reads as prose in Markdown."""


def blank(text: str) -> str:
    """Return spaces of the same length and lines."""
    return re.sub(r"[^\n]", " ", text)


def prose(suffix: str, text: str) -> str:
    """Return a file's prose where it was, and spaces in place of all else."""
    if suffix == ".py":
        return prose_of_python(text)
    for pattern in NOT_PROSE:
        text = pattern.sub(lambda match: blank(match[0]), text)
    return text


NAME = re.compile(r"\w+(?:\.\w+)+")
"""A module, an attribute or a file in a text of Python: nobody reads it as a word."""

ONE_WORD = re.compile(r"""[rRuU]?(?P<quote>["'])\w*(?P=quote)""")
"""A literal of one word: a key, an argument's name or a choice, but not a sentence."""

WITH_FIELDS = re.compile(r"[rR]?[fF][rR]?[\"']")
"""How a text with replacement fields begins."""

ESCAPE = r"\\[nrt]"
"""A line's end or a tab, between words of a text."""

FIELD = re.compile(r"\{\{|\}\}|\{(?P<code>[^{}]*)\}")
"""A brace as such, or a replacement field."""


def prose_of_python(text: str) -> str:
    """Return the comments and texts of Python where they were."""
    lines, found = text.splitlines(keepends=True), list(blank(text))
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    kinds = {token.STRING, token.COMMENT, getattr(token, "FSTRING_MIDDLE", token.STRING)}
    for part in tokenize.generate_tokens(io.StringIO(text).readline):
        if part.type in kinds:
            begin = starts[part.start[0] - 1] + part.start[1]
            found[begin : begin + len(part.string)] = prose_of_token(part.string)
    return "".join(found)


def prose_of_token(text: str) -> str:
    """Return the prose of one comment or text of Python where it was."""
    if ONE_WORD.fullmatch(text):
        return blank(text)
    if WITH_FIELDS.match(text):  # From Python 3.12 on the tokenizer does this itself.
        text = FIELD.sub(lambda field: prose_of_field(field[0], field["code"]), text)
    return re.sub(rf"`[^`]+`|{NAME.pattern}|{ESCAPE}", lambda match: blank(match[0]), text)


def prose_of_field(text: str, code: str | None) -> str:
    """Return the texts within a replacement field where they were."""
    return blank(text) if code is None else f" {prose_of_python(f'({code})')[1:-1]} "


def wrong_words(name: str, text: str) -> Iterator[str]:
    """Yield `name:line: "word": write ..., for ...` for all that a text should not say."""
    flat = re.sub(r"\n[> *#|-]*", lambda match: " " * len(match[0]), prose(name[name.rindex(".") :], text))
    for word in WORDS:
        spaced = word.pattern.replace(" ", r"\s+")
        for match in re.finditer(rf"\b(?:{spaced})(?!\w)", flat, re.IGNORECASE):
            start = match.end() - len(match[0].lstrip())
            line = text.count("\n", 0, start) + 1
            said = " ".join(match[0].split())
            yield f'{name}:{line}: "{said}": write {word.better} ({word.reason})'


def test_words_are_plain(house):
    wrong = []
    for path in house.files():
        name = path.relative_to(house.root).as_posix()
        if path.suffix in SUFFIXES and name not in (*GENERATED, THIS):
            text = path.read_text(encoding="utf-8")
            for phrase in KEPT.get(name, ()):
                text = text.replace(phrase, blank(phrase))
            wrong += wrong_words(name, text)
    house.refuse(sorted(wrong), "A text uses plain words and those of its field: take the better word.")


def test_what_is_kept_is_there_and_wrong(house):
    sources = {source.path: source.text for source in house.python()}
    for name, phrases in KEPT.items():
        for phrase in phrases:
            assert sources[name].count(phrase) == 1, f"{name}: {phrase}"
            assert list(wrong_words("x.md", phrase)), f"{name}: {phrase}"


PLANTED = {
    "What is missing is told.": "told",
    "The file is written anew.": "anew",
    "It needs the standard library alone.": "alone",
    "Models that come\nalong.": "come along",
    "The camera stands at 0.": "stands",
    "It lies beside the kernel.": "lies",
    "A sum in the place of a product.": "in the place of",
    "Matt surfaces": "Matt",
    "The path goes on.": "goes on",
    "Each is held to its bound.": "held to",
    "A feature that is asked for.": "asked for",
    "All frames that there can be.": "that there can be",
    "Files of strangers.": "strangers",
}
"""Sentences with a word that is refused."""


@pytest.mark.parametrize("text", PLANTED)
def test_a_planted_word_is_found(text):
    found = list(wrong_words("x.md", f"# Title\n\n{text}\n"))
    assert len(found) == 1, found
    assert found[0].startswith(f'x.md:3: "{PLANTED[text]}": write ')


@pytest.mark.parametrize(
    "text",
    [
        "PSNR stands for a ratio. Leave alone what works. Two runs cannot be told apart.",
        "A point lies on the sphere, a number lies in [0, 1].",
        "The option `asked for` and [a link](held to/anew.md).",
        "```text\nwritten anew\n```",
        "<!-- table: losses -->\n| held to |\n<!-- end -->",
    ],
)
def test_plain_words_and_code_pass(text):
    assert list(wrong_words("x.md", text)) == []


def test_texts_of_python_are_prose_and_its_names_are_not():
    text = 'anew = 1  # done anew\n\n\ndef f():\n    """Write it anew."""\n    return f"{x} matt"\n'
    assert [line.partition(": ")[0] for line in wrong_words("x.py", text)] == ["x.py:1", "x.py:5", "x.py:6"]


@pytest.mark.parametrize(
    "text",
    [
        "kinds = {'matt': 1, \"alone\": 2}",
        "say(f\"{path}: {'; '.join(told)} {{{told}}} {told:.2f}\")",
        "text = 'input file is none.exr: it does not exist'  # see alone.py",
        "text = 'training pairs is none: at least one is needed'",
        "program = 'from cli.files.alone import alone_in'",
        "text = 'the numbers are None'",
    ],
)
def test_names_and_values_in_texts_of_python_pass(text):
    assert list(wrong_words("x.py", f"{text}\n")) == []


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("x = f\"{a if b else 'it lies there'}\"", "lies"),
        ("x = f'{told} is told'", "told"),
        ('x = f"""{\na} stands\nthere"""', "stands"),
        ("x = rf'{a:.2f} anew'", "anew"),
        ("x = 'refuse what is\\n none'", "is none"),
        ("x = 'it is no regular file'", "is no regular"),
        ("x = 1  # what\n# goes\n# on.", "goes on"),
    ],
)
def test_words_beside_names_in_texts_of_python_are_found(text, word):
    assert [line.split('"')[1] for line in wrong_words("x.py", f"{text}\n")] == [word]


def test_no_word_of_the_glossary_has_two_meanings(house):
    rows = (house.root / "spec/glossary.md").read_text(encoding="utf-8").splitlines()
    wrong = [
        row for row in rows if row.startswith("|") and re.search(r"[;,] (?:also|or) (?:a|one|the)\b", row)
    ]
    house.refuse(wrong, "A word of the glossary means one thing: rename the other, and give it a row.")


def test_every_word_has_a_suggestion_and_a_reason():
    assert all(word.better and word.reason for word in WORDS)
    assert len({word.pattern for word in WORDS}) == len(WORDS)
