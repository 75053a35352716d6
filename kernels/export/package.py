"""An export: everything that another program needs to run a denoiser, and to find out whether it does.

1. Compile the denoiser for the target's language and place of weights, and with a scene its paths and the
   encoding of features [`export`]; what the host cannot take is refused with the name of its limit.
2. Each kernel has a folder of its own, as `wamnet compile` writes it, with its certificate; translations
   are beside the source that they are made from.
3. `check/` holds inputs, the reference's output and how far off each number may be [check_pair.py].
4. `manifest.json` says what there is and how it is bound [`manifest_of`], `README.md` how to call it.
5. With a host there is a whole program around it [hosts/], and the picture that it shows.

Everything is a function of model, scene and request, and of the translators' versions.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler import artifact as artifacts
from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.core import weights as weight_layout
from ...compiler.core.ir import sha256
from ...compiler.core.lower import lower
from ...compiler.kernel.interface import DENOISE
from ...compiler.plan import plan_program
from ...compiler.scenes.encode_kernel import compile_encode, layers_of, learned_rays, sees
from ...compiler.scenes.lower_scene import PathPrograms, lower_scene
from ...compiler.scenes.path_kernel import compile_path, feature_pass
from ...compiler.schedules.names import remedy
from ...compiler.targets import Language, language_named
from ...compiler.variants import FULL, Varied, parse, plan_model, vary
from ...refimpl.errors import ExecutorUnavailable, InputError, choice
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings
from ...refimpl.network.denoise import Model, learned_feature_spp, learned_shadow_rays
from ...refimpl.network.domain import of_model
from ...refimpl.network.whole import Whole
from ...refimpl.reading import SIZES
from . import bindings, check_pair, onnx_export, readme
from .hosts import scratch
from .hosts.table import HOSTS, host_named
from .motion import ROWS_NAME, Motion
from .targets import NAMES, ONNX, PASSES, TARGETS, Limit, Place, Row

SCHEMA = "wamnet-export-1"
"""Name and version of the manifest's form; spec/export.schema.json."""

LICENCE = (
    "The compiler's licence, Apache-2.0, makes no claim on what it writes: kernels, weights and texts of "
    "this export are yours, as the model is, without any condition of ours"
)
"""What a manifest says about rights."""

MANIFEST_NAME, README_NAME = "manifest.json", "README.md"
"""Files of every export."""

FILES, DIGEST = "files", "digest"
"""Entries of a manifest that hold the hashes of all files, and the hash of these."""

HALVES_NAME = "weights16.bin"
"""The weights in half precision, where they are halves (variant half16): half the bytes, the same numbers."""

EXPECTED_NAME = "expected.png"
"""What a host shows of the check pair, as the reference draws it."""

ENLARGED = 12
"""How many times as large each pixel is: the pair has few."""


@dataclass(frozen=True)
class Request:
    """What is wanted. `weights`: a place, `schedule`: one that has them there; the usual ones where empty.

    `motion`: what moves in the scene, which is that of its first moment. `host`: a program around it.
    """

    model: Model
    target: str
    scene: Scene | None = None
    profile: str = "ieee"
    weights: str = ""
    variant: str = FULL
    settings: Settings = field(default_factory=Settings)
    schedule: str = ""
    motion: Motion | None = None
    host: str = ""

    @cached_property
    def varied(self) -> Varied:
        """Return the variant of the model."""
        return vary(parse(self.variant), self.model)


@dataclass(frozen=True)
class Export:
    """A whole export: the manifest, all other files by path, and what they are made from."""

    request: Request
    files: Mapping[str, bytes]
    manifest: Mapping[str, Any]
    pair: check_pair.Pair
    denoiser: Artifact | None = None
    path: Artifact | None = None
    encoder: Artifact | None = None
    passes: Mapping[str, str] = field(default_factory=dict)

    @property
    def target(self) -> str:
        """Return the target's name."""
        return self.request.target

    def contents(self) -> Mapping[str, bytes]:
        """Return all files by path."""
        text = json.dumps(self.manifest, indent=2, sort_keys=True, allow_nan=False) + "\n"
        return {**self.files, MANIFEST_NAME: text.encode()}


