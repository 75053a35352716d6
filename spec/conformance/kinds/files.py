"""Kinds of files: models, good, damaged and hostile."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import struct
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....models import model_file
from ....refimpl.network import siren
from ....refimpl.network.dataset import Normalization, Window
from ....refimpl.network.denoise import Model
from ..case import Case, Kind, Output

MODEL = Model(
    siren.init([27, 4, 3], 3.0, 1.0, seed=5, dtype=np.float32),
    ("color",),
    Window(3, "clamp"),
    Normalization(exposure_stops=0.5),
    {"recipe": "none"},
)
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


def _parts(content: bytes) -> tuple[Header, bytes]:
    """Return header and data of a file."""
    length = int.from_bytes(content[:8], "little")
    return json.loads(content[8 : 8 + length]), content[8 + length :]


def _joined(header: Any, data: bytes) -> bytes:
    """Return a file of header, an object or its bytes, and data."""
    text = header if isinstance(header, bytes) else json.dumps(header, sort_keys=True).encode()
    text += b" " * (-len(text) % 8)
    return struct.pack("<Q", len(text)) + text + data


def _text(name: str, value: str | None) -> bytes:
    """Return the file with a text of its header changed, or left out."""
    header, data = _parts(file_of(MODEL))
    texts = dict(header["__metadata__"])
    texts[name] = value
    header["__metadata__"] = {key: text for key, text in texts.items() if text is not None}
    return _joined(header, data)


def _without_texts() -> tuple[Header, bytes]:
    """Return header and data of the file, the header without its texts."""
    header, data = _parts(file_of(MODEL))
    del header["__metadata__"]
    return header, data


def _tensor(name: str, **changes: Any) -> bytes:
    """Return the file with an entry of a tensor changed."""
    header, data = _parts(file_of(MODEL))
    header[name] = {**header[name], **changes}
    return _joined(header, data)


def _renamed(old: str, new: str) -> bytes:
    """Return the file with a tensor under another name."""
    header, data = _parts(file_of(MODEL))
    header[new] = header.pop(old)
    return _joined(header, data)


def _number(value: float) -> bytes:
    """Return the file with another first number."""
    header, data = _parts(file_of(MODEL))
    return _joined(header, struct.pack("<f", value) + data[4:])


def _twice() -> bytes:
    """Return a file whose header has one name twice."""
    header, data = _parts(file_of(MODEL))
    text = json.dumps(header).encode()
    return _joined(text[:-1] + b', "layer0.bias": ' + json.dumps(header["layer1.bias"]).encode() + b"}", data)


def _texts_twice() -> bytes:
    """Return a file with its texts twice, and both times the same."""
    header, data = _parts(file_of(MODEL))
    again = b', "__metadata__": ' + json.dumps(header["__metadata__"]).encode() + b"}"
    return _joined(json.dumps(header).encode()[:-1] + again, data)


def _key_of_tensor_twice() -> bytes:
    """Return a file in which an entry's key appears twice, and both times the same."""
    header, data = _parts(file_of(MODEL))
    text = json.dumps(header)
    key = '"dtype": "F32", '
    return _joined(text.replace(key, key + key, 1).encode(), data)


def _scales(**changes: Any) -> bytes:
    """Return the file with some scales changed, or left out with the value None."""
    scales = {**asdict(MODEL.normalization), **changes}
    return _text("normalization", json.dumps({k: v for k, v in scales.items() if v is not None}))


def _gap() -> bytes:
    """Return a file with four bytes between two tensors that belong to none."""
    header, data = _parts(file_of(MODEL))
    end = header["layer0.bias"]["data_offsets"][1]
    for name, entry in header.items():
        if name != "__metadata__" and entry["data_offsets"][0] >= end:
            entry["data_offsets"] = [offset + 4 for offset in entry["data_offsets"]]
    return _joined(header, data[:end] + bytes(4) + data[end:])


GOOD: Mapping[str, Callable[[], bytes]] = {
    "as it was written": lambda: file_of(MODEL),
    "in float64": lambda: file_of(
        replace(MODEL, siren=siren.init([27, 4, 3], 3.0, 1.0, seed=5, dtype=np.float64))
    ),
    "a fact more": lambda: _text("info.author", "somebody"),
    "an entry that is not known": lambda: _text("later", "ignored"),
    "one layer": lambda: file_of(replace(MODEL, siren=siren.init([27, 3], 1.0, 1.0, seed=6))),
}
"""Files that are read, by what is special about them."""

