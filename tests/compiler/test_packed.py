"""The packed schedule (WEB-5): where weights are. Kernels keep their bound in test_exports.py."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.compiler.compile import compile_program
from wamnet.compiler.languages.glsl_es import GLSLES
from wamnet.compiler.schedules.plain import WEIGHTS_A_TEXEL, Packed


@pytest.fixture(scope="module")
def program(kit):
    """Nine taps of a channel to five neurons to three."""
    return kit.denoiser(kit.network([9, 5, 3], (3.0, 3.0)), {"a": 1}, 3, "clamp")


def test_rows_of_neurons_are_filled_up_to_whole_texels(program):
    schedule = Packed(GLSLES())
    packed, slots = schedule.pack(program), schedule.layout(program)
    assert packed.size % 4 == 0
    for name, array in program.parameters.items():
        slot = slots[name]
        assert slot.offset % 4 == 0
        stored = packed[slot.offset : slot.offset + np.prod(slot.shape)].reshape(slot.shape)
        neurons = len(array)
        assert np.array_equal(stored[..., :neurons], array.T)
        assert slot.shape[-1] % 4 == 0
        assert not stored[..., neurons:].any()
    assert slots["W0"].shape == (9, 8)


def test_a_packed_kernel_says_how_its_texture_is_read(program):
    artifact = compile_program(program, "glsl-es", schedule="packed")
    assert artifact.manifest["schedule"][WEIGHTS_A_TEXEL] == 4
    assert "weight_texture: RGBA32F, 1024 texels wide" in artifact.source
    assert Packed(GLSLES()).refusal(program) == ""
    assert Packed(GLSLES()).private_bytes(program) > 0
