"""Data classes as parameters of a command: the command line fills one in, with an option for each field.

A command passes such a request on as it is. One that several commands share is defined once. Options that
mean nothing beside others are found by their defaults [`given`] and refused [`refuse`].
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterable, Mapping
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

    profile: str = options.option("profile", "ieee")
    schedule: str | None = options.option(
        "NAME  Kernel schedule: [bold]plain[/] is human-readable, the others are faster."
    )
    variant: str | None = options.option(
        "NAME  Cheaper network: [bold]full[/], or any of without-FEATURE, windowN, hiddenN, rankN and sineN "
        "joined by +, as in window8+rank16; or whole8, an 8-bit integer network, bit-identical on every "
        "device. [default: full]"
    )

    def network(self, rank: int = 0) -> str:
        """Return the variant's name, which may be given as a rank instead."""
        from ...compiler.variants import FULL, with_rank

        return with_rank(self.variant or FULL, rank)

    def plan(self, model: Model, language: Language | str) -> Plan:
        """Return the plan of a model's kernel in a language."""
        from ...compiler.schedules.schedules import PLAIN
        from ...compiler.variants import plan_model

        return plan_model(model, language, self.profile, self.schedule or PLAIN, self.network())


def given(request: Any, *names: str) -> dict[str, object]:
    """Return the values of fields, of all without names, that are not their defaults, by option."""
    found = {}
    for each in _parameters(type(request), dataclasses.fields(type(request))):
        value = getattr(request, each.name)
        if value != each.default and each.name in (names or (each.name,)):
            # In an annotation the name of an option is where a default would be.
            named = each.annotation.__metadata__[0].default
            found[named if isinstance(named, str) else f"--{each.name.replace('_', '-')}"] = value
    return found


def refuse(values: Mapping[str, object], rule: str, remedy: str = "leave it out") -> None:
    """Refuse options that are given though they mean nothing."""
    for option, value in values.items():
        if value is not None:
            raise InputError(option, value, rule, remedy)


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command for typer: each parameter that is a data class becomes a parameter for each field."""
    requests: dict[str, Any] = {}
    parameters: list[inspect.Parameter] = []
    for each in _parameters(command, inspect.signature(command).parameters.values()):
        if dataclasses.is_dataclass(each.annotation):
            requests[each.name] = each.annotation
            parameters += _parameters(each.annotation, dataclasses.fields(each.annotation))
        else:
            parameters.append(each)

    def run(**values: Any) -> None:
        for name, kind in requests.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in dataclasses.fields(kind)})
        command(**values)

    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    return run


def _parameters(of: Any, declared: Iterable[Any]) -> list[inspect.Parameter]:
    """Return the fields of a data class, or the parameters of a function, with annotations for typer."""
    hints, found = get_type_hints(of, include_extras=True), []
    for each in declared:
        kind, field = hints[each.name], each.default if isinstance(each, inspect.Parameter) else each
        default = field
        if isinstance(field, dataclasses.Field):
            kind = Annotated[kind, field.metadata["option"]] if field.metadata else kind
            default = inspect.Parameter.empty if field.default is dataclasses.MISSING else field.default
        found.append(
            inspect.Parameter(each.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        )
    return found
