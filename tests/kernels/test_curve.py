"""Tests of curves: the choice among points, files, the cache, and a small measurement."""

import json
import math
from dataclasses import fields, replace

import numpy as np
import pytest
from kit import untrained

from wamnet.compiler import variants
from wamnet.compiler.targets import language_named
from wamnet.kernels import cache
from wamnet.kernels.run import curve
from wamnet.kernels.run.curve import Curve, Limits, Measurement, Point, choose
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame


def point(variant, ms, error=0.1, loss=0.0, schedule="tile:16", mean=0.01):
    return Point(variant, schedule, "opencl", ms, error, mean, loss, 1.0)


FULL, RANK, NARROW = (
    point("full", 100.0, 1e-6),
    point("rank16", 40.0, 0.2, 0.3),
    point("window8", 60.0, 0.1, 0.1),
)
POINTS = (FULL, RANK, NARROW)
"""Three points: the faster, the less accurate."""

CHOICES = {
    "nothing asked": (Limits(), FULL),
    "error": (Limits(max_error=0.15), NARROW),
    "error met exactly": (Limits(max_error=0.1), NARROW),
    "no error": (Limits(max_error=1e-5), FULL),
    "time": (Limits(max_ms=70.0), NARROW),
    "time met exactly": (Limits(max_ms=40.0), RANK),
    "time for all": (Limits(max_ms=1000.0), FULL),
    "loss": (Limits(max_loss_db=0.1), NARROW),
    "a gain": (Limits(max_loss_db=0.0), FULL),
    "error and time": (Limits(max_error=0.3, max_ms=70.0), RANK),
    "all": (Limits(max_error=0.3, max_ms=70.0, max_loss_db=0.2), NARROW),
}
"""What is requested, and what is chosen."""


@pytest.mark.parametrize("name", CHOICES)
def test_the_best_point_within_the_limits(name) -> None:
    limits, expected = CHOICES[name]
    for points in (POINTS, POINTS[::-1]):
        found = choose(points, limits)
        assert found.point == expected
        within = [p for p in POINTS if all(getattr(p, n) <= limit for _, n, limit in limits.rules)]
        assert sorted(p.variant for p, _ in found.rejected) == sorted(
            p.variant for p in POINTS if p not in within
        )


def test_what_is_rejected_names_its_rules() -> None:
    (first, rules), *_ = choose(POINTS, Limits(max_error=0.15, max_ms=70.0)).rejected
    assert (first, rules) == (FULL, "--max-ms 70 (100)")
    rejected = dict(choose(POINTS, Limits(max_error=0.15, max_loss_db=0.2)).rejected)
    assert rejected == {RANK: "--max-error 0.15 (0.2), --max-loss-db 0.2 (0.3)"}


@pytest.mark.parametrize("number", [field.name for field in fields(Point) if field.type == "float"])
def test_numbers_that_are_none_break_every_rule(number) -> None:
    """A point without a time is never chosen; one without an error only where no error is limited."""
    broken = replace(point("rank8", 1.0), **{number: math.nan})
    limits = Limits(max_error=1.0, max_ms=1000.0, max_loss_db=10.0)
    expected = "rank8" if number in ("error_mean", "error_bound") else "rank16"
    assert choose([broken, *POINTS], limits).point.variant == expected
    assert choose([broken, *POINTS], Limits()).point.variant == "full"
    if number == "milliseconds":
        rejected = choose([broken, *POINTS], Limits(max_error=1.0)).rejected
        assert rejected == ((broken, "no time"),)


def test_where_nothing_fits_the_nearest_point_is_named() -> None:
    with pytest.raises(
        InputError, match=r"limit '--max-ms 30': no point .* nearest is rank16, schedule tile:16"
    ):
        choose(POINTS, Limits(max_ms=30.0))
    with pytest.raises(InputError, match=r"nearest is window8.*: 60 ms"):
        choose(POINTS, Limits(max_ms=50.0, max_error=0.1))
    with pytest.raises(
        InputError, match="--max-loss-db -1': no point of the curve keeps it; the nearest is full"
    ):
        choose(POINTS, Limits(max_loss_db=-1.0))
    with pytest.raises(InputError, match="curve '0 points': no point of the curve has a time"):
        choose([], Limits(max_ms=1.0))
    with pytest.raises(InputError, match="curve '1 points': no point of the curve has a time"):
        choose([replace(FULL, milliseconds=math.nan)], Limits())


@pytest.mark.parametrize(
    ("limits", "rule"),
    [
        (Limits(max_error=math.nan), "--max-error nan: must be finite and >= 0"),
        (Limits(max_ms=-1.0), "--max-ms -1.0: must be finite and >= 0"),
        (Limits(max_loss_db=math.inf), "--max-loss-db inf: must be finite"),
    ],
)
def test_limits_that_mean_nothing_are_refused(limits, rule) -> None:
    with pytest.raises(InputError, match=rule):
        choose(POINTS, limits)


CURVE = Curve("abc", "a device", (64, 64), "ieee", POINTS)
"""A curve made by hand."""


def test_curves_are_written_and_read(tmp_path) -> None:
    path = tmp_path / "curve.json"
    path.write_text(json.dumps(CURVE.as_data()))
    assert curve.read(path) == CURVE
    unknown = replace(CURVE, points=(replace(FULL, error_bound=math.nan, error_max=math.inf),))
    data = json.loads(json.dumps(unknown.as_data(), allow_nan=False))
    assert (data["points"][0]["error_bound"], data["points"][0]["error_max"]) == (None, None)
    (found,) = curve.from_data(data, "x").points
    assert math.isnan(found.error_bound)
    assert math.isnan(found.error_max)
    data["points"][0]["gflops"] = 3.0
    assert len(curve.from_data(data, "x").points) == 1, "keys of other readers may be there"


