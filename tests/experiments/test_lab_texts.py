"""Tables, figures and plots are what the records give; marks that lead nowhere are refused."""

import json

import pytest
from lab import plots, texts
from lab.records import Records
from lab.results import written
from results_of import data_of

from wamnet.refimpl.errors import InputError

pytest.importorskip("matplotlib", reason="matplotlib is not installed")


@pytest.fixture
def kept(tmp_path):
    """A folder with one record: three seeds, two poses."""
    rows = [
        {
            "configuration": "a",
            "seed": seed,
            "values": {"psnr": 30.0 + seed, "per_frame": {"psnr": [29.0 + seed, 31.0 + seed]}},
        }
        for seed in range(3)
    ]
    (tmp_path / "study.json").write_text(written(data_of(rows)))
    return Records(tmp_path)


def filler(kept, waiting=()):
    """Return what fills texts with one table and one figure."""
    tables = {"all": lambda found: f"| x |\n| --- |\n| {found['study'].text('a', 'psnr')} |\n"}
    figures = {"seeds": lambda found: str(len(found["study"].records()))}
    return texts.Filler(kept, tables, figures, dict.fromkeys(waiting))


SAMPLE = """Text.
<!-- table: all -->
stale
<!-- end -->
> Decision: so.
> <!-- table: all -->
> <!-- end -->
It has <!--= study/a/psnr:.1f -->0<!--/--> dB of <!--= seeds -->
many<!--/--> seeds, from <!--= study/a/low psnr:.0f -->1<!--/-->.
"""
"""A text with a table, the same in a quotation, and three figures."""


def test_tables_and_figures_are_filled_in(kept):
    made = filler(kept).text(SAMPLE)
    row = "| 31.00 ± 1.00 |"
    assert f"<!-- table: all -->\n\n| x |\n| --- |\n{row}\n\n<!-- end -->" in made
    assert f"> <!-- table: all -->\n>\n> | x |\n> | --- |\n> {row}\n>\n> <!-- end -->" in made
    assert "has <!--= study/a/psnr:.1f -->31.0<!--/--> dB of <!--= seeds -->3<!--/--> seeds" in made
    assert "<!--= study/a/low psnr:.0f -->29<!--/-->" in made
    assert filler(kept).text(made) == made


@pytest.mark.parametrize(
    ("text", "made"),
    [
        ("It has\n<!--= seeds -->3<!--/-->, no more.\n", "It has <!--= seeds -->3<!--/-->,\nno more.\n"),
        ("* It has\n  <!--= seeds -->3<!--/-->\n", "* It has <!--= seeds -->3<!--/-->\n"),
        ("> Of\n> <!--= seeds -->3<!--/--> seeds", "> Of <!--= seeds -->3<!--/-->\n> seeds"),
        (
            "of\n<!--= seeds -->3<!--/--> <!--= seeds -->3<!--/--> two",
            "of <!--= seeds -->3<!--/--> <!--= seeds -->3<!--/-->\ntwo",
        ),
    ],
)
def test_no_line_begins_with_a_mark(kept, text, made):
    """Markdown would end the paragraph there."""
    assert filler(kept).text(text) == made
    assert filler(kept).text(made) == made


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("<!-- table: none -->\n<!-- end -->", "no function of that name"),
        ("<!--= study/a/ssim:.1f -->0<!--/-->", "has no such value"),
        ("<!--= study/b/psnr:.1f -->0<!--/-->", "has no such value"),
        ("<!--= study@scipy -->0<!--/-->", "does not know that package"),
        ("<!--= psnr -->0<!--/-->", "must be record/configuration/value:format"),
        ("<!-- table: all -->\nno end", "has a beginning and an end"),
        ("<!--= study/a/psnr:.1f -->0", "has a beginning and an end"),
        ("<!--= other/a/psnr:.1f -->0<!--/-->", "record 'other': not found"),
    ],
)
def test_marks_that_lead_nowhere_are_refused(kept, text, match):
    with pytest.raises(InputError, match=match):
        filler(kept).text(text)


def test_machine_and_versions_come_from_the_record(kept):
    assert texts.figure(kept, "study@machine", {}) == "2 cores of a processor"
    assert texts.figure(kept, "study@numpy", {}) == "2.0"


def test_what_waits_for_a_record_stays_as_it_was_typed(tmp_path):
    held = filler(Records(tmp_path), ["study"])
    assert held.text(SAMPLE) == SAMPLE
    assert (held.missing, held.shown) == (
        {"study"},
        {"all", "seeds", "study/a/psnr:.1f", "study/a/low psnr:.0f"},
    )


def test_plots_are_the_same_bytes_and_say_what_they_show(kept, tmp_path):
    def draw(found):
        figure, (axis,) = plots.axes(1, (3.0, 2.0))
        plots.lines(axis, {"a": [(1.0, 30.0, 29.0, 31.0)]}, ("x", "dB"))
        plots.bars(axis, {"a": (30.0, 29.0, 31.0)}, "dB")
        return figure

    plot = plots.Plot(draw, ("study",))
    path = tmp_path / plots.IMAGES / "one.svg"
    path.parent.mkdir(parents=True)
    ((target, made),) = plots.stale(kept, {"one": plot}, tmp_path)
    assert target == path
    assert made == plots.svg(draw(kept)) + plots.LINE.format(plots.digest(plot, kept)).encode()
    path.write_bytes(made)
    assert not list(plots.stale(kept, {"one": plot}, tmp_path))
    record = json.loads((kept.folder / "study.json").read_text())
    record["records"][0]["values"]["psnr"] = 29.0
    (kept.folder / "study.json").write_text(written(record))
    assert list(plots.stale(kept, {"one": plot}, tmp_path))
