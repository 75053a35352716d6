"""Grades lab 4: a furnace, the weights, and three lights whose answer is known."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wamnet.kernels.judge.welch import sidak

from ..frame import (
    SIGNIFICANCE,
    Check,
    alike,
    chi_square_p,
    expect,
    hold,
    normal_p,
    numbers_of,
    results,
    still,
    uniforms,
    vectors,
)
from .sampling import SECTORS, sectors, upwards

COUNT = 20_000
"""Samples of each estimate."""

SQUARES = ((1.0, 0.3), (1.0, 1.0), (1.0, 4.0), (0.5, 2.0))
"""Half the side and the height of the lights."""


def bounced(student: Any, reflectance: float) -> tuple[Any, Any, Any]:
    """Return directions, weights and densities of COUNT bounces."""
    found = student.bounce(reflectance, *still(*uniforms(9, COUNT)[:2]))
    results("LAM-1", "the result of bounce", found, 3, "three arrays")
    return (
        numbers_of("LAM-1", "directions", found[0], (COUNT, 3)),
        numbers_of("LAM-1", "f cos / pdf", found[1], (COUNT,)),
        numbers_of("LAM-1", "densities", found[2], (COUNT,)),
    )


def density(student: Any) -> None:
    """The density is that of the directions."""
    wi, _, pdf = bounced(student, 0.3)
    upwards("LAM-1", wi, "directions below the surface")
    z = wi[:, 2]
    # The mean of z under cos / pi is 2 / 3, its variance 1 / 18.
    deviate = (float(z.mean()) - 2.0 / 3.0) * math.sqrt(18.0 * COUNT)
    text = "uniform over the hemisphere: use the map of lab 3" if abs(z.mean() - 0.5) < 0.01 else ""
    text = "the radius in the disk is u0: it has to be sqrt(u0)" if z.mean() > 0.75 else text
    found = f"{z.mean():.4f}"
    hold("LAM-1", "the mean of the cosine", normal_p(deviate) >= SIGNIFICANCE / 2, "0.6667", found, text)
    p = chi_square_p(np.bincount(sectors(wi), minlength=SECTORS), COUNT / SECTORS)
    what, text = f"the p-value of a chi-square test in {SECTORS} sectors", "the angle around z is 2 pi u1"
    # Both tests together reject a right answer with the significance at most.
    hold("LAM-1", what, p >= SIGNIFICANCE / 2, f"at least {SIGNIFICANCE / 2:g}", p, text)
    likely = [
        (z, "the factor 1 / pi is missing"),
        (np.full(COUNT, 1 / (2 * np.pi)), "that is the uniform density: here it is cos(theta) / pi"),
        (np.full(COUNT, 1 / np.pi), "the cosine is missing"),
        (0.3 * z / np.pi, "the reflectance does not belong to the density"),
        (np.full(COUNT, 0.3), "the order is directions, f cos / pdf, density"),
        (z / (2 * np.pi), "1 / pi, not 1 / (2 pi)"),
    ]
    expect("LAM-1", "densities", pdf, z / np.pi, 1e-12, likely, "cos(theta) / pi")


def mapped(student: Any) -> None:
    """A bounce is a map of its two numbers, whatever their shape."""
    u0, u1 = still(*(part[:6].reshape(2, 3) for part in uniforms(9, 6, 2)[:2]))
    found = student.bounce(0.5, u0, u1)
    wi = numbers_of("LAM-1", "directions of (2, 3) numbers", found[0], (2, 3, 3))
    numbers_of("LAM-1", "f cos / pdf of (2, 3) numbers", found[1], (2, 3))
    again, text = student.bounce(0.5, u0, u1)[0], "directions are made of u0 and u1, and of nothing else"
    expect("LAM-1", "directions of the same numbers again", again, wi, 0.0, (), text)


def furnace(student: Any) -> None:
    """Check f cos / pdf, which is a number: walls that reflect a and emit 1 have the radiance 1 / (1 - a)."""
    for a in (0.4, 0.8):
        wi, weight, _ = bounced(student, a)
        z = wi[:, 2]
        likely = [
            (np.full(COUNT, a / np.pi), "f has the factor 1 / pi, and so has the density: they cancel"),
            (a * z / np.pi, "f cos is not divided by the density"),
            (a * z, "f cos / pdf: the cosine is in f cos and in the density, and cancels"),
            (np.full(COUNT, np.pi * a), "f is reflectance / pi"),
            (np.full(COUNT, 1.0), "the reflectance is missing"),
            (np.full(COUNT, 0.5), "the reflectance is the argument's"),
            (np.full(COUNT, 2 * a), "a factor of 2: densities over the hemisphere are cos(theta) / pi"),
            (np.full(COUNT, a * a), "the reflectance twice"),
        ]
        text = "f cos / pdf of a matte surface under its cosine density is the reflectance"
        # A quotient of products: some roundings of numbers below 1.
        expect("LAM-1", f"f cos / pdf at reflectance {a}", weight, np.full(COUNT, a), 1e-12, likely, text)


def weights(student: Any) -> None:
    """The power heuristic: numbers, limits, the vectors."""
    one, two = np.float64(1.0), np.float64(2.0)
    found = student.power_weight(two, one)
    likely = [
        (0.2, "pdf and other are exchanged"),
        (2.0 / 3.0, "that is the balance heuristic: the power heuristic takes squares"),
        (1.0 / 3.0, "the balance heuristic, and pdf and other exchanged"),
        (4.0, "pdf^2 / other^2: divided by the sum of both squares"),
        (4.0 / 3.0, "the sum of squares: pdf^2 / (pdf^2 + other^2)"),
        (4.0 / 9.0, "squares of the sum: the sum of the squares is meant"),
        (8.0 / 9.0, "the exponent is 2"),
        (0.5, "a weight that does not depend on the densities"),
    ]
    expect("LTR-5", "the weight of densities 2 and 1", found, 0.8, 1e-12, likely, "pdf^2 / (pdf^2 + other^2)")
    zero = student.power_weight(np.float64(0.0), np.float64(0.0))
    text = "a pdf below 1e-15 counts as 1e-15: then there is no 0 / 0"
    expect("LTR-5", "the weight of densities 0 and 0", zero, 1.0, 1e-12, (), text)
    large = student.power_weight(np.float32(1e30), np.float32(1e30))
    text = "a square of 1e30 is beyond float32: square the ratio other / pdf"
    expect("LTR-5", "the weight of densities 1e30 and 1e30 in float32", large, 0.5, 1e-6, (), text)
    for pdf, other, right, text in (
        (1e-15, 1e-15, 0.5, "a pdf below 1e-15 counts as 1e-15, another one as it is: np.maximum, not a sum"),
        (1.0, 1e6, 1e-12, "the ratio is cut at 1e15, not sooner"),
    ):
        weight = student.power_weight(*still(np.array([pdf]), np.array([other])))
        what = f"the weight of densities {pdf:g} and {other:g}"
        expect("LTR-5", what, weight, np.array([right]), 1e-6 * right, (), text)
    vectors(
        "transport.mis_weight",
        lambda given: {"power": student.power_weight(given["pdf"], given["other"])},
        ("power",),
        "very large or small densities: the ratio's square must not overflow",
    )


def exact(half: float, height: float) -> float:
    """Howell's configuration factor of a parallel rectangle, four quarters."""
    a = half / height
    root = math.sqrt(1.0 + a * a)
    return 4.0 / math.pi * a / root * math.atan(a / root)


