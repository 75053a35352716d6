"""Data classes as parameters of a command: the command line fills one in, with an option for each field.

A command passes such a request on as it is. One that several commands share is defined once. Options that
mean nothing beside others are found by their defaults [`given`] and refused [`refuse`].
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

from ...refimpl.errors import InputError
from . import options

if TYPE_CHECKING:
    from ...compiler.plan import Plan
    from ...compiler.targets import Language
    from ...refimpl.network.denoise import Model


@dataclasses.dataclass(frozen=True)
class KernelRequest:
    """How a network is compiled; None for the usual schedule and for the full network."""

    profile: options.Profile = "ieee"
    schedule: options.Schedule = None
    variant: options.Variant = None

    def network(self, rank: int = 0) -> str:
        """Return the variant's name, which may be given as a rank instead."""
        from ...compiler.kernel.interface import FULL

        if not rank:
            return self.variant or FULL
        from ...compiler.variants import with_rank

        return with_rank(self.variant or FULL, rank)

    def plan(self, model: Model, language: Language | str) -> Plan:
        """Return the plan of a model's kernel in a language."""
        from ...compiler.schedules.schedules import PLAIN
        from ...compiler.variants import plan_model

        return plan_model(model, language, self.profile, self.schedule or PLAIN, self.network())


def given(request: Any, *names: str) -> dict[str, object]:
    """Return the values of fields, of all without names, that are not their defaults, by option."""
    found = {}
    for field, kind in fields_of(type(request)):
        value = getattr(request, field.name)
        if value != field.default and field.name in (names or (field.name,)):
            # In an annotation the name of an option is where a default would be.
            named = kind.__metadata__[0].default
            found[named if isinstance(named, str) else f"--{field.name.replace('_', '-')}"] = value
    return found


def fields_of(kind: Any) -> list[tuple[dataclasses.Field[Any], Any]]:
    """Return the fields of a data class, each with its annotation for typer."""
    hints = get_type_hints(kind, include_extras=True)
    return [
        (each, Annotated[hints[each.name], each.metadata["option"]] if each.metadata else hints[each.name])
        for each in dataclasses.fields(kind)
    ]


def refuse(values: Mapping[str, object], rule: str, remedy: str = "leave it out") -> None:
    """Refuse options that are given though they mean nothing."""
    for option, value in values.items():
        if value is not None:
            raise InputError(option, value, rule, remedy)


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
        requests[each.name] = kind, [field.name for field in dataclasses.fields(kind)]
        for field, annotation in fields_of(kind):
            needed = field.default is dataclasses.MISSING
            add(field.name, inspect.Parameter.empty if needed else field.default, annotation)

    def run(**values: Any) -> None:
        for name, (kind, names) in requests.items():
            values[name] = kind(**{field: values.pop(field) for field in names})
        command(**values)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    return run