BAD: Mapping[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "7 bytes": lambda: b"\0" * 7,
    "cut in the header": lambda: file_of(MODEL)[:100],
    "cut in the data": lambda: file_of(MODEL)[:-4],
    "bytes after the end": lambda: file_of(MODEL) + b"\0\0\0\0",
    "a header longer than the file": lambda: struct.pack("<Q", 1 << 40) + file_of(MODEL)[8:],
    "a header longer than any memory": lambda: struct.pack("<Q", (1 << 64) - 1) + file_of(MODEL)[8:],
    "a header that is no JSON": lambda: _joined(b"{'layer0': 1}", b""),
    "a header that is no object": lambda: _joined(b"[]", b""),
    "a header that is not UTF-8": lambda: _joined(b'{"\xff": 1}', b""),
    "a text of the header that is not UTF-8": lambda: _text("note", "rough").replace(
        b"rough", b"\xff\xff\xff\xff\xff"
    ),
    "a header of brackets": lambda: _joined(b"[" * 4000, b""),
    "another format": lambda: _text("format", "wamnet-checkpoint"),
    "no format": lambda: _text("format", None),
    "a later version": lambda: _text("version", "2"),
    "no features": lambda: _text("features", None),
    "an empty list of features": lambda: _text("features", "[]"),
    "an unknown feature": lambda: _text("features", '["colour"]'),
    "a feature twice": lambda: _text("features", '["color", "color"]'),
    "features that are no list": lambda: _text("features", '"color"'),
    "a window of no pixels": lambda: _text("window", '{"border": "clamp", "size": 0}'),
    "a window that does not fit the layer": lambda: _text("window", '{"border": "clamp", "size": 5}'),
    "a window of 3.0 pixels": lambda: _text("window", '{"border": "clamp", "size": 3.0}'),
    "an unknown border": lambda: _text("window", '{"border": "mirror", "size": 3}'),
    "omega_0 of 0": lambda: _text("omega_0_first", "0.0"),
    "omega_0 that is no number": lambda: _text("omega_0_hidden", "nan"),
    "a scale of 0": lambda: _text(
        "normalization",
        '{"depth_scale": 0.0, "exposure_stops": 0.0, "position_center": [0, 0, 0], "position_scale": 1.0}',
    ),
    "no normalization": lambda: _text("normalization", None),
    "a tensor of another shape than its bytes": lambda: _tensor("layer0.weight", shape=[4, 28]),
    "layers that do not chain": lambda: _tensor("layer1.weight", shape=[4, 3]),
    "a tensor of integers": lambda: _tensor("layer0.bias", dtype="I32"),
    "an unknown type": lambda: _tensor("layer0.bias", dtype="F33"),
    "a shape beyond 64 bits": lambda: _tensor("layer0.bias", shape=[1 << 62, 1 << 62]),
    "a tensor beyond the file": lambda: _tensor("layer0.bias", data_offsets=[1 << 30, (1 << 30) + 16]),
    "a tensor that ends before it begins": lambda: _tensor("layer0.bias", data_offsets=[16, 0]),
    "tensors that overlap": lambda: _tensor("layer0.weight", data_offsets=[0, 432]),
    "a gap between tensors": _gap,
    "a layer without biases": lambda: _renamed("layer1.bias", "layer1.offset"),
    "a layer left out": lambda: _renamed("layer1.weight", "layer2.weight"),
    "NaN among the weights": lambda: _number(float("nan")),
    "an infinity among the weights": lambda: _number(float("inf")),
    "a name twice": _twice,
    "all texts twice": _texts_twice,
    "a window without a border": lambda: _text("window", '{"size": 3}'),
    "a window with another key": lambda: _text("window", '{"border": "clamp", "shape": 1, "size": 3}'),
    "a key of the window twice": lambda: _text("window", '{"border": "clamp", "size": 3, "size": 3}'),
    "a key of a tensor twice": _key_of_tensor_twice,
    "a scale left out": lambda: _scales(exposure_stops=None),
    "a scale that is not known": lambda: _scales(gamma=1.0),
    "a scale that is a boolean": lambda: _scales(depth_scale=True),
    "a scale as text": lambda: _scales(depth_scale="1.0"),
    "omega_0 with an underscore": lambda: _text("omega_0_first", "1_0"),
    "omega_0 with a space": lambda: _text("omega_0_first", " 3.0"),
    "omega_0 in hexadecimal": lambda: _text("omega_0_hidden", "0x1p+0"),
}
"""Files that are refused, by what is wrong with them."""


