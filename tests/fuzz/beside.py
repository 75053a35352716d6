"""Whether an imported graph is the same function as in ONNX Runtime.

A graph is rejected by the import, not run by ONNX Runtime, or both compute the same in all pixels that are at
least the reported margin from the edge, within a bound of their rounding [`compared`, `bound`].

`python tests/fuzz/beside.py --count 20000 --seed 1` prints how many random graphs there were of each, and
keeps those that differ.
"""

import argparse
import tempfile
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import onnxruntime
from graphs import graph
from numpy.typing import NDArray

from wamnet.models.importing.graph import Graph, read
from wamnet.models.importing.network import Found, import_network
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network.imported import evaluate

Array = NDArray[Any]


def bound(graph: Graph) -> float:
    """Return how far the model and ONNX Runtime may be apart; inf if the graph may overflow.

    Each value has a majorant m of its magnitude, which is |W| m + |b| of a linear operator, and a bound e of
    the runtime's error. A sum of n products rounds n + 1 times, each time by at most u of a partial sum that
    m bounds, in any order, and passes e on as |W| e; activations have slopes of at most 1. A sine is taken to
    be within 8 u. The model is evaluated in float64, and rounds each weight that is a product once, which the
    same terms bound: both together are at most 2 e.
    """
    half = any(each.dtype == "float16" for each in graph.inputs.values())
    u, tiny, largest = (2.0**-11, 2.0**-22, 6e4) if half else (2.0**-24, 2.0**-140, 1e37)
    of: dict[str, tuple[float, float]] = {
        name: (float(np.iinfo(each.dtype).max) + 1.0 if "int" in each.dtype else 1.0, 0.0)
        for name, each in graph.inputs.items()
    }
    for node in graph.nodes:
        constants = [graph.constants[name] for name in node.inputs if name in graph.constants]
        weights = [np.abs(array.astype(np.float64)) for array in constants if array.dtype.kind == "f"]
        both = [of[name] for name in node.inputs if name in of]
        (m, e), most = both[0], float(max((array.max(initial=0.0) for array in weights), default=0.0))
        if node.op in ("Conv", "MatMul", "Gemm"):
            weight = weights[0]
            rows = weight.reshape(len(weight), -1).sum(axis=1).max()
            gain = rows if node.op == "Conv" else max(rows, weight.sum(axis=0).max())
            gain *= abs(node.attributes.get("alpha", 1.0))
            shift = max((array.max(initial=0.0) for array in weights[1:]), default=0.0)
            shift *= abs(node.attributes.get("beta", 1.0))
            m = gain * m + shift
            e = gain * e + (weight.size + 3) * u * m
        elif node.op in ("Add", "Sub"):
            other = both[1] if both[1:] else (most, 0.0)
            m, e = m + other[0], e + other[1] + u * (m + other[0])
        elif node.op in ("Mul", "Div"):
            gain = most if node.op == "Mul" else 1.0 / float(weights[0].min())
            m, e = gain * m, gain * e + 2 * u * gain * m
        elif node.op == "BatchNormalization":
            gain, shift, mean, variance = weights
            factor = float((gain / np.sqrt(variance + node.attributes.get("epsilon", 1e-5))).max())
            total = factor * (m + mean.max()) + shift.max()
            m, e = total, factor * e + 8 * u * total
        elif node.op == "Sin":
            m, e = 1.0, e + 8 * u + u * m
        elif node.op == "Clip":
            ends = [*weights, *map(abs, node.attributes.values())]
            m += sum(float(np.max(end)) for end in ends if np.max(end) < 1e8)
            e += u * m
        elif node.op == "Concat":
            m, e = max(a for a, _ in both), max(b for _, b in both)
        elif node.op == "LeakyRelu":
            e += u * m
        of[node.output] = m, e + tiny
        if not m < largest:
            return float("inf")
    return 2.0 * of[graph.output][1]


