"""Grades lab 8: the first steps, the spec's vectors, the decay, and training to a known minimum."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..frame import Check, alike, asked, equal, expect, hold, numbers_of, results, spread, still

BETA_1, BETA_2, EPSILON = 0.9, 0.999, 1e-8
"""The source's values."""

RATE = 0.01
"""The learning rate of the checks."""


def adam(gradients: Any, how: str = "", rates: Any = None, theta: Any = None) -> list[Any]:
    """Return (theta, m, v) after each step along gradients (T, n), with one mistake.

    A function in place of the gradients is called with theta.
    """
    count = len(rates) if callable(gradients) else len(gradients)
    theta = np.zeros(gradients.shape[1]) if theta is None else theta
    m, v, found = np.zeros_like(theta), np.zeros_like(theta), []
    for t in range(1, count + 1):
        g = gradients(theta) if callable(gradients) else gradients[t - 1]
        beta_1, beta_2 = (BETA_2, BETA_1) if how == "betas" else (BETA_1, BETA_2)
        before = m
        m = beta_1 * m + (1.0 if how == "heavy" else 1 - beta_1) * g
        m = beta_1 * g + (1 - beta_1) * before if how == "turned" else m
        square = np.abs(g) if how == "magnitude" else g if how == "no square" else g * g
        square = (g - m) ** 2 if how == "centred" else square
        v = beta_2 * v + (1 - beta_2) * square
        power = {"from zero": t - 1, "once": 1, "late": t + 1}.get(how, t)
        # Counted from 0 the first correction would divide by 0.
        left = max(1 - BETA_1**power, 1e-12), max(1 - BETA_2**power, 1e-12)
        mean = m if how in ("uncorrected", "uncorrected mean") else m / left[0]
        size = v if how in ("uncorrected", "uncorrected square") else v / left[1]
        below = np.sqrt(size + EPSILON) if how == "inside" else np.sqrt(size) + EPSILON
        below = np.sqrt(size) if how == "no epsilon" else size + EPSILON if how == "no root" else below
        with np.errstate(all="ignore"):
            step = (RATE if rates is None else rates[t - 1]) * mean / below
        theta = theta + step if how == "uphill" else theta - step
        if how == "kept corrected":
            m, v = mean, size
        found.append((theta, m, v))
    return found


MISTAKES = (
    ("uphill", "the sign: theta goes against the slope"),
    ("uncorrected", "both means begin at 0: divide by 1 - beta^t"),
    ("uncorrected mean", "m begins at 0: divide it by 1 - beta_1^t"),
    ("uncorrected square", "v begins at 0: divide it by 1 - beta_2^t"),
    ("betas", "beta_1 belongs to m, beta_2 to v"),
    ("heavy", "m gets (1 - beta_1) times the slope"),
    ("turned", "m keeps beta_1 of itself, and gets 1 - beta_1 of the slope"),
    ("magnitude", "v is a mean of squares of the slope"),
    ("no square", "v is a mean of squares of the slope"),
    ("centred", "v takes g^2, not the distance from the mean"),
    ("inside", "epsilon is added outside of the root"),
    ("no root", "the step divides by the root of v"),
    ("no epsilon", "epsilon is missing: 0 / 0 where the slope is 0"),
    ("once", "the correction has the power t: 1 - beta^t"),
    ("from zero", "t is counted from 1"),
    ("late", "the correction has the power t, not t + 1"),
    ("kept corrected", "m and v are kept as they are; only the step takes the corrected ones"),
)
"""Mistakes of a step, and their explanations."""

SLOPES = np.array([[1e-3, -1.0, 20.0], [2e-3, 0.5, -4.0], [-1e-3, -0.25, 7.0]])
"""Slopes of three steps of three numbers."""


def compare(student: Any, slopes: Any, what: str) -> None:
    """Compare each step along some slopes."""
    theta, m, v = np.zeros(slopes.shape[1]), np.zeros(slopes.shape[1]), np.zeros(slopes.shape[1])
    right = adam(slopes)
    wrong = [(adam(slopes, how), told) for how, told in MISTAKES]
    for t, g in enumerate(slopes, 1):
        found = student.step(*still(theta, g, m, v), t, RATE)
        results("ADM-1", "the result of step", found, 3, "theta, m and v")
        for number, name in enumerate(("theta", "m", "v")):
            # The mistake that gives all three comes first.
            whole = [pair for pair in wrong if all(map(alike, found, pair[0][t - 1]))]
            likely = [(steps[t - 1][number], told) for steps, told in (*whole, *wrong)]
            # Few roundings of numbers of at most 400.
            bound = 1e-12 * max(1.0, float(np.abs(right[t - 1][number]).max())) if number else 1e-12
            expect("ADM-1", f"{name} after {what} {t}", found[number], right[t - 1][number], bound, likely)
        theta, m, v = (numbers_of("ADM-1", "a result", value) for value in found)


def steps(student: Any) -> None:
    """Three steps."""
    compare(student, SLOPES, "step")


def small(student: Any) -> None:
    """Slopes so small that epsilon matters, and none at all."""
    theta, m, v = student.step(np.ones(2), np.zeros(2), np.zeros(2), np.zeros(2), 1, RATE)
    text = "epsilon is missing: 0 / 0 where the slope is 0"
    expect("ADM-1", "theta where the slope is 0", theta, np.ones(2), 0.0, (), text)
    expect("ADM-1", "m where the slope is 0", m, np.zeros(2))
    expect("ADM-1", "v where the slope is 0", v, np.zeros(2))
    compare(student, np.array([[1e-9, -1e-8], [1e-9, 2e-8]]), "step of small slopes")


