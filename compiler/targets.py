"""All languages, a row each [`LANGUAGES`]: how source is made, which schedules there are, and what runs it.

Those that an executor of the registry runs are in [`DENOISERS`]; the demo and the benchmark take those in
[`TARGETS`]. Other programs run the kernels of the rest.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from ..refimpl.errors import CompileError, choice
from .core.loops import USUAL, Forms
from .core.profiles import IEEE, Profile, SineContract, profile_named
from .kernel.interface import BLOCK, PATH, TABLE
from .languages.c import C
from .languages.cuda import CUDA
from .languages.dialect import Dialect
from .languages.glsl import GLSL, GLSLCompute
from .languages.glsl_buffers import Compute, Vulkan
from .languages.glsl_es import GLSLES, GodotDenoise, ShadertoyDenoise
from .languages.listing import Listing
from .languages.metal import Metal
from .languages.opencl import LANES, OpenCL
from .languages.wgsl import WGSL
from .schedules.bytes import Dot, GroupDot
from .schedules.fft import Fourier
from .schedules.group import Grouped
from .schedules.names import parse
from .schedules.passes import FourierPasses
from .schedules.plain import Packed, Plain
from .schedules.schedules import Schedule
from .schedules.straight import Inline
from .schedules.tile import Tile

HERE, SHOWN = "here", "shown"
"""Whether an executor runs a target's kernels, and one that the demo and the benchmark show."""


@dataclass(frozen=True)
class Language:
    """Something that runs kernels: its language, and what there is for it.

    `paths` are the numbers of paths that path kernels follow at once, none where there are no path kernels,
    and `forms` says what becomes of a scene's primitives. `planes`: for how many pixels in a work item there
    are kernels of the edge-avoiding filter; with 1 there is a history. `runs`: whether an executor of the
    registry runs them, and whether the demo shows it. `profile`: the numerical profile of the kernels.
    """

    dialect: Dialect
    schedules: tuple[Schedule, ...]
    paths: tuple[int, ...] = ()
    planes: tuple[int, ...] = ()
    forms: Forms = USUAL
    runs: str = ""
    profile: Profile = IEEE

    @property
    def name(self) -> str:
        """Return the name."""
        return self.dialect.target

    @property
    def language(self) -> str:
        """Return the name of the language, for a reader."""
        return self.dialect.language

    @property
    def encodes(self) -> bool:
        """Return whether there are kernels that encode features."""
        return PATH in self.dialect.entries

    @property
    def sine(self) -> SineContract:
        """Return what is promised of a sine."""
        return self.profile.sine or self.dialect.native_sine

    def under(self, name: str) -> Language:
        """Return the language under another numerical profile."""
        return self if name == self.profile.name else _with_profile(self, name)

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to other processes by name: schedules hold functions."""
        return _under, (self.name, self.profile.name)


@cache  # what is compiled for a language is kept by the language
def _with_profile(language: Language, name: str) -> Language:
    """Return a language with another profile."""
    return replace(language, profile=profile_named(name))


def _under(name: str, profile_name: str) -> Language:
    """Return the language of a target under a profile."""
    return language_named(name).under(profile_name)


TILES = {
    "vector:16": (1, "a layer's neurons side by side in vectors of 16, one pixel after another"),
    "tile:16": (14, "14 pixels share each weight: 28 vectors of 16 sums stay in registers"),
    "tile:8": (6, "the same for 16 registers of 8 numbers: 6 pixels, 12 vectors of sums"),
    "tile:4": (6, "the same for 16 registers of 4 numbers: 6 pixels, 12 vectors of sums"),
}
"""Pixels of a tile, and its idea: AVX-512, AVX2, and SSE or NEON have those registers."""


def passes(dialect: Dialect, instead: str = "group:4") -> tuple[Schedule, ...]:
    """Return the schedule of transforms for languages whose functions do not take such places."""
    return (FourierPasses(dialect, "fftpasses:32", instead=instead, points=32),)


def groups(dialect: Dialect) -> tuple[Schedule, ...]:
    """Return the schedules for graphics processors: more pixels share weights, until registers are short."""
    one = "a tile of the image in memory that a work group shares; layers in registers, one pixel an item"
    of = {"group": dialect.group}
    found: list[Schedule] = [Grouped(dialect, "group:1", one, pixels=1, **of)]
    for pixels in (2, 4):
        idea = f"the same with {pixels} pixels an item, which share each weight"
        found.append(Grouped(dialect, f"group:{pixels}", idea, pixels=pixels, instead="group:1", **of))
    if dialect.words:
        idea = f"group:4 with {Dot.idea}: {dialect.words}"
        found.append(GroupDot(dialect, "groupdot:4", idea, pixels=4, instead="group:4", **of))
    return tuple(found)


def _of(dialect: Dialect, *ladder: Schedule) -> Language:
    """Return the target of a language; `ladder` are its schedules after the plain one."""
    paths = (1,) if PATH in dialect.entries else ()
    return Language(dialect, (Plain(dialect), *ladder), paths)


def processor(dialect: Dialect) -> Language:
    """Return the target of a language for processors, and for graphics processors where it has groups.

    There are register tiles in each width of vector that the language has, transforms where its functions
    take places in arrays, and bytes. Two tiles of 32 points side by side are as fast as four and take half
    the memory; one takes a third more time: the weights pass by twice as often.
    """
    found: list[Schedule] = []
    for name, (pixels, idea) in TILES.items():
        lanes = parse(name)[1]
        if lanes in dialect.tiles and (pixels > 1 or dialect.wide):
            found.append(Tile(dialect, name, idea, lanes=lanes, pixels=pixels))
    for lanes in dialect.tiles if dialect.transforms else ():
        tile = f"tile:{lanes}"
        sizes = {"lanes": lanes, "pixels": TILES[tile][0], "points": 32, "tiles": 2}
        idea = f"the sums over the window by FFT, in tiles of 32 x 32 pixels and vectors of {lanes}"
        found.append(Fourier(dialect, f"fft:{lanes}", idea, instead=tile, **sizes))
    found += () if dialect.transforms else passes(dialect)
    if dialect.dot_of_bytes:
        found.append(Dot(dialect, "dot:16", lanes=16, pixels=14))
    return _of(dialect, *found, *(groups(dialect) if dialect.group else ()))


QUAD, PLAIN_INDEX = "weights[({index}) / 4][({index}) % 4]", "weights[{index}]"
"""A weight in a block of `vec4`, as std140 wants it; one in a table, or in memory of numbers."""

HOMES: Mapping[str, Mapping[type[Dialect], str]] = {
    TABLE: dict.fromkeys((Metal, CUDA, OpenCL, C, GodotDenoise), PLAIN_INDEX),
    BLOCK: {
        **dict.fromkeys((GLSL, GLSLES, Vulkan, Compute, WGSL), QUAD),
        **dict.fromkeys((Metal, OpenCL), PLAIN_INDEX),
    },
}
"""Other places for weights than a target's usual one, and how a weight is read there, by language: a table in
the source, or a uniform block.

