"""All languages, a row each [`LANGUAGES`]: how source is made, which schedules there are, and what runs it.

Those that an executor of the registry runs are in [`DENOISERS`]; the demo and the benchmark take those in
[`TARGETS`]. Other programs run the kernels of the rest. A language, or a schedule, is imported when it is
asked for first [`Lazy`].
"""

from __future__ import annotations

from collections import UserDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from importlib import import_module
from typing import Any

from ..refimpl.errors import CompileError, choice
from .core.loops import USUAL, Forms
from .core.profiles import IEEE, Profile, SineContract, profile_named
from .kernel.interface import BLOCK, PATH, TABLE
from .languages.dialect import Dialect
from .schedules.names import parse
from .schedules.schedules import PLAIN, Schedule


class Lazy(UserDict[str, Any]):
    """Values by name, each of which is made when it is asked for first."""

    def __getitem__(self, name: str) -> Any:
        if isinstance(found := self.data[name], partial):
            found = self.data[name] = found()
        return found


def _made(path: str, *args: Any, **parameters: Any) -> Any:
    """Return an object of a class of this part, by its module and its name."""
    module, _, kind = path.rpartition(".")
    return getattr(import_module(f".{module}", __package__), kind)(*args, **parameters)


@dataclass(frozen=True, eq=False)
class Language:
    """Something that runs kernels: its language, and what there is for it.

    `schedules` by name, the plain one first. `paths` are the numbers of paths that path kernels follow at
    once, none where there are no such kernels, nor kernels that encode; `forms` says what becomes of a
    scene's primitives. `planes`: for how many pixels in a work item there are kernels of the edge-avoiding
    filter; with 1 there is a history. `profile`: the numerical profile of the kernels.
    """

    dialect: Dialect
    schedules: Mapping[str, Schedule]
    paths: tuple[int, ...] = ()
    planes: tuple[int, ...] = ()
    forms: Forms = USUAL
    profile: Profile = IEEE

    @property
    def name(self) -> str:
        """Return the name."""
        return self.dialect.target

    @property
    def sine(self) -> SineContract:
        """Return what is promised of a sine."""
        return self.profile.sine or self.dialect.native_sine

    def under(self, name: str) -> Language:
        """Return the language under a numerical profile; CompileError lists those that exist."""
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

BYTES = "products of bytes, four at a time, of a network of integers"
"""The idea of schedules of bytes."""

Rungs = dict[str, "partial[Schedule]"]
"""What makes each schedule of a language, by name."""

FAMILIES = {
    PLAIN: ("plain.Plain", ""),
    "packed": ("plain.Packed", ""),
    "inlined": ("straight.Inline", ""),
    **dict.fromkeys(("vector", "tile"), ("tile.Tile", "lanes")),
    "fft": ("fft.Fourier", "lanes"),
    "fftpasses": ("passes.FourierPasses", "points"),
    "dot": ("bytes.Dot", "lanes"),
    "group": ("group.Grouped", "pixels"),
    "groupdot": ("bytes.GroupDot", "pixels"),
}
"""Class of schedules by family, and what the parameter in their names is [schedules/names.py]."""


def rungs(dialect: Dialect, *names: str, **more: Any) -> Rungs:
    """Return what makes the schedules of these names; `more`: parameters of theirs, or an idea."""
    found = {}
    for name in names:
        family, number = parse(name)
        path, parameter = FAMILIES[family]
        own = {parameter: number} if parameter else {}
        found[name] = partial(_made, f"schedules.{path}", dialect, name, **own, **more)
    return found


def groups(dialect: Dialect) -> Rungs:
    """Return the schedules for graphics processors: more pixels share weights, until registers are short."""
    one = "a tile of the image in memory that a work group shares; layers in registers, one pixel an item"
    of = {"group": dialect.group}
    found = rungs(dialect, "group:1", idea=one, **of)
    for pixels in (2, 4):
        idea = f"the same with {pixels} pixels an item, which share each weight"
        found |= rungs(dialect, f"group:{pixels}", idea=idea, instead="group:1", **of)
    if dialect.words:
        idea = f"group:4 with {BYTES}: {dialect.words}"
        found |= rungs(dialect, "groupdot:4", idea=idea, **of)
    return found


