"""Compile a scene's paths for a target: passes, source, artifact.

1. Run the passes of the profile on each program (lower_scene.py has run the common ones).
2. Emit the source in the target's dialect for a number of paths at once [targets.py: Language.paths].
3. Put both together with a manifest [`compile_path`].
4. A feature of a noisy picture is one pass of a host: a kernel that encodes what it adds up, over one sample
   per pixel, and returns channels [`feature_pass`, `HOSTS`].

A path kernel has no error bound: its decisions may fall differently from the reference's where a path passes
an edge by less than the rounding error. Everything is a function of scene, settings, target, profile and
schedule, to the byte.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from typing import Any

from ...refimpl.errors import CompileError
from ...refimpl.light.scene import Scene
from ...refimpl.network.dataset import Normalization
from ..artifact import Artifact
from ..compile import CALLED, Entry, asdict_finite, assemble
from ..core import ir
from ..core.passes import pipeline
from ..kernel import interface
from ..languages.dialect import Dialect
from ..languages.glsl_es import GodotDenoise, ShadertoyDenoise
from ..languages.renderer import Renderer
from ..targets import Language, language_named
from . import emit_path
from .emit_path import Encoding
from .encode_kernel import encoding_of, layers_of
from .hierarchy import as_statements
from .lower_scene import PASSES, PathPrograms
from .scene_inputs import SceneInputs, Tables, lay_out

SCHEMA = "wamnet-path-kernel-1"
"""Name and version of the manifest's form; described in spec/path_kernel.md."""


SUMS = (
    "row 0 is the picture's top row, in every language",
    "each plane but deviation_* is a sum over the samples: divide by their number, add over launches",
    "deviation_*: squared differences from the mean colour of this launch, summed; not to be added",
    "colour is linear radiance; depth is measured along the ray; normal, position and direction are those",
    "of world space; 0 where nothing is hit (a direction is always there)",
)
"""What the numbers mean that a kernel adds up: for whoever calls it."""


def can_move(language: Language | str, scene: Scene, tables: Tables, inputs: SceneInputs) -> bool:
    """Tell whether one kernel in a language should take so many numbers of a scene that is laid out.

    A language takes so many, and tables with inputs are not loops: where it would make loops of a
    scene's primitives, these do not move.
    """
    chosen = language_named(language)
    if len(inputs.places) > chosen.dialect.most_numbers:
        return False
    if not inputs.move_rows(tables):
        return True
    return as_statements(lay_out(scene, inputs.settings)["world"].geometry, chosen.forms)


def compile_path(
    programs: PathPrograms,
    language: Language | str,
    lanes: int = 1,
    groups: Sequence[str] = emit_path.FRAME_GROUPS,
    encoding: Encoding | None = None,
) -> Artifact:
    """Return the kernel that follows the paths of a scene, `lanes` at once, and adds up groups of planes.

    With an encoding of these planes it writes its images, at their places in the whole picture.
    """
    chosen = language_named(language)
    if not chosen.paths:
        raise CompileError(f"target {chosen.name} has no path kernels: use one that has them, such as opencl")
    if lanes not in chosen.paths:
        known = ", ".join(map(str, chosen.paths))
        raise CompileError(f"target {chosen.name} cannot trace {lanes} paths at once (choose one of {known})")
    programs = emit_path.asked(programs, groups)
    passed = {name: pipeline.run(part, chosen.profile.passes) for name, part in programs.parts.items()}
    emitted, dialect = replace(programs, parts=passed), chosen.dialect
    planes, images = emit_path.planes(groups), encoding.images if encoding else ()
    renderer = renderer_of(emitted, dialect, groups, lanes, encoding)
    described = (f"{i.name}: {i.channels} channels in {i.range_text}, {i.encoding}" for i in images)
    means = (SUMS[0], "encoded features, means over the samples of one launch:", *described)
    written = (*(means if images else SUMS), *_notes(programs, bool(images)))
    at_once = dialect.at_once or f"{lanes} {'path' if lanes == 1 else 'paths'}"
    entries = _entries(programs, chosen, at_once, written)
    facts = {
        "schema": SCHEMA,
        "lanes": lanes,
        "sine": asdict_finite(chosen.sine),
        "passes": [*PASSES, *chosen.profile.passes],
        **({"images": [image.facts for image in images]} if images else {"planes": list(planes)}),
        "sums": "; ".join(written),
        "scene": {"name": programs.scene, "digest": programs.scene_digest},
        "settings": programs.settings.facts(),
        "programs": {part: ir.digest(program) for part, program in passed.items()},
        **({"numbers": numbers_of(programs)} if programs.inputs else {}),
        **({"feature_rays": asdict(programs.rays)} if programs.rays else {}),
        **({"shadow_rays": programs.shadow_rays} if {"shadow", "past"} & set(programs.parts) else {}),
    }
    return assemble(
        "path tracer",
        chosen,
        renderer,
        list(passed.items()),
        [*entries, *([] if dialect.is_listing else [(CALLED, ())])],
        facts,
        emitted,
        images=images,
        lists={} if images else {interface.SUMS: planes},
        notes={"samples": "to add up"},
    )


def renderer_of(
    programs: PathPrograms,
    dialect: Dialect,
    groups: Sequence[str],
    lanes: int = 1,
    encoding: Encoding | None = None,
) -> Renderer:
    """Return the kernel with what prints it, or say which limit of a language it exceeds."""
    count, language = len(emit_path.planes(groups)), dialect.language
    if count > dialect.max_planes:
        raise CompileError(
            f"the kernel adds up {count} planes: {language} writes at most {dialect.max_planes}; request "
            "fewer groups"
        )
    if len(programs.inputs) > dialect.most_numbers:
        raise CompileError(
            f"{language}: its path kernels take at most {dialect.most_numbers} scene parameters, and "
            f"{len(programs.inputs)} move: compile for fewer times, or one"
        )
    if encoding and not dialect.paints:
        raise CompileError(
            f"{language}: its path kernels write sums, not encoded images: compile the encoding as a "
            "separate kernel"
        )
    kernel = emit_path.path_kernel(programs, dialect.path_lanes or lanes, groups, encoding)
    return Renderer(dialect, kernel, False)


