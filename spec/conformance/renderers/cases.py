"""All cases: a rule, a picture to render, a question about some of its pixels, and the known answer.

1. A [`Rule`] is a sentence about all renderers; [`RULES`] are in the order in which one rests on another, so
   that the first one that is broken is the one to look at.
2. A [`Shot`] is a scene and how to render it: a row of `cases.json`, with its questions. A camera of one
   degree looks at a place where the answer is known; its pixels are samples of one value. Colours differ
   between channels, so that exchanged or joined channels show.
3. A [`Question`] asks for the mean of a block of a layer. `intents` are the answers of renderers that deviate
   on purpose, by profile [`PROFILES`]. Answers without a number in the file are computed [`COMPUTED`].
4. Layers are those of one wall through the origin, seen at 39 degrees by a camera whose axes are not those of
   the world, so that both kinds of normals differ; distances are requested in a corner of the picture, where
   those along the ray and along the view differ. Materials take turns on it. There distances change by 1.6
   and 0.9 per cent a pixel along its sides, points by twice that, and a layer that is not a mean over a pixel
   is of any point of it: hence their slack. Distances along the view are 11 per cent off.
5. Rooms scatter 64 times: of a reflectance of 0.8 the tail is 5e-7.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from wamnet.refimpl import encoding
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scene as scene_module
from wamnet.refimpl.light.camera import camera_basis
from wamnet.refimpl.light.scene import Camera, Scene

from . import answers

SLACK = 2e-3
"""How far a mean may be off without a statistical reason, in the answer's largest channel: half floats of a
picture round by 2**-11 = 5e-4; rays that leave a surface at a distance, and the curvature of an answer over a
view of a degree, are below 1e-3 in every scene. That of display-encoded levels is 0.6 / 255: half a level of
8 bits, and a tenth for tables of encoders."""

SIZE = 8
"""Pixels along each side of a picture: a few thousand of its paths are a mean that is nearly normal."""

Block = tuple[int, int, int, int]
"""Rows and columns of a picture: top, left, height, width."""


@dataclass(frozen=True)
class Rule:
    """A sentence that holds for every renderer, and what usually breaks it."""

    sentence: str
    suspects: str


_TEXTS = json.loads(Path(__file__).with_name("rules.json").read_text(encoding="utf-8"))
"""Sentences of rules, and of profiles."""

RULES: Mapping[str, Rule] = {name: Rule(*texts) for name, texts in _TEXTS["rules"].items()}
"""All rules by name: a later one's cases are made of what earlier ones are about."""

PROFILES: Mapping[str, str] = _TEXTS["profiles"]
"""Deviations by intent in a sentence, by the names of answers in [`Question.intents`]."""


@dataclass(frozen=True)
class Shot:
    """A scene to render: `size` square pixels, `spp` samples, at most `depth` scatterings.

    `layers`: albedo, normal, depth and position are requested too; `display`: an 8-bit picture for a screen.
    """

    name: str
    scene: Scene
    size: int = SIZE
    spp: int = 64
    depth: int = 16
    layers: bool = False
    display: bool = False


@dataclass(frozen=True)
class Question:
    """What the mean of a block of a layer must be: three numbers, or one for depth.

    `scale` is the unit of `slack` and of what must be detected: by default the answer's largest magnitude,
    or 1. An intent of None says that a renderer of that profile may show anything.
    """

    name: str
    rule: str
    shot: Shot
    answer: tuple[float, ...]
    source: str
    layer: str = "color"
    block: Block | None = None
    slack: float = SLACK
    intents: Mapping[str, tuple[float, ...] | None] = field(default_factory=dict)

    @property
    def scale(self) -> float:
        """The unit of deviations; that of levels of a screen is white."""
        return 1.0 if self.layer == "display" else max(map(abs, self.answer)) or 1.0


Answer = tuple[float, ...]

COLOR = (0.2, 0.5, 0.8)
"""Reflectance of matte surfaces."""

GLASS = 1.5
"""Index of glass, unless a case states another."""

SQUARE = (-1.0, 1.0, -1.0, 1.0)
"""The lamp above a floor."""

NORMAL = (0.48, 0.6, 0.64)
"""Unit normal of the wall: 0.2304 + 0.36 + 0.4096 = 1."""

CAMERA = Camera((3.36, 1.8, 0.48), (0.0, 0.0, 0.0), vertical_fov_deg=40.0)
"""The camera of the wall: three units along the normal and 2.4 along a tangent."""

TINTS = (0.9, 0.6, 0.3), (0.5, 0.8, 0.9)
"""Reflectances of two mirrors."""


def grey(value: float) -> Answer:
    """Return a colour of equal channels."""
    return (value, value, value)


def _lit(irradiance: float, weights: Answer = (1.0, 1.0, 1.0)) -> Answer:
    """Return what the matte floor shows under an irradiance, with weights of its channels."""
    return tuple(r * (weight * irradiance) / math.pi for r, weight in zip(COLOR, weights, strict=True))


def _below(x: float, z: float, height: float, radiance: float = 4.0) -> Answer:
    """Return what the floor shows below the square lamp."""
    return _lit(radiance * answers.rectangle_irradiance(x, z, SQUARE, height))


