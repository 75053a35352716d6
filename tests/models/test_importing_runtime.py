"""Imported graphs beside ONNX Runtime: equal inside the reported margin, or rejected; and within limits."""

import tracemalloc
from collections import Counter
from random import Random

import numpy as np
import pytest
from packages import needed
from strangers import graph

from wamnet.models.importing.network import import_network
from wamnet.refimpl.errors import InputError

pytestmark = pytest.mark.needs("packages")

SEED = 20_26
"""Of the random graphs that are the same on every run; `make fuzz ONLY=graph` tries others."""


@pytest.fixture(autouse=True)
def compared():
    """Give the comparison, or skip."""
    needed("onnx")
    needed("onnxruntime")
    from beside import compared

    return compared


def ints(*values):
    return np.array(values, np.int64)


W = np.random.default_rng(3).normal(size=(2, 2, 3, 3)).astype(np.float32)
M = np.random.default_rng(5).normal(size=(2, 3)).astype(np.float32)
NORM = {name: np.float32([0.5, 2.0]) for name in "abcd"}
TO_LAST, TO_FIRST = {"perm": [0, 2, 3, 1]}, {"perm": [0, 3, 1, 2]}
SHAPE, FIXED, ROWS = (1, 2, "h", "w"), (1, 2, 9, 11), ("n", 2)
SAME = {"auto_pad": "SAME_LOWER"}

RIGHT = {
    "squeeze without axes": ([("Squeeze", "x", "y")], {}, (1, "n", 3), {"opset": 11, "rank": 2}),
    "normalised": ([("BatchNormalization", "xabcd", "y", {"training_mode": 0})], NORM, SHAPE, {}),
    "inference": ([("Dropout", "xrt", "y")], {"r": 0.5, "t": np.array(False)}, SHAPE, {}),
    "a row and a scalar": ([("Gemm", "xmc", "a"), ("Gemm", "ams", "y", {"transB": 1, "beta": 2.0})],
        {"m": M, "c": M[:1], "s": 3.0}, ROWS, {}),
    "channels last": ([("Transpose", "x", "a", TO_LAST), ("Reshape", "as", "b"), ("MatMul", "bm", "c"),
        ("Relu", "c", "y")], {"s": ints(-1, 2), "m": M}, SHAPE, {"rank": 2}),
    "rows and back": ([("Transpose", "x", "a", TO_LAST), ("Reshape", "as", "b"), ("Relu", "b", "c"),
        ("Reshape", "ct", "d"), ("Transpose", "d", "e", TO_FIRST), ("Conv", "ew", "y")],
        {"s": ints(-1, 2), "t": ints(1, 9, 11, 2), "w": W}, FIXED, {"border": "zero"}),
    "cropped to a size": ([("Conv", "xw", "a", {"pads": [2] * 4}), ("Slice", "abcd", "y")],
        {"w": W, "b": ints(1, 1), "c": ints(10, 12), "d": ints(2, 3)}, FIXED, {}),
    "one channel": ([("Slice", "xsea", "b"), ("Reshape", "bt", "c"), ("Transpose", "c", "y", TO_FIRST)],
        {"s": ints(1), "e": ints(2), "a": ints(1), "t": ints(1, 9, 11, 1)}, FIXED, {}),
    "integers": ([("Cast", "x", "a", {"to": 1}), ("Mul", "ak", "y")], {"k": 1 / 255}, SHAPE,
        {"dtype": "uint8"}),
    "float16": ([("Neg", "x", "a"), ("Relu", "a", "y")], {}, SHAPE, {"dtype": "float16"}),
    "float64": ([("Clip", "xlh", "y")], {"l": np.array(0.1), "h": np.array(0.7)}, SHAPE,
        {"dtype": "float64"}),
}  # fmt: skip
"""Graphs of two channels that are imported: nodes, constants, the input's shape, and options."""


def written(path, case):
    """Write a graph of a table; return its border too."""
    nodes, constants, shape, rest = case
    options = {key: value for key, value in rest.items() if key != "border"}
    return graph(path, nodes, constants, shape, **options).read_bytes(), rest.get("border", "")


