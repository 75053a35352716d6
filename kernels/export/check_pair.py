"""A small picture to check an integration with: inputs, the reference's output, how far off it may be.

1. Its sides are the window's and a few pixels more: most pixels see a border [`SIDES`].
2. With a scene its images are those of one sample a pixel, rounded to float32; else every number of an image
   lies in its range, spread by multiples of the golden ratio [`_spread`].
   Of several contrasts the one is taken whose output is clipped least [`_livelier`].
3. The output is the reference's in float64, rounded to float32; the bound is computed for this picture, of
   this kernel, and holds the rounding; it is 0 where nothing rounds. A kernel without a bound states what
   the emitted sine's would have.

Files are raw little-endian float32, rows from the top, channels interleaved; check.json names their shapes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.core.interpret import interpret
from ...compiler.core.ir import Gather, Program
from ...compiler.core.lower import lower
from ...compiler.kernel.interface import SCENE_NUMBERS
from ...compiler.plan import Plan, plan_program
from ...compiler.scenes import emit_path
from ...compiler.scenes.encode_kernel import layers_of
from ...compiler.scenes.lower_scene import PathPrograms
from ...compiler.scenes.path_kernel import compile_path
from ...compiler.schedules.common import kernel_gather
from ...compiler.schedules.schedules import windows
from ...compiler.targets import language_named
from ...refimpl.network.dataset import FEATURES, encode_sums
from ...refimpl.network.denoise import Model
from ..devices.kernel import Part
from ..devices.registry import open_executor

SIDES = (1, 3)
"""Rows and columns beyond the window's."""

SEED = 7
"""Seed of the sample that a scene's picture has."""

PATHS_WITHIN = 10_000 * 2.0**-24
"""Largest difference of a sum that only rounding has moved: a path of six surfaces has fewer than 10,000
operations, on values near 1."""

PATHS_ALIKE = 0.98
"""Share of a picture's sums that must lie within; the others are of paths that passed an edge that near."""

CONTRASTS = (1.0, 0.5, 0.25, 0.1)
"""Shares of an image's range that are tried: a trained network clips most of what is pure noise."""

GOLDEN = (5.0**0.5 - 1) / 2
"""Multiples of this, modulo 1, are spread evenly and repeat nothing."""


@dataclass(frozen=True)
class Moment:
    """Numbers (n,) of a scene that moves, and the sums (planes, H, W) of the picture that they give."""

    numbers: NDArray[np.float32]
    sums: NDArray[np.float32]


@dataclass(frozen=True)
class Pair:
    """Images (H, W, C) by name, the output and its bound (H, W, 3); sums (planes, H, W) of a scene.

    `promised`: whether the kernel promises the bound. `moments`: other sums, of a scene that moves.
    """

    images: Mapping[str, NDArray[np.float32]]
    output: NDArray[np.float32]
    bound: NDArray[np.float32]
    promised: bool
    sums: NDArray[np.float32] | None = None
    planes: tuple[str, ...] = ()
    moments: tuple[Moment, ...] = ()

    def facts(self) -> dict[str, Any]:
        """Return what check.json says."""
        height, width, channels = self.output.shape
        found: dict[str, Any] = {
            "width": width,
            "height": height,
            "images": {n: {"file": f"image.{n}.f32", "channels": i.shape[2]} for n, i in self.images.items()},
            "output": {"file": "output.f32", "channels": channels},
            "bound": {"file": "bound.f32", "channels": channels, "promised": self.promised},
            "format": "little-endian float32, rows from the top, channels interleaved",
            "rule": "|yours - output| <= bound, number by number; NaN fails",
            "sums": None,
        }
        if self.sums is not None:
            found["sums"] = {
                "file": "sums.f32",
                "planes": list(self.planes),
                "samples": 1,
                "seed": SEED,
                "format": "one plane of height * width numbers after another",
            }
            if self.moments:
                found["sums"]["moments"] = [
                    {"file": f"sums.{index}.f32", SCENE_NUMBERS: [float(x) for x in moment.numbers]}
                    for index, moment in enumerate(self.moments)
                ]
        return found

    def files(self) -> dict[str, bytes]:
        """Return the files by name."""
        arrays = {f"image.{name}.f32": image for name, image in self.images.items()}
        arrays |= {"output.f32": self.output, "bound.f32": self.bound}
        if self.sums is not None:
            arrays["sums.f32"] = self.sums
        arrays |= {f"sums.{index}.f32": moment.sums for index, moment in enumerate(self.moments)}
        text = json.dumps(self.facts(), indent=2, sort_keys=True) + "\n"
        return {
            **{name: np.ascontiguousarray(array).astype("<f4").tobytes() for name, array in arrays.items()},
            "check.json": text.encode(),
        }


