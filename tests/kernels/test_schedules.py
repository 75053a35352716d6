"""Every schedule against the float64 reference: shapes, sizes, borders, work groups."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import COMPILED, networks, pictures, untrained, ways

from wamnet.compiler.compile import compile_plan, compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.schedules import fft
from wamnet.compiler.targets import DENOISERS, LANGUAGES
from wamnet.compiler.variants import plan_model
from wamnet.kernels import denoise_on
from wamnet.kernels.devices import opencl_executor, opengl_executor
from wamnet.refimpl import frame
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.train import PRESETS

LADDER = ways(lambda schedule: schedule.name != "plain" and not schedule.bytewise)
"""All schedules except for the plain ones, with their targets; those of integers: test_whole.py."""

SPECTRA = ("fft:16", "fft:8", "fft:4")
"""The schedules of transforms."""

SHADERS = tuple(("opengl", f"group:{pixels}") for pixels in (1, 2, 4))
"""The schedules of compute shaders."""

LARGEST = {
    ("opengl", "inlined"): (3, 10),
    **dict.fromkeys(SHADERS, (6, 10)),
    ("opengl", "fftpasses:32"): (20, 20),
    **{(target, schedule): (20, 32) for target in ("opencl", "c") for schedule in SPECTRA},
}
"""Largest window and layer by target and schedule: Mesa compiles two thousand weights a second, and layers in
straight code in a time that grows with the square; a tile's sums must fit the stack. The other schedules'
layers may have more neurons than a block."""

LARGEST_LAYERS = {("opencl", f"group:{pixels}"): (12, 30) for pixels in (1, 2, 4)}
"""The same of schedules that unroll layers on PoCL."""

UNLIMITED = (12, 70)
"""The same of those that have loops: in long runs half of their networks are as wide as trained ones."""

GROUPED = {(t, s.name): s for t in DENOISERS for s in LANGUAGES[t].schedules.values() if hasattr(s, "group")}
"""The schedules whose groups share a tile."""


@pytest.fixture(autouse=True)
def _spectra_of_small_windows(monkeypatch):
    """Let the Fourier schedule hold what is faster without it."""
    monkeypatch.setattr(fft, "COST", 0.0)


def executor_of(executor_named, target):
    return executor_named({"opengl": "opengl-egl"}.get(target, target))


@pytest.mark.parametrize(("target", "schedule"), LADDER)
@settings(max_examples=COMPILED)
@given(data=st.data(), group=st.tuples(st.integers(1, 5), st.integers(1, 4)))
def test_error_is_within_the_bound(executor_named, kit, target, schedule, data, group):
    largest = {**LARGEST, **LARGEST_LAYERS}.get((target, schedule), UNLIMITED)
    case = data.draw(networks(*largest, wide=largest == UNLIMITED))
    executor = executor_of(executor_named, target)
    network = kit.network(case["widths"], (9.0, 3.0), case["seed"])
    program = kit.denoiser(network, case["channels"], case["size"], case["border"])
    with pytest.MonkeyPatch.context() as patch:
        for name in ("LOCAL_SIZE", "TILE_LOCAL_SIZE"):
            patch.setattr(opencl_executor, name, group)
        if (target, schedule) in GROUPED:
            patch.setattr(GROUPED[target, schedule], "group", group)
        artifact = compile_program(program, target, schedule)
        assert artifact.manifest["schedule"]["name"] == schedule
        executor._built.clear()
        images = pictures(case["channels"], case["shape"], case["seed"])
        assert kit.excess(executor, program, images, artifact) <= 1
    executor._built.clear()


@pytest.mark.parametrize(("target", "schedule"), [("opencl", "fft:16"), ("c", "fft:8")])
def test_pictures_of_more_tiles_than_one(executor_named, kit, target, schedule):
    """Tiles of 21 x 21 pixels, three below one another and two side by side; images of odd channels."""
    program = kit.denoiser(kit.network([1728, 32, 3], (3.0, 3.0)), {"a": 5, "b": 7}, 12, "zero")
    artifact = compile_program(program, target, schedule)
    assert artifact.manifest["schedule"]["name"] == schedule
    assert kit.excess(executor_named(target), program, pictures({"a": 5, "b": 7}, (43, 22), 2), artifact) <= 1


def elementwise(x):
    """Return operations on vectors that a network does not have: each has words of its own."""
    first, second = (np.linspace(-0.5, 0.5, 20 * n, dtype=np.float32).reshape(n, 20) for n in (17, 2))
    h = x @ first[:, :12].T
    h = (
        np.absolute(h)
        + np.sqrt(np.absolute(h) + 1.0) / (np.maximum(h, -h) + 2.0)
        - np.reciprocal(h * h + 1.0)
    )
    h = -np.floor(h) * np.linspace(0.5, 1.0, 17, dtype=np.float32) + np.minimum(h, 0.25)
    return h @ second[:, :17].T


@pytest.mark.parametrize(("target", "schedule"), LADDER)
def test_every_operation_on_vectors(executor_named, kit, target, schedule):
    """Away from integers, where floor may fall to either side, the bound is finite."""
    program = kit.program(elementwise, {"a": 3}, 2)
    artifact = compile_program(program, target, schedule)
    assert artifact.manifest["schedule"]["name"] == schedule
    images = {"a": np.random.default_rng(3).uniform(-2, 2, (5, 19, 3)).astype(np.float32)}
    assert kit.excess(executor_of(executor_named, target), program, images, artifact) <= 1


def test_a_group_that_a_device_does_not_hold(executor_named, kit, monkeypatch):
    executor = executor_named("opencl")
    artifact = compile_program(
        kit.denoiser(kit.network([3, 2], (3.0, 3.0)), {"a": 3}, 1, "clamp"), "opencl", "group:4"
    )
    monkeypatch.setattr(opencl_executor, "STACK_BYTES", 1000)
    executor._built.clear()
    with pytest.raises(
        CompileError,
        match=r"schedule group:4 needs groups of \d+ bytes of variables, on a proc.* at most 1000",
    ):
        executor.build(artifact)
    large = replace(
        artifact,
        manifest={**artifact.manifest, "schedule": {**artifact.manifest["schedule"], "group": [2**20, 1]}},
    )
    with pytest.raises(
        CompileError,
        match=r"needs groups of 1048576 items, and at most \d+ are available; use schedule plain",
    ):
        executor.build(large)


def test_no_compute_shader_before_opengl_4_3(executor_named, kit, monkeypatch):
    executor = executor_named("opengl-egl")
    artifact = compile_program(
        kit.denoiser(kit.network([3, 2], (3.0, 3.0)), {"a": 3}, 1, "clamp"), "opengl", "group:1"
    )
    monkeypatch.setattr(opengl_executor, "SHADER_VERSION", 460)
    executor._built.clear()
    with pytest.raises(
        CompileError,
        match=r"has OpenGL 4\.5: schedule group:1 is a compute shader, which needs OpenGL 4\.6; use",
    ):
        executor.build(artifact)


@pytest.mark.nightly
@pytest.mark.parametrize(("target", "schedule"), [("opencl", "fft:16"), ("c", "fft:8")])
def test_layers_of_64_neurons_have_spectra(executor_named, target, schedule):
    """Arrays of 800 kB fit a thread's stack; both kernels are within their bounds of the exact picture."""
    recipe = PRESETS["sky"]
    omegas = recipe.omega_0_first, recipe.omega_0_hidden
    model = untrained(recipe.widths, recipe.features, recipe.window.size, omegas=omegas, seed=3)
    rng = np.random.default_rng(4)
    images = {
        name: rng.uniform(
            dataset.FEATURES[name].low, dataset.FEATURES[name].high, (33, 57, dataset.FEATURES[name].channels)
        ).astype(np.float32)
        for name in recipe.features
    }
    device, made = executor_named(target), {}
    plans = {name: plan_model(model, target, schedule=name) for name in ("plain", schedule)}
    for name, plan in plans.items():
        kernel = compile_plan(plan)
        assert kernel.manifest["schedule"]["name"] == name
        made[name] = device.run(kernel, images)
    bound = sum(max(plan.bound.output) for plan in plans.values())
    assert np.abs(made["plain"] - made[schedule]).max() <= bound


