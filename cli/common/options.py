"""The options that several commands share, each defined once, and the parsing of their values.

Ranges are not repeated here: what a number may be is said by the function of the reference that takes it.
"""

from __future__ import annotations

import colorsys
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from ...refimpl.errors import InputError

if TYPE_CHECKING:
    from ...refimpl.light.scene import Scene, Vector

SCENES = "minicubes, glossy, vitrine, daylight, cornell, furnace, lone_light, empty"
"""Canonical scenes by name, for help texts; equal to the registry in refimpl, which they do not import."""

MODELS = "minicubes, cornell, glossy, minicubes-basic, cornell-basic, glossy-basic"
"""Names of the models that ship with the package, for help texts; equal to the files in models."""

LARGEST_EXPOSURE_STOPS = 64.0
"""Brightest and darkest exposure: a factor of 2**64; far past it float32 ends."""


def _finite(value: float | None) -> float | None:
    """Refuse a time that is not a number."""
    if value is not None and not math.isfinite(value):
        raise InputError("--time", value, "must be finite", "give seconds, for example --time 2.5")
    return value


def _context(command: typer.Context, value: ContextName | None) -> ContextName | None:
    """Let this command, and the processes that it starts, open OpenGL in this way."""
    from ...kernels.devices.registry import CONTEXT_VARIABLE

    if value is None:
        return None
    before = os.environ.get(CONTEXT_VARIABLE)
    os.environ[CONTEXT_VARIABLE] = value

    def restore() -> None:
        """Leave the environment as it was."""
        if before is None:
            os.environ.pop(CONTEXT_VARIABLE, None)
        else:
            os.environ[CONTEXT_VARIABLE] = before

    command.call_on_close(restore)
    return value


def _stops(value: float) -> float:
    """Refuse an exposure that is not a number or that leaves no picture."""
    if not abs(value) <= LARGEST_EXPOSURE_STOPS:
        rule = f"must be from {-LARGEST_EXPOSURE_STOPS:g} to {LARGEST_EXPOSURE_STOPS:g} stops"
        raise InputError("--exposure", value, rule, "for example --exposure 1")
    return value


class ExecutorName(str, Enum):
    """What runs a kernel; equal to the registry in kernels, which is not imported for a help text."""

    numpy = "numpy"
    opencl = "opencl"
    opengl = "opengl"
    c = "c"


ContextName = Literal["egl", "osmesa"]
"""How OpenGL [kernels/devices/opengl_executor.py] gets a context: with no display, or in main memory."""

ExecutorChoice = Literal["auto", "numpy", "opencl", "opengl", "c"]
"""An executor, or the fastest that is available."""

TrainerName = Literal["auto", "numpy", "opencl"]
"""What trains: the reference, its steps compiled, or the faster one of those available."""

Target = Literal["opencl", "glsl", "c"]
"""Languages that a model is compiled to."""

FloatType = Literal["float32", "float64"]
"""Element types of the reference's arithmetic."""

Sampler = Literal["pcg4d", "sobol"]
"""Sources of random numbers by name; equal to the registry in refimpl."""

Preset = Literal["best", "mirrors", "shadows", "paper", "short", "sky"]
"""Training protocols by name; equal to the registry in refimpl."""


def option(default: Any, text: str, *names: str, **how: Any) -> Any:
    """Return a field of a request [`request.spread`]: an option, called as the field unless it has names."""
    return field(default=default, metadata={"option": typer.Option(*names, help=text, **how)})


def output(metavar: str, what: str, default: str | bool = True) -> Any:
    """Return the option of what a command writes; `default` is shown in place of the parameter's."""
    return typer.Option("-o", "--output", metavar=metavar, help=what, show_default=default)


def names(what: str, default: str | bool = True, metavar: str = "NAME,...") -> Any:
    """Return an option whose text is names with commas [`parse_names`], called as its parameter."""
    return typer.Option(metavar=metavar, help=what, show_default=default)


EXECUTOR_VARIABLE = "WAMNET_EXECUTOR"
"""Environment variable that names the executor where the caller does not, for results that must not depend on
the machine."""

