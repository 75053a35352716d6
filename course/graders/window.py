"""Grades lab 6: features of known numbers, single taps, the spec's vectors, some of which must be refused."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ..frame import Check, Wrong, asked, equal, expect, hold, numbers_of, refuses, spread, still

IMAGE = np.arange(24.0).reshape(3, 4, 2)
"""Three rows of four pixels of two channels; no number comes twice."""


def taps(x: int, y: int, size: int, border: str, how: str = "") -> Any:
    """Return the window of a pixel of IMAGE, with one mistake."""
    height, width, _ = IMAGE.shape
    before = {"centre": (size - 1) // 2, "corner": 0, "end": size - 1}.get(how, size // 2)
    found = []
    for a in range(size):
        for b in range(size):
            dy, dx = (b, a) if how == "columns" else (a, b)
            row, column = y + dy - before, x + dx - before
            if how == "swapped":
                row, column = x + dy - before, y + dx - before
            if how == "mirrored":
                row, column = y - dy + before, x - dx + before
            inside = 0 <= row < height and 0 <= column < width
            at = (min(max(row, 0), height - 1), min(max(column, 0), width - 1))
            if how == "wrap":
                at, inside = (row % height, column % width), True
            if how == "reflect":
                at = (abs(row) % (2 * height), abs(column) % (2 * width))
                at = (min(at[0], 2 * height - 2 - at[0]), min(at[1], 2 * width - 2 - at[1]))
            zero = border == "zero" and how not in ("clamp", "wrap", "reflect")
            zero = zero or (how == "zero" and border == "clamp")
            found.append(0 * IMAGE[0, 0] if zero and not inside else IMAGE[at])
    stacked = np.array(found)
    return stacked.T.ravel() if how == "channels" else stacked.ravel()


MISTAKES = (
    ("swapped", "image[y, x]: the row is y, the column is x"),
    ("centre", "size // 2 taps are before the pixel, also where size is even"),
    ("corner", "the window begins size // 2 taps before the pixel, not at it"),
    ("end", "size // 2 taps are before the pixel, not all of them"),
    ("columns", "taps row by row: the column runs fastest"),
    ("channels", "the channels of a tap are together"),
    ("mirrored", "the window is mirrored: tap (dy, dx) is at y + dy - size // 2"),
    ("zero", "border `clamp`: outside a tap has the nearest pixel's value"),
    ("clamp", "border `zero`: outside a tap is 0"),
    ("wrap", "negative indices reach the other end: clamp rows and columns to the image"),
    ("reflect", "the border repeats the nearest pixel, it does not mirror the image"),
)
"""Mistakes of a window, and their explanations."""


def inside(student: Any) -> None:
    """Windows that are inside of the image."""
    found = student.window(IMAGE, 2, 1, 1, "clamp")
    flat = np.shape(found) == (2,) or np.size(found) != 2
    hold("DAT-4", "the shape of a window", flat, "(2,)", str(np.shape(found)), "one vector: ravel()")
    likely = [(IMAGE[1, 2][::-1], "the channels are in their order")]
    likely += [(IMAGE[2, 1], "image[y, x]: the row is y, the column is x")]
    expect("DAT-4", "a window of one tap", found, IMAGE[1, 2], 0.0, likely, "image[y, x]")
    for size in (3, 2):
        _compare(student, "DAT-4", 2, 1, size, "clamp")


def _compare(student: Any, clause: str, x: int, y: int, size: int, border: str) -> None:
    """Compare one window."""
    found = student.window(IMAGE.copy(), x, y, size, border)
    what = f"the window of size {size} at x = {x}, y = {y}, {border}"
    right = taps(x, y, size, border)
    array = numbers_of(clause, what, found)
    if array.shape != right.shape and array.size == right.size:
        raise Wrong(clause, f"the shape of {what}", str(right.shape), str(array.shape), "one vector: ravel()")
    likely = [(taps(x, y, size, border, how), told) for how, told in MISTAKES]
    expect(
        clause, what, found, right, 0.0, likely, "tap (dy, dx) is at (y + dy - size // 2, x + dx - size // 2)"
    )


def borders(student: Any) -> None:
    """Windows that reach beyond the image."""
    for border in ("clamp", "zero"):
        for x, y, size in ((0, 0, 3), (3, 2, 3), (1, 0, 4), (3, 1, 2), (0, 2, 5)):
            _compare(student, "DAT-5", x, y, size, border)


def refused(student: Any) -> None:
    """What is not a window."""
    for size, border in ((0, "clamp"), (0, "zero"), (65, "clamp"), (-1, "zero"), (3, "mirror"), (3, "")):
        text = "raise ValueError for a size outside 1 to 64, and for an unknown border"
        call = partial(student.window, IMAGE, 0, 0, size, border)
        refuses("DAT-9", f"size {size} and border {border!r}", ValueError, call, text, lambda _: "a window")
    for size in (1, 64):
        what = f"the length of a window of size {size}"
        try:
            length = len(student.window(IMAGE, 0, 0, size, "zero"))
        except ValueError:
            raise Wrong("DAT-9", what, str(2 * size**2), "ValueError", "1 and 64 are sizes") from None
        equal("DAT-9", what, length, 2 * size**2)


def untouched(student: Any) -> None:
    """The image is left as it was, and a window is not a view of it."""
    (image,) = still(np.ones((4, 4, 1)))
    try:
        found = numbers_of("DAT-4", "the window", student.window(image, 0, 0, 3, "zero"))
    except ValueError as error:
        text = "zeros were written into the image: make a copy"
        raise Wrong("DAT-4", "the image", "no change", str(error), text) from None
    # Nobody can write to the image, nor to a view of it.
    hold("DAT-4", "the window", found.flags.writeable, "numbers of its own", "a view of the image")


def answer(student: Any, given: Any) -> Any:
    """Return the student's answer to a case of image.window."""
    size, x, y = (int(given[name]) for name in ("size", "x", "y"))
    return {"window": student.window(given["image"], x, y, size, str(given["border"]))}