def export(request: Request) -> Export:
    """Return the export of a model, or say which limit of the target it exceeds."""
    if request.target not in NAMES:
        fix = choice(request.target, [*NAMES, "html"])
        fix = f"a host's name: use --host {request.target}" if request.target in HOSTS else fix
        raise InputError("--target", request.target, "unknown", fix)
    request = _hosted(request)
    if request.model.is_imported:
        _check_imported(request)
    if request.target == ONNX:
        return _graph(request)
    row = TARGETS[request.target]
    how = request.weights or next(iter(row.places))
    if how not in row.places:
        rule = f"is not available for target {row.name}"
        raise InputError("--weights", how, rule, f"{choice(how, row.places)}, or leave it out")
    place = row.places[how]
    schedule = request.schedule or place.schedules[0]
    if schedule not in place.schedules:
        rule = f"is not available for target {row.name} with --weights {how}"
        raise InputError(
            "--schedule", schedule, rule, f"{remedy(schedule, place.schedules)}, or leave it out"
        )
    plan = plan_model(request.model, place.kernel, request.profile, schedule, request.variant)
    denoiser = compile_plan(plan)
    limits = _limits(request, row, place, denoiser)
    programs = _programs(request, row)
    path, encoder, passes = _of_scene(request, row, programs)
    made = {"path": path, "encode": encoder, "horizontal": denoiser.before, "denoise": denoiser}
    kernels = {role: kernel for role, kernel in made.items() if kernel is not None}
    files: dict[str, bytes] = {}
    for role, kernel in kernels.items():
        held = {**artifacts.files_of(kernel), **row.files(kernel.role, kernel.source)}
        if row.slots == "header" and kernel.role == DENOISE:
            held[scratch.NAME] = scratch.header(kernel).encode()
        files |= {f"{role}/{name}": data for name, data in held.items()}
    if halves := _halves(denoiser):
        files[f"denoise/{HALVES_NAME}"] = halves
    for name, text in passes.items():
        found = row.files(f"feature.{name}", text)
        files |= {f"features/{n}": data for n, data in found.items()}
        _check(row.source, max(map(len, found.values())), row.name)
    model, promised = plan.model, plan.bound.output is not None
    others = []
    if request.motion:
        files[f"path/{ROWS_NAME}"] = request.motion.rows(request.settings).astype("<f4").tobytes()
        others = [request.motion.other(request.settings)]
    pair = check_pair.pair(plan, model, promised, programs, others)
    files |= {f"check/{name}": data for name, data in pair.files().items()}
    made_by = [] if request.model.is_imported else bindings.inputs_of(model, _usual(row))
    for each in made_by:
        folder = f"{bindings.FOLDER}/{each.name}"
        files |= {f"{folder}/{name}": data for name, data in artifacts.files_of(each.kernel).items()}
    facts = _facts(request, row, how, denoiser, limits, bool(halves)) | {"schedules": list(place.schedules)}
    facts["scene"] = _scene(request, programs)
    facts["kernels"] = bindings.kernels(row, kernels, passes)
    facts |= {"inputs": bindings.input_facts(made_by)} if made_by else {}
    return _finished(Export(request, files, facts, pair, denoiser, path, encoder, passes))


def _check_imported(request: Request) -> None:
    """Refuse what only a model of features has: a scene before it, a graph that it was not made of."""
    way_out = "leave it out"
    if request.scene is not None:
        rule = f"the model was imported and reads {', '.join(request.model.features)}, not a scene's features"
        raise InputError("--scene", request.scene.name, rule, way_out)
    if request.target == ONNX:
        rule = "the model was imported from a graph in this form"
        raise InputError("--target", request.target, rule, "use that file")


def _hosted(request: Request) -> Request:
    """Return a request with what its host wants of an export, or refuse what the host does not run."""
    if not request.host:
        return request
    host = host_named(request.host)
    if request.target != host.target:
        rule = f"host {host.name} runs kernels of target {host.target}"
        raise InputError("--target", request.target, rule, "leave it out, or leave --host out")
    scene = None if request.scene is None else request.scene.name
    two = request.varied.rank > 0
    host.check(scene, request.motion is not None, two, request.variant, request.model.features)
    weights, schedule = request.weights or host.weights, request.schedule or host.schedule
    if schedule == PASSES:
        rule = f"is several launches, and host {host.name} starts one for each kernel"
        raise InputError("--schedule", schedule, rule, "leave it out, or leave --host out")
    return replace(request, weights=weights, schedule=schedule)


