"""Models and checkpoints as files: safetensors with the facts about them in the header.

1. A file holds named tensors and, in its header, named texts; the text `format` says which kind of file it is
   and `version` how to read it [`save_model`], [`save_checkpoint`].
2. The same content gives the same bytes: the header is written with sorted keys [`_encode`]. The safetensors
   library writes its metadata in the order of a hash table, so it only reads here.
3. A file appears under its name when it is complete [`_write`, writing.py].
4. Nothing in a file is believed: what is missing, of another kind, too large, not finite or not fitting is
   refused with one line [`load_model`], [`load_checkpoint`].

The format of the container is safetensors' own: 8 bytes of header length, little-endian; a JSON header,
padded with spaces to a multiple of 8; the tensors' bytes. Versions of the library differ in what they take:
entries and types are checked here too [`_check_entry`].
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError, deserialize

from ..refimpl.errors import InputError
from ..refimpl.network import train
from ..refimpl.network.activation import SINE, activation_named
from ..refimpl.network.dataset import Normalization, normalization_from_json
from ..refimpl.network.denoise import Model, check_model
from ..refimpl.network.imported import Imported, Source, Step
from ..refimpl.network.siren import Siren
from ..refimpl.network.train import TrainState
from ..refimpl.network.whole import Whole
from ..refimpl.network.window import Window
from ..refimpl.reading import BROKEN, parse_json, read_file, to_value
from .writing import write_bytes

Tensors = Mapping[str, NDArray[Any]]
Texts = Mapping[str, str]

MODEL_FORMAT = "wamnet-model"
"""Value of the header's text `format` in a model file."""

CHECKPOINT_FORMAT = "wamnet-checkpoint"
"""Value of the header's text `format` in a checkpoint file."""

VERSION = "1"
"""Value of the header's text `version`; it changes when older readers would misread the file."""

ACTIVATION_VERSION = "2"
"""Version of models that name their activation, which readers of version 1 take to be the sine."""

WHOLE_VERSION = "3"
"""Version of models of integers."""

IMPORTED_VERSION = "4"
"""Version of networks that were imported."""

INFO_PREFIX = "info."
"""Put before the names of a model's own facts in the header, so that they cannot hide a field."""

WHOLE_TEXTS = ("amplitude", "fraction")
"""Fields of a network of integers that are texts of the header."""

_WHOLE = re.compile(r"-?(0|[1-9][0-9]*)")
"""An integer in a text (MOD-2)."""

_DECIMAL = re.compile(_WHOLE.pattern + r"(\.[0-9]+)?([eE][+-]?[0-9]+)?")
"""A decimal number in a text (MOD-2)."""

_DTYPES = {"float32": "F32", "float64": "F64", "int64": "I64", "int32": "I32", "int8": "I8"}
"""Element types that are written, by NumPy's name, as safetensors names them."""

_TYPES = {
    "BOOL": "?", "U8": "u1", "I8": "i1", "F8_E5M2": "V1", "F8_E4M3": "V1",
    "U16": "<u2", "I16": "<i2", "F16": "<f2", "BF16": "V2",
    "U32": "<u4", "I32": "<i4", "F32": "<f4", "U64": "<u8", "I64": "<i8", "F64": "<f8",
}  # fmt: skip
"""Element types that a file may have, as NumPy reads them; of those that NumPy lacks, only the size."""

_ENTRY = {"dtype", "shape", "data_offsets"}
"""Keys of a tensor in the header."""


def save_model(path: str | os.PathLike[str], model: Model) -> None:
    """Write a model that [`load_model`] reads back to the same bits."""
    check_model(model)
    _write(Path(path), model_bytes(model))