def damaged(change):
    data = CURVE.as_data()
    change(data)
    return data


DAMAGES = {
    "x: schema 'list": [],
    "x: schema 'missing': must be wamnet-curve-1": {},
    "x: schema 'wamnet-curve-0": damaged(lambda d: d.update(schema="wamnet-curve-0")),
    "x: content '.*'points' is missing": damaged(lambda d: d.pop("points")),
    "x: content '.*'milliseconds' is missing": damaged(lambda d: d["points"][0].pop("milliseconds")),
    "x: content '.*could not convert": damaged(lambda d: d["points"][0].update(error_max="much")),
    "variant 'rank': 'rank' is not an approximation": damaged(
        lambda d: d["points"][0].update(variant="rank")
    ),
    "x.points.0..schedule 3: must be a string": damaged(lambda d: d["points"][0].update(schedule=3)),
    "x.model 3: must be a string": damaged(lambda d: d.update(model=3)),
    "x.size .*: must have 2 entries": damaged(lambda d: d.update(size=[3])),
}
"""What is said, and of which data."""


@pytest.mark.parametrize("message", DAMAGES)
def test_data_that_are_no_curve_are_refused(message) -> None:
    with pytest.raises(InputError, match=message):
        curve.from_data(DAMAGES[message], "x")


def test_files_that_are_no_curve_are_refused(tmp_path) -> None:
    with pytest.raises(InputError, match=r"curve file '.*': not found"):
        curve.read(tmp_path / "none.json")
    (tmp_path / "half.json").write_text("{")
    with pytest.raises(InputError, match=r"curve file .* '{': is not acceptable JSON"):
        curve.read(tmp_path / "half.json")


def test_the_cache_gives_only_what_is_wanted(tmp_path, monkeypatch) -> None:
    """Damaged, foreign, or of something else: measured again."""
    monkeypatch.setenv(cache.FOLDER_VARIABLE, str(tmp_path))
    assert curve.cached("c", CURVE) is None
    path = cache.write_json("c", CURVE.as_data())
    assert curve.cached("c", CURVE) == CURVE
    for change in ({"model": "x"}, {"device": "x"}, {"size": (1, 2)}, {"profile": "native"}):
        assert curve.cached("c", replace(CURVE, **change)) is None
    path.write_text(path.read_text().replace("40.0", "4.0"))
    assert curve.cached("c", CURVE) is None
    cache.write_json("c", {"schema": "other"})
    assert curve.cached("c", CURVE) is None


def test_keys_tell_everything_apart() -> None:
    keys = [CURVE.key("opencl", "frames", ["full"])]
    keys += [replace(CURVE, size=(64, 65)).key("opencl", "frames", ["full"])]
    keys += [CURVE.key(*rest) for rest in (("numpy", "frames", ["full"]), ("opencl", "f", ["full"]))]
    keys += [CURVE.key("opencl", "frames", ["full", "rank2"])]
    assert len(set(keys)) == len(keys)


@pytest.fixture
def model():
    return untrained((6,), ("color",), seed=1)


def frames():
    random = np.random.default_rng(1)
    noisy, clean = (Frame({"color": random.random((20, 21, 3), dtype=np.float32)}) for _ in range(2))
    return [(noisy, clean)]


def test_a_measurement_has_every_variant(executor_named, model) -> None:
    names = curve.names_for(model, ("full", "window3", "rank2", "window9", "without-normal"))
    assert names == ("full", "window3", "rank2")
    done = []
    measured = Measurement(executor_named("numpy"), model, (17, 19), frames())
    found = measured.curve(names, repeats=2, on_done=done.append)
    assert [p.variant for p in found.points] == list(names)
    assert (found.model, found.size) == (variants.digest_of(model), (17, 19))
    # Four equal shares of 1, which add up exactly.
    assert sum(done) == 1.0
    full, narrow, _ = found.points
    assert full.error_max <= full.error_bound
    # float32 in place of float64: far below an 8-bit step.
    assert full.error_max <= 1e-5 < narrow.error_max <= narrow.error_bound
    assert all(p.milliseconds > 0 and p.error_mean <= p.error_max for p in found.points)
    assert curve.from_data(json.loads(json.dumps(found.as_data())), "x") == found


def test_every_target_s_schedules_are_tried(denoiser, model) -> None:
    """It was a KeyError for C: `compile --target c --max-ms 9 --frames FOLDER`."""
    found = Measurement(denoiser, model, (8, 8), ()).promising()
    known = set(language_named(denoiser.name).schedules)
    assert found
    assert known.issuperset(found)


def test_pictures_that_are_no_numbers_have_no_quality() -> None:
    one, other = np.full((2, 2, 3), 0.5), np.full((2, 2, 3), 0.25)
    assert curve.quality([one], [one], [other]) == (0.0, 0.0, 0.0)
    largest, mean, loss = curve.quality([one, other], [one, one], [other, one])
    assert (largest, mean) == (0.25, 0.125)
    assert loss == math.inf, "the full network's second picture is the target"
    bad = one.copy()
    bad[0, 0, 0] = np.nan
    assert all(map(math.isnan, curve.quality([one, bad], [one, one], [other, other])))
