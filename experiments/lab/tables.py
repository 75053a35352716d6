"""Results as Markdown: rows of configurations, columns of numbers with mean and spread.

A column says which value it shows, its heading and its digits [`Column`]; a configuration without that value
has an empty cell [`table`].
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from .results import Results, Summary


@dataclass(frozen=True)
class Column:
    """A value of the records, its heading, and how it is written; `scale` multiplies it first."""

    value: str
    heading: str
    digits: int = 2
    scale: float = 1.0
    write: Callable[[Summary], str] | None = None
    interval: bool = False
    """Mean and interval over seeds and poses, not mean and deviation over seeds."""

    def of(self, results: Results, configuration: str) -> str:
        """Return the cell of a configuration."""
        if not self.interval:
            return self.cell(results.summary(configuration, self.value))
        found = results.interval(configuration, self.value)
        return found.scaled(self.scale).text(self.digits) if found else ""

    def cell(self, found: Summary | None) -> str:
        """Return a cell."""
        if found is None:
            return ""
        scaled = Summary(found.mean * self.scale, found.deviation * self.scale, found.count)
        return self.write(scaled) if self.write else scaled.text(self.digits)


def table(
    results: Results, columns: Sequence[Column], names: Mapping[str, str] | None = None, first: str = ""
) -> str:
    """Return a Markdown table of the configurations in `names`, by their texts; of all without `names`."""
    rows = names or {name: name for name in results.configurations()}
    cells = [[text, *(column.of(results, name) for column in columns)] for name, text in rows.items()]
    return markdown([first, *(column.heading for column in columns)], cells)


def markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"
