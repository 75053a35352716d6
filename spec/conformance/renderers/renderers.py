"""How a renderer is asked: by a command for each picture or each shot, or in this process.

1. A [`Format`] writes a shot as a scene file; [`FORMATS`] has them by name.
2. [`ByCommand`] runs a command without a shell. Its words may hold {scene}, {output}, {seed}, {width},
   {height}, {samples} and {depth}; with {seeds} and {outputs}, lists with commas, one process makes all
   pictures of a shot. A process that ends with another status than 0, takes too long or writes nothing has
   failed, and the verdict has its last line.
3. [`Own`] is this project's path tracer on one of its executors.
4. [`KNOWN`] has the commands of renderers that the project has been run against.
5. Pictures come as .npz with layers by name, or as what the caller reads: .exr, and .png for a screen.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from wamnet.kernels.run.render_frame import render_frame
from wamnet.refimpl import encoding
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import to_json
from wamnet.refimpl.light.transport import Settings

from .cases import Shot
from .judgement import FAILED, UNTESTED, Missing, Picture
from .parts import NotExpressed, written
from .programs import printed, running, temporary

LIMIT_S = 300.0
"""Seconds after which a renderer's process counts as one that never ends."""

MOST_TOLD = 300
"""Most letters of what a process says that a verdict keeps."""

MOST_READ = 1 << 16
"""Most bytes of what a process says that are kept while it runs: the last ones."""

NPZ, EXR, PNG = ".npz", ".exr", ".png"
"""Ends of the names of pictures."""

OUTPUT, OUTPUTS, SEEDS = "{output}", "{outputs}", "{seeds}"
"""Words that say where one picture goes, or all of a shot, and the seeds of these."""

LISTS = (OUTPUTS, SEEDS)
"""Words of a command that runs for each shot; any other runs for each picture."""

Read = Callable[[Path], Picture]
"""Reads the layers of an .exr, or of a .png as layer `display`."""


@dataclass(frozen=True)
class Format:
    """A form of scene files: the end of their names, and what writes a shot for a seed.

    `intents`: profiles by which its words are meant, whoever reads them.
    """

    suffix: str
    write: Callable[[Shot, int], str]
    intents: tuple[str, ...] = ()


FORMATS: Mapping[str, Format] = {
    "wamnet": Format(".json", lambda shot, _: to_json(shot.scene)),
    "mitsuba": Format(".xml", partial(written, "mitsuba")),
    "blender": Format(".py", partial(written, "blender")),
    "povray": Format(".pov", partial(written, "povray")),
    "luxcore": Format(".py", partial(written, "luxcore")),
    "gltf": Format(".gltf", partial(written, "gltf"), ("schlick-metals",)),
    "three": Format(".json", partial(written, "three"), ("schlick-metals",)),
}
"""Forms of scene files by name: a new one is a file in `forms` and a line here."""


class Renderer(Protocol):
    """What makes pictures of shots."""

    @property
    def name(self) -> str:
        """Return what it is."""

    @property
    def intents(self) -> tuple[str, ...]:
        """Return the profiles that the form of its scenes implies."""

    def pictures(self, shot: Shot, seeds: Sequence[int]) -> Sequence[Picture] | Missing:
        """Return a picture for each seed, or why there are none."""


