"""Write all tables, figures and plots of the texts again from the records in git.

    python experiments/rewrite.py
    python experiments/rewrite.py --check

1. Blocks and figures in README, CHANGELOG, docs, spec and experiments [`lab/texts.py`], and the plots
   [`lab/plots.py`] are made from experiments/records. All of them are made before the first is written.
2. `--check` writes nothing, names what differs, and ends with status 1 if anything does.
3. What waits for a record that is still to be made is listed, with the command that makes it.
"""

import sys
from collections.abc import Sequence

from lab import plots, texts
from lab.command import begin, described
from lab.gallery import PLOTS
from lab.records import ROOT, Records, pending
from lab.shown import FIGURES, TABLES

from wamnet.cli.files.outputs import replacing, write_text


def main(arguments: Sequence[str] | None = None) -> None:
    """Write what differs, or name it."""
    parser = described(__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing; status 1 if anything differs")
    options = parser.parse_args(arguments)
    records = Records()
    filler = texts.Filler(records, TABLES, FIGURES)
    stale = list(texts.stale(filler))
    drawn = list(plots.stale(records, PLOTS))
    for path, text in [] if options.check else stale:
        write_text(path, text)
    for path, picture in [] if options.check else drawn:
        with replacing(path) as new:
            new.write_bytes(picture)
    for path, _ in (*stale, *drawn):
        print(f"{'differs' if options.check else 'written'}: {path.relative_to(ROOT)}")
    for name, (line, time) in pending().items():
        print(f"waits for the record {name}: {line} ({time})")
    sys.stdout.flush()
    if options.check and (stale or drawn):
        raise SystemExit(1)


if __name__ == "__main__":
    begin(main)
