"""Grades exercise 5: the spec's vectors, some of which must be refused."""

from __future__ import annotations

import numpy as np


def test_one_pixel_is_its_own_window(student):
    image = np.arange(12).reshape(2, 3, 2)
    assert list(student.window(image, 2, 1, 1, "clamp")) == [10, 11], "image[row y, column x]"


def test_the_vectors(student, hold_to_vectors):
    def answer(given):
        size, x, y = (int(given[name]) for name in ("size", "x", "y"))
        return {"window": student.window(given["image"], x, y, size, str(given["border"]))}

    hold_to_vectors("image.window", answer)


def test_the_image_is_left_as_it_was(student):
    image = np.ones((4, 4, 1))
    student.window(image, 0, 0, 3, "zero")
    assert np.all(image == 1.0)
