"""What decisions cost or gain that depart from the paper or fill what it leaves open (spec/departures.md).

1. Noisy frames and references of `minicubes` at training times, and at two that continue their sequence.
2. Each choice differs from the preset `paper` in one thing [`CHOICES`]: in the frames [`encoded`], in how
   minibatches are picked [`picks`], or in the loss [`fit`]. All else is the reference's own.
3. PSNR of display-encoded colour on the test times, over seeds [`score`]; a Markdown table.

    python experiments/departures.py
    python experiments/departures.py --scale paper

The small scale has pools of 20,000 windows as the paper, of smaller frames, in fewer and smaller steps: what
it tells is how choices differ, not how good they get.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from lab import command, frames
from lab.frames import Pair, Shot
from lab.results import Results, fill, summary
from lab.tables import markdown
from numpy.typing import NDArray

from wamnet.cli.files.outputs import write_text
from wamnet.refimpl import encoding, metrics
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.scenes import TURN_SECONDS
from wamnet.refimpl.network import adam, dataset, siren, train
from wamnet.refimpl.network.dataset import Normalization, Window
from wamnet.refimpl.network.denoise import Model, denoise
from wamnet.refimpl.network.siren import Siren
from wamnet.refimpl.network.train import PAPER, Recipe

Array = NDArray[Any]


@dataclass(frozen=True)
class Choice:
    """What differs from the preset: see the fields' names; `loss_factor` 3 is the sum over the channels."""

    text: str
    border: str = "clamp"
    flipped: bool = False
    linear: bool = False
    shifted_normals: bool = False
    with_replacement: bool = True
    loss_factor: float = 1.0
    clipped_loss: bool = False


CHOICES: Mapping[str, Choice] = {
    "as decided": Choice("as decided"),
    "unclipped": Choice("the output not clipped (DEN-2)"),
    "summed": Choice("loss summed over the channels (TRN-3)", loss_factor=3.0),
    "without replacement": Choice("half of the pool, no window twice (TRN-2)", with_replacement=False),
    "clipped loss": Choice("output clipped in the loss (TRN-3)", clipped_loss=True),
    "zero": Choice("border `zero` (DAT-5)", border="zero"),
    "centre 5": Choice("centre at index 5 (DAT-4)", flipped=True),
    "linear": Choice("linear colour, clipped to [0, 1] (ENC-5)", linear=True),
    "normals": Choice("normals in [0, 1] (DAT-1)", shifted_normals=True),
}
"""The choices by name; that of the first is the spec's."""


@dataclass(frozen=True)
class Scale:
    """Sizes of a run: training frames, pixels a side, samples of a reference, and the recipe's numbers."""

    train: int
    size: int
    spp: int
    recipe: Recipe


UNSEEN = 2
"""Number of test frames."""

SCALES: Mapping[str, Scale] = {
    "toy": Scale(1, 8, 2, replace(PAPER, window=Window(4), widths=(4, 4), n_windows=32, batch=16, steps=4)),
    "small": Scale(8, 64, 64, replace(PAPER, batch=400, steps=800)),
    "paper": Scale(1, 1024, 1024, PAPER),
}
"""Sizes by the option `--scale`."""


def encoded(frame: Frame, choice: Choice) -> Frame:
    """Return a frame whose features, encoded as the spec says, are what the choice wants.

    Linear colour: the display encoding of its decoding is itself. A centre at index 5 is one at index 6 of
    the picture turned by half a turn.
    """
    layers = dict(frame.layers)
    if choice.linear:
        layers["color"] = encoding.srgb_decode(np.clip(layers["color"].astype(np.float64), 0.0, 1.0))
    if choice.shifted_normals:
        layers["normal"] = 0.5 * layers["normal"].astype(np.float64) + 0.5
    if choice.flipped:
        layers = {name: np.ascontiguousarray(values[::-1, ::-1]) for name, values in layers.items()}
    return Frame(layers, frame.info)


def picks(recipe: Recipe, step: int, choice: Choice) -> Array:
    """Return the members of the pool that a step sees."""
    if choice.with_replacement:
        return train.draw_picks(recipe, step)
    generator = np.random.default_rng((recipe.seed, step))
    return generator.permutation(recipe.n_windows)[: recipe.batch]