Executor = Annotated[
    ExecutorChoice,
    typer.Option(
        "--executor",
        envvar=EXECUTOR_VARIABLE,
        help="Backend that runs the kernel: [bold]auto[/] is the fastest that [bold]wamnet "
        "executors[/] lists.",
    ),
]
Renderer = Annotated[
    ExecutorChoice,
    typer.Option(
        envvar=EXECUTOR_VARIABLE,
        help="Backend that traces the paths: [bold]auto[/] is the fastest available.",
    ),
]
OpenGLContext = Annotated[
    ContextName | None,
    typer.Option(
        "--context",
        callback=_context,
        help="OpenGL context: [bold]egl[/] needs no display; [bold]osmesa[/] renders in main memory.",
        show_default="the first one available, or WAMNET_OPENGL_CONTEXT",
    ),
]
Exposure = Annotated[
    float,
    typer.Option("--exposure", callback=_stops, help="Exposure in stops; +1 doubles the brightness."),
]
ModelFile = Annotated[
    Path, typer.Argument(metavar="MODEL", help=f"Trained model (.safetensors), or bundled model ({MODELS}).")
]
Profile = Annotated[
    str,
    typer.Option(
        "--profile",
        help="Numerical profile: [bold]ieee[/] has its own sine and a proven error bound, "
        "[bold]ieee-sine7[/] a sine of degree 7 (3 to 13), [bold]native[/] uses the target's sine.",
    ),
]
Trainer = Annotated[
    TrainerName,
    typer.Option(
        "--executor",
        envvar=EXECUTOR_VARIABLE,
        help="Backend that trains: numpy is the reference, opencl a compiled training step; "
        "[bold]auto[/] is the fastest available.",
    ),
]
ActivationName = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="Hidden-layer activation: sine or relu.",
        show_default="the preset's: sine",
    ),
]
CutRank = Annotated[
    int,
    typer.Option(
        "--rank",
        metavar="R",
        help="Short for --variant rankR: reduce the first layer to rank R and run it as two passes, "
        "rows then columns. Loses little quality after fine-tuning.",
        show_default="no cut",
    ),
]
Variant = Annotated[
    str | None,
    typer.Option(
        "--variant",
        metavar="NAME",
        help="Cheaper network: [bold]full[/], or any of without-FEATURE, windowN, hiddenN, rankN "
        "and sineN joined by +, as in window8+rank16; or whole8, an 8-bit integer network, "
        "bit-identical on every device.",
        show_default="full",
    ),
]
Here = Annotated[
    bool,
    typer.Option(
        "--here", help="Use the best schedule for this machine: the tuned one, or else the built-in choice."
    ),
]
Schedule = Annotated[
    str | None,
    typer.Option(
        "--schedule",
        metavar="NAME",
        help="Kernel schedule: [bold]plain[/] is human-readable, the others are faster.",
    ),
]
Seed = Annotated[int, typer.Option("--seed", help="Random seed.")]
Time = Annotated[
    float | None,
    typer.Option("--time", callback=_finite, help="Time in the animation, in seconds.", show_default="0"),
]
Parameters = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        help="Parameter of a canonical scene: one number, or three separated by commas. Repeatable.",
    ),
]
SamplerName = Annotated[
    Sampler,
    typer.Option(
        "--sampler",
        help="Sampler: independent (pcg4d) or low-discrepancy (sobol), with less noise at many samples.",
    ),
]
FeatureSpp = Annotated[
    int,
    typer.Option(
        "--feature-spp",
        metavar="N",
        help="Stratified camera rays per pixel for the features; 4 give smooth edges, and each "
        "costs a fraction of a path.",
        show_default="same as --spp",
    ),
]
ShadowRays = Annotated[
    int,
    typer.Option(
        "--shadow-rays",
        metavar="N",
        help="Also write the layer direct: direct light with its soft shadows, by N shadow rays per camera "
        "ray.",
    ),
]
Seen = Annotated[
    bool,
    typer.Option(
        "--seen",
        help="Also write specular features, traced through mirrors and glass: seen_albedo, seen_normal, ...",
    ),
]
SceneName = Annotated[
    str, typer.Argument(metavar="SCENE", help=f"Canonical scene ({SCENES}) or scene file (.json).")
]