def model_bytes(model: Model) -> bytes:
    """Return a model as the content of its file, the same for equal models."""
    tensors: dict[str, NDArray[Any]] = {}
    for layer, (weight, bias) in enumerate(zip(model.siren.weights, model.siren.biases, strict=True)):
        tensors[f"layer{layer}.weight"], tensors[f"layer{layer}.bias"] = weight, bias
    if isinstance(model.siren, Whole):
        tensors = {n: a.astype(np.int8 if n.endswith("weight") else np.int32) for n, a in tensors.items()}
        factors = enumerate(model.siren.factors)
        tensors |= {f"layer{layer}.factor": factor.astype(np.int32) for layer, factor in factors}
    texts = {
        "window": json.dumps(asdict(model.window), sort_keys=True),
        **{INFO_PREFIX + name: text for name, text in model.info.items()},
    }
    if isinstance(model.siren, Imported):
        ends = (model.siren.low, model.siren.high)
        texts |= {
            "images": json.dumps([asdict(source) for source in model.siren.sources], sort_keys=True),
            "steps": json.dumps([asdict(step) for step in model.siren.steps], sort_keys=True),
            "clip": json.dumps([end if math.isfinite(end) else None for end in ends]),
            "version": IMPORTED_VERSION,
        }
        return _encode(MODEL_FORMAT, tensors, texts)
    texts |= {
        "features": json.dumps(model.features),
        "omega_0_first": repr(model.siren.omega_0_first),
        "omega_0_hidden": repr(model.siren.omega_0_hidden),
        "normalization": json.dumps(asdict(model.normalization), sort_keys=True),
    }
    if isinstance(model.siren, Whole):
        texts |= {name: repr(getattr(model.siren, name)) for name in WHOLE_TEXTS} | {"version": WHOLE_VERSION}
    if model.siren.activation != SINE:
        texts |= {"activation": model.siren.activation, "version": ACTIVATION_VERSION}
    return _encode(MODEL_FORMAT, tensors, texts)


def load_model(path: str | os.PathLike[str]) -> Model:
    """Read a model, or raise InputError that says what is wrong with the file."""
    path = Path(path)
    versions = (VERSION, ACTIVATION_VERSION, WHOLE_VERSION, IMPORTED_VERSION)
    tensors, texts = _read(path, MODEL_FORMAT, versions)
    window = _value(path, texts, "window", Window)
    info = {
        name.removeprefix(INFO_PREFIX): text
        for name, text in sorted(texts.items())
        if name.startswith(INFO_PREFIX)
    }
    if texts["version"] == IMPORTED_VERSION:
        weights, biases = _layers(path, tensors)
        sources = _value(path, texts, "images", tuple[Source, ...])
        steps = _value(path, texts, "steps", tuple[Step, ...])
        low, high = _value(path, texts, "clip", tuple[float | None, float | None])
        ends = -math.inf if low is None else low, math.inf if high is None else high
        network = Imported(weights, biases, 1.0, 1.0, SINE, steps, *ends, sources)
        model = imported_model(network, window, info)
    else:
        model = Model(
            siren=_network(path, tensors, texts),
            features=_value(path, texts, "features", tuple[str, ...]),
            window=window,
            normalization=_parsed(path, texts, "normalization", normalization_from_json),
            info=info,
        )
    _check(path, check_model, model)
    return model


def imported_model(network: Imported, window: Window, info: Texts) -> Model:
    """Return the model of an imported network, whose features are its images."""
    return Model(network, tuple(source.name for source in network.sources), window, Normalization(), info)


def _layers(path: Path, tensors: Tensors) -> tuple[tuple[NDArray[Any], ...], tuple[NDArray[Any], ...]]:
    """Return weights and biases of all layers."""
    layers = range(max(sum(name.endswith(".weight") for name in tensors), 1))
    weights, biases = (
        tuple(_tensor(path, tensors, f"layer{layer}.{name}") for layer in layers)
        for name in ("weight", "bias")
    )
    return weights, biases


