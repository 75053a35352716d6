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
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiler import artifact as artifacts
from ...compiler.artifact import Artifact
from ...compiler.compile import compile_plan
from ...compiler.core import weights as weight_layout
from ...compiler.core.ir import OUTPUT_ENCODING, sha256
from ...compiler.core.lower import lower
from ...compiler.kernel.interface import DENOISE
from ...compiler.plan import plan_program
from ...compiler.scenes.encode_kernel import compile_encode, layers_of, learned_rays, sees
from ...compiler.scenes.lower_scene import PathPrograms, lower_scene
from ...compiler.scenes.path_kernel import compile_path, feature_pass
from ...compiler.schedules.common import kernel_gather
from ...compiler.schedules.names import remedy
from ...compiler.variants import FULL, Varied, parse, plan_model, vary
from ...refimpl.errors import NO_VALUE, ExecutorUnavailable, InputError, choice
from ...refimpl.light.scene import Scene
from ...refimpl.light.transport import Settings
from ...refimpl.network.denoise import Model, learned_feature_spp, learned_shadow_rays
from ...refimpl.network.domain import of_model
from ...refimpl.reading import SIZES
from . import bindings, check_pair, onnx_export, readme
from .hosts.headers import SCRATCH_NAME, scratch
from .hosts.host import HOSTS, Host, host_named
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
    host = host_named(request.host) if request.host else None
    request = replace(request, schedule=request.schedule or (host.schedule if host else ""))
    for wrong, option, value, rule, fix in _refusals(request, host):
        if wrong:
            raise InputError(option, value, rule, fix)
    return _finished(_graph(request) if request.target == ONNX else _compiled(request))


def _refusals(request: Request, host: Host | None) -> Iterator[tuple[Any, str, Any, str, str]]:
    """Yield what no export has: if it is asked for, the option, its value, the rule, and what to do."""
    leave, without = "leave it out", "leave it out, or leave --host out"
    model, target, schedule = request.model, request.target, request.schedule
    scene = request.scene.name if request.scene else None
    if host:
        no, alone = f"is not supported by host {host.name}", f"{leave}, or export with --target and no --host"
        runs = f"host {host.name} runs kernels of target {host.target}"
        yield target != host.target, "--target", target, runs, without
        lacking = ", ".join(name for name in model.features if host.features and name not in host.features)
        has = f"are not available in host {host.name}, which has {', '.join(host.features)}"
        yield lacking, "features of the model", lacking, has, "train it with these"
        yield request.scene and not host.scenes, "--scene", scene, f"{no}, which only denoises", alone
        yield request.motion, "--moving", NO_VALUE, f"{no}, which renders one time", alone
        one, other = f"{no}: it has one pass, and a rank needs two", "leave the rank out, or choose another"
        two = request.varied.rank > 0
        yield two and not host.ranks, "--variant", request.variant, one, f"{other} host"
        several = f"is several launches, and host {host.name} starts one for each kernel"
        yield schedule == PASSES, "--schedule", schedule, several, without
    if model.is_imported:
        own = f"the model was imported and reads {', '.join(model.features)}, not a scene's features"
        yield request.scene, "--scene", scene, own, leave
        graph = "the model was imported from a graph in this form"
        yield target == ONNX, "--target", target, graph, "use that file"
    if target == ONNX:
        paths = "a graph denoises; it traces no paths"
        yield request.scene, "--scene", scene, paths, f"{leave}, or choose another target"
        weights = request.weights
        yield weights not in ("", "inline"), "--weights", weights, "the graph contains them", leave
        yield schedule, "--schedule", schedule, "the runtime schedules it", leave


def _compiled(request: Request) -> Export:
    """Return the export of kernels, without what all exports have."""
    row = TARGETS[request.target]
    how = _one_of("--weights", request.weights, tuple(row.places), row.name, choice)
    place = row.places[how]
    at = f"{row.name} with --weights {how}"
    schedule = _one_of("--schedule", request.schedule, place.schedules, at, remedy)
    language = row.kernel(how).under(request.profile)
    plan = plan_model(request.model, language, schedule, request.variant)
    denoiser = compile_plan(plan)
    limits = _limits(request, row, place, denoiser)
    programs = _programs(request, row)
    path, encoder, passes = _of_scene(request, row, programs)
    made = {"path": path, "encode": encoder, "horizontal": denoiser.before, "denoise": denoiser}
    kernels = {role: kernel for role, kernel in made.items() if kernel is not None}
    sources = {role: row.files(kernel.role, kernel.source) for role, kernel in kernels.items()}
    sources |= {f"feature {name}": row.files(f"feature.{name}", text) for name, text in passes.items()}
    inputs = {} if request.model.is_imported else bindings.inputs_of(plan.model, row.language)
    files = _files(row, kernels, inputs, sources)
    if halves := _halves(denoiser):
        files[f"denoise/{HALVES_NAME}"] = halves
    others = []
    if request.motion:
        files[f"path/{ROWS_NAME}"] = request.motion.rows(request.settings).astype("<f4").tobytes()
        others = [request.motion.other(request.settings)]
    pair = check_pair.pair(plan, plan.model, plan.bound.output is not None, programs, others)
    held, first = denoiser.manifest, denoiser.kernels[0].manifest
    facts = {
        "language": row.text or row.language.dialect.language,
        **{name: held[name] for name in ("profile", "output", "bound")},
        "images": first["images"],
        "window": {"size": plan.model.window.size, "border": first["window"]["border"]},
        "assumes": plan.assumes,
        "certificate": f"denoise/{held['certificate']}" if held["certificate"] else None,
        "weights": {
            "where": how,
            **{name: held["weights"][name] for name in ("count", "order")},
            "file": f"denoise/{artifacts.WEIGHTS_NAME}",
            **({"half": f"denoise/{HALVES_NAME}"} if halves else {}),
        },
        "limits": limits,
        "schedules": list(place.schedules),
        "scene": _scene(request, programs),
        "kernels": bindings.kernels(row, kernels, sources),
        **({"inputs": bindings.input_facts(plan.model, inputs)} if inputs else {}),
    }
    return Export(request, files, facts, pair, denoiser, path, encoder, passes)


