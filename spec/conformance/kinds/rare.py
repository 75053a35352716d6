"""Cases of all kinds that decide what others leave open: each kills changes of a program that survived.

`python experiments/mutants.py` changes the reference, and with `--c99` the second implementation; a change
that no case saw and that alters an answer became one of these. They come after the kind's own cases
[`asked`].
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....compiler.proof import ranges
from ....compiler.scenes.lower_scene import PATH, SURFACE
from ....refimpl.light import transport
from ....refimpl.light.shapes.shape import BLACK
from ....refimpl.light.transport import Settings
from ....refimpl.network import siren
from ....refimpl.network.dataset import Window
from ....refimpl.network.siren import Siren
from ....refimpl.network.whole import MOST_INPUTS
from ..case import Case, Kind, Output
from ..functions import drawn
from . import files, light, network, paths, pictures, records, rules, scene_files, surfaces, whole
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


def _spheres() -> list[Case]:
    """Return a ray whose first root is 1 exactly: nothing but 0 takes the least component's place."""
    given = {"origin": (0.75, 0.0, -0.625), "direction": (0.0, 0.0, 1.0)}
    inputs = {n: np.asarray(v, np.float32).astype(np.float64) for n, v in given.items()}
    expected, undecided = light.SPHERE.bounded(inputs)
    assert not undecided
    return [Case("", "ISC-6", inputs, expected, (), "the far root is 1")]


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
        program = paths.programs_of(view.scene, view.settings).parts["arrive"]
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
        found = ranges.evaluate(paths.programs_of(view.scene, view.settings).parts["scatter"], flat)
        note = f"a lamp a thousand units below 0 along {'xyz'[axis]}"
        count = len(cases)
        paths._add(cases, "path.scatter", "LTR-7", inputs, wanted, found, "LTR-3", note)
        assert len(cases) == count + 1, f"{note}: a decision is not sure"
    return cases


def _settings() -> list[Case]:
    """Return a path whose counts are the largest that there are."""
    most = transport.LARGEST_DEPTH - 1
    view = View("foundry", Settings(max_depth=most, roulette_depth=most), 3, 8, 0)
    given, cases = view.inputs(), list[Case]()
    wanted = paths.start(paths._with_scene(given, view))
    found = ranges.evaluate(
        paths.programs_of(view.scene, view.settings).parts["start"], paths._counted(given)
    )
    paths._add(cases, "path.start", "LTR-8", given, wanted, found, note=f"both depths {most}")
    return cases


def _arrivals() -> list[Case]:
    """Return rays to two equal shapes, and one to a block that shines, which no light sample finds."""
    start, end = (1.375, 1.5, 1.5), (1.4375, 0.375, -0.25)
    direction = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
    cases = list[Case]()
    for settings in VARIANTS[:2]:
        view = View("terrace", settings, 0, 0, 0)
        inputs = midway(view.scene, settings, tuple(direction), start)
        wanted = paths.arrive(paths._with_scene(inputs, view))
        found = ranges.evaluate(
            paths.programs_of(view.scene, settings).parts["arrive"], paths._flat(inputs, PATH)
        )
        note = f"a block that shines under a sky, {settings.strategy}"
        paths._add(cases, "path.arrive", "LTR-2", inputs, wanted, found, "LTR-10", note)
    return [*_twins(), *cases]


HALF = 24_091_914
"""The first sample of the pixel (8, 13) whose first light number is 1/2: the lamps', by ENV-4."""

RAIL_RAYS: tuple[tuple[str, str, Place, Place, Place, Place, int], ...] = (
    (
        "a lamp where metal is the last kind",
        "SHD-1",
        (0.96, 0.28, 0.0),
        (0.0, 1.0, 0.125),
        (0.0, -1.0, 0.0),
        BLACK,
        2,
    ),
    ("a floor under a dim lamp", "LTR-3", (0.0, -1.0, 0.0), (0.5, -1.0, 0.125), (0.0, 1.0, 0.0), GRAY, 0),
)
"""What is met, the clause of its light, direction, point, normal, reflectance and number of a surface."""