def _network(path: Path, tensors: Tensors, texts: Texts) -> Siren:
    """Return the network of a model file."""
    weights, biases = _layers(path, tensors)
    first, hidden = (_parsed(path, texts, name, _decimal) for name in ("omega_0_first", "omega_0_hidden"))
    omegas = first, hidden
    if texts.get("version") != WHOLE_VERSION:
        return Siren(weights, biases, *omegas, _activation(path, texts))
    factors = tuple(_tensor(path, tensors, f"layer{layer}.factor") for layer in range(len(weights)))
    for array in (*weights, *biases, *factors):
        if array.dtype.kind != "i":
            rule = "a model of integers has tensors of I8 and I32"
            raise InputError(f"{path}: type of a tensor", str(array.dtype), rule, "round the model again")
    held = (tuple(array.astype(np.float32) for array in some) for some in (weights, biases, factors))
    kept, shifts, scales = held
    fields = (_parsed(path, texts, name, _whole) for name in WHOLE_TEXTS)
    return Whole(kept, shifts, *omegas, SINE, scales, *fields)


def save_checkpoint(path: str | os.PathLike[str], state: TrainState) -> None:
    """Write a state of training that [`load_checkpoint`] reads back to the same bits."""
    tensors, texts = train.state_to_arrays(state)
    _write(Path(path), _encode(CHECKPOINT_FORMAT, tensors, texts))


def load_checkpoint(path: str | os.PathLike[str]) -> TrainState:
    """Read a state of training, or raise InputError that says what is wrong with the file."""
    path = Path(path)
    tensors, texts = _read(path, CHECKPOINT_FORMAT)
    try:
        state = train.state_from_arrays(tensors, texts)
    except KeyError as error:
        what = f"{path}: list of entries"
        rule = f"{error.args[0]!r} must be among them"
        raise InputError(what, ", ".join(sorted({*tensors, *texts})), rule, "start a new run") from None
    except BROKEN as error:
        raise _inside(path, error) from None
    _check(path, train.check_state, state)
    return state


def _encode(kind: str, tensors: Tensors, texts: Texts) -> bytes:
    """Return the file's bytes: header with sorted keys, then the tensors in the order of their names."""
    header: dict[str, Any] = {"__metadata__": {"format": kind, "version": VERSION, **texts}}
    data, end = [], 0
    # Eight-byte elements first: every tensor then starts at a multiple of its element's size.
    for name in sorted(tensors, key=lambda name: (-tensors[name].dtype.itemsize, name)):
        values = np.ascontiguousarray(tensors[name])
        raw = values.astype(values.dtype.newbyteorder("<")).tobytes()
        span = [end, end + len(raw)]
        header[name] = {"dtype": _DTYPES[values.dtype.name], "shape": values.shape, "data_offsets": span}
        data.append(raw)
        end += len(raw)
    text = json.dumps(header, sort_keys=True, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)
    return b"".join([len(text).to_bytes(8, "little"), text, *data])


def _write(path: Path, content: bytes) -> None:
    """Give `path` the content, whole or not at all."""
    try:
        write_bytes(path, content)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError("output file", str(path), f"cannot be written: {reason}", "choose another") from None


def _read(
    path: Path, kind: str, versions: Sequence[str] = (VERSION,)
) -> tuple[dict[str, NDArray[Any]], dict[str, str]]:
    """Return tensors and texts of a file of this kind and one of these versions."""
    content = read_file(path, f"{kind} file")
    way_out = "write it with `wamnet train`"
    try:
        found = deserialize(content)  # type: ignore[no-untyped-call]
    except (SafetensorError, *BROKEN) as error:
        raise InputError(f"{kind} file", str(path), f"is not a safetensors file: {error}", way_out) from None
    texts = _header_texts(path, content)
    tensors = {
        name: np.frombuffer(entry["data"], _TYPES[entry["dtype"]]).reshape(entry["shape"])
        for name, entry in found
    }
    if (given := texts.get("format", "missing")) != kind:
        raise InputError(f"{path}: format", given, f"must be {kind}", "give a file that wamnet wrote")
    if (version := texts.get("version", "missing")) not in versions:
        rule = f"this program reads version {' and '.join(versions)}"
        raise InputError(f"{path}: version", version, rule, "use the wamnet version that wrote it")
    return tensors, texts


