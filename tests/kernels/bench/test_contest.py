"""The run: contenders compute what they should, and none that fails or dawdles spoils it for others."""

import json
import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kit import untrained

from wamnet.compiler.targets import language_named
from wamnet.kernels.bench import contenders, contest, rates, workload
from wamnet.kernels.bench.contenders import Contender, Opened, Tools, Variant
from wamnet.kernels.bench.contest import front
from wamnet.kernels.bench.rates import Stage
from wamnet.kernels.cache import clean
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable, InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network.denoise import Model, denoise

SIZE = 20
"""Width and height of pictures: more than a window, less than a crop."""


@pytest.fixture(scope="module")
def model() -> Model:
    """Return a network of colour and normal in a window of 4 x 4, with outputs around 0.5."""
    return untrained()


@pytest.fixture(autouse=True)
def small_machine(monkeypatch) -> None:
    """Let the machine be measured on little."""
    monkeypatch.setattr(rates, "MATRIX", 32)
    monkeypatch.setattr(rates, "TRIAD_NUMBERS", 2 * rates.BLOCK_NUMBERS)
    monkeypatch.setattr(rates, "PROBE_PX", (8,))


def kernel(*facts) -> Contender:
    return contenders.kernel(*facts)


def fake(name: str, open_it: Callable[..., Opened], **facts) -> Contender:
    return Contender(name, "a fake", open_it, **facts)


def by_reference(model: Model, **facts) -> Opened:
    """Return a contender that is the reference."""
    return Opened(lambda given: denoise(model, given.frame), "here", **facts)


def run(model: Model, taking_part, **facts) -> dict:
    request = contest.Request(model, SIZE, **{"repeats": 2, "pause_s": 0.0, **facts})
    with Tools() as tools:
        found = contest.Contest(request, taking_part, tools)
        found.run()
        data = found.as_data()
    json.dumps(data, allow_nan=False)
    return data


def rows(data: dict) -> dict[str, dict]:
    return {row["name"]: row for row in data["contenders"]}


def names_on(executor) -> list[Contender]:
    """Return the plain kernel of an executor, others of OpenCL, and one of a rank."""
    found = [kernel(executor.name, "plain")]
    if executor.name == "opencl":
        found += [kernel("opencl", name) for name in ("vector:16", "tile:4")]
    return [*found, kernel(executor.name, "plain", Variant("rank3", "cut", rank=3))]


@pytest.mark.nightly(but="opengl-egl")
def test_kernels_are_within_their_bound(executor, model) -> None:
    """Rounding is bounded for all; what a rank leaves out counts in the error, and not in the rounding."""
    found = rows(run(model, names_on(executor)))
    for row in found.values():
        assert row["state"] == "measured", row["reason"]
        assert row["rounding"]["max"] <= row["rounding"]["bound"]
        assert len(row["ms"]["rounds"]) == 2
        if row["name"].endswith("rank3"):
            assert row["error"]["max"] > row["rounding"]["bound"]
        else:
            assert row["error"]["max"] == row["rounding"]["max"]


def test_counts_are_those_of_the_network(model) -> None:
    """96 x 8 + 8 x 3 products, 8 sines, 6 channels in and 3 out."""
    row = rows(run(model, [kernel("numpy", "plain")]))["numpy:plain"]
    assert (row["products"], row["sines"], row["bytes"]) == (96 * 8 + 24, 8, 4 * 9)
    flops = 2 * row["products"] * SIZE * SIZE / (1e-3 * row["ms"]["median"])
    # A quotient of the same numbers in another order: a few roundings of float64.
    assert abs(row["gflops"] * 1e9 - flops) <= 2.0**-48 * flops


@pytest.mark.parametrize(
    ("error", "state"),
    [
        (CompileError("no such kernel"), "failed"),
        (InputError("size", 1, "too small", "grow"), "failed"),
        (MemoryError(), "failed"),
        (ExecutorUnavailable("nowhere"), "missing"),
        (RuntimeError("its own way to fail"), "failed"),
    ],
)
@pytest.mark.parametrize("late", [True, False])
def test_one_that_fails_is_named_and_others_go_on(model, error, state, late) -> None:
    """When it is opened, or in a round after good frames."""

    def failing(tools, model, size):
        if not late:
            raise error
        opened, frames = by_reference(model), iter(range(3))

        def run(given):
            if next(frames) == 2:
                raise error
            return opened.run(given)

        return Opened(run, "here")

    data = run(model, [fake("bad", failing), fake("good", lambda t, m, s: by_reference(m))], sizes=(8,))
    assert rows(data)["bad"]["state"] == state
    assert rows(data)["bad"]["reason"].endswith(str(error) or "MemoryError")
    assert len(rows(data)["good"]["ms"]["rounds"]) == 2


