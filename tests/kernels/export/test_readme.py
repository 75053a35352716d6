"""The README of an export: what it says of the proof is what `wamnet certify` does."""

import json
import re

import pytest

from wamnet.compiler.artifact import CERTIFICATE_NAME
from wamnet.compiler.proof.checker import check
from wamnet.compiler.reading.check import check_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.kernels.bench.workload import random_model
from wamnet.kernels.export.package import Request, export
from wamnet.kernels.export.targets import ONNX, TARGETS
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable, InputError
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings

WAYS = [
    (row.name, where, schedule)
    for row in TARGETS.values()
    for where, place in row.places.items()
    for schedule in place.schedules
]
"""Every target, with every place of its weights and every schedule there."""


def proof_of(made):
    """Return the section of an export's README about its proof."""
    return made.contents()["README.md"].decode().partition("## Proof")[2].partition("\n## ")[0]


def written(made, folder):
    """Write the denoiser of an export as it is there; return its certificate's path."""
    for name, data in made.contents().items():
        if name.startswith("denoise/"):
            (folder / name.removeprefix("denoise/")).write_bytes(data)
    return folder / CERTIFICATE_NAME


def reads(path):
    """Return whether the reader takes the text beside a certificate."""
    try:
        return check_text(path)["sums"] > 0
    except Unread:
        return False


def exported(target, where, schedule, **options):
    """Return an export; skip where a target or a schedule cannot hold the model."""
    try:
        return export(Request(random_model(), target, weights=where, schedule=schedule, **options))
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    except (CompileError, InputError) as error:
        if not re.search("cannot hold this model|a compiler that keeps operations in order", str(error)):
            raise
        pytest.skip(str(error))


def agrees(made, folder):
    """Hold what an export's README says of its proof against what the checker and the reader do."""
    told, path = proof_of(made), written(made, folder)
    bound = max(check(path)["bound"]["output"])
    assert ("no operation rounds" if bound == 0 else f"a bound of {bound:g} for all images") in told
    assert "\nwamnet certify denoise\n" in told
    named = json.loads((folder / "manifest.json").read_text())["files"]
    (source,) = named.keys() - {"weights.bin"}
    assert f"{source}`" in told
    assert ("It reads `denoise/" in told) == reads(path)


@pytest.mark.needs("programs")
@pytest.mark.product
@pytest.mark.parametrize("variant", ["full", "whole8"])
@pytest.mark.parametrize(("target", "where", "schedule"), WAYS)
def test_it_says_what_certify_does(target, where, schedule, variant, tmp_path):
    """CER-1, TXT-7: the certified bound, and whether the text is read, for whatever can be exported."""
    agrees(exported(target, where, schedule, variant=variant), tmp_path)


@pytest.mark.needs("programs")
@pytest.mark.parametrize("variant", ["full", "whole8"])
@pytest.mark.parametrize("target", ["opencl", "c", "cuda", "glsl", "wgsl"])
def test_it_says_so_of_the_target_s_own_sine(target, variant, tmp_path):
    made = exported(target, "", "plain", variant=variant, profile="native")
    if made.manifest["certificate"] is None:
        assert "There is no certificate: nothing is promised of the sine" in proof_of(made)
    else:
        agrees(made, tmp_path)


@pytest.mark.needs("programs")
def test_it_says_so_of_sines_of_another_degree(tmp_path):
    agrees(exported("c", "", "plain", variant="sine7"), tmp_path)


def test_it_says_which_file_is_a_translation_that_nobody_reads():
    try:
        made = export(Request(random_model(), "hlsl", schedule="plain"))
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    told = proof_of(made)
    assert "It reads `denoise/denoise.comp` too" in told
    assert "`denoise/denoise.dxc.hlsl`, `denoise/denoise.fxc.hlsl`: translated from it, and not read" in told


@pytest.mark.needs("packages")
@pytest.mark.parametrize(
    ("target", "options", "said"),
    [
        ("c", {"variant": "rank2"}, "It reads `denoise/denoise.h` and `denoise/horizontal.denoise.h` too"),
        ("c", {"profile": "native"}, "There is no certificate: nothing is promised of the sine"),
        (ONNX, {}, "There is no certificate: a runtime makes kernels of its own"),
        ("cuda", {"profile": "native"}, "(schedule group:4, profile native) it does not know."),
    ],
)
def test_it_says_what_has_no_certificate_or_is_not_read(target, options, said):
    made = export(Request(random_model(), target, **options))
    assert said in re.sub(r"\s+", " ", proof_of(made))
    assert ("no certificate" in said) == (made.manifest["certificate"] is None)


@pytest.mark.parametrize("schedule", ["plain", "tile:8", "dot:16"])
def test_only_a_header_for_several_processors_is_advised_as_one(schedule):
    made = exported("c", "", schedule, variant="whole8" if schedule == "dot:16" else "full")
    told, header = (made.contents()[name].decode() for name in ("README.md", "denoise/denoise.h"))
    assert ("WAMNET_PORTABLE" in told) == ("WAMNET_CLONES" in header)
    assert "-O3 -march=native" in told


def test_paths_have_none():
    scene, settings = canonical("lone_light"), Settings(max_depth=1)
    for given in (None, scene):
        told = proof_of(export(Request(random_model(), "c", given, settings=settings)))
        assert ("What traces paths or encodes features has no certificate." in told) == (given is scene)
