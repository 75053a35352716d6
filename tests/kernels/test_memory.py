"""Freed memory that stays with the process."""

import ctypes
import subprocess
import sys

import pytest

from wamnet.kernels import memory
from wamnet.refimpl.errors import ExecutorUnavailable


def test_glibc_takes_both_thresholds():
    if not hasattr(ctypes.CDLL(None), "gnu_get_libc_version"):
        pytest.skip("the C library is not glibc: nothing to set")
    assert memory.keep_freed_memory()


OPENED = """\
import sys, numpy as np
from wamnet import kernels
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.window import Window
from wamnet.refimpl.network.denoise import Model
network = siren.init((3, 80_000, 3), 2.0, 2.0, 5, np.float32)
model = Model(network, ("color",), Window(1, "clamp"), Normalization(), {})
with kernels.open_executor(sys.argv[1]) as executor:
    kernel = compile_program(lower(model), executor.language.under("native"))
    executor.run(kernel, {"color": np.zeros((2, 3, 3), np.float32)})
"""
"""A kernel whose arrays take 320 kB of a thread's stack."""


@pytest.mark.needs("devices")
@pytest.mark.parametrize("executor", ["c", "opencl"])
def test_threads_have_room_under_a_low_limit_of_stacks(executor):
    command = 'ulimit -s 256 && exec "$@"'
    done = subprocess.run(
        ["bash", "-c", command, "bash", sys.executable, "-c", OPENED, executor],
        capture_output=True,
        text=True,
        check=False,
    )
    if "ExecutorUnavailable" in done.stderr:
        pytest.skip(done.stderr.splitlines()[-1])
    assert done.returncode == 0, done.stderr


def test_a_limit_of_stacks_that_nobody_may_raise_is_rejected(monkeypatch):
    def denied(*_):
        raise ValueError("not allowed to raise maximum limit")

    monkeypatch.setattr(memory.resource, "getrlimit", lambda _: (160 << 10, 160 << 10))
    monkeypatch.setattr(memory.resource, "setrlimit", denied)
    with pytest.raises(ExecutorUnavailable, match=r"the stack limit is 160 KiB.* 256 KiB .*ulimit -s 8192"):
        memory.widen_stacks()


def test_other_c_libraries_are_left_alone(monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    assert not memory.keep_freed_memory()