def features(student: Any) -> None:
    """Each feature within its range, in order, rounded once."""
    albedo, normal = spread(91, (2, 3, 3), -0.5, 1.5), spread(92, (2, 3, 3), -1.5, 1.5)
    depth = spread(93, (2, 3, 1), -4.0, 12.0)
    depth[0, 0] = 0.25  # below 1 also before it is divided
    found = student.feature_image(*still(albedo, normal, depth), 8.0)
    kind = str(numbers_of("DAT-3", "the feature image", found).dtype)
    text = "float64 all the way, rounded once at the end: .astype(np.float32)"
    equal("DAT-3", "the kind of the feature image", kind, "float32", text)
    parts = [np.clip(albedo, 0, 1), np.clip(normal, -1, 1), np.clip(depth / 8.0, 0, 1)]
    right = np.concatenate(parts, axis=-1).astype(np.float32)

    def made(a: Any, n: Any, d: Any) -> Any:
        return np.concatenate([a, n, d], axis=-1).astype(np.float32)

    likely = [
        (made(albedo, parts[1], parts[2]), "albedo is clipped to [0, 1]"),
        (made(np.clip(albedo, -1, 1), parts[1], parts[2]), "albedo is clipped to [0, 1], not to [-1, 1]"),
        (made(parts[0], np.clip(normal, 0, 1), parts[2]), "a normal has both signs: clip to [-1, 1]"),
        (made(parts[0], normal, parts[2]), "a normal is clipped to [-1, 1]"),
        (made(parts[0], (parts[1] + 1) / 2, parts[2]), "a normal keeps its range [-1, 1]"),
        (made(parts[0], parts[1], depth / 8.0), "depth / depth_scale is clipped to [0, 1]"),
        (made(parts[0], parts[1], np.clip(depth, 0, 1)), "depth is divided by depth_scale"),
        (made(parts[0], parts[1], np.clip(depth, 0, 1) / 8.0), "divided by depth_scale first, clipped then"),
        (
            made(parts[0], parts[1], np.clip(depth * 8.0, 0, 1)),
            "depth is divided by depth_scale, not multiplied",
        ),
        (made(parts[1], parts[0], parts[2]), "the order: albedo, normal, depth"),
        (made(parts[2], parts[0], parts[1]), "the order: albedo, normal, depth"),
        (made(parts[2], parts[1], parts[0]), "the order: albedo, normal, depth"),
        (made(parts[0], parts[1], 1 - parts[2]), "depth grows with the distance"),
    ]
    text = "clip, divide, concatenate along the last axis"
    expect("DAT-1", "the feature image", found, right, 0.0, likely, text)
    # float32 layers: 1 / 3 of them in float64 and in float32 differ in the last bit.
    small = spread(94, (40, 1, 1), 0.0, 3.0).astype(np.float32)
    found = student.feature_image(
        np.zeros((40, 1, 3), np.float32), np.zeros((40, 1, 3), np.float32), small, 3.0000001
    )
    right = np.clip(small.astype(np.float64) / 3.0000001, 0, 1).astype(np.float32)
    text = "computed in float32: convert to float64 first, and round once at the end"
    depths = numbers_of("DAT-3", "the image", found, (40, 1, 7))[..., 6:]
    expect("DAT-3", "depths of float32 layers", depths, right, 0.0, (), text)


def scales(student: Any) -> None:
    """Depths at scales that are not above 1."""
    depth, zeros = spread(95, (2, 3, 1), 0.0, 2.0), np.zeros((2, 3, 3))
    for scale in (0.5, 1.0):
        text = "any scale above 0 is right"
        try:
            image = student.feature_image(zeros, zeros, depth, scale)
        except ValueError as error:
            raise Wrong("DAT-1", f"depth_scale {scale}", "an image", f"ValueError: {error}", text) from None
        last = numbers_of("DAT-1", "the feature image", image, (2, 3, 7))[..., 6:]
        scaled = np.clip(depth / scale, 0, 1).astype(np.float32)
        expect("DAT-1", f"depths at a scale of {scale}", last, scaled, 0.0, (), text)


def bad_scale(student: Any) -> None:
    """A scale that is not above 0."""
    layers = np.zeros((1, 1, 3)), np.zeros((1, 1, 3)), np.ones((1, 1, 1))
    for scale in (0.0, -1.0, float("nan")):
        text = "`not depth_scale > 0` refuses NaN too" if scale != scale else "raise ValueError"
        call = partial(student.feature_image, *layers, scale)
        refuses("DAT-9", f"depth_scale {scale}", ValueError, call, text, lambda _: "an image")


CHECKS = (
    Check("features", features),
    Check("small scales", scales),
    Check("scales that are refused", bad_scale),
    Check("windows inside of the image", inside),
    Check("windows at the border", borders),
    Check("windows that are refused", refused),
    Check("the image is left as it was", untouched),
    Check("the spec's vectors", asked("image.window", answer, "what is refused, and what is not")),
)
"""In the order in which they explain a mistake best."""