LARGEST, SCALE = 1e12, 1e18
"""Largest parameter (DEN-1) and scale (DAT-2)."""

AT_LIMITS: Mapping[str, Callable[[], bytes]] = {
    "scales at their upper limits": lambda: _scales(
        exposure_stops=64, depth_scale=SCALE, position_scale=SCALE, position_center=[SCALE, -SCALE, 0]
    ),
    "scales at their lower limits": lambda: _scales(
        exposure_stops=-64, depth_scale=1 / SCALE, position_scale=1 / SCALE
    ),
    "omega_0 at its limit": lambda: _text("omega_0_first", "1e12"),
    "omega_0 of hidden layers at its limit": lambda: _text("omega_0_hidden", "1000000000000.0"),
    "the largest parameter": lambda: _number(-999999995904.0),
    "a window of one pixel, seven features": lambda: file_of(
        replace(
            MODEL,
            siren=siren.init([16, 5, 4, 3, 3], 3.0, 1.0, seed=7, dtype=np.float32),
            features=("unshadowed", "direction", "position", "depth", "normal", "albedo")[:6],
            window=Window(1, "zero"),
        )
    ),
}
"""Files that are just allowed."""

BEYOND: Mapping[str, Callable[[], bytes]] = {
    "exposure_stops beyond 64": lambda: _scales(exposure_stops=64.0000001),
    "exposure_stops below -64": lambda: _scales(exposure_stops=-64.0000001),
    "a depth_scale beyond 1e18": lambda: _scales(depth_scale=1.0000001e18),
    "a depth_scale below 1e-18": lambda: _scales(depth_scale=0.9999999e-18),
    "a position_scale below 1e-18": lambda: _scales(position_scale=0.9999999e-18),
    "a negative position_scale": lambda: _scales(position_scale=-1.0),
    "a position_center beyond 1e18": lambda: _scales(position_center=[0, 0, -1.0000001e18]),
    "a position_center of two numbers": lambda: _scales(position_center=[0, 0]),
    "a position_center of four numbers": lambda: _scales(position_center=[0, 0, 0, 0]),
    "omega_0 of hidden layers of 0": lambda: _text("omega_0_hidden", "0"),
    "omega_0 below 0": lambda: _text("omega_0_first", "-3.0"),
    "omega_0 beyond 1e12": lambda: _text("omega_0_first", "1.0000001e12"),
    "omega_0 of hidden layers beyond 1e12": lambda: _text("omega_0_hidden", "1.0000001e12"),
    "a parameter beyond 1e12": lambda: _number(1000000061440.0),
    "a parameter below -1e12": lambda: _number(-1000000061440.0),
    "layers of which the second takes too many": lambda: file_of_unchecked([27, 4, 3], more=1),
    "biases of two axes": lambda: _tensor("layer0.bias", shape=[4, 1]),
    "biases of the other axis": lambda: _tensor("layer0.bias", shape=[1, 4]),
    "weights of one axis": lambda: _tensor("layer0.weight", shape=[108]),
    "weights of three axes": lambda: _tensor("layer0.weight", shape=[4, 27, 1]),
    "weights of other widths": lambda: _tensor("layer0.weight", shape=[27, 4]),
    "a window of 65 pixels": lambda: _text("window", '{"border": "clamp", "size": 65}'),
    "a window of true pixels": lambda: _text("window", '{"border": "clamp", "size": true}'),
    "a border that is a number": lambda: _text("window", '{"border": 0, "size": 3}'),
    "a window that is a list": lambda: _text("window", '["clamp", 3]'),
    "features that are numbers": lambda: _text("features", "[1]"),
    "features that are an object": lambda: _text("features", '{"color": 1}'),
    "two outputs": lambda: file_of_unchecked([27, 4, 2]),
    "four outputs": lambda: file_of_unchecked([27, 4, 4]),
    "no omega_0_first": lambda: _text("omega_0_first", None),
    "no omega_0_hidden": lambda: _text("omega_0_hidden", None),
    "no window": lambda: _text("window", None),
    "no version": lambda: _text("version", None),
    "no text at all": lambda: _joined(*_without_texts()),
}
"""Files that are just not."""