def answer(student: Any, given: Any) -> Any:
    """Return what the student's steps make of a case of adam.run."""
    theta, rows = given["theta"].astype(np.float64), []
    m, v = np.zeros_like(theta), np.zeros_like(theta)
    for t, g in enumerate(given["gradients"], 1):
        theta, m, v = student.step(theta, g, m, v, t, float(given["learning_rate"]))
        rows.append((theta, m, v))
    return dict(zip(("theta", "m", "v"), map(np.array, zip(*rows, strict=True)), strict=True))


def decay(student: Any) -> None:
    """The learning rate."""
    for k, wanted in (
        (0, 1.0),
        (2, (1 + np.cos(np.pi / 5)) / 2),
        (5, 0.5),
        (9, (1 + np.cos(0.9 * np.pi)) / 2),
    ):
        c = np.cos(np.pi * k / 10)
        likely = [
            (2 * RATE * wanted, "half of 1 + cos"),
            (RATE * (1 - c) / 2, "1 + cos: it falls"),
            (RATE * (1 + np.cos(2 * np.pi * k / 10)) / 2, "half a wave: pi k / steps"),
            (RATE * c, "(1 + cos) / 2, so that it never is below 0"),
            (RATE * (1 + np.cos(np.pi / 2 * k / 10)) / 2, "half a wave: pi k / steps"),
            (RATE * (1 + np.cos(np.pi * (k + 1) / 10)) / 2, "k is counted from 0"),
            (RATE * (1 + np.cos(np.pi * (k - 1) / 10)) / 2, "k is counted from 0"),
            (RATE * (1 + np.cos(np.pi * k / 9)) / 2, "k / steps, not k / (steps - 1)"),
            (RATE * (1 - k / 10), "a cosine, not a line"),
            (wanted, "times the learning rate"),
            (RATE, "the decay is missing"),
        ]
        what, text = f"the learning rate of step {k} of 10", "(1 + cos(pi k / steps)) / 2"
        expect("TRN-4", what, student.rate(RATE, k, 10), RATE * wanted, 1e-15, likely, text)


def training(student: Any) -> None:
    """A bowl, sum of a (theta - c)^2: each step, and where it ends."""
    a, c = np.array([1.0, 10.0, 0.1]), np.array([0.5, -0.25, 0.3])
    (start,) = still(np.zeros(3))
    calls: list[Any] = []

    def gradient(theta: Any) -> Any:
        calls.append(np.array(theta))
        return 2 * a * (np.asarray(theta) - c)

    count, rate = 30, 0.05
    found = student.train(start, gradient, count, rate)
    once = "gradient(theta) once a step, where theta is by then"
    lost = not np.all(np.isfinite(np.asarray(found, np.float64)))
    text = "t is counted from 1: with t = 0 the corrections divide by 0"
    hold("TRN-4", "theta after the steps", not lost, "numbers", found, text)
    equal("TRN-2", "the number of slopes", len(calls), count, once)
    rates = [rate * (1 + np.cos(np.pi * k / count)) / 2 for k in range(count)]

    def after(rates: Any, how: str = "") -> Any:
        return adam(lambda theta: 2 * a * (theta - c), how, rates, np.zeros(3))[-1][0]

    fixed = gradient(np.zeros(3))
    late = [rate * (1 + np.cos(np.pi * (k + 1) / count)) / 2 for k in range(count)]
    likely = [
        (after([rate] * count), "the learning rate does not fall: rate(learning_rate, k, steps)"),
        (after(late), "the learning rate of step k is that of k from 0"),
        (after(rates, "once"), "t is the number of the step, from 1 on"),
        (after(rates, "late"), "t is counted from 1"),
        (after(rates, "from zero"), "t is counted from 1: k + 1"),
        (
            adam(np.array([fixed] * count), "", rates, np.zeros(3))[-1][0],
            "the slope is that of the start in each step",
        ),
        (after(rates[:-1]), "one step too few"),
        (np.zeros(3), "what step returns is not kept"),
    ]
    forgets, theta = [], np.zeros(3)
    for t, r in enumerate(rates, 1):
        g = gradient(theta)
        theta = theta - r * (0.1 * g / (1 - 0.9**t)) / (np.sqrt(0.001 * g * g / (1 - 0.999**t)) + EPSILON)
        forgets.append(theta)
    likely.append((forgets[-1], "m and v are kept from step to step"))
    text = "theta, m, v = step(theta, gradient(theta), m, v, k + 1, rate(learning_rate, k, steps))"
    expect("TRN-4", f"theta after {count} steps", found, after(rates), 1e-12, likely, text)


def learns(student: Any) -> None:
    """The slope of a line of least squares, with its answer in closed form."""
    x = spread(101, (64, 2), -1.0, 1.0)
    y = x @ np.array([0.75, -0.5])

    def gradient(theta: Any) -> Any:
        return 2 * (x @ theta - y) @ x / len(x)

    found = student.train(np.zeros(2), gradient, 2000, 0.02)
    # The rate ends at 0; what Adam leaves is far below a thousandth here.
    text = "training stops early"
    expect("TRN-4", "the line after 2000 steps", found, np.array([0.75, -0.5]), 1e-3, (), text)


CHECKS = (
    Check("three steps", steps),
    Check("small slopes", small),
    Check(
        "the spec's vectors",
        asked("adam.run", answer, "single precision, or the learning rate is not the argument's"),
    ),
    Check("the learning rate", decay),
    Check("training", training),
    Check("a line of least squares", learns),
)
"""In the order in which they explain a mistake best."""
