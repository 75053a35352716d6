"""`wamnet listing`: a kernel with the lines that it came from, to the terminal or to a file."""

import pytest


@pytest.mark.parametrize("target", ["opencl", "glsl", "c"])
def test_a_model_s_kernel(wamnet, samples, target):
    outcome = wamnet("listing", samples / "model.safetensors", "--target", target, "--profile", "native")
    assert outcome.status == 0
    lines = outcome.out.splitlines()
    sine = next(i for i, line in enumerate(lines) if "x = activate(_omega_0(siren, layer) * x)" in line)
    assert lines[sine].startswith("refimpl/network/siren.py:")
    assert any("sin" in line for line in lines[sine + 1 : sine + 8])
    assert all(line.startswith(("refimpl/", "the kernel's own: ", "    |")) for line in lines)


def test_a_scene_s_kernel_into_a_file(wamnet, tmp_path):
    outcome = wamnet("listing", "lone_light", "--target", "opencl", "-o", "listing.txt")
    assert (outcome.status, outcome.out) == (0, "listing.txt\n")
    text = (tmp_path / "listing.txt").read_text()
    kernel = wamnet("compile", "lone_light", "--target", "opencl", "-o", "kernel")
    assert kernel.status == 0
    listed = [line[6:] for line in text.splitlines() if line.startswith("    |")]
    assert "\n".join(listed).strip() == (tmp_path / "kernel/path.cl").read_text().strip()


def test_what_is_no_model_is_refused(refused, tmp_path):
    (tmp_path / "model.safetensors").write_text("no")
    assert "model.safetensors" in refused("listing", "model.safetensors", "--target", "glsl")


def test_the_model_is_not_overwritten(refused, samples, tmp_path):
    (tmp_path / "m.safetensors").write_bytes((samples / "model.safetensors").read_bytes())
    assert "m.safetensors" in refused("listing", "m.safetensors", "--target", "glsl", "-o", "m.safetensors")