Tensors = Mapping[str, NDArray[Any]]


def _tensors(model: Model = MODEL) -> dict[str, NDArray[Any]]:
    """Return the tensors of a model by name."""
    pairs = enumerate(zip(model.siren.weights, model.siren.biases, strict=True))
    return {
        f"layer{layer}.{name}": array
        for layer, arrays in pairs
        for name, array in zip(("weight", "bias"), arrays, strict=True)
    }


def _made_of(tensors: Tensors) -> bytes:
    """Return the file with these tensors in place of its own, one after another."""
    header, data = {"__metadata__": _parts(file_of(MODEL))[0]["__metadata__"]}, b""
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


def _with(name: str, array: Any = MODEL.siren.weights[1]) -> bytes:
    """Return the file with one tensor more."""
    return _made_of({**_tensors(), name: array})


LATER_GOOD: Mapping[str, Callable[[], bytes]] = {
    "twelve layers: layer10 comes after layer9": lambda: file_of(
        replace(MODEL, siren=siren.init([27, *range(2, 13), 3], 3.0, 1.0, seed=9, dtype=np.float32))
    ),
    "tensors in the order of their layers": lambda: _made_of(_tensors()),
    "tensors in the other order": lambda: _made_of(dict(reversed(_tensors().items()))),
    "a tensor that is not known": lambda: _with("layer0.scale"),
    "biases of a layer that is not there": lambda: _with("layer2.bias", MODEL.siren.biases[1]),
    "a name that is longer than .weight": lambda: _with("layer2.weights"),
    "the activation, which is the sine": lambda: _text("activation", "sine"),
    "omega_0 with a point and an exponent": lambda: _text("omega_0_first", "0.25e+1"),
}
"""Files that are read, which came later."""

LATER_BAD: Mapping[str, Callable[[], bytes]] = {
    "weights in float32, biases in float64": lambda: _doubled("bias"),
    "weights in float64, biases in float32": lambda: _doubled("weight"),
    "the first layer in float64, the last in float32": lambda: _doubled("layer0"),
    "the last layer in float64, the first in float32": lambda: _doubled("layer1"),
    "one tensor in float64": lambda: _doubled("layer1.bias"),
    "weights of another name": lambda: _with("extra.weight"),
    "weights of no name": lambda: _with(".weight"),
    "weights of a layer with a zero before its number": lambda: _with("layer01.weight"),
    "weights of a layer more, without its biases": lambda: _with("layer2.weight"),
    "weights of a layer that is not the next": lambda: _made_of(
        {**_tensors(), "layer3.weight": MODEL.siren.weights[1], "layer3.bias": MODEL.siren.biases[1]}
    ),
    "layers that begin with 1": lambda: _made_of(
        {f"layer{int(name[5]) + 1}{name[6:]}": array for name, array in _tensors().items()}
    ),
    "no tensor": lambda: _made_of({}),
    "names in capitals": lambda: _made_of({name.upper(): array for name, array in _tensors().items()}),
    "an activation that is not the sine": lambda: _text("activation", "relu"),
    "a letter after the end of a text": lambda: _text("features", '["color"]\0'),
    **{
        f"omega_0 = {text!a}": lambda text=text: _text("omega_0_first", text)  # type: ignore[misc]
        for text in (
            "",
            "+3.0",
            "3.",
            ".5",
            "03.0",
            "3.0\n",
            "3.0\0",
            "3,0",
            "3.0f",
            "1e",
            "inf",
            "-0",
            "1e400",
        )
    },
    **{
        f"a window of {text} pixels": lambda text=text: _text(  # type: ignore[misc]
            "window", f'{{"border": "clamp", "size": {text}}}'
        )
        for text in ("3e0", "null", '"3"', "[3]", "-3")
    },
}
"""Files that are refused, which came later."""

LATER_RULES = {
    "float64": "MOD-2", "activation": "MOD-6", "window of": "DAT-9", "omega_0 = '-0'": "MOD-6",
    "omega_0": "MOD-2", "letter": "RDG-2",
}  # fmt: skip
"""Clauses of those, by what a note says of them."""


EVERY_TYPE = {
    "BOOL": 1, "U8": 1, "I8": 1, "F8_E5M2": 1, "F8_E4M3": 1, "U16": 2, "I16": 2, "F16": 2, "BF16": 2,
    "U32": 4, "I32": 4, "F32": 4, "U64": 8, "I64": 8, "F64": 8,
}  # fmt: skip
"""The types of tensors, with their size in bytes (MOD-1)."""


