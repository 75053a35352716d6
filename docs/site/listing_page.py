"""The page that sets kernels beside the reference: left the NumPy lines, right what became of them.

1. A small network and a small scene are compiled, their programs with the places that they came from
   [`network_listing`], [`scene_listing`].
2. A line of a kernel belongs to the line of the shown function that led to it, directly or through what it
   called; both have one colour, and its number leads from one to the other [`shown`].
3. Pointing at a line, or moving to it with the keyboard, marks its partners (assets/listing.js).
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from sources import coloured

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.listing import Line, lines_of, within
from wamnet.compiler.core.lower import lower
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import language_named
from wamnet.refimpl.light import transport
from wamnet.refimpl.light.scene import Camera, Light, Quad, Scene, Sphere
from wamnet.refimpl.light.shapes import sphere
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import denoise, siren
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.window import Window

ROOT = Path(siren.__file__).parents[2]
"""The folder whose places are shown."""

MARK = "<p>LISTING {}</p>"
"""The place of a listing on its page."""

COLOURS = 6
"""Colours that lines take in turn, in style.css."""


def network_listing(target: str) -> list[Line]:
    """Return the kernel of a small denoiser: 2 x 2 pixels, four sines, the target's own sine."""
    network = siren.init([12, 4, 3], 2.0, 2.0, seed=5, dtype=np.float32)
    model = denoise.Model(network, ("color",), Window(2), Normalization())
    kernel = compile_program(lower(model, keep_places=True), language_named(target).under("native"))
    return lines_of(kernel.source, {"": kernel.programs})


def scene_listing(target: str) -> list[Line]:
    """Return the path kernel of a sphere on a plane under a light."""
    scene = Scene(
        "ball",
        Camera((0.0, 1.0, 5.0), (0.0, 0.5, 0.0)),
        spheres=(Sphere((0.0, 1.0, 0.0), 1.0, (0.8, 0.4, 0.2)),),
        quads=(Quad((-5.0, 0.0, -5.0), (0.0, 0.0, 10.0), (10.0, 0.0, 0.0), (0.6, 0.6, 0.6)),),
        lights=(Light((-1.0, 4.0, -1.0), (2.0, 0.0, 0.0), (0.0, 0.0, 2.0), (1.0, 1.0, 1.0), 20.0),),
    )
    programs = lower_scene(scene, Settings(), keep_places=True)
    kernel = compile_path(programs, language_named(target).under("native"), groups=("color",))
    return lines_of(kernel.source, kernel.programs.parts)


def listings() -> Iterator[tuple[str, str]]:
    """Yield the name of each listing, and its HTML."""
    for target in ("opencl", "opengl"):
        yield f"network-{target}", shown(siren.forward, network_listing(target), f"network-{target}")
    scene = scene_listing("opencl")
    for name, function, part in (
        ("sphere", sphere.sphere_distance, "arrive"),
        ("bounce", transport.scatter, "scatter"),
    ):
        yield name, shown(function, [line for line in scene if line.part == part], name, part != "scatter")


def shown(function: Callable[..., Any], lines: list[Line], name: str, only: bool = False) -> str:
    """Return the HTML of a function beside the lines of a kernel; `only`: no others."""
    source, first = inspect.getsourcelines(function)
    file = Path(inspect.getfile(function))
    path = file.relative_to(ROOT).as_posix()
    last = first + len(source) - 1
    rows = []
    for line in lines:
        own = next((place for place in line.places if within(place, path, first, last)), "")
        number = int(own.rpartition(":")[2]) if own else 0
        if line.text.strip() and (number or not only):
            rows.append((number, line.text))
        if line.text == " */":
            rows.clear()  # the comment at the kernel's head
    used = sorted({number for number, _ in rows if number})
    colours = {number: index % COLOURS for index, number in enumerate(used)}
    left = "".join(
        _row(number, html, colours.get(number), number, name, f"{name}-{number}" if number in colours else "")
        for number, html in enumerate(coloured("".join(source).rstrip("\n")), first)
    )
    right = "".join(
        _row(number, escape(text), colours.get(number), number, name, "") for number, text in rows
    )
    return (
        f'<div class="listing"><div class="highlight"><p><code>{path}: {function.__name__}</code></p>'
        f'<pre tabindex="0">{left}</pre></div>'
        f'<div><p>What the kernel has of it</p><pre tabindex="0">{right}</pre></div></div>'
    )


def _row(number: int, html: str, colour: int | None, line: int, name: str, anchor: str) -> str:
    """Return a row of a listing: its number, and its text on the colour of its line."""
    if colour is None:
        shown_number = str(line) if line else ""
        return f'<span class="row"><span class="number">{shown_number}</span>{html}\n</span>'
    place = f' id="{anchor}"' if anchor else ""
    number_link = f'<a class="number" href="#{name}-{number}">{number}</a>'
    return f'<span class="row colour{colour}" data-line="{name}-{number}"{place}>{number_link}{html}\n</span>'


def page(html: str) -> str:
    """Return the page's HTML with its listings in their places."""
    for name, listing in listings():
        mark = MARK.format(name)
        assert html.count(mark) == 1, f"docs/listing.md: no place for the listing {name}"
        html = html.replace(mark, listing)
    return html
