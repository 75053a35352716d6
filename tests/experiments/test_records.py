"""Texts and plots of the repository are what the records in git give."""

import hashlib
import re
from functools import cache

import pytest
import rewrite
from lab import gallery, plots, records, results, shown, support, texts
from lab.records import Records, checked

from wamnet.kernels.export.targets import NAMES

pytest.importorskip("matplotlib", reason="matplotlib is not installed")

PICTURES = (".png", ".jpg", ".jpeg", ".svg", ".webp", ".gif")
"""Endings of pictures."""

LARGEST_BYTES = 2_000_000
"""All still pictures in git together; and the moving one."""

MOVING = "front.webp"
"""The moving image at the top of README.md, which experiments/front.py makes."""

OTHERS = ("web-page", "front")
"""Beginnings of the names of pictures without a record: of the web page, and on the first page."""


@pytest.fixture(scope="module")
def filled():
    """Give all texts as the records, each read once, fill them: what filled them, and those that differ."""
    filler = texts.Filler(Counting(Records().folder), shown.TABLES, shown.FIGURES)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(results, "_data", cache(results._data))
        return filler, [path.relative_to(records.ROOT).as_posix() for path, _ in texts.stale(filler)]


def test_texts_are_what_the_records_give(filled):
    filler, stale = filled
    assert not stale, f"{stale}: run python experiments/rewrite.py, and read the difference"
    unused = sorted((set(shown.TABLES) | set(shown.FIGURES)) - filler.shown)
    assert not unused, f"lab/shown.py: no text shows {unused}"


def test_every_target_has_a_row_of_the_support_matrix():
    lines = support.matrix(Records()).splitlines()[2:]
    assert sorted(line.split("`")[1] for line in lines) == sorted(NAMES)


def test_plots_are_what_the_records_give():
    stale = [path.name for path, _ in plots.stale(Records(), gallery.PLOTS)]
    assert not stale, f"{stale}: run python experiments/rewrite.py, and look at them"


def test_records_can_be_trusted():
    for name in Records().names():
        data = Records()[name].data()
        assert checked(data, partial=True) == {**data}, f"{name}: publish it again"


def test_code_of_records_is_here_or_in_the_commit_that_they_name():
    readme = (records.ROOT / "experiments/README.md").read_text()
    for name in Records().names():
        data = Records()[name].data()
        programs = set(re.findall(r"python (experiments/\w+\.py)", " ".join(data["commands"])))
        if gone := {program for program in programs if not (records.ROOT / program).exists()}:
            assert re.fullmatch(rf"git show \w+:{gone.pop()}", data.get("code", "")), f"{name}: no such code"
            assert f"`{name}`" in readme, f"experiments/README.md: what did {name} decide?"
        else:
            assert "code" not in data, f"{name}: its code is here"


def test_what_is_pending_is_not_there_and_is_waited_for(filled):
    """An entry goes when its record comes, and when no text waits for it any more."""
    kept, waiting = Records(), records.pending()
    there = sorted(name for name in waiting if name in kept)
    assert not there, f"pending.txt: {there} are there; remove the lines"
    drawn = {name for plot in gallery.PLOTS.values() for name in plot.records}
    idle = sorted(set(waiting) - filled[0].missing - drawn)
    assert not idle, f"pending.txt: no text waits for {idle}; remove the lines"


def test_every_record_is_shown(filled):
    drawn = {name for plot in gallery.PLOTS.values() for name in plot.records}
    idle = sorted(set(Records().names()) - filled[0].records.asked - drawn)
    assert not idle, f"no text shows the records {idle}: show them or remove them"


class Counting(Records):
    """Records that remember what a table or a figure has read."""

    asked: set[str] = set()

    def __getitem__(self, name):
        self.asked.add(name)
        return super().__getitem__(name)


def test_pictures_are_small_and_come_from_records():
    images = records.ROOT / plots.IMAGES
    found = [path for path in sorted(images.rglob("*")) if path.suffix in PICTURES]
    total = sum(path.stat().st_size for path in found if path.name != MOVING)
    assert (images / MOVING).stat().st_size <= LARGEST_BYTES
    assert total <= LARGEST_BYTES, f"pictures in git: {total:,} bytes of {LARGEST_BYTES:,}"
    named = records.pictures(Records())
    for path in found:
        place = path.relative_to(records.ROOT).as_posix()
        if path.stem not in gallery.PLOTS and not path.name.startswith(OTHERS):
            digest = hashlib.sha256(path.read_bytes()).hexdigest()
            assert named.get(place) == digest, f"{place}: no record names it; publish it with --picture"
    assert not [place for place in named if not (records.ROOT / place).exists()]
    text = "".join(path.read_text() for path in texts.documents())
    assert not [path.name for path in found if f"images/{path.name}" not in text], "no document shows these"


def test_the_command_names_what_differs(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(texts, "documents", lambda root: [tmp_path / "README.md"])
    monkeypatch.setattr(texts, "ROOT", tmp_path)
    monkeypatch.setattr(rewrite, "ROOT", tmp_path)
    monkeypatch.setattr(texts.stale, "__defaults__", (tmp_path,))
    monkeypatch.setattr(rewrite, "PLOTS", {})
    monkeypatch.setattr(rewrite, "TABLES", {"all": lambda found: "made\n"})
    (tmp_path / "README.md").write_text("<!-- table: all -->\n<!-- end -->\n")
    with pytest.raises(SystemExit) as left:
        rewrite.main(["--check"])
    assert (left.value.code, "differs: README.md" in capsys.readouterr().out) == (1, True)
    rewrite.main([])
    assert (tmp_path / "README.md").read_text() == "<!-- table: all -->\n\nmade\n\n<!-- end -->\n"
    rewrite.main(["--check"])
