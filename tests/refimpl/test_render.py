"""The driver: the image does not depend on how the work is cut, and the layers are what they say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wamnet.kernels.run.render_pool import bands, render_parallel
from wamnet.refimpl import frame
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import render as R
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Camera, Scene, Sphere
from wamnet.refimpl.light.transport import Settings

CORNELL = scenes.canonical("cornell")


def equal(a: R.Render, b: R.Render) -> bool:
    same_layers = all(np.array_equal(a.frame[name], b.frame[name]) for name in a.frame.layers)
    return same_layers and np.array_equal(a.color_variance, b.color_variance)


@settings(max_examples=20)
@given(
    st.integers(1, 11), st.integers(1, 11), st.integers(1, 3), st.integers(1, 130), st.integers(0, 2**32 - 1)
)
def test_image_does_not_depend_on_tile_size(width, height, spp, tile_pixels, seed):
    job = R.Job(width, height, spp, seed)
    assert equal(R.render(CORNELL, job), R.render(CORNELL, job, tile_pixels=tile_pixels))


@settings(max_examples=10)
@given(st.integers(2, 9), st.data())
def test_row_ranges_join_to_the_whole(height, data):
    cut = data.draw(st.integers(1, height - 1))
    job = R.Job(7, height, 2)
    parts = [R.render(CORNELL, job, rows=rows) for rows in ((0, cut), (cut, height))]
    assert equal(R.join_rows(parts), R.render(CORNELL, job))


def test_workers_change_nothing_and_all_samples_are_counted():
    job = R.Job(96, 97, 16)  # enough samples for processes to be worth while
    counted: list[int] = []
    scene = scenes.canonical("lone_light")
    assert equal(render_parallel(scene, job, workers=2, on_progress=counted.append), R.render(scene, job))
    assert sum(counted) == 96 * 97 * 16


@given(st.integers(1, 3000), st.integers(1, 3000), st.integers(1, 64))
def test_bands_cover_every_row_once(width, height, workers):
    ranges = bands(R.Job(width, height), workers)
    assert [first for first, _ in ranges] == [0, *(last for _, last in ranges[:-1])]
    assert ranges[-1][1] == height
    assert all(first < last for first, last in ranges)


def test_workers_must_be_one_or_more():
    with pytest.raises(InputError, match=r"workers 0: at least one process must work"):
        render_parallel(CORNELL, R.Job(4, 4), workers=0)


def test_samples_are_numbered_so_that_a_render_can_be_split():
    """Samples 0-3 and 4-7 rendered apart have the mean of samples 0-7: sums in float64, one rounding to the
    layer."""
    job = R.Job(8, 8, 8, dtype="float64")
    halves = [R.render(CORNELL, replace(job, spp=4, first_sample=k)).frame["color"] for k in (0, 4)]
    whole = R.render(CORNELL, job).frame["color"]
    # 8 sums of positives.
    assert np.max(np.abs((halves[0] + halves[1]) / 2 - whole)) <= 16 * 2.0**-52 * whole.max()
    assert not np.array_equal(*halves)


def test_seeds_and_pixels_differ():
    a, b = (R.render(CORNELL, R.Job(16, 16, seed=seed)).frame["color"] for seed in (0, 1))
    assert np.mean(a != b) > 0.5


def test_a_pixel_is_the_same_in_an_image_of_another_size():
    """The random numbers of a pixel depend on x and y, not on the width: neighbours of other jobs line up."""
    assert R.pixel_counter(np.array([5]), np.array([9]))[0] == 5 + 65536 * 9


def test_variance_equals_that_of_the_samples():
    """Welford's running variance equals the textbook formula over single samples, to rounding."""
    job = R.Job(6, 5, 5, dtype="float64")
    singles = [R.render(CORNELL, replace(job, spp=1, first_sample=k)).frame["color"] for k in range(5)]
    expected = np.var(np.stack(singles), axis=0, ddof=1)
    got = R.render(CORNELL, job).color_variance
    # 30 roundings of 2**-53, with margin.
    assert np.max(np.abs(got - expected)) <= 1e-13 * max(expected.max(), 1.0)


def test_layers_of_a_known_scene():
    """A sphere in front of the camera: the centre pixel's layers in closed form."""
    sphere = Sphere((0.0, 0.0, -1.0), 1.0, (0.2, 0.4, 0.6))
    scene = Scene("ball", Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), vertical_fov_deg=20.0), spheres=(sphere,))
    result = R.render(scene, R.Job(33, 33, dtype="float64")).frame
    frame.validate(result)
    y, x = 16, 16
    # The jitter moves the ray by at most a pixel: tan(10 deg) * 2 / 33 * 4 = 0.043 scene units at the sphere.
    reach = 0.043
    assert np.array_equal(result["albedo"][y, x], [0.2, 0.4, 0.6])
    assert np.max(np.abs(result["normal"][y, x] - [0.0, 0.0, 1.0])) <= reach
    assert abs(result["depth"][y, x, 0] - 4.0) <= reach
    assert np.max(np.abs(result["position"][y, x])) <= reach
    assert np.max(np.abs(result["direction"][y, x] - [0.0, 0.0, -1.0])) <= reach / 4
    ray_end = np.array([0.0, 0.0, 4.0]) + result["direction"] * result["depth"]
    hit = result["depth"][..., 0] > 0
    # A product and a sum of numbers < 8.
    assert np.max(np.abs(ray_end - result["position"])[hit]) <= 16 * 2.0**-52 * 8