def _beside(*entries: Mapping[str, Any]) -> bytes:
    """Return the file with tensors more, which are ignored: of each its shape, and its type if not U8."""
    header, data = _parts(file_of(MODEL))
    for number, entry in enumerate(entries):
        size = math.prod(entry["shape"]) * EVERY_TYPE[entry.get("dtype", "U8")]
        span = {"data_offsets": [len(data), len(data) + size]}
        header[f"more{number}"] = {"dtype": "U8", **entry, **span}
        data += bytes(size)
    return _joined(header, data)


def _odd(size: int = 6, **entry: Any) -> bytes:
    """Return the file with a tensor more of 6 bytes in 2 rows, whose entry is changed, ... being left out."""
    header, data = _parts(file_of(MODEL))
    made = {"dtype": "U8", "shape": [2, 3], "data_offsets": [len(data), len(data) + size], **entry}
    header["more"] = {key: value for key, value in made.items() if value is not ...}
    return _joined(header, data + bytes(size))


def _header(before: bytes = b"", after: bytes = b"", texts: Any = None) -> bytes:
    """Return the file with bytes before and after the header's object, or with other texts."""
    header, data = _parts(file_of(MODEL))
    if texts is not None:
        header["__metadata__"] = texts
    return _joined(before + json.dumps(header).encode() + after, data)


def _other_biases(count: int) -> bytes:
    """Return the file with another number of biases in the first layer."""
    return _made_of({**_tensors(), "layer0.bias": np.full(count, 0.5, np.float32)})


ENTRY_GOOD: Mapping[str, Callable[[], bytes]] = {
    **{
        f"a tensor of {dtype} that is not known": lambda dtype=dtype: _beside(  # type: ignore[misc]
            {"dtype": dtype, "shape": [3]}
        )
        for dtype in EVERY_TYPE
    },
    "tensors that are not known: a number, and none": lambda: _beside(
        {"shape": []}, {"shape": [2, 0]}, {"shape": [1]}
    ),
    "a header that ends in every white space": lambda: _header(after=b" \t\r\n"),
}
"""Containers that are read: what they have beside the model is ignored (MOD-1)."""

ENTRY_BAD: Mapping[str, Callable[[], bytes]] = {
    "a byte order mark before the header": lambda: _header(b"\xef\xbb\xbf"),
    "a space before the header": lambda: _header(b" "),
    "a line end before the header": lambda: _header(b"\n"),
    "a zero after the header": lambda: _header(after=b"\0"),
    "texts in a list": lambda: _header(texts=["format"]),
    "a number among the texts": lambda: _header(texts={**_parts(file_of(MODEL))[0]["__metadata__"], "n": 1}),
    "two sides below 0": lambda: _odd(shape=[-2, -3]),
    "a side below 0, none beside it": lambda: _odd(0, shape=[-2, 0]),
    "a side with a point": lambda: _odd(shape=[2.0, 3]),
    "a side as text": lambda: _odd(shape=["2", 3]),
    "a side that is true": lambda: _odd(shape=[True, 6]),
    "a side that is null": lambda: _odd(shape=[None, 6]),
    "sides in a list of lists": lambda: _odd(shape=[[2, 3]]),
    "a shape that is a number": lambda: _odd(shape=6),
    "no shape": lambda: _odd(shape=...),
    "no type": lambda: _odd(dtype=...),
    "no offsets": lambda: _odd(data_offsets=...),
    "a type that is a number": lambda: _odd(dtype=8),
    "a type in small letters": lambda: _odd(dtype="u8"),
    "a type that is not known, of a tensor that is not": lambda: _odd(dtype="F4"),
    "a key too many in an entry": lambda: _odd(strides=[3, 1]),
    "an entry that is a list": lambda: _entry(["U8", [0], [0, 0]]),
    "an entry that is null": lambda: _entry(None),
    "one offset": lambda: _odd(data_offsets=[496]),
    "three offsets": lambda: _odd(data_offsets=[0, 6, 6]),
    "offsets with a point": lambda: _offsets(float),
    "offsets as text": lambda: _offsets(str),
    "fewer bytes than numbers": lambda: _odd(5),
    "more bytes than numbers": lambda: _odd(7),
    "a byte after the last tensor": lambda: file_of(MODEL) + b"\0",
    "a bias too many": lambda: _other_biases(5),
    "a bias too few": lambda: _other_biases(3),
}
"""Containers that are refused, whatever is wrong with them being in an entry that no model needs."""


