"""Tables and figures in texts, written from the records.

1. A table is a block, in a quotation too, that a function of the records returns [`shown.TABLES`]:

       <!-- table: losses -->
       ...
       <!-- end -->

2. A figure in a sentence is between two comments, which nobody sees where the text is read:
   `<!--= losses/MSE/psnr:.1f -->31.3<!--/-->`. Before the colon are the record, the configuration and the
   value, after it how Python writes a number; `low` or `high` before the value is an end of its interval
   [`figure`]. `losses@machine` is what the record was measured on, `losses@numpy` a version
   [`fact`]. One word in place of the three is a function of the records [`shown.FIGURES`].
3. No line begins with the mark of a figure, where Markdown would tear the paragraph apart: the figure goes
   to the end of the line before it [`joined`].
4. What needs a record that is still to be made stays as it was typed [`Filler.text`], as long as
   `pending.txt` names the record.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from wamnet.refimpl.errors import InputError

from .records import ROOT, Missing, Records, pending

TABLE = re.compile(
    r"^(?P<quote>(?:> )?)<!-- table: (?P<name>[\w-]+) -->\n(?P<old>.*?)^(?:> )?<!-- end -->$",
    re.MULTILINE | re.DOTALL,
)
"""A block that a function returns."""

FIGURE = re.compile(r"<!--= (?P<name>[^<>]+?) -->(?P<old>[^<>]*)<!--/-->")
"""A figure in a sentence; its text may continue on the next line."""

LEADING = re.compile(
    r"(?<=\S)[ ]*\n(?P<indent>(?:> )?[ ]*)(?P<figure><!--= [^<>]+? -->[^<>]*<!--/-->[^\s<]*)(?P<gap>[ ]*)"
)
"""A figure at the start of a line of a paragraph, and the punctuation behind it."""

TORN = re.compile(r"^(?:> )?[ ]*(?:[*-] |\d+\. )?<!--[=/].*", re.MULTILINE)
"""A line that begins with a mark: Markdown takes it for a block of HTML, and ends the paragraph before it."""

MARK = re.compile(r"<!-- table:|<!--=|<!--/-->")
"""What may only be there as a part of the two above."""

TableOf = Callable[[Records], str]
"""Returns the Markdown of a block."""


def documents(root: Path = ROOT) -> list[Path]:
    """Return the texts that may show records."""
    found = [root / "README.md", root / "CHANGELOG.md"]
    for pattern in ("docs/**/*.md", "spec/*.md", "spec/vectors/*.md", "experiments/*.md"):
        found += sorted(root.glob(pattern))
    return found


def figure(records: Records, name: str, figures: Mapping[str, Callable[[Records], str]]) -> str:
    """Return the text of a figure, or refuse a name that leads nowhere."""
    if name in figures:
        return figures[name](records)
    if "@" in name and "/" not in name:
        return fact(records, *name.split("@", 1))
    path, _, form = name.rpartition(":")
    parts = path.split("/")
    if len(parts) != 3:
        rule = "must be record/configuration/value:format, or the name of a function in lab/shown.py"
        raise InputError("figure", name, rule, "correct it")
    record, configuration, value = parts
    end, _, rest = value.partition(" ")
    found = records[record].interval(configuration, rest if end in ("low", "high") else value)
    if found is None:
        raise InputError("figure", name, f"the record {record} has no such value", "correct it")
    number = {"low": found.low, "high": found.high}.get(end, found.mean)
    return format(number, form)


def fact(records: Records, record: str, key: str) -> str:
    """Return the machine that a record is from, or the version of a package there."""
    data = records[record].data()
    if key == "machine":
        here = data["machine"]
        return str(here.get("device") or f"{here['cores']} cores of {here['processor']}")
    if key not in data["versions"]:
        raise InputError("figure", f"{record}@{key}", "the record does not know that package", "correct it")
    return str(data["versions"][key])


def joined(text: str) -> str:
    """Return a text whose figures at the start of a line are at the end of the line before it."""

    def moved(match: re.Match[str]) -> str:
        return f" {match['figure']}" + (f"\n{match['indent']}" if match["gap"] else "")

    while (made := LEADING.sub(moved, text)) != text:
        text = made
    return text


@dataclass
class Filler:
    """Writes texts from records, and remembers what was shown and what was missing."""

    records: Records
    tables: Mapping[str, TableOf]
    figures: Mapping[str, Callable[[Records], str]]
    waiting: Mapping[str, object] = field(default_factory=pending)
    shown: set[str] = field(default_factory=set)
    missing: set[str] = field(default_factory=set)

    def text(self, text: str) -> str:
        """Return a text with its blocks and figures as the records have them now."""
        if stray := MARK.search(FIGURE.sub("", TABLE.sub("", text))):
            rest = text[text.index(stray[0]) :][:40]
            raise InputError(
                "mark in a text", rest, "a table or figure has a beginning and an end", "close it"
            )
        made = joined(FIGURE.sub(self._figure, TABLE.sub(self._table, text)))
        if torn := TORN.search(made):
            rule = "a line that begins with a mark ends its paragraph"
            raise InputError("mark in a text", torn[0][:40], rule, "begin with a word")
        return made

    def _table(self, match: re.Match[str]) -> str:
        """Return a block, each of its lines in the quotation that it is a part of."""
        name, quote = match["name"], match["quote"]
        if name not in self.tables:
            raise InputError("table", name, "no function of that name is in lab/shown.py", "write one")
        self.shown.add(name)
        made = self._made(lambda: self.tables[name](self.records))
        if made is None:
            return match[0]
        lines = ["", *made.strip("\n").split("\n"), ""]
        body = "".join(f"{quote}{line}".rstrip() + "\n" for line in lines)
        return f"{quote}<!-- table: {name} -->\n{body}{quote}<!-- end -->"

    def _figure(self, match: re.Match[str]) -> str:
        """Return a figure between its marks."""
        name = " ".join(match["name"].split())
        self.shown.add(name)
        made = self._made(lambda: figure(self.records, name, self.figures))
        return match[0] if made is None else f"<!--= {match['name']} -->{made}<!--/-->"

    def _made(self, make: Callable[[], str]) -> str | None:
        """Return what a function makes, or None where its record is still to come."""
        try:
            return make()
        except Missing as error:
            if error.value not in self.waiting:
                raise
            self.missing.add(str(error.value))
            return None


def stale(filler: Filler, root: Path = ROOT) -> Iterator[tuple[Path, str]]:
    """Yield the texts that are not as the records have it, each with its new text."""
    for path in documents(root):
        old = path.read_text(encoding="utf-8")
        try:
            new = filler.text(old)
        except InputError as error:
            where = f"{error.what} of {path.relative_to(root)}"
            raise InputError(where, error.value, error.rule, error.way_out) from None
        if new != old:
            yield path, new
