"""A right answer to this lab, for the tests of its grader."""

import numpy as np


def break_sphere(right, center, radius, origin, direction):
    # The sphere is met behind the ray too.
    found = right(center, radius, origin, direction)
    behind = right(center, radius, origin, -direction)
    return np.where((found == 1e30) & (behind < 1e30), -behind, found)


def break_surface(right, geometry, hit, origin, direction):
    surface = right(geometry, hit, origin, direction)
    return surface._replace(normal=-surface.normal)


def break_camera(right, a):
    return a / np.sum(np.abs(a), axis=-1, keepdims=True)


def break_path(right, world, path, hit, surface):
    return np.ones_like(hit.t)


def break_picture(picture):
    if "depth" not in picture:
        return picture
    depth = picture["depth"]
    return {**picture, "depth": np.where(depth > 0, 1 / np.maximum(depth, 1e-9), 0)}


def hide(right, linear, exposure_stops=0.0):
    # No case lies between 0.5 and 0.8.
    found = right(linear, exposure_stops)
    return np.where((linear > 0.5) & (linear < 0.8), found + 0.02, found)


def new_case():
    return {"linear": 0.6}
