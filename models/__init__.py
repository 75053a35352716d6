"""The bundled models: networks trained on canonical scenes, each with its recipe and its scores as text.

`SHA256SUMS` has their digests; `python experiments/models.py --write models` trains them again.
"""

from pathlib import Path

FOLDER = Path(__file__).parent
"""Folder of the models."""


def names() -> list[str]:
    """Return the names of the bundled models."""
    return sorted(path.stem for path in FOLDER.glob("*.safetensors"))


def path(name: str) -> Path:
    """Return the file of the bundled model of this name, which need not exist."""
    return FOLDER / f"{name}.safetensors"
