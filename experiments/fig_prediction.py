"""The paper's pictures: a prediction beside input and reference (Fig. 2), methods compared (Fig. 3).

1. The paper's protocol is trained on one frame, and looked at on this frame and on unseen poses; so is the
   preset `short`, trained on all frames [`networks`].
2. Figure 2: input, normals, predictions, reference, and where FLIP sees a difference [`prediction`].
3. Figure 3: one unseen frame by several methods, whole and enlarged [`strip`]. The paper's other networks
   are drawn from the pictures of experiments/table1.py, where its folder has some [`others`].
4. A table has the scores of all that is shown [`measure`].

    python experiments/fig_prediction.py
    python experiments/fig_prediction.py --scale paper -o out/fig-prediction-paper
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from lab import command, figures, scores, tables
from lab.frames import Pair, Shot
from lab.ground import (
    Cost,
    Ground,
    inputs,
    judged,
    measure_all,
    start,
    targets,
    together,
    told,
    write_table,
)
from lab.results import Results, Values
from lab.tables import Column

from wamnet.cli.files.images import read_png
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.frame import Floats
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.train import PAPER, SHORT, Recipe
from wamnet_peers import peer_oidn

ENLARGED = (0.44, 0.36, 0.28)
"""The part of the picture that is enlarged: its left and upper edge and its side, as shares of the whole."""

NETWORKS: Mapping[str, tuple[Recipe, bool]] = {
    "WAMnet without normals": (replace(PAPER, features=("color",)), True),
    "WAMnet, paper": (PAPER, True),
    "WAMnet, short": (SHORT, False),
}
"""Recipes, and whether they are trained on only one frame, as in the paper."""

REFERENCE = "reference"
"""Name of the picture of many samples in the folder of experiments/table1.py."""

ORDER = ("input", "dncnn", "pix2pix", "wamnet-color", "wamnet", "wamnet-short", "oidn-noisy", "render30")
"""Names of its other pictures, in the order in which they are drawn."""

OIDN = "Open Image Denoise"
"""The general denoiser, given albedo and normal."""


def network(ground: Ground, name: str, seed: int) -> Model:
    """Return a trained network."""
    recipe, lone = NETWORKS[name]
    plan = ground.plan
    steps, batch = (plan.paper_steps, plan.paper_batch) if lone else (plan.steps, plan.batch)
    pairs = ground.seen()[: 1 if lone else None]
    return ground.train(replace(recipe, steps=steps, batch=batch, seed=seed), pairs)[0]


def by_network(name: str, ground: Ground, pairs: Sequence[Pair], seed: int) -> list[Floats]:
    """Return a network's pictures."""
    return ground.pictures(network(ground, name, seed), pairs)


def by_oidn(ground: Ground, pairs: Sequence[Pair], seed: int) -> list[Floats]:
    """Return the general denoiser's pictures."""
    return [to_display(peer_oidn.filtered(noisy, noisy)) for noisy, _ in pairs]


Method = Callable[[Ground, Sequence[Pair], int], list[Floats]]
"""From ground, pairs and seed to display-encoded pictures."""


def methods() -> dict[str, Method]:
    """Return what makes pictures here, in the order of the table."""
    found: dict[str, Method] = {"input, 1 spp": lambda ground, pairs, seed: inputs(pairs)}
    found |= {name: partial(by_network, name) for name in NETWORKS}
    if importlib.util.find_spec("pyoidn") is not None:
        found[OIDN] = by_oidn
    return found


def training_shots(ground: Ground) -> list[Shot]:
    """Return the shot of the frame that the paper's network is trained on."""
    return ground.training_shots()[:1]


def training_frame(ground: Ground) -> list[Pair]:
    """Return the frame that the paper's network is trained on, with a reference as clean as the tests'."""
    return ground.tested(training_shots(ground))


def measure(ground: Ground, method: Method, seed: int) -> Values:
    """Return the scores on unseen frames, and on the training frame."""
    found = (("", ground.unseen()), ("trained", training_frame(ground)))
    return together(*(told(judged(method(ground, pairs, seed), pairs), what) for what, pairs in found))


