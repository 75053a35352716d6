"""Cells: code of a page that is executed when the site is built, so that what it shows is what it gives.

1. A fence that opens with ```` ```python cell ```` is a cell; the cells of a page share one namespace, in
   their order [`executed`]. Other fences are only shown.
2. What a cell prints stands below it. `show(figure, "what is seen")` puts a Matplotlib figure or a picture
   (H, W, 3) or (H, W) with values in [0, 1] there, with its alternative text.
3. `task(4)` prints what lab 4 leaves to write [tasks.py]; a cell that only does this is not shown itself.
4. A cell that raises stops the build, with page and line.
"""

from __future__ import annotations

import base64
import contextlib
import io
import re
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np
import tasks
from mkdocs.exceptions import PluginError

CELL = re.compile(r"^```python cell\n(.*?)^```$", re.MULTILINE | re.DOTALL)
"""A cell: the fence and its code."""

DOTS_PER_INCH = 110
"""Resolution of plots: sharp enough on a screen, small enough for a page."""

WIDEST_PX = 640
"""Pictures are magnified by an integer to at most this width, so that their pixels are visible."""


@dataclass
class Output:
    """What a cell leaves below itself: pieces of HTML."""

    pieces: list[str] = field(default_factory=list)

    def show(self, what: Any, alternative: str) -> None:
        """Put a figure or a picture below the cell; `alternative` says what is seen in words."""
        if not alternative.strip():
            raise ValueError("show: a picture needs an alternative text; say what is seen")
        data = _png(what)
        address = "data:image/png;base64," + base64.b64encode(data).decode()
        kind = "shown" if hasattr(what, "savefig") else "shown pixels"
        self.pieces.append(f'<img class="{kind}" alt="{escape(alternative)}" src="{address}">')


def executed(text: str, where: str, on_cell: Callable[[int], None] | None = None) -> str:
    """Return a page's Markdown with the output of its cells below them; `where` names it in errors."""
    # A dataclass in a cell asks for the module that it is in: it has the page's name, and is not there.
    namespace: dict[str, Any] = {"__name__": "__main__"}

    def cell(match: re.Match[str]) -> str:
        line = text.count("\n", 0, match.start()) + 2
        if on_cell:
            on_cell(line)
        output = _run(match[1], f"{where}:{line}", namespace)
        shown = "" if match[1].startswith("task(") else f"```python\n{match[1]}```\n"
        return f'{shown}\n<div class="output">\n{output}\n</div>\n' if output else shown

    return CELL.sub(cell, text)


def _run(code: str, place: str, namespace: dict[str, Any]) -> str:
    """Return the HTML of what a cell prints and shows."""
    output, printed = Output(), io.StringIO()
    namespace |= {"show": output.show, "task": tasks.task}
    try:
        with contextlib.redirect_stdout(printed):
            exec(compile(code, place, "exec"), namespace)
    except Exception as error:
        lines = [
            str(frame.lineno)
            for frame in traceback.extract_tb(error.__traceback__)
            if frame.filename == place
        ]
        at = f"line {lines[-1]} of the cell" if lines else "the cell"
        raise PluginError(f"{place}: {at} raises {type(error).__name__}: {error}") from error
    texts = [f'<pre tabindex="0">{escape(printed.getvalue())}</pre>'] if printed.getvalue() else []
    return "\n".join(texts + output.pieces)


def _png(what: Any) -> bytes:
    """Return a figure or a picture as the bytes of a PNG file."""
    buffer = io.BytesIO()
    if hasattr(what, "savefig"):
        what.savefig(
            buffer, format="png", dpi=DOTS_PER_INCH, bbox_inches="tight", metadata={"Software": None}
        )
        import matplotlib.pyplot as plt

        plt.close(what)
    else:
        from PIL import Image

        picture = np.asarray(what, np.float64)
        levels = np.floor(255.0 * np.clip(picture, 0.0, 1.0) + 0.5).astype(np.uint8)
        factor = max(1, WIDEST_PX // levels.shape[1])
        levels = np.repeat(np.repeat(levels, factor, axis=0), factor, axis=1)
        Image.fromarray(levels).save(buffer, format="png")
    return buffer.getvalue()
