"""The demonstration's report: the same facts for programs (`report.json`) and for people (`report.html`).

1. All facts are gathered as JSON's types [`facts`]; they are the whole of `report.json`.
2. `report.html` shows them with pictures and plots [`page`]. It is one file: nothing is fetched, no script
   runs, and it follows the reader's choice of a light or a dark page.
"""

from __future__ import annotations

import base64
import json
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import machine, plots
from .compare import scores_as_data
from .outputs import write_text

if TYPE_CHECKING:
    from ..refimpl.denoise import Model
    from .demo import Plan, Results

SCHEMA = "wamnet-demo-1"
"""Name and version of the form of `report.json`."""

PICTURES = ("noisy", "denoised", "reference", "normal")
"""Pictures that the report shows, by the names of their files."""


def write(output: Path, plan: Plan, results: Results, command: str) -> None:
    """Write `report.json` and `report.html` into the folder that has the pictures."""
    data = facts(plan, results, command)
    write_text(output / "report.json", json.dumps(data, indent=2, allow_nan=False) + "\n")
    pictures = {name: _embedded((output / f"{name}.png").read_bytes()) for name in PICTURES}
    write_text(output / "report.html", page(data, pictures, draw(results)))


def facts(plan: Plan, results: Results, command: str) -> dict[str, Any]:
    """Return everything that a demonstration has found, as JSON's types."""
    return {
        "schema": SCHEMA,
        "command": command,
        "plan": asdict(plan),
        "model": _model_facts(results.model),
        "scores": {name: scores_as_data(scores) for name, scores in results.scores.items()},
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


def _model_facts(model: Model) -> dict[str, Any]:
    """Return what a reader wants to know of a model."""
    layers = (*model.siren.weights, *model.siren.biases)
    return {
        "features": model.features,
        "window": asdict(model.window),
        "widths": model.siren.widths,
        "parameters": sum(layer.size for layer in layers),
    }


def draw(results: Results) -> dict[str, dict[str, str]]:
    """Return each plot as an embedded picture for a light and for a dark page."""
    from ..refimpl.encoding import to_display
    from ..refimpl.metrics import error_map

    stops = results.model.normalization.exposure_stops
    noisy, target = (to_display(frame["color"], stops) for frame in (results.noisy, results.reference))
    maps = [("input", error_map(noisy, target)), ("denoised", error_map(results.denoised, target))]
    drawn: dict[str, dict[str, str]] = {"input_error": {}, "denoised_error": {}, "training": {}}
    for name, theme in (("light", plots.LIGHT), ("dark", plots.DARK)):
        of_input, of_denoised = plots.error_maps(maps, theme)
        drawn["input_error"][name], drawn["denoised_error"][name] = (
            _embedded(of_input),
            _embedded(of_denoised),
        )
        curve = plots.training_curve(results.state.history, results.seconds_per_step, theme)
        drawn["training"][name] = _embedded(curve)
    return drawn


def page(data: dict[str, Any], pictures: dict[str, str], drawn: dict[str, dict[str, str]]) -> str:
    """Return the report as one HTML page."""
    import jinja2

    text = resources.files(__package__).joinpath("report.html.jinja").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    environment.filters["number"] = _number
    return environment.from_string(text).render(**data, pictures=pictures, plots=drawn)


def _number(value: float | None, digits: int = 3) -> str:
    """Return a number with so many significant digits, or a dash where there is none."""
    if value is None:
        return "–"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.{digits}g}"


def _embedded(png: bytes) -> str:
    """Return a PNG as the address of itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode()
