"""Cases of all kinds that decide what others leave open: each kills changes of the C program that survived.

`python experiments/mutants.py --c99` changes the second implementation; a change that no case saw and that
alters an answer became one of these. They come after the kind's own cases [`asked`].
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....compiler.proof import ranges
from ....compiler.scenes.lower_scene import PATH, SURFACE
from ....refimpl.network import siren
from ..case import Case, Kind, Output
from ..functions import drawn
from . import files, network, paths, rules, scene_files, surfaces, whole
from .deep import FAR, GRAY, Place, along
from .views import SEED, VARIANTS, View, midway, rounded, sample_between

EQUAL = "range of single precision with decisions as the reference takes them: twins are equal to the bit"
"""Where the bounds of rays to two equal shapes come from."""

NEAR = 2.0**-14
"""Largest bound of a ray to twins: a wrong decision would move a number by a quarter at least."""

LIGHT_PX = 0
"""The counter of the pixel of light samples: column 0 of row 0."""


def asked(kind: Kind) -> Kind:
    """Return a kind with its cases of this module after its own."""
    more = MORE.get(kind.name)
    if more is None:
        return kind

    def make() -> Sequence[Case]:
        cases = list(kind.make())
        cases += (replace(case, id=f"{kind.name}/{n}") for n, case in enumerate(more(), len(cases)))
        return cases

    return replace(kind, make=make)


def _slabs() -> list[Case]:
    """Return rays with a component between 1e-15, the least that stays as it is, and twice as much."""
    cases = []
    for axis in range(3):
        for component in (-1.25e-15, 1.75e-15):
            direction = np.roll((0.0, 0.6, -0.8), axis)
            direction[axis] = component
            given = {"origin": (0.5, 0.0, 4.0), "direction": direction}
            inputs = {n: np.asarray(v, np.float32).astype(np.float64) for n, v in given.items()}
            expected, undecided = surfaces.SLABS.bounded(inputs)
            assert not undecided
            note = f"a component {'xyz'[axis]} of {component:g}"
            cases.append(Case("", "ISC-5", inputs, expected, (), note))
    return cases


# ---- paths ------------------------------------------------------------------------------------------------


TWIN_RAYS: tuple[tuple[str, Place, Place], ...] = (
    ("boxes", (0.25, -0.5, 4.0), (0.0, 0.0, -1.0)),
    ("boxes, from inside", (0.25, -0.5, 0.25), (0.0, 0.0, -1.0)),
    ("balls", (4.0, 0.5, 4.0), (0.0, 0.0, -1.0)),
    ("balls, from inside", (4.0, 0.5, 0.5), (0.0, 0.0, -1.0)),
    ("quads", (-3.25, 0.0, 4.0), (0.0, 0.0, -1.0)),
)
"""Rays to two equal shapes: which, origin and direction."""


def _twins() -> list[Case]:
    """Return rays that meet two equal shapes at once: the one of the lower number counts (SCN-2)."""
    cases = []
    for note, origin, direction in TWIN_RAYS:
        inputs = midway("twins", VARIANTS[0], direction, origin)
        view = View("twins", VARIANTS[0], 0, 0, 0)
        wanted = paths.arrive(paths._with_scene(inputs, view))
        program = paths.programs_of(view.scene, view.settings).arrive
        found = ranges.evaluate(program, paths._flat(inputs, PATH), guided=True)
        expected = {}
        for name, value in wanted.items():
            low, high, _ = paths._ends(found, name, {**PATH, **SURFACE}[name][0])
            low, high = (end.reshape(np.shape(value)) for end in (low, high))
            clause = paths.CLAUSES["path.arrive"].get(name, "")
            if name == "surface":
                expected[name] = Output(int(value), clause=clause)
                continue
            bound = np.maximum(high - value, value - low)
            assert np.max(bound) <= NEAR, f"{note}: {name}"
            expected[name] = Output(value, bound, EQUAL, clause=clause)
        cases.append(Case("", "ISC-1", inputs, expected, (), f"two equal {note}: the first counts", "LTR-8"))
    return cases


def _far() -> list[Case]:
    """Return light samples a thousand units out, where a lamp's point is lifted by its magnitude."""
    cases = list[Case]()
    for axis in range(3):
        point, up = along(axis, FAR, 0.125, 0.0625), along(axis, 1.0, 0.0, 0.0)
        down = along(axis, -1.0, 0.0, 0.0)
        state = midway("deep", VARIANTS[0], down, along(axis, FAR + 0.5, 0.125, 0.0625))
        inputs = {
            **state,
            "seed": SEED,
            "pixel": LIGHT_PX,
            "sample": sample_between(axis / 3 + 0.1, axis / 3 + 0.2, 0, 0),
            "depth": 0,
            "point": rounded(np.array(point)),
            "normal": rounded(np.array(up)),
            "reflectance": rounded(np.array(GRAY)),
            "t": 0.5,
            "surface": axis,
        }
        view = View("deep", VARIANTS[0], 0, 0, 0)
        wanted = paths.scatter(paths._with_scene(inputs, view))
        assert np.all(wanted["radiance"] > state["radiance"]), "the lamp must be seen"
        flat = {**paths._flat(inputs, PATH), **paths._flat(inputs, SURFACE), **paths._counted(inputs)}
        found = ranges.evaluate(paths.programs_of(view.scene, view.settings).scatter, flat)
        note = f"a lamp a thousand units below 0 along {'xyz'[axis]}"
        count = len(cases)
        paths._add(cases, "path.scatter", "LTR-7", inputs, wanted, found, "LTR-3", note)
        assert len(cases) == count + 1, f"{note}: a decision is not sure"
    return cases


