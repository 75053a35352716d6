"""Memory of a process stays flat over pictures of a scene that moves: what a picture takes it gives back."""

import ctypes
import gc
import itertools
import os
from pathlib import Path

import pytest

from wamnet.kernels.bench.workload import paper_model
from wamnet.kernels.run.pipeline import Pipeline
from wamnet_peers.pipelines import moments

pytestmark = pytest.mark.apart
"""What other tests have freed, and allocators still hold, would count as growth when it is used again."""

SIZE, WARM, PICTURES, STRETCHES = 64, 100, 1000, 3
"""Width of the pictures, how many come first, and all; those after the first are looked at in stretches."""

LEFT_BEHIND = 1024
"""Bytes a picture that would be seen: less than a scene of 27 boxes takes in Python, or than any image of
4 SIZE^2 bytes. Allocators still add some 0.1 MB after the first pictures, at once; what each picture leaves
behind grows in every stretch."""

STATUS = Path("/proc/self/statm")
"""Where Linux says how many pages of a process are in memory: the second number."""


def resident():
    """Return the bytes of this process that are in memory."""
    gc.collect()
    if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):  # glibc: what is free goes back to the system
        trim(0)
    return int(STATUS.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["opencl", "opengl-egl", "c"])
def test_memory_is_flat_over_a_thousand_pictures(executor_named, name) -> None:
    if not STATUS.exists():
        pytest.skip("the system does not say what is in memory as Linux does")
    executor, shots = executor_named(name), moments("minicubes")
    model = paper_model(("color", "normal"), 3, (4,))
    stretch = (PICTURES - WARM) // STRETCHES
    held = []
    with Pipeline(executor, shots[0], model, (SIZE, SIZE), moving=shots) as pipeline:
        for number in range(PICTURES):
            pipeline.set_scene(shots[number % len(shots)])
            pipeline.run(number)
            if number + 1 >= WARM and (number + 1 - WARM) % stretch == 0:
                held.append(resident())
    growths = [after - before for before, after in itertools.pairwise(held)]
    assert len(growths) == STRETCHES
    assert min(growths) <= LEFT_BEHIND * stretch, growths
