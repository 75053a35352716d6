"""Colour spaces of frames: from the primaries of a file to those of the networks, and back.

1. Networks see linear RGB of Rec. 709 (ITU-R BT.709): red, green, blue and white D65 [`REC_709`].
2. A file's primaries are its attribute `chromaticities`; without one those that `colorInteropID` names, of an
   ACES container AP0, else Rec. 709, as OpenEXR's documentation says [`to_rec_709`]. `adoptedNeutral` is what
   looks white, so it is the white that is adapted.
3. RGB is a mixture of its primaries that makes the white of luminance 1: the columns of the matrix to XYZ
   [`to_xyz`]. White is adapted by von Kries' rule in the cone space of Bradford [`BRADFORD`].
4. The matrix is float64, and the product of a pixel is rounded once; Rec. 709 is not converted at all.

Sources: SMPTE RP 177 (matrix of primaries); K. M. Lam, "Metamerism and colour constancy", 1985 (Bradford);
SMPTE ST 2065-1 (AP0), Academy S-2014-004 (AP1).
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.frame import Floats
from ...refimpl.reading import refusing
from .exr_header import Part

D65, ACES_WHITE = (0.3127, 0.3290), (0.32168, 0.33767)
"""Chromaticities (x, y) of two whites."""

REC_709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, *D65)
"""x and y of red, green, blue and white."""

SPACES: Mapping[str, tuple[str, tuple[float, ...]]] = {
    "lin_rec709_scene": ("Rec. 709", REC_709),
    "lin_ap1_scene": ("ACEScg (AP1)", (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, *ACES_WHITE)),
    "lin_ap0_scene": ("ACES (AP0)", (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, *ACES_WHITE)),
    "lin_rec2020_scene": ("Rec. 2020", (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *D65)),
    "lin_p3d65_scene": ("P3 D65", (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *D65)),
    "lin_adobergb_scene": ("Adobe RGB", (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, *D65)),
}
"""Names that `colorInteropID` gives to linear RGB, their names in messages, and their chromaticities."""

STATED = ("chromaticities", "colorInteropID", "acesImageContainerFlag")
"""Attributes that state a file's primaries."""

SAME_XY = 1e-3
"""Chromaticities that differ by no more are the same, as OpenEXR has it: programs round them to three
digits or to five, and the colours differ by less than an 8-bit step."""

BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
"""From XYZ to cone responses."""


def to_xyz(chromaticities: Floats) -> Floats:
    """Return the matrix from linear RGB of chromaticities (4, 2) to XYZ, whose white has luminance 1."""
    columns = np.array([(x, y, 1.0 - x - y) for x, y in chromaticities]).T
    return columns[:, :3] * np.linalg.solve(columns[:, :3], columns[:, 3] / columns[1, 3])


def conversion(chromaticities: Sequence[float], neutral: Sequence[float]) -> Floats | None:
    """Return the matrix to Rec. 709 that makes a neutral (x, y) white; None if it is the identity."""
    if same((*chromaticities, *neutral), (*REC_709, *D65)):
        return None
    cones = [BRADFORD @ (x / y, 1.0, (1.0 - x - y) / y) for x, y in (neutral, D65)]
    adaptation = np.linalg.inv(BRADFORD) @ np.diag(cones[1] / cones[0]) @ BRADFORD
    source, target = (to_xyz(np.reshape(space, (4, 2))) for space in (chromaticities, REC_709))
    matrix: Floats = np.linalg.inv(target) @ adaptation @ source
    # The condition number of AP0 is 4.
    if not np.isfinite(matrix).all() or not np.linalg.cond(matrix) <= 1e4:
        raise ValueError("the matrix of this space has no inverse")
    return matrix


def same(space: Sequence[float], other: Sequence[float]) -> bool:
    """Compare two lists of chromaticities."""
    return bool(np.abs(np.subtract(space, other)).max() <= SAME_XY)


def to_rec_709(what: str, part: Part) -> tuple[Floats | None, str]:
    """Return the matrix from a part's RGB to Rec. 709, None for the identity, and the name of its space."""
    interop = part.text("colorInteropID")
    if interop not in (*SPACES, "", "unknown", "data"):
        rule = f"the colour spaces that can be read are {', '.join(SPACES)}"
        raise InputError(f"{what}: colorInteropID", interop, rule, "convert its colours to one of them")
    container = "lin_ap0_scene" if "acesImageContainerFlag" in part.attributes else "lin_rec709_scene"
    default = SPACES[interop if interop in SPACES else container][1]
    with (
        refusing(f"{what}: chromaticities", NO_VALUE, "must span a colour space", "export it again"),
        np.errstate(all="ignore"),
    ):
        space = part.numbers("chromaticities", "<f4", default)
        matrix = conversion(space, part.numbers("adoptedNeutral", "<f4", space[6:]))
    shown = ", ".join(f"{value:g}" for value in space)
    if interop in SPACES and not same(space, default):
        rule = f"colorInteropID is {interop}, which has others"
        raise InputError(f"{what}: chromaticities", shown, rule, "remove the wrong attribute")
    return matrix, next((name for name, other in SPACES.values() if same(space, other)), shown)


def converted(colors: Floats, matrix: Floats) -> Floats:
    """Return float32 colours (H, W, 3) times a matrix (3, 3), computed in float64, a row at a time."""
    result = np.empty(colors.shape, np.float32)
    # Sums in a fixed order: a library's product may differ in the last bit from one processor to another.
    with np.errstate(all="ignore"):
        for target, row in zip(result, colors, strict=True):
            target[:] = sum(row[:, c : c + 1].astype(np.float64) * matrix[:, c] for c in range(3))
    return result
