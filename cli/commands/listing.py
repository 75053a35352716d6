"""`wamnet listing`: a kernel, and above its lines those of the reference that they came from."""

from pathlib import Path

from ...compiler.compile import compile_program
from ...compiler.core.listing import Line, as_text, lines_of
from ...compiler.core.lower import lower
from ...compiler.scenes.lower_scene import lower_scene
from ...compiler.scenes.path_kernel import compile_path
from ...compiler.targets import Language, language_named
from ...refimpl.light.transport import Settings
from ..common import options
from ..common.inputs import load_model, load_scene
from ..common.options import Target, argument, option
from ..common.terminal import say
from ..files.outputs import check_output, write_text
from .compile import is_scene


def listing(
    model: str = argument("MODEL  Trained model (.safetensors), canonical scene or scene file (.json)."),
    target: Target = option("Target language.", ...),
    output: Path | None = option("-o --output FILE  Output file. [default: the terminal]"),
    profile: options.Profile = "ieee",
) -> None:
    """Print a kernel interleaved with the lines of the reference that it came from.

    Denoisers use the plain schedule; scenes trace one path at a time. Only -o writes a file.

    Examples:
    wamnet listing model.safetensors --target glsl
    wamnet listing minicubes --target opencl --profile native -o minicubes.txt
    """
    if output is not None:
        check_output(output, inputs=[Path(model)])
    text = as_text(_lines(model, language_named(target), profile), _reference)
    if output is None:
        for line in text.rstrip("\n").split("\n"):
            say(line)
    else:
        write_text(output, text)
        say(str(output))


def _lines(model: str, language: Language, profile: str) -> list[Line]:
    """Return the lines of the kernel of a model or a scene, with their places."""
    if is_scene(model):
        scene = load_scene(model, None, [])
        programs = lower_scene(scene, Settings(), language.forms, keep_places=True)
        path_kernel = compile_path(programs, language, profile)
        return lines_of(path_kernel.source, path_kernel.programs.parts)
    program = lower(load_model(Path(model), imported=True), keep_places=True)
    kernel = compile_program(program, language, profile)
    return lines_of(kernel.source, {"": kernel.programs})


def _reference(place: str) -> str:
    """Return the text of a place, refimpl/network/siren.py:122."""
    path, _, line = place.rpartition(":")
    return (Path(__file__).parents[2] / path).read_text(encoding="utf-8").splitlines()[int(line) - 1]