@pytest.mark.parametrize("case", RIGHT)
def test_right(case, compared, tmp_path):
    content, border = written(tmp_path / "graph.onnx", RIGHT[case])
    assert compared(content, tmp_path, border) == "equal"


WRONG = {
    "batch statistics": ([("BatchNormalization", "xabcd", "y m v", {"training_mode": 1})], NORM, SHAPE,
        r"training_mode=1': training_mode must be 0 \(export the network for inference"),
    "batch statistics of old": ([("BatchNormalization", "xabcd", "y m v s t")], NORM, SHAPE,
        "'y, m, v, s, t': further outputs are for training"),
    "random masks": ([("Dropout", "xrt", "y")], {"r": 0.5, "t": np.array(True)}, SHAPE,
        "training_mode=1': must be 0"),
    "statistics of rows": ([("Transpose", "x", "a", TO_LAST), ("BatchNormalization", "abcde", "y")],
        {name: np.float32([1, 2]) for name in "bcde"}, (1, 2, 2, 5), "axis 1 must be the channels"),
    "columns before rows": ([("Transpose", "x", "a", {"perm": [0, 3, 2, 1]}), ("Reshape", "as", "b"),
        ("Transpose", "b", "y", TO_FIRST)], {"s": ints(1, 9, 9, 2)}, (1, 2, 9, 9),
        "axes of the output '1, C, W, H': .* not transposed"),
    "a column": ([("Gemm", "xmc", "y", {"transB": 1})], {"m": M.T, "c": np.ones((3, 1))}, (3, 2),
        r"a constant of shape \(3, 1\) beside axes N, C': one number, or one for each channel"),
    "a matrix": ([("Gemm", "xmc", "y")], {"m": M, "c": np.float32(np.ones((3, 3)))}, (3, 2),
        r"a constant of shape \(3, 3\) beside axes N, C"),
    "leading axes": ([("Add", "xc", "y")], {"c": np.float32(np.ones((2, 1, 1)))}, ROWS,
        r"a constant of shape \(2, 1, 1\) beside axes 1, N, C"),
    "another mode": ([("Conv", "xw", "y", {"auto_pad": "SAME"})], {"w": W}, SHAPE,
        "auto_pad=SAME': auto_pad must be NOTSET or SAME_LOWER or"),
    "one dilation": ([("Conv", "xw", "y", {"dilations": [2]})], {"w": W}, SHAPE,
        r"dilations=\[2\]': dilations m"),
    "two margins": ([("Conv", "xw", "y", {"pads": [1, 1]})], {"w": W}, SHAPE,
        r"pads=\[1, 1\]': pads must be 4"),
    "a scalar weight": ([("Conv", "xw", "y")], {"w": 1.0}, SHAPE, r"weights \(\), constants"),
    "words": ([("Conv", "xw", "y")], {"w": np.array([["a"]])}, SHAPE, "input 1 of object': must be float"),
    "a weight of one axis": ([("Gemm", "xmc", "y")], {"m": M[0], "c": M[0]}, ROWS,
        r"weights \(3,\)': a matrix"),
    "seven constants": ([("Gemm", "xmc", "y")], {"m": M, "c": np.float32(np.ones(7))}, ROWS,
        r"a constant of shape \(7,\)"),
    "fewer statistics": ([("BatchNormalization", "xabcd", "y")], NORM | {"d": np.float32([1])}, SHAPE,
        "2 channels, constants"),
    "fractions": ([("Slice", "xse", "y")], {"s": np.float32([0.5]), "e": ints(1)}, SHAPE,
        "starts of float32, .*: at most 16 integers"),
    "one margin": ([("Pad", "xp", "y")], {"p": ints(1)}, SHAPE, r"\[1\], constant, 0.0': margins of rows"),
    "a margin of words": ([("Pad", "xpv", "y")], {"p": ints(0, 0, 1, 1, 0, 0, 1, 1), "v": np.array(["a"])},
        SHAPE, "value of object, .*: one number of floating point"),
    "an axis twice": ([("Unsqueeze", "xa", "y")], {"a": ints(0, 0)}, ROWS, r"\[0, 0\]: each axis once, of 4"),
    "several ends": ([("Clip", "xl", "y")], {"l": np.float32([0, 1])}, SHAPE,
        "min of float32, .*: one number"),
    "integers": ([("Div", "xc", "y")], {"c": np.int32([2])}, "int32", "type of the elements 'int32': one of"),
    "bytes": ([("Sub", "xc", "y")], {"c": np.uint8([2])}, "uint8", ".* 'integers': it would round or wrap"),
}  # fmt: skip
"""Graphs that are rejected: nodes, constants, the input's shape or type, and the message."""


