"""Nothing becomes a record that cannot be trusted; what does keeps what was found."""

import math

import publish
import pytest
from lab import printed, texts
from lab.records import Records, checked, flat, nested, of_bench
from lab.results import Results, summary
from results_of import data_of

from wamnet.refimpl.errors import InputError


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"records": []}, "have no records"),
        ({"commands": []}, "do not state their command"),
        ({"settings": {"scale": "toy"}}, "are of scale toy and mean nothing"),
        ({"records": [{"configuration": "a", "seed": 0, "values": {"psnr": math.inf}}]}, "must be finite"),
        (
            {"records": [{"configuration": "a", "seed": 0, "values": {"x": [1.0, math.nan]}}]},
            "must be finite",
        ),
        (
            {
                "records": [
                    {"configuration": c, "seed": s, "values": {}} for c, s in (("a", 0), ("a", 1), ("b", 0))
                ]
            },
            "it lacks seeds",
        ),
        ({"settings": {"folder": "/" + "home/me/out"}}, "no place of one machine"),
    ],
)
def test_what_cannot_be_trusted_is_no_record(changes, match):
    row = {"configuration": "a", "seed": 0, "values": {"psnr": 30.0}}
    assert checked(data_of([row]))["records"] == [row]
    with pytest.raises(InputError, match=match):
        checked(data_of([row], **changes))


def test_a_result_becomes_a_record(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(publish, "FOLDER", tmp_path)
    results = Results(tmp_path / "found.json", "study", {"scale": "small"}, "python experiments/study.py")
    results._write([])
    results.put("a", 0, {"psnr": 30.123456789})
    publish.main([str(results.path), "--name", "kept"])
    assert "kept.json: 1 records" in capsys.readouterr().out
    assert Records(tmp_path)["kept"].of("a", "psnr") == [30.1235]
    with pytest.raises(InputError, match="FILE or --run NAME COMMAND: one of them is needed"):
        publish.main([])
    with pytest.raises(InputError, match="must be python experiments"):
        publish.main(["--run", "x", "rm", "-r", "x"])
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(InputError, match="cannot be read"):
        publish.main([str(tmp_path / "broken.json")])


def test_what_a_program_prints_becomes_a_record(tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "FOLDER", tmp_path)
    monkeypatch.setattr(publish, "ROOT", tmp_path)
    (tmp_path / "experiments").mkdir()
    text = "| by | ms | ms |\\n|---|---|---|\\n| a/b | **1,024** | 2.50 |\\n| a/b | 3 | - |"
    (tmp_path / "experiments/x.py").write_text(f'print("""{text}""")')
    publish.main(["--run", "speed", "python", "experiments/x.py"])
    found = Records(tmp_path)["speed"]
    assert printed.table(found).splitlines()[0::2] == ["| by | ms | ms |", "| a/b | **1,024** | 2.50 |"]
    assert found.data()["commands"] == ["python experiments/x.py"]
    assert texts.figure(Records(tmp_path), "speed/a,b/ms:.0f", {}) == "1024"
    assert texts.figure(Records(tmp_path), "speed/a,b #2/ms:.1f", {}) == "3.0"
    with pytest.raises(InputError, match="does not begin with a number"):
        texts.figure(Records(tmp_path), "speed/a,b #2/ms #2:.1f", {})
    (tmp_path / "experiments/x.py").write_text("raise SystemExit(3)")
    with pytest.raises(InputError, match="must end with status 0"):
        publish.main(["--run", "speed", "python", "experiments/x.py"])


def test_a_benchmark_becomes_a_record():
    row = {"name": "opencl:plain", "text": "plain", "kind": "kernel", "ms": {"median": 2.0}, "error": None}
    data = {
        "schema": "wamnet-bench-2",
        "size_px": 64,
        "contenders": [row],
        "sizes": [{"size_px": 32, "contenders": [row]}],
        "limits": {"flops_per_s": 1e9},
    }
    found = of_bench(data, "wamnet bench")
    names = [record["configuration"] for record in found["records"]]
    assert names == ["opencl:plain", "opencl:plain@32", "machine"]
    assert found["records"][0]["values"] == {"text": "plain", "kind": "kernel", "ms.median": 2.0}
    assert checked(found)["commands"] == ["wamnet bench"]
    assert flat({"a": {"b": {"c": 1}, "d": None}}) == {"a.b.c": 1}
    assert nested({"a.b.c": 1, "a.e": 2, "f": 3}) == {"a": {"b": {"c": 1}, "e": 2}, "f": 3}


def test_what_is_shown_of_departures_follows_from_their_values():
    """A decided question's tables are text in its record; these are differences of means, in dB."""
    found = Records()["departures"]
    shown = found.data()["shown"]
    names = list(dict.fromkeys(record["configuration"] for record in found.records()))
    rows = [summary(found.of(name, "psnr")) for name in names]
    cells = [line.split(" | ")[-1].rstrip(" |") for line in shown["departures"].splitlines()[2:]]
    assert cells == [row.text() for row in rows]
    for name, other in (("clip", "unclipped"), ("loss", "summed"), ("replacement", "without replacement")):
        assert shown[f"departures-{name}"] == f"{abs(rows[names.index(other)].mean - rows[0].mean):.2f}"
