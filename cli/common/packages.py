"""Optional packages: imported when they are needed, and a plain sentence when they are not there."""

import importlib
from typing import Any

from ...models.writing import signals_wait
from ...refimpl.errors import InputError


def need(module: str, purpose: str, package: str = "'wamnet[full]'") -> Any:
    """Import an optional module, or say what needs it and which package brings it."""
    try:
        with signals_wait():
            return importlib.import_module(module)
    except ImportError:
        rule = f"missing, and needed {purpose}"
        raise InputError("Python package", module, rule, f"install it: pip install {package}") from None