def numbers_of(programs: PathPrograms) -> list[dict[str, Any]]:
    """Return what a manifest says of each number that is an input: its index, value and places in tables."""
    return [
        {"index": index, "value": value, "places": [{"table": t, "index": i} for t, i in places]}
        for index, (value, places) in enumerate(zip(programs.values, programs.places, strict=True))
    ]


def _notes(programs: PathPrograms, encoded: bool) -> Iterator[str]:
    """Yield what else there is to say of the numbers, by the programs that they come from."""
    if "see" in programs.parts and not encoded:
        yield "seen_*: the same of what is seen past mirrors and glass; albedo times the tints on the way"
    if {"shadow", "past"} & set(programs.parts):
        shadows = f"by {programs.shadow_rays} shadow rays of each camera ray"
        yield f"direct_*, seen_direct_*: emission and direct light, {shadows}"
    if programs.rays:
        rays = f"{programs.rays.count} camera rays of the source {programs.rays.sampler}"
        yield f"features are of {rays}, whatever the number of samples: of one launch"


def _entries(programs: PathPrograms, language: Language, at_once: str, written: Sequence[str]) -> list[Entry]:
    """Return the entries of the header, up to the arguments.

    `written` says what the numbers mean that are the result.
    """
    settings = [f"{key} {value}" for key, value in programs.settings.facts().items()]
    if programs.rays:
        settings.append(f"features of {programs.rays.count} camera rays, {programs.rays.sampler}")
    fixed = "camera, time and all of the scene: another moment is another kernel"
    if programs.inputs:
        fixed = f"all of the scene but {len(programs.inputs)} numbers: {interface.SCENE_NUMBERS}"
    # A file's letters must not become a kernel's code; the manifest has all of the name.
    scene = re.sub(r"[^A-Za-z0-9_. +-]", "_", programs.scene[:60])
    return [
        ("scene", [f"{scene}, digest {programs.scene_digest[:32]}"]),
        ("paths", [", ".join(settings)]),
        ("schedule", [f"{at_once} at once"]),
        ("profile", [": ".join(language.profile.facts.values())]),
        ("bound", ["none: a path's decisions may fall differently near an edge"]),
        ("fixed", [fixed]),
        ("sums", written),
    ]


# ---- passes of hosts --------------------------------------------------------------------------------------


class _ShadertoyPath(ShadertoyDenoise):
    """The words of a path, and of the encoding at its end, whose channels are those of a variable."""

    language = "Shadertoy (GLSL ES 3.00), one buffer a feature"
    most_numbers = 0
    paints = True
    fragment = ("at.x", "at.y")
    ends = {
        interface.PATH: """\
    return image;
}

void mainImage(out vec4 fragColor, in vec2 fragCoord)
{
    fragColor = wamnet_trace(ivec2(fragCoord), int(iResolution.x), int(iResolution.y), uint(iFrame));
}"""
    }
    main = "vec4 wamnet_trace(ivec2 at, int width, int height, uint seed_number)"
    beginning = (
        "    vec4 image = vec4(0.0, 0.0, 0.0, 1.0);",
        "    const int first_row = 0;",
        "    const int samples = 1;",
        "    const uint first_sample = 0u;",
    )
    numbers_of_host: Sequence[tuple[str, int]] = ()

    def uniforms(self, kernel: interface.Interface) -> list[str]:
        """Return the declarations of what the host sets."""
        return [f"uniform int {name} = {value};" for name, value in self.numbers_of_host]

    def read(self, array: interface.Array, index: Sequence[str], lanes: int) -> str:
        """Return a channel of the image."""
        return f"image[{index[-1]}]"


class _GodotPath(_ShadertoyPath):
    """The same for Godot, which knows no `precise` either and has words of its own for what is shared."""

    target = "godot"
    language = "Godot 4 shading language, one canvas item a feature"
    suffix = ".gdshader"
    first = GodotDenoise.first
    preamble = ""
    qualifiers = {}
    ends = {
        interface.PATH: """\
    return image;
}

void fragment()
{
    ivec2 at = ivec2(UV * vec2(float(width), float(height)));
    COLOR = wamnet_trace(at, uint(seed_number));
}"""
    }
    main = "vec4 wamnet_trace(ivec2 at, uint seed_value)"
    # What a script sets, with values to start with: the item's size in pixels, a number each frame.
    numbers_of_host = (("width", 512), ("height", 512), ("seed_number", 0))

    def integer(self, kernel: interface.Interface, name: str) -> str:
        """Return the text of an integer that the kernel is given."""
        return "seed_value" if name == "seed_number" else name


HOSTS = {"shadertoy": _ShadertoyPath(), "godot": _GodotPath()}
"""The dialect of a pass, by target; every frame of a host has random numbers of its own."""


def feature_pass(
    programs: PathPrograms,
    feature: str,
    normalization: Normalization,
    language: str,
    header: Sequence[str],
    whole: bool = False,
) -> str:
    """Return the pass that traces one sample a pixel and writes one encoded feature; `whole`: in integers."""
    encoding = encoding_of((feature,), normalization, whole=whole)
    return renderer_of(programs, HOSTS[language], layers_of((feature,)), encoding=encoding).source(header)
