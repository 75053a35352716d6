"""A NumPy path tracer and a small neural denoiser, and the compiler that turns both into kernels.

    import wamnet

    model = wamnet.load("minicubes")
    frame = wamnet.render("minicubes", time=2.5, feature_spp=16, shadow_rays=1)
    image = wamnet.denoise(model, frame)

This module is the public interface: its names change only with a line in the changelog. All other modules
of the package are internal. A name is imported when it is first used, so that `import wamnet` takes no time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .api import certify as certify
    from .api import compile as compile  # noqa: A004 - what it does
    from .api import denoise as denoise
    from .api import executors as executors
    from .api import export as export
    from .api import load as load
    from .api import render as render
    from .api import trace as trace
    from .api import train as train
    from .kernel import Certificate as Certificate
    from .kernel import CertificateError as CertificateError
    from .kernel import Function as Function
    from .kernel import Kernel as Kernel
    from .refimpl.errors import WamnetError as WamnetError
    from .refimpl.frame import Frame as Frame
    from .refimpl.network.denoise import Model as Model

    __version__: str

_MODULES = {
    **dict.fromkeys(
        ("certify", "compile", "denoise", "executors", "export", "load", "render", "trace", "train"), "api"
    ),
    **dict.fromkeys(("Certificate", "CertificateError", "Function", "Kernel"), "kernel"),
    "Frame": "refimpl.frame",
    "Model": "refimpl.network.denoise",
    "WamnetError": "refimpl.errors",
}
"""Module of each public name."""

__all__ = ["__version__", *sorted(_MODULES)]  # noqa: PLE0604 - the names of a table


def __getattr__(name: str) -> Any:
    """Import a public name when it is first used."""
    if name == "__version__":
        from importlib.metadata import version

        return version(__name__)
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_MODULES[name]}", __name__), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