def processor(dialect: Dialect) -> Rungs:
    """Return the schedules of a language for processors, and for graphics processors where it has groups.

    There are register tiles in each width of vector that the language has, transforms in one kernel where
    those are several, since only then its functions take places in arrays, and bytes. Two tiles of 32 points
    side by side are as fast as four and take half the memory; one takes a third more time: the weights pass
    by twice as often.
    """
    found = rungs(dialect, PLAIN)
    for name, (pixels, idea) in TILES.items():
        lanes = parse(name)[1]
        if lanes in dialect.tiles and (pixels > 1 or dialect.wide):
            found |= rungs(dialect, name, idea=idea, pixels=pixels)
    transforms = len(dialect.tiles) > 1
    for lanes in dialect.tiles if transforms else ():
        tile = f"tile:{lanes}"
        sizes = {"pixels": TILES[tile][0], "points": 32, "tiles": 2}
        idea = f"the sums over the window by FFT, in tiles of 32 x 32 pixels and vectors of {lanes}"
        found |= rungs(dialect, f"fft:{lanes}", idea=idea, instead=tile, **sizes)
    found |= {} if transforms else rungs(dialect, "fftpasses:32")
    if dialect.dot_of_bytes:
        found |= rungs(dialect, "dot:16", idea=BYTES, pixels=14)
    return found | (groups(dialect) if dialect.group else {})


def fragments(dialect: Dialect) -> Rungs:
    """Return the schedules of fragment shaders, and those of compute shaders beside them."""
    compute = _made("languages.glsl.GLSLCompute")
    passes = rungs(compute, "fftpasses:32", instead="inlined")
    return rungs(dialect, PLAIN, "inlined") | passes | groups(compute)


Ladder = Sequence[str] | Callable[[Dialect], Rungs]
"""The schedules of a language: their names, or what makes them."""


def _of(dialect: Dialect, ladder: Ladder = (PLAIN,), **more: Any) -> Language:
    """Return the target of a language."""
    paths = (1,) if PATH in dialect.entries else ()
    found = ladder(dialect) if callable(ladder) else rungs(dialect, *ladder)
    return Language(dialect, Lazy(found), **{"paths": paths, **more})


def _named(path: str, ladder: Ladder = (PLAIN,), **more: Any) -> Language:
    """Return the target of the language of a class."""
    return _of(_made(f"languages.{path}"), ladder, **more)


def _placed(name: str, home: str, weight: str) -> Language:
    """Return a target whose weights are elsewhere."""
    return _of(LANGUAGES[name].dialect.placed(home, weight))


QUAD, PLAIN_INDEX = "weights[({index}) / 4][({index}) % 4]", "weights[{index}]"
"""A weight in a block of `vec4`, as std140 wants it; one in a table, or in memory of numbers."""

HOMES: Mapping[str, Mapping[str, str]] = {
    TABLE: dict.fromkeys(("metal", "cuda", "opencl", "c", "godot"), PLAIN_INDEX),
    BLOCK: {
        **dict.fromkeys(("opengl", "glsl-es", "glsl-vulkan", "glsl-compute", "wgsl"), QUAD),
        **dict.fromkeys(("metal", "opencl"), PLAIN_INDEX),
    },
}
"""Other places for weights than a target's usual one, and how a weight is read there, by target: a table in
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

LANES = (1, 4, 8, 16)
"""Numbers of paths that a work item of OpenCL follows at once, or of pixels that it filters."""

LANGUAGES: Mapping[str, Language] = Lazy(
    {
        "numpy": partial(
            _named,
            "listing.Listing",
            lambda dialect: rungs(dialect, PLAIN, idea="one operation after another, all pixels at once"),
            planes=(1,),
        ),
        "opencl": partial(
            _named, "opencl.OpenCL", processor, paths=LANES, planes=LANES, forms=Forms(trees=True)
        ),
        "opengl": partial(_named, "glsl.GLSL", fragments, planes=(1,), forms=MESA),
        "c": partial(_named, "c.C", processor, planes=(1,), forms=Forms(trees=True)),
        "glsl-es": partial(_named, "glsl_es.GLSLES", (PLAIN, "inlined", "packed"), forms=MESA),
        "glsl-compute": partial(_named, "glsl_buffers.Compute", processor),
        "glsl-vulkan": partial(_named, "glsl_buffers.Vulkan", processor),
        "wgsl": partial(_named, "wgsl.WGSL", processor),
        "cuda": partial(_named, "cuda.CUDA", processor),
        "metal": partial(_named, "metal.Metal", processor),
        "shadertoy": partial(_named, "glsl_es.ShadertoyDenoise", ("inlined",)),
        "godot": partial(_named, "glsl_es.GodotDenoise"),
        **{
            f"{name}:{home}": partial(_placed, name, home, weight)
            for home, languages in HOMES.items()
            for name, weight in languages.items()
        },
    }
)
"""All targets by name."""

TARGETS = ("numpy", "opencl", "opengl")
"""The targets that the demo and the benchmark show, by the name of the executor that runs them."""

DENOISERS = (*TARGETS, "c")
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
