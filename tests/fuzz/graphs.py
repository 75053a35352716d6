"""Random graphs in ONNX's form, for a comparison with ONNX Runtime [beside.py].

1. A graph is a function of a `random.Random`: inputs of several layouts and types, of fixed or any size
   [`graph`].
2. Nodes follow at random [`STEPS`], mostly such as the axes of their input allow. Sizes coincide now and
   then, and attributes are wrong or change what the operator does [`ODD`].
"""

from collections.abc import Callable, Mapping
from random import Random
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

Array = NDArray[Any]

INT_MAX = 2**31 - 1


class Value:
    """A tensor: its name, its concrete shape, and what its axes are likely to be."""

    def __init__(self, name: str, shape: list[int], labels: list[str]) -> None:
        self.name, self.shape, self.labels = name, shape, labels

    @property
    def channels(self) -> int:
        """Return the likely number of channels."""
        return self.shape[self.labels.index("C")] if "C" in self.labels else 1


class Maker:
    """A graph in the making."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.numbers = np.random.default_rng(random.getrandbits(32))
        self.opset = random.choice([7, 9, 10, 11, 12, 13, 14, 15, 17, 18, 19, 20, 21, 22])
        self.nodes: list[Any] = []
        self.tensors: list[Any] = []
        self.listed: list[Any] = []
        self.inputs: list[Any] = []
        self.dtype = np.dtype("float32")

    def maybe(self, share: float) -> bool:
        """Return whether something that is so likely happens."""
        return self.random.random() < share

    def constant(self, array: Any) -> str:
        """Return the name of a constant: an initializer, one that is listed as an input, or a node."""
        name, array = f"c{len(self.tensors) + len(self.nodes)}", np.asarray(array)
        dtype = self.dtype if array.dtype.kind == "f" else array.dtype
        if array.dtype.kind == "f" and dtype.kind != "f":
            # A division of integers by 0 ends the process.
            array = np.where(np.abs(array) < 1.0, 2.0, array)
        with np.errstate(over="ignore", invalid="ignore"):
            array = array.astype(dtype)
        if self.maybe(0.1):
            tensor = numpy_helper.from_array(array, name)
            self.nodes.append(helper.make_node("Constant", [], [name], value=tensor))
            return name
        self.tensors.append(numpy_helper.from_array(array, name))
        if self.maybe(0.1):
            kind = helper.np_dtype_to_tensor_dtype(array.dtype)
            self.listed.append(helper.make_tensor_value_info(name, kind, array.shape))
        return name

    def uniform(self, *shape: int, low: float = -1.0) -> Array:
        """Return random numbers, of which few are 0."""
        scale = self.random.choice([1.0, 1.0, 0.5, 0.0, 3.0])
        return np.asarray(self.numbers.uniform(low, 1.0, shape) * scale)

    def add(
        self, op: str, inputs: list[str], shape: list[int], labels: list[str], **attributes: Any
    ) -> Value:
        """Add a node; now and then with an attribute that it may not have."""
        name = f"t{len(self.nodes)}"
        if self.maybe(0.03):
            attributes |= self.random.choice(ODD.get(op, [{}]))
        self.nodes.append(helper.make_node(op, inputs, [name], **attributes))
        return Value(name, shape, labels)

    def option(self, since: int, inputs: list[str], **options: Any) -> dict[str, Any]:
        """Return options as attributes before a version, or append them as constant inputs."""
        if self.opset < since:
            return options
        inputs += [self.constant(value) if value is not None else "" for value in options.values()]
        return {}


ODD: Mapping[str, list[dict[str, Any]]] = {
    "Conv": [*({"dilations": [2]}, {"pads": [1, 1]}, {"auto_pad": "SAME"}, {"strides": [2, 1]}, {"group": 0}),
        *({"auto_pad": "SAME_UPPER", "pads": [1, 1, 1, 1]}, {"pads": [-1, 0, 0, 0]},
        {"kernel_shape": [2, 2]})],
    "Gemm": [{"transA": 1}, {"transB": 2}, {"alpha": float("inf")}, {"beta": float("nan")}],
    "LeakyRelu": [{"alpha": -0.5}, {"alpha": 2.0}],
    "BatchNormalization": [{"epsilon": -1.0}, {"momentum": 2.0}],
    "Cast": [{"to": TensorProto.FLOAT16}, {"to": TensorProto.INT32}],
    "Concat": [{"axis": 9}],
    "Flatten": [{"axis": 9}],
}  # fmt: skip
"""Attributes that are wrong, or change what the operator does."""

LAYOUTS = ("NCHW", "NCHW", "NCHW", "NCHW", "NHWC", "NWHC", "HWC", "PC", "PC", "C")
TYPES = ("float32",) * 14 + ("float16", "float64", "float64", "uint8", "int8", "int32", "int64")


def graph(random: Random) -> bytes:
    """Return a random graph as a file."""
    make = Maker(random)
    layout, dtype = random.choice(LAYOUTS), np.dtype(random.choice(TYPES))
    make.dtype = dtype if dtype.kind == "f" else np.dtype("float32")
    sizes = {"N": random.choice([1] * 9 + [2]), "C": random.randint(1, 4), "P": random.choice([1, 5, 30])}
    sizes |= {"H": random.choice([9, 9, 9, 9, 1]), "W": random.choice([9, 11])}
    if make.maybe(0.15):
        # Axes that are taken for each other fit.
        sizes |= dict.fromkeys("HWPC", random.choice([3, 4]))
    fixed = make.maybe(0.4) or sizes["N"] > 1 or sizes["H"] == 1
    values = []
    for number in range(random.choice([1, 1, 1, 2])):
        shape = [sizes[label] for label in layout]
        shown = [size if fixed or label == "C" else label for label, size in zip(layout, shape, strict=True)]
        kind = helper.np_dtype_to_tensor_dtype(dtype)
        make.inputs.append(helper.make_tensor_value_info(f"x{number}", kind, shown))
        values.append(Value(f"x{number}", shape, list(layout)))
        if dtype.kind != "f" and make.maybe(0.8):
            values[-1] = make.add("Cast", [values[-1].name], shape, list(layout), to=TensorProto.FLOAT)
        elif dtype.kind != "f":
            make.dtype = dtype
    for _ in range(random.randint(1, 8)):
        x = values[-1] if make.maybe(0.8) else random.choice(values)
        following = random.choice(STEPS)(make, x, values)
        if following is not None:
            values.append(following)
            if min(following.shape, default=0) < 1:
                break
    last = values[-1]
    if last.channels > 4 or make.maybe(0.2):
        last = _reduced(make, last) or last
    if not make.nodes:
        last = make.add("Identity", [last.name], last.shape, last.labels)
    kind = helper.np_dtype_to_tensor_dtype(make.dtype)
    output = helper.make_tensor_value_info(last.name, kind, [None] * len(last.shape))
    whole = helper.make_graph(make.nodes, "graph", [*make.inputs, *make.listed], [output], make.tensors)
    opsets = [helper.make_opsetid("", make.opset)]
    content: bytes = helper.make_model(whole, opset_imports=opsets, ir_version=8).SerializeToString()
    return content


Step = Callable[[Maker, Value, list[Value]], "Value | None"]


def _axis(make: Maker, x: Value) -> int:
    """Return the channels' axis; now and then another."""
    if "C" in x.labels and make.maybe(0.97):
        return x.labels.index("C")
    return make.random.randrange(len(x.shape))