# ---- networks and files -----------------------------------------------------------------------------------


def _unfit() -> list[Case]:
    """Return networks whose layers do not fit: the reference refuses them, as SIR-1 says."""
    good = network._as_inputs(siren.init([4, 5, 3], 3.0, 1.0, seed=0, dtype=np.float32))
    zeros: Callable[..., Any] = lambda *shape: np.zeros(shape, np.float32)  # noqa: E731
    changes: dict[str, dict[str, Any]] = {
        "a bias too few in the first layer": {"bias_0": zeros(4)},
        "a bias too many in the first layer": {"bias_0": zeros(6)},
        "one bias in the last layer": {"bias_1": zeros(1)},
        "weights of the last layer for a number less": {"weight_1": zeros(3, 4)},
        "weights of the last layer for a number more": {"weight_1": zeros(3, 6)},
        "an input too few": {"x": np.zeros(3)},
        "an input too many": {"x": np.zeros(5)},
    }
    rows = [(note, {**good, "x": np.zeros(4), **change}) for note, change in changes.items()]
    return [Case("", "SIR-1", inputs, None, (), note) for note, inputs in rows]


QUIET, BEYOND = 23, 4
"""Seeds of networks and windows, found by trying: see [`_on_windows`]."""


def _on_windows() -> list[Case]:
    """Return networks on windows that hardly vary, and with best weights beyond 127 on both sides.

    On the first ones the inputs vary by 0.28 and 0.12 squared steps, so that the 1 of WHO-14 decides; what is
    rounded is 0.047 from a tie. Of the second the largest weights are 127.7 and -127.5, 0.020 from a tie.
    """
    steps = np.floor((1.0 + 0.25 * np.arange(8)) * drawn("whole.quiet", QUIET, 24 * 8).reshape(24, 8))
    quiet = (np.float32(0.25) + steps / np.float32(127)).astype(np.float32).astype(np.float64)
    cases = []
    for note, seed, given in (
        ("windows of few steps: a spread below one step counts as one", QUIET, quiet),
        ("the best integers would be 128 and -128", BEYOND, None),
    ):
        net = siren.init([8, 4, 3], 3.0, 3.0, seed=seed)
        windows = whole._windows(seed, net) if given is None else given
        inputs = {**network._as_inputs(net), "size": 2, "amplitude": 127, "windows": windows}
        expected = {
            name: Output(value, 0.0, whole.CHOSEN, clause="WHO-7" if name[0] == "f" else "WHO-14")
            for name, value in whole._rounded_on(inputs).items()
        }
        cases.append(Case("", "WHO-14", inputs, expected, (), note))
    return cases


def _models() -> list[Case]:
    """Return a file whose header is not UTF-8, by one byte before ten that continue, and one of a number."""
    end = b"\x84\x8f\xbf\xbf"
    stray, shorter = b"\xff" + b"\x80" * 6 + end, b"\xff" + b"\x80" * 4 + end
    header, data = files._parts(files.file_of(files.MODEL))
    texts = {**header["__metadata__"], "later": 1}
    # As many bytes as letters, so that nothing else of the file is wrong.
    texts_of = {"rough paper": stray, "rough end": shorter}
    rows = [
        (
            "RDG-2",
            f"a byte 255 before {len(some) - 1}",
            files._text("note", note).replace(note.encode(), some),
        )
        for note, some in texts_of.items()
    ]
    numbered = files._joined({**header, "__metadata__": texts}, data)
    rows.append(("MOD-6", "a number among the texts, which is not known", numbered))
    return [
        Case("", clause, {"content": base64.b64encode(content).decode()}, None, (), note)
        for clause, note, content in rows
    ]


def _scenes() -> list[Case]:
    """Return a scene whose name escapes the characters beside halves of others, and one of a matte box."""
    cases = []
    for note, clause, text in (
        ("escapes beside halves of characters", "RDG-2", rules._named(r"\ud7ff\ue000")),
        (
            "boxes.0.material = lambertian",
            "SCN-8",
            rules.changed(("boxes.0.material", {"kind": "lambertian"})),
        ),
    ):
        inputs = {"text": text}
        expected = {name: Output(v, clause="SCN-8") for name, v in scene_files._scene(inputs).items()}
        cases.append(Case("", clause, inputs, expected, (), note, "RDG-2" if "halves" in note else "SCN-7"))
    return cases


MORE: Mapping[str, Callable[[], list[Case]]] = {
    "intersection.slabs": _slabs,
    "path.arrive": _twins,
    "path.scatter": _far,
    "network.forward": _unfit,
    "whole.rounded_on": _on_windows,
    "file.model": _models,
    "file.scene": _scenes,
}
"""More cases, by kind; their numbers follow those of the kind's own."""
