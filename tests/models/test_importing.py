"""Networks in ONNX's form as models: the same function, exact at the border, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
from packages import needed
from strangers import STRANGERS, graph

from wamnet.compiler.core import ir
from wamnet.compiler.core.lower import lower
from wamnet.compiler.proof.checker import check
from wamnet.compiler.variants import plan_model
from wamnet.models.importing.network import import_network
from wamnet.models.model_file import load_model, save_model
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network.imported import Step, evaluate

pytestmark = pytest.mark.needs("packages")

U = 2.0**-53
"""float64's rounding."""


@pytest.fixture(autouse=True)
def onnx():
    """Give the package, or skip."""
    return needed("onnx")


def imported(stranger):
    return import_network(stranger.path, {"": (stranger.low, stranger.high)}, stranger.border)


def run(path, **given):
    """Return what ONNX's own reference computes of arrays, in float64: it knows no Conv but of one type."""
    import onnx
    from onnx import numpy_helper
    from onnx.reference import ReferenceEvaluator

    model = onnx.load(path)
    for tensor in [*model.graph.initializer, *(a.t for n in model.graph.node for a in n.attribute if a.t)]:
        if tensor.data_type == onnx.TensorProto.FLOAT:
            array = numpy_helper.to_array(tensor).astype(np.float64)
            tensor.CopyFrom(numpy_helper.from_array(array, tensor.name))
    found = ReferenceEvaluator(model).run(None, {name: x.astype(np.float64) for name, x in given.items()})
    return found[0]


def within(network):
    """Return how far two orders of float64 sums may be apart.

    A layer of n inputs adds n + 1 terms and rounds each product: at most (n + 2) U of the sum of all
    magnitudes, in either order, and later layers amplify by the largest row sum of |W|. Numbers are at most
    1 before the first layer here, and sines' scales multiply.
    """
    error, size = 0.0, 1.0
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        grown = float(np.abs(weight).astype(np.float64).sum(axis=1).max())
        total = grown * size + float(np.abs(bias).max())
        error = grown * error + 2 * (weight.shape[1] + 2) * U * total
        step = network.steps[layer] if layer < len(network.steps) else None
        is_sine = step is not None and step.kind == "sine"
        scale = abs(step.numbers[0]) if is_sine else 1.0
        error, size = scale * error + 4 * U * scale * total, 1.0 if is_sine else total
    return error


@pytest.mark.parametrize("stranger", STRANGERS, ids=lambda each: each.name)
def test_a_network_is_the_same_function(stranger):
    found, image = imported(stranger), stranger.image()
    network = found.model.siren
    ours = evaluate(network, found.model.window, {"x": image})
    theirs = stranger.picture(run(stranger.path, x=stranger.tensor(image)))
    error = np.abs(stranger.inside(ours - theirs)).max()
    assert error <= within(network)
    assert (found.moved, found.rounded) == (bool(stranger.margin), 0)
    if stranger.margin:
        assert found.margin == stranger.margin
        # At the border it is another function: what is read there was padded after the first layer.
        assert np.abs(ours - theirs).max() > 1e-3


@pytest.mark.parametrize("stranger", STRANGERS, ids=lambda each: each.name)
def test_a_file_holds_it(stranger, tmp_path):
    model = imported(stranger).model
    save_model(tmp_path / "a.safetensors", model)
    again = load_model(tmp_path / "a.safetensors")
    save_model(tmp_path / "b.safetensors", again)
    assert (tmp_path / "a.safetensors").read_bytes() == (tmp_path / "b.safetensors").read_bytes()
    assert again.siren.steps == model.siren.steps
    assert again.siren.sources == model.siren.sources
    assert ir.digest(lower(again)) == ir.digest(lower(model))


@pytest.mark.parametrize("stranger", STRANGERS, ids=lambda each: each.name)
def test_it_has_a_certificate(stranger, tmp_path):
    from wamnet.compiler.artifact import CERTIFICATE_NAME, write
    from wamnet.compiler.compile import compile_plan

    plan = plan_model(imported(stranger).model, "opencl")
    write(compile_plan(plan), tmp_path / "kernel")
    held = check(tmp_path / "kernel" / CERTIFICATE_NAME)
    assert held["bound"]["output"] == list(plan.bound.output)