def lights(student: Any, half: float, height: float) -> tuple[Any, Any, Any]:
    """Return the student's samples of a light."""
    found = student.by_light(0.8, half, height, *still(*uniforms(9, COUNT, 1)[:2]))
    results("LTR-5", "the result of by_light", found, 3, "three arrays")
    names = ("value", "pdf", "pdf of bounce")
    three = [numbers_of("LTR-5", name, v, (COUNT,)) for name, v in zip(names, found, strict=True)]
    return three[0], three[1], three[2]


def light_density(student: Any) -> None:
    """Densities and values of points of a light are numbers."""
    for half, height in SQUARES:
        value, pdf, other = lights(student, half, height)
        u0, u1 = uniforms(9, COUNT, 1)[:2]
        x, y = (2 * u0 - 1) * half, (2 * u1 - 1) * half
        square = x * x + y * y + height * height
        cos, area = height / np.sqrt(square), 4 * half * half
        right = square / (area * cos)
        likely = [
            (
                np.full(COUNT, 1 / area),
                "that is the density per area: times distance^2 / cos it is one in 1/sr",
            ),
            (square / area, "the cosine at the light is missing: distance^2 / (area cos)"),
            (1 / (area * cos), "the squared distance is missing: distance^2 / (area cos)"),
            (cos / (area * square), "upside down: a density per area times distance^2 / cos"),
            (square * cos / area, "the cosine at the light divides"),
            (np.sqrt(square) / (area * cos), "the distance counts as its square"),
            (square / (half * half * cos), "the side is 2 half: the area is 4 half^2"),
            (square / (2 * half * cos), "the area is 4 half^2"),
            (square / (2 * half * half * cos), "the area is 4 half^2"),
            (height * height / (area * cos), "the distance is that of the point, not the height"),
        ]
        what = f"the density of a light of half side {half} at height {height}"
        bound = 1e-9 * float(right.max())
        expect("LTR-5", what, pdf, right, bound, likely, "distance^2 / (area cos)")
        likely = [
            (
                np.full(COUNT, 1 / np.pi),
                "the cosine is missing: it is the density by which bounce would draw it",
            ),
            (cos, "the factor 1 / pi is missing"),
            (right, "the third result is bounce's density of the same direction: cos / pi"),
        ]
        expect(
            "LTR-5", "bounce's density of a light's direction", other, cos / np.pi, 1e-9, likely, "cos / pi"
        )
        best = 0.8 / np.pi * cos / right
        likely = [
            (0.8 / np.pi * cos, "not divided by the density"),
            (0.8 * cos / right, "f is reflectance / pi"),
            (0.8 / np.pi / right, "the cosine at the surface is missing: f cos / pdf"),
            (
                0.8 / np.pi * cos * cos / right,
                "the cosine twice: that at the light is in the density already",
            ),
            (best / 0.8, "the reflectance is missing"),
            (0.8 / np.pi * cos * right, "multiplied by the density: divide"),
        ]
        most = 1e-9 * float(best.max())
        expect(
            "LTR-5", "values of a light's points", value, best, most, likely, "f cos / pdf, times radiance 1"
        )