def _scatterings() -> list[Case]:
    """Return light samples far out, what a lamp and its floor scatter, and a choice at its threshold."""
    cases, view = _far(), View("rail", VARIANTS[0], 0, 0, 0)
    for note, clause, direction, point, normal, reflectance, surface in RAIL_RAYS:
        origin = np.subtract(point, direction)
        inputs = {
            **midway(view.scene, view.settings, direction, (origin[0], origin[1], origin[2])),
            "seed": SEED,
            "pixel": LIGHT_PX,
            "sample": 0,
            "depth": 0,
            "point": rounded(np.array(point)),
            "normal": rounded(np.array(normal)),
            "reflectance": rounded(np.array(reflectance)),
            "t": 1.0,
            "surface": surface,
        }
        wanted = paths.scatter(paths._with_scene(inputs, view))
        flat = {**paths._flat(inputs, PATH), **paths._flat(inputs, SURFACE), **paths._counted(inputs)}
        found = ranges.evaluate(paths.programs_of(view.scene, view.settings).parts["scatter"], flat)
        paths._add(cases, "path.scatter", "LTR-7", inputs, wanted, found, clause, note)
    tie = paths.Found([], [], [])
    paths._walk(tie, View("night", VARIANTS[0], 8, 13, HALF, "ENV-4", steps=1))
    return [*cases, *tie.scatter]


MANY = 258
"""Samples of a pixel whose numbers need more than 8 bits."""


def _pictures() -> list[Case]:
    """Return pictures with the ends of what seeds may be, and with many samples."""
    seeds = ((0, "the least seed"), ((1 << 32) - 1, "the largest seed"))
    rows = [(pictures.Exact("foundry", Settings(max_depth=0), 2, 2, 1, seed), note) for seed, note in seeds]
    rows.append((pictures.Exact("overcast", Settings(max_depth=0), 1, 1, MANY, SEED), f"{MANY} samples"))
    return [pictures.exact_case(exact, note) for exact, note in rows]


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


def _rounded() -> list[Case]:
    """Return a row whose sum limits its factor, just above an integer, and a layer of too many inputs."""
    flat = siren.init([1, 264, 1, 1], 3.0, 6.0, seed=7)
    ramp = np.sign(flat.weights[1]) * (1.0 - np.arange(264) / 2.0**13)
    zeros: Callable[..., Any] = lambda *shape: np.zeros(shape, np.int64)  # noqa: E731
    long = Siren((zeros(1, MOST_INPUTS + 1),), (zeros(1),), 1.0, 1.0)
    loud = siren.init([8, 6, 5, 3], 3.0, 2.0, seed=5)
    wide = Siren(
        (zeros(MOST_INPUTS + 1, 1), zeros(1, MOST_INPUTS + 1)), (zeros(MOST_INPUTS + 1), zeros(1)), 1.0, 1.0
    )
    one = siren.init([6, 5, 3], 3.0, 2.0, seed=5)
    rows = [
        (
            "a flat row: two steps for each weight",
            replace(flat, weights=(flat.weights[0], ramp, flat.weights[2])),
            511,
            1,
            True,
        ),
        (f"{MOST_INPUTS} inputs", Siren((zeros(1, MOST_INPUTS),), (zeros(1),), 1.0, 1.0), 127, 1, True),
        (f"{MOST_INPUTS + 1} inputs", long, 127, 1, False),
        (f"{MOST_INPUTS + 1} numbers in between", wide, 127, 1, False),
        ("6 inputs of a window of 2 x 2", one, 127, 2, False),
        ("colours that would need the fraction -1", whole._louder(loud, 38400.0), 127, 2, False),
    ]
    cases = []
    for note, net, amplitude, size, valid in rows:
        inputs = {**network._as_inputs(net), "size": size, "amplitude": amplitude}
        expected = whole.exact(whole._rounded(inputs)) if valid else None
        cases.append(Case("", "WHO-7", inputs, expected, (), note))
    return cases