def test_an_export_comes_back_to_the_bit(tmp_path):
    from wamnet.cli.common.inputs import model_path
    from wamnet.kernels.export.onnx_export import graph as exported

    model = load_model(model_path(Path("minicubes")))
    path = tmp_path / "minicubes.onnx"
    path.write_bytes(exported(model))
    found = import_network(path, {"": (-1.0, 1.0), "color": (0.0, 1.0)}).model
    assert found.window == model.window
    assert found.features == model.features
    omegas = [model.siren.omega_0_first, *[model.siren.omega_0_hidden] * (len(found.siren.steps) - 1)]
    assert found.siren.steps == tuple(Step("sine", (omega,)) for omega in omegas)
    for name in ("weights", "biases"):
        for ours, theirs in zip(getattr(found.siren, name), getattr(model.siren, name), strict=True):
            assert np.array_equal(ours, theirs.astype(np.float32))


W = np.random.default_rng(3).normal(size=(4, 2, 3, 3)).astype(np.float32)
V = np.random.default_rng(4).normal(size=(2, 4, 1, 1)).astype(np.float32)
M = np.random.default_rng(5).normal(size=(2, 3)).astype(np.float32)
PADS = np.array([0, 0, 1, 1, 0, 0, 1, 1])

CASES = {
    "zeros": ([("Conv", "xw", "y", {"pads": [1, 1, 1, 1]})], {"w": W[:3]}),
    "nearest": ([("Pad", "xp", "a", {"mode": "edge"}), ("Conv", "aw", "y")], {"w": W[:3], "p": PADS}),
    "upper": ([("Conv", "xw", "y", {"auto_pad": "SAME_UPPER"})], {"w": W[:3, :, :2, :2]}),
    "lower": ([("Conv", "xw", "y", {"auto_pad": "SAME_LOWER"})], {"w": W[:3, :, :2, :2]}),
    "dilated": ([("Conv", "xw", "y", {"pads": [2, 2, 2, 2], "dilations": [2, 2]})], {"w": W[:3]}),
    "groups": ([("Conv", "xw", "y", {"pads": [1, 1, 1, 1], "group": 2})], {"w": W[:2, :1]}),
    "leaky": ([("Conv", "xw", "a", {"pads": [1] * 4}), ("LeakyRelu", "a", "b", {"alpha": 0.25}),
        ("Conv", "bv", "y")], {"w": W, "v": V}),
    "hidden clip": ([("Conv", "xw", "a", {"pads": [1] * 4}), ("Clip", "alh", "b"), ("Conv", "bv", "y")],
        {"w": W, "v": V, "l": -0.5, "h": 0.75}),
    "two linear": ([("Conv", "xw", "a", {"pads": [1] * 4}), ("Mul", "ma", "b"), ("Conv", "bv", "c"),
        ("Sub", "dc", "y")], {"w": W, "v": V, "m": np.float32([[[1]], [[2]], [[3]], [[0.3]]]), "d": 0.7}),
    "cropped skip": ([("Pad", "xp", "a"), ("Conv", "aw", "b"), ("Relu", "b", "c"), ("Conv", "cv", "d"),
        ("Slice", "astq", "e"), ("Add", "de", "y")],
        {"w": W, "v": V, "p": PADS, "s": np.array([1, 1]), "t": np.array([-1, -1]), "q": np.array([2, 3])}),
    "negative skip": ([("Conv", "xv", "a"), ("Relu", "a", "b"), ("Conv", "bu", "c"), ("Relu", "c", "d"),
        ("Sub", "xd", "e"), ("Div", "ek", "f"), ("Neg", "f", "y")],
        {"v": V.reshape(4, 2, 1, 1), "u": V, "k": 3.0}),
    "last sine": ([("Conv", "xv", "a"), ("Sin", "a", "y")], {"v": V.reshape(4, 2, 1, 1)}),
    "normalised": ([("Conv", "xv", "a"), ("BatchNormalization", "agbcd", "e"), ("Relu", "e", "y")],
        {"v": V.reshape(4, 2, 1, 1), **{n: np.float32([1, 2, 0.5, 3]) for n in "gbcd"}}),
    "axes": ([("Transpose", "x", "a", {"perm": [0, 2, 3, 1]}), ("MatMul", "am", "b"), ("Relu", "b", "c"),
        ("Transpose", "c", "d", {"perm": [0, 3, 1, 2]}), ("Slice", "dstq", "e"),
        ("Concat", "ex", "f", {"axis": 1}), ("Clip", "fl", "y")],
        {"m": M, "s": np.array([1]), "t": np.array([3]), "q": np.array([1]), "l": 0.25}),
}  # fmt: skip
"""Graphs of two channels: their nodes, whose inputs are letters, and their constants."""