def test_features_of_more_rays_are_their_means():
    """RND-2b: the colour stays to the bit; features are means over single rays, the colour's among them."""
    job = R.Job(9, 7, 2, seed=5, dtype="float64", feature_sampler="pcg4d")
    counted: list[int] = []
    found = R.render(CORNELL, replace(job, feature_spp=5), on_progress=counted.append)
    plain = R.render(CORNELL, job)
    assert np.array_equal(found.frame["color"], plain.frame["color"])
    assert np.array_equal(found.color_variance, plain.color_variance)
    assert sum(counted) == replace(job, feature_spp=5).samples == 9 * 7 * (2 + 5)
    rays = [R.render(CORNELL, replace(job, spp=1, first_sample=n)).frame for n in range(5)]
    for name in ("albedo", "normal", "depth", "position", "direction"):
        mean = np.mean([ray[name] for ray in rays], axis=0)
        # Five sums and a quotient of float64 in another order: 6 roundings of numbers below 8.
        assert np.max(np.abs(found.frame[name] - mean)) <= 6 * 8 * 2.0**-53
    assert found.frame.info == {**plain.frame.info, "feature_spp": "5"}


@pytest.mark.parametrize("sampler", ["pcg4d", "sobol"])
def test_features_of_their_own_rays_begin_with_the_colour_s_ray(sampler):
    """RND-2c: by default they are spread evenly; the first one is that of the colour's sample 0."""
    job = R.Job(8, 6, seed=5, settings=Settings(max_depth=1, sampler=sampler), feature_spp=4)
    of_features = R.feature_job(job)
    assert of_features.settings.sampler == {"pcg4d": "net", "sobol": "sobol"}[sampler]
    found, shared = R.render(CORNELL, job), R.render(CORNELL, replace(of_features, spp=1))
    assert all(
        np.array_equal(shared.frame[name], R.render(CORNELL, replace(job, feature_spp=0)).frame[name])
        for name in frame.USUAL
        if name != "color"
    )
    facts = {"feature_spp": "4", **({"feature_sampler": "net"} if sampler == "pcg4d" else {})}
    assert found.frame.info == {**R.render(CORNELL, replace(job, feature_spp=0)).frame.info, **facts}


@pytest.mark.parametrize("feature_spp", [0, 1, 2])
def test_features_of_no_more_rays_are_the_colour_s(feature_spp):
    job = R.Job(5, 4, 2, seed=5)
    found = R.render(CORNELL, replace(job, feature_spp=feature_spp))
    assert equal(found, R.render(CORNELL, job))
    assert "feature_spp" not in found.frame.info
    assert replace(job, feature_spp=feature_spp).samples == 5 * 4 * 2


def test_row_zero_is_the_top_and_column_zero_the_left():
    up_right = Sphere((0.5, 0.5, 0.0), 0.3, (1.0, 1.0, 1.0))
    scene = Scene(
        "corner", Camera((0.0, 0.0, 4.0), (0.0, 0.0, 0.0), vertical_fov_deg=30.0), spheres=(up_right,)
    )
    albedo = R.render(scene, R.Job(32, 32)).frame["albedo"][..., 0]
    assert albedo[:16, 16:].sum() > 0
    assert albedo[16:].sum() == albedo[:, :16].sum() == 0


def test_info_names_what_made_the_frame():
    info = R.render(CORNELL, R.Job(2, 2, 3, seed=9)).frame.info
    assert {
        "scene": "cornell",
        "spp": "3",
        "seed": "9",
        "time": "0.0",
        "max_depth": "5",
    }.items() <= info.items()
    assert len(info["scene_digest"]) == 64


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"width": 0}, "width 0: must be an integer from 1 to 65536"),
        ({"width": 1.5}, "width 1.5: must be an integer"),
        ({"height": 65537}, "height 65537"),
        ({"spp": 0}, "spp 0"),
        ({"seed": -1}, "seed -1: must be an integer from 0 to 4294967295"),
        ({"seed": True}, "seed True"),
        ({"first_sample": 2**32}, "first_sample 4294967296"),
        ({"dtype": "float16"}, "dtype 'float16': must be float32 or float64"),
        ({"feature_spp": -1}, "feature_spp -1: must be an integer from 0 to 4294967296"),
        (
            {"feature_spp": 4, "feature_sampler": "halton"},
            r"feature_sampler 'halton': unknown \(choose one of pcg4d, sobol",
        ),
    ],
)
def test_refuses_jobs(arguments, message):
    with pytest.raises(InputError, match=message):
        R.Job(**{"width": 4, "height": 4, **arguments})


@pytest.mark.parametrize("rows", [(0, 5), (2, 2), (-1, 3)])
def test_refuses_row_ranges(rows):
    with pytest.raises(InputError, match=r"rows .*: must be a range within 0 to 4"):
        R.render(CORNELL, R.Job(4, 4), rows=rows)
    with pytest.raises(InputError, match="tile_pixels 0"):
        R.render(CORNELL, R.Job(4, 4), tile_pixels=0)
