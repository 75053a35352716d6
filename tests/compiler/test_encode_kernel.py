"""Encoding kernels: the traced reference, its bound, generated text, manifest, refusals."""

import json

import numpy as np
import pytest
from errors_at import encoding_errors

from wamnet.compiler import artifact
from wamnet.compiler.core import ir
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.scenes.encode_kernel import (
    SAMPLES,
    compile_encode,
    layers_of,
    lower_encode,
    planes_of,
)
from wamnet.compiler.targets import language_named
from wamnet.refimpl.errors import CompileError, InputError
from wamnet.refimpl.frame import HISTORY
from wamnet.refimpl.network.dataset import FEATURES, FIRST_HITS, Normalization, encode_sums

SCALES = Normalization(0.5, 12.0, (0.1, -0.2, 0.3), 6.0)
ALL = tuple(FIRST_HITS)
OF_ONE_PICTURE = tuple(f.name for f in FEATURES.values() if f.name not in (*HISTORY, "sun") and not f.guides)


def sums_of(samples, seed=1):
    """Return sums (40,) by plane, colour over nine powers of ten, some on limits of the curve."""
    random = np.random.default_rng(seed)
    planes = {name: random.uniform(-2, 2, 40) * samples for name in planes_of(ALL)}
    color = 10 ** random.uniform(-7, 2, 40)
    color[:4] = [0.0, 0.0031308 / 2**0.5, 1 / 2**0.5, 0.0031308]
    planes |= {f"color_{c}": color * samples for c in "rgb"}
    return {name: values.astype(np.float32) for name, values in planes.items()}


def interpreted(program, sums, samples, dtype):
    given = {**sums, SAMPLES: np.full(40, samples, np.float32)}
    return interpret(program, given, dtype)


@pytest.mark.parametrize("samples", [1, 3])
def test_the_program_is_the_reference(samples):
    """In float64 nothing but the folding of constants, which are the same numbers, lies between them."""
    sums = sums_of(samples)
    wide = {name: values.astype(np.float64) for name, values in sums.items()}
    layers = {
        **{n: np.stack([wide[f"{n}_{c}"] for c in "rgb"], -1) for n in ("color", "albedo", "unshadowed")},
        "depth": wide["depth"],
        **{n: np.stack([wide[f"{n}_{c}"] for c in "xyz"], -1) for n in ("normal", "position", "direction")},
    }
    expected = encode_sums(layers, float(samples), ALL, SCALES)
    found = interpreted(lower_encode(ALL, SCALES), sums, samples, np.float64)
    for name, values in expected.items():
        for channel in range(FEATURES[name].channels):
            wanted = values[..., channel] if FEATURES[name].channels > 1 else values
            assert np.array_equal(found[f"{name}_{channel}"], wanted)


@pytest.mark.parametrize("samples", [1, 3])
def test_float32_is_within_the_bound_which_is_small(samples):
    """2^-18 is 64 u: 37 of them the power's where it is worst, 5 each division's, scales the rest."""
    artifact, sums = compile_encode(ALL, SCALES, "numpy"), sums_of(samples)
    exact, found = (interpreted(artifact.programs, sums, samples, kind) for kind in (np.float64, np.float32))
    for name, errors in encoding_errors(artifact, sums, samples).items():
        assert np.all(errors <= 2.0**-18)
        for channel in range(FEATURES[name].channels):
            both = [values[f"{name}_{channel}"].astype(np.float64) for values in (exact, found)]
            assert np.all(np.abs(both[0] - both[1]) <= errors[..., channel])


def test_the_bound_catches_an_exponent_of_2_2():
    artifact, sums = compile_encode(("color",), SCALES, "numpy"), sums_of(1)
    exact = interpreted(artifact.programs, sums, 1, np.float64)["color_0"]
    wrong = np.clip(sums["color_r"] * 2**0.5, 0, 1) ** (1 / 2.2)
    assert np.any(np.abs(wrong - exact) > encoding_errors(artifact, sums, 1)["color"][..., 0])