def test_what_is_predicted_to_dawdle_is_left_out_loudly(model) -> None:
    """A kernel of 10^18 products a pixel is not run."""

    def open_it(tools, model, size):
        def never(given):
            raise AssertionError

        return Opened(never, "here", stages=(Stage(1e18, 0, 0),))

    data = run(model, [fake("endless", open_it, executor="numpy")])
    row = rows(data)["endless"]
    assert row["state"] == "skipped"
    assert row["reason"].startswith("left out: a frame would take ")
    assert row["reason"].endswith("s by the cost model, more than --budget 30 s")


def test_quality_is_a_loss_against_the_full_network(model) -> None:
    """The full network loses exactly 0; who returns the reference has no finite PSNR, and an SSIM of 1."""
    frame = workload.noise(SIZE)
    clean = Frame({"color": workload.noise(2 * SIZE)["color"][SIZE:, SIZE:]})

    def perfect(tools, model, size):
        return Opened(lambda given: clean["color"], "here", display=lambda c: _encoded(model, clean))

    taking_part = [
        fake("same", lambda t, m, s: by_reference(m)),
        fake("perfect", perfect, variant=None),
    ]
    data = run(model, taking_part, pairs=((frame, clean), (frame, clean)))
    same, best = rows(data)["same"]["quality"], rows(data)["perfect"]["quality"]
    assert (same["psnr_loss_db"], same["ssim_loss"]) == (0.0, 0.0)
    assert best["psnr_db"] is None
    # SSIM of equal pictures is 1 up to the rounding of its means in float64.
    assert abs(best["ssim"] - 1.0) <= 1e-9
    assert "error" not in rows(data)["perfect"]
    assert data["front"]["quality"] == ["same"]
    assert data["unseen_frames"] == 2
    assert same["psnr_frames_db"] == [same["psnr_db"]] * 2


def _encoded(model: Model, clean: Frame) -> np.ndarray:
    from wamnet.refimpl.network.dataset import target_image

    return target_image(clean, model.normalization)


def test_turns_are_taken(model) -> None:
    """After a first and a second frame each, one frame of each in every round."""
    order: list[str] = []

    def noting(name):
        def open_it(tools, model, size):
            reference = by_reference(model)

            def run(given):
                order.append(name)
                return reference.run(given)

            return Opened(run, "here")

        return fake(name, open_it)

    run(model, [noting("a"), noting("b")])
    assert order == ["a", "b", "a", "b", "a", "b", "a", "b"]


@pytest.mark.nightly(but=("opencl-sine7", "numpy-native"))
@pytest.mark.parametrize("variant", contenders.VARIANTS, ids=lambda variant: variant.name)
def test_variants_are_within_their_bound(executor, model, variant) -> None:
    """On this frame, and for all images; a sine that promises nothing has neither bound."""
    found = rows(run(model, [kernel(executor.name, "plain", variant)]))
    (row,) = found.values()
    rounding = row["rounding"]
    assert (row["profile"], row["executor"], row["schedule"]) == (variant.profile, executor.name, "plain")
    if language_named(executor.name).under(variant.profile).sine.error is None:
        assert (rounding["bound"], rounding["bound_all"], rounding["certified"]) == (None, None, False)
    else:
        assert rounding["max"] <= rounding["bound"] <= rounding["bound_all"]
    assert row["degree"] == {"sine7": 7, "sine9": 9, "sine5": 5, "native": None}[variant.name]


# ---- the list of contenders --------------------------------------------------------------------------------


