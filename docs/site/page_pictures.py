"""Draw what the web page shows at 40 degrees and under other colours, for the documents.

    python docs/site/page_pictures.py MODEL FOLDER NAME
    python docs/site/page_pictures.py minicubes docs/images after

1. The page of the model is opened in a headless Chromium, which draws on the processor.
2. It draws each moment of [`MOMENTS`] with the first variant of the network, denoised from one sample a pixel
   [`take`]; colours keep the brightness of the scene's lamps [`as_bright`].
3. Each canvas becomes FOLDER/page-NAME-MOMENT.png.
"""

from __future__ import annotations

import argparse
import base64
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from wamnet.cli.reports.webpage import page_of

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "support"))
from browser import Chromium, Tab

FRAME = 75
"""Number of the moment in the animation: 2.5 s."""

GREEN, MAGENTA = (0.3, 1.0, 0.4), (1.0, 0.3, 0.8)
"""Hue and saturation (0.7) of the lamps' other colours, linear RGB: far from the warm and the cool one."""

MOMENTS: dict[str, dict[str, Any]] = {
    "40-degrees": {"turn": {"yaw": 40.0}},
    "colors": {"colors": [GREEN, MAGENTA]},
}
"""What each picture changes, by name."""

DRAW = """async (options) => {
  await wamnet.draw({ ...options, variant: wamnet.page.data.variants[0].name });
  wamnet.page.wipeTo(0); // shows it; the canvas holds it until this task ends
  return document.getElementById("picture").toDataURL("image/png").split(",")[1];
}"""
"""Draws a moment, and returns the canvas as base64."""


def as_bright(color: Sequence[float], own: Sequence[float]) -> list[float]:
    """Return a linear colour with the mean of the lamp's own."""
    return [channel * sum(own) / sum(color) for channel in color]


def take(tab: Tab, moment: dict[str, Any], size: int) -> bytes:
    """Return the page's picture of a moment as PNG."""
    options = {"size": size, "frame": FRAME, **moment}
    if "colors" in moment:
        own = tab.page.evaluate("wamnet.page.data.lights.map((light) => light.color)")
        options["colors"] = [as_bright(*pair) for pair in zip(moment["colors"], own, strict=True)]
    return base64.b64decode(tab.page.evaluate(DRAW, options))


def pictures(model: Path, folder: Path, name: str, size: int) -> list[Path]:
    """Write the pictures of a model's page, and return their files."""
    written = []
    with tempfile.TemporaryDirectory() as place, Chromium() as chromium:
        file = Path(place) / "page.html"
        file.write_text(page_of(model, "minicubes", (), None), encoding="utf-8")
        with chromium.tab(file, reduced_motion="reduce") as tab:
            tab.page.evaluate("wamnet.ready")
            for moment, options in MOMENTS.items():
                path = folder / f"page-{name}-{moment}.png"
                path.write_bytes(take(tab, options, size))
                written.append(path)
    return written


def main(arguments: Sequence[str]) -> int:
    """Draw the pictures that the command line selects."""
    parser = argparse.ArgumentParser(description="Draw the web page at 40 degrees and under other colours.")
    parser.add_argument("model", type=Path, help="model file, or the name of a shipped one")
    parser.add_argument("folder", type=Path, help="where the pictures go")
    parser.add_argument("name", help="what their names begin with, after page-")
    parser.add_argument("--size", type=int, default=256, help="width and height in pixels")
    chosen = parser.parse_args(arguments)
    for path in pictures(chosen.model, chosen.folder, chosen.name, chosen.size):
        print(path)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