@pytest.mark.parametrize("case", CASES)
def test_operators(case, tmp_path):
    """Values in [-1, 1]: what skips past a rectifier may be negative."""
    nodes, constants = CASES[case]
    path = graph(tmp_path / "graph.onnx", nodes, constants)
    found = import_network(path, {"": (-1.0, 1.0)})
    image = np.random.default_rng(7).uniform(-1.0, 1.0, (7, 6, 2))
    ours = evaluate(found.model.siren, found.model.window, {"x": image})
    theirs = run(path, x=image.transpose(2, 0, 1)[None])[0].transpose(1, 2, 0)
    # Weights that float32 rounds are off by 2^-24 each, as many times as there are layers.
    network = found.model.siren
    rounded = 2.0**-24 / U / 4 if found.rounded else 1.0
    assert np.abs(ours - theirs).max() <= within(network) * rounded
    assert not found.moved
    assert (found.rounded > 0) == (case in ("two linear", "negative skip", "normalised"))
    plan = plan_model(found.model, "opencl")
    assert plan.bound.output is not None


def test_without_margins_a_border_is_chosen(tmp_path):
    path = graph(tmp_path / "graph.onnx", [("Conv", "xw", "y")], {"w": W[:3]})
    with pytest.raises(
        InputError, match=r"sizes of output and input image '-2 rows and -2 columns': .* --border"
    ):
        import_network(path, {})
    found = import_network(path, {}, "clamp")
    image = np.random.default_rng(7).uniform(0.0, 1.0, (7, 6, 2))
    ours = evaluate(found.model.siren, found.model.window, {"x": image})
    theirs = run(path, x=image.transpose(2, 0, 1)[None])[0].transpose(1, 2, 0)
    assert np.abs(ours[1:-1, 1:-1] - theirs).max() <= within(found.model.siren)


CONV, RELU = ("Conv", "xw", "a", {"pads": [1] * 4}), ("Relu", "a", "b")

REFUSED = {
    "unknown": ([("Sigmoid", "x", "y")], {}, r"node n0 \(Sigmoid\) 'Sigmoid': supported are Add, .* \(exp"),
    "stride": ([("Conv", "xw", "y", {"strides": [2, 2]})], {"w": W}, r"node n0 \(Conv\) '.*: stride 1 \(use"),
    "padded twice": ([CONV, RELU, ("Conv", "bv", "y", {"pads": [1] * 4})],
        {"w": W, "v": np.float32(np.ones((2, 4, 3, 3)))},
        r"node n2 \(Conv\) 'margins 1, 1, 1, 1, constant': .* --border zero or clamp"),
    "reflect": ([("Pad", "xp", "y", {"mode": "reflect"})], {"p": PADS}, r"n0 \(Pad\) 'margins .*, reflect"),
    "product": ([("Mul", "xx", "y")], {}, r"n0 \(Mul\) 'two values': one of the factors must be constant"),
    "two activations": ([("Sin", "x", "a"), ("Relu", "x", "b"), ("Add", "ab", "y")], {},
        r"node n1 \(Relu\) .*: node n0 \(Sin\) is as deep and is another activation"),
    "past a sine": ([("Sin", "x", "a"), ("Add", "ax", "y")], {},
        r"node n0 \(Sin\) 'sine': .* skips past it, .* \(use Relu"),
    "flat": ([("Flatten", "x", "y")], {}, r"n0 \(Flatten\) 'axes 1, C, H, W to 1, CHW': it mixes pixels"),
    "reshaped": ([("Reshape", "xs", "y")], {"s": np.array([-1, 3])},
        r"n0 \(Reshape\) 'axes 1, C, H, W to -1, 3': it splits or swaps axes, of sizes that the inputs do"),
    "no matrix": ([("MatMul", "xm", "y")], {"m": M}, r"n0 \(MatMul\) 'axes 1, C, H, W, 2 channels"),
    "a column": ([("Add", "xc", "y")], {"c": np.ones((2,))}, r"\(Add\) 'a constant of shape \(2,\) beside"),
    "open clip": ([("Clip", ["x", "", "h"], "a"), ("Conv", "aw", "y", {"pads": [0] * 4})],
        {"w": V.reshape(4, 2, 1, 1), "h": 1.0},
        r"node n0 \(Clip\) \(-inf, 1.0\): only the last Clip may lack its lower end"),
    "wide": ([CONV], {"w": np.float32(np.ones((5, 2, 3, 3)))}, r"outputs of the last layer 5: at most 4"),
    "large": ([("Conv", "xw", "a"), RELU, ("Conv", "bv", "y")],
        {"w": np.float32(np.ones((90, 2, 17, 17))), "v": np.float32(np.ones((1, 90, 17, 17)))},
        r"neurons of a layer over its window 26010: at most 8192"),
}  # fmt: skip
"""Graphs, and what is said of them."""


