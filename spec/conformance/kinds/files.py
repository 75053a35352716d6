"""Kinds of files: models, good, damaged and hostile.

`models.json` has a row for each file: note, clause, the clause that its refusal is blamed on, or null if it
must be refused, and how it is made: a function of [`MADE`] and its arguments. A character of a text that is
put into a file is a byte. ... stands for a key that is left out.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import struct
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....models import model_file
from ....refimpl.network import siren
from ....refimpl.network.dataset import Normalization, Window
from ....refimpl.network.denoise import Model
from ..case import Case, exact
from .records import CAMERA_KIND, SCENE_KIND, spelled
from .tables import kind, table


def network(
    widths: Sequence[int] = (27, 4, 3),
    seed: int = 5,
    features: Sequence[str] = ("color",),
    window: tuple[int, str] = (3, "clamp"),
    omega_0: tuple[float, float] = (3.0, 1.0),
    dtype: str = "float32",
) -> Model:
    """Return the model of the files, or another one."""
    made = siren.init(widths, *omega_0, seed=seed, dtype=np.dtype(dtype).type)
    scales, facts = Normalization(exposure_stops=0.5), {"recipe": "none"}
    return Model(made, tuple(features), Window(*window), scales, facts)


MODEL = network()
"""The model of the files."""


def file_of(model: Model) -> bytes:
    """Return a model's file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        model_file.save_model(path, model)
        return path.read_bytes()


def model_from(content: bytes) -> Model:
    """Return the model in a file's content."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        path.write_bytes(content)
        return model_file.load_model(path)


def digest(model: Model) -> str:
    """Return the SHA-256 of all parameters as little-endian float64: layer by layer weights, then biases."""
    parts = (p for pair in zip(model.siren.weights, model.siren.biases, strict=True) for p in pair)
    return hashlib.sha256(b"".join(np.ascontiguousarray(p, "<f8").tobytes() for p in parts)).hexdigest()


def _model(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a file holds."""
    model = model_from(base64.b64decode(inputs["content"]))
    return {
        "digest": digest(model),
        "widths": np.array(model.siren.widths),
        "features": ",".join(model.features),
        "window": model.window.size,
        "border": model.window.border,
        "omega_0": np.array([model.siren.omega_0_first, model.siren.omega_0_hidden]),
    }


# ---- changed files ----------------------------------------------------------------------------------------

Header = dict[str, Any]
Tensors = Mapping[str, NDArray[Any]]

OUT = "..."
"""Stands for a key of an entry that is left out."""


@cache
def _file() -> bytes:
    """Return the file of the model."""
    return file_of(MODEL)


def _bytes(text: Any) -> bytes:
    """Return a text of the table as bytes."""
    return spelled(text).encode("latin-1")


def _parts() -> tuple[Header, bytes]:
    """Return header and data of the file."""
    length = int.from_bytes(_file()[:8], "little")
    return json.loads(_file()[8 : 8 + length]), _file()[8 + length :]


def _joined(header: Any, data: bytes = b"") -> bytes:
    """Return a file of header, an object or its bytes, and data."""
    text = header if isinstance(header, bytes) else json.dumps(header, sort_keys=True).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + data


def _changed(name: str, value: Any) -> bytes:
    """Return the file with an entry of its header replaced, or left out if it is `OUT`."""
    header, data = _parts()
    return _joined({key: entry for key, entry in {**header, name: value}.items() if entry != OUT}, data)


def _texts(**changes: Any) -> bytes:
    """Return the file with texts of its header changed, or left out if they are None."""
    texts = {**_parts()[0]["__metadata__"], **changes}
    return _changed("__metadata__", {key: text for key, text in texts.items() if text is not None})


def _scales(changes: Mapping[str, Any]) -> bytes:
    """Return the file with some scales changed, or left out if they are None."""
    scales = {**asdict(MODEL.normalization), **changes}
    return _texts(normalization=json.dumps({k: v for k, v in scales.items() if v is not None}))


def _renamed(old: str, new: str) -> bytes:
    """Return the file with a tensor under another name."""
    header, data = _parts()
    header[new] = header.pop(old)
    return _joined(header, data)


def _ended(more: Callable[[Header], Mapping[str, Any]]) -> bytes:
    """Return the file with entries written once more at the end of its header, whose names it has already."""
    header, data = _parts()
    text = json.dumps(header)[:-1]
    again = "".join(f', "{name}": {json.dumps(entry)}' for name, entry in more(header).items())
    return _joined((text + again + "}").encode(), data)


def _key_twice() -> bytes:
    """Return a file in which an entry's key appears twice, and both times the same."""
    header, data = _parts()
    key = '"dtype": "F32", '
    return _joined(json.dumps(header).replace(key, key + key, 1).encode(), data)


def _gap() -> bytes:
    """Return a file with four bytes between two tensors that belong to none."""
    header, data = _parts()
    end = header["layer0.bias"]["data_offsets"][1]
    for name, entry in header.items():
        if name != "__metadata__" and entry["data_offsets"][0] >= end:
            entry["data_offsets"] = [offset + 4 for offset in entry["data_offsets"]]
    return _joined(header, data[:end] + bytes(4) + data[end:])


def _tensors(network: siren.Siren = MODEL.siren) -> dict[str, NDArray[Any]]:
    """Return the tensors of a network by name."""
    pairs = enumerate(zip(network.weights, network.biases, strict=True))
    return {
        f"layer{layer}.{name}": array
        for layer, arrays in pairs
        for name, array in zip(("weight", "bias"), arrays, strict=True)
    }