@pytest.mark.needs("packages")
def test_names_are_unique_and_schedules_complete() -> None:
    from wamnet.compiler.targets import LANGUAGES, TARGETS

    with Tools() as tools:
        everybody = contenders.of_machine(tools, SIZE)
        few = contenders.of_machine(tools, SIZE, quick=True)
    names = [each.name for each in everybody]
    assert len(set(names)) == len(names)
    form = Variant("rank3", "trained", rank=3)
    with Tools() as tools:
        trained = contenders.of_machine(tools, SIZE, forms=[form])
    assert {each.executor for each in trained if each.variant is form} == {"opencl", "opengl"}
    assert {f"{t}:{s}" for t in TARGETS for s in LANGUAGES[t].schedules} <= set(names)
    assert {each.name for each in few} < set(names)


@pytest.mark.needs("packages")
def test_an_executor_that_is_missing_is_in_the_list(monkeypatch, model) -> None:
    """And says in its row what is missing."""

    def missing(self, name):
        raise ExecutorUnavailable(f"{name}: not here")

    monkeypatch.setattr(Tools, "executor", missing)
    with Tools() as tools:
        everybody = contenders.of_machine(tools, SIZE)
    data = run(model, contenders.chosen(everybody, ["opencl:plain"], []))
    assert rows(data)["opencl:plain"]["reason"] == "opencl: not here"
    assert rows(data)["opencl:plain"]["state"] == "missing"


def test_choice_by_name_and_executor() -> None:
    everybody = [kernel(n, "plain") for n in ("numpy", "opencl")]
    everybody.append(fake("peer", lambda t, m, s: by_reference(m)))
    names = lambda only, executors: [c.name for c in contenders.chosen(everybody, only, executors)]  # noqa: E731
    assert names([], []) == ["numpy:plain", "opencl:plain", "peer"]
    assert names(["open*", "peer"], []) == ["opencl:plain", "peer"]
    assert names([], ["numpy"]) == ["numpy:plain", "peer"]
    with pytest.raises(
        InputError, match=r"name of a program 'nobody': matches none \(choose one of numpy:plain"
    ):
        names(["nobody"], [])


# ---- what is denoised --------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0, -1, 8193])
def test_sizes_without_a_picture_are_refused(size) -> None:
    with pytest.raises(InputError, match=r"size of the image -?\d+: must be from 1 to 8192"):
        workload.noise(size)


# ---- the front, and data that JSON can hold --------------------------------------------------------------

NUMBERS = st.one_of(st.sampled_from([0.0, 1.0, 2.0, 3.0]), st.just(math.nan), st.none())
"""Few values, so that ties are common."""


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ({}, []),
        ({"a": (1.0, 1.0)}, ["a"]),
        ({"a": (1.0, 2.0), "b": (2.0, 1.0), "c": (2.0, 2.0)}, ["a", "b"]),
        ({"slow": (2.0, 1.0), "fast": (1.0, 1.0)}, ["fast"]),
        ({"far": (1.0, 2.0), "near": (1.0, 1.0)}, ["near"]),
        ({"a": (1.0, 1.0), "twin": (1.0, 1.0), "b": (1.0, 3.0)}, ["a", "twin"]),
        ({"nan": (1.0, math.nan), "none": (None, 0.0), "late": (math.inf, 0.0), "a": (5.0, 5.0)}, ["a"]),
        ({"nan": (math.nan, math.nan)}, []),
        ({"loss": (2.0, -0.1), "gain": (1.0, -0.3)}, ["gain"]),
    ],
)
def test_front(points, expected) -> None:
    """A NaN beats nobody and is not on it; equal points stay both."""
    assert front(points) == expected


@given(st.dictionaries(st.sampled_from("abcdefgh"), st.tuples(NUMBERS, NUMBERS)))
def test_every_other_point_is_beaten_by_one_on_the_front(points) -> None:
    on_it = front(points)
    known = {n: p for n, p in points.items() if None not in p and not any(map(math.isnan, p))}
    assert set(on_it) <= set(known)
    for name, (time, error) in known.items():
        beaten = any(
            points[o][0] <= time and points[o][1] <= error and points[o] != (time, error) for o in on_it
        )
        assert beaten == (name not in on_it)


def test_what_json_does_not_know_is_null() -> None:
    found = clean({"a": math.nan, "b": [math.inf, np.float32(0.5), np.int64(3)], 4: (True, None, "x", 7)})
    assert found == {"a": None, "b": [None, 0.5, 3.0], "4": [True, None, "x", 7]}
    json.dumps(found, allow_nan=False)
