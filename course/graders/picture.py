"""Grades lab 5: few samples, pictures of known mean and variance, the error that they predict."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from wamnet.refimpl import rng
from wamnet.refimpl.errors import InputError

from ..frame import (
    SIGNIFICANCE,
    Check,
    Likely,
    alike,
    equal,
    expect,
    hold,
    normal_p,
    normals,
    numbers_of,
    results,
    spread,
    vectors,
)  # fmt: skip

WIDTH, HEIGHT = 12, 8
"""The picture: not square, so that rows and columns cannot be exchanged unnoticed."""

SPP = 25
"""Samples of a pixel."""


def sums(student: Any, samples: Any) -> tuple[Any, Any, Any]:
    """Return what the student's recurrence makes of samples (n, ...)."""
    state = (0, np.zeros(samples.shape[1:]), np.zeros(samples.shape[1:]))
    for x in samples:
        found = student.add_sample(*state, x)
        results("RND-4", "the result of add_sample", found, 3, "n, sum and sum of squares")
        state = (found[0], found[1], found[2])
    return state


def few(student: Any) -> None:
    """Three samples, 2, 3 and 7: mean 4, sum of squared distances 14."""
    samples = np.array([2.0, 3.0, 7.0])[:, None]
    n, total, squares = sums(student, samples[:1])
    expect("RND-4", "n after one sample", n, 1, 0, [(0, "n is not counted up")])
    expect("RND-1", "the sum after one sample", total, samples[0], 0.0, (), "sum + x")
    first = "the recurrence begins with the second sample: n = 0 adds no square"
    expect("RND-4", "the sum of squares after one sample", squares, np.zeros(1), 0.0, (), first)
    n, total, squares = sums(student, samples)
    expect("RND-4", "n after three samples", n, 3, 0)
    likely: Likely = [
        ([4.0], "the sum, not the mean: divide when all samples are there"),
        ([7.0], "only the last sample"),
    ]
    expect("RND-1", "the sum after three samples", total, np.array([12.0]), 1e-12, likely, "sum + x")
    x, wrong = samples[:, 0], []
    steps: tuple[tuple[str, Any], ...] = (
        ("squares of the samples: (n x - S)^2 / (n (n + 1))", lambda n, s, x: x * x),
        ("the squares are summed", lambda n, s, x: (n * x - s) ** 2 / 6 * (n == 2)),
        ("squares of the samples: (n x - S)^2 / (n (n + 1))", lambda n, s, x: x * x if n else 0),
        ("divided by n (n + 1)", lambda n, s, x: (n * x - s) ** 2),
        ("divided by n (n + 1), not n", lambda n, s, x: (n * x - s) ** 2 / max(n, 1)),
        ("divided by n (n + 1), not n + 1", lambda n, s, x: (n * x - s) ** 2 / (n + 1) if n else 0),
        ("divided by n (n + 1), not n^2", lambda n, s, x: (n * x - s) ** 2 / n**2 if n else 0),
        ("n times x: (n x - S)^2", lambda n, s, x: (x - s) ** 2 / (n * (n + 1)) if n else 0),
        ("S is the sum before x", lambda n, s, x: (n * x - s - x) ** 2 / (n * (n + 1)) if n else 0),
        ("the square is missing", lambda n, s, x: (n * x - s) / (n * (n + 1)) if n else 0),
        ("n is that before x", lambda n, s, x: ((n + 1) * x - s - x) ** 2 / ((n + 1) * (n + 2)) if n else 0),
        ("n is that before x", lambda n, s, x: ((n + 1) * x - s) ** 2 / ((n + 1) * (n + 2))),
    )  # fmt: skip
    for told, step in steps:
        wrong.append((np.array([sum(step(n, x[:n].sum(), x[n]) for n in range(3))]), told))
    text = "(n x - S)^2 / (n (n + 1)) is added, n and S being those before x"
    expect("RND-4", "the sum of squares after three samples", squares, np.array([14.0]), 1e-12, wrong, text)


