"""The peers that `wamnet bench` measures: the names of the protocol in kernels/bench/peers.py.

Each peer has a separate file `peer_*.py`; a new one is a file and a line here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from wamnet.kernels.bench.contenders import Contender
from wamnet.kernels.bench.peers import Renderer
from wamnet.kernels.bench.pipelines import Maker
from wamnet.refimpl.light.scene import Scene

from . import (
    peer_halide,
    peer_mitsuba,
    peer_oidn,
    peer_onnxruntime,
    peer_openvino,
    peer_tinygrad,
    peer_torch,
)
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
renderers: Mapping[str, Renderer] = {"mitsuba": peer_mitsuba.renderer}
makers: Mapping[str, Callable[[Scene, int], Maker]] = {"mitsuba": MitsubaOidn, "cycles": Cycles}
trainer = peer_torch.trainer
