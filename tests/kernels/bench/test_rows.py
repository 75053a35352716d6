"""The Pareto front on its hard cases, and data that JSON can hold."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.kernels.bench.contest import front
from wamnet.kernels.cache import clean

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