@pytest.mark.parametrize("case", REFUSED)
def test_what_no_kernel_can_be_made_of_is_refused(case, tmp_path):
    nodes, constants, told = REFUSED[case]
    nodes = [
        (*node[:2], "y" if number == len(nodes) - 1 else node[2], *node[3:])
        for number, node in enumerate(nodes)
    ]
    path = graph(tmp_path / "graph.onnx", nodes, constants)
    border = "clamp" if case == "large" else ""
    with pytest.raises(InputError, match=told):
        import_network(path, {}, border)


def test_a_damaged_file_is_refused_in_one_line(tmp_path, onnx):
    path = graph(tmp_path / "graph.onnx", [("Relu", "x", "y")])
    content = path.read_bytes()
    for cut in range(0, len(content), 3):
        path.write_bytes(content[:cut])
        with pytest.raises(
            InputError, match=r"network '.*graph.onnx': cannot be read as a graph|operators is"
        ):
            import_network(path, {})
    model = onnx.load_from_string(content)
    model.graph.initializer.add(name="w", data_type=1, dims=[1], data_location=1)
    path.write_bytes(model.SerializeToString())
    with pytest.raises(InputError, match="tensor 'w': its numbers are in another file, which is not read"):
        import_network(path, {})


def test_graphs_of_other_forms_are_refused(tmp_path):
    path, node = tmp_path / "graph.onnx", ("Relu", "x", "y")
    graph(path, [node], opset=6)
    with pytest.raises(InputError, match="version of the operators 6: this reader knows 7 to 22"):
        import_network(path, {})
    graph(path, [node, ("Sin", "x", "z")], outputs=("y", "z"))
    with pytest.raises(InputError, match="outputs 'y, z': exactly one"):
        import_network(path, {})
    graph(path, [node], shape=(1, "c", "h", "w"))
    with pytest.raises(InputError, match="input x: channels 'any': a size from 1 to 1024"):
        import_network(path, {})
    graph(path, [node], shape=(1, 1, 2, 3, 4))
    with pytest.raises(InputError, match="input x: axes 5: rows of values"):
        import_network(path, {})
    graph(path, [node])
    with pytest.raises(InputError, match=r"--range 'z': the network has no such input \(choose one of x"):
        import_network(path, {"z": (0.0, 1.0)})
    with pytest.raises(InputError, match=r"--border 'odd': unknown \(choose one of"):
        import_network(path, {}, "odd")
    graph(path, [("ConstantOfShape", "s", "y")], {"s": np.array([10**6])})
    with pytest.raises(InputError, match=r"n0 \(ConstantOfShape\) 1000000: constants of at most 4096 el"):
        import_network(path, {})
    graph(path, [("Relu", "w", "y")], {"w": 1.0})
    with pytest.raises(InputError, match=r"n0 \(Relu\) 'w': this operator on constants is not supp"):
        import_network(path, {})


@pytest.mark.parametrize(
    ("nodes", "constants", "told"),
    [
        ([("Add", "pq", f"c{at}") for at in range(900)],
            {"p": np.float32(np.ones((2000, 1))), "q": np.float32(np.ones((1, 2000)))},
            ".* 4000000: constants of at most 4096 elements"),
        ([("Transpose", "w" if at == 0 else [f"t{at - 1}"], f"t{at}") for at in range(900)],
            {"w": np.float32(np.ones((400, 400)))}, "at most 4194304 elements of all computed constants"),
        ([("Concat", ["x"] * 10**5, "a", {"axis": 1})], {}, "inputs of nodes 100001: at most 16384"),
        ([("Div", "pq", "c")], {"p": np.array([-3]), "q": np.array([2])}, "only integers of at least 0"),
    ],
)  # fmt: skip
def test_constants_are_limited(nodes, constants, told, tmp_path):
    path = graph(tmp_path / "graph.onnx", [*nodes, ("Relu", "x", "y")], constants)
    with pytest.raises(InputError, match=told):
        import_network(path, {})


def test_names_fit_kernels(tmp_path):
    path = tmp_path / "graph.onnx"
    nodes = [("Add", ["1.in", "1:in"], "y")]
    graph(path, nodes, inputs=("1.in", "1:in"))
    found = import_network(path, {"1:in": (-2.0, 3.0)}).model.siren.sources
    assert [(each.name, each.low, each.high) for each in found] == [
        ("x1_in", 0.0, 1.0),
        ("x1_in_1", -2.0, 3.0),
    ]
