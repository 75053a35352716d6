"""Reports and pages from templates: each is a file in the folder `templates`, filled with data."""

from functools import cache
from pathlib import Path
from typing import Any

import jinja2

TEMPLATES = Path(__file__).parent / "templates"
"""The folder."""

NONE = "–"
"""What is printed where there is no number."""


def number(value: float | None, form: str = ".3g") -> str:
    """Return a number as it is printed, a dash where there is none; a sign only if a digit is not 0."""
    if value is None:
        return NONE
    text = f"{value:,.0f}" if form.endswith("g") and abs(value) >= 1000 else format(value, form)
    return text[1:] if form.startswith("+") and not float(text) else text


@cache
def _environment() -> jinja2.Environment:
    """Return the templates, of which those of HTML escape what is filled in."""
    found = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=lambda name: name is not None and ".html" in name,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    found.filters["number"] = number
    return found


def filled(name: str, **values: Any) -> str:
    """Return the text of a template with values."""
    text: str = _environment().get_template(name).render(values)
    return text
