"""EXP-16: what an export says of its speed is what a clock said, and only where that means something."""

import hashlib
import itertools
import json
from pathlib import Path

import pytest

from wamnet.kernels.bench.workload import random_model
from wamnet.kernels.export.check import MS, measure
from wamnet.kernels.export.package import README_NAME, Request, export, with_speed
from wamnet.refimpl.errors import InputError

ROOT = Path(__file__).resolve().parents[3]
"""The project's folder."""

NAMED = ("device", "size", "rounds", "ms", "least_ms", "most_ms", "compile_s")
"""What the manifest says."""


def clock_of(*durations):
    """Return a clock that is read in pairs, so far apart; exact in binary."""
    marks = itertools.accumulate(itertools.chain.from_iterable((1.0, each) for each in durations))
    return marks.__next__


def test_the_readme_says_what_the_clock_said(executor_named):
    jsonschema = pytest.importorskip("jsonschema")
    executor_named("opencl")
    made = export(Request(random_model(), "opencl"))
    # Building and a first picture take 2.25 s; three rounds take 0.25, 0.5 and 0.125 s.
    speed = measure(made, size=48, rounds=3, clock=clock_of(2.25, 0.25, 0.5, 0.125))
    assert [speed[f"{name}_ms"] for name in ("least", "most")] == [125.0, 0.5 * MS]
    assert (speed["ms"], speed["compile_s"]) == (250.0, 2.0)
    told = with_speed(made, speed)
    text = told.contents()[README_NAME].decode()
    line = f"* Speed: 250 ms (125 to 500, 3 runs) for 48 x 48 pixels on {speed['device']}, with copies"
    said = " ".join(text.split())
    assert " ".join(line.split()) in said
    assert "there and back; 2 s to compile." in said
    assert set(told.manifest["speed"]) == set(NAMED)
    jsonschema.validate(told.manifest, json.loads((ROOT / "spec/export.schema.json").read_text()))
    # All else is the export without a time, and the manifest's hash is the new README's.
    kept = {name: data for name, data in made.files.items() if name != README_NAME}
    assert {name: data for name, data in told.files.items() if name != README_NAME} == kept
    assert told.manifest["files"][README_NAME] == hashlib.sha256(text.encode()).hexdigest()


@pytest.mark.needs("devices")
def test_c_is_measured_for_this_processor_and_with_o2():
    made = export(Request(random_model(), "c"))
    speed = measure(made, size=16, rounds=1, clock=clock_of(2.25, 0.25, 2.5, 0.5))
    assert (speed["ms"], speed["plain_ms"]) == (250.0, 500.0)
    said = " ".join(with_speed(made, speed).contents()[README_NAME].decode().split())
    assert "there and back; 500 ms with -O2 alone; 2 s to compile." in said
    assert speed["device"].endswith(" -O3 -march=native")


def test_a_readme_gives_the_bytes_of_each_kernel():
    made = export(Request(random_model(), "c"))
    text = made.contents()[README_NAME].decode()
    for name in made.manifest["kernels"][0]["files"]:
        assert f"`{name}` ({len(made.files[name]):,} bytes)" in text
    assert "* Speed" not in text


@pytest.mark.needs("packages")
def test_a_time_that_is_nothing_is_refused():
    with pytest.raises(InputError, match="--measure"):
        measure(export(Request(random_model(), "onnx")))
