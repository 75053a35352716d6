"""Kernels' paths against the reference, step by step: right ones are explained, wrong ones are caught."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.kernels.judge import compare_images, compare_paths
from wamnet.kernels.judge.compare_images import ImageReport, blocks
from wamnet.kernels.judge.compare_paths import QUANTITIES, View, kernel_of_states
from wamnet.refimpl import vectors
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light import intersection, sampling, scenes, transport
from wamnet.refimpl.light.render import Job, Render
from wamnet.refimpl.light.scene import Camera, Light, Quad, Scene, Sphere
from wamnet.refimpl.light.shapes import quad
from wamnet.refimpl.light.shapes.shape import MISS
from wamnet.refimpl.light.transport import Settings

VIEW = View(32, 24, seed=5)

SMALL = View(32, 16, seed=5)

U = 2.0**-24
"""Unit roundoff of float32."""


def scene(name):
    """Return a canonical scene; the mini cubes are turned, so that no axes are parallel."""
    return scenes.canonical(name, **({"time": 1.3} if name == "minicubes" else {}))


LIGHTS = [
    Light((-1.0, 2.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 0.9, 0.8), power)
    for power in (30.0, 10.0)
]
BALLS = Scene(
    "balls",
    Camera((0.0, 0.5, 4.0), (0.0, 0.0, 0.0), vertical_fov_deg=60.0),
    None,
    spheres=(Sphere((-0.6, 0.0, 0.0), 0.7, (0.9, 0.8, 0.7)), Sphere((0.7, 0.1, 0.3), 0.5, (0.5, 0.9, 0.6))),
    quads=(Quad((-3.0, -0.7, -3.0), (0.0, 0.0, 6.0), (6.0, 0.0, 0.0), (0.7, 0.7, 0.7)),),
    lights=(
        LIGHTS[0],
        replace(LIGHTS[1], corner=(-2.5, 0.5, -1.0), edge_u=(0.0, 0.0, 1.0), edge_v=(0.3, 1.0, 0.0)),
    ),
    background=(0.1, 0.2, 0.3),
)
"""Spheres seen from outside, two lights to choose from, and a background: not in the canonical scenes."""

MANY = replace(
    BALLS,
    name="many",
    spheres=tuple(
        Sphere((0.5 * i - 1.5, 0.45 * j - 0.4, -0.5 * k), 0.1 + 0.01 * i, (0.9, 0.8, 0.7))
        for i in range(7)
        for j in range(4)
        for k in range(3)
    ),
)
"""More spheres than become statements each: a table and a loop."""

SCENES = {**{name: scene(name) for name in scenes.CANONICAL}, "balls": BALLS, "many": MANY}


# ---- right kernels -----------------------------------------------------------------------------------------


@pytest.mark.product
@pytest.mark.parametrize("name", SCENES)
def test_paths_are_those_of_the_reference(executor, name):
    """Nothing is unexplained; decisions within rounding of their threshold are rare.

    At most 1 path in 100 at a depth is undecided: 0.5 % are seen, most of them grazing a light's plane.
    """
    report = compare_paths.compare_paths(executor, SCENES[name], Settings(max_depth=2), VIEW)
    assert report.passed, [str(example) for example in report.examples]
    assert report.examples == ()
    assert [depth.depth for depth in report.depths] == [0, 1, 2]
    assert report.depths[0].paths == 32 * 24
    for depth in report.depths:
        assert depth.unexplained == 0
        assert depth.different <= depth.undecided <= 0.01 * 32 * 24
        assert set(depth.gaps) == set(QUANTITIES)
        assert all(gap.ratio <= 1 for gap in depth.gaps.values())
    assert report.depths[-1].parted <= 0.01 * 32 * 24


@pytest.mark.product
@pytest.mark.parametrize(
    "settings",
    [
        Settings(max_depth=3, roulette_depth=1),
        Settings(max_depth=2, strategy="light"),
        Settings(max_depth=2, strategy="bsdf", heuristic="balance"),
        Settings(max_depth=0),
    ],
)
def test_settings(executor, settings):
    report = compare_paths.compare_paths(executor, scene("cornell"), settings, SMALL)
    assert report.passed, [str(example) for example in report.examples]
    assert len(report.depths) == settings.max_depth + 1


def test_bounds_are_as_tight_as_rounding(executor_named):
    """Bounds that are too wide would find nothing: medians are some units of 2^-24 of the numbers' size.

    A direction carries 3 to 8 roundings of numbers up to 1 and the contract's 4 u of a sine; the cube scene's
    points are below 8, and have a distance, a product and a sum behind them.
    """
    report = compare_paths.compare_paths(
        executor_named("numpy"), scene("minicubes"), Settings(max_depth=2), VIEW
    )
    gaps = report.depths[-1].gaps
    assert 0 < gaps["direction"].bound <= 12 * U
    assert 0 < gaps["point"].bound <= 3 * 8 * U
    assert gaps["direction"].ratio >= 0.25  # and the differences that happen are of the same size


def test_random_numbers_are_the_reference_s_to_the_bit(executor):
    """All words of all blocks that a path of five bounces may use, for seeds and samples of 32 bits."""
    for view in (View(13, 7), View(5, 3, sample=2**32 - 1, seed=2**32 - 1)):
        assert compare_paths.wrong_words(executor, view, 5) == 0


# ---- wrong kernels -----------------------------------------------------------------------------------------


def wrong_report(monkeypatch, executor, world, settings, view, module, name, wrong):
    """Compare a kernel that was traced while a function or constant of the reference was another one."""
    with monkeypatch.context() as patch:
        patch.setattr(module, name, wrong)
        programs = lower_scene(world, settings)
    return compare_paths.compare_paths(
        executor,
        world,
        settings,
        view,
        build=lambda right, device: kernel_of_states(replace(programs, settings=right.settings), device),
    )


def open_quad(quad, origin, direction):
    """Return the distance of a quad without its edges: < instead of <=."""
    corner, dual_u, dual_v, _ = quad
    t = right_quad(quad, origin, direction)
    offset = origin + vectors.scale(direction, np.where(t < MISS, t, 0.0)) - corner
    a, b = vectors.dot(offset, dual_u), vectors.dot(offset, dual_v)
    return np.where((a > 0.0) & (a < 1.0) & (b > 0.0) & (b < 1.0), t, MISS)


right_quad = quad.quad_distance
right_pdf, right_weight = sampling.cosine_hemisphere_pdf, transport.mis_weight

FAULTS = {
    "lifted origin": (intersection, "SPAWN_OFFSET", 2 * intersection.SPAWN_OFFSET, "origin"),
    "no cosine in the density": (
        sampling,
        "cosine_hemisphere_pdf",
        lambda cos_theta: right_pdf(cos_theta) * 0.0 + sampling.INV_PI,
        "pdf",
    ),
    "weight off by 1e-5": (
        transport,
        "mis_weight",
        lambda *given: right_weight(*given) * 1.00001,
        "radiance",
    ),
}
"""Faults by name: what is replaced while the kernel is traced, and the quantity in which it must be seen."""


@pytest.mark.parametrize("fault", FAULTS)
def test_wrong_kernels_are_caught(executor_named, monkeypatch, fault):
    module, name, wrong, quantity = FAULTS[fault]
    settings = Settings(max_depth=2)
    report = wrong_report(
        monkeypatch, executor_named("numpy"), scene("cornell"), settings, SMALL, module, name, wrong
    )
    assert not report.passed
    assert sum(depth.unexplained for depth in report.depths) >= 100
    assert any(example.component in QUANTITIES[quantity] for example in report.examples)
    assert max(depth.gaps[quantity].ratio for depth in report.depths) > 1
    assert "bound" in str(report.examples[0])


EDGE = Scene(
    "edge",
    # 64 pixels span 2 tan(0.0005 deg) of a distance of 4.1: 7e-5 around the edge x = 1, and 1.1e-6 a pixel.
    Camera((0.3, 0.2, 4.0), (1.0, 0.0, 0.0), vertical_fov_deg=0.001),
    None,
    quads=(Quad((0.0, -0.5, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.7, 0.7, 0.7)),),
    background=(0.1, 0.2, 0.3),
)
"""An edge under the magnifying glass, seen at an angle."""

EDGE_VIEW = View(64, 64)


def edge_report(monkeypatch, executor, wrong):
    """Compare camera rays near the edge with a kernel that has another distance to a quad."""
    settings = Settings(max_depth=0)
    return wrong_report(monkeypatch, executor, EDGE, settings, EDGE_VIEW, quad, "quad_distance", wrong)


@pytest.mark.parametrize("wrong", [right_quad, open_quad])
def test_at_the_edge_itself_either_decision_is_explained(executor, monkeypatch, wrong):
    """Rounding moves a hit by some units of 2^-24 of the distance 4: undecided there, and nowhere else.

    The bound on t is 8 u of 4, of which the direction, 0.17, passes on 0.17: with the rounding of the point
    less than 1e-6, one of 64 pixels on each side. 4 columns leave room.
    """
    report = edge_report(monkeypatch, executor, wrong)
    assert report.passed, [str(example) for example in report.examples]
    assert 0 < report.depths[0].undecided <= 64 * 4


def broken(executor, plane, value):
    """Return an executor like this one that tells another value of one plane in pixel (2, 1)."""

    class Broken(type(executor)):
        def trace(self, kernel, part):
            sums = super().trace(kernel, part)
            if plane in kernel.planes:
                sums[kernel.planes.index(plane), 1, 2] = value
            return sums

    return Broken()


@pytest.mark.parametrize(
    ("plane", "value"),
    [
        ("last_point_x", np.nan),
        ("last_point_x", np.inf),
        ("last_surface", np.nan),
        ("last_surface", np.inf),
        ("last_surface", 2.5),
        ("alive", 0.0),
        ("alive", np.nan),
    ],
)
def test_a_state_that_cannot_be_is_unexplained(executor_named, plane, value):
    executor = broken(executor_named("numpy"), plane, value)
    report = compare_paths.compare_paths(executor, scene("cornell"), Settings(max_depth=0), View(5, 4))
    assert report.depths[0].unexplained == 1
    assert {(e.x, e.y, e.component) for e in report.examples} == {(2, 1, plane.removeprefix("last_"))}
    assert (report.depths[0].gaps["point"].ratio == np.inf) == (plane == "last_point_x")


def test_paths_that_end_too_early_or_too_late_are_unexplained(executor_named):
    """In the open scene half of the paths end at once."""
    for value in (0.0, 1.0):
        executor = broken(executor_named("numpy"), "alive", value)
        views = [View(5, 4, seed=seed) for seed in range(3)]
        reports = [
            compare_paths.compare_paths(executor, scene("lone_light"), Settings(max_depth=1), view)
            for view in views
        ]
        assert any(e.component == "alive" for report in reports for e in report.examples)


def test_other_random_words_are_counted(executor_named):
    executor = executor_named("numpy")

    class Broken(type(executor)):
        def trace(self, kernel, part):
            sums = super().trace(kernel, part)
            sums[0, 0, 0] += 1.0
            return sums

    assert compare_paths.wrong_words(Broken(), View(5, 4), 1) == 1


def test_views_outside_their_rules_are_refused():
    for arguments, what in (((0, 4), "width"), ((4, 2**17), "height"), ((4, 4, -1), "first_sample")):
        with pytest.raises(InputError, match=what):
            View(*arguments)


# ---- pictures ----------------------------------------------------------------------------------------------


@pytest.mark.nightly(but="lone_light-128")
@pytest.mark.parametrize(
    ("name", "spp"),
    [
        *((name, 128) for name in ("minicubes", "daylight", "cornell", "lone_light", "balls")),
        # Light that glass gathers is far from normally distributed: of 15 pairs of the kernel's own pictures
        # one was refused with 128 samples, none with 1024, whose least p-values are as expected.
        ("glossy", 1024),
    ],
)
def test_kernel_estimates_the_reference_s_image(executor_named, name, spp):
    """Other seeds, so other paths: Welch's test on blocks of pixels, at a significance of 0.01 each."""
    report = compare_images.compare_images(executor_named("opencl"), SCENES[name], Job(32, 24, spp, seed=1))
    assert report.comparisons >= 3 * 8
    assert report.passed, report


