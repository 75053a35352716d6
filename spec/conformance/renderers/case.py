"""What a case is: a rule, a picture to render, a question about some of its pixels, and the known answer.

1. A [`Rule`] is a sentence about all renderers; [`RULES`] are in the order in which one rests on another, so
   that the first one that is broken is the one to look at.
2. A [`Shot`] is a scene and how to render it. Its camera sees so little, or its radiance is so even, that all
   pixels of a block have one expected value.
3. A [`Question`] asks for the mean of a block of a layer; several may be about one shot. `intents` are the
   answers of renderers that deviate on purpose, by profile [`PROFILES`].
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from wamnet.refimpl.light.scene import Scene

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
