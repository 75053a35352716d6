"""A headless Chromium that draws WebGL on the processor: the same on every machine, and no network."""

import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

from wamnet.refimpl.errors import ExecutorUnavailable

NAMES = ("chromium", "chromium-browser", "google-chrome")
"""What the program may be called."""

FLAGS = (
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
        "--disable-background-networking", "--disable-component-update", "--no-first-run",
)  # fmt: skip
"""SwiftShader draws; nothing is fetched that no page asks for."""

WAIT_MS = 120_000
"""How long a page may take for anything: machines that run tests are slow, and no test asserts a time."""

STEP_MS = 20
"""Between two looks at a condition."""


class Chromium(AbstractContextManager["Chromium"]):
    """One browser for a session."""

    def __init__(self) -> None:
        program = next(filter(None, map(shutil.which, NAMES)), None)
        if program is None:
            raise ExecutorUnavailable("no Chromium; in Debian: apt-get install chromium")
        try:
            from playwright.sync_api import Error, sync_playwright
        except ImportError:
            raise ExecutorUnavailable("no package playwright; pip install playwright") from None
        self._driver = sync_playwright().start()
        try:
            launch = self._driver.chromium.launch
            self.browser = launch(executable_path=program, headless=True, args=[*FLAGS])
        except Error as error:
            self._driver.stop()
            raise ExecutorUnavailable(f"Chromium does not start: {str(error).splitlines()[0]}") from None
        self.device = f"Chromium {self.browser.version}, SwiftShader"

    def __exit__(self, *_: object) -> None:
        self.browser.close()
        self._driver.stop()

    @contextmanager
    def tab(self, path: Path, script: str = "", **options: Any) -> Iterator["Tab"]:
        """Open a file in a tab of its own; `script` runs before the page's."""
        context = self.browser.new_context(**options)
        context.set_default_timeout(WAIT_MS)
        page = context.new_page()
        if script:
            page.add_init_script(script)
        try:
            yield Tab(page, path)
        finally:
            context.close()


class Tab:
    """A page, and all that it has said and requested."""

    def __init__(self, page: Any, path: Path) -> None:
        self.page = page
        self.said: list[str] = []
        self.asked: list[str] = []
        page.on("console", lambda message: self.said.append(f"{message.type}: {message.text}"))
        page.on("pageerror", lambda error: self.said.append(f"error: {error}"))
        page.on("request", lambda request: self.asked.append(request.url))
        self.address = path.resolve().as_uri()
        page.goto(self.address)

    def until(self, condition: str) -> None:
        """Wait for a condition; the page forbids `eval`, by which Playwright would wait."""
        for _ in range(WAIT_MS // STEP_MS):
            if self.page.evaluate(condition):
                return
            self.page.wait_for_timeout(STEP_MS)
        raise AssertionError(f"{condition} did not come true; the page has said {self.said}")

    def text(self, name: str) -> str:
        """Return the text of an element."""
        return str(self.page.locator(f"#{name}").text_content())

    def state(self, name: str) -> Any:
        """Return what the page holds of a control."""
        return self.page.evaluate(f"wamnet.page.state.{name}")
