"""Reading what commands are given, with errors that name the file and fit the command."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..refimpl.errors import InputError

if TYPE_CHECKING:
    from ..refimpl.denoise import Model
    from ..refimpl.frame import Frame

CHECKPOINT_MARK = ".checkpoint"
"""Before the suffix of a model's name in the name of its checkpoint."""


def check_input(path: Path) -> None:
    """Refuse an input that is no file."""
    if path.is_dir():
        raise InputError("input file", str(path), "it is a folder", "give the name of a file in it")
    if not path.is_file():
        raise InputError("input file", str(path), "it does not exist", "check the name")


def load_model(path: Path) -> Model:
    """Read a model; a checkpoint is refused with the name of the model that belongs to it."""
    from ..compiler import model_file

    try:
        return model_file.load_model(path)
    except InputError as error:
        if error.value != model_file.CHECKPOINT_FORMAT:
            raise
    name = path.name.replace(CHECKPOINT_MARK + path.suffix, path.suffix)
    way_out = f"give the model beside it: {path.with_name(name)}" if name != path.name else "give the model"
    raise InputError("model file", str(path), "it is a checkpoint of training, not a model", way_out)


def need_layers(path: Path, frame: Frame, features: Sequence[str], because: str, way_out: str) -> None:
    """Refuse the frame in `path` if it lacks a layer that one of the features needs."""
    from ..refimpl.dataset import FEATURES

    # Unknown features are refused where they come from.
    for layer in (FEATURES[name].layer for name in features if name in FEATURES):
        if layer not in frame.layers:
            rule = f"{layer} must be among them, because {because}"
            raise InputError(f"{path}: list of layers", ", ".join(frame.layers), rule, way_out)