def slopes(network: Siren, windows: Array, targets: Array, choice: Choice) -> siren.Gradients:
    """Return the derivatives of the choice's loss."""
    outputs, cache = siren.forward_cached(network, windows)
    shown = np.clip(outputs, 0.0, 1.0) if choice.clipped_loss else outputs
    _, dy = train.squared_error(shown, targets, outputs.size)
    dy = choice.loss_factor * dy * (shown == outputs)
    return siren.backward(network, cache, dy.astype(outputs.dtype), with_dx=False)


def fit(recipe: Recipe, pairs: Sequence[Pair], choice: Choice) -> Model:
    """Return the model that the recipe gives under the choice; as decided, the reference's own."""
    recipe = replace(recipe, window=replace(recipe.window, border=choice.border))
    data = dataset.build(pairs, recipe.features, recipe.window, Normalization())
    pool = train.draw_pool(recipe, data)
    assert pool is not None, "the paper's protocol has a pool"
    network = siren.init(recipe.layer_widths, recipe.omega_0_first, recipe.omega_0_hidden, recipe.seed)
    parameters = network.weights + network.biases
    moments = adam.init(parameters)
    for step in range(recipe.steps):
        chosen = picks(recipe, step, choice)
        windows, targets = dataset.examples_at(data, *(part[chosen] for part in pool))
        found = slopes(network, windows, targets, choice)
        parameters, moments = adam.step(
            parameters, found.dweights + found.dbiases, moments, train.rate_at(recipe, step)
        )
        layers = len(network.weights)
        network = replace(network, weights=parameters[:layers], biases=parameters[layers:])
    return Model(network, recipe.features, recipe.window, Normalization())


def picture_of(model: Model, frame: Frame, choice: Choice) -> Array:
    """Return the denoised frame, display-encoded, the right way up."""
    picture = denoise(model, encoded(frame, choice))
    if choice.text == CHOICES["unclipped"].text:
        image = dataset.feature_image(frame, model.features, model.normalization)
        windows = dataset.all_windows(dataset.pad(image, model.window), model.window)
        picture = siren.forward(model.siren, windows)
    if choice.flipped:
        picture = picture[::-1, ::-1]
    return np.asarray(encoding.srgb_encode(picture) if choice.linear else picture)


def score(
    scale: Scale, train_pairs: Sequence[Pair], tests: Sequence[Pair], choice: Choice, seed: int
) -> float:
    """Return the mean PSNR of the test frames, dB."""
    recipe = replace(scale.recipe, seed=seed)
    made = [(encoded(noisy, choice), encoded(clean, choice)) for noisy, clean in train_pairs]
    model = fit(recipe, made, choice)
    wanted = [encoding.to_display(clean["color"].astype(np.float64)) for _, clean in tests]
    pictures = [picture_of(model, noisy, choice) for noisy, _ in tests]
    return float(np.mean([metrics.psnr(a, b) for a, b in zip(pictures, wanted, strict=True)]))


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure all choices and write the table."""
    given = command.parser(__doc__ or "", "departures").parse_args(arguments)
    scale = SCALES[given.scale]
    times, tests = frames.split_times(scale.train, UNSEEN, TURN_SECONDS)
    shots = [Shot(time=time, size=scale.size, seed=i) for i, time in enumerate([*times, *tests])]
    found = frames.pairs(given.cache, shots, scale.spp, given.executor)
    learned, unseen = found[: len(times)], found[len(times) :]
    results = Results.open(given.output / "results.json", "departures", {"scale": given.scale})
    work = {name: partial(measured, scale, learned, unseen, choice) for name, choice in CHOICES.items()}
    fill(results, work, given.seeds)
    text = summed_up(results, given.seeds)
    write_text(given.output / "departures.md", text)
    print(text)


def measured(
    scale: Scale, train_pairs: Sequence[Pair], tests: Sequence[Pair], choice: Choice, seed: int
) -> Mapping[str, float]:
    """Return what is kept of a choice and a seed."""
    return {"psnr": score(scale, train_pairs, tests, choice, seed)}


def summed_up(results: Results, seeds: Sequence[int]) -> str:
    """Return the table: PSNR, and its difference from that of the spec's choice with the same seed."""
    first, *_ = CHOICES
    found = {name: [float((results.get(name, seed) or {})["psnr"]) for seed in seeds] for name in CHOICES}
    rows = [
        [
            choice.text,
            summary(found[name]).text(),
            summary([a - b for a, b in zip(found[name], found[first], strict=True)]).text(),
        ]
        for name, choice in CHOICES.items()
    ]
    return markdown(("choice", "PSNR, dB", "to the first, dB"), rows)


if __name__ == "__main__":
    command.begin(main)
