"""House rule about figures: what a document says was measured has a record in git.

1. A figure in README, CHANGELOG, docs, spec or experiments is written from a record, between two marks or in
   a block [`lab/texts.py`]; a table typed by hand is refused [`test_figures_have_records`].
2. What needs no record is quoted in `experiments/records/quoted.txt`, with its reason; an entry that covers
   nothing goes [`test_quotes_are_of_use`].
"""

import measured
from lab import records, texts


def looked_at() -> tuple[list[str], set[measured.Quote]]:
    """Return all figures without a record, and the quotes that are of use."""
    quotes, wrong, used = records.quoted(), [], set()
    for path in texts.documents():
        name = path.relative_to(records.ROOT).as_posix()
        mine, covering = measured.found(name, path.read_text(), quotes)
        wrong += mine
        used |= covering
    return wrong, used


def test_figures_have_records(house):
    house.refuse(
        looked_at()[0],
        "A measured figure is written from a record (experiments/lab/texts.py): publish one, quote it with "
        "its reason in experiments/records/quoted.txt, or leave it out.",
    )


def test_quotes_are_of_use(house):
    used = looked_at()[1]
    idle = [f"{file}: {words}" for file, words, _ in records.quoted() if (file, words) not in used]
    house.refuse(idle, "A line of experiments/records/quoted.txt covers a figure: remove it.")