@dataclass(frozen=True)
class Own:
    """This project's path tracer."""

    executor: str = "numpy"
    finish: Callable[[Picture], Picture] = field(default=lambda picture: picture)
    intents: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Return what it is."""
        return f"wamnet ({self.executor})"

    def pictures(self, shot: Shot, seeds: Sequence[int]) -> Sequence[Picture]:
        """Return a picture for each seed."""
        settings = Settings(max_depth=shot.depth)
        found = []
        for seed in seeds:
            job = Job(shot.size, shot.size, shot.spp, seed, settings)
            layers = dict(render_frame(self.executor, shot.scene, job).frame.layers)
            if shot.display:
                layers["display"] = encoding.to_8bit(encoding.to_display(layers["color"])) / 255.0
            found.append(self.finish(layers))
        return found


@dataclass(frozen=True)
class ByCommand:
    """A program: its words with placeholders, the form of its scenes, and how its pictures are read.

    `output` ends the names of its pictures; `more`: further words by the end of a picture's name.
    """

    name: str
    form: str
    words: tuple[str, ...]
    read: Read
    output: str = EXR
    limit_s: float = LIMIT_S
    more: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def intents(self) -> tuple[str, ...]:
        """Return the profiles that the form of its scenes implies."""
        return FORMATS[self.form].intents

    def pictures(self, shot: Shot, seeds: Sequence[int]) -> Sequence[Picture] | Missing:
        """Return a picture for each seed, or why there are none."""
        with temporary("verify") as folder:
            try:
                return self._asked(shot, seeds, folder)
            except NotExpressed as error:
                return Missing(UNTESTED, f"format {self.form} has no {error}")
            except _Broken as error:
                return Missing(FAILED, str(error))

    def _asked(self, shot: Shot, seeds: Sequence[int], folder: Path) -> list[Picture]:
        """Write, run and read."""
        suffix = PNG if shot.display else self.output
        outputs = [folder / f"{shot.name}-{seed}{suffix}" for seed in seeds]
        form = FORMATS[self.form]
        together = any(mark in word for word in self.words for mark in LISTS)
        pairs = list(zip(seeds, outputs, strict=True))
        for group in [pairs] if together else [[pair] for pair in pairs]:
            scene = folder / f"{shot.name}-{group[0][0]}{form.suffix}"
            try:
                scene.write_text(form.write(shot, group[0][0]), encoding="utf-8")
            except OSError as error:  # the process of an earlier picture has removed the folder, or filled it
                raise _Broken(f"its scene cannot be written ({error.strerror})") from None
            self._run(self._filled(shot, scene, group), folder)
        return [self._read(path) for path in outputs]

    def _filled(self, shot: Shot, scene: Path, group: Sequence[tuple[int, Path]]) -> list[str]:
        """Return the command's words with what stands for placeholders."""
        values = {
            "{scene}": str(scene),
            "{output}": str(group[0][1]),
            "{seed}": str(group[0][0]),
            "{outputs}": ",".join(str(path) for _, path in group),
            "{seeds}": ",".join(str(seed) for seed, _ in group),
            "{width}": str(shot.size),
            "{height}": str(shot.size),
            "{samples}": str(shot.spp),
            "{depth}": str(shot.depth),
        }
        found = []
        for word in (*self.words, *self.more.get(group[0][1].suffix, ())):
            for mark, value in values.items():
                word = word.replace(mark, value)
            found.append(word)
        return found

    def _run(self, words: Sequence[str], folder: Path) -> None:
        """Run the command in a folder of its own; whatever goes wrong is reported."""
        none, pipe, both = subprocess.DEVNULL, subprocess.PIPE, subprocess.STDOUT
        try:
            with running(words, cwd=folder, stdin=none, stdout=pipe, stderr=both) as process:
                said = printed(process, MOST_READ, self.limit_s).decode(errors="replace")
        except subprocess.TimeoutExpired:
            raise _Broken(f"no answer in {self.limit_s:g} s") from None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise _Broken(f"{words[0]} cannot be run ({reason})") from None
        if process.returncode:
            last = (said.strip().splitlines() or ["nothing said"])[-1][:MOST_TOLD]
            raise _Broken(f"exit status {process.returncode}: {last}")

    def _read(self, path: Path) -> Picture:
        """Return the layers of a picture."""
        if not path.exists():
            raise _Broken(f"it ended well, and wrote no {path.suffix} where {{output}} said")
        try:
            if path.suffix == NPZ:
                with np.load(path, allow_pickle=False) as stored:
                    return {name: stored[name] for name in stored.files}
            return self.read(path)
        except (InputError, OSError, ValueError) as error:
            raise _Broken(f"its picture cannot be read: {error}") from None


class _Broken(Exception):
    """How a renderer failed to answer."""


def command_words(text: str) -> tuple[str, ...]:
    """Return the words of a command, or refuse one that cannot be asked."""
    try:
        words = tuple(shlex.split(text))
    except ValueError as error:
        raise InputError(
            "--command", text, f"it is not a command ({error})", "close quotation marks"
        ) from None
    has = {mark for mark in ("{scene}", OUTPUT, *LISTS) if any(mark in word for word in words)}
    if "{scene}" not in has or not has & {OUTPUT, OUTPUTS}:
        rule = "it must say where {scene} and {output} go, or {outputs} for all pictures of a shot"
        raise InputError("--command", text or "empty", rule, "for example: my_renderer {scene} {output}")
    if has & set(LISTS) and OUTPUTS not in has:
        rule = "one process for all {seeds} must know where all pictures go"
        raise InputError("--command", text, rule, "write {outputs} for {output}, or {seed} for {seeds}")
    return words


# ---- renderers that the project knows ---------------------------------------------------------------------


EACH = "{python} {scene} {seeds} {outputs}"
"""The command of a scene that is a Python script."""

KNOWN: Mapping[str, tuple[str, str, str]] = {
    "mitsuba": ("mitsuba", "{python} -m wamnet_verify.mitsuba_process {scene} {seeds} {outputs}", NPZ),
    "cycles": ("blender", EACH, EXR),
    "cycles-as-it-comes": ("blender", f"{EACH} --as-it-comes", EXR),
    "cycles-gltf": (
        "gltf",
        "{python} -m wamnet_verify.gltf_process {seeds} {outputs} {scene} {width} {samples} {depth}",
        EXR,
    ),
    "luxcore": ("luxcore", EACH, NPZ),
    "povray": ("povray", "povray +I{scene} +O{output} +W{width} +H{height} -D -GA -A", EXR),
}
"""Form of scenes, command and end of pictures of renderers by name, beside `wamnet` itself: a new one is a
line here. They need the packages mitsuba, bpy (without its dependencies), pyluxcore, and povray of Debian."""

MORE: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "povray": {EXR: ("+FE",), PNG: ("+FN8", "File_Gamma=sRGB")}
}
"""Further words of a known renderer by the end of a picture's name."""


def known(name: str, executor: str, read: Read, limit_s: float = LIMIT_S) -> Renderer:
    """Return a renderer by name, or refuse the name."""
    if name == "wamnet":
        return Own(executor)
    if name not in KNOWN:
        names = ", ".join(("wamnet", *KNOWN))
        raise InputError("--renderer", name, "it is unknown", f"known are {names}; or give --command")
    form, command, output = KNOWN[name]
    words = tuple(sys.executable if word == "{python}" else word for word in command.split())
    return ByCommand(name, form, words, read, output, limit_s, MORE.get(name, {}))
