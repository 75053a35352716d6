"""The peers that `wamnet bench` measures: the denoisers beside its own, renderers, and makers of pictures.

Each peer has a separate file `peer_*.py`; a new one is a file and a line here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from wamnet.kernels.bench.contenders import Contender
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.transport import Settings

from . import (
    peer_halide,
    peer_mitsuba,
    peer_oidn,
    peer_onnxruntime,
    peer_openvino,
    peer_tinygrad,
    peer_torch,
)
from .common import Maker
from .moving import MitsubaOidn
from .peer_cycles import Cycles

contenders: tuple[Contender, ...] = (
    *peer_torch.CONTENDERS,
    *peer_onnxruntime.CONTENDERS,
    *peer_openvino.CONTENDERS,
    *peer_tinygrad.CONTENDERS,
    *peer_halide.CONTENDERS,
    *peer_oidn.CONTENDERS,
)
Renderer = Callable[[Scene, int, int, Settings], Callable[[int, int], Any]]
"""From a scene, width, height and settings to what renders it, by the number of samples and a seed."""

renderers: Mapping[str, Renderer] = {"mitsuba": peer_mitsuba.renderer}
makers: Mapping[str, Callable[[Scene, int], Maker]] = {"mitsuba": MitsubaOidn, "cycles": Cycles}
