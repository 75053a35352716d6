"""Pictures of two renderers, compared by Welch's test: means of blocks of pixels, and of the whole.

1. Each renderer makes BATCHES independent pictures of a scene: the spread of a number over them is the error
   of its mean [`numbers`], [`ours`], [`theirs`].
2. Welch's test compares the means, number by number [`p_values`]; whoever asserts corrects their number, and
   that of the scenes (statistical.py).
"""

from typing import Any

import numpy as np
from statistical import welch_p

from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels.devices.kernel import Part
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.transport import Settings
from wamnet_peers import peer_mitsuba

WIDTH, HEIGHT, BLOCK = 16, 12, 4
BATCHES = 32
"""Independent renders of each scene by each renderer: their spread is the error of their mean."""

SPP = 256
"""Samples per pixel of a batch."""

EVEN = 1e-5
"""Numbers that spread less, relative to their size, show the background, where there is nothing to test but
the rounding of 256 sums (15 u = 9e-7 for random ones)."""


def numbers(images: np.ndarray) -> np.ndarray:
    """Return, for images (B, H, W, 3), the numbers (B, N) to compare: blocks' colours and the whole mean."""
    b = images.reshape(BATCHES, HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK, 3).mean(axis=(2, 4))
    return np.concatenate([b.reshape(BATCHES, -1), images.mean(axis=(1, 2, 3))[:, np.newaxis]], axis=1)


def ours(executor: Any, scene: Scene, settings: Settings) -> np.ndarray:
    """Return the numbers (B, N) of our kernel."""
    programs = lower_scene(scene, settings)
    kernel = compile_path(programs, executor.name, lanes=executor.lanes, groups=("color",))
    parts = [Part(WIDTH, HEIGHT, 0, HEIGHT, SPP * k, SPP, 7) for k in range(BATCHES)]
    images = np.stack([executor.trace(kernel, part) for part in parts]).astype(np.float64) / SPP
    return numbers(np.moveaxis(images, 1, -1))


def theirs(mitsuba: Any, scene: Scene, settings: Settings, spp: int = SPP) -> np.ndarray:
    """Return the numbers (B, N) of Mitsuba, in the variant that is set."""
    return of_dictionary(mitsuba, peer_mitsuba.export(mitsuba, scene, WIDTH, HEIGHT, settings), spp)


def of_dictionary(mitsuba: Any, made: dict[str, Any], spp: int = SPP) -> np.ndarray:
    """Return the numbers (B, N) of a scene in Mitsuba's own form."""
    loaded = mitsuba.load_dict(made)
    images = [peer_mitsuba.render(mitsuba, loaded, spp, seed) for seed in range(BATCHES)]
    return numbers(np.stack(images).astype(np.float64))


def p_values(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return Welch's p-values for equal means of those numbers of a, b (B, N) that spread."""
    noisy = np.minimum(a.std(axis=0), b.std(axis=0)) > EVEN * a.mean(axis=0)
    assert noisy.sum() >= 0.8 * a.shape[1]
    a, b = a[:, noisy], b[:, noisy]
    (mean_a, var_a), (mean_b, var_b) = ((x.mean(axis=0), x.var(axis=0, ddof=1)) for x in (a, b))
    return welch_p(mean_a, var_a, BATCHES, mean_b, var_b, BATCHES)
