"""Networks of other programs for tests: those of tests/models/networks, and graphs that are made by hand.

The files are PyTorch's own, written by `python tests/support/strangers.py`; tests with PyTorch make them
again and compare. Others need the package onnx only.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FOLDER = Path(__file__).parents[1] / "models" / "networks"
"""Where the files are."""

SIZE = (9, 11)
"""Rows and columns of a picture: most pixels see the border, none of the sides is a multiple of a group's."""


@dataclass(frozen=True)
class Stranger:
    """A network: the range of its numbers, the border that is chosen, and how many of its pixels differ.

    `rows`: it maps rows of numbers (N, D), not pictures.
    """

    name: str
    low: float = 0.0
    high: float = 1.0
    channels: int = 3
    border: str = ""
    margin: int = 0
    rows: bool = False

    @property
    def path(self) -> Path:
        """Return the file."""
        return FOLDER / f"{self.name}.onnx"

    def image(self, seed: int = 1) -> NDArray[np.float32]:
        """Return a picture (H, W, C) of float32 in the range."""
        shares = np.random.default_rng(seed).random((*SIZE, self.channels))
        return (self.low + (self.high - self.low) * shares).astype(np.float32)

    def tensor(self, image: NDArray[Any]) -> NDArray[Any]:
        """Return a picture (H, W, C) as the network reads it."""
        if self.rows:
            return image.reshape(-1, self.channels)
        return np.ascontiguousarray(image.transpose(2, 0, 1)[None])

    def picture(self, tensor: NDArray[Any]) -> NDArray[Any]:
        """Return what the network writes as a picture (H, W, D)."""
        if self.rows:
            return tensor.reshape(*SIZE, -1)
        return tensor[0].transpose(1, 2, 0)

    def inside(self, picture: NDArray[Any]) -> NDArray[Any]:
        """Return the part of a picture (H, W, D) where the model is the network."""
        m = self.margin
        return picture[m:-m, m:-m] if m else picture


STRANGERS = (
    Stranger("pixels"),
    Stranger("sines", low=-1.0, channels=2, rows=True),
    Stranger("residual"),
    Stranger("same", border="zero", margin=1),
)
"""A rectifier network of each pixel; a network of sines on coordinates; two convolutions on a padded picture
and what skips past them; two convolutions that pad what they read."""


def modules() -> Mapping[str, Any]:
    """Return PyTorch's modules by the names of their networks, with random weights of a fixed seed."""
    import torch
    from torch import nn
    from torch.nn import functional

    class Sines(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.layers = nn.ModuleList([nn.Linear(2, 8), nn.Linear(8, 8), nn.Linear(8, 3)])

        def forward(self, x: Any) -> Any:
            first, second, last = self.layers
            return last(torch.sin(3.0 * second(torch.sin(10.0 * first(x)))))

    class Skipping(nn.Module):
        def __init__(self, margin: int) -> None:
            super().__init__()
            self.margin = margin
            self.first = nn.Conv2d(3, 4, 3, padding=1 - margin // 2)
            self.second = nn.Conv2d(4, 3, 3, padding=1 - margin // 2)

        def forward(self, x: Any) -> Any:
            wide = functional.pad(x, (self.margin,) * 4, mode="replicate") if self.margin else x
            return (x + self.second(torch.relu(self.first(wide)))).clamp(0, 1)

    torch.manual_seed(1)
    pixels = nn.Sequential(nn.Conv2d(3, 8, 1), nn.ReLU(), nn.Conv2d(8, 3, 1), nn.Hardtanh(0.0, 1.0))
    return {"pixels": pixels, "sines": Sines(), "residual": Skipping(2), "same": Skipping(0)}


def export(name: str, path: Path) -> None:
    """Write a network as PyTorch's exporter does, for any size of picture."""
    import torch

    stranger = next(each for each in STRANGERS if each.name == name)
    axes = {"x": {0: "rows"} if stranger.rows else {2: "height", 3: "width"}}
    given = torch.from_numpy(stranger.tensor(stranger.image()))
    with warnings.catch_warnings():
        # The exporter that needs no other package announces its end.
        warnings.simplefilter("ignore")
        torch.onnx.export(
            modules()[name].eval(),
            (given,),
            str(path),
            dynamo=False,
            input_names=["x"],
            output_names=["y"],
            dynamic_axes=axes,
            opset_version=17,
        )


def graph(
    path: Path,
    nodes: Sequence[tuple[Any, ...]],
    constants: Mapping[str, Any] | None = None,
    shape: Sequence[Any] = (1, 2, "h", "w"),
    opset: int = 17,
    inputs: Sequence[str] = ("x",),
    outputs: Sequence[str] = ("y",),
    dtype: str = "float32",
    rank: int = 0,
) -> Path:
    """Write a graph from `x` to `y` of nodes (operator, inputs, output, attributes), and return its file.

    `dtype`: of the inputs; an output of integers is float32. `rank`: the axes of the output, 0 for as many.
    """
    from onnx import TensorProto, helper, numpy_helper

    made = [
        helper.make_node(op, list(given), output.split(), name=f"n{i}", **(rest[0] if rest else {}))
        for i, (op, given, output, *rest) in enumerate(nodes)
    ]
    held = {
        name: array if isinstance(array, np.ndarray) else np.asarray(array, np.float32)
        for name, array in (constants or {}).items()
    }
    of = helper.np_dtype_to_tensor_dtype(np.dtype(dtype))
    result = of if dtype.startswith("float") else TensorProto.FLOAT
    whole = helper.make_graph(
        made,
        "graph",
        [helper.make_tensor_value_info(name, of, list(shape)) for name in inputs],
        [helper.make_tensor_value_info(name, result, [None] * (rank or len(shape))) for name in outputs],
        [numpy_helper.from_array(array, name) for name, array in held.items()],
    )
    found = helper.make_model(whole, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)
    path.write_bytes(found.SerializeToString())
    return path


if __name__ == "__main__":
    for each in STRANGERS:
        export(each.name, each.path)