def both(student: Any) -> None:
    """z-tests of twelve means, significance 1 % for all together: each way and their weighted sum."""
    level = sidak(SIGNIFICANCE, 3 * len(SQUARES))
    for half, height in SQUARES:
        wanted = 0.8 * exact(half, height)
        wi, weight, pdf = bounced(student, 0.8)
        on_light = np.all(np.abs(wi[:, :2]) * height <= half * wi[:, 2:], axis=-1)
        found = np.where(on_light, weight, 0.0)
        distance = height / np.maximum(wi[:, 2], 1e-9)
        other = distance**2 / (4 * half**2 * np.maximum(wi[:, 2], 1e-9))
        value, pdf_light, pdf_bounce = lights(student, half, height)
        mixed = found * student.power_weight(pdf, other) + value * student.power_weight(pdf_light, pdf_bounce)
        for name, some in (("bounces", found), ("points of the light", value), ("both, weighted", mixed)):
            error = float(np.std(some)) / math.sqrt(COUNT)
            p = normal_p((float(np.mean(some)) - wanted) / max(error, 1e-300))
            text = "the weights of both ways must add up to 1" if some is mixed else "where points or rays go"
            if alike(np.mean(some), 2 * wanted, 0.1 * wanted):
                text = "each light counts twice: the weights must add up to 1"
            what = f"the light by {name}, of half side {half} at height {height}"
            hold("LTR-5", what, p >= level, f"{wanted:.4f}", f"{np.mean(some):.4f} (p = {p:.1g})", text)


CHECKS = (
    Check("the density of a bounce", density),
    Check("a bounce is a map", mapped),
    Check("a furnace", furnace),
    Check("the weights", weights),
    Check("points of a light", light_density),
    Check("both ways and their sum", both),
)
"""In the order in which they explain a mistake best."""
