"""A network in WebGL 2, by the web page's own shaders and scripts, in Chromium and in Firefox.

Chromium is driven by Playwright. Playwright has a Firefox of its own; the one that people use is driven by
Marionette, which is in it: a socket, and messages of JSON [`Marionette`]. Without a display Firefox has no
WebGL, so it is given one that nobody sees.
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
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

FIREFOX = ("firefox-esr", "firefox")
"""What that program may be called."""

DISPLAY = "Xvfb"
"""A display that nobody sees."""

START_S, POLL_S = 60, 0.2
"""Seconds in which Firefox has to listen, and between two questions."""

PREFERENCES: Mapping[str, bool | int | str] = {
    "webgl.force-enabled": True,
    "webgl.enable-debug-renderer-info": True,
    "webgl.sanitize-unmasked-renderer": False,
    "ui.prefersReducedMotion": 1,
    "dom.max_script_run_time": 0,
    "app.update.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "toolkit.telemetry.enabled": False,
}
"""Settings of Firefox: WebGL may be software, and a script may be slow."""

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

ASKED = """
const asked = document.createElement("script");
asked.textContent = `(%s)().then(
  (words) => { document.body.dataset.told = JSON.stringify({ words, device: wamnet.page.device.name }); },
  (error) => { document.body.dataset.told = JSON.stringify({ error: String(error) }); },
);`;
document.body.append(asked);
"""
"""The same as a script of the page itself: those of Marionette have a scope of their own."""


@contextmanager
def chromium(flags: Sequence[str] = ()) -> Iterator[Any]:
    """Yield a browser; raise ExecutorUnavailable where there is none, or it does not start."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        raise ExecutorUnavailable("no package playwright; pip install playwright") from None
    if program is None:
        raise ExecutorUnavailable("no Chromium; in Debian: apt-get install chromium")
    with sync_playwright() as driver:
        try:
            browser = driver.chromium.launch(executable_path=program, headless=True, args=[*FLAGS, *flags])
        except Error as error:
            raise ExecutorUnavailable(f"Chromium does not start: {str(error).splitlines()[0]}") from None
        try:
            yield browser
        finally:
            browser.close()


def denoise(
    model: Model, images: Mapping[str, NDArray[np.float32]], flags: Sequence[str]
) -> tuple[str, NDArray[np.float32]]:
    """Return browser and graphics device, and the picture (H, W, 3) of square images (H, W, C)."""
    with chromium(flags) as browser, _page(model, images) as path:
        from playwright.sync_api import Error

        try:
            tab = browser.new_context(reduced_motion="reduce").new_page()
            tab.set_default_timeout(WAIT_MS)
            tab.goto(path.resolve().as_uri())
            words = tab.evaluate(READ)
            device = tab.evaluate("wamnet.page.device.name")
        except Error as error:
            raise ExecutorUnavailable(f"Chromium: {str(error).splitlines()[0]}") from None
        told = f"Chromium {browser.version}, {device}"
    return told, _picture(words)


def denoise_in_firefox(
    model: Model, images: Mapping[str, NDArray[np.float32]]
) -> tuple[str, NDArray[np.float32]]:
    """Return browser and graphics device, and the picture (H, W, 3) of square images (H, W, C)."""
    program = next(filter(None, map(shutil.which, FIREFOX)), None)
    if program is None:
        raise ExecutorUnavailable("no Firefox; in Debian: apt-get install firefox-esr")
    with _page(model, images) as path, _display() as display, _firefox(program, display) as tab:
        version = tab.ask("WebDriver:NewSession")["capabilities"]["browserVersion"]
        tab.ask("WebDriver:Navigate", url=path.resolve().as_uri())
        tab.ask("WebDriver:ExecuteScript", script=ASKED % READ.replace("`", "\\`"), args=[])
        told = None
        ended = time.monotonic() + WAIT_MS / 1000
        while told is None and time.monotonic() < ended:
            time.sleep(POLL_S)
            said = tab.ask("WebDriver:ExecuteScript", script="return document.body.dataset.told;", args=[])
            told = said["value"]
        with suppress(ExecutorUnavailable):
            tab.ask("Marionette:Quit", flags=["eForceQuit"])
    found = json.loads(told or '{"error": "no picture in time"}')
    if "error" in found:
        raise ExecutorUnavailable(f"Firefox {version}: {found['error']}")
    return f"Firefox {version}, {found['device']}", _picture(found["words"])


