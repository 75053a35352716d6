"""Variants of a trained network: what each costs on unseen frames, untouched and trained further; its time.

    wamnet demo -o out/demo
    python experiments/variants.py --model out/demo/model.safetensors --dataset out/demo/frames --tune 2000

Print a Markdown table: multiplications a pixel, milliseconds of the network at --size on an executor (the
fastest schedule), the mean PSNR that is lost on the test frames untouched and after so many steps of training
on, the largest error untouched, and the bound of how far any picture may move.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from wamnet.cli.files import dataset_files
from wamnet.compiler import variants
from wamnet.kernels import open_executor, train_on
from wamnet.kernels.devices.executor import Executor
from wamnet.kernels.run.curve import Point
from wamnet.kernels.run.measure_curve import NAMES, Pairs, measure, names_for
from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl import metrics
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model, denoise
from wamnet.refimpl.network.train import SHORT, model_of

MORE = ("window4", "hidden24", "hidden16", "without-normal", "without-albedo", "without-position")
"""Variants in addition to those of a curve, which lose much untouched."""


def psnr(model: Model, tests: Pairs) -> float:
    """Return the mean PSNR of a model on frames, in dB."""
    scales = model.normalization
    found = [
        metrics.psnr(denoise(model, noisy), dataset.target_image(clean, scales)) for noisy, clean in tests
    ]
    return sum(found) / len(found)


def tuned(device: Executor, model: Model, name: str, steps: int, pairs: Pairs) -> Model:
    """Return a variant after training on: all variants for as many steps."""
    varied = variants.vary(variants.parse(name), model)
    small = varied.model
    recipe = replace(
        SHORT,
        features=small.features,
        window=small.window,
        widths=small.siren.widths[1:-1],
        omega_0_first=small.siren.omega_0_first,
        omega_0_hidden=small.siren.omega_0_hidden,
        activation=small.siren.activation,
        rank=varied.rank,
        steps=steps,
        seed=2,
    )
    return model_of(train_on(device, recipe, pairs, network=small.siren))


def fastest(points: Sequence[Point], name: str) -> Point:
    """Return the fastest point of a variant."""
    return min((point for point in points if point.variant == name), key=lambda point: point.milliseconds)


def main() -> None:
    """Measure, train on, and print a line a variant."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--model", type=Path, default=Path("out/demo/model.safetensors"))
    parser.add_argument("--dataset", type=Path, default=Path("out/demo/frames"), help="folder of a data set")
    parser.add_argument("--size", type=int, default=1024, help="pixels a side for times")
    parser.add_argument("--variants", nargs="+", default=[*NAMES, *MORE])
    parser.add_argument("--schedules", nargs="*", default=[], help="those that may pay, if none is named")
    parser.add_argument("--tune", type=int, default=0, help="steps of training on")
    parser.add_argument("--models", type=Path, help="folder for the models that were trained on")
    options = parser.parse_args()
    model = load_model(options.model)
    pairs, tests = (dataset_files.read_pairs(options.dataset, split) for split in ("train", "test"))
    with open_executor("opencl") as device:
        names = names_for(model, options.variants)
        size = (options.size, options.size)
        curve = measure(device, model, size, "ieee", tests, names, options.schedules)
        full = psnr(model, tests)
        print(f"{curve.device}, {options.size}x{options.size}; full network: {full:.2f} dB\n")
        heads = (
            "variant",
            "products a pixel",
            "schedule",
            "ms",
            "loss, dB",
            f"after {options.tune} steps, dB",
        )
        print(f"| {' | '.join((*heads, 'largest error', 'bound'))} |\n|{'---|' * (len(heads) + 2)}")
        for name in names:
            best, after = fastest(curve.points, name), ""
            varied = variants.vary(variants.parse(name), model)
            if options.tune and "sine" not in name:
                trained = tuned(device, model, name, options.tune, pairs)
                after = f"{full - psnr(trained, tests):.2f}"
                if options.models:
                    save_model(options.models / f"{name}.safetensors", trained)
            cells = (name, f"{varied.products:,}", best.schedule, f"{best.milliseconds:.0f}")
            cells += (f"{best.psnr_loss_db:.2f}", after, f"{best.error_max:.2g}", f"{best.error_bound:.2g}")
            print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
