"""What a web page needs to path-trace a scene and denoise it in WebGL 2: kernels, weights, moving numbers.

1. The paths are one kernel for all moments: what differs between the scenes of the animation is read from a
   table of uniforms, a row for each moment; camera and light colours are uniforms too [`moving_numbers`].
   Features that do not fit into its colour buffers have a kernel of their own, which ends at the first hit
   [`drawn_together`].
2. The encoding of the features is split where they are more than colour buffers [`encoders`].
3. Each variant of the network is one or two passes, with its bound [`variant`]. One of them is no shader
   but a module of WebAssembly, several times as fast as shaders that run on a processor: it imports nothing,
   and exports its memory, its first free byte (`__heap_base`) and `wamnet_rows` of C executors [`module_of`].
4. A page cannot trust its compiler (GLSL ES 3.00 has no `precise`): it carries a small picture's features,
   and for each variant the reference's output in float64 with a bound for each number [`check`]; of a network
   of integers, whose bits every device has, the SHA-256 of the output too.

Everything is JSON's types; arrays are base64 of little-endian numbers. spec/webpage.md describes the form.
"""

from __future__ import annotations

import base64
import importlib.util
import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.core.ir import digest, sha256
from ...compiler.core.loops import STATEMENTS
from ...compiler.core.lower import lower
from ...compiler.languages.glsl import MOST_UNIFORMS
from ...compiler.languages.glsl_es import MOST_BUFFERS
from ...compiler.plan import Expected, plan_program
from ...compiler.scenes.encode_kernel import (
    compile_encode,
    feature_rays,
    layers_of,
    learned_rays,
    planes_of,
    sees,
)
from ...compiler.scenes.lower_scene import FeatureRays, lower_scene
from ...compiler.scenes.path_kernel import compile_path
from ...compiler.scenes.scene_inputs import SceneInputs, varying
from ...compiler.schedules.common import kernel_gather, output_channels
from ...compiler.schedules.plain import WEIGHTS_A_TEXEL
from ...compiler.variants import parse, vary
from ...refimpl import rng
from ...refimpl.errors import NO_VALUE, CompileError, ExecutorUnavailable, InputError
from ...refimpl.light import transport
from ...refimpl.light.render import Job, feature_settings, render
from ...refimpl.light.scene import Scene
from ...refimpl.light.scenes import TURN_SECONDS
from ...refimpl.light.shapes.quad import quad_area_pdf
from ...refimpl.light.transport import Settings
from ...refimpl.light.variation import RANGES, ranges_from_json
from ...refimpl.network import factored
from ...refimpl.network.dataset import FEATURES, feature_image
from ...refimpl.network.denoise import Model, check_model, learned_shadow_rays
from ...refimpl.network.whole import INPUT_LEVELS, WEIGHT_LEVELS, round_image
from .. import cache
from ..devices.c_executor import MOST_TOLD, glue_of
from .denoise_on import bound_of, products_of

SCHEMA = "wamnet-page-6"
"""Name and version of the form of a page's data."""

TARGET = "glsl-es"
"""What the kernels are written in."""

SHOWN = ("color", "normal")
"""Features that a page shows, whether or not a network reads them."""

RANK = 16
"""Rank of the fast variant's first layer, unless another is given: as many numbers as four colour buffers
hold. Trained in this form it loses nothing (spec/factored.md)."""

WHOLE = "whole8"
"""The variant of integers."""

MANY, FEW = "packed", "inlined"
"""Schedules: four weights a texel, however many there are; constants of the source where they are few."""

PROCESSOR = "c", "fft:4"
"""Target and schedule of the variant for processors: vectors of WebAssembly hold four floats."""

CHECK_PX = 32
"""Side of the picture that a page checks itself with: the window fits in, all four borders are seen."""

CHECK_SEED = 0xC43C
"""Seed of its noise."""

SAMPLE_SCENES = 4
"""Scenes with drawn colours and cameras that show which numbers depend on them: with three or more, numbers
that are equal by chance are not taken for one."""

COMPUTED = ("camera.", "world.lights.")
"""Tables that a page computes itself: a number that is in another one too is known by its place here."""