def test_a_picture_that_is_not_finite_fails(executor_named, monkeypatch):
    right = compare_images.render_on

    def broken(*arguments):
        found = right(*arguments)
        color = found.frame["color"].copy()
        color[1, 2, 0] = np.nan
        return Render(Frame({**found.frame.layers, "color": color}), found.color_variance)

    monkeypatch.setattr(compare_images, "render_on", broken)
    assert not compare_images.compare_images(executor_named("numpy"), scene("empty"), Job(9, 7, 2)).passed
    assert not ImageReport(1, np.nan, 0.01, 0.01, (2, 2)).passed


def test_one_sample_has_no_variance(executor_named):
    with pytest.raises(InputError, match=r"spp 1: Welch's test needs the variance of samples \(use 2 or"):
        compare_images.compare_images(executor_named("numpy"), scene("empty"), Job(4, 4, 1))


def test_blocks_are_means_and_variances_of_means():
    """9 x 10 pixels are blocks of 8 and of what is left; rounding of at most 90 sums."""
    random = np.random.default_rng(2)
    color, variance = random.uniform(size=(9, 10, 3)).astype(np.float32), random.uniform(size=(9, 10, 3))
    mean, of_mean = blocks(Render(Frame({"color": color}), variance))
    assert mean.shape == (2, 2, 3)
    assert np.abs(mean[1, 1] - color[8, 8:].mean(axis=0, dtype=np.float64)).max() <= 90 * 2.0**-53
    assert np.abs(of_mean[0, 0] - variance[:8, :8].mean(axis=(0, 1)) / 64).max() <= 90 * 2.0**-53
