"""Compile a scene's paths for a target: passes, source, artifact.

1. Run the passes of the profile on each program (lower_scene.py has run the common ones).
2. Emit the source in the target's dialect for a number of paths at once [targets.py: Target.paths].
3. Put both together with a manifest [`compile_path`].

A path kernel has no error bound: its decisions may fall differently from the reference's where a path passes
an edge by less than the rounding error. Everything is a function of scene, settings, target, profile and
schedule, to the byte.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import CompileError
from ...refimpl.light.scene import Scene
from ...refimpl.reading import SIZES
from ..artifact import OneSource
from ..compile import asdict_finite
from ..core import ir, profiles
from ..core.ir import Image
from ..core.loops import Forms
from ..core.passes import pipeline
from ..core.profiles import Profile
from ..kernel import interface
from ..kernel.interface import Interface
from ..languages.dialect import Dialect
from ..languages.openings import IMAGES
from ..languages.renderer import Renderer
from ..plan import sine_contract
from ..schedules.schedules import PRINTED
from ..targets import integers_of, target_named
from . import emit_path
from .emit_path import Encoding
from .forms import as_statements
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

PAST_SUMS = ("seen_*: the same of what is seen past mirrors and glass; albedo times the tints on the way",)
"""What the planes of `see` mean."""


OF_SHADOWS = "direct_*: the lamps' light with shadows, by {0} shadow rays of each camera ray"
"""What the planes of `shadow` mean."""

OF_RAYS = "features are of {0} camera rays of the source {1}, whatever the number of samples: of one launch"
"""What else is to be known where features have rays of their own."""


@dataclass(frozen=True)
class PathArtifact(OneSource):
    """A compiled path kernel; `programs` are what was emitted, `planes` what it adds up, in order.

    With `images` it writes these, encoded, in place of the sums.
    """

    target: str
    profile: str
    lanes: int
    entry_point: str
    source: str
    source_name: str
    programs: PathPrograms
    planes: tuple[str, ...]
    manifest: Mapping[str, Any]
    images: tuple[Image, ...] = ()

    @property
    def interface(self) -> Interface:
        """Return what the kernel is bound to, in its language."""
        integers, numbers = integers_of(self.target, interface.PATH), len(self.programs.inputs)
        return interface.paths(len(self.planes), integers, numbers, self.images)

    @property
    def scene_numbers(self) -> NDArray[np.float32]:
        """Return the numbers (n,) of the scene that was compiled, which are inputs."""
        return np.array(self.programs.values, np.float32)


NO_LIMIT = 2**16
"""Planes of a kernel without a limit of its own: far more than there are."""


def forms_of(target: str) -> Forms:
    """Return the forms of a scene's primitives from which a target gains."""
    return target_named(target).forms


def most_planes(target: str, lanes: int) -> int:
    """Return how many planes a path kernel of a target adds up at most; NumPy's has no limit."""
    chosen = target_named(target)
    return chosen.dialect.max_planes if chosen.dialect and lanes in chosen.paths else NO_LIMIT


def can_move(target: str, scene: Scene, tables: Tables, inputs: SceneInputs) -> bool:
    """Tell whether one kernel of a target should take so many numbers of a scene that is laid out.

    A language takes so many, and tables with inputs are not loops: where a target would make loops of a
    scene's primitives, these do not move.
    """
    chosen = target_named(target)
    if chosen.dialect and len(inputs.places) > chosen.dialect.most_numbers:
        return False
    if not inputs.move_rows(tables):
        return True
    return as_statements(lay_out(scene, inputs.settings)["world"].geometry, chosen.forms)


def compile_path(
    programs: PathPrograms,
    target: str,
    profile: str = "ieee",
    lanes: int = 1,
    groups: Sequence[str] = emit_path.FRAME_GROUPS,
    encoding: Encoding | None = None,
) -> PathArtifact:
    """Return the kernel that follows the paths of a scene, `lanes` at once, and adds up groups of planes.

    With an encoding of these planes it writes its images, at their places in the whole picture.
    """
    chosen, promised = target_named(target), profiles.profile_named(profile)
    if not chosen.paths:
        raise CompileError(f"target {target} has no path kernels: use one that has them, such as opencl")
    if lanes not in chosen.paths:
        known = ", ".join(map(str, chosen.paths))
        raise CompileError(f"target {target} cannot trace {lanes} paths at once (choose one of {known})")
    programs = emit_path.asked(programs, groups)
    passed = {name: pipeline.run(part, promised.passes) for name, part in programs.parts.items()}
    emitted, dialect = replace(programs, parts=passed), chosen.dialect
    planes = tuple(emit_path.planes(groups))
    images = encoding.images if encoding else ()
    written = (*(_written(images) if images else SUMS), *_notes(programs, bool(images)))
    at_once = (dialect and dialect.at_once) or f"{lanes} {'path' if lanes == 1 else 'paths'}"
    header = _header(programs, dialect.language if dialect else chosen.language, promised, at_once, written)
    arguments = dialect.said[interface.PATH] if dialect else PRINTED
    if images:
        arguments = f"{IMAGES};\n{arguments.partition('{planes};' + chr(10))[2]}"
    arguments = arguments.format(lanes=lanes, planes="\n".join(textwrap.wrap(", ".join(planes), 98)))
    if dialect and programs.inputs:
        arguments += f".\n{dialect.said_numbers.format(count=len(programs.inputs))}"
    if dialect is None:
        text, suffix, entry = _printed(emitted, header), chosen.suffix, chosen.entry
    else:
        first, *others = arguments.split("\n")
        header += [f"arguments {first}", *(f"          {line}" for line in others)]
        text = source_of(emitted, dialect, groups, header, lanes, encoding)
        suffix, entry = dialect.suffix, dialect.entries[interface.PATH]
    facts = {
        "target": target,
        "language": chosen.language,
        "entry_point": entry,
        "lanes": lanes,
        "profile": {"name": promised.name, "text": promised.text},
        "sine": asdict_finite(sine_contract(profile, target)),
        "passes": [*PASSES, *promised.passes],
        **({"images": [image.facts for image in images]} if images else {"planes": list(planes)}),
        "sums": "; ".join(written),
        "arguments": arguments,
        **({"numbers": numbers_of(programs)} if programs.inputs else {}),
        **({"feature_rays": asdict(programs.rays)} if programs.rays else {}),
        **({"shadow_rays": programs.shadow_rays} if "shadow" in programs.parts else {}),
    }
    name = f"path{suffix}"
    manifest = {**facts, **_identity(emitted, name, text)}
    return PathArtifact(target, profile, lanes, entry, text, name, emitted, planes, manifest, images)