@pytest.mark.parametrize("case", WRONG)
def test_wrong(case, tmp_path):
    nodes, constants, shape, message = WRONG[case]
    options = {"dtype": shape} if isinstance(shape, str) else {"shape": shape}
    old = {"opset": 7} if case.endswith("of old") else {}
    path = graph(tmp_path / "graph.onnx", nodes, constants, **options, **old)
    with pytest.raises(InputError, match=message):
        import_network(path, {}, "zero")


PAD = ints(0, 0, 1, 1, 0, 0, 1, 1)

MARGINS = {
    "none": ([("Conv", "xw", "y", SAME)], {"w": W}, "zero", 0),
    "another rule": ([("Conv", "xw", "y", SAME)], {"w": W}, "clamp", 1),
    "smaller": ([("Conv", "xw", "y")], {"w": W}, "zero", 1),
    "twice": ([("Conv", "xw", "a", SAME), ("Relu", "a", "b"), ("Conv", "bw", "y", SAME)], {"w": W}, "zero",
        1),
    "moved": ([("Slice", "xsea", "b"), ("Pad", "bp", "y", {"mode": "reflect"})],
        {"s": ints(1, 1), "e": ints(2**40, 2**40), "a": ints(2, 3), "p": ints(0, 0, 1, 1, 0, 0, 0, 0)},
        "zero", 1),
    "cropped again": ([("Relu", "x", "b"), ("Conv", "bw", "c", SAME), ("Slice", "csea", "y")],
        {"w": W, "s": ints(1, 1), "e": ints(-1, -1), "a": ints(2, 3)}, "clamp", 1),
    "padded further": ([("Conv", "xw", "b", SAME), ("Conv", "bw", "c", SAME), ("Pad", "cp", "d"),
        ("Conv", "dw", "y")], {"w": W, "p": PAD}, "zero", 2),
    "one side": ([("Pad", "xp", "b"), ("Conv", "bw", "c"), ("Relu", "c", "d"), ("Pad", "dp", "e"),
        ("Conv", "ew", "y")], {"w": W, "p": ints(0, 0, 2, 2, 0, 0, 0, 0)}, "clamp", 4),
}  # fmt: skip
"""Graphs, a border rule, and in how many pixels from the edge the model is another function."""


@pytest.mark.parametrize("case", MARGINS)
def test_a_margin_is_as_wide_as_it_must_be(case, compared, tmp_path):
    nodes, constants, border, margin = MARGINS[case]
    content = graph(tmp_path / "graph.onnx", nodes, constants).read_bytes()
    assert import_network(tmp_path / "graph.onnx", {}, border).margin == margin
    assert compared(content, tmp_path, border) == "equal"
    if margin:
        with pytest.raises(AssertionError, match="apart where"):
            compared(content, tmp_path, border, inward=-1)


def doubled(count):
    """Return nodes that double channels so often."""
    return [
        ("Concat", (["x"] if at == 0 else [f"t{at - 1}"]) * 2, f"t{at}", {"axis": 1}) for at in range(count)
    ]


ONE = np.float32(np.ones((1, 1, 60, 60)))