def _made_of(tensors: Tensors) -> bytes:
    """Return the file with these tensors in place of its own, one after another."""
    header, data = {"__metadata__": _parts()[0]["__metadata__"]}, b""
    for name, array in tensors.items():
        span = [len(data), len(data) + array.nbytes]
        dtype = {"float32": "F32", "float64": "F64"}[array.dtype.name]
        header[name] = {"dtype": dtype, "shape": list(array.shape), "data_offsets": span}
        data += array.tobytes()
    return _joined(header, data)


def _doubled(*parts: str) -> bytes:
    """Return the file with the tensors in float64 whose names have one of these parts; they come first."""
    of_double = {n: a.astype("<f8") for n, a in _tensors().items() if any(part in n for part in parts)}
    return _made_of({**of_double, **{n: a for n, a in _tensors().items() if n not in of_double}})


def _unchecked(widths: list[int], more: int = 0) -> bytes:
    """Return the file with tensors of other widths, which the writer would refuse."""
    made = _tensors(siren.init(widths, 3.0, 1.0, seed=8, dtype=np.float32))
    wider = {"layer1.weight": np.pad(made["layer1.weight"], ((0, 0), (0, more)))}
    return _made_of({**made, **wider})


EVERY_TYPE = {
    "BOOL": 1, "U8": 1, "I8": 1, "F8_E5M2": 1, "F8_E4M3": 1, "U16": 2, "I16": 2, "F16": 2, "BF16": 2,
    "U32": 4, "I32": 4, "F32": 4, "U64": 8, "I64": 8, "F64": 8,
}  # fmt: skip
"""The types of tensors, with their size in bytes (MOD-1)."""


def _beside(*entries: Mapping[str, Any]) -> bytes:
    """Return the file with tensors more, which are ignored: of each its shape, and its type if not U8."""
    header, data = _parts()
    for number, entry in enumerate(entries):
        size = math.prod(entry["shape"]) * EVERY_TYPE[entry.get("dtype", "U8")]
        span = {"data_offsets": [len(data), len(data) + size]}
        header[f"more{number}"] = {"dtype": "U8", **entry, **span}
        data += bytes(size)
    return _joined(header, data)


def _odd(size: int, entry: Mapping[str, Any] = MappingProxyType({})) -> bytes:
    """Return the file with a tensor more in 2 rows of 3 bytes, whose entry is changed."""
    header, data = _parts()
    made = {"dtype": "U8", "shape": [2, 3], "data_offsets": [len(data), len(data) + size], **entry}
    header["more"] = {key: value for key, value in made.items() if value != OUT}
    return _joined(header, data + bytes(size))


def _header(before: str, after: str = "", texts: Any = None) -> bytes:
    """Return the file with bytes before and after the header's object, with more texts or a list of them."""
    header, data = _parts()
    own = header["__metadata__"]
    header["__metadata__"] = texts if isinstance(texts, list) else {**own, **(texts or {})}
    return _joined(_bytes(before) + json.dumps(header).encode() + _bytes(after), data)


MADE: Mapping[str, Callable[..., bytes]] = {
    "sliced": lambda start=0, end=None, before="", after="": (
        _bytes(before) + _file()[start:end] + _bytes(after)
    ),
    "network": lambda changes: file_of(network(**changes)),
    "joined": lambda header: _joined(_bytes(header)),
    "text": lambda name, value: _texts(**{name: value}),
    "untold": lambda: _changed("__metadata__", OUT),
    "note": lambda note, read: _texts(note=note).replace(note.encode(), _bytes(read)),
    "scales": _scales,
    "tensor": lambda name, changes: _changed(name, {**_parts()[0][name], **changes}),
    "renamed": _renamed,
    "number": lambda value: _joined(_parts()[0], struct.pack("<f", float(value)) + _parts()[1][4:]),
    "twice": lambda: _ended(lambda header: {"layer0.bias": header["layer1.bias"]}),
    "texts_twice": lambda: _ended(lambda header: {"__metadata__": header["__metadata__"]}),
    "key_twice": _key_twice,
    "gap": _gap,
    "ordered": lambda: _made_of(_tensors()),
    "reversed": lambda: _made_of(dict(reversed(_tensors().items()))),
    "named": lambda names: _made_of({names[n]: array for n, array in _tensors().items() if n in names}),
    "more": lambda names: _made_of({**_tensors(), **{n: _tensors()[own] for n, own in names.items()}}),
    "biases": lambda count: _made_of({**_tensors(), "layer0.bias": np.full(count, 0.5, np.float32)}),
    "doubled": _doubled,
    "unchecked": _unchecked,
    "beside": _beside,
    "odd": _odd,
    "entry": lambda value: _changed("more", value),
    "header": _header,
}
"""How files are made, by name."""


def _model_cases() -> list[Case]:
    """Return good and bad files."""
    cases = []
    for note, clause, refusal, made, *arguments in table("models"):
        inputs = {"content": base64.b64encode(MADE[made](*arguments)).decode()}
        expected = exact(_model(inputs)) if refusal is not None else None
        cases.append(Case(clause, inputs, expected, note, refusal or ""))
    return cases


KINDS = (CAMERA_KIND, kind("file.model", _model_cases, _model), SCENE_KIND)
"""The kinds of files and of texts."""
