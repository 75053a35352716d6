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
    assert "\nsource: computes the certified program: " in outcome.out
    assert "source:" not in wamnet("certify", kernel / name, "--no-text").out


def test_a_text_that_was_changed_is_read(wamnet, kernel, tmp_path):
    mine = tmp_path / "mine.cl"
    source = (kernel / "denoise.cl").read_text()
    mine.write_text(source.replace("0.318309873f", "0.318309963f"))
    outcome = wamnet("certify", kernel, "--source", mine)
    assert outcome.status == 1
    assert "rejected: source: output 0 is not the program's" in outcome.out
    mine.write_text(source.replace("++dx", "dx += 1"))
    assert wamnet("certify", kernel, "--source", mine).status == 0


def test_a_source_that_is_not_read_is_said(wamnet, samples):
    """A certificate that holds is not enough for status 0, unless the source is left out."""
    path = samples / "model.safetensors"
    assert wamnet("export", path, "--target", "cuda", "--profile", "native", "-o", "v").status == 0
    outcome = wamnet("certify", "v/denoise")
    assert outcome.status == 3
    assert "source: not checked: " in outcome.out.splitlines()[-1]
    assert wamnet("certify", "v/denoise", "--no-text").status == 0


@pytest.mark.parametrize("line", ['#include "/etc/passwd"', "#include </dev/zero>", "#ifdef __OPTIMIZE__"])
def test_a_source_with_another_directive_is_not_checked(wamnet, kernel, tmp_path, line):
    """No file that a source names is opened."""
    (tmp_path / "mine.cl").write_text(f"{line}\n{(kernel / 'denoise.cl').read_text()}")
    outcome = wamnet("certify", kernel, "--source", "mine.cl")
    assert outcome.status == 3
    assert "root" not in outcome.out


def test_a_text_that_is_not_there_is_a_bad_file(refused, kernel):
    assert "no.cl" in refused("certify", kernel, "--source", "no.cl")
    told = refused("certify", kernel, "--no-text", "--source", kernel / "denoise.cl")
    assert "with --no-text no source is checked" in told


def test_a_kernel_without_one_is_a_bad_file(wamnet, refused, samples, tmp_path):
    model = samples / "model.safetensors"
    made = wamnet("compile", model, "--target", "glsl", "--profile", "native", "-o", "plain")
    assert made.status == 0
    assert "no certificate: nothing is promised of the sine (" in made.out
    assert "not found (only kernels of profile ieee have one" in refused("certify", "plain")


@pytest.mark.parametrize("variant", ["rank2", "sine7", "window3"])
def test_a_variant_has_a_certificate(wamnet, samples, tmp_path, variant):
    given = "--target", "opencl", "--variant", variant, "-o", "kernel"
    made = wamnet("compile", samples / "model.safetensors", *given)
    assert made.status == 0
    assert "no certificate" not in made.out
    assert wamnet("certify", "kernel").status == 0


MANIFEST, CERTIFICATE = "manifest.json", "denoise.certificate.json"


def edited(name, change):
    """Return a function that changes what a JSON file of a kernel's folder holds, in place."""

    def edit(folder):
        held = json.loads((folder / name).read_text())
        change(held)
        (folder / name).write_text(json.dumps(held))

    return edit


def smaller(held):
    held["layers"][1]["error_bound"][0] *= 0.999


def wide(held):
    """Numbers that a file of weights does not have are not made room for."""
    place = next(place for place in held["parameters"].values() if "rows" in place)
    place["rows"] = place["columns"] = [0] * 60_000


def other_weights(folder):
    path = folder / "weights.bin"
    path.write_bytes(path.read_bytes()[:-4] + b"\0\0\0\0")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (edited(CERTIFICATE, smaller), "layer 1: error_bound is "),
        (edited(CERTIFICATE, wide), "more numbers than weights.bin has is True"),
        (other_weights, "digest of weights.bin"),
        (edited(MANIFEST, lambda held: held.update(entry_point="main")), ""),
        (edited(MANIFEST, lambda held: held["window"].update(centre=0)), ""),
    ],
)
def test_what_does_not_hold_is_rejected(wamnet, kernel, change, said):
    """CER-5: entry point and centre of the manifest are bound too."""
    change(kernel)
    outcome = wamnet("certify", kernel)
    assert (outcome.status, outcome.out.count("\n")) == (1, 1)
    assert outcome.out.startswith("rejected: ")
    assert said in outcome.out


@pytest.mark.parametrize("key", ["entry_point", "centre"])
def test_a_certificate_without_what_is_bound_is_none(wamnet, kernel, key):
    edited(CERTIFICATE, lambda held: held.pop(key))(kernel)
    assert wamnet("certify", kernel).status != 0


def test_a_manifest_from_before_lengths_is_accepted(wamnet, kernel):
    edited(MANIFEST, lambda held: held.pop("file_bytes"))(kernel)
    assert wamnet("certify", kernel).status == 0


def pipe(folder):
    os.mkfifo(folder / "pipe")
    named(folder, "pipe")
    edited(MANIFEST, lambda held: held["file_bytes"].update(pipe=0))(folder)


def named(folder, name):
    """Let the manifest name a file, beside a secret in the folder above."""
    (folder.parent / "secret").write_text("x")
    edited(MANIFEST, lambda held: held["files"].update({name: "0"}))(folder)


def short(folder):
    with (folder / "weights.bin").open("r+b") as file:
        file.truncate(8)


def half(folder):
    (folder / CERTIFICATE).write_bytes((folder / CERTIFICATE).read_bytes()[:200])


PLAIN = "must be the plain name of a file"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        *((lambda folder, name=name: named(folder, name), PLAIN) for name in (
            "/dev/zero", "../secret", "..", "a/b", "")),
        (pipe, "not a regular file"),
        (short, "weights.bin in bytes 8: must be the stated one, "),
        (half, "is not acceptable JSON"),
        *((edited(MANIFEST, lambda held, size=size: held["file_bytes"].update({"weights.bin": size})),
           "file_bytes: weights.bin ") for size in (None, -1, 1.5, "8", True)),
    ],
)  # fmt: skip
def test_files_that_cannot_be_are_refused(refused, kernel, change, said):
    """RDG-4: names of other folders, pipes and endless devices before anything is opened, and lengths."""
    change(kernel)
    assert said in refused("certify", kernel)
