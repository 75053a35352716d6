"""House rule about words: a text says things plainly, and in the words of its field.

1. Each row of [`WORDS`] is a pattern, the better word, and the reason. A text that matches fails with file,
   line, word and suggestion [`test_words_are_plain`]. Rows of [`GLOSSARY`] are for texts that users meet
   [`USERS`]: pages, help and messages.
2. What a reader does not read as prose is blanked: code, comments, addresses, and what is written from
   records [`prose`]. Of Python, docstrings, comments and texts are prose, but not the names in them
   [`prose_of_token`].
3. What is not looked at is listed: texts that programs write [`GENERATED`] and this list [`THIS`]. Some
   sentences stay because files hold them [`KEPT`].
4. A pattern sees text whose line ends are spaces, so that two words may be on two lines.
"""

import ast
import io
import re
import token
import tokenize
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

SUFFIXES = (".ini", ".md", ".py")
"""The kinds of files that are looked at [`prose`]."""

GENERATED = ("kernels/shelf/README.md", "spec/vectors/README.md")
"""Texts that programs write: their words are in the programs."""

THIS = "tests/meta/test_words.py"
"""The list of words contains them."""

KEPT = {
    "compiler/kernel/instructions.py": ("unless it is told -ffp",),  # a comment of kernels
    "refimpl/network/dataset.py": ("were it matt and nothing in between",),  # manifests and heads of kernels
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
    Word(r"matt", "matte", "the renderer's spelling"),
    Word(r"(?<!there\s)(?:is|are) (?-i:none)(?!:)", "is not one", "none of what?"),
    Word(r"mend(?:s|ed|ing)?", "fix", "software is fixed"),
    Word(r"(?:that|as) there (?:can|may) be", "every possible ...", "shorter"),
    Word(r"strangers?'?", "untrusted", "the word of the field"),
    Word(r"truth values?", "boolean", "the word of the field"),
    Word(r"whole numbers?", "integer", "the word of the field"),
    Word(r"(?:and|then|be) train(?:ed)? on(?= (?:for|from|with)\b|[.,;:])", "trained further", "on what?"),
    Word(
        r"(?<!there\s)(?:is|are|was|were) no "
        r"(?!longer|more|less|fewer|other|worse|better|use\b|concern\b|bound over|\w+er\b)\w+",
        "is not a ...",
        "no before a noun says that there is none of it",
    ),
    Word(r"give or take", "with a tolerance of", "the word of the field"),
    Word(r"(?:to|only|by|from) who", "to those who", "a relative clause needs its noun"),
)
"""What no text says, and what it says instead."""

COUNTED = (
    r"(?:samples?|paths?|rays?|pictures?|images?|frames?|hits?|megabytes?|MB|bytes?|operations?|steps?|times?|"
    r"milliseconds?|ms|seconds?|minutes?|hours?|days?|lines?|files?|folders?|schedules?|processes|commands?|one)"
)
"""What is counted per unit."""

GLOSSARY = (
    Word(
        rf"{COUNTED} (?-i:an?) (?:pixel|second|minute|frame|step|sample|line|scene|layer|device|core|group|"
        r"student|page|folder|file)",
        "per",
        "rates are per unit",
    ),
    Word(r"in (?:the )?place of", "instead of", "shorter"),
    Word(r"(?:inside|outside) of", "inside, outside, within", "no of after these"),
    Word(r"moments?", "time, time step, frame", "the word of the field"),
    Word(r"lamps?", "light, light source", "the word of the field"),
    Word(r"pictures?", "image, frame, render", "the word of the field"),
    Word(r"films?", "animation, sequence", "the word of the field"),
    Word(r"rectifiers?", "ReLU", "the word of the field"),
    Word(r"past (?:mirrors|glass|what)", "through, behind", "light goes through glass"),
    Word(r"of (?:its|their|his|our) own", "separate, own X", "an adjective is shorter"),
    Word(r"ends? with status", "exits with status", "processes exit"),
    Word(r"made to be (?:read|pasted)", "human-readable", "shorter"),
    Word(r"(?:networks?|kernels?) (?:of|in) (?:sines|integers)", "SIREN, integer network", "a compound noun"),
    Word(r"(?:has|have) (?:not |never )?learned", "was trained on", "networks are trained"),
    Word(r"spectra", "FFT", "the name of the schedule"),
    Word(r"ways? out", "remedy, fix", "the word of the field"),
    Word(r"(?<![-/.])peers?", "baseline, other renderer", "the word of the field"),
    Word(r"shelf", "prebuilt kernels", "the word of the field"),
    Word(r"telephones?", "phone", "the usual word"),
    Word(r"that (?:is|are) here", "available, installed", "a place says nothing"),
    Word(r"whoever", "anyone who", "a relative clause needs its noun"),
    Word(r"refuses?|refused", "reject", "programs reject"),
)
"""What texts that users meet do not say either: former words of the project, and the field's instead."""

