"""Networks of integers: every executor and schedule gives the reference's bits."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import COMPILED, networks, untrained, ways

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.schedules.fft import Fourier
from wamnet.compiler.targets import language_named
from wamnet.compiler.variants import plan_model
from wamnet.kernels.devices.c_executor import COMPILER_VARIABLE, CExecutor
from wamnet.kernels.run.tune import Tuning
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.whole import SINES, forward_whole, rounded
from wamnet.refimpl.network.window import Window, all_windows, pad

SLOW = {"inlined", "group:1", "group:2", "group:4", "groupdot:4"}
"""Schedules in straight code, which compilers take long for."""


@st.composite
def cases(draw, small):
    """Draw a network and the shape of its images."""
    case = draw(networks(3, 8) if small else networks(6, 40))
    omega = draw(st.sampled_from([1.0, 9.0, 1e6]))
    drawn = siren.init(case["widths"], omega, omega, seed=case["seed"] % 2**31)
    found = rounded(drawn, case["size"], draw(st.sampled_from(sorted(SINES))))
    window = Window(case["size"], case["border"])
    return {**case, "network": found, "window": window, "level": draw(st.sampled_from([0, 1, 127]))}


def lowered(case):
    images = tuple(Image(name, n, -127.0, 127.0, whole=True) for name, n in case["channels"].items())
    gather = Gather(case["window"], images)
    types = {"window": Type(shape=(gather.n_inputs,))}
    return trace(lambda window: forward_whole(case["network"], window), types, gather)


def images_of(case):
    """Return whole images: all 0, of few levels, or of all."""
    random, level = np.random.default_rng(case["seed"]), case["level"]
    return {
        name: random.integers(-level, level + 1, (*case["shape"], n)).astype(np.float32)
        for name, n in case["channels"].items()
    }


def reference(case, images):
    """Return the picture (H, W, C) of the reference."""
    joined = np.concatenate(list(images.values()), axis=-1)
    padded = pad(joined, case["window"])
    return forward_whole(case["network"], all_windows(padded, case["window"]))


@pytest.mark.parametrize(("target", "schedule"), ways(lambda schedule: not isinstance(schedule, Fourier)))
@settings(max_examples=COMPILED)
@given(data=st.data(), profile=st.sampled_from(["ieee", "native"]))
def test_every_schedule_gives_the_bits_of_the_reference(
    executor_named, target, schedule, data, profile
) -> None:
    executor = executor_named({"opengl": "opengl-egl"}.get(target, target))
    case = data.draw(cases(schedule in SLOW))
    images = images_of(case)
    artifact = compile_program(lowered(case), language_named(target).under(profile), schedule)
    assert artifact.manifest["bound"]["output"] == [0.0] * artifact.manifest["output"]["channels"]
    found = executor.run(artifact, images)
    assert found.tobytes() == reference(case, images).astype(np.float32).tobytes()


# ---- the executors' choice --------------------------------------------------------------------------------


def chosen(executor, whole):
    """Return the schedule of a network, of integers or of floats, for a picture of 64 x 64."""
    model = untrained((32, 32), size=12, omegas=(1.0, 3.0), seed=1)
    model = replace(model, siren=rounded(model.siren, 12)) if whole else model
    plan = plan_model(model, executor.name)
    plan = plan.scheduled(Tuning(executor, plan.model, (64, 64), plan.varied).picked()[0])
    return plan.schedule.name


@pytest.mark.parametrize("name", ["opencl", "c"])
def test_bytes_are_chosen_where_they_are_multiplied(executor_named, monkeypatch, tmp_path, name) -> None:
    monkeypatch.setenv("WAMNET_CACHE", str(tmp_path))  # nothing is tuned there
    executor = executor_named(name)
    direct = {"fft:16": "tile:16", "fft:8": "tile:8", "fft:4": "tile:4"}[executor.schedule]
    assert chosen(executor, True) == (executor.byte_schedule or direct)
    assert chosen(executor, False) == executor.schedule
    monkeypatch.setattr(executor, "byte_schedule", "")
    assert chosen(executor, True) == direct


def test_a_compiler_without_the_instruction_does_not_get_bytes(monkeypatch) -> None:
    """Loops would take much longer than tiles of floats."""
    monkeypatch.setenv(COMPILER_VARIABLE, "cc -mno-avx512vnni")
    try:
        with CExecutor() as executor:
            assert not executor.byte_schedule
    except ExecutorUnavailable as error:  # a compiler for another processor
        pytest.skip(str(error))