def test_the_time_of_a_kernel_alone(executor_named, kit):
    executor = executor_named("opencl")
    artifact = compile_program(kit.program(lambda x: x * 1.625, {"a": 1}), "opencl")
    executor.build(artifact)
    assert executor.kernel_seconds(artifact, {"a": np.ones((2, 3, 1), np.float32)}) > 0


def test_the_device_s_schedule_is_taken_and_told(executor, kit):
    model = kit.model(border="zero")
    noisy = frame.Frame({name: np.zeros((3, 4, 3), np.float32) for name in ("color", "normal")})
    assert denoise_on(executor, model, noisy).schedule.startswith(f"{executor.schedule_for((3, 4))}: ")
    asked = denoise_on(executor, model, noisy, schedule="plain")
    assert asked.schedule.startswith("plain: one ")
    artifact = compile_program(lower(model), executor.name, executor.schedule)
    assert artifact.manifest["schedule"]["name"] == executor.schedule == executor.schedule_for((2000, 2000))
    if executor.schedule_pixels:
        assert executor.schedule_for((1, executor.schedule_pixels - 1)) == "plain"


def test_pictures_of_a_size_share_what_launches_hand_on(executor_named, kit):
    program = kit.denoiser(kit.network([192, 8, 3], (3.0, 3.0)), {"a": 3}, 8, "clamp")
    artifact = compile_program(program, "opengl", "fftpasses:32")
    executor, held = executor_named("opengl-egl"), []
    for width in (40, 40, 900):
        images = {"a": np.random.default_rng(width).uniform(-2, 2, (9, width, 3)).astype(np.float32)}
        assert kit.excess(executor, program, images, artifact) <= 1
        held.append(list(executor._between_passes))
    assert held[0] == held[1]
    assert not set(held[1]) & set(held[2])