def pair(
    plan: Plan,
    model: Model,
    promised: bool,
    programs: PathPrograms | None = None,
    rows: Sequence[NDArray[np.float32]] = (),
) -> Pair:
    """Return the pair of a plan's kernel, or of both of its passes; with a scene's programs, of its picture.

    `model` is what the plan compiles; `promised`: whether the kernel keeps the plan's bound. Otherwise the
    bound is what the emitted sine would have. `rows` (n,): numbers of the scene for other sums.
    """
    gather = kernel_gather(plan.analysed)
    size = (gather.rows + SIDES[0], gather.columns + SIDES[1])
    sums: NDArray[np.float32] | None = None
    planes: tuple[str, ...] = ()
    moments: tuple[Moment, ...] = ()
    if programs is None:
        images = _livelier(plan.analysed, size)
    else:
        groups = tuple(dict.fromkeys(layers_of(model.features)))
        kernel = compile_path(programs, replace(language_named("numpy"), profile=plan.profile), groups=groups)
        with open_executor("numpy") as executor:
            part = Part(size[1], size[0], 0, size[0], 0, 1, SEED)
            sums, *others = (executor.trace(kernel, part, row) for row in (None, *rows))
        planes = kernel.planes
        rays = programs.rays.count if programs.rays else 0
        images = _encoded(model, dict(zip(planes, sums, strict=True)), rays)
        moments = tuple(map(Moment, rows, others))
    held = (plan if promised else plan_program(lower(model), "numpy")).expected(images)
    output = held.value.astype(np.float32)
    return Pair(images, output, held.most_from(output), promised, sums, planes, moments)


def _livelier(program: Program, size: tuple[int, int]) -> dict[str, NDArray[np.float32]]:
    """Return the images of the contrast whose output has most numbers that are not clipped."""
    gather = kernel_gather(program)
    best, most = {}, -1
    for contrast in CONTRASTS:
        images = _spread(gather, size, contrast)
        (value,) = interpret(program, {"window": windows(gather, images)}, np.float64).values()
        lively = int(((value > 0) & (value < 1)).sum())
        if lively > most:
            best, most = images, lively
    return best


def _spread(gather: Gather, size: tuple[int, int], contrast: float) -> dict[str, NDArray[np.float32]]:
    """Return images (H, W, C) whose numbers lie in that share of their ranges, around the middle."""
    found = {}
    for number, image in enumerate(gather.images):
        count = size[0] * size[1] * image.channels
        shares = 0.5 + contrast * (((np.arange(count) + 1) * GOLDEN + number / 7) % 1.0 - 0.5)
        values = (image.low + (image.high - image.low) * shares).reshape(*size, image.channels)
        values = np.rint(values) if image.whole else values
        found[image.name] = np.clip(values.astype(np.float32), np.float32(image.low), np.float32(image.high))
    return found


def _encoded(
    model: Model, sums: Mapping[str, NDArray[np.float32]], rays: int
) -> dict[str, NDArray[np.float32]]:
    """Return the encoded images (H, W, C) of a model's features, from sums over one sample.

    `rays`: the number of the features' own, or 0.
    """
    found = {}
    for name in model.features:
        planes = [sums[plane].astype(np.float64) for plane in emit_path.GROUPS[FEATURES[name].layer]]
        layer = planes[0] if len(planes) == 1 else np.stack(planes, axis=-1)
        given = ({FEATURES[name].layer: layer}, 1.0, (name,), model.normalization, model.is_whole, rays)
        encoded = encode_sums(*given)[name]
        image = encoded[..., None] if encoded.ndim == 2 else encoded
        found[name] = image.astype(np.float32)
    return found