def cost(ground: Ground) -> Cost:
    """Return what the pictures need."""
    plan = ground.plan
    needed = [(ground.training_shots(), plan.train_spp), (ground.test_shots(), plan.test_spp)]
    needed.append((training_shots(ground), plan.test_spp))
    # Of all methods only those of one frame take long; the mean over all is taken.
    share = sum(lone for _, lone in NETWORKS.values()) / len(methods())
    windows = share * plan.paper_steps * plan.paper_batch / FASTER
    return Cost(needed, plan.test_frames + 1, windows)


FASTER = 8.0
"""Times as many windows of the paper's features as the preset's are trained on in a second, roughly."""

COLUMNS = (
    Column("psnr trained", "the training frame: PSNR, dB", 2, interval=True),
    Column("ssim trained", "SSIM", 3, interval=True),
    Column("psnr", "unseen poses: PSNR, dB", 2, interval=True),
    Column("ssim", "SSIM", 3, interval=True),
    Column("flip", "FLIP", 3, interval=True),
)
"""The columns of the table."""


def prediction(ground: Ground, seed: int, path: Path) -> None:
    """Write Figure 2: a row for the training frame and for two unseen poses."""
    rows: list[figures.Row] = []
    shown = [("the training frame", training_frame(ground))]
    shown += [
        (f"unseen: {float(noisy.info['time']):.2f} s", [(noisy, clean)])
        for noisy, clean in ground.unseen()[:2]
    ]
    for title, pairs in shown:
        (target,) = targets(pairs)
        made = {name: by_network(name, ground, pairs, seed)[0] for name in list(NETWORKS)[1:]}
        pictures = [("input, 1 spp", inputs(pairs)[0]), ("normals", (pairs[0][0]["normal"] + 1.0) / 2.0)]
        pictures += list(made.items())
        pictures += [("reference", target)]
        pictures += [(f"FLIP, {name}", scores.flip_map(picture, target)) for name, picture in made.items()]
        rows.append((title, pictures))
    figures.sheet(path, rows)


def strip(ground: Ground, seed: int, path: Path) -> None:
    """Write Figure 3: an unseen frame by all methods of this file, whole, and a part of it."""
    pairs = ground.unseen()[:1]
    pictures = {name: method(ground, pairs, seed)[0] for name, method in methods().items()}
    enlarge(path, {**pictures, "reference": targets(pairs)[0]})


def enlarge(path: Path, pictures: Mapping[str, Floats]) -> None:
    """Write pictures (H, W, 3) of one size in a row, and a part of each below."""
    height, width = next(iter(pictures.values())).shape[:2]
    left, top, side = round(ENLARGED[0] * width), round(ENLARGED[1] * height), round(ENLARGED[2] * height)
    parts = [
        ("", picture[top : top + max(side, 1), left : left + max(side, 1)]) for picture in pictures.values()
    ]
    figures.sheet(path, [("an unseen frame", list(pictures.items())), ("enlarged", parts)])


def others(folder: Path) -> dict[str, Floats]:
    """Return the pictures that experiments/table1.py left in a folder, its reference last, or none."""
    found = {path.stem: path for path in sorted(folder.glob("*.png"))} if folder.is_dir() else {}
    if REFERENCE not in found:
        return {}
    names = [name for name in ORDER if name in found]
    return {name: read_png(found[name]) for name in (*names, REFERENCE)}


def report(ground: Ground, results: Results, seed: int, pictures: Path, folder: Path) -> None:
    """Write the table and both figures; pictures are those of one seed."""
    names = {name: name for name in methods()}
    write_table(folder / "table.md", tables.table(results, COLUMNS, names))
    prediction(ground, seed, folder / "prediction.png")
    strip(ground, seed, folder / "methods.png")
    if found := others(pictures):
        enlarge(folder / "baselines.png", found)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train and score whatever is missing, then draw."""
    parser = command.parser(__doc__, "fig_prediction")
    parser.add_argument("--pictures", type=Path, default=Path("out/table1/pictures"), help="other methods'")
    options, ground, results = start(parser, "fig_prediction", arguments)
    work = {name: partial(measure, ground, method) for name, method in methods().items()}
    measure_all(ground, results, work, options.seeds, cost(ground))
    report(ground, results, options.seeds[0], options.pictures, options.output)


if __name__ == "__main__":
    command.begin(main)
