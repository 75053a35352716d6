"""Interleaved times: the order of the runs, what is measured, and what a way measures itself."""

from collections.abc import Callable

from wamnet.kernels import measure
from wamnet.kernels.measure import Times, in_turns


def test_ways_take_turns_after_warm_runs() -> None:
    """One unmeasured run each, then round by round; a clock that counts its readings gives 1 a run."""
    order: list[str] = []
    readings = iter(range(100))

    def way(name: str) -> Callable[[], None]:
        return lambda: order.append(name)

    found = in_turns({"a": way("a"), "b": way("b")}, 2, pause_s=0.0, clock=lambda: float(next(readings)))
    assert order == ["a", "b"] * 3
    assert found == {"a": Times((1.0, 1.0)), "b": Times((1.0, 1.0))}


def test_each_measured_run_comes_after_a_rest(monkeypatch) -> None:
    """Warm runs do not."""
    order: list[object] = []
    monkeypatch.setattr(measure, "rest", order.append)
    in_turns({"a": lambda: order.append("a")}, 2, warm=1, pause_s=0.25)
    assert order == ["a", 0.25, "a", 0.25, "a"]


def test_a_way_may_measure_itself() -> None:
    """What it returns replaces the clock's difference."""
    own = iter([9.0, 3.0, 1.0, 2.0])
    times = in_turns({"device": lambda: next(own)}, 3, pause_s=0.0)["device"]
    assert times.seconds == (3.0, 1.0, 2.0)
    assert times.median == 2.0
    assert times.spread == (3.0 - 1.0) / 2.0


def test_entries_open_and_take_turns_while_they_are_in() -> None:
    """Round 0 is not measured; one takes part in a single round, another has no round and is out."""
    order: list[tuple[str, int]] = []

    def opened(name: str) -> Callable[[], measure.Round]:
        return lambda: lambda number: order.append((name, number))

    entries = [measure.Entry("a", opened("a")), measure.Entry("b", opened("b"), most=1)]
    done = [0]
    measure.begin(entries)
    measure.take_turns([*entries, measure.Entry("out")], 2, done=lambda: done.append(len(order)))
    assert order == [("a", 0), ("b", 0), ("a", 1), ("b", 1), ("a", 2)]
    assert [len(entry.seconds) for entry in entries] == [2, 1]
    assert done == [0, 3, 4, 4, 5, 5, 5]
