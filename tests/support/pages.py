"""Pages of hosts in browsers: a server in the page's folder, to which the page sends what it has found.

The server is the host's own (serve.mjs). Chromium draws on SwiftShader. Firefox has no WebGL without a
display, and gets one that nobody sees.
"""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from browser import FLAGS, NAMES

SECONDS = 120
"""How long a page may take: machines that run tests are slow, and no test asserts a time."""

GPU = ("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader", "--enable-features=Vulkan")
"""What lets Chromium have WebGPU without a graphics processor."""

SETTINGS = {
    "webgl.force-enabled": "true",
    "browser.shell.checkDefaultBrowser": "false",
    "datareporting.policy.dataSubmissionEnabled": "false",
}
"""Settings of Firefox: WebGL may be software, and no question is asked."""


@contextmanager
def _display() -> Iterator[dict[str, str]]:
    """Yield an environment with a display."""
    if os.environ.get("DISPLAY"):
        yield dict(os.environ)
        return
    program = shutil.which("Xvfb")
    if program is None:
        pytest.skip("Firefox has no WebGL without a display: apt-get install xvfb")
    reading, writing = os.pipe()
    command = [program, "-displayfd", str(writing), "-screen", "0", "640x480x24"]
    process = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
    try:
        with os.fdopen(reading) as told:
            os.close(writing)
            number = told.readline().strip()
        yield {**os.environ, "DISPLAY": f":{number}"}
    finally:
        process.terminate()
        process.wait()


def _chromium(profile: Path, address: str) -> list[str]:
    """Return the command of Chromium."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip("Chromium is missing: apt-get install chromium")
    return [program, "--headless", *FLAGS, *GPU, f"--user-data-dir={profile}", address]


def _firefox(profile: Path, address: str) -> list[str]:
    """Return the command of Firefox."""
    program = shutil.which("firefox-esr") or shutil.which("firefox")
    if program is None:
        pytest.skip("Firefox is missing: apt-get install firefox-esr")
    lines = [f'user_pref("{name}", {value});' for name, value in SETTINGS.items()]
    (profile / "user.js").write_text("\n".join(lines))
    return [program, "--no-remote", "--profile", str(profile), address]


BROWSERS = {"chromium": _chromium, "firefox": _firefox}
"""Commands by name."""


def browse(folder: Path, name: str) -> tuple[int, str]:
    """Return the status of a folder's server, and what the page has sent to it from a browser."""
    with ExitStack() as opened:
        environment = opened.enter_context(_display()) if name == "firefox" else dict(os.environ)
        where = opened.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True))
        command = [shutil.which("node") or "node", "serve.mjs", "0", "--once"]
        server = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
        opened.enter_context(server)
        opened.callback(server.kill)
        assert server.stdout is not None
        address = server.stdout.readline().strip()
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        browser = subprocess.Popen(BROWSERS[name](Path(where), address), env=environment, **quiet)
        try:
            told, _ = server.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            return 1, f"{name} has sent nothing"
        finally:
            browser.terminate()
            browser.wait()
        return server.returncode, told