TOLD = ("trained_on_scene", "steps_done")
"""What of a model's info a page repeats."""


@dataclass(frozen=True)
class Animation:
    """A scene at times in seconds; a still one has one of them."""

    times: tuple[float, ...]
    scenes: tuple[Scene, ...]


@dataclass(frozen=True)
class Network:
    """A variant of the page: the first layer is cut to the rank, unless it is 0; a schedule of the kernel."""

    name: str
    model: Model
    rank: int = 0
    schedule: str = MANY
    target: str = TARGET


def networks_of(
    model: Model, fast: Model | None = None, rank: int = RANK, processor: bool = False
) -> tuple[Network, ...]:
    """Return a page's variants: the full network, one of low rank with its weights in either way, integers.

    `processor`: the full network as a module of WebAssembly too, which takes Zig to build.
    `fast`: what is cut to the rank, if it is another model, such as one that was trained on in this form.
    A network of integers is the only one: a rank rounds (WHO-11). A network that cannot be rounded has no
    variant in integers.
    """
    if model.is_whole or (fast is not None and fast.is_whole):
        if fast is not None:
            rule = "excluded: an integer network cannot be cut to a rank, and is the only one of its page"
            raise InputError("second model", NO_VALUE, rule, "leave it out")
        return (Network("full", model),)
    cut = fast or model
    integers: list[Network] = []
    with suppress(InputError):  # a network without angles, or with too large sums, has none
        integers = [Network("whole", vary(parse(WHOLE), model).model)]
    n_out, n_in = cut.siren.weights[0].shape
    most = min(rank, factored.largest_rank(cut.window.size, n_in, n_out), 4 * MOST_BUFFERS)
    return (
        Network("full", model),
        Network("fast", cut, most, FEW),
        Network("fast-texture", cut, most),
        *integers,
        *[Network("processor", model, 0, PROCESSOR[1], PROCESSOR[0])][: int(processor)],
    )


def page_data(
    animation: Animation,
    networks: Sequence[Network],
    settings: Settings | None = None,
) -> dict[str, Any]:
    """Return a page's data; the first network is the one that the others are compared with."""
    settings = settings or Settings()
    shown = _features([network.model for network in networks])
    scene, first = animation.scenes[0], networks[0].model
    inputs, numbers = moving_numbers(animation, settings)
    together = drawn_together(shown)
    # What is shown is encoded as for floats, whatever a network reads.
    read = {
        levels: {name for one in networks if _levels(one.model) == levels for name in one.model.features}
        for levels in (1, INPUT_LEVELS)
    }
    read[1] |= set(SHOWN)
    # Whole paths give colour; the other features are of their first hit, or of what is seen.
    lengths = [settings, *(feature_settings(settings, sees(part)) for part in together[1:])]
    rays = learned_rays(replace(first, features=shown), settings)
    shadows = learned_shadow_rays(replace(first, features=shown))
    paths = []
    for length, part in zip(lengths, together, strict=True):
        seen = sees(part)
        programs = lower_scene(scene, length, STATEMENTS, inputs, seen=seen, rays=rays, shadow_rays=shadows)
        paths.append(compile_path(programs, TARGET, groups=layers_of(part)))
    images = check(animation, first, shown, settings, rays, shadows)
    return {
        "schema": SCHEMA,
        "scene": scene.name,
        "times": list(animation.times),
        "turn_s": TURN_SECONDS,
        "camera": asdict(scene.camera),
        "lights": [
            {"color": list(light.color), "power": light.power, "area": 1.0 / quad_area_pdf(light)}
            for light in scene.lights
        ],
        "share": transport.SKY_SHARE if scene.environment is not None else 1.0,
        "numbers": numbers,
        "rays": rays.count if rays else 1,
        "paths": [
            {"source": one.source, "planes": list(one.planes), "settings": one.programs.settings.facts()}
            for one in paths
        ],
        "encoders": [
            {"path": number, "levels": levels, **encoder}
            for levels, names in read.items()
            for number, (part, path) in enumerate(zip(together, paths, strict=True))
            for encoder in encoders([n for n in part if n in names], levels, first, path)
        ],
        "check": {
            "size": CHECK_PX,
            "images": {n: {"channels": a.shape[-1], "values": _packed(a)} for n, a in images.items()},
        },
        "variants": variants(networks, images, scene.name),
    }


