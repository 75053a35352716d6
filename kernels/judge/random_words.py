"""The random numbers' generator on an executor, compared with the reference's integers to the bit.

1. A path kernel of the empty scene whose features of the first surface are something else: the words of the
   generator, in halves of 16 bits, which floats hold exactly [`_look`].
2. The blocks that a path may use are joined by exclusive or, so that every bit of every block counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.ir import Type
from ...compiler.core.passes import pipeline
from ...compiler.core.trace import trace
from ...compiler.scenes.emit_path import planes
from ...compiler.scenes.lower_scene import PASSES, PathPrograms, lower_scene
from ...compiler.scenes.path_kernel import compile_path
from ...refimpl import rng
from ...refimpl.light.scenes import canonical
from ...refimpl.light.transport import BLOCKS_PER_BOUNCE, Settings
from ..devices.executor import Executor
from ..devices.kernel import Part

COUNTERS = ("seed", "pixel", "sample_number")
"""Inputs of the words, in the order of refimpl/rng.py: random_block."""

CARRIERS = ("albedo", "normal", "depth", "position")
"""Groups of planes that carry the halves: ten planes for eight halves."""

HALF = 16
"""Bits of half a word."""


def words(given: Mapping[str, Any], max_depth: int) -> list[Any]:
    """Return four words (...): those of all blocks that paths of this depth use, joined by exclusive or."""
    seed, pixel, sample = (given[name] for name in COUNTERS)
    blocks = [
        rng.random_block(seed, pixel, sample, np.uint32(block))
        for block in range(1 + BLOCKS_PER_BOUNCE * max_depth)
    ]
    return [reduce(lambda a, b: a ^ b, same) for same in zip(*blocks, strict=True)]


def wrong_words(
    executor: Executor, given: Mapping[str, NDArray[Any]], max_depth: int, width: int, height: int
) -> int:
    """Return for how many paths (P,) of an image the executor's generator gives other words."""
    kernel = compile_path(_programs(max_depth), executor.language, "ieee", executor.lanes, CARRIERS)
    sample, seed = (int(given[name][0]) for name in ("sample_number", "seed"))
    found = executor.trace(kernel, Part(width, height, 0, height, sample, 1, seed)).reshape(
        len(kernel.planes), -1
    )
    expected = [half.astype(np.float32) for word in words(given, max_depth) for half in _halves(word)]
    return int(np.any(found[: len(expected)] != np.stack(expected), axis=0).sum())


def _programs(max_depth: int) -> PathPrograms:
    """Return the programs of the empty scene with words instead of features."""

    def look(*values: Any) -> dict[str, Any]:
        halves = [
            half
            for word in words(dict(zip(COUNTERS, values, strict=True)), max_depth)
            for half in _halves(word)
        ]
        carriers = planes(CARRIERS)
        # The planes that are left over repeat the first halves.
        return {name: halves[i % len(halves)].astype(np.float32) for i, name in enumerate(carriers)}

    program = trace(look, dict.fromkeys(COUNTERS, Type("uint32")))
    programs = lower_scene(canonical("empty"), Settings(max_depth=0))
    return replace(programs, parts={**programs.parts, "look": pipeline.run(program, PASSES)})


def _halves(word: Any) -> tuple[Any, Any]:
    """Return the upper and the lower 16 bits (...) of words (...)."""
    upper = word >> np.uint32(HALF)
    return upper, word - upper * np.uint32(1 << HALF)