def _header_texts(path: Path, content: bytes) -> dict[str, str]:
    """Return the header's texts; the library has found the header sound, but keeps them to itself."""
    length, way_out = int.from_bytes(content[:8], "little"), "write it with `wamnet train`"
    text = content[8 : 8 + length]
    if not text.startswith(b"{"):
        raise InputError(f"{path}: header", text[:20], "its first byte must be {", way_out)
    header = parse_json(text, f"{path}: header", way_out)
    texts: dict[str, str] = header.pop("__metadata__", None) or {}
    for name, entry in header.items():
        what = f"{path}: header: {name}"
        if not isinstance(entry, dict) or set(entry) != _ENTRY:
            rule = f"must be an object with the keys {', '.join(sorted(_ENTRY))} and no others"
            raise InputError(what, entry, rule, way_out)
        if entry["dtype"] not in _TYPES:
            raise InputError(f"{what}.dtype", entry["dtype"], f"must be one of {', '.join(_TYPES)}", way_out)
    return texts


def _tensor(path: Path, tensors: Tensors, name: str) -> NDArray[Any]:
    """Return a tensor, or say that it is missing."""
    if name not in tensors:
        present = ", ".join(sorted(tensors)) or "empty"
        raise InputError(f"{path}: list of tensors", present, f"{name!r} must be among them", "train again")
    return tensors[name]


def _parsed(path: Path, texts: Texts, name: str, parse: Callable[[str], Any]) -> Any:
    """Return the header's text `name` as `parse` reads it, or say that it is missing or unreadable."""
    if name not in texts:
        present = ", ".join(sorted(texts))
        raise InputError(
            f"{path}: list of header entries", present, f"{name!r} must be among them", "train again"
        )
    try:
        return parse(texts[name])
    except InputError as error:
        raise _inside(path, error) from None
    except BROKEN as error:
        raise InputError(f"{path}: {name}", texts[name], f"cannot be read: {error}", "train again") from None


def _value(path: Path, texts: Texts, name: str, hint: Any) -> Any:
    """Return the header's text `name`, which is JSON, as an annotation asks for."""
    return _parsed(path, texts, name, lambda text: to_value(hint, text, name, "train or import it again"))


def _activation(path: Path, texts: Texts) -> str:
    """Return the name of the activation; files of version 1 have the sine."""
    if texts["version"] == VERSION:
        name = texts.get("activation", SINE)
        if name != SINE:
            rule = f"a model of version {VERSION} has the {SINE}"
            raise InputError(f"{path}: activation", name, rule, "train again")
        return name
    return str(_parsed(path, texts, "activation", lambda name: activation_named(name).name))


def _decimal(text: str) -> float:
    """Return a number as JSON writes it; Python would also take spaces, underscores and words."""
    if not _DECIMAL.fullmatch(text):
        raise ValueError("a decimal number is needed")
    return float(text)


def _whole(text: str) -> int:
    """Return an integer as JSON writes it."""
    if not _WHOLE.fullmatch(text):
        raise ValueError("a decimal integer is needed")
    return int(text)


def _check(path: Path, check: Callable[[Any], None], content: Any) -> None:
    """Run a check of the reference, and name the file in what it refuses."""
    try:
        check(content)
    except InputError as error:
        raise _inside(path, error) from None


def _inside(path: Path, error: Exception) -> InputError:
    """Return the error with the file's name before the thing that it names."""
    if isinstance(error, InputError):
        return InputError(f"{path}: {error.what}", error.value, error.rule, error.way_out)
    return InputError(f"{path}: content", str(error), "cannot be read", "start a new run")