def _files(
    row: Row,
    kernels: Mapping[str, Artifact],
    inputs: Mapping[str, Artifact],
    sources: Mapping[str, Mapping[str, bytes]],
) -> dict[str, bytes]:
    """Return the files of all kernels by path."""
    files: dict[str, bytes] = {}
    beside = {f"{bindings.FOLDER}/{role}": kernel for role, kernel in inputs.items()}
    for role, kernel in {**kernels, **beside}.items():
        files |= {f"{role}/{name}": data for name, data in artifacts.files_of(kernel).items()}
        if row.slots == "header" and kernel.role == DENOISE:
            files[f"{role}/{SCRATCH_NAME}"] = scratch(kernel).encode()
    for role, found in sources.items():
        files |= {f"{bindings.folder_of(role)}/{name}": data for name, data in found.items()}
        if role not in kernels:
            _check(row.source, max(map(len, found.values())), row.name)
    return files


def _one_of(
    option: str, value: str, known: Sequence[str], where: str, fix: Callable[[str, Sequence[str]], str]
) -> str:
    """Return the value of an option, the first of those that are known by default, or refuse it."""
    if value and value not in known:
        rule = f"is not available for target {where}"
        raise InputError(option, value, rule, f"{fix(value, known)}, or leave it out")
    return value or known[0]


def _graph(request: Request) -> Export:
    """Return the export as an ONNX graph."""
    model = request.varied.model
    data, plan = onnx_export.graph(model), plan_program(lower(model), "numpy")
    pair, program = check_pair.pair(plan, model, promised=model.is_whole), plan.analysed
    count = sum(array.size for array in program.parameters.values())
    facts = {
        "scene": None,
        "images": [image.facts for image in kernel_gather(program).images],
        "window": {"size": model.window.size, "border": model.window.border},
        "output": {"name": "result", "channels": 3, "encoding": dict(program.info)[OUTPUT_ENCODING]},
        **onnx_export.promise(model),
        "certificate": None,
        "weights": {"where": "inline", "count": count, "file": None, "order": "initialisers"},
        "limits": [],
        "schedules": [],
        "kernels": [onnx_export.kernel(model)],
    }
    return Export(request, {"denoise/denoise.onnx": data}, facts, pair)


def _finished(export: Export) -> Export:
    """Return an export with what all manifests say, its host, its README, and hashes and lengths of files."""
    request, pair = export.request, export.pair
    files = {**export.files, **{f"check/{name}": data for name, data in pair.files().items()}}
    facts = {"schema": SCHEMA, "target": request.target, "licence": LICENCE, "check": pair.facts()}
    facts |= {"model": _model(request), **export.manifest}
    if request.host:
        host = host_named(request.host)
        facts["host"] = host.facts()
        first = next(iter(pair.images.values()))
        seen = first if first.shape[2] == 3 else pair.output
        files |= {**host.contents(facts), EXPECTED_NAME: beside(seen, pair.output)}
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
    forms = row.language.forms
    more = {"seen": seen, "rays": rays, "shadow_rays": learned_shadow_rays(request.model)}
    return lower_scene(request.scene, request.settings, forms, moving, **more)  # type: ignore[arg-type]


def _of_scene(
    request: Request, row: Row, programs: PathPrograms | None
) -> tuple[Artifact | None, Artifact | None, Mapping[str, str]]:
    """Return the kernels of a scene: paths and encoding, or passes that write a feature each."""
    if request.scene is None or programs is None:
        return None, None, {}
    model, language = request.varied.model, row.language.under(request.profile)
    scales, whole = model.normalization, model.is_whole
    if row.single:
        name = "".join(letter if letter.isalnum() else "_" for letter in request.scene.name[:60])
        header = [f"wamnet: a noisy feature of scene {name}, one sample a pixel."]
        passes = {
            each: feature_pass(programs, each, scales, row.name, header, whole) for each in model.features
        }
        return None, None, passes
    groups = tuple(dict.fromkeys(layers_of(model.features)))
    path = compile_path(programs, language, groups=groups)
    rays = programs.rays.count if programs.rays else 0
    encoder = compile_encode(model.features, scales, language, path.planes, whole, rays)
    return path, encoder, {}