def parse_parameters(texts: Sequence[str]) -> dict[str, float | tuple[float, ...]]:
    """Return parameters of a scene from texts like `albedo=0.8` and `warm=1,0.5,0.2`."""
    parameters: dict[str, float | tuple[float, ...]] = {}
    for text in texts:
        name, sign, value = text.partition("=")
        try:
            numbers = tuple(float(part) for part in value.split(","))
        except ValueError:
            numbers = ()
        if not sign or len(numbers) not in (1, 3):
            rule = "must be NAME=NUMBER or NAME=NUMBER,NUMBER,NUMBER"
            raise InputError("--set", text, rule, "for example --set albedo=0.8")
        if not all(map(math.isfinite, numbers)):
            raise InputError("--set", text, "must have finite numbers", "for example --set albedo=0.8")
        parameters[name.strip()] = numbers if len(numbers) > 1 else numbers[0]
    return parameters


def parse_limits(option: str, text: str) -> tuple[float, float]:
    """Return the two numbers of a text like `-24:24`, or refuse it."""
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise InputError(option, text, "must be LOW:HIGH", f"for example {option}=-24:24") from None
    return low, high


@dataclass(frozen=True)
class View:
    """What is asked of camera and lamps: degrees, a factor of the distance, texts like `1=1,0.5,0.2`."""

    yaw_deg: float = option(0.0, "Orbit the camera around its target, in degrees.", "--yaw", metavar="DEG")
    pitch_deg: float = option(
        0.0,
        "Raise the camera around its target, in degrees (negative: lower it).",
        "--pitch",
        metavar="DEG",
    )
    distance: float = option(1.0, "Scale the camera distance; 2 moves it twice as far away.", metavar="X")
    lights: list[str] | None = option(
        None,
        "Hue and saturation of light N (from 1), in linear RGB; its brightness is unchanged. Repeatable.",
        "--light",
        metavar="N=R,G,B",
        show_default="as in the scene",
    )

    def of(self, scene: Scene) -> Scene:
        """Return the scene from there and under these lamps; its info says so."""
        from ...refimpl.light.variation import Variation, varied

        colors = parse_lights(self.lights or (), [light.color for light in scene.lights])
        return varied(scene, Variation(self.yaw_deg, self.pitch_deg, self.distance, colors))


def parse_lights(texts: Sequence[str], own: Sequence[Vector]) -> tuple[Vector, ...]:
    """Return the lamps' colours from texts like `1=1,0.5,0.2`, as bright as their own; none without texts."""
    from ...refimpl.light.variation import lamp_color

    colors = dict(enumerate(own, start=1))
    chosen: set[int] = set()
    for text in texts:
        number, color = _parse_light(text)
        if number not in colors:
            rule = f"the scene's lights are 1 to {len(own)}" if own else "the scene has no lights"
            raise InputError("--light", text, rule, "choose another" if own else "leave it out")
        if number in chosen:
            raise InputError("--light", text, f"light {number} already has a colour", "give one per light")
        chosen.add(number)
        hue, saturation, _ = colorsys.rgb_to_hsv(*color)
        colors[number] = lamp_color(own[number - 1], hue, saturation)
    return tuple(colors.values()) if texts else ()


def _parse_light(text: str) -> tuple[int, Vector]:
    """Return a lamp's number and its colour."""
    number, _, value = text.partition("=")
    try:
        red, green, blue = (float(part) for part in value.split(","))
        found = int(number)
    except ValueError:
        rule = "must be N=R,G,B: a light's number and its colour"
        raise InputError("--light", text, rule, "for example --light 1=1,0.4,0.2") from None
    color = (red, green, blue)
    if not (all(map(math.isfinite, color)) and min(color) >= 0.0 and max(color) > 0.0):
        rule = "its channels must be finite, 0 or more, and not all 0"
        raise InputError("--light", text, rule, "for example --light 1=1,0.4,0.2")
    return found, color


def parse_names(text: str) -> tuple[str, ...]:
    """Return names that are separated by commas."""
    return tuple(part.strip() for part in text.split(",") if part.strip())


def refuse_given(context: typer.Context, names: Sequence[str], where: str) -> None:
    """Refuse arguments and options that were given on the command line and have no meaning."""
    typed = {each.name: each.opts[-1] for each in context.command.params}
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name not in ("DEFAULT", "ENVIRONMENT"):
            shown = typed[name] if typed[name].startswith("-") else name.upper()
            raise InputError("argument", shown, f"has no meaning {where}", "leave it out")