class Marionette:
    """A Firefox that listens on a port of this machine: a message is its length, a colon, and JSON."""

    def __init__(self, port: int) -> None:
        ended = time.monotonic() + START_S
        while True:
            try:
                self._socket = socket.create_connection(("127.0.0.1", port))
                break
            except OSError:
                if time.monotonic() > ended:
                    raise ExecutorUnavailable("Firefox does not listen") from None
                time.sleep(POLL_S)
        self._count = 0
        self._receive()

    def ask(self, command: str, **parameters: Any) -> Any:
        """Return what a command gives; raise ExecutorUnavailable for what it refuses."""
        self._count += 1
        text = json.dumps([0, self._count, command, parameters]).encode()
        self._socket.sendall(b"%d:%b" % (len(text), text))
        _, _, error, found = self._receive()
        if error:
            raise ExecutorUnavailable(f"Firefox: {command}: {error['message']}")
        return found

    def _receive(self) -> Any:
        """Return the next message."""
        digits = b""
        while (digit := self._bytes(1)) != b":":
            digits += digit
        return json.loads(self._bytes(int(digits)))

    def _bytes(self, count: int) -> bytes:
        """Return so many bytes."""
        found = b""
        while len(found) < count:
            part = self._socket.recv(count - len(found))
            if not part:
                raise ExecutorUnavailable("Firefox has ended")
            found += part
        return found

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()


@contextmanager
def _display() -> Iterator[str]:
    """Yield the name of a display: the one that is there, or one that nobody sees."""
    if os.environ.get("DISPLAY"):
        yield os.environ["DISPLAY"]
        return
    program = shutil.which(DISPLAY)
    if program is None:
        raise ExecutorUnavailable(f"Firefox has no WebGL without a display, and there is no {DISPLAY}")
    command = [program, "-displayfd", "1", "-screen", "0", "640x480x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            yield f":{(server.stdout.readline() if server.stdout else '').strip()}"
        finally:
            server.terminate()


@contextmanager
def _firefox(program: str, display: str) -> Iterator[Marionette]:
    """Yield a Firefox with a new profile."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port: int = free.getsockname()[1]
    with tempfile.TemporaryDirectory(prefix="wamnet-firefox-", ignore_cleanup_errors=True) as profile:
        told = {**PREFERENCES, "marionette.port": port}
        lines = [f"user_pref({json.dumps(name)}, {json.dumps(value)});" for name, value in told.items()]
        (Path(profile) / "user.js").write_text("\n".join(lines), encoding="utf-8")
        command = [program, "--no-remote", "--profile", profile, "--marionette"]
        environment = {**os.environ, "DISPLAY": display, "HOME": profile}
        with subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        ) as browser:
            try:
                tab = Marionette(port)
                yield tab
                tab.close()
            finally:
                browser.terminate()


@contextmanager
def _page(model: Model, images: Mapping[str, NDArray[np.float32]]) -> Iterator[Path]:
    """Yield the file of a page whose check has these images."""
    with tempfile.TemporaryDirectory(prefix="wamnet-web-") as name:
        path = Path(name) / "page.html"
        size = len(next(iter(images.values())))
        path.write_text(render_page(_data(model, images, size)), encoding="utf-8")
        yield path


def _picture(words: Sequence[int]) -> NDArray[np.float32]:
    """Return the picture (H, W, 3) of its words (RGBA)."""
    size = round((len(words) / 4) ** 0.5)
    return np.array(words, np.uint32).view(np.float32).reshape(size, size, 4)[..., :3].copy()


def _data(model: Model, images: Mapping[str, NDArray[np.float32]], size: int) -> dict[str, Any]:
    """Return the data of a page whose check has these images; what they must give is not looked at."""
    animation = page.Animation((0.5,), (canonical("lone_light"),))
    data = page.page_data(animation, (page.Network("full", model),), Settings(max_depth=0))
    held = data["check"]["images"]
    data["check"]["size"] = size
    levels = data["variants"][0]["levels"]  # the page rounds features to integers itself
    for name, image in images.items():
        held[name]["values"] = base64.b64encode((image / levels).astype("<f4").tobytes()).decode()
    for name in set(held) - set(images):
        del held[name]
    nothing = base64.b64encode(np.zeros(3 * size * size, "<f8").tobytes()).decode()
    data["variants"][0]["check"] = {"expected": nothing, "bound": nothing, "sha256": None}
    return data
