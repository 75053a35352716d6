"""The generator at the ends of its counters, on every executor, to the bit."""

import numpy as np
import pytest

from wamnet.kernels.judge import compare_paths
from wamnet.kernels.judge.compare_paths import View
from wamnet.refimpl import rng
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.render import Job

LAST = 2**32 - 1
"""Largest counter."""


@pytest.mark.nightly(but="numpy-view0")
@pytest.mark.product
@pytest.mark.parametrize(
    "view", [View(3, 2, sample=LAST), View(3, 2, seed=LAST), View(1, 1, sample=LAST, seed=LAST)]
)
def test_last_counters(executor, view):
    """All words of 20 bounces at the last sample and seed: products wrap modulo 2^32, everywhere alike."""
    assert compare_paths.wrong_words(executor, view, 20) == 0


def test_wide_pictures(executor):
    """Pixels of a row of 5,000 and of a column of 5,000: numbers beyond 16 bits are not cut."""
    for view in (View(5_000, 1), View(1, 5_000)):
        assert compare_paths.wrong_words(executor, view, 0) == 0


def test_neighbouring_counters_at_the_wrap_are_unrelated():
    """Around 2^32 - 1 -> 0 no word repeats, along any counter: 4 x 64 blocks of 4 words, all different.

    By chance two of 1,024 words of 32 bits agree with probability 1,024^2 / 2^33 = 1.2e-4.
    """
    near = rng.counter(np.arange(-32, 32, dtype=np.int64) % 2**32)
    fixed = rng.counter(7)
    blocks = [
        rng.random_block(*(near if axis == chosen else fixed for axis in range(4))) for chosen in range(4)
    ]
    found = np.concatenate([np.broadcast_to(word, near.shape) for block in blocks for word in block])
    # The block in which all four counters are 7 is the same along each axis: once here, three times again.
    assert len(np.unique(found)) == len(found) - 3 * 4


@pytest.mark.parametrize(
    ("job", "message"),
    [
        ({"width": 2**16 + 1, "height": 2**16}, "width"),
        ({"first_sample": LAST, "spp": 2}, "sample"),
        ({"seed": LAST + 1}, "seed"),
    ],
)
def test_counters_that_overflow_are_refused(job, message):
    """A picture, a sample or a seed beyond 32 bits would repeat numbers: it is refused."""
    with pytest.raises(InputError, match=message):
        Job(**{"width": 4, "height": 4, "spp": 1, "seed": 0, **job})
