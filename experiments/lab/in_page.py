"""A renderer in a browser: three-gpu-pathtracer, the path tracer of three.js, in Chromium by WebGL 2.

1. A page has three.js, its loader of glTF, three-mesh-bvh and the path tracer as modules [`SCRIPT`]. What the
   page asks for comes from the packages' folders; all else is refused [`_answer`].
2. One page makes the pictures of all shots: without a graphics card its shader takes minutes to compile, and
   is kept [`PathTracer`].
3. For each seed the tracer begins again with other random numbers and takes the samples of the shot. The
   colour is read from its target of floats. It has no other layers, and what a screen gets is not read.

    npm install --global three three-mesh-bvh three-gpu-pathtracer
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet_verify import renderers, write_gltf
from wamnet_verify.case import Shot
from wamnet_verify.judgement import FAILED, UNTESTED, Missing, Picture
from wamnet_verify.parts import NotExpressed

from .browsers import WAIT_MS, chromium

NAME = "three-gpu-pathtracer"
"""Of the renderer, and of its package."""

MODULES = {
    "three": "three/build/three.module.js",
    "three/examples/": "three/examples/",
    "three-mesh-bvh": "three-mesh-bvh/build/index.module.js",
    NAME: f"{NAME}/build/index.module.js",
}
"""Files of the packages by the names under which modules ask for them."""

ADDRESS = "http://modules.invalid/"
"""Where the page believes to be: no such host exists, and every request is answered here."""

SCRIPT = """\
<script type="module">
import { Color, Scene, WebGLRenderer } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { WebGLPathTracer } from "three-gpu-pathtracer";

const renderer = new WebGLRenderer();
const tracer = new WebGLPathTracer(renderer);
Object.assign(tracer, { renderDelay: 0, minSamples: 0, rasterizeScene: false, renderToCanvas: false });
tracer.filterGlossyFactor = 0;
tracer.tiles.set(1, 1);
const soon = () => new Promise((resolve) => setTimeout(resolve));

const base64 = (floats) => {
  let text = "";
  for (const byte of new Uint8Array(floats.buffer)) text += String.fromCharCode(byte);
  return btoa(text);
};

// A number of a seed's own for each of the tracer's generators; both count on from there.
const begin = (seed) => {
  const { material } = tracer._pathTracer;
  material.seed = 65536 * seed;
  material.stratifiedTexture.generator.seed = 1 + 7919 * seed;
};

window.render = async ([text, seeds, size, samples, depth]) => {
  const { scene: parts, cameras: [camera] } = await new GLTFLoader().parseAsync(text, "");
  const scene = new Scene();
  scene.background = new Color(0, 0, 0);
  scene.add(parts);
  camera.aspect = 1;
  camera.updateProjectionMatrix();
  renderer.setPixelRatio(1);
  renderer.setSize(size, size, false);
  tracer.bounces = depth + 1;
  tracer.transmissiveBounces = depth;
  tracer.setScene(scene, camera);
  const found = [];
  for (const seed of seeds) {
    tracer.reset();
    begin(seed);
    while (tracer.samples < samples) {
      tracer.renderSample();
      if (tracer.isCompiling || tracer.samples % 64 == 0) await soon();
    }
    const floats = new Float32Array(4 * size * size);
    renderer.readRenderTargetPixels(tracer.target, 0, 0, size, size, floats);
    found.push(base64(floats));
  }
  return found;
};
</script>
"""
"""`render` gives a picture for each seed, rows from below, red, green, blue and alpha."""

IMPORTS = json.dumps({"imports": {name: f"/{path}" for name, path in MODULES.items()}})
PAGE = f'<!doctype html>\n<script type="importmap">{IMPORTS}</script>\n{SCRIPT}'
"""The page."""


class PathTracer:
    """The renderer, with a page that is opened for the first shot."""

    name = NAME
    intents = renderers.FORMATS["gltf"].intents

    def __init__(self) -> None:
        self._browser = ExitStack()
        self._page: Any = None

    def pictures(self, shot: Shot, seeds: Sequence[int]) -> Sequence[Picture] | Missing:
        """Return a picture for each seed, or why there are none."""
        if shot.layers or shot.display:
            return Missing(UNTESTED, "only the colour is read, in floats")
        try:
            text = write_gltf.write(shot, seeds[0])
        except NotExpressed as error:
            return Missing(UNTESTED, f"format gltf has no {error}")
        page = self._opened()
        from playwright.sync_api import Error

        try:
            asked = [text, list(seeds), shot.size, shot.spp, shot.depth]
            found = page.evaluate("(asked) => window.render(asked)", asked)
        except Error as error:
            return Missing(FAILED, str(error).splitlines()[0][: renderers.MOST_TOLD])
        return [{"color": _picture(text, shot.size)} for text in found]

    def _opened(self) -> Any:
        """Return the page, with all of its modules."""
        if self._page is None:
            folder = packages()
            page = self._browser.enter_context(chromium()).new_page()
            page.set_default_timeout(WAIT_MS)
            page.route("**/*", lambda route: _answer(route, folder))
            page.goto(ADDRESS)
            page.wait_for_function("() => window.render")
            self._page = page
        return self._page

    def close(self) -> None:
        """Close the browser."""
        self._browser.close()
        self._page = None


def packages() -> Path:
    """Return the folder of the packages, or raise ExecutorUnavailable."""
    npm = shutil.which("npm")
    asked = [npm, "root", "--global"] if npm else ["true"]
    root = subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    folders = [*filter(None, os.environ.get("NODE_PATH", "").split(os.pathsep)), *([root] if root else [])]
    for folder in map(Path, folders):
        if all((folder / path).exists() for path in MODULES.values()):
            return folder
    names = "three three-mesh-bvh three-gpu-pathtracer"
    raise ExecutorUnavailable(f"no package {NAME}; npm install --global {names}")


def _answer(route: Any, folder: Path) -> None:
    """Answer a request of the page: by itself, by a file of the packages, or not at all."""
    asked = route.request.url
    path = (folder / asked.removeprefix(ADDRESS)).resolve()
    if asked == ADDRESS:
        route.fulfill(body=PAGE, content_type="text/html")
    elif asked.startswith(ADDRESS) and path.is_relative_to(folder.resolve()) and path.is_file():
        route.fulfill(body=path.read_bytes(), content_type="text/javascript")
    elif asked.startswith(("data:", "blob:")):
        route.continue_()
    else:
        route.abort()


def _picture(text: str, size: int) -> Any:
    """Return the colour (H, W, 3) of a target, its rows from above."""
    found = np.frombuffer(base64.b64decode(text), "<f4").reshape(size, size, 4)
    return found[::-1, :, :3].copy()
