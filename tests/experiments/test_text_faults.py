"""Experiments about what is proven: the table of kernels, and faults that are planted in texts."""

import certified
import text_faults


def test_a_kernel_is_a_row(capsys, monkeypatch):
    certified.main(["--models", "cornell", "--only", "wgsl:plain:whole8"])
    (plain,) = capsys.readouterr().out.splitlines()[2:3]
    assert plain.startswith("| cornell | wgsl | plain | whole8 | 0: the same bits | 0.00 | ")
    assert "| computes it: 5 sums |" in plain

    def unread(path):
        raise certified.Unread("a word")

    monkeypatch.setattr(certified, "check_text", unread)
    certified.main(["--models", "cornell", "--only", "wgsl:plain:whole8"])
    assert "| not checked: a word |" in capsys.readouterr().out


def test_faults_are_kept_apart(tmp_path, capsys):
    """Spare room is not a fault; what the reader accepts is, and ends with status 1."""
    source = "/* */ void f() {\n    float v[4];\n    x = v[0] + 0.5f;\n}\n"
    found = list(text_faults.faults(source))
    assert {f.kind for f in found} >= {"an integer one more", "another operator", "a statement lost"}
    (room,) = (f for f in found if f.kind == "an integer one more" and f.new == "5")
    assert text_faults.spare(source, room)
    larger = text_faults.Fault(source.index("4"), source.index("4"), "1 + ", "a foreign word")
    shared = text_faults.Fault(source.index("float"), source.index("float"), "1 + ", "a foreign word")
    assert [text_faults.spare(source, fault) for fault in (larger, shared)] == [True, False]
    (sign,) = (f for f in found if f.new == "-")
    assert not text_faults.spare(source, sign)


def test_what_is_accepted_ends_with_status_1(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(text_faults, "TILES", ())
    monkeypatch.setattr(text_faults, "TITLES", ("opencl",))
    assert text_faults.main(["--count", "3"]) == 0
    assert "| opencl | plain |" in capsys.readouterr().out
    monkeypatch.setattr(text_faults, "run_text", lambda *given: {"sums": 1})
    assert text_faults.main(["--count", "3"]) == 1
