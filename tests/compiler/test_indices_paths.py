"""Indices of path and encoding kernels, evaluated in the types that their texts declare (PTK-17).

1. The declarations of a text that lead to an index are read with their types, and evaluated in order: `int`
   and `i32` are 32 bits that must not overflow, `size_t` is 64 [`Number`], [`names_in`].
2. Each subscript of sums and images is evaluated at the corners of pictures and for all planes: below the
   stated limit all are in the array and no two meet; where a text counts in 32 bits, one number more than the
   limit overflows, which is why exports state it; where it counts in `size_t`, far larger ones are right.
3. What reads and writes textures has no subscripts; its coordinates are those of the texture.
"""

import re
from itertools import product

import pytest

from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import LANGUAGES
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import Normalization

LIMIT = 2**31
"""First number that 32 bits with a sign do not hold; the sums of a launch must be fewer."""


DECLARED = re.compile(
    r"(?m)^ +(?:const |let )?"
    r"(?:(?P<kind>size_t|int) (?P<name>\w+)|(?P<name_>\w+): (?P<kind_>i32)) = (?P<text>[^;]+);"
)
"""A declaration of an integer."""

SUBSCRIPT = re.compile(r"\b(?P<array>sums|image_\w+)\[(?P<text>[^\[\]]*\b(?:at|pixel)\b[^\[\]]*)\]")
"""A subscript of a place in the picture."""

VECTOR = re.compile(r"vstore\d+\([^,]+, 0, (?P<array>sums) \+ (?P<text>[^)]+)\)")
"""A store of a vector: the index of its first number."""

TEXTURES = ("texelFetch", "layout(location")
"""Words of texts without subscripts."""


class Number:
    """An integer of a type, whose arithmetic must not leave it."""

    def __init__(self, value, kind):
        value = int(value)
        low, high = (0, 2**64) if kind == "size_t" else (-LIMIT, LIMIT)
        assert low <= value < high, f"{value} is outside of {kind}"
        self.value, self.kind = value, kind

    def _with(self, other, operation):
        """A number of 64 bits makes the result one; a literal takes the other's type."""
        kinds = {self.kind, other.kind if isinstance(other, Number) else self.kind}
        return Number(operation(self.value, int(other)), "size_t" if "size_t" in kinds else self.kind)

    def __int__(self):
        return self.value

    def __add__(self, other):
        return self._with(other, int.__add__)

    def __sub__(self, other):
        return self._with(other, int.__sub__)

    def __mul__(self, other):
        return self._with(other, int.__mul__)

    __radd__, __rmul__ = __add__, __mul__


def evaluated(text, known):
    """Return the value of an index: names, sums, products and casts."""
    text = re.sub(r"\((size_t|int)\)(\w+(?:(?:->|\.)\w+)?)", r"\1(\2)", text)
    text = re.sub(r"\b(?:part->|size\.)", "", text)
    casts = {kind: lambda value, kind=kind: Number(value, kind) for kind in ("size_t", "int")}
    return eval(text, {"__builtins__": {}}, {**casts, **known})


def names_in(source, given):
    """Return the numbers that lead to indices by name; `given` are coordinates, sizes and strides."""
    known = {name: Number(value, "int") for name, value in given.items()}
    for found in DECLARED.finditer(source):
        name, kind = found["name"] or found["name_"], found["kind"] or found["kind_"]
        try:
            # Coordinates come from the launch; the rest is computed from them.
            if name in ("x", "y", "row", "column"):
                known[name] = Number(given[name], kind)
            elif name == "stride":
                known[name] = Number(given["width"], kind)
            elif name == "plane" and "get_global_size" in found["text"]:
                known[name] = Number(given["rows"], kind) * known["stride"]
            else:
                known[name] = Number(evaluated(found["text"], known), kind)
        except (NameError, SyntaxError, KeyError):
            continue
    if "for (size_t at = 0; at < plane; ++at)" in source:
        known["at"] = Number(given["y"] * given["width"] + given["x"], "size_t")
    return known


def indices(source, height, width, corner, planes):
    """Return (array, index) of all places of a pixel that a text reads or writes."""
    y, x = corner
    given = {"width": width, "height": height, "rows": height, "row": y, "column": x, "y": y, "x": x}
    given |= {"row_stride": width, "plane_stride": height * width}
    if "plane_stride" not in source:
        del given["plane_stride"]
    known = names_in(source, given)
    found = set()
    for match in (*SUBSCRIPT.finditer(source), *VECTOR.finditer(source)):
        index = int(evaluated(match["text"], known))
        found.add((match["array"], index))
    assert len({index for array, index in found if array == "sums"}) == planes
    return found


def path_text(target):
    programs = lower_scene(canonical("lone_light"), Settings(max_depth=1))
    made = compile_path(programs, target, groups=("color", "normal"))
    return made.source, len(made.planes), {}


def encode_text(target):
    made = compile_encode(("color", "normal", "depth"), Normalization(), target)
    return made.source, len(made.planes), {f"image_{image.name}": image.channels for image in made.images}


WRITTEN = [target for target in LANGUAGES.values() if target.name != "numpy"]
CASES = [(path_text, target.name) for target in WRITTEN if target.paths]
CASES += [(encode_text, target.name) for target in WRITTEN if target.paths]


def check_picture(text, height, width):
    """Insist that all indices at the corners of a picture lie in their arrays and are different."""
    source, planes, images = text
    corners = sorted(set(product({0, height - 1}, {0, width - 1})))
    seen = [indices(source, height, width, corner, planes) for corner in corners]
    assert len(set().union(*seen)) == sum(map(len, seen)), "two places meet"
    for array, index in set().union(*seen):
        channels = planes if array == "sums" else images[array]
        assert 0 <= index < channels * height * width, array


def sizes(most):
    """Return (height, width) of a square, a flat and a high picture of at most so many pixels."""
    side = int(most**0.5)
    return [(side, side), (2, most // 2), (most // 3, 3)]


@pytest.mark.parametrize(("make", "target"), CASES)
def test_indices_below_the_limit_are_right(make, target):
    """PTK-17: whatever the language, where all sums together are fewer than 2^31."""
    text = make(target)
    if not SUBSCRIPT.search(text[0]):
        assert any(word in text[0] for word in TEXTURES), "neither subscripts nor textures"
        return
    for height, width in [(1, 1), (1, 5), *sizes((LIMIT - 1) // text[1])]:
        check_picture(text, height, width)


@pytest.mark.parametrize(("make", "target"), CASES)
def test_indices_beyond_the_limit_are_right_or_no_numbers(make, target):
    """Texts that count in size_t are right there; the others are those whose exports state the limit."""
    text = make(target)
    if not SUBSCRIPT.search(text[0]):
        return
    wide = "size_t at" in text[0]
    assert wide == (target.partition(":")[0] in ("opencl", "cuda", "c")), target
    for height, width in sizes(LIMIT - 1):
        if wide:
            check_picture(text, height, width)
        else:
            with pytest.raises(AssertionError, match="is outside of i"):
                check_picture(text, height, width)


@pytest.mark.parametrize("lanes", [1, 4, 16])
def test_opencl_paths_in_vectors_are_right(lanes):
    """A vector is stored from the index of its first number on; rows are whole vectors."""
    programs = lower_scene(canonical("lone_light"), Settings(max_depth=1))
    made = compile_path(programs, "opencl", lanes=lanes, groups=("color",))
    for height, width in ((1, 16), (2**15, 2**15), (3, 2**29)):
        check_picture((made.source, 3, {}), height, width)
