"""The demonstration's report: the same facts for programs (`report.json`) and for people (`report.html`).

1. All facts are gathered as JSON's types [`facts`]; they are the whole of `report.json`.
2. `report.html` shows them with pictures and plots [`page`]. It is one file: nothing is fetched, no script
   runs, and it follows the reader's choice of a light or a dark page.
"""

import base64
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...refimpl.encoding import to_display
from ...refimpl.frame import Frame
from ...refimpl.metrics import error_map
from ...refimpl.network.denoise import Model
from ...refimpl.network.train import TrainState
from ..files.outputs import write_text
from . import bench_report, machine, plots, scores
from .pages import filled
from .runs import Run
from .scores import Score

SCHEMA = "wamnet-demo-2"
"""Name and version of the form of `report.json`."""

FOLDER = "pictures"
"""Folder of the pictures, in the folder of the results; their names begin with the test frame's number."""

PICTURES = ("noisy", "denoised", "reference", "normal")
"""Pictures of a test frame that the report shows, by the ends of their files' names."""


Limits = tuple[float, float]


@dataclass(frozen=True)
class Plan:
    """All sizes of a demonstration; the defaults take two to four minutes on two cores.

    The frames are those of `wamnet dataset`: the network never sees a test frame's pose. Many targets of
    `train_spp` samples teach more than few clean ones; what is judged has references of `reference_spp`.
    `steps` None means the preset's. A scene that moves is shown at different times, one of a file, which is
    static and has a SHA-256, from cameras in the ranges.
    """

    scene: str = "minicubes"
    scene_sha256: str = ""
    size_px: int = 256
    train_frames: int = 48
    test_frames: int = 2
    train_spp: int = 64
    reference_spp: int = 1024
    feature_spp: int = 8
    preset: str = "shadows"
    steps: int | None = None
    seed: int = 1
    renderer: str = "opencl"
    trainer: str = "opencl"
    yaw_deg: Limits = (0.0, 0.0)
    pitch_deg: Limits = (0.0, 0.0)
    distance: Limits = (1.0, 1.0)


@dataclass(frozen=True)
class Unseen:
    """A test frame: time, heading, noisy frame, its reference, the denoised image (H, W, 3), the scores.

    `scores` has a tuple for each picture, input and denoised.
    """

    time_s: float
    label: str
    noisy: Frame
    reference: Frame
    denoised: Any
    scores: dict[str, tuple[Score, ...]]


@dataclass(frozen=True)
class Results:
    """What a demonstration has found.

    The test frames' pictures are those of the executor `denoised_by`; `runs` were made on the first of them.
    """

    train_times_s: tuple[float, ...]
    unseen: tuple[Unseen, ...]
    denoised_by: str
    model: Model
    state: TrainState
    seconds_per_step: float | None
    runs: tuple[Run, ...]
    seconds: dict[str, float]


def write(
    output: Path, plan: Plan, results: Results, command: str, bench: Mapping[str, Any] | None = None
) -> None:
    """Write `report.json` and `report.html` into the folder that has the pictures.

    `bench`: what `cli/commands/bench.py: measure` has found, which both then hold too.
    """
    data = facts(plan, results, command)
    if bench is not None:
        data["bench"] = bench
    write_text(output / "report.json", json.dumps(data, indent=2, allow_nan=False) + "\n")
    folder = output / FOLDER
    pictures = [
        {name: _embedded((folder / f"{index}-{name}.png").read_bytes()) for name in PICTURES}
        for index in range(len(results.unseen))
    ]
    write_text(output / "report.html", page(data, pictures, draw(results)))


def facts(plan: Plan, results: Results, command: str) -> dict[str, Any]:
    """Return everything that a demonstration has found, as JSON's types."""
    model = results.model
    return {
        "schema": SCHEMA,
        "command": command,
        "plan": asdict(plan),
        "model": {
            "features": model.features,
            "window": asdict(model.window),
            "widths": model.siren.widths,
            "parameters": sum(layer.size for layer in (*model.siren.weights, *model.siren.biases)),
        },
        "unseen": [
            {
                "time_s": frame.time_s,
                "label": frame.label,
                **{name: scores.as_data(s) for name, s in frame.scores.items()},
            }
            for frame in results.unseen
        ],
        "train_times_s": results.train_times_s,
        "denoised_by": results.denoised_by,
        "runs": [asdict(run) for run in results.runs],
        "training": {
            "steps": results.state.step,
            "seconds_per_step": results.seconds_per_step,
            "history": results.state.history,
            "recipe": asdict(results.state.recipe),
        },
        "seconds": results.seconds,
        "machine": machine.describe(),
        "versions": machine.versions(),
    }


def draw(results: Results) -> dict[str, Any]:
    """Return each plot as an embedded picture for a light and for a dark page.

    `errors` has the maps of each test frame by picture, both on one scale; `training` is the curve.
    """
    drawn: dict[str, Any] = {"errors": [], "training": {}}
    themes = (("light", plots.LIGHT), ("dark", plots.DARK))
    for frame in results.unseen:
        stops = results.model.normalization.exposure_stops
        noisy, target = (to_display(shown["color"], stops) for shown in (frame.noisy, frame.reference))
        maps = {"input": error_map(noisy, target), "denoised": error_map(frame.denoised, target)}
        by_theme = {name: plots.error_maps(list(maps.items()), theme) for name, theme in themes}
        drawn["errors"].append(
            {title: {name: _embedded(by_theme[name][k]) for name in by_theme} for k, title in enumerate(maps)}
        )
    for name, theme in themes:
        curve = plots.training_curve(results.state.history, results.seconds_per_step, theme)
        drawn["training"][name] = _embedded(curve)
    return drawn


def page(data: dict[str, Any], pictures: list[dict[str, str]], drawn: dict[str, Any]) -> str:
    """Return the report as one HTML page."""
    bench = bench_report.section(data["bench"], _embedded) if data.get("bench") else None
    return filled("report.html.jinja", **{**data, "bench": bench}, pictures=pictures, plots=drawn)


def _embedded(png: bytes) -> str:
    """Return a PNG as the address of itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode()
