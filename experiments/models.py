"""Make the models that ship with the package: two for each scene of `experiments/quality.py`.

    python experiments/models.py
    python experiments/models.py --scenes minicubes -o out/models --write models

1. Each is the network of that experiment's row for a set of frames, seed 0; it is trained where the cache
   lacks it [`MADE_OF`]. That of the mini cubes knows all that the web page moves.
   The second one of each scene needs colour, normal and albedo alone, which every renderer writes.
2. Its scores on the test frames inside of its ranges, with features of 16 rays and of one, and those of Open
   Image Denoise there go into its facts, beside the recipe and the ranges [`shipped`].
3. The folder gets a file for each scene, and `SHA256SUMS` [`written`].
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lab import command, scores
from lab.sets import SETS
from quality import PLANS, RAYS, ROWS, SHIPPED_SET, Bench, denoised

from wamnet.cli.files.dataset_files import sum_of
from wamnet.cli.files.outputs import write_text
from wamnet.models.model_file import save_model
from wamnet.refimpl.light.variation import RANGES
from wamnet.refimpl.network.denoise import Model

MADE_BY = "experiments/models.py"
"""Fact of these models: what makes them."""

SUMS = "SHA256SUMS"
"""File with the digest of each model, in the form of `sha256sum`."""

MADE_OF = {
    "minicubes": (SHIPPED_SET, "shipped-shadows"),
    "cornell": ("cornell", "shadows-16"),
    "glossy": ("glossy", "five-shadows-16"),
    "minicubes-basic": ("minicubes", "basic-16"),
    "cornell-basic": ("cornell", "basic-16"),
    "glossy-basic": ("glossy", "basic-16"),
}
"""The models by name: the set that each has learned from, and the row that it is."""

OURS = ""
"""Stands for the model's own row."""

SCORED = {
    f"{RAYS} rays": (OURS, RAYS),
    "1 ray": (OURS, 1),
    f"Open Image Denoise, {RAYS} rays": ("oidn-clean16", RAYS),
    "Open Image Denoise, 1 ray": ("oidn-1", 1),
    "input": ("input", 1),
}
"""What is scored, by the words of the facts: a row, and the camera rays of the features that it is given."""

SEEN = {f"Open Image Denoise, {RAYS} rays, specular features": ("oidn-past-prefiltered16", RAYS)}
"""What is scored besides where the model's features are of what is seen past mirrors and glass."""

DIGITS = 4
"""Digits of a score after the point."""


def scored(bench: Bench, ours: str) -> dict[str, dict[str, float]]:
    """Return PSNR, SSIM and FLIP on the test frames, means, of each way in the table above."""
    found = {}
    for text, (name, rays) in (SCORED | (SEEN if ROWS[ours].past else {})).items():
        pairs = bench.tests(0, rays, shadow_rays=ROWS[ours].shadow_rays)
        row = ROWS[name or ours]
        row = row if row.recipe else replace(row, rays=rays)
        pictures, _ = denoised(bench, row, [frame for frame, _ in pairs], 0)
        each = [
            scores.score(picture, clean["color"], linear)
            for (picture, linear), (_, clean) in zip(pictures, pairs, strict=True)
        ]
        mean = scores.mean_scores(each)
        found[text] = {metric: round(mean[metric], DIGITS) for metric in ("psnr", "ssim", "flip")}
    return found


def shipped(bench: Bench, ours: str) -> Model:
    """Return a set's model with its ranges and its scores among its facts, and without each frame's draw."""
    model, _ = bench.model(ROWS[ours], 0)
    plan = bench.plan
    frames = f"{plan.test} unseen frames, {plan.size}x{plan.size}, references of {plan.test_spp} samples"
    facts: dict[str, Any] = {"made_by": MADE_BY, "scored_on": frames}
    facts |= {"scores": json.dumps(scored(bench, ours)), "trained_on_frames": str(bench.counts.train)}
    facts[f"trained_on_{RANGES}"] = SETS[bench.name].ranges.to_json()
    kept = {name: text for name, text in model.info.items() if ", " not in text or "trained_on" not in name}
    drawn = ("time", "yaw_deg", "pitch_deg", "distance", "lights", "scene_digest", "seed")
    for name in drawn:
        kept.pop(f"trained_on_{name}", None)
    return replace(model, info={**kept, **facts})


def written(folder: Path, models: dict[str, Model]) -> None:
    """Write the models, and the digests of all that lie in the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, model in models.items():
        save_model(folder / f"{name}.safetensors", model)
    lines = [f"{sum_of(path).sha256}  {path.name}\n" for path in sorted(folder.glob("*.safetensors"))]
    write_text(folder / SUMS, "".join(lines))


def main(arguments: Sequence[str] | None = None) -> None:
    """Make and write the models; say their scores."""
    parser = command.parser(__doc__ or "", "models")
    parser.add_argument(
        "--scenes", nargs="+", default=list(MADE_OF), metavar="SCENE", help=", ".join(MADE_OF)
    )
    parser.add_argument("--write", type=Path, help="folder of the models, if not that of the results")
    options = parser.parse_args(arguments)
    models = {}
    for scene in options.scenes:
        of, row = MADE_OF[scene]
        models[scene] = shipped(Bench(of, PLANS[options.scale], options.cache, options.executor), row)
        print(scene, models[scene].info["scores"])
    written(options.write or options.output, models)


if __name__ == "__main__":
    command.begin(main)
