"""The functions of the public module.

Images are arrays (height, width, channels) of floats, row 0 at the top. Colour is linear radiance in Rec. 709
primaries unless it is said to be display-encoded: then it is sRGB in [0, 1]. All errors that a caller can
cause are a `WamnetError`; its subclass InputError is a ValueError, and its message names the value and the
remedy.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import models
from .kernel import PLAIN, Certificate, CertificateError, Function, Kernel, language_of
from .refimpl.errors import NO_VALUE, InputError, choice
from .refimpl.frame import Frame, validate

if TYPE_CHECKING:
    from .kernels.devices.executor import Executor
    from .refimpl.light.scene import Scene
    from .refimpl.network.denoise import Model

    Layers = Frame | Mapping[str, NDArray[Any]]
    Paths = str | os.PathLike[str]

AUTO = "auto"
"""The fastest executor that is available."""

NUMPY = "numpy"
"""The executor that needs no other package: the reference itself."""


def load(
    model: Paths | Model, *, ranges: Mapping[str, tuple[float, float]] | None = None, border: str = ""
) -> Model:
    """Load a model: a bundled one by name, a file, or a network in ONNX's form.

    `model` is one of the names of `wamnet.models.names()`, the path of a `.safetensors` file that
    `wamnet train` or `train` made, or of an `.onnx` file, whose inputs then have these `ranges`
    ([0, 1] by default; the key "" stands for all others) and this `border` ("zero", "clamp", or the
    network's own margins). A model is returned as it is.

    Raises InputError for an unknown name, a missing or a damaged file, or an unsupported operator.

        model = wamnet.load("minicubes")
    """
    from .models.model_file import load_model
    from .refimpl.network.denoise import Model

    if isinstance(model, Model):
        return model
    path = Path(model)
    if path.suffix.lower() == ".onnx":
        from .models.importing.network import import_network

        return import_network(path, dict(ranges or {}), border).model
    if ranges is not None or border:
        raise InputError("ranges, border", str(model), "belong to an .onnx file", "leave them out")
    if path.suffix or path.exists():
        return load_model(path)
    if str(model) not in models.names():
        raise InputError("model", str(model), "not found", f"{choice(str(model), models.names())}, or a file")
    return load_model(models.path(str(model)))


def render(
    scene: Paths | Scene = "minicubes",
    *,
    width: int = 256,
    height: int = 256,
    spp: int = 1,
    feature_spp: int = 0,
    seen: bool = False,
    shadow_rays: int = 0,
    seed: int = 0,
    max_depth: int = 5,
    time: float | None = None,
    executor: str = AUTO,
    **parameters: Any,
) -> Frame:
    """Path-trace a scene and return a frame: colour, and the features of the first hits.

    `scene` is the name of a canonical scene, with its `parameters` (`wamnet scene NAME` prints it), the path
    of a scene file (`.json`), or a scene. `width` and `height` are in pixels, `spp` is in paths per pixel,
    `feature_spp` in camera rays per pixel for the features (0: those of the paths), `time` in the scene's
    own unit. `seen` adds the layers of what is seen through mirrors and glass, `shadow_rays` per camera ray
    the layer `direct`: the lamps' light with shadows. `max_depth` is the largest number of bounces. The same
    arguments give the same frame, on every executor up to rounding.

    Returns a `Frame` of float32 layers (height, width, channels): `frame["color"]`, linear radiance;
    `"albedo"` in [0, 1]; `"normal"`, unit length; `"position"` and `"depth"` in scene units, and others.

    Raises InputError for an unknown scene or parameter, ExecutorUnavailable for a missing device.

        frame = wamnet.render("minicubes", time=2.5, spp=64)
    """
    from .kernels.run.render_frame import render_frame
    from .refimpl.light.render import Job
    from .refimpl.light.transport import Settings

    settings = Settings(max_depth=max_depth)
    more = {"feature_spp": feature_spp, "seen": seen, "shadow_rays": shadow_rays}
    job = Job(width, height, spp, seed, settings, "float32", **more)  # type: ignore[arg-type]
    loaded = _scene(scene, parameters if time is None else {**parameters, "time": time})
    return render_frame(_name(executor), loaded, job).frame


def train(
    noisy: Layers | Sequence[Layers],
    clean: Layers | Sequence[Layers],
    *,
    preset: str = "best",
    steps: int | None = None,
    features: Sequence[str] | None = None,
    seed: int = 0,
    executor: str = AUTO,
    on_progress: Callable[[int, float], None] | None = None,
) -> Model:
    """Train a denoiser on noisy frames and their references, and return the model.

    `noisy` and `clean` are single frames, or two sequences of equal length; a frame is a `Frame` or a mapping
    from layers to arrays (H, W, C). Noisy frames have the layers of `features` (by default the preset's),
    clean ones `"color"`. `steps` replaces the preset's number of steps. `on_progress` is called with the
    number of steps and the loss. Presets are short, best, mirrors, sky and paper.

    Raises InputError for frames that do not fit each other or lack a layer, TrainingError if the loss
    becomes infinite, ExecutorUnavailable for a missing device.

        model = wamnet.train(noisy, clean, preset="short", features=["color", "normal", "albedo"])
    """
    from .kernels import train_on
    from .kernels.run.trainer import model_of_run
    from .refimpl.network.train import PRESETS
    from .refimpl.network.train import train as train_reference

    if preset not in PRESETS:
        raise InputError("preset", preset, "unknown", choice(preset, PRESETS))
    changes: dict[str, Any] = {"steps": steps, "features": features and tuple(features), "seed": seed}
    recipe = replace(PRESETS[preset], **{key: value for key, value in changes.items() if value is not None})
    inputs, targets = _frames(noisy), _frames(clean)
    if len(inputs) != len(targets):
        rule = f"each of {len(inputs)} noisy frames needs its clean one"
        raise InputError("number of clean frames", len(targets), rule, "pass as many of both")
    pairs = list(zip(inputs, targets, strict=True))
    progress = None if on_progress is None else lambda state, loss: on_progress(state.step, loss)
    name = _name(executor, trains=True)
    if name == NUMPY:
        return model_of_run(train_reference(recipe, pairs, on_progress=progress), pairs)
    with _open(name) as device:
        return model_of_run(train_on(device, recipe, pairs, on_progress=progress), pairs)


def denoise(
    model: Paths | Model,
    frame: Layers | None = None,
    *,
    executor: str = AUTO,
    encoded: bool = False,
    **layers: NDArray[Any],
) -> NDArray[np.float32]:
    """Denoise a frame and return its colour (H, W, 3), float32.

    The layers that the model reads are those of `frame`, or are passed by name: arrays (H, W, C) of floats,
    `color=` linear radiance, `normal=` unit vectors in world space, `albedo=` in [0, 1], and so on; see
    `model.features`. The result is linear radiance, which ends at the white of the model's exposure, or with
    `encoded` the display-encoded image in [0, 1].

    Raises InputError for a missing layer, or one of another shape, ExecutorUnavailable for a missing device.

        image = wamnet.denoise(model, color=color, normal=normal, albedo=albedo)
    """
    from .refimpl.encoding import from_display

    model = load(model)
    if model.is_imported:
        rule = "was imported, and reads its own images, not the layers of a frame"
        raise InputError("model", repr(model), rule, "use wamnet.compile(model, target).run(...)")
    whole = _frame({**(frame.layers if isinstance(frame, Frame) else frame or {}), **layers})
    name = _name(executor)
    if name == NUMPY:
        from .refimpl.network.denoise import denoise as reference

        image = reference(model, whole)
    else:
        from .kernels import denoise_on

        with _open(name) as device:
            image = denoise_on(device, model, whole, keeps=True).image
    display = np.asarray(image, np.float32)
    return display if encoded else from_display(display, model.normalization.exposure_stops)


def compile(  # noqa: A001 - what it does
    model: Paths | Model,
    target: str = "opencl",
    *,
    profile: str = "ieee",
    schedule: str = PLAIN,
    variant: str = "full",
) -> Kernel:
    """Compile a model to a kernel: source, weights, interface, and a bound on its rounding error.

    `target` is a language: opencl, glsl, c, wgsl, cuda, metal, glsl-es, vulkan and others. `profile` "ieee"
    has a proven bound, "native" uses the device's own sine. `schedule` "plain" is human-readable; "tile:16"
    and "fft:16" are faster where the target has them. `variant` is a cheaper network, as "window8+rank16".

    Raises InputError or CompileError for a combination that does not exist.

        kernel = wamnet.compile("minicubes", "glsl")
        kernel.save("denoiser")
    """
    from .compiler.compile import compile_plan
    from .compiler.variants import plan_model

    return Kernel(compile_plan(plan_model(load(model), language_of(target, profile), schedule, variant)))


def certify(kernel: Kernel | Paths) -> Certificate:
    """Check the proof of a kernel's error bound, and that its source computes the proven program.

    `kernel` is a `Kernel` of profile "ieee", or the folder that it was saved to. The checker shares no code
    with the compiler. It assumes that compiler and device keep to the language's standard and to IEEE 754's
    float32, rounded to nearest.

    Raises CertificateError where a step does not hold, where there is no certificate, or where the source
    cannot be checked.

        bound = wamnet.certify(kernel).bound
    """
    from .compiler.artifact import CERTIFICATE_NAME
    from .compiler.proof.checker import check
    from .compiler.proof.evidence import Refused
    from .compiler.reading.check import check_text
    from .compiler.reading.lanes import Unread

    if isinstance(kernel, Kernel):
        if reason := kernel.artifact.plan.unproven:
            raise CertificateError(f"{kernel.target} kernel has no certificate: {reason}")
        with tempfile.TemporaryDirectory() as folder:
            kernel.save(folder)
            return certify(folder)
    path = Path(kernel) / CERTIFICATE_NAME
    if not path.is_file():
        raise CertificateError(f"{kernel}: there is no certificate: compile with profile 'ieee'")
    try:
        proof, source = check(path), check_text(path)
    except Refused as error:
        raise CertificateError(f"{kernel}: rejected: {error}") from None
    except Unread as error:
        raise CertificateError(f"{kernel}: the source has not been checked: {error}") from None
    bound = tuple(float(each) for each in proof["bound"]["output"]) if "bound" in proof else ()
    return Certificate(bound, source["sums"], source["lanes"])


def export(
    model: Paths | Model,
    folder: Paths,
    *,
    target: str | None = None,
    host: str = "",
    scene: Paths | Scene | None = None,
    variant: str = "full",
    schedule: str = "",
) -> Path:
    """Write a denoiser for another program into a new folder, and return the folder.

    It has the kernels, a manifest, a README and a pair of images to check with; with a `host` also a program
    around them, and with a `scene` the path tracer of that scene. `wamnet export --help` lists targets and
    hosts; the target is the host's where there is one.

    Raises InputError for an unknown name, a limit of the target, or a folder that exists.

        wamnet.export("minicubes", "denoiser", target="wgsl")
    """
    from .cli.files.outputs import making_folder
    from .kernels.export.hosts.host import host_named
    from .kernels.export.package import Request
    from .kernels.export.package import export as exported

    if target is None and not host:
        raise InputError("target", NO_VALUE, "missing, and so is the host", "pass target= or host=")
    loaded = None if scene is None else _scene(scene, {})
    row = target or host_named(host).target
    made = exported(Request(load(model), row, loaded, variant=variant, schedule=schedule, host=host))
    with making_folder(Path(folder)) as new:
        for name, content in made.contents().items():
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).write_bytes(content)
    return Path(folder)


def trace(
    function: Callable[[Any], Any],
    shapes: Mapping[str, int],
    *,
    window: int = 1,
    border: str = "clamp",
    ranges: Mapping[str, tuple[float, float]] | None = None,
) -> Function:
    """Trace a function of NumPy arrays, which then compiles to a kernel that runs it for every pixel.

    `shapes` are the channels of the input images by name, `ranges` their values ([0, 1] by default), for
    which the kernel's error bound holds. `function` gets the `window` x `window` pixels around a pixel of
    all images as one vector (..., N), image by image, row by row, channel by channel, and returns a number
    (...) or a vector (..., C); what is outside of the image is its nearest pixel ("clamp") or 0 ("zero").
    It is called once, with a value that records NumPy's operations: `+ - * /`, `@`, np.sin, np.clip,
    np.where, `x[..., i]`, np.stack and others, without `if` on values.

    Raises CompileError, with the line, for an operation that has no counterpart in kernels.

        def grey(pixel):
            return 0.2126 * pixel[..., 0] + 0.7152 * pixel[..., 1] + 0.0722 * pixel[..., 2]

        print(wamnet.trace(grey, {"color": 3}).compile("glsl").source)
    """
    from .compiler.core.ir import OUTPUT_ENCODING, Gather, Image, Type
    from .compiler.core.trace import trace as traced
    from .compiler.core.verify import verify
    from .refimpl.network.window import Window, check_window

    ends = dict.fromkeys(shapes, (0.0, 1.0)) | {
        name: (float(low), float(high)) for name, (low, high) in (ranges or {}).items()
    }
    if unknown := sorted(set(ends) - set(shapes)):
        rule = f"must be one of {', '.join(shapes)}"
        raise InputError("range of image", unknown[0], rule, "name an image of `shapes`")
    size = Window(window, border)
    check_window(size)
    as_given = "as the caller passes it"
    images = tuple(Image(name, channels, *ends[name], as_given) for name, channels in shapes.items())
    gather = Gather(size, images)
    inputs = {"window": Type(shape=(gather.n_inputs,))}
    program = traced(function, inputs, gather, info={OUTPUT_ENCODING: "as the function returns it"})
    return Function(verify(program, "traced function"))


def executors() -> dict[str, str]:
    """Return the executors that are available, usually fastest first, and the device of each.

    wamnet.executors()  # {"opencl": "...", "c": "...", "numpy": "..."}
    """
    from .kernels import EXECUTORS
    from .kernels.devices.registry import FASTEST
    from .refimpl.errors import ExecutorUnavailable

    devices = {}
    for name in dict.fromkeys((*FASTEST, *EXECUTORS)):
        try:
            with _open(name) as executor:
                devices[name] = executor.device
        except ExecutorUnavailable:
            continue
    return devices


def _open(name: str) -> Executor:
    """Return an open executor."""
    from .kernels import open_executor

    return open_executor(name)


def _name(executor: str, trains: bool = False) -> str:
    """Return the name of an executor; of `auto`, that of the fastest one, which `trains` if it must."""
    from .kernels.devices.registry import fastest

    return fastest(trains)[0] if executor == AUTO else executor


def _scene(scene: Paths | Scene, parameters: Mapping[str, Any]) -> Scene:
    """Return a canonical scene by name, or that of a file."""
    from .models.data.scene_source import scene_source
    from .refimpl.light.scene import Scene

    if not isinstance(scene, Scene):
        return scene_source(str(scene), parameters).at()
    if parameters:
        rule = "only canonical scenes have parameters"
        raise InputError("parameter", ", ".join(parameters), rule, "change the scene itself")
    return scene


def _frame(layers: Layers) -> Frame:
    """Return a valid frame of layers, as float32; values that are not finite are left to the encoding."""
    info = layers.info if isinstance(layers, Frame) else {}
    named = layers.layers if isinstance(layers, Frame) else layers
    arrays = {}
    for name, values in named.items():
        array = np.asarray(values)
        if array.dtype.kind != "f":
            rule = "layers are floats; linear radiance for colour"
            raise InputError(f"type of layer {name!r}", str(array.dtype), rule, "convert it to float32")
        arrays[name] = array.astype(np.float32, copy=False)
    frame = Frame(arrays, info)
    validate(frame, finite=False)
    return frame


def _frames(frames: Layers | Sequence[Layers]) -> list[Frame]:
    """Return one frame or several as a list of valid frames."""
    several = [frames] if isinstance(frames, (Frame, Mapping)) else frames
    return [_frame(each) for each in several]
