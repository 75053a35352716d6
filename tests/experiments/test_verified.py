"""The tables of renderers: cells in few words, deviations, and results that are kept."""

from __future__ import annotations

import verified

from wamnet_verify import judgement, renderers, run
from wamnet_verify.cases import chosen
from wamnet_verify.judgement import Missing


class Half:
    """Half as much light as there should be, and no layers."""

    name = "half"
    intents = ()

    def pictures(self, shot, seeds):
        if shot.display:
            return Missing(judgement.UNTESTED, "no screen")
        pictures = renderers.Own().pictures(shot, seeds)
        return [{"color": picture["color"] * 0.5} for picture in pictures]


def test_cells_say_what_was_found():
    found = run.verify(Half(), chosen(["radiance", "display", "albedo-matte", "lamp-back"]), pictures=4)
    assert verified.cell(found, "radiance") == "**3 of 3 deviate**"
    assert verified.cell(found, "display") == "not tested"
    assert verified.cell(found, "albedo") == "not tested"
    assert verified.cell(found, "one-sided") == "1 pass"
    assert verified.cell(found, "finite") == "kept"


def test_results_are_kept(tmp_path, monkeypatch, capsys):
    """The second run asks nobody."""
    monkeypatch.setattr(verified, "questions", lambda: chosen(["sky-dim"]))
    arguments = ["--only", "half", "-o", str(tmp_path), "--pictures", "4"]
    monkeypatch.setattr(renderers, "known", lambda *_: Half())
    verified.main(arguments)
    first = capsys.readouterr().out
    assert "| half | radiance | sky-dim | 0.25 | 0.5 | -50.00 % ± 0.00 | confirmed |" in first
    monkeypatch.setattr(renderers, "known", None)
    verified.main(arguments)
    assert capsys.readouterr().out == first