def _graph(request: Request) -> Export:
    """Return the export as an ONNX graph."""
    if request.scene is not None:
        rule = "a graph denoises; it traces no paths"
        raise InputError("--scene", request.scene.name, rule, "leave it out, or choose another target")
    if request.weights not in ("", "inline"):
        raise InputError("--weights", request.weights, "the graph contains them", "leave it out")
    if request.schedule:
        raise InputError("--schedule", request.schedule, "the runtime schedules it", "leave it out")
    model = request.varied.model
    data, plan = onnx_export.graph(model), plan_program(lower(model), "numpy")
    pair, network = check_pair.pair(plan, model, promised=model.is_whole), model.siren
    factors = network.factors if isinstance(network, Whole) else ()
    count = sum(array.size for array in (*network.weights, *network.biases, *factors))
    files = {"denoise/denoise.onnx": data}
    files |= {f"check/{name}": content for name, content in pair.files().items()}
    facts = {
        "model": _model(request),
        "scene": None,
        "images": bindings.images(model),
        "window": {"size": model.window.size, "border": model.window.border},
        "output": {"name": "result", "channels": 3, "encoding": bindings.encoding(model)},
        **onnx_export.promise(model),
        "certificate": None,
        "weights": {"where": "inline", "count": count, "file": None, "order": "initialisers"},
        "limits": [],
        "schedules": [],
        "kernels": [onnx_export.kernel(model)],
    }
    return _finished(Export(request, files, facts, pair))


def _finished(export: Export) -> Export:
    """Return an export with what all manifests say, its host, its README, and hashes and lengths of files."""
    request, pair, files = export.request, export.pair, export.files
    facts = {"schema": SCHEMA, "target": request.target, "licence": LICENCE, "check": pair.facts()}
    facts |= export.manifest
    if request.host:
        host = host_named(request.host)
        facts["host"] = host.facts()
        first = next(iter(pair.images.values()))
        seen = first if first.shape[2] == 3 else pair.output
        files = {**files, **host.contents(facts), EXPECTED_NAME: beside(seen, pair.output)}
    return _closed(replace(export, files=files, manifest=facts))


def beside(noisy: NDArray[np.float32], output: NDArray[np.float32]) -> bytes:
    """Return the pair's colour (H, W, 3) and the reference's output beside it, enlarged, as a file.

    Raises `ExecutorUnavailable` where Pillow is not installed.
    """
    try:
        from PIL import Image
    except ImportError:
        raise ExecutorUnavailable("Pillow is not installed: pip install 'wamnet[full]'") from None
    both = np.concatenate([noisy, output], axis=1).clip(0, 1)
    large = both.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    file = io.BytesIO()
    Image.fromarray((255 * large + 0.5).astype(np.uint8)).save(file, format="PNG", optimize=True)
    return file.getvalue()


def _closed(export: Export) -> Export:
    """Return an export with its README, and with hashes and lengths of all files in its manifest."""
    facts = {name: value for name, value in export.manifest.items() if name not in (FILES, SIZES, DIGEST)}
    host = host_named(export.request.host) if export.request.host else None
    files = {name: data for name, data in export.files.items() if name != README_NAME}
    text = readme.readme(facts, export.denoiser, host, {name: len(data) for name, data in files.items()})
    files[README_NAME] = text.encode()
    hashes = {name: sha256(data) for name, data in sorted(files.items())}
    digest = sha256(*(value.encode() for value in hashes.values()))
    named = {FILES: hashes, SIZES: {name: len(files[name]) for name in hashes}, DIGEST: digest}
    manifest = json.loads(json.dumps({**facts, **named}, allow_nan=False))
    return replace(export, files=files, manifest=manifest)


def with_speed(export: Export, speed: Mapping[str, Any]) -> Export:
    """Return an export that says how long it takes: `speed` in its manifest, a line in its README."""
    return _closed(replace(export, manifest={**export.manifest, "speed": speed}))


def _facts(
    request: Request,
    row: Row,
    how: str,
    denoiser: Artifact,
    limits: Sequence[Mapping[str, Any]],
    halves: bool,
) -> dict[str, Any]:
    """Return the entries of a manifest other than kernels and files."""
    held = denoiser.manifest
    first = denoiser.kernels[0].manifest
    return {
        "language": row.text,
        "profile": held["profile"],
        "model": _model(request),
        "images": first["images"],
        "window": {"size": denoiser.plan.model.window.size, "border": first["window"]["border"]},
        "output": held["output"],
        "bound": held["bound"],
        "assumes": denoiser.plan.assumes,
        "certificate": f"denoise/{held['certificate']}" if held["certificate"] else None,
        "weights": {
            "where": how,
            "count": held["weights"]["count"],
            "file": f"denoise/{artifacts.WEIGHTS_NAME}",
            "order": held["weights"]["order"],
            **({"half": f"denoise/{HALVES_NAME}"} if halves else {}),
        },
        "limits": list(limits),
    }


def _halves(denoiser: Artifact) -> bytes:
    """Return the weights as little-endian halves, where these are exactly the same numbers; else nothing."""
    with np.errstate(over="ignore"):  # what is too large becomes infinite, not a half
        halves = denoiser.weights.astype("<f2")
    return halves.tobytes() if np.array_equal(halves.astype(np.float32), denoiser.weights) else b""