def divided(student: Any) -> None:
    """The variance of one sample."""
    likely = [
        (14.0 / 3.0, "divided by n: n - 1, since the mean was estimated from the same samples"),
        (14.0 / 4.0, "divided by n + 1: n - 1"),
        (14.0 / 6.0, "that is the variance of the mean: of one sample it is squares / (n - 1)"),
        (7.0**0.5, "the standard deviation: the variance has no root"),
        (14.0, "not divided"),
    ]
    found, what = student.variance(3, 14.0), "the variance of 3 samples whose squares are 14"
    expect("RND-4", what, found, 7.0, 1e-12, likely)
    expect("RND-4", "the variance of 2 samples whose squares are 3", student.variance(2, 3.0), 3.0, 1e-12)
    text = "one sample says nothing of its variance: divide by max(n - 1, 1)"
    expect(
        "RND-4", "the variance of one sample", student.variance(1, np.zeros(2)), np.zeros(2), 0.0, (), text
    )


def cancellation(student: Any) -> None:
    """Samples around 1e9 with variance 1: x^2 has 2^-53 * 1e18 = 100 of rounding, the recurrence 1e-6."""
    samples = 1e9 + normals(71, (400, 1))
    n, _, squares = sums(student, samples)
    found = float(numbers_of("RND-4", "the variance", student.variance(n, squares), (1,))[0])
    right = float(np.var(samples, ddof=1))
    text = "a sum of squares minus a square of sums loses all digits: use the recurrence"
    expect("RND-4", "the variance of samples near 1e9", found, right, 1e-4, (), text)


def colours(x: Any, y: Any, n: int) -> Any:
    """Return colours (P, 2): uniform in [x, x + 1) and in [0, y + 1), of known mean and variance."""
    pixel = np.asarray(y) * WIDTH + np.asarray(x)
    first, second, third, fourth = (rng.counter(v) for v in (77, pixel, n, 0))
    u0, u1, _, _ = rng.uniforms(first, second, third, fourth, np.float64)
    return np.stack([x + u0, (y + 1) * u1], axis=-1)


def taken(student: Any, spp: int = SPP) -> tuple[Any, Any, list[int]]:
    """Return the student's picture, its variance, and the numbers of the samples that it took."""
    asked: list[int] = []

    def radiance(x: Any, y: Any, n: int) -> Any:
        text = "one array of all columns: np.mgrid's are (H, W), so ravel() them"
        equal("RND-1", "the shape of a call's pixels", np.shape(x), (WIDTH * HEIGHT,), text)
        last, swapped = int(np.max(x)), "x and y are exchanged"
        hold("RND-1", "the columns x", last == WIDTH - 1, f"up to {WIDTH - 1}", last, swapped)
        asked.append(int(n))
        return colours(x, y, n)

    found = student.picture(radiance, WIDTH, HEIGHT, spp)
    results("RND-1", "the result of picture", found, 2, "a pair")
    return found[0], found[1], asked


