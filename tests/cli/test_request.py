"""Data classes as parameters of a command: each field is an option, at its place among the others."""

import inspect
from dataclasses import dataclass
from typing import Annotated

import typer
from typer.testing import CliRunner

from wamnet.cli.common.request import spread


@dataclass(frozen=True)
class Size:
    """Two of the options below."""

    width: Annotated[int, typer.Option(help="Width.")]
    height: Annotated[int, typer.Option("--tall", help="Height.")] = 2


def test_fields_are_options_and_the_command_is_given_the_request() -> None:
    given: list[object] = []

    def command(name: str, *, size: Size, quick: Annotated[bool, typer.Option("--quick")] = False) -> None:
        given.append((name, size, quick))

    shown = spread(command)
    assert list(inspect.signature(shown).parameters) == ["name", "width", "height", "quick"]
    app = typer.Typer()
    app.command()(shown)
    outcome = CliRunner().invoke(app, ["a", "--width", "3", "--quick"])
    assert outcome.exit_code == 0
    assert given == [("a", Size(3, 2), True)]
    assert CliRunner().invoke(app, ["a"]).exit_code == 2
