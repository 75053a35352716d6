"""The baseline of the kernel rebuild: bugs in emitters, the tests that they are tried with, and outcomes."""

from __future__ import annotations

import ast
import json
import os
import signal

import house3
import pytest
from lab import kill_server, kills, planting, reach
from lab.reach import Traced

SOURCE = '''"""Words."""


class C:
    """A language."""

    clamp = "clamp({0}, {1})"

    def store(self, name):
        """Return a store."""
        if name:
            raise ValueError("a + b")
        return f"{name}[x + 1] = y;"
'''
"""A module that prints."""

SEEDED = [(group, origin) for group in planting.GROUPS for origin in ("hand", "logic", "print")]


def strings():
    return [(fault.kind, fault.planted(SOURCE)) for fault in planting.of_strings("m.py", SOURCE)]


def test_strings_have_other_operators_numbers_names_and_operands():
    """Docstrings, messages of errors and names in braces are left alone."""
    result = strings()
    assert [kind for kind, _ in result] == [
        "operands exchanged", "statement dropped", "name exchanged", "operator", "integer one more",
        "integer one less", "name exchanged",
    ]  # fmt: skip
    assert 'clamp = "clamp({1}, {0})"' in result[0][1]
    assert 'return f""' in result[1][1]
    assert "[y + 1] = y;" in result[2][1]
    assert "[x - 1] = y;" in result[3][1]
    for _, text in result:
        assert text != SOURCE
        ast.parse(text)


@pytest.mark.parametrize(("group", "origin"), SEEDED)
def test_every_group_has_bugs_of_every_origin(group, origin):
    every = planting.faults(group)
    some = [fault for fault in every if fault.origin == origin]
    assert some, f"{group} has no bug of origin {origin}"
    assert all(fault.group == group for fault in some)
    assert len({fault.name for fault in every}) == len(every), "a name is that of one bug"


def test_bugs_by_hand_say_what_the_kernel_does_wrong_and_are_other_programs():
    for fault in planting.written():
        source = (planting.ROOT / fault.file).read_text(encoding="utf-8")
        assert fault.kind, fault.name
        assert fault.says, fault.name
        assert ast.dump(ast.parse(fault.planted(source))) != ast.dump(ast.parse(source)), fault.name


def test_a_seed_draws_the_same_bugs_and_fewer_are_a_part_of_more():
    names = [fault.name for fault in kills.in_turns({"languages": 20, "roles": 10}, 1)]
    assert names == [fault.name for fault in kills.in_turns({"languages": 20, "roles": 10}, 1)]
    assert {f.name for f in kills.in_turns({"languages": 5}, 1)} <= set(names)


# ---- tests that reach a bug -------------------------------------------------------------------------------


def test_the_tier_of_a_test():
    device, reader = "kernels/devices/c_executor.py", "compiler/reading/check.py"
    assert reach.tier(["golden"], "tests/a.py", [device]) == "golden"
    assert reach.tier([], "tests/a.py", [device, reader]) == "device"
    assert reach.tier([], "tests/a.py", [reader]) == "reader"
    assert reach.tier([], "tests/compiler/test_indices.py", []) == "reader"
    assert reach.tier([], "tests/a.py", ["kernels/export/readme.py"]) == "compile"


def some_tests():
    lines = {"compiler/languages/c.py": [300, 301]}
    return [
        Traced("tests/a.py::test_a[1]", 1.0, "device", lines, []),
        Traced("tests/a.py::test_a[2]", 2.0, "device", lines, []),
        Traced("tests/a.py::test_a[3]", 3.0, "device", {}, []),
        Traced("tests/b.py::test_b", 5.0, "reader", {}, ["compiler/languages/c.py:C"]),
        Traced("tests/c.py::test_c", 0.1, "golden", lines, []),
    ]


def test_tests_come_in_the_order_of_their_cost_and_two_of_each_file_first():
    names = [test.name for test in kills.chosen(some_tests())]
    first = ["tests/a.py::test_a[1]", "tests/a.py::test_a[2]", "tests/b.py::test_b"]
    assert names == [*first, "tests/a.py::test_a[3]"]


def test_a_line_in_a_function_and_an_attribute_of_a_class_are_reached():
    index = kills.Index(some_tests())
    inside = next(f for f in planting.written() if f.file.endswith("languages/c.py") and f.function)
    within = inside._replace(first=300, last=300)
    assert [t.name for t in index.of(within)] == [f"tests/{t}" for t in (
        "a.py::test_a[1]", "a.py::test_a[2]", "c.py::test_c")]  # fmt: skip
    attribute = next(f for f in planting.written() if f.detail.startswith('"floor": "floorf'))
    assert [t.name for t in index.of(attribute)] == ["tests/b.py::test_b"]


# ---- outcomes ---------------------------------------------------------------------------------------------

SAME = {"changed": 0, "first": "", "old": "", "new": ""}
OTHER = {"changed": 2, "first": "c plain", "old": "a = b + c;", "new": "a = b - c;"}
COMMENTED = {"changed": 2, "first": "c plain", "old": "/* a */", "new": "/* b */"}


