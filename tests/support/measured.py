"""Figures in documents that look measured: what the house rule about records goes over.

1. What cannot hold one is blanked: fenced blocks, code, comments, addresses, formulas, examples that are
   computed, and what is written from records [`blanked`].
2. A figure is a number with a unit of a result, a number after the name of a metric, a spread, a number with
   an exponent, or so many times as much [`PATTERNS`]; and every typed table whose cells are such [`tables`].
3. One that is quoted, with its reason, needs no record [`found`].
"""

import re
from collections.abc import Iterable, Iterator
from fnmatch import fnmatch

from lab.texts import FIGURE, TABLE

BLANKED = (
    re.compile(r"(?<=\n\n)(?: {4,}\S.*(?:\n|\Z))+"),
    re.compile(r"^(?:> ?)?```.*?^(?:> ?)?```", re.MULTILINE | re.DOTALL),
    re.compile(r"^<!-- worked: \w+ -->\n.*?^<!-- end -->$", re.MULTILINE | re.DOTALL),
    TABLE,
    FIGURE,
    re.compile(r"<!--.*?-->", re.DOTALL),
    re.compile(r"\$\$.*?\$\$", re.DOTALL),
    re.compile(r"`[^`]+`"),
    re.compile(r"(?<=\])\([^)]*\)"),
)
"""What holds no figure of its own."""

NUMBER = r"(?<![\w.])[-−+]?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?"
"""A number as documents write it."""

WORDS = "two|three|four|five|six|seven|eight|nine|ten|eleven|twelve|fifteen|twenty|thirty|forty|fifty|hundred"
"""Numbers as words."""

GAP = r"[\s>]*"
"""What may be between a number and its unit: a line's end too."""

UNITS = (
    r"dB|ms|µs|us|s|seconds?|minutes?|hours?|[GTM]?FLOPS?(?:/s)?|GFLOP/s|Msamples(?:/s)?|%|kB|MB|GB|spp"
    r"|(?:million |thousand )?(?:frames|samples|paths|steps)(?:/s| a second| per second)|frames/s|samples/s"
)
"""Units of results."""

PATTERNS = (
    re.compile(rf"{NUMBER}{GAP}(?:{UNITS})(?![\w/])"),
    re.compile(rf"(?:PSNR|SSIM|FLIP|relMSE|SMAPE|MSE)(?: of| is| \w+)?{GAP}{NUMBER}(?!x)"),
    re.compile(rf"{NUMBER} ± {NUMBER}"),
    re.compile(r"(?<![\w.^])(?!1e)\d(?:\.\d+)?e[-+]?\d+"),
    re.compile(r"(?<![\w./^])\d+\.\d\d+(?![\w.]*\d)(?!\w)"),
    re.compile(
        rf"(?:{NUMBER}|\b(?:{WORDS})){GAP} times(?={GAP} (?:as|faster|slower|the|that|its|more|less)\b)"
    ),
    re.compile(rf"{NUMBER}{GAP}x(?={GAP} (?:as|faster|slower)\b)"),
)
"""What looks measured."""

ROW = re.compile(r"^(?:> ?)?\|.*\|$", re.MULTILINE)
"""A row of a table."""

CELL = re.compile(rf"\**{NUMBER}(?: ?(?:{UNITS}|x))?\**(?: ?(?:/|-|±).*)?")
"""A cell that holds a number and no more."""

MEASURED_CELL = re.compile(r"\d\.\d|\de[-+]?\d|±|%")
"""A number that somebody has measured rather than chosen: it has a fraction, an exponent or a spread."""

FEWEST = 3
"""A table with so many cells that look measured is one of measurements."""


def blanked(text: str) -> str:
    """Return a text of the same length and lines without what holds no figure."""
    for pattern in BLANKED:
        text = pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    return text


def tables(text: str) -> Iterator[tuple[int, int]]:
    """Yield the places of the typed tables that hold measurements."""
    rows = list(ROW.finditer(text))
    groups: list[list[re.Match[str]]] = []
    for row in rows:
        if groups and row.start() == groups[-1][-1].end() + 1:
            groups[-1].append(row)
        else:
            groups.append([row])
    for group in groups:
        cells = [cell.strip() for row in group[2:] for cell in row[0].lstrip("> ").strip("|").split("|")]
        measured = [cell for cell in cells if CELL.fullmatch(cell) and MEASURED_CELL.search(cell)]
        if len(measured) >= FEWEST:
            yield group[0].start(), group[-1].end()


def places(text: str) -> list[tuple[int, int]]:
    """Return the places of all figures, each table as one."""
    clean = blanked(text)
    found = list(tables(clean))
    for pattern in PATTERNS:
        for match in pattern.finditer(clean):
            if not any(low <= match.start() < high for low, high in found):
                found.append(match.span())
    return sorted(found)


def spans(text: str, part: str) -> list[tuple[int, int]]:
    """Return where a text has some words, also with the ends of lines between them; `*` is all of it."""
    if part == "*":
        return [(0, len(text))]
    words = r"[\s>]+".join(re.escape(word) for word in part.split())
    return [match.span() for match in re.finditer(words, text)]


Quote = tuple[str, str]
"""A file and the words in it that are quoted."""


def found(name: str, text: str, quotes: Iterable[tuple[str, str, str]] = ()) -> tuple[list[str], set[Quote]]:
    """Return `name:line: figure` of those without a record, and the quotes that are of use.

    A quote covers the figures that are whole in its words; of a table any of its words are enough.
    """
    allowed = [
        ((file, part), span) for file, part, _ in quotes if fnmatch(name, file) for span in spans(text, part)
    ]
    wrong: list[str] = []
    used: set[Quote] = set()
    for low, high in places(text):
        whole = not ROW.match(text[low:high].partition("\n")[0])
        covering = [
            quote
            for quote, (start, end) in allowed
            if (start <= low and high <= end if whole else start < high and low < end)
        ]
        used.update(covering)
        if not covering:
            shown = " ".join(text[low:high].split())
            line = text.count("\n", 0, low) + 1
            wrong.append(f"{name}:{line}: {shown if len(shown) <= 60 else shown[:57] + '...'}")
    return wrong, used