def _mirrored(angle_deg: float) -> float:
    """Return the share that glass mirrors at an angle."""
    return float(answers.fresnel(math.cos(math.radians(angle_deg)), GLASS))


def _hits() -> tuple[float, float, Any]:
    """Return the distances of the wall along the ray and the view, and the point, in the picture's corner."""
    return answers.plane_hits(CAMERA, 64, (0, 0, 1, 1), np.array(NORMAL))


def _two_mirrors() -> Answer:
    """Return the colour of two mirrors at 45 degrees that fade to white."""
    both = [answers.schlick(tint, math.sqrt(0.5)) for tint in TINTS]
    return tuple(a * b for a, b in zip(*both, strict=True))


def _in_camera() -> Answer:
    """Return the wall's normal in camera space."""
    basis = camera_basis(CAMERA)
    return tuple(float(np.dot(NORMAL, axis)) for axis in (basis.right, basis.up, -basis.forward))


def _metal(alpha: float, angle: float, correlated: bool) -> Answer:
    """Return what rough white metal shows of a white sky."""
    return grey(answers.rough_metal(angle, alpha, correlated))


def _shown(*sky: float) -> Answer:
    """Return a sky on a screen."""
    return tuple(float(encoding.to_display(np.array(channel))) for channel in sky)


COMPUTED: Mapping[str, Callable[[], Answer]] = {
    "display-dark": lambda: _shown(0.002, 0.02, 0.2),
    "display-light": lambda: _shown(0.5, 1.0, 4.0),
    "lamp-below": lambda: _below(0.0, 0.0, 1.0),
    "lamp-aside": lambda: _below(2.0, 1.0, 1.0),
    "lamp-close": lambda: _below(0.5, 0.0, 0.5),
    "lamps-two": lambda: _lit(
        answers.rectangle_irradiance(0.0, 0.0, (1.5, 2.5, -0.5, 0.5), 1.0), (1.0, 9.0, 5.0)
    ),
    "lamp-ball": lambda: _lit(8.0 * answers.sphere_irradiance(0.8, 2.0)),
    "half-shadow": lambda: _below(0.0, 0.0, 1.0, 2.0),
    "mirror, schlick-metals": lambda: tuple(2.0 * r for r in answers.schlick(TINTS[0], 0.5)),
    "mirrors-two, schlick-metals": _two_mirrors,
    "fresnel-60": lambda: grey(4.0 * _mirrored(60.0)),
    "fresnel-80": lambda: grey(4.0 * _mirrored(80.0)),
    "snell": lambda: grey((1.0 - _mirrored(45.0)) ** 2),
    "total-reflection": lambda: grey((1.0 - _mirrored(45.0)) ** 2),
    "floor-below-pane": lambda: tuple(answers.floor_below_pane(a, GLASS) for a in COLOR),
    "normal, camera-normals": _in_camera,
    "normal-turned, camera-normals": _in_camera,
    "depth": lambda: (_hits()[0],),
    "depth, depth-along-view": lambda: (_hits()[1],),
    "position": lambda: tuple(map(float, _hits()[2])),
    **{
        f"metal-{alpha:g}-{angle:g}{masking}": partial(_metal, alpha, angle, not masking)
        for alpha in (0.1, 0.5, 1.0)
        for angle in (0.0, 70.0)
        for masking in ("", ", separable-masking")
    },
}
"""Answers that have no number in the file, by question, or by question and profile."""


def _answer(name: str, stated: Any) -> Any:
    """Return the answer that the file states, None for any, or the one that it calls computed."""
    return COMPUTED[name]() if stated == "computed" else stated and tuple(stated)


def _question(shot: Shot, row: Mapping[str, Any]) -> Question:
    """Return the question of a row."""
    row = {name: tuple(value) if name == "block" else value for name, value in row.items()}
    intents = {p: _answer(f"{row['name']}, {p}", a) for p, a in row.pop("intents", {}).items()}
    return Question(shot=shot, answer=_answer(row["name"], row.pop("answer")), intents=intents, **row)


@cache
def questions() -> tuple[Question, ...]:
    """Return every question, in the order of rules."""
    rows = json.loads(Path(__file__).with_name("cases.json").read_text(encoding="utf-8"))
    head, found = {"format": scene_module.FORMAT, "version": scene_module.VERSION}, []
    for row in rows:
        scene = scene_module.from_json(json.dumps({**head, "name": row["name"], **row.pop("scene")}))
        asked = row.pop("questions")
        shot = Shot(scene=scene, **row)
        found += [_question(shot, question) for question in asked]
    return tuple(sorted(found, key=lambda question: list(RULES).index(question.rule)))


def chosen(words: Sequence[str]) -> tuple[Question, ...]:
    """Return the questions whose name holds one of these words or whose rule it is; all without words."""
    every = questions()
    if not words:
        return every
    for word in words:
        if not any(word in question.name or word == question.rule for question in every):
            rule = "no case's name holds it, and no rule is called so"
            raise InputError("-k", word, rule, f"rules are {', '.join(RULES)}")
    return tuple(q for q in every if any(word in q.name or word == q.rule for word in words))