def compared(content: bytes, folder: Path, border: str | None = None, inward: int = 0) -> str:
    """Return the outcome of a graph: "equal", or why it is not compared; raise what the import raises.

    An AssertionError says how a model differs inside its margin. `border`: a random rule if it is None.
    `inward`: compare so many pixels further in than the margin is.
    """
    path = folder / "network.onnx"
    path.write_bytes(content)
    border = Random(content).choice(["", "zero", "zero", "clamp"]) if border is None else border
    result = import_network(path, {}, border)
    graph = read(path)
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = 1, 4
    images, tensors = _images(graph, result)
    try:
        session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
        theirs = session.run(None, tensors)[0]
    except Exception:  # noqa: BLE001 - whatever the runtime does not run
        return "not run"
    with np.errstate(all="ignore"):
        ours = evaluate(result.model.siren, result.model.window, images)
        within = bound(graph)
    if not np.isfinite(within):
        return "overflows"
    rows, columns = ours.shape[:2]
    batch = sum(tensor.size for tensor in tensors.values()) // sum(image.size for image in images.values())
    if batch > 1:
        # The batch is first, by itself or with the axes that are merged with it.
        theirs = theirs.squeeze()
        theirs = theirs[: len(theirs) // batch]
    candidates = _pictures(theirs.astype(np.float64), ours.shape)
    if not candidates:
        return "merged"
    m = result.margin + inward
    if rows <= 2 * m or columns <= 2 * m:
        return "no inside"
    error = min(_error(ours, picture, m) for picture in candidates)
    assert error <= within, f"{error} apart where {within} is the bound, {m} pixels from the edge"
    return "equal"


def _error(ours: Array, theirs: Array, margin: int) -> float:
    """Return how far images with one middle are apart inside a margin; inf if theirs has no pixels there."""
    rows, columns = ours.shape[:2]
    down, across = (theirs.shape[0] - rows) // 2, (theirs.shape[1] - columns) // 2
    inside = theirs[margin + down : rows - margin + down, margin + across : columns - margin + across]
    expected = ours[margin : rows - margin, margin : columns - margin]
    return float(np.abs(inside - expected).max()) if inside.shape == expected.shape else float("inf")


def _images(graph: Graph, result: Found) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return random inputs as images by the model's names, and as tensors by the graph's.

    Of a batch the first image is compared; the others must not matter.
    """
    rng = np.random.default_rng(1)
    plain = {1: "C", 2: "PC", 3: "HWC", 4: "NCHW"}
    layouts, sizes = {}, {"N": 1, "H": 9, "W": 11}
    for name, each in graph.inputs.items():
        last = len(each.sizes) == 4 and each.sizes[1] is None and each.sizes[3] is not None
        layouts[name] = "NHWC" if last else plain[len(each.sizes)]
        sizes |= {label: size for label, size in zip(layouts[name], each.sizes, strict=True) if size}
    sizes |= {"H": 1, "W": sizes["P"]} if "P" in sizes else {}
    sizes |= {"H": 1, "W": 1} if "C" in layouts.values() else {}
    images, tensors = {}, {}
    for (name, each), source in zip(graph.inputs.items(), result.model.siren.sources, strict=True):
        shares = rng.random((*(sizes[label] for label in "NHW"), source.channels))
        batch = source.low + (source.high - source.low) * shares
        batch = (batch if each.dtype.startswith("f") else np.rint(batch)).astype(each.dtype)
        images[source.name] = batch[0]
        if layouts[name] == "NCHW":
            batch = np.moveaxis(batch, -1, 1)
        elif layouts[name] != "NHWC":
            shape = {"HWC": batch.shape[1:], "PC": (-1, source.channels), "C": (-1,)}[layouts[name]]
            batch = batch[0].reshape(shape)
        tensors[name] = np.ascontiguousarray(batch)
    return images, tensors


def _pictures(tensor: Array, shape: tuple[int, ...]) -> list[Array]:
    """Return a result as images (h, w, D): channels are the first axis or the last, rows before columns.

    There is none if rows and columns of another size than the inputs' are one axis.
    """
    rows, columns, channels = shape
    plain = tensor.reshape([n for n in tensor.shape if n != 1])
    if channels == 1:
        both = [plain[..., None]]
    else:
        assert channels in (plain.shape[0], plain.shape[-1]), f"{channels} channels of {tensor.shape}"
        both = [each for each in (plain, np.moveaxis(plain, 0, -1)) if each.shape[-1] == channels]
    if both[0].ndim == 3:
        return both
    if plain.size == rows * columns * channels:
        return [each.reshape(shape) for each in both]
    return [each.reshape(1, -1, channels) for each in both] if rows == 1 else []


def main() -> None:
    """Compare as many graphs as the options say."""
    parser = argparse.ArgumentParser(description="Compare imported random graphs with ONNX Runtime.")
    parser.add_argument("--count", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", "--output", type=Path, default=Path("out/graphs"), help="of findings")
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for number in range(options.count):
            content = graph(Random(f"{options.seed}/{number}"))
            try:
                outcome = compared(content, Path(folder))
            except InputError:
                outcome = "rejected"
            except Exception as error:  # noqa: BLE001 - a finding
                outcome = "DIFFERENT" if isinstance(error, AssertionError) else "RAISED"
                options.output.mkdir(parents=True, exist_ok=True)
                (options.output / f"{options.seed}.{number}.onnx").write_bytes(content)
                print(f"{number}: {type(error).__name__}: {error}", flush=True)
            counts[outcome] += 1
    print(", ".join(f"{count} {outcome}" for outcome, count in counts.most_common()))


if __name__ == "__main__":
    main()
