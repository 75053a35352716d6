"""Networks of integers in the benchmark: images are rounded, the bound is 0, others' 8 bits are near."""

from dataclasses import replace

import numpy as np
import pytest
from kit import untrained

from wamnet.compiler.variants import parse, vary
from wamnet.kernels.bench import contenders, workload
from wamnet.kernels.bench.accuracy import Crop
from wamnet.kernels.bench.contenders import Tools
from wamnet.refimpl.network.denoise import denoise
from wamnet_peers import peer_onnxruntime, peer_openvino

pytestmark = pytest.mark.apart

SIZE = 48
"""Width and height of the pictures."""


@pytest.fixture(scope="module")
def model():
    """A network that gives colours inside of [0, 1]."""
    found = untrained((8, 8), omegas=(1.0, 3.0), seed=1)
    (*weights, last), (*biases, _) = found.siren.weights, found.siren.biases
    weights, biases = (*weights, last / 4), (*biases, np.full(3, 0.5, np.float32))
    return replace(found, siren=replace(found.siren, weights=weights, biases=biases))


@pytest.mark.parametrize(
    ("executor", "schedule"), [("opencl", "dot:16"), ("opencl", "tile:16"), ("c", "dot:16")]
)
def test_kernels_of_integers_give_the_reference_s_bits(executor_named, model, executor, schedule):
    executor_named(executor)
    frame = workload.noise(SIZE)
    given = workload.given(model, frame)
    contender = contenders.kernel(executor, schedule, contenders.INTEGERS)
    assert contender.name == f"{executor}:{schedule}:whole8"
    with Tools() as tools:
        opened = contender.open(tools, model, SIZE)
        found = opened.run(given)
    assert opened.schedule == schedule
    assert opened.bound == 0.0
    assert opened.certified
    wanted = denoise(vary(parse("whole8"), model).model, frame)
    assert found.tobytes() == wanted.tobytes()
    crop = Crop(model, given.images)
    reference, bound = crop.rounding(contenders.INTEGERS, executor, schedule)
    assert bound == 0.0
    assert np.array_equal(crop.cut(found), reference)


IN_FEWER_BITS = (*peer_onnxruntime.CONTENDERS[1:], *peer_openvino.CONTENDERS[1:])
"""Others' networks of 8 bits, and of bfloat16, which has as many."""


@pytest.mark.parametrize("peer", IN_FEWER_BITS, ids=lambda peer: peer.name)
def test_networks_in_fewer_bits_of_others_are_near(model, peer):
    """Not a bound of ours: 8 bits of three layers, which end near the middle, are off by a few steps."""
    if reason := peer.missing():
        pytest.skip(reason)
    frame = workload.noise(SIZE)
    given = workload.given(model, frame)
    with Tools() as tools:
        found = peer.open(tools, model, SIZE).run(given)
    assert np.abs(found - denoise(model, frame)).max() <= 0.05
