"""A page that is drawn in a moment, for the tests in a browser: a small network, 40 x 40 pixels."""

import base64
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from browser import Tab
from numpy.typing import NDArray

from wamnet.cli.reports import webpage
from wamnet.kernels.run import page as P
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import Ranges
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.window import Window

SIZE, FRAME, SEED = 40, 3, 5
SETTINGS = Settings(max_depth=2)
FEATURES = ("color", "normal", "position")
SCALES = dataset.Normalization(0.5, 12.0, (0.1, -0.2, 0.3), 6.0)
TIMES = tuple((number + 0.5) / 4 for number in range(8))
AT_REST = "!wamnet.page.preparing && !wamnet.page.dirty && !wamnet.page.renderer.strips.busy"
COLORS = [[0.9, 0.2, 0.1], [0.3, 0.4, 0.8]]
RANGES = Ranges((0.0, 8.0), (-24.0, 24.0), (-8.0, 8.0), (0.9, 1.1), (0.0, 0.5))
TURN = {"yaw": 25.0, "pitch": 8.0, "distance": 0.9}

NO_MOTION = {"reduced_motion": "reduce"}

BELOW = """[...document.querySelectorAll("figure > :not(.view), .controls, footer")]
  .filter((element) => element.getClientRects().length)
  .map((element) => element.getBoundingClientRect().top + scrollY)"""
"""Where everything around the sentence is in the document."""


class SmallPage(NamedTuple):
    """A network, the data of its page, and the page's file."""

    model: Model
    data: dict[str, Any]
    path: Path


def make(kit: Any, folder: Path) -> SmallPage:
    """Write the page of a network whose pictures lie within 0.5 +- 0.45, of an odd width."""
    window = Window(5, "zero")
    network = kit.network([dataset.n_inputs(FEATURES, window), 10, 7, 3], (3.0, 3.0))
    model = Model(network, FEATURES, window, SCALES, {"trained_on_ranges": RANGES.to_json()})
    animation = P.Animation(TIMES, tuple(scenes.canonical("minicubes", time=time) for time in TIMES))
    data = P.page_data(animation, P.networks_of(model, rank=4, processor=True), SETTINGS)
    path = folder / "page.html"
    path.write_text(webpage.render_page(data), encoding="utf-8")
    return SmallPage(model, data, path)


def read(tab: Tab, name: str) -> NDArray[np.float32]:
    """Return the floats (H, W, 4) of an image."""
    text = tab.page.evaluate("name => wamnet.read(name)", name)
    return np.frombuffer(base64.b64decode(text), "<f4").reshape(SIZE, SIZE, 4)


def draw(tab: Tab, **options: Any) -> Any:
    """Draw a moment; return what the page says of camera, colours and time."""
    return tab.page.evaluate("options => wamnet.draw(options)", {"size": SIZE, **options})


def text_when(tab: Tab, condition: str) -> str:
    """Return the sentence about what is outside once it is as it should be."""
    tab.until(f"(() => {{ const text = document.getElementById('outside').textContent; {condition} }})()")
    return tab.text("outside")
