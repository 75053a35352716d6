"""A network in WebGL 2, by the web page's own shaders and scripts, in a headless Chromium."""

from __future__ import annotations

import base64
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.cli.reports.webpage import render_page
from wamnet.kernels.run import page
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.denoise import Model

NAMES = ("chromium", "chromium-browser", "google-chrome")
"""What the program may be called."""

FLAGS = ("--no-sandbox", "--enable-unsafe-swiftshader", "--disable-background-networking", "--no-first-run")
"""WebGL may be software; nothing is fetched."""

WAIT_MS = 900_000
"""How long a picture may take."""

READ = """async () => {
  await wamnet.ready;
  wamnet.page.held = true;
  const { renderer } = wamnet.page;
  const read = renderer.device.read;
  let kept = null;
  renderer.device.read = function (...given) { return (kept = read.apply(this, given)); };
  await renderer.check("full");
  renderer.device.read = read;
  return Array.from(new Uint32Array(kept.buffer));
}"""
"""The words of the picture (RGBA) that the page has made of its check's images."""


def denoise(
    model: Model, images: Mapping[str, NDArray[np.float32]], flags: Sequence[str]
) -> tuple[str, NDArray[np.float32]]:
    """Return browser and graphics device, and the picture (H, W, 3) of square images (H, W, C)."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        raise ExecutorUnavailable("no package playwright; pip install 'wamnet[web]'") from None
    if program is None:
        raise ExecutorUnavailable("no Chromium; in Debian: apt-get install chromium")
    size = len(next(iter(images.values())))
    with tempfile.TemporaryDirectory(prefix="wamnet-web-") as name, sync_playwright() as driver:
        path = Path(name) / "page.html"
        path.write_text(render_page(_data(model, images, size)), encoding="utf-8")
        try:
            browser = driver.chromium.launch(executable_path=program, headless=True, args=[*FLAGS, *flags])
            tab = browser.new_context(reduced_motion="reduce").new_page()
            tab.set_default_timeout(WAIT_MS)
            tab.goto(path.resolve().as_uri())
            words = tab.evaluate(READ)
            device = tab.evaluate("wamnet.page.device.name")
        except Error as error:
            raise ExecutorUnavailable(f"Chromium: {str(error).splitlines()[0]}") from None
        told = f"Chromium {browser.version}, {device}"
        browser.close()
    return told, np.array(words, np.uint32).view(np.float32).reshape(size, size, 4)[..., :3].copy()


def _data(model: Model, images: Mapping[str, NDArray[np.float32]], size: int) -> dict[str, Any]:
    """Return the data of a page whose check has these images; what they must give is not looked at."""
    animation = page.Animation((0.5,), (canonical("lone_light"),))
    data = page.page_data(animation, (page.Network("full", model),), Settings(max_depth=0))
    held = data["check"]["images"]
    data["check"]["size"] = size
    for name, image in images.items():
        held[name]["values"] = base64.b64encode(np.ascontiguousarray(image, "<f4").tobytes()).decode()
    for name in set(held) - set(images):
        del held[name]
    nothing = base64.b64encode(np.zeros(3 * size * size, "<f8").tobytes()).decode()
    data["variants"][0]["check"] = {"expected": nothing, "bound": nothing, "sha256": None}
    return data
