"""Three ways to save work that no kernel has: what they would cost on unseen frames, in the reference.

    wamnet demo -o out/demo
    python experiments/savings.py --model out/demo/model.safetensors --dataset out/demo/frames

1. Taps left out [`without_taps`]: the smallest weights of the first layer are 0, and the means of what they
   would have added are in the biases.
2. Storage in half precision [`halved`]: weights, or encoded images, are rounded to it.
3. A stride [`strided`]: every second pixel of every second row is computed; the others are means of their
   neighbours among these, weighted by how alike their albedo, normal and position are (a joint bilateral
   filter: Kopf, Cohen, Lischinski, Uyttendaele, "Joint Bilateral Upsampling", ACM Transactions on Graphics
   26(3), 2007).

Print a Markdown table: PSNR of display-encoded colour on the test frames of a data set, and its loss.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.cli.files import dataset_files
from wamnet.models.model_file import load_model
from wamnet.refimpl import metrics
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model, denoise

Array = NDArray[Any]

GUIDES: Mapping[str, float] = {"albedo": 0.05, "normal": 0.1, "position": 0.02}
"""Standard deviations of the filter by encoded feature: noise differs by less, edges by more."""


def without_taps(model: Model, share: float, frames: list[Frame]) -> Model:
    """Return the model without this share of its first layer's weights, the smallest ones."""
    weight, bias = model.siren.weights[0], model.siren.biases[0]
    images = [dataset.feature_image(frame, model.features, model.normalization) for frame in frames]
    channels = np.mean([image.mean(axis=(0, 1)) for image in images], axis=0)
    mean = np.tile(channels, model.window.size**2)
    dropped = np.abs(weight) < np.quantile(np.abs(weight), share)
    kept = np.where(dropped, 0.0, weight).astype(weight.dtype)
    moved = (bias + np.where(dropped, weight, 0.0) @ mean).astype(bias.dtype)
    weights, biases = (kept, *model.siren.weights[1:]), (moved, *model.siren.biases[1:])
    return replace(model, siren=replace(model.siren, weights=weights, biases=biases))


def halved(model: Model) -> Model:
    """Return the model with all weights and biases rounded to half precision."""
    rounded = [
        tuple(a.astype(np.float16).astype(np.float32) for a in arrays)
        for arrays in (model.siren.weights, model.siren.biases)
    ]
    return replace(model, siren=replace(model.siren, weights=rounded[0], biases=rounded[1]))


def halved_frame(frame: Frame) -> Frame:
    """Return the frame with its layers rounded to half precision, as images of it would be stored."""
    largest = float(np.finfo(np.float16).max)
    layers = {
        name: np.clip(values, -largest, largest).astype(np.float16).astype(np.float32)
        for name, values in frame.layers.items()
    }
    return replace(frame, layers=layers)


def strided(model: Model, frame: Frame) -> Array:
    """Return the picture (H, W, 3) of which a quarter is computed."""
    full = denoise(model, frame)
    guides = [
        dataset.feature_image(frame, (name,), model.normalization) / sigma for name, sigma in GUIDES.items()
    ]
    guide = np.concatenate(guides, axis=-1)
    rows, columns = (np.arange(n) for n in full.shape[:2])
    total, weights = np.zeros_like(full), np.zeros((*full.shape[:2], 1))
    for dy in (0, 1):
        for dx in (0, 1):
            # The computed pixels around a pixel: one, two or four of them, once each.
            y = np.clip((rows // 2 + dy * (rows % 2)) * 2, 0, (len(rows) - 1) // 2 * 2)
            x = np.clip((columns // 2 + dx * (columns % 2)) * 2, 0, (len(columns) - 1) // 2 * 2)
            near = guide[np.ix_(y, x)] - guide
            alike = np.exp(-0.5 * (near * near).sum(axis=-1, keepdims=True)) + 1e-6
            total, weights = total + alike * full[np.ix_(y, x)], weights + alike
    found: Array = total / weights
    return found


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--model", type=Path, default=Path("out/demo/model.safetensors"))
    parser.add_argument("--dataset", type=Path, default=Path("out/demo/frames"), help="folder of a data set")
    options = parser.parse_args()
    model = load_model(options.model)
    seen = [noisy for noisy, _ in dataset_files.read_pairs(options.dataset, "train")]
    tests = dataset_files.read_pairs(options.dataset, "test")
    targets = [dataset.target_image(clean, model.normalization) for _, clean in tests]

    def score(picture: Callable[[Frame], Array]) -> float:
        found = [
            metrics.psnr(picture(noisy), target) for (noisy, _), target in zip(tests, targets, strict=True)
        ]
        return float(np.mean(found))

    full = score(lambda noisy: denoise(model, noisy))
    rows: dict[str, Callable[[Frame], Array]] = {
        f"{share:.0%} of the first layer's weights left out": lambda noisy, share=share: denoise(  # type: ignore[misc]
            without_taps(model, share, seen), noisy
        )
        for share in (0.25, 0.5, 0.75)
    }
    rows["weights in half precision"] = lambda noisy: denoise(halved(model), noisy)
    rows["images in half precision"] = lambda noisy: denoise(model, halved_frame(noisy))
    rows["every second pixel and row, guided upsampling"] = lambda noisy: strided(model, noisy)
    print(f"| saved | PSNR, dB | lost, dB |\n|---|---|---|\n| nothing | {full:.2f} | |")
    for name, picture in rows.items():
        found = score(picture)
        print(f"| {name} | {found:.2f} | {full - found:.2f} |", flush=True)


if __name__ == "__main__":
    main()
