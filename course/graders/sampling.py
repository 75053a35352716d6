"""Grades lab 3: the generator's words, a chi-square test of directions, the density, the way back."""

from __future__ import annotations

from typing import Any

import numpy as np

from wamnet.refimpl import rng

from ..frame import (
    SIGNIFICANCE,
    SINGLE,
    Check,
    alike,
    chi_square_p,
    expect,
    hold,
    kind_of_number,
    numbers_of,
    results,
    still,
    uniforms,
)

COUNT = 200_000
"""Directions that are drawn: some 1,480 in each of 135 cells."""

RINGS, SECTORS = 9, 15
"""Cells of equal probability: rings of equal squared sine, by sectors; an odd number of them."""

Words = tuple[Any, Any, Any, Any]
"""Four words."""


def _mixed(
    v: Words,
    order: Any = None,
    shift: bool = True,
    rounds: int = 2,
    first: bool = True,
    last: bool = False,
    reverse: bool = False,
) -> Words:
    """Return what PCG4D with a mistake makes of four words."""
    a, c = np.uint32(1664525), np.uint32(1013904223)
    words = [w * a + c for w in v] if first else list(v)
    for number in range(rounds):
        if number and shift:
            words = [w ^ (w >> np.uint32(16)) for w in words]
        words = list((order or _lines)(*words))
    words = [w ^ (w >> np.uint32(16)) for w in words] if last else words
    words = words[::-1] if reverse else words
    return words[0], words[1], words[2], words[3]


def _four(a: Any, b: Any, c: Any, d: Any) -> Words:
    """Return four words as a tuple of four."""
    return a, b, c, d


def _lines(a: Any, b: Any, c: Any, d: Any) -> Words:
    """Return the four lines, each with what those before have changed."""
    a = a + b * d
    b = b + c * a
    c = c + a * b
    return a, b, c, d + b * c


def _together(a: Any, b: Any, c: Any, d: Any) -> Words:
    """Return the four lines, each with the words as they were."""
    return a + b * d, b + c * a, c + a * b, d + b * c


MISTAKES = (
    ({"order": _together}, "each line takes the words that the lines before have changed, not the old ones"),
    ({"shift": False}, "v ^ (v >> 16) between the two rounds is missing"),
    ({"rounds": 1}, "the four lines come twice"),
    ({"rounds": 1, "last": True}, "the four lines come once more after v ^ (v >> 16)"),
    ({"last": True}, "v ^ (v >> 16) comes between the two rounds only, not after them"),
    ({"reverse": True}, "the words come back in their order: v0, v1, v2, v3"),
    ({"first": False}, "v * 1664525 + 1013904223 at the beginning is missing"),
)
"""Arguments of `_mixed`, and what is wrong with them."""


def mixing(student: Any) -> None:
    """Words of 1000 blocks."""
    given = _four(*still(*(rng.counter(np.arange(1000) * k + k) for k in (1, 7, 31, 1009))))
    found = student.mix(*given)
    results("RNG-2", "the result of mix", found, 4, "four arrays", "return v0, v1, v2, v3")
    wanted = rng.pcg4d(*given)
    for number, (word, right) in enumerate(zip(found, wanted, strict=True)):
        kind_of_number("RNG-2", f"word {number}", word, np.uint32)
        likely = [(_mixed(given, **how)[number], text) for how, text in MISTAKES]
        text = (
            "the order of the lines, or an operand of one: v0 += v1 v3, v1 += v2 v0, "
            "v2 += v0 v1, v3 += v1 v2;"
            " or 1664525, 1013904223, ^ or >> 16 is not what is there"
        )
        expect("RNG-2", f"word {number} of mix", word, right, 0.0, likely, text)


def floats(student: Any) -> None:
    """Uniform numbers."""
    (words,) = still(np.array([0, 255, 256, 1 << 31, (1 << 32) - 1], np.uint32))
    found = student.uniform(words)
    wanted = np.array([0.0, 0.0, 2.0**-24, 0.5, 1.0 - 2.0**-24])
    whole = numbers_of("RNG-5", "uniform numbers", found, (5,)).dtype.kind in "iu"
    hold("RNG-5", "the kind of uniform numbers", not whole, "float64", "integers", "/ 2**24, not // 2**24")
    kind_of_number("RNG-5", "uniform numbers", found, np.float64)
    likely = [
        (words / 2.0**32, "all 32 bits: a float32 cannot hold them, so only the upper 24 count"),
        (words / (2.0**32 - 1), "divided by 2^32 - 1: then 1 itself can come, and numbers are not exact"),
        ((words >> 8) / (2.0**24 - 1), "divided by 2^24 - 1: then 1 itself can come"),
        ((words & 0xFFFFFF) / 2.0**24, "the lower 24 bits: the upper ones are mixed better"),
        ((words >> 8) / 2.0**32, "shifted by 8 and still divided by 2^32: divide by 2^24"),
    ]
    # These differ in the last of ten digits only, so they are compared by themselves.
    near = next((text for value, text in likely if np.array_equal(found, value)), "(words >> 8) / 2^24")
    expect("RNG-5", "uniform numbers", found, wanted, 0.0, (), near)


