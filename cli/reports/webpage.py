"""One HTML file that path-traces a scene and denoises it in the reader's browser [`build_page`].

1. The scene at the times of its animation [`animation_of`]; one that time does not change is still.
2. Kernels, weights and numbers come from kernels/run/page.py, as JSON in the page.
3. The page is a template with one style sheet and some scripts beside it [`SCRIPTS`], which are put into it
   as they are: nothing is built, nothing is fetched; its Content-Security-Policy forbids it to.
"""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...kernels.run.page import Animation, compiler, networks_of, page_data
from ...models.data.scene_source import scene_source
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.network.denoise import Model
from ..common import options
from ..common.inputs import learned_scene, load_model, load_scene
from ..common.packages import need
from .pages import TEMPLATES, filled

SCRIPTS = (
    "page.scene.js",
    "page.device.js",
    "page.processor.js",
    "page.renderer.js",
    "page.reference.js",
    "page.main.js",
)
"""The page's scripts, in the order in which they are joined to one module."""

FRAMES = 240
"""Moments of an animation that a page can show: eight seconds, 30 a second."""

FPS = 30.0
"""Moments a second. They are half a step beside integers, since some scenes are laid out otherwise at time 0,
where their boxes are parallel to the axes."""


def build_page(animation: Animation, model: Model, fast: Model | None = None) -> str:
    """Return the page of an animation and a model; `fast` is a model for the variants of low rank."""
    networks = networks_of(model, fast, processor=bool(compiler()) and not model.is_whole)
    return render_page(page_data(animation, networks))


def page_of(model: Path, scene: str | None, assignments: Sequence[str], fast: Path | None) -> str:
    """Return the page of files and names as a command is given them."""
    need("jinja2", "for web pages")
    network = load_model(model)
    name = scene or learned_scene(network)
    return build_page(animation_of(name, assignments), network, load_model(fast) if fast else None)


def animation_of(name: str, assignments: Sequence[str] = ()) -> Animation:
    """Return a canonical scene at the times of a page, or the scene in a file, which is still."""
    still = scene_source(name, options.parse_parameters(assignments)).still
    if still is not None:
        return Animation((0.0,), (still,))
    if "time" in options.parse_parameters(assignments):
        rule = "does not apply: a page shows all times of a canonical scene"
        raise InputError("parameter time", NO_VALUE, rule, "leave it out, or give a scene file")
    times = tuple((number + 0.5) / FPS for number in range(FRAMES))
    scenes = tuple(load_scene(name, time, assignments) for time in times)
    if len({repr(replace(scene, info={})) for scene in scenes}) == 1:
        return Animation(times[:1], scenes[:1])
    return Animation(times, scenes)


def render_page(data: dict[str, Any]) -> str:
    """Return the page that shows such data."""

    def part(name: str) -> str:
        return (TEMPLATES / name).read_text(encoding="utf-8")

    # In a script element nothing but its end tag and <!-- mean anything: JSON can do without the sign.
    # The indentation of sources would be a twelfth of a page.
    text = re.sub(r"\\n +", r"\\n", json.dumps(data, allow_nan=False)).replace("<", "\\u003c")
    return filled(
        "page.html.jinja",
        title=f"{data['scene'].replace('_', ' ').capitalize()}, path-traced and denoised live",
        style=part("page.css"),
        script="\n".join(part(name) for name in SCRIPTS),
        data=text,
    )
