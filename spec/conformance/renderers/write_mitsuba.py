"""A shot as a scene file of Mitsuba 3 (XML, version 3.0.0).

1. Integrator `path` without Russian roulette; it counts edges of a path, one more than scatterings. Where
   layers are requested it is inside of `aov`: albedo, shading normal, depth, position.
2. A sheet that reflects is two-sided. One that emits on both sides is two of them back to back: Mitsuba's
   area emitters emit to the front. What emits and is a mirror, metal or glass is not expressed.
3. Metal is `roughconductor` of GGX whose reflectance is the same at all angles (`material` none): questions
   about the colour of tinted metal are not asked.

Source: Mitsuba 3's documentation of plugins, https://mitsuba.readthedocs.io.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wamnet.refimpl.light.scene import Camera

from .cases import Shot
from .parts import GLASS, MATTE, METAL, MIRROR, Array, Look, Parts, Sheet, axes_of, parts_of, text

LAYERS = "albedo:albedo,normal:sh_normal,depth:depth,position:position"
"""Names and kinds of arbitrary output variables."""


def write(shot: Shot, seed: int) -> str:
    """Return the scene file of a shot for a seed; raises NotExpressed."""
    lines = ['<scene version="3.0.0">', *_integrator(shot), _sensor(shot, seed)]
    if any(shot.scene.background):
        lines += ['<emitter type="constant">', _rgb("radiance", shot.scene.background), "</emitter>"]
    lines += _shapes(parts_of(shot.scene))
    return "\n".join([*lines, "</scene>", ""])


def _integrator(shot: Shot) -> list[str]:
    """Return how light is gathered."""
    path = f"""\
<integrator type="path" name="image">
<integer name="max_depth" value="{shot.depth + 1}"/>
<integer name="rr_depth" value="{shot.depth + 2}"/>
</integrator>"""
    if not shot.layers:
        return [path]
    return ['<integrator type="aov">', f'<string name="aovs" value="{LAYERS}"/>', path, "</integrator>"]


def _sensor(shot: Shot, seed: int) -> str:
    """Return camera, film and random numbers."""
    camera: Camera = shot.scene.camera
    place = f'origin="{text(camera.position)}" target="{text(camera.look_at)}" up="{text(camera.up)}"'
    return f"""\
<sensor type="perspective">
<string name="fov_axis" value="y"/>
<float name="fov" value="{camera.vertical_fov_deg!r}"/>
<float name="near_clip" value="1e-4"/>
<transform name="to_world"><lookat {place}/></transform>
<sampler type="independent">
<integer name="sample_count" value="{shot.spp}"/>
<integer name="seed" value="{seed}"/>
</sampler>
<film type="hdrfilm">
<integer name="width" value="{shot.size}"/>
<integer name="height" value="{shot.size}"/>
<string name="pixel_format" value="rgb"/>
<string name="component_format" value="float32"/>
<rfilter type="box"/>
</film>
</sensor>"""


def _shapes(parts: Parts) -> list[str]:
    """Return all surfaces."""
    lines = [line for sheet in parts.sheets for side in sheet.sides for line in _rectangle(side)]
    for box, look in parts.boxes:
        lines += ['<shape type="cube">', _matrix(axes_of(box)), *_look(look, closed=True), "</shape>"]
    for ball, look in parts.spheres:
        x, y, z = ball.center
        lines += [
            '<shape type="sphere">',
            f'<point name="center" x="{x!r}" y="{y!r}" z="{z!r}"/>',
            f'<float name="radius" value="{ball.radius!r}"/>',
            *_look(look, closed=True),
            "</shape>",
        ]
    return lines


def _rectangle(sheet: Sheet) -> list[str]:
    """Return a parallelogram that faces the side of edge_u x edge_v; Mitsuba's is [-1, 1]^2 at z = 0."""
    u, v = 0.5 * sheet.edge_u, 0.5 * sheet.edge_v
    columns = np.column_stack([u, v, sheet.normal, sheet.corner + u + v])
    return ['<shape type="rectangle">', _matrix(columns), *_look(sheet.look, closed=False), "</shape>"]


def _matrix(columns: Array) -> str:
    """Return a map to columns (3, 4)."""
    rows = [*(text(row, " ") for row in columns), "0 0 0 1"]
    return f'<transform name="to_world"><matrix value="{" ".join(rows)}"/></transform>'


def _look(look: Look, closed: bool) -> list[str]:
    """Return material and emitter of a shape."""
    kind, lines, tinted = _BSDFS[look.kind]
    numbers = (line.format(repr(look.number)) for line in lines)
    bsdf = [f'<bsdf type="{kind}">', *numbers, *(_rgb(name, look.reflectance) for name in tinted), "</bsdf>"]
    if not closed and not look.emits:
        bsdf = ['<bsdf type="twosided">', *bsdf, "</bsdf>"]
    if look.emits:
        bsdf += ['<emitter type="area">', _rgb("radiance", look.emission), "</emitter>"]
    return bsdf


_NO_METAL = '<string name="material" value="none"/>'
"""A conductor that reflects everything."""

_BSDFS: Mapping[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    MATTE: ("diffuse", (), ("reflectance",)),
    MIRROR: ("conductor", (_NO_METAL,), ("specular_reflectance",)),
    METAL: (
        "roughconductor",
        (_NO_METAL, '<string name="distribution" value="ggx"/>', '<float name="alpha" value="{}"/>'),
        ("specular_reflectance",),
    ),
    GLASS: (
        "dielectric",
        ('<float name="int_ior" value="{}"/>', '<float name="ext_ior" value="1.0"/>'),
        ("specular_reflectance", "specular_transmittance"),
    ),
}
"""How each kind of surface is said: its name, lines with the material's number, and what has its colour."""


def _rgb(name: str, color: tuple[float, ...]) -> str:
    """Return a colour in linear RGB."""
    return f'<rgb name="{name}" value="{text(color)}"/>'
