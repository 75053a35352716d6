"""`wamnet denoise` and `wamnet executors`: a model on a frame, and what there is to run it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...refimpl.errors import ExecutorUnavailable
from ..common import options
from ..common.domain import check_domain
from ..common.inputs import load_model
from ..common.options import ExecutorName
from ..common.terminal import say, table
from ..files.outputs import check_output

if TYPE_CHECKING:
    from ...refimpl.frame import Frame
    from ...refimpl.network.denoise import Model

DENOISE_EXAMPLES = """Examples:

wamnet denoise model.safetensors noisy.exr -o denoised.png

wamnet denoise minicubes noisy.exr -o denoised.png

wamnet denoise model.safetensors noisy.exr --executor opencl -o denoised.exr

wamnet denoise model.safetensors noisy.exr --executor opencl --variant window8+rank16

wamnet denoise model.safetensors noisy.exr --executor c --profile exact

wamnet denoise hall.safetensors frame0001.exr --keep-layers -o for-the-compositor.exr

wamnet denoise small.safetensors noisy.exr --executor opencl --rank 16"""
"""Shown below the help of `wamnet denoise`."""

EXECUTORS_EXAMPLES = """Example:

wamnet executors"""
"""Shown below the help of `wamnet executors`."""

KeepLayers = Annotated[
    bool,
    typer.Option("--keep-layers", help="Write all layers of FRAME too, and the picture as layer wamnet."),
]
ViewLayer = Annotated[
    str,
    typer.Option(
        metavar="NAME", help="View, part or view layer of FRAME to denoise.", show_default="the first view"
    ),
]


def denoise(
    model: options.ModelFile,
    frame: Annotated[
        Path,
        typer.Argument(
            metavar="FRAME", help="Noisy frame with the model's layers (.exr).", show_default=False
        ),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="Linear colour (.exr) or picture (.png).")
    ] = Path("denoised.png"),
    executor: options.Executor = ExecutorName.numpy,
    profile: options.Profile = "ieee",
    schedule: options.Schedule = None,
    rank: options.CutRank = 0,
    variant: options.Variant = None,
    anyway: Annotated[
        bool, typer.Option("--anyway", help="Denoise another program's frame that is unlike the training's.")
    ] = False,
    keep_layers: KeepLayers = False,
    view_layer: ViewLayer = "",
    context: options.OpenGLContext = None,
) -> None:
    """Denoise a frame with a trained model.

    The kernel's schedule is the one that suits the device, unless another is named. With profile exact the
    result is the same to the last bit on every executor; its digest is printed, to be compared.
    """
    from ...compiler.variants import FULL, with_rank
    from ...kernels import denoise_on, open_executor
    from ...kernels.run.tune import first_time
    from ...refimpl.encoding import from_display
    from ..files import exr, images

    check_output(output, (".exr",) if keep_layers else (".exr", ".png"), [model, frame])
    network, noisy = load_model(model), exr.read_frame(frame, False, say, view_layer)
    why, way_out = "the model was trained with it", "render or export that layer too"
    exr.need_layers(frame, noisy, network.features, why, way_out, view_layer)
    _say_what_is_no_number(frame, noisy, network)
    check_domain(frame, noisy, network, anyway)
    with open_executor(executor.value) as runner:
        result = denoise_on(runner, network, noisy, profile, schedule, with_rank(variant or FULL, rank))
        first = first_time(runner, result.kernel, result.seconds_compile)
    if output.suffix.lower() == ".png":
        images.write_png(output, result.image)
    else:
        linear = from_display(result.image, network.normalization.exposure_stops)
        layer = exr.write_denoised(output, frame, linear, view_layer, keep_layers, denoised="true")
        if layer:
            say(f"{output}: layer {layer} is the denoised image")
    say(f"{output}: {noisy.width}x{noisy.height} pixels on {executor.value} ({result.device})")
    say(f"schedule {result.schedule}; {result.reason}")
    if result.variant:
        say(result.variant)
    before = "" if first == result.seconds_compile else f" (the first time {first:.3f} s)"
    say(f"{result.seconds_run:.3f} s, after {result.seconds_compile:.3f} s of compilation{before}")
    if profile == "exact":
        say(f"sha256 of the float32 result, the same on every executor: {result.digest}")


def _say_what_is_no_number(path: Path, noisy: Frame, model: Model) -> None:
    """Warn of pixels that are read as something else."""
    from ...refimpl.frame import not_finite
    from ...refimpl.network.dataset import FEATURES

    read = {layer for name in model.features for layer in FEATURES[name].layers}
    for layer, count in not_finite(noisy).items():
        if layer in read:
            rule = "NaN is read as 0, an infinity as the end of the range"
            say(f"{path}: {count} pixels of {layer} are not finite: {rule}")


def write_denoised(path: Path, encoded: Any, model: Model, noisy: Frame) -> None:
    """Write display-encoded colour (H, W, 3): as it is to PNG, as linear radiance to EXR."""
    from ...refimpl.encoding import from_display
    from ...refimpl.frame import Frame
    from ..files import exr, images

    if path.suffix.lower() == ".png":
        images.write_png(path, encoded)
    else:
        color = from_display(encoded, model.normalization.exposure_stops)
        exr.write_frame(path, Frame({"color": color}, {**noisy.info, "denoised": "true"}))


def executors() -> None:
    """List what can run a kernel here, or what is missing for it."""
    found = [probe(name.value) for name in ExecutorName]
    heads = ("name", "state", "schedule", "device, or what is missing")
    table("Executors", heads, found, texts=4)


def probe(name: str) -> tuple[str, str, str, str]:
    """Return an executor's name, whether it works here, its schedule, and its device or why it does not."""
    from ...kernels import open_executor

    try:
        with open_executor(name) as executor:
            least = f" from {executor.schedule_pixels} pixels on" if executor.schedule_pixels else ""
            return name, "ready", executor.schedule + least, executor.device
    except ExecutorUnavailable as error:
        return name, "missing", "", str(error)