Fragment shaders of GLSL have constants as straight code instead; compute shaders have no table: Mesa had not
compiled one of 770 numbers after a minute, and a buffer is there wherever they are.
"""

MESA = Forms(few=10000.0)
"""Most operations of primitives that become statements in fragment shaders. llvmpipe reads a table at a
loop's counter lane by lane, so a loop that Mesa does not unroll itself (it does up to some 30 trips) is two
to four times slower than statements; but it compiles the statements of 100 primitives of all kinds, which
take 8,000 operations, in 1 to 5 s, those of 300 in 9 to 60 s. A walk is slower still than a loop
(`wamnet bench primitives --executors opengl`)."""

LANGUAGES: Mapping[str, Language] = {
    target.name: target
    for target in (
        Language(
            Listing(),
            (Plain(Listing(), idea="one operation after another, all pixels at once"),),
            paths=(1,),
            planes=(1,),
            runs=SHOWN,
        ),
        replace(processor(OpenCL()), paths=LANES, planes=LANES, forms=Forms(trees=True), runs=SHOWN),
        replace(
            _of(GLSL(), Inline(GLSL()), *passes(GLSLCompute(), "inlined"), *groups(GLSLCompute())),
            planes=(1,),
            forms=MESA,
            runs=SHOWN,
        ),
        replace(processor(C()), planes=(1,), forms=Forms(trees=True), runs=HERE),
        replace(_of(GLSLES(), Inline(GLSLES()), Packed(GLSLES())), forms=MESA),
        *(processor(dialect()) for dialect in (Compute, Vulkan, WGSL, CUDA, Metal)),
        Language(ShadertoyDenoise(), (Inline(ShadertoyDenoise()),)),
        _of(GodotDenoise()),
        *(
            _of(language().placed(home, weight))
            for home, languages in HOMES.items()
            for language, weight in languages.items()
        ),
    )
}
"""All targets by name."""

TARGETS = {name: target for name, target in LANGUAGES.items() if target.runs == SHOWN}
"""The targets that the demo and the benchmark show, by the name of the executor that runs them."""

DENOISERS = {name: target for name, target in LANGUAGES.items() if target.runs}
"""All targets that an executor of the registry runs."""

ALIASES = {"glsl": "opengl"}
"""Other names of targets: those of their languages."""


def language_named(name: Language | str) -> Language:
    """Return the language of a target by name, or say which ones there are; one that is known is returned."""
    if isinstance(name, Language):
        return name
    if (known := ALIASES.get(name, name)) not in LANGUAGES:
        raise CompileError(f"target {name!r}: unknown ({choice(name, LANGUAGES)})")
    return LANGUAGES[known]


def schedule_named(language: Language | str, name: str) -> Schedule:
    """Return the schedule of this name in a language."""
    return {schedule.name: schedule for schedule in language_named(language).schedules}[name]
