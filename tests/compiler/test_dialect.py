"""Dialects: every operation has its words, every constant names one float32."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wamnet.compiler.core.ops import ELEMENTWISE, OPS
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.dialect import Dialect
from wamnet.compiler.languages.glsl import GLSL
from wamnet.compiler.languages.glsl_buffers import Vulkan
from wamnet.compiler.languages.glsl_es import GLSLES
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.wgsl import WGSL


@pytest.mark.parametrize("dialect", [OpenCL, GLSL, C])
def test_every_elementwise_operation_has_a_template(dialect):
    names = {name.partition(".")[0] for name in dialect.operations}
    assert names == {"any", "remainder", "take", *(op.name for op in ELEMENTWISE)}
    assert set(OPS) >= names - {"any", "remainder"}


@given(value=st.floats(allow_nan=False, allow_infinity=False, width=32))
def test_constant_reads_back_as_the_same_float32(value):
    text = Dialect.literal(value).strip("()")
    assert text.endswith("f")
    assert "." in text or "e" in text
    assert np.float32(text[:-1]).tobytes() == np.float32(value).tobytes()
    assert np.float32(float(text[:-1])).tobytes() == np.float32(value).tobytes()


def test_limits_are_those_that_every_device_has():
    """WebGPU's maxComputeWorkgroupStorageSize, Vulkan's maxComputeSharedMemorySize; MAX_DRAW_BUFFERS."""
    assert Vulkan.largest_shared == WGSL.largest_shared == 16_384
    assert GLSLES.max_output_channels == GLSLES.max_planes == 4 * 4


def test_negative_constants_stand_in_brackets():
    assert Dialect.literal(-2.0) == "(-2.0f)"
    assert Dialect.literal(3.0) == "3.0f"


ASKED = """\
import sys
from wamnet.compiler.targets import LANGUAGES, language_named
def loaded(part):
    return sorted(m.rpartition(".")[2] for m in sys.modules if m.startswith(f"wamnet.compiler.{part}."))
print(loaded("languages"), loaded("schedules"))
assert {"c", "cuda", "wgsl"} < set(LANGUAGES)
language_named("cuda").schedules["plain"]
print("opencl" in loaded("languages"), "fft" in loaded("schedules"), "cuda" in loaded("languages"))
"""


@pytest.mark.needs("programs")
def test_a_language_and_a_schedule_are_imported_when_they_are_asked_for():
    """Whoever compiles for one target waits for no other one's words, and reads none."""
    done = subprocess.run([sys.executable, "-c", ASKED], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == [
        "['dialect', 'renderer'] ['common', 'names', 'schedules']",
        "False False True",
    ]