def noted(tier, failed=True):
    return {"test": f"tests/{tier}.py::test", "tier": tier, "failed": failed}


@pytest.mark.parametrize(
    ("state", "tier", "notes", "ended"),
    [
        ("detected", "device", [OTHER, noted("compile"), noted("device")], "done"),
        ("detected", "reader", [OTHER, noted("reader")], "done"),
        ("compiled", "compile", [OTHER, noted("compile")], "done"),
        ("missed", "", [OTHER, noted("device", False)], "done"),
        ("equal", "", [SAME, noted("device", False)], "done"),
        ("text", "", [COMMENTED, noted("device", False)], "done"),
        ("open", "", [OTHER, noted("device", False)], "late"),
        # The signal of a process whose CPU time is used up, or that has crashed.
        ("detected", "device", [OTHER, noted("device", False)], f"signal {signal.SIGXCPU.value}"),
        ("compiled", "import", [], "signal 11"),
    ],
)
def test_the_state_of_a_bug(state, tier, notes, ended):
    fault = next(planting.written())
    result = kills.outcome(fault, some_tests(), {"ended": ended, "notes": notes, "seconds": 1.0})
    assert (result.state, result.tier) == (state, tier)
    assert result.says == fault.says


def test_a_bug_without_tests_is_open():
    fault, answer = next(planting.written()), {"ended": "done", "notes": [OTHER], "seconds": 1.0}
    assert kills.outcome(fault, [], answer).state == "open"
    assert kills.outcome(fault, some_tests(), answer).state == "missed"


def test_outcomes_come_back_from_their_file_and_become_rows(tmp_path):
    fault = next(planting.written())
    result = kills.outcome(fault, [], {"ended": "done", "notes": [OTHER, noted("device")], "seconds": 1.0})
    (tmp_path / "kills.jsonl").write_text(json.dumps(result) + "\n")
    assert kills.outcomes(tmp_path / "kills.jsonl") == {fault.name: result}
    ((name, values),) = kills.rows(tmp_path)
    assert name.startswith("bug: compiler/schedules/emit.py")
    assert (values["part"], values["state"], values["by"]) == ("kills", "detected", "tests/device.py::test")
    assert house3.counts("hand", [values]) == ["hand", "1", "1", "0", "0", "0", "0", "0"]


def test_a_difference_names_the_first_line_that_differs():
    before = {"a": "1\n2\n", "b": "1\n2\n"}
    assert kill_server.difference(before, dict(before))["changed"] == 0
    result = kill_server.difference(before, {"a": "1\n2\n", "b": "1\n3\n"})
    assert result == {"changed": 1, "first": "b", "old": "2", "new": "3"}
    assert kill_server.difference(before, {"a": "1\n"}) == {"changed": 1, "first": "a", "old": "2", "new": ""}


def test_without_tests_none_runs(tmp_path, monkeypatch):
    """Pytest without names would run all tests of the project."""
    monkeypatch.setattr(kill_server, "_emitted", lambda file: {"a": "2"})
    monkeypatch.setattr(kill_server, "_run", lambda *request: pytest.fail("tests run"))
    (tmp_path / "emitted.json").write_text('{"a": "1"}')
    request = {"file": "compiler/languages/c.py", "tests": []}
    kill_server._tried(tmp_path / "tree", request, tmp_path / "notes.jsonl")
    (line,) = (tmp_path / "notes.jsonl").read_text().splitlines()
    assert json.loads(line) == {"changed": 1, "first": "a", "old": "1", "new": "2"}


def test_a_fork_ends_by_itself_or_by_a_signal(tmp_path, monkeypatch):
    (tmp_path / "tree").mkdir()
    monkeypatch.chdir(tmp_path / "tree")
    assert kill_server._fork(lambda: None, 10) == "done"
    assert kill_server._fork(lambda: os.kill(os.getpid(), signal.SIGKILL), 10) == "signal 9"


# ---- the parts --------------------------------------------------------------------------------------------


def test_images_are_of_every_backend_and_role():
    names = [name for name, _ in house3.images(lambda name: None)]
    assert len(set(names)) == len(names)
    for backend in house3.BACKENDS:
        for role in ("plain", "path", "encode", "smooth", "history"):
            assert any(name.startswith(f"image: {backend} {role}") for name in names), (backend, role)


def test_an_image_of_the_small_network_has_a_digest():
    with house3.open_executor("numpy") as device:
        rows = dict(house3.images(lambda name: device))
        name = next(name for name in rows if name.startswith("image: numpy plain small"))
        first, second = rows[name](0), rows[name](0)
    assert first == second
    assert len(first["sha256"]) == 64


def test_a_bound_is_that_of_the_schedule_that_holds_the_model():
    assert house3.bound("cornell", "opencl", "dot16", "full")["schedule"] != "dot16"
    result = house3.bound("cornell", "c", "dot16", "whole8")
    assert result == {"part": "bounds", "schedule": "dot16", "bound": 0.0}