LARGE = {
    "channels": (doubled(60), {}, "node n.* .Concat. '.* numbers': at most"),
    "kernels": ([("Conv", "xw", "a"), ("Conv", "aw", "b")], {"w": ONE}, "numbers': at most"),
    "a product": ([("MatMul", "xa", "b"), ("Relu", "b", "c"), ("MatMul", "cd", "e")],
        {"a": np.float32(np.ones((5, 20000))), "d": np.float32(np.ones((20000, 5)))},
        r"\(Relu\) '.* numbers': at most"),
    "groups": ([("Cast", "k", "w", {"to": 1}), ("Conv", "xw", "a", {"group": 1000})],
        {"k": np.ones((1000, 1, 30, 30), np.int8)}, "numbers': at most"),
    "places": ([node for at in range(4) for node in (("Conv", [f"r{at}" if at else "x", "w"], f"c{at}"),
        ("Relu", [f"c{at}"], f"r{at + 1}"))], {"w": ONE[:, :, :16, :16]},
        "positions that a pixel depends on .*: at most 524288 in all layers"),
    "axes": ([("Unsqueeze", "xa", "b")], {"a": np.arange(10**5)}, "axes of int64, .*: at most 16 integers"),
    "layers": ([("MatMul", [f"t{at - 1}" if at else "x", "w"], f"t{at}") for at in range(900)],
        {"w": np.float32(np.ones((400, 400)))}, "multiplications': at most"),
}  # fmt: skip
"""Small files that would take gigabytes or minutes: nodes, constants, and the message."""


@pytest.mark.parametrize("case", LARGE)
def test_small_files_take_little(case, tmp_path):
    """A file of less than a megabyte takes less than 300 MiB."""
    nodes, constants, message = LARGE[case]
    channels = {"groups": 1000, "layers": 400, "a product": 5}.get(case, 1)
    shape = ("n", channels) if "MatMul" in nodes[0] else (1, channels, "h", "w")
    last = ("Identity", [nodes[-1][2]], "y")
    path = graph(tmp_path / "graph.onnx", [*nodes, last], constants, shape)
    assert path.stat().st_size < 2**20
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=message):
            import_network(path, {}, "zero")
        assert tracemalloc.get_traced_memory()[1] <= 300 * 2**20
    finally:
        tracemalloc.stop()


def test_ranges_follow_types(tmp_path):
    nodes = [("Cast", "x", "a", {"to": 1}), ("Relu", "a", "y")]
    path = graph(tmp_path / "graph.onnx", nodes, dtype="uint8")
    (source,) = import_network(path, {}).model.siren.sources
    assert (source.low, source.high) == (0.0, 255.0)
    with pytest.raises(InputError, match=r"range \(0.0, 256.0\): inside \[0, 255\], as its type is uint8"):
        import_network(path, {"x": (0.0, 256.0)})
    graph(path, nodes, dtype="float16")
    with pytest.raises(InputError, match=r"inside \[-65504, 65504\], as its type is float16"):
        import_network(path, {"": (0.0, 1e5)})


def test_random_graphs(compared, tmp_path):
    """No graph is imported as another function; the runtime runs most of those that are imported."""
    from graphs import graph as graph_of

    outcomes = Counter()
    for number in range(400):
        content = graph_of(Random(f"{SEED}/{number}"))
        try:
            outcomes[compared(content, tmp_path)] += 1
        except InputError:
            outcomes["rejected"] += 1
    assert outcomes["equal"] > 100
    assert outcomes["rejected"] > 100
    assert outcomes["not run"] < 40


def test_sizes_of_inputs_agree(tmp_path):
    from onnx import helper

    path = tmp_path / "graph.onnx"
    inputs = [helper.make_tensor_value_info(name, 1, [1, 2, size, 9]) for name, size in (("a", 1), ("b", 9))]
    output = helper.make_tensor_value_info("y", 1, [None] * 4)
    add = helper.make_node("Add", ["a", "b"], ["y"])
    whole = helper.make_graph([add], "graph", inputs, [output])
    model = helper.make_model(whole, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    with pytest.raises(InputError, match="input b: size of axis H 9: 1 as of the inputs before"):
        import_network(path, {})
