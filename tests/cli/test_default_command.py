"""A command with commands of its own: what names none of them is its own line, with all its messages."""

import pytest
import typer

from wamnet.cli.common.default_command import CommandWithOthers

app = typer.Typer(rich_markup_mode=None, context_settings={"help_option_names": ["-h", "--help"]})
both = typer.Typer(cls=CommandWithOthers, invoke_without_command=True)


@app.callback()
def root() -> None:
    """Do nothing before a command."""


@both.callback(help="Measure all.")
def measure(model: str = typer.Argument("usual"), size: int = 1) -> None:
    """Say what it was given."""
    typer.echo(f"all {model} {size}")


@both.command("part", help="Measure a part.")
def part(size: int = 2) -> None:
    """Say what it was given."""
    typer.echo(f"part {size}")


app.add_typer(both, name="measure")


@pytest.fixture
def run(capsys):
    """Give a function that runs a line and returns what it prints, an error too."""

    def one(line: str) -> str:
        with pytest.raises(SystemExit):
            app(line.split(), prog_name="x")
        return "".join(capsys.readouterr()).strip()

    return one


@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("measure", "all usual 1"),
        ("measure mine", "all mine 1"),
        ("measure mine --size 3", "all mine 3"),
        ("measure --size 3 mine", "all mine 3"),
        ("measure ./part", "all ./part 1"),
        ("measure --size 3 part", "all part 3"),
        ("measure part", "part 2"),
        ("measure part --size 4", "part 4"),
    ],
)
def test_the_first_argument_decides(run, line, printed) -> None:
    assert run(line) == printed


@pytest.mark.parametrize(
    ("line", "command", "message"),
    [
        ("measure mine other", "x measure", "Got unexpected extra argument"),
        ("measure --sise 3", "x measure", "No such option: --sise"),
        ("measure --size many", "x measure", "Invalid value for '--size'"),
        ("measure part other", "x measure part", "Got unexpected extra argument"),
        ("measure part --sise 3", "x measure part", "No such option: --sise"),
    ],
)
def test_what_is_wrong_is_said_with_the_command(run, line, command, message) -> None:
    text = run(line)
    assert text.startswith(f"Usage: {command} [OPTIONS]")
    assert message in text


@pytest.mark.parametrize("option", ["--help", "-h"])
def test_the_help_has_options_and_commands(run, option) -> None:
    text = run(f"measure {option}")
    assert all(word in text for word in ("Measure all.", "--size", "part", "Measure a part."))
    assert "Usage: x measure part [OPTIONS]" in run(f"measure part {option}")
