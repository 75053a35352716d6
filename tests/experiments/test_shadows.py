"""The experiment on shadow rays: what its rows read, and its scores of a frame."""

import numpy as np
import pytest
import shadows

from wamnet.refimpl import metrics
from wamnet.refimpl.frame import Frame


def test_direct_light_takes_the_place_of_the_unshadowed_one():
    found = {name: row.layers[4:] for name, row in shadows.ROWS.items()}
    assert found["4 camera rays, no shadow ray"] == ("unshadowed",)
    assert found["4 camera rays, no shadow ray, visible lights"] == ("unshadowed", "seen_emission")
    assert found["16 camera rays, 16 shadow rays"] == ("direct",)
    assert set(shadows.SHOWN) <= set(shadows.ROWS)


def test_scores_are_of_the_penumbra_too():
    """A difference of 0.1 in the left half, which is in the penumbra, and none in the right half."""
    grey = np.full((32, 32, 3), 0.2, np.float32)
    half = np.where(np.arange(32) < 16, 0.5, 1.0)[None, :, None] * np.ones_like(grey)
    reference = Frame({"color": grey, "unshadowed": np.ones_like(grey), "direct": half})
    target = shadows.to_display(grey)
    found = shadows.score_lit(target + 0.1 * (half < 1.0), reference)
    assert abs(found["penumbra"] - 25.5) <= 255.0 * 2.0**-20  # float32 in, a tenth of 255
    assert 0.0 < found["blurred"] < found["penumbra"]


def test_under_a_sun_the_penumbra_is_that_of_its_light(tmp_path):
    """Of what the sun lights, all of it, or nothing, reaches most of a frame; its edge reaches the rest."""
    options = shadows.options_of(
        ["--tests", "1", "--size", "24", "--spp", "4", "--executor", "numpy", "--cache", str(tmp_path)]
    )
    ((_, target),) = shadows.Bench(options, "daylight").pairs("test", shadows.Row(1), 0)
    full = target["unshadowed"].sum(axis=-1)
    share = target["direct"].sum(axis=-1)[full > 0.1] / full[full > 0.1]
    assert np.count_nonzero(share < 0.05) > 10 < np.count_nonzero(share > 0.9)
    assert 0.0 < metrics.penumbra(target["direct"], target["unshadowed"]).mean() < 0.3


@pytest.mark.parametrize("given", [["--rows", "2 paths"], ["--models", "glossy"]])
def test_times_are_compared_with_the_usual_row_whatever_is_asked_for(given, monkeypatch):
    bench = shadows.Bench(shadows.options_of(["--times", *given]), "vitrine")
    monkeypatch.setattr(shadows, "milliseconds", lambda bench, models, clock: dict.fromkeys(models, 5.0))
    monkeypatch.setattr(shadows.Bench, "untrained", lambda bench, row: None)
    found = shadows.times_of(bench)
    assert [shadows.USUAL, "5", "1.00"] in found
    assert len(found) > 1


def test_frames_outside_are_of_cameras_beyond_those_of_training(tmp_path):
    found = [
        [shot.variation.yaw_deg for shot in bench.shots(bench.tests, shadows.Row(16), 0)]
        for outside in ([], ["--outside"])
        for bench in [shadows.Bench(shadows.options_of(outside), "vitrine")]
    ]
    assert [len(yaws) for yaws in found] == [4, 4]
    assert max(map(abs, found[0])) <= 24.0 < min(map(abs, found[1]))


def test_the_same_direct_light_takes_the_place_of_the_path_s_own(tmp_path):
    """What is left of a path's own colour is light after two scatterings or more, nowhere negative."""
    options = shadows.options_of(
        ["--tests", "1", "--size", "16", "--executor", "numpy", "--cache", str(tmp_path)]
    )
    bench, row = shadows.Bench(options), shadows.Row(2, 1)
    (noisy,) = bench.frames(bench.shots("test", row, 0))
    (found,) = bench.relit([noisy], row, 0)
    more = found["color"] - noisy["direct"]
    assert np.all(more >= 0.0)
    assert more.any()
    # Where the path has met a lamp at once, nothing is left of it but that.
    lamps = noisy["color"].max(axis=-1) > 5.0
    assert lamps.any()
    assert np.array_equal(found["color"][lamps], noisy["direct"][lamps])