@pytest.mark.parametrize("target", ["opencl", "opengl"])
def test_golden_source(golden, target):
    """PPL-5, PPL-6: arguments, strides and textures of both languages."""
    made = compile_encode(ALL, SCALES, target)
    golden(f"ieee.{made.source_name}", made.source)


def test_golden_manifest(golden):
    manifest = json.dumps(compile_encode(ALL, SCALES, "opencl").manifest, indent=2, sort_keys=True)
    golden("ieee.encode.manifest.json", manifest + "\n")


def test_the_manifest_names_what_was_made():
    made = compile_encode(("normal", "depth"), SCALES, "opengl")
    assert made.manifest["files"] == {"encode.frag": ir.sha256(made.source.encode())}
    assert made.manifest["file_bytes"] == {"encode.frag": len(made.source.encode())}
    assert made.digest == ir.sha256(made.source.encode())
    assert made.planes == ("normal_x", "normal_y", "normal_z", "depth")
    assert [image.name for image in made.images] == ["normal", "depth"]
    assert made.images[1].encoding == FEATURES["depth"].encoding(SCALES)
    assert "image_color" not in made.source


def test_more_images_than_a_fragment_draws():
    """PPL-6: eight colour buffers; languages with buffers take any number."""
    with pytest.raises(CompileError, match=r"encodes 15 features: GLSL 3.30, .* at most 8 images at once"):
        compile_encode(OF_ONE_PICTURE, SCALES, "opengl")
    assert len(compile_encode(OF_ONE_PICTURE, SCALES, "opencl").images) == 15


def test_it_is_written_as_other_kernels_are(tmp_path):
    made = compile_encode(("color",), SCALES, "opencl")
    assert [path.name for path in artifact.write(made, tmp_path)] == ["encode.cl", "manifest.json"]
    assert (tmp_path / "encode.cl").read_text() == made.source
    assert json.loads((tmp_path / "manifest.json").read_text()) == made.manifest


def test_planes_of_a_whole_frame_are_read_where_they_lie():
    given = ("deviation_r", "color_r", "color_g", "color_b", "depth", "normal_x", "normal_y", "normal_z")
    made = compile_encode(("normal",), SCALES, "opencl", planes=given)
    assert made.planes == given
    assert [f"sums[{n} * plane" in made.source for n in range(8)] == [False] * 5 + [True] * 3
    texture = compile_encode(("normal",), SCALES, "opengl", planes=given).source
    assert "normal_x = texelFetch(sums_1, ivec2(x, y), 0)[1];" in texture


def test_layers_follow_the_features():
    assert layers_of(("albedo", "color")) == ("albedo", "color")
    assert planes_of(("depth", "color")) == ("depth", "color_r", "color_g", "color_b")


def test_a_bound_needs_operations_in_order():
    assert "#error" in compile_encode(ALL, SCALES, "opengl").source
    assert "#error" not in compile_encode(ALL, SCALES, language_named("opengl").under("native")).source


def test_refusals():
    with pytest.raises(InputError, match="feature 'heat': unknown"):
        compile_encode(("heat",), SCALES, "opencl")
    with pytest.raises(InputError, match=r"depth_scale 0\.0: must be from"):
        compile_encode(ALL, Normalization(depth_scale=0.0), "opencl")
    with pytest.raises(CompileError, match="target 'abacus': unknown"):
        compile_encode(ALL, SCALES, "abacus")
    with pytest.raises(CompileError, match="sums have no planes normal_y, normal_z: the features normal are"):
        compile_encode(("normal",), SCALES, "opencl", planes=("normal_x",))


@pytest.mark.parametrize("name", HISTORY)
def test_features_of_pictures_before_are_refused(name):
    """HIS-7: a path kernel makes no history."""
    with pytest.raises(InputError, match=f"features '{name}': a path kernel computes layers of one frame"):
        layers_of(("color", name))


def test_the_feature_sun_is_refused():
    """ENV-6: a path kernel sums up what paths meet."""
    with pytest.raises(InputError, match="features 'sun': a path kernel knows what a pixel's paths meet"):
        layers_of(("color", "sun"))