def _conv(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    if len(x.shape) != 4 or (x.labels[1] != "C" and make.maybe(0.95)):
        return None
    channels, kernel = x.shape[1], [make.random.choice([1, 1, 2, 3, 3, 5]) for _ in "hw"]
    dilation = [make.random.choice([1, 1, 1, 2]) for _ in "hw"]
    reach = [(k - 1) * d for k, d in zip(kernel, dilation, strict=True)]
    group = make.random.choice([1, 1, 1, channels])
    outputs = group * make.random.randint(1, 3)
    attributes: dict[str, Any] = {"dilations": dilation} if max(dilation) > 1 or make.maybe(0.3) else {}
    attributes |= {"group": group} if group > 1 else {}
    attributes |= {"kernel_shape": kernel} if make.maybe(0.3) else {}
    way = make.random.choice(["none", "same", "same", "auto", "auto", "any", "VALID"])
    pads = [0] * 4
    if way == "same":
        pads = [r // 2 for r in reach] + [r - r // 2 for r in reach]
    elif way == "any":
        pads = [make.random.randint(0, 2) for _ in range(4)]
    if way in ("same", "any"):
        attributes["pads"] = pads
    elif way != "none":
        attributes["auto_pad"] = way if way == "VALID" else make.random.choice(["SAME_UPPER", "SAME_LOWER"])
    inputs = [x.name, make.constant(make.uniform(outputs, channels // group, *kernel) / channels)]
    if make.maybe(0.5):
        inputs.append(make.constant(make.uniform(outputs)))
    size = [n if way == "auto" else n + pads[i] + pads[i + 2] - reach[i] for i, n in enumerate(x.shape[2:])]
    return make.add("Conv", inputs, [x.shape[0], outputs, *size], x.labels, **attributes)


def _matrix(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    if not x.shape or (x.labels[-1] != "C" and make.maybe(0.9)):
        return None
    channels, outputs = x.shape[-1], make.random.randint(1, 5)
    weight = make.uniform(channels, outputs) / channels
    shape, labels = [*x.shape[:-1], outputs], [*x.labels[:-1], "C"]
    if len(x.shape) != 2 or make.maybe(0.3):
        inputs = [x.name, make.constant(weight)]
        return make.add("MatMul", inputs, shape, labels)
    turned = make.maybe(0.5)
    inputs = [x.name, make.constant(weight.T if turned else weight)]
    attributes: dict[str, Any] = {"transB": 1} if turned else {}
    if make.maybe(0.3):
        attributes |= {"alpha": make.random.uniform(-2, 2), "beta": make.random.uniform(-2, 2)}
    if make.opset < 11 or make.maybe(0.7):
        shapes = [(outputs,), (1, outputs), (1,), (), (x.shape[0], 1), tuple(shape)]
        inputs.append(make.constant(make.uniform(*make.random.choice(shapes))))
    return make.add("Gemm", inputs, shape, labels, **attributes)


def _reduced(make: Maker, x: Value) -> Value | None:
    """Return few channels of a value."""
    if x.labels[1:2] == ["C"] and len(x.shape) == 4:
        weight = make.constant(make.uniform(make.random.randint(1, 4), x.shape[1], 1, 1))
        return make.add("Conv", [x.name, weight], [x.shape[0], 4, *x.shape[2:]], x.labels)
    return _sliced(make, x, x.labels.index("C"), 0, 3) if "C" in x.labels else None


def _with_constant(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    op = make.random.choice(["Add", "Sub", "Mul", "Div"])
    shape = [1] * len(x.shape)
    if shape and make.maybe(0.7):
        axis = _axis(make, x)
        shape[axis] = x.shape[axis]
    if make.maybe(0.5):
        while shape and shape[0] == 1:
            shape = shape[1:]
    elif make.maybe(0.1):
        shape = [1, *shape]
    array = make.uniform(*shape)
    if op == "Div":
        array = np.where(np.abs(array) < 0.1, 2.0, array)
    names = [x.name, make.constant(array)]
    if op != "Div" and make.maybe(0.3):
        names = names[::-1]
    more = max(len(shape) - len(x.shape), 0)
    return make.add(op, names, [1] * more + x.shape, [""] * more + x.labels)


def _two(make: Maker, x: Value, values: list[Value]) -> Value | None:
    alike = [other for other in values if other.shape == x.shape]
    if not alike:
        return None
    other = make.random.choice(alike)
    op = make.random.choice(["Add", "Sub", "Add", "Sub", "Mul"])
    return make.add(op, [x.name, other.name], x.shape, x.labels)


def _concat(make: Maker, x: Value, values: list[Value]) -> Value | None:
    if not x.shape:
        return None
    axis = _axis(make, x)
    alike = [v for v in values if len(v.shape) == len(x.shape) and _but(v.shape, axis) == _but(x.shape, axis)]
    parts = [x, *make.random.choices(alike, k=make.random.randint(0, 2))]
    shape = list(x.shape)
    shape[axis] = sum(part.shape[axis] for part in parts)
    axis -= len(shape) if make.opset >= 11 and make.maybe(0.3) else 0
    return make.add("Concat", [part.name for part in parts], shape, x.labels, axis=axis)


def _but(items: list[int], axis: int) -> list[int]:
    return items[:axis] + items[axis + 1 :]


def _activation(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    op = make.random.choice(["Relu", "Relu", "Relu", "Sin", "LeakyRelu", "Clip"])
    inputs, attributes = [x.name], {}
    if op == "LeakyRelu" and make.maybe(0.7):
        attributes = {"alpha": make.random.choice([0.25, 0.1])}
    if op == "Clip":
        ends = {"min": make.random.choice([0.0, -0.5, 0.1]), "max": make.random.choice([1.0, 0.75, 1e9])}
        if make.maybe(0.02):
            ends["max"] = np.ones(2)
        attributes = make.option(11, inputs, **ends)
        if attributes and np.ndim(attributes["max"]):
            return None
    return make.add(op, inputs, x.shape, x.labels, **attributes)


def _normalised(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    if len(x.shape) < 2 or (x.labels[1] != "C" and make.maybe(0.5)):
        return None
    n = x.shape[1]
    arrays = [make.uniform(n), make.uniform(n), make.uniform(n), make.numbers.uniform(0.2, 2.0, n)]
    inputs = [x.name, *map(make.constant, arrays)]
    attributes: dict[str, Any] = {"epsilon": 0.01} if make.maybe(0.3) else {}
    if make.opset >= 14 and make.maybe(0.3):
        attributes["training_mode"] = make.random.choice([0, 1])
    if make.opset < 9 and make.maybe(0.2):
        attributes["spatial"] = make.random.choice([0, 1])
    result = make.add("BatchNormalization", inputs, x.shape, x.labels, **attributes)
    if (attributes.get("training_mode") and make.maybe(0.5)) or (make.opset < 14 and make.maybe(0.05)):
        make.nodes[-1].output.extend([f"{result.name}m", f"{result.name}v"])
    return result


def _dropout(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    inputs = [x.name]
    attributes: dict[str, Any] = {}
    if make.opset < 12:
        attributes = {"ratio": 0.5}
    elif make.maybe(0.5):
        inputs.append(make.constant(0.5))
        if make.maybe(0.5):
            inputs.append(make.constant(np.array(make.maybe(0.3))))
    result = make.add("Dropout", inputs, x.shape, x.labels, **attributes)
    if make.maybe(0.2):
        make.nodes[-1].output.append(f"{result.name}m")
    return result


def _transposed(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    order = list(range(len(x.shape)))
    if make.maybe(0.7) and len(order) == 4:
        order = [0, 2, 3, 1] if x.labels[1] == "C" else [0, 3, 1, 2]
    else:
        make.random.shuffle(order)
    attributes = {} if order == order[::-1] and make.maybe(0.5) else {"perm": order}
    return make.add(
        "Transpose", [x.name], [x.shape[i] for i in order], [x.labels[i] for i in order], **attributes
    )


def _reshaped(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    groups: list[list[int]] = []
    for axis, label in enumerate(x.labels):
        merge = groups and label != "C" and x.labels[groups[-1][-1]] != "C" and make.maybe(0.6)
        groups = [*groups[:-1], [*groups[-1], axis]] if merge else [*groups, [axis]]
    shape = [int(np.prod([x.shape[axis] for axis in group])) for group in groups]
    labels = ["".join(x.labels[axis] for axis in group) for group in groups]
    split = next((i for i, label in enumerate(labels) if len(label) > 1 and make.maybe(0.5)), None)
    if split is not None and len(x.shape) == len(groups):
        # A merged axis is split again, now and then into other axes.
        parts = list(labels[split].replace("N", ""))
        sizes = {"H": 9, "W": shape[split] // 9, "P": shape[split]}
        if make.maybe(0.3):
            parts = parts[::-1]
        shape = shape[:split] + [sizes.get(part, 1) for part in parts] + shape[split + 1 :]
        labels = labels[:split] + parts + labels[split + 1 :]
    if make.maybe(0.3) and len(shape) < 4:
        at = make.random.randint(0, len(shape))
        shape, labels = [*shape[:at], 1, *shape[at:]], [*labels[:at], "", *labels[at:]]
    if make.maybe(0.1):
        make.random.shuffle(shape)
    written = list(shape)
    if make.maybe(0.7) and written:
        at = max(range(len(written)), key=written.__getitem__)
        written[at] = -1
    for axis, size in enumerate(shape):
        if axis < len(x.shape) and size == x.shape[axis] and written[axis] > 0 and make.maybe(0.3):
            written[axis] = 0
    inputs = [x.name, make.constant(np.array(written, np.int64))]
    attributes = {"allowzero": make.random.choice([0, 1])} if make.opset >= 14 and make.maybe(0.1) else {}
    return make.add("Reshape", inputs, shape, labels, **attributes)


def _flattened(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    axis = make.random.randint(0, len(x.shape))
    sizes = [int(np.prod(x.shape[:axis])), int(np.prod(x.shape[axis:]))]
    labels = ["".join(x.labels[:axis]), "".join(x.labels[axis:])]
    return make.add("Flatten", [x.name], sizes, labels, **({} if axis == 1 else {"axis": axis}))


def _squeezed(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    axes = [axis for axis, size in enumerate(x.shape) if size == 1]
    axes = make.random.sample(axes, make.random.randint(0, len(axes)))
    if not axes and make.maybe(0.8):
        return None
    inputs = [x.name]
    gone = axes or [axis for axis, size in enumerate(x.shape) if size == 1]
    written = [axis - (len(x.shape) if make.opset >= 11 and make.maybe(0.3) else 0) for axis in axes]
    attributes = make.option(13, inputs, axes=np.array(written, np.int64)) if axes else {}
    keep = [axis for axis in range(len(x.shape)) if axis not in gone]
    return make.add("Squeeze", inputs, [x.shape[i] for i in keep], [x.labels[i] for i in keep], **attributes)


def _unsqueezed(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    if len(x.shape) > 3:
        return None
    axis, inputs = make.random.randint(0, len(x.shape)), [x.name]
    axes = [axis, axis] if make.maybe(0.02) else [axis]
    attributes = make.option(13, inputs, axes=np.array(axes, np.int64))
    shape, labels = [*x.shape[:axis], 1, *x.shape[axis:]], [*x.labels[:axis], "", *x.labels[axis:]]
    return make.add("Unsqueeze", inputs, shape, labels, **attributes)


def _padded(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    rank = len(x.shape)
    pads = [make.random.choice([0, 0, 1, 2]) for _ in range(2 * rank)]
    if make.maybe(0.95):
        pads = [n if x.labels[i % rank] in ("H", "W") else 0 for i, n in enumerate(pads)]
    mode, inputs = make.random.choice(["constant", "edge", "edge", "reflect"]), [x.name]
    shape = [n + pads[i] + pads[i + rank] for i, n in enumerate(x.shape)]
    attributes = make.option(11, inputs, pads=np.array(pads, np.int64))
    if make.opset >= 18 and make.maybe(0.2) and {"H", "W"} <= set(x.labels):
        axes = [x.labels.index(label) for label in make.random.sample(["H", "W"], 2)]
        inputs[1] = make.constant(np.array([pads[a] for a in axes] + [pads[a + rank] for a in axes]))
        shape = [n + (pads[i] + pads[i + rank] if i in axes else 0) for i, n in enumerate(x.shape)]
        inputs += ["", make.constant(np.array(axes, np.int64))]
    elif make.maybe(0.05):
        attributes |= make.option(11, inputs, value=0.5)
    if make.maybe(0.8) or mode != "constant":
        attributes["mode"] = mode
    return make.add("Pad", inputs, shape, x.labels, **attributes)


def _cropped(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    if not x.shape:
        return None
    axis = make.random.choice([a for a, label in enumerate(x.labels) if label in ("C", "H", "W")] or [0])
    start = make.random.choice([0, 1, 1, 2, -2])
    end = make.random.choice([-1, -2, INT_MAX, 2**62, 3, x.shape[axis]])
    return _sliced(make, x, axis, start, end)


def _sliced(make: Maker, x: Value, axis: int, start: int, end: int) -> Value | None:
    size = len(range(x.shape[axis])[start:end])
    if not size and make.maybe(0.95):
        return None
    inputs, shape = [x.name], list(x.shape)
    shape[axis] = size
    numbers = {"starts": [start], "ends": [end], "axes": [axis]}
    if make.maybe(0.02):
        numbers = {name: values * 2 for name, values in numbers.items()}
    if make.opset >= 10 and make.maybe(0.1):
        numbers["steps"] = [make.random.choice([1, 1, 2, -1])] * len(numbers["axes"])
    attributes = make.option(10, inputs, **{name: np.array(v, np.int64) for name, v in numbers.items()})
    return make.add("Slice", inputs, shape, x.labels, **attributes)


def _plain(make: Maker, x: Value, _values: list[Value]) -> Value | None:
    op = make.random.choice(["Identity", "Neg", "Neg", "Cast"])
    attributes = {"to": helper.np_dtype_to_tensor_dtype(make.dtype)} if op == "Cast" else {}
    return make.add(op, [x.name], x.shape, x.labels, **attributes)


STEPS: tuple[Step, ...] = (
    *([_conv] * 5 + [_activation] * 5 + [_matrix] * 4 + [_with_constant] * 4 + [_two, _concat] * 2),
    *([_normalised, _transposed, _reshaped, _padded, _cropped] * 2),
    *(_dropout, _flattened, _squeezed, _unsqueezed, _plain),
)
"""How a graph continues, by how often."""
