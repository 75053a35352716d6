"""`wamnet certify`: the verdict, its exit status, and the table."""

import json
import os

import pytest


@pytest.fixture
def kernel(wamnet, samples, tmp_path):
    """Return the folder of a kernel with a certificate."""
    assert wamnet("compile", samples / "model.safetensors", "--target", "opencl", "-o", "kernel").status == 0
    return tmp_path / "kernel"


@pytest.mark.parametrize("name", ["", "denoise.certificate.json"])
def test_a_certificate_holds(wamnet, kernel, name):
    outcome = wamnet("certify", kernel / name)
    assert outcome.status == 0
    assert "Where the error comes from" in outcome.out
    assert "holds: |output - reference| <= " in outcome.out
    assert "of half an 8-bit step" in outcome.out


def test_the_folder_of_an_export_has_a_certificate(wamnet, samples):
    """It lies in the folder of the denoiser."""
    assert wamnet("export", samples / "model.safetensors", "--target", "c", "-o", "made").status == 0
    assert "holds: |output - reference| <= " in wamnet("certify", "made", "--no-text").out


def test_the_text_is_read(wamnet, kernel):
    assert "\nsource: computes the certified program: " in wamnet("certify", kernel).out
    assert "text:" not in wamnet("certify", kernel, "--no-text").out


def test_a_text_that_was_changed_is_read(wamnet, kernel, tmp_path):
    mine = tmp_path / "mine.cl"
    source = (kernel / "denoise.cl").read_text()
    mine.write_text(source.replace("0.318309873f", "0.318309963f"))
    outcome = wamnet("certify", kernel, "--source", mine)
    assert outcome.status == 1
    assert "rejected: source: output 0 is not the program's" in outcome.out
    mine.write_text(source.replace("++dx", "dx += 1"))
    assert wamnet("certify", kernel, "--source", mine).status == 0


def test_a_schedule_that_is_not_read_is_said(wamnet, samples):
    """A certificate that holds is not enough for status 0, unless the source is left out."""
    path = samples / "model.safetensors"
    assert wamnet("compile", path, "--target", "glsl", "--schedule", "inlined", "-o", "v").status == 0
    outcome = wamnet("certify", "v")
    assert outcome.status == 3
    assert "source: not checked: " in outcome.out.splitlines()[-1]
    assert wamnet("certify", "v", "--no-text").status == 0


@pytest.mark.parametrize("line", ['#include "/etc/passwd"', "#include </dev/zero>", "#ifdef __OPTIMIZE__"])
def test_a_source_with_another_directive_is_not_checked(wamnet, kernel, tmp_path, line):
    """No file that a source names is opened."""
    (tmp_path / "mine.cl").write_text(f"{line}\n{(kernel / 'denoise.cl').read_text()}")
    outcome = wamnet("certify", kernel, "--source", "mine.cl")
    assert outcome.status == 3
    assert "root" not in outcome.out


@pytest.mark.parametrize("key", ["entry_point", "centre"])
def test_entry_point_and_centre_are_bound(wamnet, kernel, key):
    """CER-5: a manifest with another one is refused, and so is a certificate without one."""
    path = kernel / "manifest.json"
    manifest = json.loads(path.read_text())
    changed = {"entry_point": "main", "window": {**manifest["window"], "centre": 0}}
    place = "entry_point" if key == "entry_point" else "window"
    path.write_text(json.dumps({**manifest, place: changed[place]}))
    assert "rejected: " in wamnet("certify", kernel).out
    certificate = kernel / "denoise.certificate.json"
    stated = json.loads(certificate.read_text())
    del stated[key]
    path.write_text(json.dumps(manifest))
    certificate.write_text(json.dumps(stated))
    assert wamnet("certify", kernel).status != 0


def test_a_text_that_is_not_there_is_a_bad_file(refused, kernel):
    assert "no.cl" in refused("certify", kernel, "--source", "no.cl")
    told = refused("certify", kernel, "--no-text", "--source", kernel / "denoise.cl")
    assert "with --no-text no source is checked" in told


