"""The support matrix says what records show, and no more."""

import pytest
from lab import support
from lab.records import Records
from lab.results import written
from results_of import data_of

from wamnet.kernels.export.targets import NAMES

EXPORTS = [
    {"target": "opencl", "emitted": "1 kB", "compiled by": "a driver", "executed on": "pthread-x"},
    {"target": "cuda", "emitted": "2 kB", "compiled by": "nvcc", "executed on": "a card"},
    {"target": "shadertoy", "emitted": "0 kB", "compiled by": "beyond a limit", "executed on": "-"},
]
CERTIFIED = [
    {"target": "opencl", "schedule": "plain", "variant": "full", "text": "computes it: 2 sums"},
    {"target": "opencl", "schedule": "fft:16", "variant": "full", "text": "not looked at"},
    {"target": "opencl", "schedule": "dot:16", "variant": "whole8", "text": "computes it: 2 sums"},
]
FAULTS = [
    {"target": "cuda", "seeded": "60", "accepted": "1"},
    {"target": "cuda", "seeded": "5", "accepted": "0"},
]


def test_cells_are_of_the_records(tmp_path):
    for name, rows in (("exports", EXPORTS), ("certified", CERTIFIED), ("text-faults", FAULTS)):
        kept = [{"configuration": row["target"], "seed": 0, "values": {"table": 1, **row}} for row in rows]
        (tmp_path / f"{name}.json").write_text(written(data_of(kept)))
    lines = support.matrix(Records(tmp_path)).splitlines()[2:]
    assert lines == [
        "| `opencl` | 1 kB | a driver | pthread-x | CPU | plain, fft:16; integers: dot:16 "
        "| plain; integers: dot:16 | – |",
        "| `cuda` | 2 kB | nvcc | a card | a card | – | – | 1 of 65 |",
        "| `shadertoy` | – | beyond a limit | – | – | – | – | – |",
    ]


def test_every_target_has_a_row():
    lines = support.matrix(Records()).splitlines()[2:]
    assert sorted(line.split("`")[1] for line in lines) == sorted(NAMES)


@pytest.mark.parametrize(
    ("device", "kind"), [("llvmpipe (LLVM 15) through egl", "CPU"), ("NVIDIA H100", "NVIDIA H100")]
)
def test_a_card_is_not_a_processor(device, kind):
    assert support.hardware(device) == kind
