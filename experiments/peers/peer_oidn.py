"""Intel Open Image Denoise as a peer: another denoiser, made for all scenes, with a quality and no error.

1. It is given linear colour, albedo and normal [`filtered`]; in the benchmark these two have no noise
   ("clean").
2. For pictures of one size, one after another, a filter is kept with its memory: what it prepares once it
   does not prepare for each [`Kept`].
3. Noisy albedo and normals are denoised first, each by the filter itself, and are then declared clean
   [`prefiltered`]: its documentation recommends that for the best quality.

Source: its documentation, filter `RT`, images `color`, `albedo`, `normal` and `output`, parameters `hdr`,
`cleanAux` and `quality`, section "Prefiltering".
"""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wamnet.kernels.bench.contenders import Opened, Tools
from wamnet.kernels.bench.workload import Given
from wamnet.refimpl.encoding import to_display
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network.denoise import Model

from .common import Peer, told_as_missing

LAYERS = ("color", "albedo", "normal")
"""Layers that it is given, in the order of its arguments."""


def filtered(
    color: Frame, aux: Frame | None = None, clean: bool = False, quality: str = "high"
) -> NDArray[np.float32]:
    """Return the denoised radiance (H, W, 3) of a frame's colour; `aux` is where albedo and normal come from.

    `clean`: albedo and normal have no noise, and are not smoothed.
    """
    with told_as_missing("pyoidn"):
        import pyoidn
    frames = [color] if aux is None else [color, aux, aux]
    images = [
        np.ascontiguousarray(frame[name], np.float32) for frame, name in zip(frames, LAYERS, strict=False)
    ]
    found: NDArray[np.float32] = pyoidn.denoise(*images, hdr=True, clean_aux=clean, quality=quality)
    return found


def prefiltered(frame: Frame, quality: str = "high") -> Frame:
    """Return albedo and normal (H, W, 3) of a frame, each denoised without the help of another layer."""
    return Frame({name: _alone(name, frame[name], quality) for name in LAYERS[1:]}, frame.info)


def _alone(name: str, image: NDArray[np.float32], quality: str) -> NDArray[np.float32]:
    """Return one auxiliary image (H, W, 3), denoised; the package's short call wants a colour, so not it."""
    with told_as_missing("pyoidn"):
        import pyoidn
    noisy = np.ascontiguousarray(image, np.float32)
    made, device = np.empty_like(noisy), _device()
    with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as it:
        it.set_image(name, noisy, pyoidn.OIDN_FORMAT_FLOAT3)
        it.set_image(pyoidn.OIDN_IMAGE_OUTPUT, made, pyoidn.OIDN_FORMAT_FLOAT3)
        it.set_quality(getattr(pyoidn, f"OIDN_QUALITY_{quality.upper()}"))
        it.commit()
        it.execute()
    if (told := device.get_error()) is not None:
        raise InputError(f"{name} for Open Image Denoise", noisy.shape, f"it says: {told}", "check the frame")
    return made


class Kept:
    """A filter for pictures (height, width), with memory of its own: what a program keeps that shows many."""

    def __init__(self, size: tuple[int, int], quality: str = "high", clean: bool = False) -> None:
        """Make the filter ready; `clean` as in [`filtered`]."""
        with told_as_missing("pyoidn"):
            import pyoidn
        self._images = {name: np.zeros((*size, 3), np.float32) for name in (*LAYERS, "output")}
        self._device = _device()
        self._filter = pyoidn.Filter(self._device, pyoidn.OIDN_FILTER_TYPE_RT)
        for name, image in self._images.items():
            self._filter.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
        self._filter.set_bool("hdr", True)
        self._filter.set_bool("cleanAux", clean)
        self._filter.set_quality(getattr(pyoidn, f"OIDN_QUALITY_{quality.upper()}"))
        self._filter.commit()

    def __call__(self, frame: Frame) -> NDArray[np.float32]:
        """Return the denoised radiance (H, W, 3) of a frame; the next call writes over it."""
        for name in LAYERS:
            np.copyto(self._images[name], frame[name])
        self._filter.execute()
        if (told := self._device.get_error()) is not None:
            shape = self._images["color"].shape
            raise InputError("frame for Open Image Denoise", shape, f"it says: {told}", "check the frame")
        return self._images["output"]

    def close(self) -> None:
        """Give the filter back."""
        self._filter.release()


@cache
def _device() -> Any:
    """Return its CPU device, which stays open."""
    import pyoidn

    device = pyoidn.Device()
    device.commit()
    return device


def _open(quality: str, tools: Tools, model: Model, size: int) -> Opened:
    """Return its filter with a quality."""
    with told_as_missing("pyoidn"):
        import pyoidn  # noqa: F401

    def run(given: Given) -> NDArray[np.float32]:
        return filtered(given.frame, given.frame, True, quality)

    stops = model.normalization.exposure_stops
    return Opened(
        run, "Open Image Denoise, CPU device", display=lambda color: np.asarray(to_display(color, stops))
    )


CONTENDERS = tuple(
    Peer(
        f"oidn:{quality}",
        f"Open Image Denoise, quality {quality}; another denoiser",
        partial(_open, quality),
        variant=None,
        packages=("pyoidn",),
    )
    for quality in ("fast", "high")
)
"""Two of its qualities."""