USERS = (
    "README.md",
    "SECURITY.md",
    "CONTRIBUTING.md",
    "docs/index.md",
    "docs/first-kernel.md",
    "docs/limits.md",
    "docs/reference.md",
    "docs/guide/",
)
"""Texts that users meet: a name of a file, or a folder's with a slash."""

PROGRAMS = ("cli/", "compiler/", "kernels/", "refimpl/", "wamnet/")
"""Folders whose messages users meet."""

ERRORS = ("InputError", "CompileError", "TrainingError", "ExecutorUnavailable", "WamnetError")
"""Calls whose texts are messages [`messages`]."""

RULES = ("rule", "way_out", "fix")
"""Names of the parts of messages [`messages`]."""

NOT_PROSE = (
    re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL),
    re.compile(r"^(?:> )?<!-- table: .*?<!-- end -->", re.MULTILINE | re.DOTALL),
    re.compile(r"<!--.*?-->", re.DOTALL),
    re.compile(r"`[^`]+`"),
    re.compile(r"(?<=\])\([^)]*\)"),
)
"""What nobody reads as prose in Markdown."""


NAMES = re.compile(r"^\[.*\]$|^\w+ = (?:-\S+ )*", re.MULTILINE)
"""What nobody reads as prose in a table of options: sections and names."""


def blank(text: str) -> str:
    """Return spaces of the same length and lines."""
    return re.sub(r"[^\n]", " ", text)


@cache
def prose(suffix: str, text: str) -> str:
    """Return a file's prose where it was, and spaces in place of all else."""
    if suffix == ".py":
        return prose_of_python(text)
    for pattern in NOT_PROSE if suffix != ".ini" else (NAMES,):
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


def messages(text: str) -> set[int]:
    """Return the lines of Python that have messages."""
    shown: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        parts: list[ast.AST] = []
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ERRORS:
            parts = [node]
        elif isinstance(node, ast.Assign) and any(getattr(one, "id", "") in RULES for one in node.targets):
            parts = [node.value]
        elif isinstance(node, ast.keyword) and node.arg in ("help", "show_default"):
            parts.append(node.value)
        for part in parts:
            shown.update(range(part.lineno, (part.end_lineno or part.lineno) + 1))  # type: ignore[attr-defined]
    return shown


@cache
def pattern_of(words: tuple[Word, ...]) -> re.Pattern[str]:
    """Return the pattern of one of some words."""
    spaced = "|".join(word.pattern.replace(" ", r"\s+") for word in words)
    return re.compile(rf"\b(?:{spaced})(?!\w)", re.IGNORECASE)


def wrong_words(name: str, text: str, words: tuple[Word, ...] = WORDS) -> Iterator[str]:
    """Yield `name:line: "word": write ..., for ...` for all that a text should not say."""
    flat = re.sub(r"\n[> *#|-]*", lambda match: " " * len(match[0]), prose(name[name.rindex(".") :], text))
    if not pattern_of(words).search(flat):
        return
    for word in words:
        for match in pattern_of((word,)).finditer(flat):
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


def test_texts_that_users_meet_have_the_words_of_the_field(house):
    """Spec, records, notes of vectors and comments of kernels are not among them."""
    wrong = []
    for path in house.files():
        name = path.relative_to(house.root).as_posix()
        text = path.read_text(encoding="utf-8") if path.suffix in SUFFIXES else ""
        if path.suffix == ".ini" or (name.startswith(USERS) and path.suffix == ".md"):
            wrong += wrong_words(name, text, GLOSSARY)
        elif name.startswith(PROGRAMS) and path.suffix == ".py":
            shown = messages(text)
            found = wrong_words(name, text, GLOSSARY)
            wrong += [line for line in found if int(line.split(":")[1]) in shown]
    house.refuse(sorted(wrong), "A text that users meet has the words of the field: take the better one.")


def test_no_word_of_the_glossary_has_two_meanings(house):
    rows = (house.root / "spec/glossary.md").read_text(encoding="utf-8").splitlines()
    wrong = [
        row for row in rows if row.startswith("|") and re.search(r"[;,] (?:also|or) (?:a|one|the)\b", row)
    ]
    house.refuse(wrong, "A word of the glossary means one thing: rename the other, and give it a row.")
