"""Peers compute the network's function, within what float32 may do to it; those that are absent say so.

A peer that is not installed is skipped, with the text that the benchmark prints; PyTorch and Open Image
Denoise fail where they are required.
"""

import numpy as np
import pytest
from kit import untrained
from packages import PACKAGES, needed

from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.profiles import SineContract
from wamnet.compiler.plan import analysed
from wamnet.compiler.proof import bounds
from wamnet.kernels.bench import workload
from wamnet.kernels.bench.contenders import Tools
from wamnet.refimpl.errors import ExecutorUnavailable
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.network.denoise import denoise
from wamnet.refimpl.network.window import all_windows, pad
from wamnet_peers import table

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.apart,
    pytest.mark.needs("programs"),
    pytest.mark.filterwarnings("default"),  # warnings of a peer are not faults of the project
]

LIBRARY_SINE = SineContract("4 ulp, as OpenCL asks of a library", 4 * 2.0**-24)
"""A sine of a library: an ulp of a number in [-1, 1] is at most 2^-24, and libraries promise 1 to 4."""

SAME_FUNCTION = [peer for peer in table.contenders if peer.variant]
"""Peers that compute the network."""


def opened(peer, model, size):
    """Return the open peer with its tools, or skip."""
    for package in PACKAGES.keys() & peer.packages:
        needed(package)
    tools = Tools()
    try:
        peer.prepare(tools)
        return tools, peer.open(tools, model, size)
    except ExecutorUnavailable as error:
        pytest.skip(str(error))


@pytest.mark.parametrize(("border", "activation"), [("clamp", "sine"), ("zero", "sine"), ("clamp", "relu")])
@pytest.mark.parametrize("peer", SAME_FUNCTION, ids=lambda peer: peer.name)
def test_a_peer_computes_the_network(peer, border, activation) -> None:
    """On an oblong picture, smaller than twice the window: the bound is that of the program in float32.

    It holds for every order of summation and for fused sums, and so for every library that rounds to nearest.
    """
    model = untrained((8, 6), size=5, border=border, omegas=(2.0, 3.0), seed=7, activation=activation)
    whole = workload.noise(9)
    frame = Frame({name: layer[:7] for name, layer in whole.layers.items()})
    shown = workload.given(model, frame)
    tools, runner = opened(peer, model, 9)
    with tools:
        for _ in range(2):
            picture = runner.display(runner.run(shown))
    joined = np.concatenate(list(shown.images.values()), axis=-1)
    windows = all_windows(pad(joined, model.window), model.window)
    (bound,) = bounds.at_inputs(analysed(lower(model)), {"window": windows}, LIBRARY_SINE).values()
    assert picture.shape == (7, 9, 3)
    assert (np.abs(picture - denoise(model, frame, np.float64)) <= bound).all()


def test_absent_peers_are_named_with_the_command_that_installs_them(monkeypatch) -> None:
    monkeypatch.setattr("wamnet_peers.common.find_spec", lambda name: None)
    for peer in table.contenders:
        text = f"not installed: {', '.join(peer.packages)}; pip install {' '.join(peer.packages)}"
        assert peer.missing() == text
        with pytest.raises(ExecutorUnavailable, match="not installed: "):
            peer.prepare(Tools())
