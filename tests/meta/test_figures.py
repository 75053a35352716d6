"""House rule about figures: what a document says was measured has a record in git.

1. A figure in README, CHANGELOG, docs, spec or experiments is written from a record, between two marks or in
   a block [`lab/texts.py`]; a table typed by hand is refused [`test_figures_have_records`].
2. What needs no record is quoted in `experiments/records/quoted.txt`, with its reason; an entry that covers
   nothing goes [`test_quotes_are_of_use`].
"""

import measured
import pytest
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


CLEAN = """# Settings and counts
Three seeds, 256x256 pixels, 24 frames, `--limit 30 s`, [a link](b-2.50.md), page 12, version 2.5.

```sh
wamnet bench --budget 12 # 35.8 dB
```

<!-- table: losses -->

| loss | PSNR, dB |
| --- | --- |
| MSE | 31.25 |
| L1 | 31.18 |
| mix | 31.28 |

<!-- end -->

It has <!--= losses/MSE/psnr:.1f -->31.3<!--/--> dB.

| key | default |
|---|---|
| width | 32 |
| rate | 0.5 |
"""
"""A document without a figure of its own."""


def test_settings_and_what_is_written_from_records_pass():
    assert measured.found("x.md", CLEAN) == ([], set())


@pytest.mark.parametrize(
    ("line", "figure"),
    [
        ("It has 35.8 dB.", "35.8 dB"),
        ("It has 35\ndB.", "35 dB"),
        ("> a frame takes 12 ms", "12 ms"),
        ("after 3 minutes", "3 minutes"),
        ("takes 12.5\n> s there", "12.5 > s"),
        ("at 310 GFLOP/s", "310 GFLOP/s"),
        ("1.8 million samples a second", "1.8 million samples a second"),
        ("16.9 frames/s", "16.9 frames/s"),
        ("91 % of the rate", "91 %"),
        ("an error of 2.7e-7", "2.7e-7"),
        ("34.5 ± 0.1", "34.5 ± 0.1"),
        ("SSIM 0.9", "SSIM 0.9"),
        ("FLIP of 0.1", "FLIP of 0.1"),
        ("worth 209 spp", "209 spp"),
        ("about 35 times as fast", "35 times"),
        ("twelve times the operations", "twelve times"),
        ("0.883 against it", "0.883"),
        ("the file has 104 kB", "104 kB"),
    ],
)
def test_a_planted_figure_is_found(line, figure):
    wrong, _ = measured.found("x.md", CLEAN + line)
    assert wrong == [f"x.md:{CLEAN.count(chr(10)) + 1}: {figure}"]


@pytest.mark.parametrize("quote", ["", "> "])
def test_a_table_by_hand_is_found(quote):
    table = "".join(f"{quote}{row}\n" for row in ("| by | ms |", "|---|---|", *("| a | 1.5 |",) * 3))
    wrong, _ = measured.found("x.md", f"{CLEAN}\n{table}")
    assert len(wrong) == 1
    assert "| by | ms |" in wrong[0]
    assert measured.found("x.md", f"{CLEAN}\n{table}", [("x.md", "| by | ms |", "why")])[0] == []


def test_a_quote_covers_its_words_in_its_file_and_no_more():
    text = "It has 35.8 dB,\n> and 35.85 dB there."
    quotes = [("spec/*.md", "has 35.8 dB, and", "why"), ("spec/x.md", "35.8", "why")]
    wrong, used = measured.found("spec/x.md", text, quotes)
    assert (wrong, used) == (["spec/x.md:2: 35.85 dB"], {("spec/*.md", "has 35.8 dB, and")})
    assert len(measured.found("README.md", text, quotes)[0]) == 2
    assert measured.found("spec/x.md", text, [("*", "*", "why")])[0] == []
