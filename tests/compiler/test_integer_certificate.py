"""Certificates of integers: what the checker accepts and refuses."""

import ast
import inspect
import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
from kit import untrained

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.proof import integer_checker
from wamnet.compiler.proof.checker import check
from wamnet.compiler.proof.evidence import Refused
from wamnet.refimpl.network import siren
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.whole import rounded


def model(seed: int = 5, amplitude: int = 127, border: str = "zero") -> Model:
    """Return a small model of integers."""
    found = untrained((6, 5), size=2, border=border, omegas=(1.0, 3.0), seed=seed)
    return replace(found, siren=rounded(found.siren, 2, amplitude))


def written(folder, target="opencl", schedule="plain", **kwargs):
    """Write the kernel of a small model, and return the path of its certificate."""
    artifact.write(compile_program(lower(model(**kwargs)), target, schedule=schedule), folder)
    return folder / artifact.CERTIFICATE_NAME


@pytest.mark.parametrize(
    ("target", "schedule"),
    [
        *(("opencl", "plain"), ("opencl", "dot:16"), ("c", "tile:8"), ("c", "dot:16"), ("wgsl", "plain")),
        *((target, "groupdot:4") for target in ("opencl", "cuda", "wgsl", "glsl-vulkan")),
    ],
)
@pytest.mark.parametrize("amplitude", [127, 511])
def test_certificates_hold(tmp_path, target, schedule, amplitude) -> None:
    held = check(written(tmp_path, target, schedule, amplitude=amplitude))
    assert held["schema"] == "wamnet-integers-1"
    assert held["bound"]["output"] == [0.0, 0.0, 0.0]
    assert [len(sums) for sums in held["sums"].values()] == [6, 5, 3]
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    assert manifest["certificate"] == artifact.CERTIFICATE_NAME


def test_sums_are_those_of_the_largest_inputs(tmp_path) -> None:
    held = check(written(tmp_path))
    net = model().siren
    # Of colour only 0 to 127, and 0 beyond the border; of normals -127 to 127.
    largest = np.tile(np.full(6, 127.0), 4)
    first, *others = held["sums"].values()
    assert first == (np.abs(net.weights[0]) @ largest).tolist()
    for sums, weight in zip(others, net.weights[1:], strict=True):
        assert sums == (127.0 * np.abs(weight).sum(axis=1)).tolist()


def _leaves(value, place=()):
    """Yield the places of all numbers."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, (*place, key))
    elif isinstance(value, list):
        for key, inner in enumerate(value):
            yield from _leaves(inner, (*place, key))
    elif type(value) in (int, float):
        yield place


def test_no_stated_number_can_be_another(tmp_path) -> None:
    """Of one place after the other, less, more and none in turn."""
    path = written(tmp_path)
    held = json.loads(path.read_text())
    moves = itertools.cycle([lambda n: n - 1, lambda n: n + 1, lambda n: None])
    for place in _leaves({name: held[name] for name in ("ranges", "sums", "bound")}):
        changed = json.loads(path.read_text())
        inner = changed
        for key in place[:-1]:
            inner = inner[key]
        inner[place[-1]] = next(moves)(inner[place[-1]])
        path.write_text(json.dumps(changed))
        with pytest.raises(Refused, match="must be"):
            check(path)
    path.write_text(json.dumps(held))
    check(path)


LIES = {
    "an image of fractions": (" whole in [0.0, 127.0]", " in [0.0, 127.0]", "not of integers"),
    "a wider image": ("3 whole in [0.0, 127.0]", "3 whole in [0.0, 99999.0]", "sum may be|sums"),
    "a sine of floats": ("convert %1 {dtype=int32}", "sin %1", "may round"),
    "a shift by 32": ("value=22}", "value=32}", "not a constant below 32"),
    "a constant of another size": ("value=51053}", "value=51054}", "ranges"),
    "a step of half an integer": ("value=22} : uint32", "value=0.5} : uint32", "not of integers|32"),
}
"""Texts that are changed, with digests to match, and what the checker says."""


@pytest.mark.parametrize("lie", LIES)
def test_a_text_that_promises_more_is_refused(tmp_path, lie, monkeypatch) -> None:
    """Digests would show it first: they are let be here."""
    before, after, message = LIES[lie]
    path = written(tmp_path)
    held = json.loads(path.read_text())
    assert before in held["program"]
    text = held["program"].replace(before, after, 1)
    arrays = {
        name: array.astype(np.float64)
        for name, array in compile_program(lower(model()), "opencl").plan.analysed.parameters.items()
    }
    with pytest.raises(Refused, match=message):
        integer_checker.check_integers(held, text, arrays)


def test_sums_beyond_float32_are_refused(tmp_path) -> None:
    path = written(tmp_path)
    held = json.loads(path.read_text())
    found = compile_program(lower(model()), "opencl").plan.analysed.parameters
    arrays = {name: array.astype(np.float64) for name, array in found.items()}
    arrays["W0"] = arrays["W0"] * 2.0**16
    with pytest.raises(Refused, match=r"a sum may be"):
        integer_checker.check_integers(held, held["program"], arrays)


def test_weights_and_digests_belong_together(tmp_path) -> None:
    path = written(tmp_path)
    raw = bytearray((tmp_path / "weights.bin").read_bytes())
    raw[2] ^= 1
    (tmp_path / "weights.bin").write_bytes(bytes(raw))
    with pytest.raises(Refused, match="digest"):
        check(path)


def test_the_checker_shares_nothing_with_the_writer() -> None:
    tree = ast.parse(inspect.getsource(integer_checker))
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert modules <= {"__future__", "collections.abc", "fractions", "typing", "evidence"}


def test_a_network_of_floats_keeps_its_certificate(tmp_path) -> None:
    network = siren.init((24, 6, 5, 3), 1.0, 3.0, 5)
    artifact.write(compile_program(lower(replace(model(), siren=network)), "opencl"), tmp_path)
    assert check(tmp_path / artifact.CERTIFICATE_NAME)["schema"] == "wamnet-certificate-1"