LATER_FEATURES = "a window of one pixel of features that came later"
"""Names of features with other numbers of channels than those before."""


def _models() -> list[Case]:
    """Return files whose header is not UTF-8, by one byte before ten that continue; others."""
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
    later = replace(
        files.MODEL,
        siren=siren.init([14, 4, 3], 3.0, 1.0, seed=9, dtype=np.float32),
        features=("highlights", "history_weight", "history", "seen_depth", "smoothed", "seen_emission"),
        window=Window(1, "zero"),
    )
    good = {"content": base64.b64encode(files.file_of(later)).decode()}
    read = {name: Output(value) for name, value in files._model(good).items()}
    return [
        *(
            Case("", clause, {"content": base64.b64encode(content).decode()}, None, (), note)
            for clause, note, content in rows
        ),
        Case("", "MOD-2", good, read, (), LATER_FEATURES, "DAT-1"),
    ]


def _scenes() -> list[Case]:
    """Return scenes that are hard to read, of which some are to be refused.

    A name that escapes the characters beside halves of others; a matte box; rotations that exchange axes; a
    name that is no number; a sun that is a little too concentrated.
    """
    cases = []
    turned = ("boxes.0.rotation", [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    for note, clause, text in (
        ("boxes.0.rotation = x, y, z to z, x, y", "BOX-1", rules.changed(turned)),
        ("escapes beside halves of characters", "RDG-2", rules._named(r"\ud7ff\ue000")),
        (
            "boxes.0.material = lambertian",
            "SCN-8",
            rules.changed(("boxes.0.material", {"kind": "lambertian"})),
        ),
    ):
        inputs = {"text": text}
        expected = {name: Output(v, clause="SCN-8") for name, v in scene_files._scene(inputs).items()}
        refusal = "RDG-2" if "halves" in note else "BOX-1" if "rotation" in note else "SCN-7"
        cases.append(Case("", clause, inputs, expected, (), note, refusal))
    mirrored = ("boxes.0.rotation", [[1, 0, 0], [0, 0, 1], [0, 1, 0]])
    refused = (
        ("boxes.0.rotation exchanges y and z", "BOX-1", rules.changed(mirrored)),
        ("a name that is NaN", "RDG-2", rules.changed(("name", float("nan")))),
        ("a concentration of 1000001", "SCN-7", rules.under("sun_concentration", 1_000_001)),
    )
    return [*cases, *(Case("", clause, {"text": text}, None, (), note) for note, clause, text in refused)]


LONG_BYTES = 30_000
"""Length of a text that is far below the limit of RDG-2, and longer than all others."""


def _cameras() -> list[Case]:
    """Return cameras that are read: of a narrow angle, one unit from what they see, and in a long text."""
    rows = (
        ("an angle of half a degree", "SCN-7", records._text(vertical_fov_deg=0.5)),
        ("one unit away", "SCN-7", records._text(position=[0.5, 0, 1])),
        (f"{LONG_BYTES} bytes, nearly all of them white space", "RDG-2", records._text().ljust(LONG_BYTES)),
    )
    return [
        Case("", clause, inputs, {n: Output(v) for n, v in records._camera(inputs).items()}, (), note, clause)
        for note, clause, text in rows
        for inputs in [{"text": text}]
    ]


MORE: Mapping[str, Callable[[], list[Case]]] = {
    "intersection.slabs": _slabs,
    "intersection.sphere": _spheres,
    "path.start": _settings,
    "path.arrive": _arrivals,
    "path.scatter": _scatterings,
    "picture.exact": _pictures,
    "network.forward": _unfit,
    "whole.rounded": _rounded,
    "whole.rounded_on": _on_windows,
    "file.camera": _cameras,
    "file.model": _models,
    "file.scene": _scenes,
}
"""More cases, by kind; their numbers follow those of the kind's own."""