def _levels(model: Model) -> int:
    """Return what a feature of 1 is to a network: 1, or the largest integer of 8 bits."""
    return INPUT_LEVELS if model.is_whole else 1


def _features(models: Sequence[Model]) -> tuple[str, ...]:
    """Return the features that are encoded, or refuse models that would need two encodings."""
    first, *others = models
    for model in models:
        check_model(model)
    for model in others:
        if model.normalization != first.normalization:
            rule = "its scales are not those of the first model, and one page encodes once"
            raise InputError("second model", model.normalization, rule, "train it from the first (--from)")
    return tuple(dict.fromkeys([name for model in models for name in model.features] + [*SHOWN]))


def drawn_together(features: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the features in parts whose planes fit into the buffers; those of colour are in the first."""
    parts: list[tuple[str, ...]] = [()]
    for name in sorted(features, key=lambda name: FEATURES[name].layer != "color"):
        if len(planes_of((*parts[-1], name))) > 4 * MOST_BUFFERS:
            parts.append(())
        parts[-1] = (*parts[-1], name)
    return parts


def moving_numbers(animation: Animation, settings: Settings) -> tuple[SceneInputs, dict[str, Any]]:
    """Return the scene's numbers that are uniforms, and their values at each time."""
    scene = animation.scenes[0]
    drawn = [_drawn(scene, number) for number in range(SAMPLE_SCENES)]
    inputs = varying([*animation.scenes, *drawn], settings)
    if len(inputs.places) > 4 * MOST_UNIFORMS:
        rule = f"{len(inputs.places)} of its numbers move; a shader has uniforms for {4 * MOST_UNIFORMS}"
        raise InputError("scene", scene.name, rule, "fix its time, or use a scene with fewer moving parts")
    rows = np.stack([inputs.values(one) for one in animation.scenes])
    moving = np.flatnonzero(np.any(rows != rows[0], axis=0))
    return inputs, {
        # A page knows a number by the place that it computes, if there is one.
        "names": [
            list(next((place for place in places if place[0].startswith(COMPUTED)), places[0]))
            for places in inputs.places
        ],
        "still": [float(value) for value in rows[0]],
        "moving": [int(place) for place in moving],
        "rows": _packed(rows[:, moving]),
    }


def _drawn(scene: Scene, number: int) -> Scene:
    """Return the scene with drawn light colours and a camera moved in a drawn direction."""
    words = rng.counter(np.arange(1 + len(scene.lights)))
    x, y, z, _ = rng.uniforms(rng.counter(number), words, rng.counter(0), rng.counter(0), np.float64)
    moved = [p + d[0] - 0.5 for p, d in zip(scene.camera.position, (x, y, z), strict=True)]
    colors = [(0.1 + float(x[i]), 0.1 + float(y[i]), 0.1 + float(z[i])) for i in range(1, len(x))]
    lights = tuple(replace(light, color=c) for light, c in zip(scene.lights, colors, strict=True))
    camera = replace(scene.camera, position=(float(moved[0]), float(moved[1]), float(moved[2])))
    return replace(scene, camera=camera, lights=lights)


def encoders(features: Sequence[str], levels: int, model: Model, path: Artifact) -> list[dict[str, Any]]:
    """Return the encoding as passes of at most as many features as there are colour buffers."""
    rays = path.programs.rays
    parts = [features[first : first + MOST_BUFFERS] for first in range(0, len(features), MOST_BUFFERS)]
    given = (model.normalization, TARGET, path.planes, levels > 1, rays.count if rays else 0)
    found = [compile_encode(part, *given) for part in parts]
    return [{"source": one.source, "images": [image.facts for image in one.images]} for one in found]


def variants(
    networks: Sequence[Network], images: Mapping[str, NDArray[np.float32]], scene: str
) -> list[dict[str, Any]]:
    """Return the networks of a page, each with what it has learned and how far it is from the first one."""
    found, expected = list[dict[str, Any]](), list[tuple[Network, Expected]]()
    for network in networks:
        # Two schedules of one network have one reference, and most of them one bound, which take seconds.
        same = (n for n in expected if n[0].model is network.model and n[0].rank == network.rank)
        like = next(same, None)
        one, held = variant(network, images, like and like[1])
        expected.append((network, held))
        if like is not None and held is like[1]:
            one["check"] = like[0].name
        # How far a variant's picture is from the first one's is a fact about the weights, not about a device.
        off = held.value - expected[0][1].value
        facts = {"ranges": learned_ranges(network.model, scene), "rays": max(feature_rays(network.model), 1)}
        found.append({**one, **facts, "rms_to_first": float(np.sqrt(np.mean(off**2)))})
    return found


def variant(
    network: Network, images: Mapping[str, NDArray[np.float32]], held: Expected | None = None
) -> tuple[dict[str, Any], Expected]:
    """Return a network as passes, with its bound, and what it makes of the check's images.

    `held`: what another schedule of the network was found to make of them.
    """
    model, rank = network.model, network.rank
    program = lower(model)
    plan = plan_program(program, network.target, network.schedule, rank)
    artifact = compile_plan(plan)
    packed = None if network.target == TARGET else compile_plan(plan_program(program, TARGET, schedule=MANY))
    mine = {name: round_image(images[name]) if model.is_whole else images[name] for name in model.features}
    held = held if held and plan.shares_bound else plan.expected(mine)
    bits = sha256(held.value.astype("<f4").tobytes()) if plan.is_whole else None
    found = {
        "name": network.name,
        "rank": rank,
        "levels": _levels(model),
        "schedule": artifact.manifest["schedule"]["name"],
        "features": list(model.features),
        "program": digest(program),
        "trained": {key: model.info[key] for key in TOLD if key in model.info},
        "weights": sum(kernel.weights.size for kernel in artifact.kernels),
        "products": sum(products_of(kernel.programs) for kernel in artifact.kernels),
        "bound": bound_of(artifact),
        "passes": [_pass(kernel, packed) for kernel in artifact.kernels],
        "check": {
            "expected": _packed(held.value),
            "bound": None if plan.is_whole else _packed(held.most_from(held.value.astype(np.float32))),
            "sha256": bits,
        },
    }
    return found, held


def learned_ranges(model: Model, scene: str) -> dict[str, Any] | None:
    """Return the ranges of what a model has learned of a scene; None where it does not say."""
    text = model.info.get(f"trained_on_{RANGES}")
    scenes = model.info.get("trained_on_scene", scene).split(", ")
    return None if text is None or scene not in scenes else asdict(ranges_from_json(text))


def _pass(kernel: Artifact, packed: Artifact | None) -> dict[str, Any]:
    """Return one fragment pass, or the module that does the work of one, `packed`, on the processor."""
    images = kernel_gather(kernel.programs).images
    found: dict[str, Any] = {
        "reads": [image.name for image in images],
        "texel": kernel.manifest["schedule"].get(WEIGHTS_A_TEXEL, 1),
        "buffers": -(-output_channels(kernel.programs) // 4),
    }
    if packed is None:
        return {"source": kernel.source, "weights": _weights(kernel.weights), **found}
    return {
        "module": base64.b64encode(module_of(kernel)).decode(),
        "channels": [image.channels for image in images],
        "rows": kernel.manifest["schedule"].get("rows", 1),
        "weights": _transformed(kernel, packed),
        **found,
    }


def _transformed(kernel: Artifact, packed: Artifact) -> str | dict[str, Any]:
    """Return how a page makes spectra from the weights of its first variant, `packed`, and all other weights.

    Spectra are eight times as many (FOU-4). A kernel without spectra has its own weights.
    """
    spectra = kernel.plan.schedule.spectra(kernel.programs)
    if spectra is None:
        return _packed(kernel.weights)
    slot = max(kernel.manifest["weights"]["layout"], key=lambda slot: len(slot["shape"]))
    (whole,) = (each for each in packed.manifest["weights"]["layout"] if each["name"] == slot["name"])
    inside = slice(slot["offset"], slot["offset"] + math.prod(slot["shape"]))
    facts = {"window": spectra.size, "order": spectra.order.tolist()}
    others = _packed(np.delete(kernel.weights, inside))
    return {"of": "full", "from": whole, "to": slot, **facts, "others": others}


def _weights(numbers: NDArray[np.float32]) -> str | dict[str, Any]:
    """Return floats; or bytes of integers, and by their places those of more bits."""
    if not numbers.size or np.any(numbers != np.rint(numbers)):
        return _packed(numbers)
    small = np.abs(numbers) <= WEIGHT_LEVELS
    large = [[int(place), int(numbers[place])] for place in np.flatnonzero(~small)]
    return {"bytes": _packed(np.where(small, numbers, 0), "i1"), "large": large}


def check(
    animation: Animation,
    model: Model,
    features: Sequence[str],
    settings: Settings,
    rays: FeatureRays | None,
    shadows: int = 0,
) -> dict[str, NDArray[np.float32]]:
    """Return the encoded features (H, W, C) of a small noisy picture by name, as floats."""
    job = Job(CHECK_PX, CHECK_PX, 1, CHECK_SEED, settings, seen=sees(features), shadow_rays=shadows)
    if rays:
        job = replace(job, feature_spp=rays.count, feature_sampler=rays.sampler)
    frame = render(animation.scenes[0], job).frame
    return {name: feature_image(frame, (name,), model.normalization) for name in features}


def _packed(array: NDArray[Any], kind: str = "<f4") -> str:
    """Return the numbers as base64."""
    return base64.b64encode(np.ascontiguousarray(array, kind).tobytes()).decode()


# ---- WebAssembly ------------------------------------------------------------------------------------------


ZIG_OPTIONS = (
    "-target", "wasm32-wasi", "-mcpu=generic+simd128", "-std=gnu99", "-O3", "-ffp-contract=off",
)  # fmt: skip
"""Vectors, and no contraction."""

LINK_OPTIONS = (
    "-nostdlib", "-Wl,--no-entry", "-Wl,--strip-all", "-Wl,--export=wamnet_rows", "-Wl,--export=__heap_base",
)  # fmt: skip
"""No start, no file, no debugging: a page needs one function. No C library, which Zig would build first, in
half a minute."""


def compiler() -> list[str]:
    """Return the words that call Zig; none where it is not there."""
    if importlib.util.find_spec("ziglang"):
        return [sys.executable, "-m", "ziglang"]
    return [*filter(None, [shutil.which("zig")])]


def module_of(artifact: Artifact) -> bytes:
    """Return a kernel in C as a module.

    Raises `ExecutorUnavailable` without Zig, `CompileError` where it does not build the kernel.
    """
    command = compiler()
    if not command:
        raise ExecutorUnavailable("zig is not installed: pip install ziglang")
    glue = glue_of(artifact, "denoise.h")

    def built() -> str:
        with tempfile.TemporaryDirectory(prefix="wamnet-") as name:
            folder = Path(name)
            (folder / "denoise.h").write_text(artifact.source, encoding="utf-8")
            (folder / "page.c").write_text(glue, encoding="utf-8")
            for step in (("-c", "-o", "page.o", "page.c"), (*LINK_OPTIONS, "-o", "page.wasm", "page.o")):
                done = subprocess.run(
                    [*command, "cc", *ZIG_OPTIONS, *step],
                    cwd=folder, capture_output=True, text=True, check=False, errors="replace",
                )  # fmt: skip
                if done.returncode:
                    told = done.stderr.strip()[:MOST_TOLD] or "no module"
                    raise CompileError(f"zig: {told}; update ziglang")
            return base64.b64encode((folder / "page.wasm").read_bytes()).decode()

    version = subprocess.run([*command, "version"], capture_output=True, text=True, check=False).stdout
    given = [version, *ZIG_OPTIONS, *LINK_OPTIONS, artifact.source, glue]
    return base64.b64decode(cache.kept("webassembly", given, built))