def source_of(
    programs: PathPrograms,
    dialect: Dialect,
    groups: Sequence[str],
    header: Sequence[str],
    lanes: int = 1,
    encoding: Encoding | None = None,
) -> str:
    """Return the kernel's source; `header` are the lines of the comment at its top."""
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
    kernel = emit_path.path_kernel(programs, dialect.path_lanes or lanes, groups, encoding)
    renderer = Renderer(dialect, kernel, False)
    if kernel.interface.images and not dialect.paints:
        raise CompileError(
            f"{language}: its path kernels write sums, not encoded images: compile the encoding as a "
            "separate kernel"
        )
    return renderer.source(header)


def numbers_of(programs: PathPrograms) -> list[dict[str, Any]]:
    """Return what a manifest says of each number that is an input: its index, value and places in tables."""
    return [
        {"index": index, "value": value, "places": [{"table": t, "index": i} for t, i in places]}
        for index, (value, places) in enumerate(zip(programs.values, programs.places, strict=True))
    ]


NAME_SHOWN = 60
"""Characters of a scene's name in a source's comment; the manifest has all of it."""


def _harmless(name: str) -> str:
    """Return a scene's name for a comment: a file's letters must not become a kernel's code."""
    return re.sub(r"[^A-Za-z0-9_. +-]", "_", name[:NAME_SHOWN])


def _written(images: Sequence[Image]) -> tuple[str, ...]:
    """Return what the numbers of encoded images mean."""
    described = (f"{i.name}: {i.channels} channels in {i.range_text}, {i.encoding}" for i in images)
    return (SUMS[0], "encoded features, means over the samples of one launch:", *described)


def _notes(programs: PathPrograms, encoded: bool) -> Iterator[str]:
    """Yield what else there is to say of the numbers, by the programs that they come from."""
    if "see" in programs.parts and not encoded:
        yield from PAST_SUMS
    if "shadow" in programs.parts:
        yield OF_SHADOWS.format(programs.shadow_rays)
    if programs.rays:
        yield OF_RAYS.format(programs.rays.count, programs.rays.sampler)


def _header(
    programs: PathPrograms, language: str, profile: Profile, at_once: str, written: Sequence[str]
) -> list[str]:
    """Return the lines of the comment at the top of the source, up to the arguments.

    `written` says what the numbers mean that are the result.
    """
    settings = [f"{key} {value}" for key, value in programs.settings.facts().items()]
    if programs.rays:
        settings.append(f"features of {programs.rays.count} camera rays, {programs.rays.sampler}")
    fixed = "camera, time and all of the scene: another moment is another kernel"
    if programs.inputs:
        fixed = f"all of the scene but {len(programs.inputs)} numbers: {interface.SCENE_NUMBERS}"
    return [
        f"wamnet path tracer, {language}. Generated: change the compiler, not this text.",
        f"scene     {_harmless(programs.scene)}, digest {programs.scene_digest[:32]}",
        f"paths     {', '.join(settings)}",
        f"schedule  {at_once} at once",
        f"profile   {profile.name}: {profile.text}",
        "bound     none: a path's decisions may fall differently near an edge",
        f"fixed     {fixed}",
        *(f"{'sums' if i == 0 else '':10}{line}" for i, line in enumerate(written)),
    ]


def _identity(programs: PathPrograms, name: str, text: str) -> dict[str, Any]:
    """Return what the manifest says of the scene, the programs and the source file `name`."""
    return {
        "schema": SCHEMA,
        "digest": ir.sha256(text.encode()),
        "scene": {"name": programs.scene, "digest": programs.scene_digest},
        "settings": programs.settings.facts(),
        "programs": {part: ir.digest(program) for part, program in programs.parts.items()},
        "bound": None,
        "files": {name: ir.sha256(text.encode())},
        SIZES: {name: len(text.encode())},
    }


def _printed(programs: PathPrograms, header: Sequence[str]) -> str:
    """Return the programs as text, which is all that the interpreter needs."""
    parts = [f"# {line}".rstrip() for line in header]
    for name, program in programs.parts.items():
        parts += [f"# {name}", ir.text(program).rstrip("\n")]
    return "\n".join(parts) + "\n"
