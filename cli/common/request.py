"""Data classes as parameters of a command: the command line fills one in, with an option for each field.

A command passes such a request on as it is. One that several commands share is defined once.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from typing import Any, get_type_hints

from . import options


@dataclasses.dataclass(frozen=True)
class KernelRequest:
    """How a network is compiled; None for the usual schedule and for the full network."""

    profile: options.Profile = "ieee"
    schedule: options.Schedule = None
    variant: options.Variant = None


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command for typer: each parameter that is a data class becomes a parameter for each field."""
    requests: dict[str, tuple[Any, list[str]]] = {}
    parameters: list[inspect.Parameter] = []

    def add(name: str, default: Any, annotation: Any) -> None:
        kind = inspect.Parameter.KEYWORD_ONLY
        parameters.append(inspect.Parameter(name, kind, default=default, annotation=annotation))

    hints = get_type_hints(command, include_extras=True)
    for each in inspect.signature(command).parameters.values():
        kind = hints[each.name]
        if not dataclasses.is_dataclass(kind):
            add(each.name, each.default, kind)
            continue
        fields, own = dataclasses.fields(kind), get_type_hints(kind, include_extras=True)
        requests[each.name] = kind, [field.name for field in fields]
        for field in fields:
            needed = field.default is dataclasses.MISSING
            add(field.name, inspect.Parameter.empty if needed else field.default, own[field.name])

    def run(**values: Any) -> None:
        for name, (kind, names) in requests.items():
            values[name] = kind(**{field: values.pop(field) for field in names})
        command(**values)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    return run