def drawn(student: Any) -> tuple[Any, Any]:
    """Return the uniform numbers and the student's directions."""
    u0, u1 = still(*uniforms(5, COUNT)[:2])
    u = u0, u1
    wi = numbers_of("SMP-2", "directions", student.sample_hemisphere(*u), (COUNT, 3))
    return u, wi


def upwards(clause: str, wi: Any, likely: str) -> None:
    """Refuse directions (N, 3) that are not unit vectors above the horizon."""
    off = float(np.abs(np.sqrt(np.sum(wi * wi, axis=-1)) - 1.0).max())
    text = "x, y and z do not belong together: z = sqrt(1 - x^2 - y^2)"
    text = SINGLE if off < 1e-6 else text
    # Squares, sums and a root: a few roundings of float64.
    hold(clause, "the largest deviation of a length from 1", off <= 1e-12, "at most 1e-12", off, text)
    least = float(wi[:, 2].min())
    hold(clause, "the least z", least >= 0.0, "at least 0", least, likely)


def directions(student: Any) -> None:
    """Unit vectors above the horizon."""
    upwards("SMP-2", drawn(student)[1], "the whole sphere, or z with the other sign")


def sectors(wi: Any) -> Any:
    """Return the numbers (N,) of the SECTORS around z in which directions (N, 3) are."""
    turn = np.arctan2(wi[:, 1], wi[:, 0]) / (2 * np.pi) + 0.5
    return np.minimum((SECTORS * turn).astype(int), SECTORS - 1)


def distribution(student: Any) -> None:
    """Rings of equal probability under cos / pi, by sectors: a chi-square test."""
    _, wi = drawn(student)
    ring = np.minimum((RINGS * (1.0 - wi[:, 2] ** 2)).astype(int), RINGS - 1)
    sector = sectors(wi)
    cells = RINGS * SECTORS
    tests = (
        (cells, chi_square_p(np.bincount(SECTORS * ring + sector, minlength=cells), COUNT / cells)),
        (RINGS, chi_square_p(np.bincount(ring, minlength=RINGS), COUNT / RINGS)),
        (SECTORS, chi_square_p(np.bincount(sector, minlength=SECTORS), COUNT / SECTORS)),
    )
    # Each at a third of the level: together they reject a right answer with that of the level at most.
    cells, p = min(tests, key=lambda test: test[1])
    if p >= SIGNIFICANCE / len(tests):
        return
    rings = np.bincount(ring, minlength=RINGS) / COUNT
    shares = np.bincount(sector, minlength=SECTORS) / COUNT
    edges = np.arange(RINGS + 1) / RINGS
    uniform = np.diff(-np.sqrt(1.0 - edges))
    text = "u0 and u1 do not become a point that is uniform in the disk: radius sqrt(u0), angle 2 pi u1"
    # Shares of some 20,000 directions each vary by 0.7 %; shares of known mistakes differ by more.
    if np.abs(shares * SECTORS - 1.0).max() > 0.2:
        text = "the azimuth does not go around: the angle is 2 pi u1"
    elif np.abs(rings - uniform).max() < 0.01:
        text = "uniform over the hemisphere (z = 1 - u0): more directions belong where the cosine is large"
    elif np.abs(rings - np.diff(np.sqrt(edges))).max() < 0.01:
        text = "the radius in the disk is u0: it has to be sqrt(u0), since area grows with its square"
    what = f"the p-value of a chi-square test in {cells} cells"
    hold("SMP-2", what, False, f"at least {SIGNIFICANCE / len(tests):.3g}", p, text)


