"""Parameters of commands as options: types and defaults are Python's, names and texts are in `options.ini`.

A parameter that is a data class has an option for each field [`spread`], and a command passes such a request
on as it is. One that several commands share is defined once. Options that mean nothing beside others are
found by their defaults [`given`] and refused [`refuse`].
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from configparser import ConfigParser, ExtendedInterpolation
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from ...refimpl.errors import InputError
from .options import CALLBACKS

if TYPE_CHECKING:
    from ...compiler.plan import Plan
    from ...compiler.targets import Language
    from ...refimpl.network.denoise import Model


TABLE = Path(__file__).parents[1] / "options.ini"
"""All commands and options, whose form is described there; another distribution has one beside its module."""

LINE = re.compile(r"(?:(\S.*?)  )?(.*?)((?: ?\[(?:default|env|panel|range): [^][]*\])*)")
"""A line of the table: names and metavar, the text, and what else is said of the option."""


@cache
def table(path: Path = TABLE) -> Mapping[str, Mapping[str, str]]:
    """Return the sections of a table by name, with those of the command's own table."""
    found = ConfigParser(interpolation=ExtendedInterpolation(), delimiters="=", comment_prefixes="#")
    found.optionxform = str  # type: ignore[assignment, method-assign]
    found.read([TABLE, path], encoding="utf-8")
    return {name: dict(section) for name, section in found.items()}


def texts_of(of: Any, path: str = "") -> Mapping[str, str]:
    """Return the lines about a data class, or about the function of the command `path`."""
    sections = table(Path(inspect.getfile(of)).with_name(TABLE.name))
    classes = [f"{each.__module__.rpartition('.')[2]}.{each.__name__}" for each in getattr(of, "__mro__", ())]
    found = dict(sections["shared"])
    for name in (*reversed(classes), path):
        found |= sections.get(name, {})
    return found


def _usage(line: str, name: str, default: Any) -> Any:
    """Return what typer has of an option, or an argument, from its line: `-o --output FILE  Model.`."""
    parts = LINE.fullmatch(line.replace("\n", " "))
    assert parts is not None, "everything in it may be missing"
    words, marks = (parts[1] or "").split(), dict(re.findall(r"\[(\w+): ([^][]*)\]", parts[3]))
    names = [word for word in words if word.startswith("-")]
    return (typer.Option if names or not words else typer.Argument)(
        *names,
        metavar=" ".join(words[len(names) :]) or None,
        help=parts[2] or None,
        show_default=marks.get("default", True),
        envvar=marks.get("env"),
        rich_help_panel=marks.get("panel"),
        callback=_within(names, name, default, **marks) if "range" in marks else CALLBACKS.get(name),
    )


def _within(names: Sequence[str], name: str, example: Any, **marks: str) -> Callable[[Any], Any]:
    """Return what refuses a number outside of its range, `1:64 pixels`, perhaps with an example: `, 8`."""
    limits, _, other = marks["range"].partition(", ")
    ends, _, unit = limits.partition(" ")
    low, high = ends.split(":")
    option = names[-1] if names else f"--{name.replace('_', '-')}"

    def check(value: Any) -> Any:
        if value is not None and not float(low) <= value <= float(high):
            rule = f"must be from {low} to {high} {unit}".rstrip()
            raise InputError(option, value, rule, f"for example {option} {other or example}")
        return value

    return check


@dataclasses.dataclass(frozen=True)
class KernelRequest:
    """How a network is compiled; None for the usual schedule and for the full network."""

    profile: str = "ieee"
    schedule: str | None = None
    variant: str | None = None

    def network(self, rank: int = 0) -> str:
        """Return the variant's name, which may be given as a rank instead."""
        from ...compiler.variants import FULL, with_rank

        return with_rank(self.variant or FULL, rank)

    def plan(self, model: Model, language: Language | str) -> Plan:
        """Return the plan of a model's kernel in a language."""
        from ...compiler.schedules.schedules import PLAIN
        from ...compiler.targets import language_named
        from ...compiler.variants import plan_model

        chosen = language_named(language).under(self.profile)
        return plan_model(model, chosen, self.schedule or PLAIN, self.network())


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


def spread(command: Callable[..., None], path: str = "") -> Callable[..., None]:
    """Return the command `path` for typer: a parameter that is a data class becomes one for each field."""
    requests: dict[str, Any] = {}
    parameters: list[inspect.Parameter] = []
    for each in _parameters(command, inspect.signature(command).parameters.values(), path):
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


def _parameters(of: Any, declared: Iterable[Any], path: str = "") -> list[inspect.Parameter]:
    """Return the fields of a data class, or the parameters of a function, with annotations for typer."""
    hints, lines, found = get_type_hints(of, include_extras=True), texts_of(of, path), []
    for each in declared:
        kind, default = hints[each.name], each.default
        default = inspect.Parameter.empty if default is dataclasses.MISSING else default
        if each.name in lines and not dataclasses.is_dataclass(kind):
            kind = Annotated[kind, _usage(lines[each.name], each.name, default)]
        found.append(
            inspect.Parameter(each.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        )
    return found
