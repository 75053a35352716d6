"""The autotuner: what it times, what it leaves out and says, and when its table is taken."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import untrained

from wamnet.compiler.targets import language_named
from wamnet.compiler.variants import plan_model
from wamnet.kernels import Pipeline, cache, denoise_on
from wamnet.kernels.run import tune
from wamnet.kernels.run.tune import Row, Table, Tuning
from wamnet.refimpl import frame
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.network.window import Window

SIZE = (12, 20)
"""Height and width of the pictures."""


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path / "cache"))


def model(hidden=(8,), window=3):
    return untrained(hidden, size=window, omegas=(3.0, 3.0), seed=1)


def planned(executor, network=None, **how):
    """Return the plan of a network, the usual one where none is given."""
    return plan_model(network or model(), executor.name, **how)


def choose(executor, plan, size, pictures=1):
    """Return the schedule of a plan and why."""
    return Tuning(executor, plan.model, size, plan.varied).picked(pictures)


def measured(executor, plan, *names):
    """Return the table of a plan: of the schedules that are named, or of all."""
    if names:
        few = {name: plan.target.schedules[name] for name in names}
        plan = replace(plan, target=replace(plan.target, schedules=few))
    return Tuning(executor, plan.model, SIZE, plan.varied).measured(plan, repeats=1)


def keep(executor, table):
    """Put a table into the cache as if it had been measured."""
    found = {"device": "d", "network": "n", "size": list(SIZE), "day": "2026-01-02", "rows": table}
    assert cache.write_json(Tuning(executor, model(), SIZE).entry, found)


def row(schedule, ms, again_s=0.1):
    return {"schedule": schedule, "ms": ms, "first_s": 1.0, "again_s": again_s, "note": ""}


def test_every_schedule_is_checked_and_the_fastest_is_taken(executor_named):
    executor = executor_named("opencl")
    table = measured(executor, planned(executor))
    assert {r.schedule for r in table.rows} == set(language_named("opencl").schedules)
    assert all((r.ms is None) == bool(r.note) for r in table.rows)
    assert all(r.again_s > 0 for r in table.rows if r.ms is not None)
    assert table.network == "54-8-3, color + normal, window 3 (clamp)"
    assert Tuning(executor, model(), SIZE).remembered() == table
    best = min((r for r in table.rows if r.ms is not None), key=lambda r: r.ms)
    schedule, reason = choose(executor, planned(executor), SIZE, pictures=10**9)
    assert schedule == best.schedule
    assert reason.startswith(f"tuned on this device on {table.day}: {best.ms:.3g} ms at 20x12, ")


@pytest.mark.parametrize("fault", [lambda image: image + 0.01, lambda image: image * np.nan])
def test_a_schedule_with_a_wrong_result_is_not_timed(executor_named, monkeypatch, fault):
    executor = executor_named("opencl")
    run = executor.run
    wrong = lambda artifact, images: fault(run(artifact, images))  # noqa: E731
    chosen = lambda artifact, images: (  # noqa: E731
        wrong if artifact.manifest["schedule"]["name"] == "tile:16" else run
    )(artifact, images)
    monkeypatch.setattr(executor, "run", chosen)
    table = measured(executor, planned(executor), "plain", "tile:16")
    (bad,) = [r for r in table.rows if r.schedule == "tile:16"]
    assert bad.ms is None
    assert bad.note.startswith("its result is wrong on this device: ")
    assert choose(executor, planned(executor), SIZE)[0] != "tile:16"


def test_what_does_not_hold_the_program_says_why(executor_named, monkeypatch):
    monkeypatch.setattr("wamnet.compiler.schedules.group.LARGEST_NUMBERS", 30)
    executor = executor_named("opencl")
    table = measured(executor, planned(executor, model((8, 8), 1)), "group:1", "group:4")
    notes = {r.schedule: r.note for r in table.rows}
    assert notes["group:4"].startswith("two layers of 4 pixels are 64 numbers, of at most 30")
    assert "numbers" not in notes["group:1"]


def test_compilation_counts_for_few_pictures():
    rows = (Row("a", 100.0, 9.0, 0.5), Row("b", 50.0, 9.0, 20.0), Row("c", note="none"))
    table = Table("d", "n", SIZE, "2026-01-02", rows)
    assert [table.best(n).schedule for n in (1, 389, 391)] == ["a", "a", "b"]
    assert replace(table, rows=rows[2:]).best(1) is None


def test_without_a_table_the_choice_is_built_in(executor):
    schedule, reason = choose(executor, planned(executor), SIZE)
    assert schedule == executor.schedule_for(SIZE)
    assert reason == executor.schedule_reason
    assert reason.startswith("built-in choice" if executor.name != "numpy" else "the only one")


CHANGES = {
    "device": lambda executor, patch: patch.setattr(executor, "device", "another"),
    "driver": lambda executor, patch: patch.setattr(executor, "driver", "4.7"),
    "cores": lambda executor, patch: patch.setattr("os.sched_getaffinity", lambda _: range(99)),
    "compiler": lambda executor, patch: patch.setattr(cache, "program_version", lambda: "another"),
}
"""What makes a table useless."""


@pytest.mark.parametrize("change", CHANGES)
def test_a_table_of_another_machine_is_not_taken(executor_named, monkeypatch, change):
    executor = executor_named("opencl")
    keep(executor, [row("plain", 1.0)])
    assert choose(executor, planned(executor), SIZE)[0] == "plain"
    CHANGES[change](executor, monkeypatch)
    assert choose(executor, planned(executor), SIZE)[1].startswith("built-in")


def test_a_table_of_another_network_or_size_is_not_taken(executor_named, monkeypatch):
    executor = executor_named("opencl")
    keep(executor, [row("plain", 1.0)])
    assert choose(executor, planned(executor), (16, 16))[0] == "plain"  # 240 and 256 pixels: 2^7 to 2^8
    zero = replace(model(), window=Window(3, "zero"))
    albedo = replace(model(), features=("color", "albedo"))
    cases = [(model((9,)), SIZE), (zero, SIZE), (albedo, SIZE), (model(), (13, 20)), (model(), (12, 10))]
    for other, size in cases:
        assert choose(executor, planned(executor, other), size)[1].startswith("built-in")
    for variant in ("rank2", "sine7"):
        assert choose(executor, planned(executor, variant=variant), SIZE)[1].startswith("built-in")
    monkeypatch.setattr(executor, "profile", "native")
    assert choose(executor, planned(executor), SIZE)[1].startswith("built-in")


@given(height=st.integers(1, 5000), width=st.integers(1, 5000))
def test_size_classes_are_powers_of_two(height, width):
    k = tune.size_class((height, width))
    assert 2**k / 2 < height * width <= 2**k


@pytest.mark.parametrize(
    "data",
    [
        {"rows": 3},
        [],
        {"rows": [{"schedule": "plain", "color": 1}], "size": [1, 1], "device": "", "network": "", "day": ""},
        {"rows": [row("plain", 1.0)], "size": [1], "device": "", "network": "", "day": ""},
    ],
)
def test_an_entry_that_is_no_table_is_none(executor_named, data):
    executor = executor_named("opencl")
    cache.write_json(Tuning(executor, model(), SIZE).entry, data)
    assert choose(executor, planned(executor), SIZE)[1].startswith("built-in")


def test_a_damaged_table_is_measured_anew(executor_named, caplog):
    executor = executor_named("opencl")
    keep(executor, [row("plain", 1.0)])
    (path,) = cache.folder().iterdir()
    path.write_text(path.read_text().replace("plain", "tile:4"))
    assert choose(executor, planned(executor), SIZE)[1].startswith("built-in")
    assert "is damaged, or no entry of wamnet: it is ignored" in caplog.text
    table = measured(executor, planned(executor), "plain")
    assert Tuning(executor, model(), SIZE).remembered() == table


def test_pictures_are_made_with_the_schedule_of_the_table(executor_named):
    executor = executor_named("opencl")
    keep(executor, [row("vector:16", 5.0, 1.0), row("tile:4", 6.0, 0.1)])
    noisy = frame.Frame({name: np.zeros((*SIZE, 3), np.float32) for name in ("color", "normal")})
    one = denoise_on(executor, model(), noisy)
    assert one.schedule.startswith("tile:4: ")
    assert one.reason == "tuned on this device on 2026-01-02: 6 ms at 20x12, 0.1 s to build"
    assert denoise_on(executor, model(), noisy, pictures=1000).schedule.startswith("vector:16: ")
    asked = denoise_on(executor, model(), noisy, schedule="plain")
    assert asked.schedule.startswith("plain: ")
    assert asked.reason == "as asked"
    for pictures, name in ((1, "tile:4"), (1000, "vector:16")):
        with Pipeline(executor, canonical("lone_light"), model(), SIZE, pictures=pictures) as pipeline:
            assert pipeline.denoise.manifest["schedule"]["name"] == name