def density(student: Any) -> None:
    """The density of single directions, and its integral; cos is linear in z, so midpoints are exact."""
    z = (np.arange(200) + 0.5) / 200
    (grid,) = still(np.stack([np.sqrt(1 - z * z), 0 * z, z], axis=-1))
    found = numbers_of("SMP-2", "densities", student.hemisphere_pdf(grid), (200,))
    likely = [
        (z, "the factor 1 / pi is missing: the integral over the hemisphere has to be 1"),
        (z / 2, "1 / pi, not 1 / 2"),
        (z / (2 * np.pi), "1 / pi, not 1 / (2 pi): that is the uniform density's"),
        (np.full(200, 1 / (2 * np.pi)), "that is the uniform density: cos(theta) / pi is meant"),
        (np.full(200, 1 / np.pi), "the cosine is missing: cos(theta) / pi"),
        (np.sqrt(1 - z * z) / np.pi, "the sine of theta: cos(theta) is z"),
        (np.cos(z) / np.pi, "the third component is cos(theta) already: no cosine of it"),
        (0 * z, "cos(theta) is the third component, [..., 2]"),
        (z * z / np.pi, "the cosine twice"),
        (
            z * np.sqrt(1 - z * z) / np.pi,
            "a density per theta and phi: it is one per solid angle, without the sine",
        ),
    ]
    expect("SMP-2", "densities", found, z / np.pi, 1e-12, likely, "cos(theta) / pi")
    below = student.hemisphere_pdf(*still([[0.6, 0.0, -0.8]]))
    text = "below the horizon the density is 0: np.maximum(z, 0) / pi"
    expect("SMP-2", "the density below the horizon", below, np.zeros(1), 0.0, (), text)


def way_back(student: Any) -> None:
    """At the horizon z is a root of a difference; it is not needed for the way back along the disk."""
    u, wi = drawn(student)
    found = student.invert_hemisphere_sample(*still(wi))
    results("SMP-2", "the way back", found, 2, "a pair", "return u0, u1")
    found = [numbers_of("SMP-2", f"u{i}", value, (COUNT,)) for i, value in enumerate(found)]
    text = "it inverts another map than sample_hemisphere's"
    if alike(found[0], u[1], 1e-7) and alike(found[1], u[0], 1e-7):
        text = "u0 and u1 are exchanged"
    elif alike(np.mod(found[1], 1.0), u[1], 1e-7) and alike(found[0], u[0], 1e-7):
        text = "arctan2 gives angles in [-pi, pi]: bring them to [0, 1) with np.mod(..., 1)"
    elif alike(found[0], np.sqrt(u[0]), 1e-7):
        text = "u0 is the square of the radius in the disk"
    elif alike(found[1], np.mod(0.25 - u[1], 1.0), 1e-7):
        text = "arctan2 takes y first: np.arctan2(y, x)"
    z, angle = wi[:, 2], np.arctan2(wi[:, 1], wi[:, 0])
    with np.errstate(all="ignore"):
        slope = np.arctan(wi[:, 1] / wi[:, 0])
    likely = (
        [(1.0 - z, "u0 from 1 - z: the disk's radius is sin(theta), and u0 its square"), (z, "u0 is not z")],
        [
            (np.mod(angle / np.pi, 1.0), "a whole turn is 2 pi: divide by 2 pi, not by pi"),
            (angle / np.pi, "a whole turn is 2 pi: divide by 2 pi, not by pi"),
            (angle, "an angle in radians: / (2 pi) makes turns of it"),
            (np.mod(angle, 1.0), "an angle in radians: / (2 pi) makes turns of it"),
            (np.mod(slope / (2 * np.pi), 1.0), "arctan of y / x knows half a turn only: np.arctan2(y, x)"),
            (slope / (2 * np.pi), "arctan of y / x knows half a turn only: np.arctan2(y, x)"),
            (np.abs(angle) / (2 * np.pi), "a magnitude of an angle: np.mod(..., 1)"),
        ],
    )
    for number in (0, 1):
        expect("SMP-2", f"u{number} on the way back", found[number], u[number], 1e-7, likely[number], text)


def shapes(student: Any) -> None:
    """Arrays of any shape, and single numbers: components are on the last axis."""
    u0, u1 = still(*(part[:6].reshape(2, 3) for part in uniforms(6, 6)[:2]))
    wi = numbers_of("SMP-2", "directions of (2, 3) numbers", student.sample_hemisphere(u0, u1), (2, 3, 3))
    text = "stack with axis=-1, and take components with [..., 0]"
    for at in ((), (1, 2)):
        given, wanted = (np.asarray(part[at]) for part in (wi, wi[..., 2] / np.pi))
        found = student.hemisphere_pdf(*still(given))
        expect("SMP-2", f"densities of {given.shape[:-1]} directions", found, wanted, 1e-12, (), text)
        back = student.invert_hemisphere_sample(*still(given))
        for number, part in enumerate((u0, u1)):
            what = f"u{number} of {given.shape[:-1]} directions"
            expect("SMP-2", what, back[number], np.asarray(part[at]), 1e-7, (), text)


CHECKS = (
    Check("random words", mixing),
    Check("uniform numbers", floats),
    Check("unit directions above the horizon", directions),
    Check("where the directions are", distribution),
    Check("the density", density),
    Check("the way back", way_back),
    Check("arrays of any shape", shapes),
)
"""In the order in which they explain a mistake best."""