def _scene(request: Request, programs: PathPrograms | None) -> dict[str, Any] | None:
    """Return what a manifest says about the scene, and about the numbers of it that move."""
    if request.scene is None or programs is None:
        return None
    numbers = {"numbers": request.motion.facts(programs)} if request.motion else {}
    rays = asdict(programs.rays) if programs.rays else None
    return {
        "name": request.scene.name,
        "settings": request.settings.facts(),
        "feature_rays": rays,
        **numbers,
    }


def _model(request: Request) -> dict[str, Any]:
    """Return what a manifest says about the model."""
    varied, domain = request.varied.model, of_model(request.model)
    return {
        **({"domain": asdict(domain)} if domain else {}),
        "features": list(varied.features),
        "widths": [varied.siren.weights[0].shape[1], *(len(b) for b in varied.siren.biases)],
        "variant": request.variant,
        "feature_spp": learned_feature_spp(request.model) or 1,
    }


def _check(limit: Limit | None, needs: float, name: str) -> list[dict[str, Any]]:
    """Return what a manifest says about a limit, or refuse what exceeds it."""
    if limit is None:
        return []
    if needs > limit.most:
        rule = f"{name} takes at most {limit.most}"
        raise InputError(limit.name, int(np.ceil(needs)), rule, limit.way_out)
    return [{"name": limit.name, "needs": int(np.ceil(needs)), "most": limit.most}]


def _limits(request: Request, row: Row, place: Place, denoiser: Artifact) -> list[dict[str, Any]]:
    """Return the limits that an export keeps, or refuse it."""
    found = []
    for kernel in denoiser.kernels:
        count = sum(array.size for array in weight_layout.weights(kernel.programs).values())
        found += _check(place.limit, place.each * count, row.name)
        picked = kernel.manifest["schedule"]
        if "reason" in picked and request.schedule:
            rule = f"cannot hold this model: {picked['reason']}"
            raise InputError("--schedule", request.schedule, rule, "leave it out, or choose another")
        if picked["name"] not in place.schedules:
            rule = f"is not possible for this model: {picked['reason']}"
            raise InputError("--weights", "inline", rule, "choose another with --weights")
        gather = kernel.programs.gather
        assert gather is not None, "kernels have windows"
        found += _check(row.most_images, len(gather.images), row.name)
        found += _check(row.source, len(kernel.source), row.name)
    if row.single and denoiser.before is not None:
        rule = f"target {row.name} has one pass for the denoiser, and a rank is two"
        raise InputError("--variant", denoiser.manifest["variant"]["name"], rule, "leave the rank out")
    return found


def _programs(request: Request, row: Row) -> PathPrograms | None:
    """Return the programs of a scene's paths, as the target unrolls them."""
    if request.scene is None:
        return None
    if request.motion and row.single:
        rule = f"the passes of target {row.name} have no place for numbers of a scene"
        raise InputError("--moving", ", ".join(request.motion.kinds), rule, "leave it out")
    moving = request.motion.inputs(request.settings) if request.motion else None
    seen = sees(request.model.features)
    # A pass of a host writes a feature of one sample.
    rays = None if row.single else learned_rays(request.model, request.settings)
    forms = _usual(row).forms
    more = {"seen": seen, "rays": rays, "shadow_rays": learned_shadow_rays(request.model)}
    return lower_scene(request.scene, request.settings, forms, moving, **more)  # type: ignore[arg-type]


def _usual(row: Row) -> Language:
    """Return the language of a target, wherever weights are."""
    return language_named(next(iter(row.places.values())).kernel.partition(":")[0])


def _of_scene(
    request: Request, row: Row, programs: PathPrograms | None
) -> tuple[Artifact | None, Artifact | None, Mapping[str, str]]:
    """Return the kernels of a scene: paths and encoding, or passes that write a feature each."""
    if request.scene is None or programs is None:
        return None, None, {}
    model, language = request.varied.model, _usual(row)
    scales, whole = model.normalization, model.is_whole
    if row.single:
        name = "".join(letter if letter.isalnum() else "_" for letter in request.scene.name[:60])
        header = [f"wamnet: a noisy feature of scene {name}, one sample a pixel."]
        passes = {
            each: feature_pass(programs, each, scales, row.name, header, whole) for each in model.features
        }
        return None, None, passes
    groups = tuple(dict.fromkeys(layers_of(model.features)))
    path = compile_path(programs, language, request.profile, groups=groups)
    rays = programs.rays.count if programs.rays else 0
    encoder = compile_encode(model.features, scales, language, request.profile, path.planes, whole, rays)
    return path, encoder, {}
