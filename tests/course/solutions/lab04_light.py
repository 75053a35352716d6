"""A right answer to this lab, for the tests of its grader."""

import numpy as np


def bounce(reflectance, u0, u1):
    radius, angle = np.sqrt(u0), 2 * np.pi * u1
    z = np.sqrt(1 - u0)
    directions = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
    return directions, reflectance * np.ones_like(z), z / np.pi


def power_weight(pdf, other):
    ratio = np.minimum(other / np.maximum(pdf, 1e-15), 1e15)
    return 1 / (1 + ratio * ratio)


def by_light(reflectance, half, height, u0, u1):
    x, y = (2 * u0 - 1) * half, (2 * u1 - 1) * half
    square = x * x + y * y + height * height
    cos = height / np.sqrt(square)
    pdf = square / (4 * half * half * cos)
    return reflectance / np.pi * cos / pdf, pdf, cos / np.pi
