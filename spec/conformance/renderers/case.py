"""What a case is: a rule, a picture to render, a question about some of its pixels, and the known answer.

1. A [`Rule`] is a sentence about all renderers; [`RULES`] are in the order in which one rests on another, so
   that the first one that is broken is the one to look at.
2. A [`Shot`] is a scene and how to render it. Its camera sees so little, or its radiance is so even, that all
   pixels of a block have one expected value.
3. A [`Question`] asks for the mean of a block of a layer; several may be about one shot. `intents` are the
   answers of renderers that deviate on purpose, by the name of a [`Profile`].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

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


RULES: Mapping[str, Rule] = {
    "finite": Rule("Every number of a picture is finite.", "a division by a cosine or a density of 0"),
    "radiance": Rule(
        "A picture holds linear radiance, neither scaled nor clipped.",
        "display encoding or exposure in the file, a clamp, a factor pi in what a lamp emits",
    ),
    "display": Rule(
        "A picture for a screen is clipped to [0, 1] and encoded by sRGB's transfer function.",
        "a power of 2.2, encoding twice or never, a film's response curve",
    ),
    "one-sided": Rule("A lamp emits from its front only.", "a normal that is not compared, mesh winding"),
    "misses": Rule(
        "Layers are 0 where nothing is hit.", "distances of 1e10 or infinity, normals that look on"
    ),
    "albedo": Rule(
        "Albedo is the surface's reflectance, of matte surfaces, metal, mirrors and glass.",
        "only the diffuse part is written: 0 for metal and glass",
    ),
    "normals": Rule(
        "Normals are unit vectors of world space on the side of the ray.",
        "camera space, a mapping to [0, 1], the mesh's own side",
    ),
    "depth": Rule("Depth is the distance along the ray.", "distance along the view, 1 / z, normalised depth"),
    "position": Rule("Position is the first hit in world space.", "camera space"),
    "matte": Rule(
        "A convex matte body shows its reflectance under a white sky.",
        "a factor pi or a cosine that is lost or twice there",
    ),
    "direct": Rule(
        "Direct light is reflectance / pi times the irradiance, which has a closed form.",
        "a lost cosine or distance squared, lights that are counted twice, wrong choice between lamps",
    ),
    "shadow": Rule("What is hidden sends no light.", "shadow rays that end too late or too early"),
    "mirror": Rule(
        "A mirror shows what is in the mirrored direction, times its reflectance.",
        "a mirrored direction about the wrong normal, too few bounces",
    ),
    "metal": Rule(
        "Rough metal shows a white sky as its microscopic mirrors do.",
        "roughness that is squared or not, another masking, compensated losses",
    ),
    "fresnel": Rule("Glass mirrors the share that Fresnel's equations give.", "Schlick's approximation"),
    "snell": Rule(
        "Glass refracts by Snell's law, and mirrors all beyond the critical angle.", "an inverse index"
    ),
    "glass": Rule(
        "Clear glass loses nothing under a white sky.", "too few bounces, absorption, a lost factor"
    ),
    "series": Rule(
        "In a closed room that emits 1 and reflects a, radiance is 1 / (1 - a).",
        "too few bounces, roulette without weights, energy that is lost or made",
    ),
    "bright": Rule("The same holds for any unit of radiance.", "a clamp of indirect light"),
    "caustic": Rule("Light reaches matte surfaces through glass.", "caustics that are left out"),
    "equilibrium": Rule(
        "Bodies that absorb nothing cannot be seen in a closed room of even radiance.",
        "a mirror or glass that gains or loses",
    ),
}
"""All rules by name: a later one's cases are made of what earlier ones are about."""


@dataclass(frozen=True)
class Profile:
    """A deviation by intent: its name is that of answers in [`Question.intents`]."""

    sentence: str


PROFILES: Mapping[str, Profile] = {
    "clamps": Profile("Indirect light is clamped."),
    "no-caustics": Profile("Light that glass or mirrors bring to matte surfaces is left out."),
    "separable-masking": Profile("Masking of rough metal is the product of both directions' own."),
    "compensates": Profile("Rough metal gets back what single scattering loses."),
    "schlick-metals": Profile(
        "Colours of metal and mirrors fade to white at grazing angles by Schlick's formula."
    ),
    "two-sided-lamps": Profile("Lamps emit from both sides."),
    "far-misses": Profile("Depth is at least 1e9 where nothing is hit."),
    "depth-along-view": Profile("Depth is the distance along the view."),
    "camera-normals": Profile("Normals are those of camera space."),
    "white-albedo": Profile("Albedo of mirrors, metal and glass is 1."),
    "diffuse-albedo": Profile("Albedo is that of the diffuse part: 0 of mirrors, metal and glass."),
}
"""Deviations by intent, by name."""


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
