"""Numbers as text that loses nothing: floats in hexadecimal, so that files can be compared and reviewed.

1. A float is C's `%a`: `0x1.8p+1`; also `inf`, `-inf` and `nan` [`number_text`]. An integer is a JSON number.
2. An array is a list of such, nested by its axes [`to_json`]; a boolean is a JSON one.
3. Reading takes decimal numbers too, which are rounded to float64: programs without a hexadecimal format may
   answer with 17 significant digits [`from_json`].
4. A picture may be a file: `{"file": PATH, "shape": [...]}`, raw little-endian float32 [`from_file`].
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.reading import read_file, refusing


def number_text(value: float) -> str:
    """Return a float as text: hexadecimal with the shortest fraction, or inf, -inf, nan."""
    if not math.isfinite(value):
        return str(float(value))
    sign, _, rest = float(value).hex().rpartition("0x")
    mantissa, _, exponent = rest.partition("p")
    whole, _, fraction = mantissa.partition(".")
    fraction = fraction.rstrip("0")
    return f"{sign}0x{whole}{'.' + fraction if fraction else ''}p{exponent}"


def is_number(value: Any) -> bool:
    """Tell whether a JSON value is a number, as such or as text."""
    try:
        _float(value, "")
    except InputError:
        return False
    return True


def rounded_up(bound: Any) -> Any:
    """Return bounds (...) rounded up to 8 bits: short texts, and no less than was proven."""
    mantissa, exponent = np.frexp(np.asarray(bound, np.float64))
    return np.ldexp(np.ceil(mantissa * 256.0), exponent - 8)


def from_file(value: Mapping[str, Any], what: str) -> NDArray[np.float32]:
    """Return the array (...) in the file that a JSON value names."""
    way_out = "see spec/conformance.md"
    rule = "must name a file of little-endian float32 of its shape"
    with refusing(what, value, rule, way_out):
        shape = tuple(int(side) for side in value["shape"])
        raw = read_file(str(value["file"]), what, way_out, stated=4 * math.prod(shape))
        return np.frombuffer(raw, "<f4").astype(np.float32).reshape(shape)


def to_json(value: Any) -> Any:
    """Return arrays, numbers and booleans in the form of JSON; mappings and sequences item by item."""
    if isinstance(value, dict):
        return {name: to_json(item) for name, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_json(item) for item in value]
    if isinstance(value, np.ndarray) and value.ndim:
        return [to_json(item) for item in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating, np.ndarray)):
        return number_text(float(value))
    return value


def from_json(value: Any, what: str) -> NDArray[Any]:
    """Return nested lists of numbers as an array: float64, or int64 where all are integers, or bool."""
    kinds = set[type]()

    def converted(item: Any) -> Any:
        if isinstance(item, list):
            return [converted(part) for part in item]
        kinds.add(type(item))
        return item if isinstance(item, int) else _float(item, what)

    try:
        tree = converted(value)
        if bool in kinds and len(kinds) > 1:
            # A boolean is not a number.
            _float(True, what)
        dtype = np.bool_ if kinds == {bool} else np.int64 if kinds == {int} else np.float64
        return np.array(tree, dtype)
    except RecursionError:
        raise InputError(what, NO_VALUE, "is nested too deeply", "give a list of numbers") from None
    except (ValueError, OverflowError):
        rule = "lists must be of one length on each axis, integers below 2**63"
        raise InputError(what, value, rule, "answer with the shape that the format page states") from None


def _float(leaf: Any, what: str) -> float:
    """Return one number."""
    try:
        if isinstance(leaf, str):
            return float.fromhex(leaf) if "0x" in leaf.lower() else float(leaf)
        if isinstance(leaf, (int, float)) and not isinstance(leaf, bool):
            return float(leaf)
    except (ValueError, OverflowError):
        pass
    rule = "must be a number, as JSON or as text such as 0x1.8p+1"
    raise InputError(what, leaf, rule, "see the format page of this kind")


def mean_and_variance(mean: Any, variance: Any, size: int) -> tuple[Any, Any]:
    """Return means of blocks of pixels (H / size, W / size, C), and the variances of one sample of a block.

    Block means are nearly normal, which single pixels of a path tracer are not. A sample of a block is one of
    each of its pixels, which are independent: variances are averaged, and divided by the number of pixels.
    """
    height, width, channels = mean.shape
    parts = (height // size, size, width // size, size, channels)
    means, variances = (np.mean(image.reshape(parts), axis=(1, 3)) for image in (mean, variance))
    return means, variances / size**2