def right_picture(spp: int = SPP) -> Any:
    """Return all samples (spp, H, W, 2)."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.stack([colours(x, y, n) for n in range(spp)])


def whole(student: Any) -> None:
    """Mean and variance of a picture."""
    mean, variance, asked = taken(student)
    text = "each of the samples 0 to spp - 1 once"
    told = f"{len(asked)}, the first {asked[:3]}"
    hold("RND-1", "the samples that are taken", asked == list(range(SPP)), f"0 to {SPP - 1}", told, text)
    samples = right_picture()
    likely = [
        (samples.sum(axis=0), "the sum is not divided by the number of samples"),
        (samples[-1], "only the last sample"),
        (samples[0], "only the first sample"),
        (samples.mean(axis=0)[::-1], "row 0 is at the top"),
        (samples.mean(axis=0)[:, ::-1], "column 0 is at the left"),
        (samples.sum(axis=0) / (SPP - 1), "the mean divides by n; n - 1 is for the variance"),
        (samples.sum(axis=0) / (SPP + 1), "divided by n + 1"),
    ]
    text = "pixels row by row: reshape(height, width, -1)"
    expect("RND-1", "the mean", mean, samples.mean(axis=0), 1e-9, likely, text)
    right = samples.var(axis=0, ddof=1)
    likely = [
        (right / SPP, "that is the variance of the mean: of one sample it is asked"),
        (samples.var(axis=0), "divided by n: n - 1"),
        (np.sqrt(right), "the standard deviation: the variance has no root"),
        (right * (SPP - 1), "the sum of squares is not divided by n - 1"),
    ]
    expect("RND-4", "the variance", variance, right, 1e-9, likely, "variance(n, squares)")


def predicts(student: Any) -> None:
    """Compare the picture's mean squared error with what its variance says.

    A z-test of the mean of 2 W H squared deviates, each of mean 1 and variance 2 or a little less;
    significance 1 %.
    """
    mean, _, _ = taken(student)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    truth = np.stack([x + 0.5, (y + 1) / 2.0], axis=-1)
    true_variance = np.stack([np.full(x.shape, 1 / 12), (y + 1) ** 2 / 12], axis=-1)
    ratio = float(np.mean((np.asarray(mean) - truth) ** 2 / (true_variance / SPP)))
    p = normal_p((ratio - 1.0) / math.sqrt(2.0 / truth.size))
    what, text = "squared error / (variance / n)", "not a mean of n samples"
    hold("RND-1", what, p >= SIGNIFICANCE, "1", f"{ratio:.3f}", text)


def bright(student: Any) -> None:
    """A picture around 1e9 has the variance of the same one around 0, up to what the recurrence rounds."""
    _, wanted, _ = taken(student)
    found = student.picture(lambda x, y, n: 1e9 + colours(x, y, n), WIDTH, HEIGHT, SPP)[1]
    text = "a mean of squares minus a square of means loses all digits: add_sample for each sample"
    right = np.asarray(wanted, np.float64)
    expect("RND-4", "the variance of a picture around 1e9", found, right, 1e-4 * (HEIGHT + 1) ** 2, (), text)


def one_sample(student: Any) -> None:
    """A picture of one sample."""
    mean, variance, _ = taken(student, 1)
    expect("RND-1", "the mean of one sample", mean, right_picture(1)[0], 1e-12)
    expect(
        "RND-4", "the variance of one sample", variance, np.zeros((HEIGHT, WIDTH, 2)), 0.0, (), "0 for n = 1"
    )


def needed(student: Any) -> None:
    """Numbers of samples."""
    given = np.array([4.0, 0.0, 1.0, 2.25])
    found = student.samples_needed(given, 0.5)
    likely = [
        (np.array([8.0, 0.0, 2.0, 4.5]), "the error counts as its square: n = variance / error^2"),
        (np.array([8.0, 1.0, 2.0, 5.0]), "the error counts as its square: n = variance / error^2"),
        (np.array([16.0, 0.0, 4.0, 9.0]), "at least one sample"),
        (np.array([17.0, 1.0, 5.0, 10.0]), "one too many where the quotient is an integer: np.ceil"),
        (np.array([16.0, 2.0, 4.0, 9.0]), "at least one sample, not two"),
        (np.array([4.0, 1.0, 2.0, 3.0]), "the variance is the square already: divide it by error^2"),
        (np.array([1.0, 1.0, 1.0, 1.0]), "multiplied by the error's square: divide"),
        (np.array([64.0, 1.0, 4.0, 21.0]), "the variance is squared already"),
        (np.array([8.0, 1.0, 4.0, 6.0]), "variance / error^2: the variance has no root here"),
    ]
    wanted, text = np.array([16.0, 1.0, 4.0, 9.0]), "variance / error^2"
    expect("RND-4", "samples for an error of 0.5", found, wanted, 0.0, likely, text)
    found = student.samples_needed(np.array([1.1]), 0.5)
    large = student.samples_needed(np.array([2.0**24 + 1.0]), 1.0)
    text = "single precision: float32 does not hold 2^24 + 1"
    expect("RND-4", "samples for a variance of 2^24 + 1", large, np.array([2.0**24 + 1.0]), 0.0, (), text)
    text = "4.4 samples: round up, so that the error is not above what is asked"
    expect("RND-4", "samples for a variance of 1.1", found, np.array([5.0]), 0.0, (), text)


def errors(student: Any) -> None:
    """The mean squared error: numbers, single precision, the spec's vectors."""
    image, reference = spread(81, (3, 4, 3), 0.0, 1.0), spread(82, (3, 4, 3), 0.0, 1.0)
    d = image - reference
    likely = [
        (np.sum(d**2), "a sum: the mean over all pixels and channels"),
        (np.sum(d**2) / 12, "the mean goes over the channels too"),
        (np.sqrt(np.mean(d**2)), "the root is not taken"),
        (np.mean(np.abs(d)), "squares, not magnitudes"),
        (np.mean(d) ** 2, "the mean of the squares, not the square of the mean"),
        (np.mean(d), "the square is missing"),
        (np.mean(d**2) / 2, "no factor 1 / 2"),
        (np.mean(image**2 - reference**2), "the square of the difference"),
    ]
    expect("MET-3", "the mean squared error", student.mse(image, reference), np.mean(d**2), 1e-12, likely)
    exact = np.float32(1e8), np.float32(1e8) + np.float32(8)
    found = student.mse(np.full((2, 2), exact[0]), np.full((2, 2), exact[1]).astype(np.float32))
    expect("MET-3", "the error of 1e8 and 1e8 + 8", found, 64.0, 0.0)
    fine, text = np.ones((2, 2)) + 2.0**-30, "single precision: convert to float64 before subtracting"
    for pair in ((fine, np.ones((2, 2))), (np.ones((2, 2)), fine)):
        expect("MET-3", "the error of 1 + 2^-30 and 1", student.mse(*pair), 2.0**-60, 0.0, (), text)
    bytes_ = np.array([[0, 255]], np.uint8)
    found = student.mse(bytes_, bytes_[:, ::-1])
    text = "differences of bytes wrap: convert to float64 before subtracting"
    expect("MET-3", "the error of bytes 0 and 255", found, 255.0**2, 0.0, (), text)

    def answer(given: Any) -> Any:
        image, reference = given["image"], given["reference"]
        # What MET-1 refuses is not asked here.
        if isinstance(reference, list):
            raise InputError("reference", "this case", "MET-1 refuses it", "it is not asked")
        if (
            image.shape != reference.shape
            or not image.size
            or not np.isfinite([image.sum(), reference.sum()]).all()
        ):
            raise InputError("image", "this case", "MET-1 refuses it", "it is not asked")
        return {"value": student.mse(image, reference)}

    vectors("metric.mse", answer, likely="single precision: convert to float64 before subtracting")


def no_memory(student: Any) -> None:
    """Twice the same picture: nothing is kept between calls."""
    first, second = taken(student)[0], taken(student)[0]
    same, text = alike(first, second, 1e-12), "a sum that outlives the call"
    hold("RND-3", "the same picture again", same, "the same numbers", "others", text)


CHECKS = (
    Check("three samples", few),
    Check("the variance of one sample", divided),
    Check("samples far from 0", cancellation),
    Check("a picture", whole),
    Check("a picture around 1e9", bright),
    Check("a picture of one sample", one_sample),
    Check("the same picture again", no_memory),
    Check("the error that the variance predicts", predicts),
    Check("samples that are needed", needed),
    Check("the mean squared error", errors),
)
"""In the order in which they explain a mistake best."""