def test_a_smaller_number_is_refused(wamnet, kernel):
    path = kernel / "denoise.certificate.json"
    held = json.loads(path.read_text())
    held["layers"][1]["error_bound"][0] *= 0.999
    path.write_text(json.dumps(held))
    outcome = wamnet("certify", path)
    assert outcome.status == 1
    assert outcome.out.startswith("rejected: layer 1: error_bound is ")
    assert outcome.out.count("\n") == 1


def test_other_weights_are_refused(wamnet, kernel):
    path = kernel / "weights.bin"
    path.write_bytes(path.read_bytes()[:-4] + b"\0\0\0\0")
    outcome = wamnet("certify", kernel)
    assert outcome.status == 1
    assert outcome.out.startswith("rejected: digest of weights.bin")


@pytest.mark.parametrize("name", ["/dev/zero", "../secret", "..", "a/b", ""])
def test_a_manifest_that_names_other_folders_is_refused_before_they_are_read(refused, kernel, name):
    """A pipe or an endless device must not be opened either."""
    path = kernel / "manifest.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, "files": {**manifest["files"], name: "0"}}))
    (kernel.parent / "secret").write_text("x")
    assert "must be the plain name of a file" in refused("certify", kernel)


def test_a_pipe_beside_a_kernel_is_refused_at_once(refused, kernel):
    path = kernel / "manifest.json"
    manifest = json.loads(path.read_text())
    os.mkfifo(kernel / "pipe")
    named = {"files": {**manifest["files"], "pipe": "0"}, "file_bytes": {**manifest["file_bytes"], "pipe": 0}}
    path.write_text(json.dumps({**manifest, **named}))
    assert "not a regular file" in refused("certify", kernel)


def test_a_file_of_another_length_is_refused(refused, kernel):
    """RDG-4: the manifest states how long it is."""
    with (kernel / "weights.bin").open("r+b") as file:
        file.truncate(8)
    assert "weights.bin in bytes 8: must be the stated one, " in refused("certify", kernel)


def test_a_manifest_from_before_lengths_is_accepted(wamnet, kernel):
    path = kernel / "manifest.json"
    manifest = json.loads(path.read_text())
    del manifest["file_bytes"]
    path.write_text(json.dumps(manifest))
    assert wamnet("certify", kernel).status == 0


def test_numbers_that_a_weights_file_does_not_have_are_not_made_room_for(wamnet, kernel):
    path = kernel / "denoise.certificate.json"
    held = json.loads(path.read_text())
    place = next(place for place in held["parameters"].values() if "rows" in place)
    place["rows"] = place["columns"] = [0] * 60_000
    path.write_text(json.dumps(held))
    outcome = wamnet("certify", kernel)
    assert outcome.status == 1
    assert "more numbers than weights.bin has is True" in outcome.out


def test_a_kernel_without_one_is_a_bad_file(wamnet, refused, samples, tmp_path):
    model = samples / "model.safetensors"
    made = wamnet("compile", model, "--target", "glsl", "--profile", "native", "-o", "plain")
    assert made.status == 0
    assert "no certificate: nothing is promised of the sine (" in made.out
    assert "not found (only kernels of profile ieee have one" in refused("certify", "plain")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--variant", "rank2"), "no certificate: it is two kernels, one after the other"),
        (("--variant", "sine7"), None),
        (("--variant", "window3"), None),
    ],
)
def test_a_variant_has_a_certificate_or_says_why_not(wamnet, samples, tmp_path, given, said):
    made = wamnet("compile", samples / "model.safetensors", "--target", "opencl", *given, "-o", "kernel")
    assert made.status == 0
    assert (said or "") in made.out
    assert ("no certificate" in made.out) == (said is not None)
    assert wamnet("certify", "kernel").status == (2 if said else 0)


def test_half_a_file_is_a_bad_file(refused, kernel):
    path = kernel / "denoise.certificate.json"
    path.write_bytes(path.read_bytes()[:200])
    assert "is not acceptable JSON" in refused("certify", path)


@pytest.mark.parametrize("size", [None, -1, 1.5, "8", True])
def test_a_length_is_a_whole_number(refused, kernel, size):
    path = kernel / "manifest.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, "file_bytes": {**manifest["file_bytes"], "weights.bin": size}}))
    assert "file_bytes: weights.bin " in refused("certify", kernel)
