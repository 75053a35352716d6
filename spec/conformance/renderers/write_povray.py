"""A shot as a scene of POV-Ray 3.7: what has an answer without global illumination.

1. POV-Ray has no lamps of a given radiance and size whose light reaches matte surfaces as it should (its area
   lights are rows of points), and its radiosity interpolates: matte surfaces that receive light are not
   expressed, nor is rough metal. Skies, what emits, mirrors and clear glass are.
2. Its y is up and its z is away from the viewer: coordinates are left-handed, and all z are negated.
3. Numbers are linear (`assumed_gamma 1`). Pixels are samples at their centres, alike for every seed.

Source: POV-Ray 3.7's reference, sections 3.3 to 3.5.
"""

from __future__ import annotations

from .cases import Shot
from .parts import GLASS, MATTE, METAL, MIRROR, Array, Look, NotExpressed, axes_of, frame_of, parts_of, text


def write(shot: Shot, seed: int) -> str:
    """Return the scene file of a shot; it has no random numbers. Raises NotExpressed."""
    del seed
    if shot.layers:
        raise NotExpressed("layers beside the colour")
    lines = [
        "#version 3.7;",
        f"global_settings {{ assumed_gamma 1 max_trace_level {shot.depth + 1} adc_bailout 0.0001 }}",
        f"background {{ rgb <{text(shot.scene.background)}> }}",
        *_camera(shot),
    ]
    parts = parts_of(shot.scene)
    for sheet in parts.sheets:
        if sheet.front:
            raise NotExpressed("lamps that emit to one side")
        a, b, c, d = (_vector(corner) for corner in sheet.corners)
        lines.append(
            f"union {{ triangle {{ {a}, {b}, {c} }} triangle {{ {a}, {c}, {d} }} {_look(sheet.look)} }}"
        )
    for box, look in parts.boxes:
        columns = axes_of(box)
        moved = ", ".join(text(_mirrored(column), ", ") for column in columns.T)
        shape = "box { <-1, -1, -1>, <1, 1, 1> "
        lines.append(f"{shape} matrix <{moved}> {_look(look)} }}")
    for ball, look in parts.spheres:
        lines.append(f"sphere {{ {_vector(ball.center)}, {ball.radius!r} {_look(look)} }}")
    return "\n".join([*lines, ""])


def _mirrored(vector: Array) -> tuple[float, ...]:
    """Return a vector in left-handed coordinates."""
    x, y, z = map(float, vector)
    return (x, y, -z)


def _vector(values: object) -> str:
    """Return a point as POV-Ray writes it."""
    return f"<{text(_mirrored(values))}>"  # type: ignore[arg-type]


def _camera(shot: Shot) -> list[str]:
    """Return the camera by its axes: `angle` spans the width, which is the height here."""
    right, up, back, position = frame_of(shot.scene.camera).T
    return [
        "camera { perspective",
        f"location {_vector(position)} direction {_vector(-back)} right {_vector(right)} up {_vector(up)}",
        f"angle {shot.scene.camera.vertical_fov_deg!r} }}",
    ]


def _look(look: Look) -> str:
    """Return texture and interior."""
    colour = f"rgb <{text(look.reflectance)}>"
    if look.emits:
        if any(look.reflectance) or look.kind != MATTE:
            raise NotExpressed("what emits and reflects")
        return f"pigment {{ rgb <{text(look.emission)}> }} finish {{ ambient 0 diffuse 0 emission 1 }}"
    if look.kind == MIRROR:
        return f"pigment {{ rgb 0 }} finish {{ ambient 0 diffuse 0 reflection {{ {colour} }} }}"
    if look.kind == GLASS:
        return (
            f"pigment {{ rgbt <{text(look.reflectance)}, 1> }} "
            "finish { ambient 0 diffuse 0 reflection { 0, 1 fresnel on } conserve_energy } "
            f"interior {{ ior {look.number!r} }}"
        )
    if look.kind == METAL:
        raise NotExpressed("rough metal")
    if any(look.reflectance):
        raise NotExpressed("matte surfaces that are lit")
    return "pigment { rgb 0 } finish { ambient 0 diffuse 0 }"
