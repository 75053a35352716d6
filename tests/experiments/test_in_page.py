"""The path tracer of three.js in a page: what is asked of it, what it may load, and what it shows."""

from __future__ import annotations

import base64
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
import pytest
from lab import browsers, in_page

from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.light.materials import Mirror
from wamnet.refimpl.light.scene import Quad, Scene
from wamnet_verify import run
from wamnet_verify.case import Shot
from wamnet_verify.cases import chosen, questions
from wamnet_verify.judgement import DEVIATES, PASS, UNTESTED, Missing

Found = TypeVar("Found")
"""What a function gives."""


def in_own_thread(function: Callable[[], Found]) -> Found:
    """Return what a function gives in a thread of its own.

    Playwright refuses to begin where another of its loops runs, and the browser that tests share has one."""
    with ThreadPoolExecutor(1) as threads:
        return threads.submit(function).result()


class Route:
    """A request of a page, and what is said to it."""

    def __init__(self, url):
        self.request, self.url, self.said = self, url, None

    def fulfill(self, body, content_type):
        self.said = content_type

    def continue_(self):
        self.said = "continued"

    def abort(self):
        self.said = "aborted"


@pytest.mark.parametrize(
    ("url", "said"),
    [
        (in_page.ADDRESS, "text/html"),
        (in_page.ADDRESS + "three/three.js", "text/javascript"),
        (in_page.ADDRESS + "three/none.js", "aborted"),
        (in_page.ADDRESS + "../secret", "aborted"),
        (in_page.ADDRESS + "three", "aborted"),
        ("http://example.org/three/three.js", "aborted"),
        ("data:application/octet-stream;base64,AA==", "continued"),
    ],
)
def test_the_page_gets_files_of_the_packages_and_nothing_else(tmp_path, url, said):
    folder = tmp_path / "modules"
    (folder / "three").mkdir(parents=True)
    (folder / "three" / "three.js").write_text("export {};")
    (tmp_path / "secret").write_text("secret")
    route = Route(url)
    in_page._answer(route, folder)
    assert route.said == said


def test_rows_come_from_above():
    target = np.arange(16, dtype="<f4").reshape(2, 2, 4)
    found = in_page._picture(base64.b64encode(target.tobytes()).decode(), 2)
    assert found.tolist() == [[[8, 9, 10], [12, 13, 14]], [[0, 1, 2], [4, 5, 6]]]


def shot_of(name):
    """Return the shot of a case."""
    return next(question.shot for question in questions() if question.name == name)


def test_only_the_colour_is_asked():
    """No page is opened for layers, for a screen, or for what glTF cannot say."""
    tracer = in_page.PathTracer()
    for name in ("normal", "display-dark"):
        assert tracer.pictures(shot_of(name), [1]) == Missing(UNTESTED, "only the colour is read, in floats")
    edges = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    lit = Quad(*edges, (1.0, 1.0, 1.0), emission=(1.0, 1.0, 1.0), material=Mirror())
    shining = Shot("shining", Scene("shining", shot_of("sky-dim").scene.camera, quads=(lit,)))
    assert tracer.pictures(shining, [1]) == Missing(UNTESTED, "format gltf has no mirror that emits")
    tracer.close()


def test_a_missing_package_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("NODE_PATH", str(tmp_path))
    monkeypatch.setattr(in_page.shutil, "which", lambda name: None)
    with pytest.raises(ExecutorUnavailable, match="no package three-gpu-pathtracer; npm install --global"):
        in_page.packages()
    for path in in_page.MODULES.values():
        (tmp_path / path).mkdir(parents=True, exist_ok=True)
    assert in_page.packages() == tmp_path


def test_a_browser_that_does_not_start_is_no_executor(monkeypatch):
    """A crash of the browser is reported in a sentence, also beside another browser."""
    playwright = pytest.importorskip("playwright.sync_api")
    monkeypatch.setattr(browsers, "NAMES", ("false",))

    def begin():
        with pytest.raises(ExecutorUnavailable, match="Chromium does not start: "), browsers.chromium():
            pass

    def begin_beside_another():
        with playwright.sync_playwright():
            in_own_thread(begin)

    in_own_thread(begin_beside_another)


@pytest.mark.nightly
@pytest.mark.needs("programs")
def test_it_shows_known_answers():
    """Mirrors and the sky are right; glass mirrors by Schlick's formula, and that is seen.

    Without a graphics card its shader compiles for minutes."""
    try:
        in_page.packages()
    except ExecutorUnavailable as error:
        pytest.skip(f"MISSING: {error}")

    def verify():
        tracer = in_page.PathTracer()
        try:
            return run.verify(tracer, chosen(["sky-dim", "mirrors-two", "fresnel-60"]), pictures=4)
        finally:
            tracer.close()

    found = in_own_thread(verify)
    assert [verdict.state for verdict in found] == [PASS, PASS, DEVIATES]