def _entry(value: Any) -> bytes:
    """Return the file with an entry of another kind."""
    header, data = _parts(file_of(MODEL))
    return _joined({**header, "more": value}, data)


def _offsets(form: Callable[[int], Any]) -> bytes:
    """Return the file with the offsets of a tensor more in another form."""
    end = len(_parts(file_of(MODEL))[1])
    return _odd(data_offsets=[form(end), form(end + 6)])


GOVERNING = {
    "scale": "MOD-6", "position_center": "MOD-6", "exposure_stops": "MOD-6", "pixel": "DAT-9",
    "parameter": "MOD-6", "omega_0 ": "MOD-6", "biases": "DEN-1", "weights": "DEN-1", "outputs": "DEN-1",
    "layers of": "DEN-1",
}  # fmt: skip
"""Clauses of what is at its limit, by what a note says of it."""


def file_of_unchecked(widths: list[int], more: int = 0) -> bytes:
    """Return the file with tensors of other widths, which the writer would refuse."""
    made = siren.init(widths, 3.0, 1.0, seed=8, dtype=np.float32)
    header, data = {"__metadata__": _parts(file_of(MODEL))[0]["__metadata__"]}, b""
    for layer, arrays in enumerate(zip(made.weights, made.biases, strict=True)):
        wider = (np.pad(arrays[0], ((0, 0), (0, more * layer))), arrays[1])
        for name, array in zip(("weight", "bias"), wider, strict=True):
            span = [len(data), len(data) + array.nbytes]
            header[f"layer{layer}.{name}"] = {
                "dtype": "F32",
                "shape": list(array.shape),
                "data_offsets": span,
            }
            data += array.astype("<f4").tobytes()
    return _joined(header, data)


def _model_cases() -> list[Case]:
    """Return good and bad files."""
    cases: list[Case] = []
    good = {**GOOD, **AT_LIMITS}
    for note, content in [*GOOD.items(), *BAD.items(), *AT_LIMITS.items(), *BEYOND.items()]:
        later = note in AT_LIMITS or note in BEYOND
        inputs = {"content": base64.b64encode(content()).decode()}
        expected = {name: Output(value) for name, value in _model(inputs).items()} if note in good else None
        clause = "MOD-2" if note in good else "MOD-6"
        clause = (
            next((known for part, known in GOVERNING.items() if part in note), clause) if later else clause
        )
        refusal = "" if note not in good else "DAT-1" if "features" in note else "MOD-6"
        cases.append(Case(f"file.model/{len(cases)}", clause, inputs, expected, (), note, refusal))
    for note, content in [*LATER_GOOD.items(), *LATER_BAD.items()]:
        inputs, read = {"content": base64.b64encode(content()).decode()}, note in LATER_GOOD
        expected = {name: Output(value) for name, value in _model(inputs).items()} if read else None
        otherwise = "MOD-2" if read else "MOD-6"
        clause = next((known for part, known in LATER_RULES.items() if part in note), otherwise)
        refusal = "MOD-6" if read else ""
        cases.append(Case(f"file.model/{len(cases)}", clause, inputs, expected, (), note, refusal))
    for note, content in [*ENTRY_GOOD.items(), *ENTRY_BAD.items()]:
        inputs, read = {"content": base64.b64encode(content()).decode()}, note in ENTRY_GOOD
        expected = {name: Output(value) for name, value in _model(inputs).items()} if read else None
        clause = "SIR-1" if "a bias" in note else "MOD-1"
        cases.append(Case(f"file.model/{len(cases)}", clause, inputs, expected, (), note, "MOD-1" * read))
    return cases


KINDS = (
    Kind(
        "file.model",
        "Model files",
        {"content": "text, the file's bytes in base64"},
        {
            "digest": "text, SHA-256 in hexadecimal of all parameters as little-endian float64: "
            "layer by layer, weights in C order, then biases",
            "widths": "integer[L + 1]",
            "features": "text, names with commas",
            "window": "integer, its size",
            "border": "text",
            "omega_0": "float[2]: first layer, others",
        },
        _model_cases,
        _model,
    ),
)
"""The kinds of this module."""
