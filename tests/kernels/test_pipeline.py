"""The pipeline against the separate way, with a bound computed for each pixel, and what it reads back."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from errors_at import encoding_errors
from kit import encoded

from wamnet.compiler.compile import compile_plan
from wamnet.compiler.core import ir
from wamnet.compiler.core.lower import lower
from wamnet.compiler.plan import analysed
from wamnet.compiler.proof import bounds
from wamnet.compiler.scenes.emit_path import GROUPS
from wamnet.compiler.scenes.encode_kernel import compile_encode, encoding_of, layers_of
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import language_named
from wamnet.compiler.variants import FULL, with_rank
from wamnet.kernels import Pipeline, denoise_on, open_executor, render_on
from wamnet.kernels.devices.kernel import Part
from wamnet.kernels.devices.passes import Passes
from wamnet.refimpl.errors import CompileError, InputError
from wamnet.refimpl.frame import SEEN, Frame
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import dataset
from wamnet.refimpl.network.denoise import denoise_pixel
from wamnet.refimpl.network.whole import rounded
from wamnet.refimpl.network.window import all_windows, pad

SCALES = dataset.Normalization(0.5, 12.0, (0.1, -0.2, 0.3), 6.0)
SETTINGS = Settings(max_depth=3)
ALL = tuple(dataset.FIRST_HITS)

EIGHT = (*(name for name in ALL if name != "unshadowed"), "direct")
"""As many features as a shader of OpenGL draws into at once."""

CASES = {
    "minicubes, eight features": ("minicubes", EIGHT, 4, "clamp", (13, 37), 1),
    "cornell, colour and normal": ("cornell", ("color", "normal"), 5, "zero", (9, 17), 3),
    "lone light, odd order": ("lone_light", ("depth", "normal", "color"), 3, "clamp", (7, 1), 2),
    "empty, one pixel": ("empty", ("color", "direction"), 2, "zero", (1, 1), 1),
    "glossy, past mirrors": ("glossy", ("color", *SEEN), 3, "clamp", (9, 11), 2),
    "furnace, many samples": ("furnace", ("albedo", "color"), 1, "zero", (5, 33), 16),
}
"""Scene, features, window, border, (height, width) and samples."""


def scene(name, time=1.3):
    """Return a canonical scene; the mini cubes are turned."""
    return scenes.canonical(name, time=time)


@pytest.fixture(scope="module")
def model_of(kit):
    """Give a function that returns a small model whose pictures lie within 0.5 +- 0.45."""
    return lambda features, size, border: kit.model((8,), features, size, border, SCALES)


def traced(executor, model, name, case, seed):
    """Return the sums (H, W) by plane that the path kernel leaves which writes them, and the encoding."""
    size, samples = case
    part = Part(size[1], size[0], 0, size[0], 0, samples, seed)
    with Pipeline(executor, scene(name), model, size, settings=SETTINGS, sums=True) as pipeline:
        sums = executor.trace(pipeline.path, part)
        return dict(zip(pipeline.path.planes, sums, strict=True)), pipeline.encode


def frame_of(sums, samples, features):
    """Return the frame that render_on makes of sums: means in float64, rounded once."""
    layers = {}
    for name in layers_of(features):
        planes = [plane for plane in sums if plane == name or plane.startswith(f"{name}_")]
        means = [sums[plane].astype(np.float64) / samples for plane in planes]
        layers[name] = np.stack(means, axis=-1).astype(np.float32)
    return Frame(layers)


def difference_bound(model, executor, images, errors):
    """Return how far (H, W, 3) two runs of the denoiser may be apart: on `images`, and on others.

    Images (H, W, C) are off by `errors`. The network's float64 value lies in a range over the box of both,
    and each run is off by its error over that box.
    """
    program = analysed(lower(model))
    ends = []
    for sign in (-1, 1):
        moved = [images[name].astype(np.float64) + sign * errors[name] for name in model.features]
        joined = np.concatenate(moved, axis=-1)
        ends.append(all_windows(pad(joined, model.window), model.window))
    found = bounds.enclose(program, {"window": tuple(ends)}, language_named(executor.name).sine)
    (_, index) = program.outputs[0]
    return found[index].high - found[index].low + 2 * found[index].read


@pytest.mark.product
@pytest.mark.parametrize("sums", [False, True])
@pytest.mark.parametrize("case", CASES)
def test_the_pipeline_is_the_separate_way(executor, model_of, case, sums):
    """Feature images within the encoding's bound of the float64 ones, and the picture within what that costs.

    The float64 ones are made from means that were rounded to float32, and are rounded: twice the bound, which
    has a division and a product with larger errors, holds for both.
    """
    name, features, window, border, size, samples = CASES[case]
    model = model_of(features, window, border)
    with Pipeline(executor, scene(name), model, size, settings=SETTINGS, sums=sums) as pipeline:
        assert bool(pipeline.path.images) == (executor.paints and not sums)
        found = pipeline.run(seed=3, spp=samples)
        images = {feature: pipeline.image(feature) for feature in features}
    sums, encode = traced(executor, model, name, (size, samples), 3)
    errors = encoding_errors(encode, sums, samples)
    assert found.shape == (*size, 3)
    assert found.dtype == np.float32
    frame = frame_of(sums, samples, features)
    wanted = {n: dataset.feature_image(frame, (n,), SCALES) for n in features}
    for feature in features:
        errors[feature] = 2 * errors[feature] + 2.0**-24 * np.abs(wanted[feature])
        assert images[feature].shape == wanted[feature].shape
        assert np.all(np.abs(images[feature].astype(np.float64) - wanted[feature]) <= errors[feature])
    separate = denoise_on(executor, model, frame).image.astype(np.float64)
    bound = difference_bound(model, executor, wanted, errors)
    assert np.all(np.abs(found - separate) <= bound)
    assert bound.max() <= 1e-3  # a bound this small tells colours apart; 2^-8 would be one level of a PNG


@pytest.mark.product
@pytest.mark.parametrize("lanes", [1, 4, 16])
@pytest.mark.parametrize("size", [(1, 1), (4, 16), (9, 33)])
def test_images_at_the_end_of_paths_are_those_of_the_encoding(executor_named, lanes, size):
    """PPL-13: within what both are off; C, whose functions are the same in both kernels, to the bit."""
    part, features = Part(size[1], size[0], 0, size[0], 0, 2, 7), ("depth", "color", "normal")
    programs = lower_scene(scene("lone_light"), SETTINGS)
    for name in ("opencl", "c")[: 2 if lanes == 1 else 1]:
        executor = executor_named(name)
        sums_kernel = compile_path(programs, name, lanes=lanes, groups=layers_of(features))
        sums = executor.trace(sums_kernel, part)
        encode = compile_encode(features, SCALES, name, planes=sums_kernel.planes)
        wanted = encoded(executor, encode, sums, 2)
        kernel = compile_path(programs, name, lanes, layers_of(features), encoding_of(features, SCALES))
        found = executor.call(kernel, {}, part.integers)
        errors = encoding_errors(encode, dict(zip(sums_kernel.planes, sums, strict=True)), 2)
        for feature in features:
            apart = np.abs(found[f"image_{feature}"].astype(np.float64) - wanted[feature])
            assert np.all(apart <= (0 if name == "c" else 2 * errors[feature]))


RAYS = {
    "spread over the pixel": ("minicubes", EIGHT, (13, 37), "pcg4d", "", (4, 1, 0)),
    "at random, later samples": ("cornell", ("color", "normal"), (9, 17), "pcg4d", "pcg4d", (3, 2, 5)),
    "of Sobol points": ("cornell", ("albedo", "color"), (5, 12), "sobol", "", (4, 3, 4)),
    "no colour": ("lone_light", ("depth", "normal"), (7, 3), "pcg4d", "net", (16, 1, 0)),
}
"""Scene, features, (height, width), sampler, features' sampler, (rays, samples, first sample)."""


@pytest.mark.product
@pytest.mark.parametrize("sums", [False, True])
@pytest.mark.parametrize("case", RAYS)
def test_features_of_their_own_rays_are_the_separate_way_s(executor, model_of, case, sums):
    """PPL-14: images are those of the frame with feature_spp, within twice the encoding's bound.

    The frame's sums are the pipeline's in float64, rounded once more as means; where a compiler contracts two
    kernels differently a ray may fall on the other side of an edge, and these pixels are few.
    """
    name, features, size, sampler, source, (rays, spp, first) = RAYS[case]
    model, settings = model_of(features, 3, "clamp"), replace(SETTINGS, sampler=sampler)
    own = {"feature_spp": rays, "feature_sampler": source}
    job = Job(*size[::-1], spp, 3, settings, first_sample=first, shadow_rays=int("direct" in features), **own)
    frame = render_on(executor, scene(name), job).frame
    with Pipeline(executor, scene(name), model, size, settings=settings, sums=sums, **own) as pipeline:
        pipeline.draw(3, spp, first)
        found = {feature: pipeline.image(feature) for feature in features}
        encode = pipeline.encode
    counts = {layer: spp if layer == "color" else rays for layer in frame.layers}
    planes = {
        plane: frame[layer][..., c] * np.float32(counts[layer])
        for layer in layers_of(features)
        for c, plane in enumerate(GROUPS[layer])
    }
    errors, near = encoding_errors(encode, planes, spp), np.ones(size, bool)
    for feature in features:
        wanted = dataset.feature_image(frame, (feature,), SCALES)
        off = 2 * errors[feature] + 2.0**-23 * np.abs(wanted)
        near &= np.all(np.abs(found[feature].astype(np.float64) - wanted) <= off, axis=-1)
    assert near.mean() >= (1.0 if executor.name in ("numpy", "c") else 0.99)


def test_rays_of_features_that_mean_nothing_are_refused(executor_named, model_of):
    executor, model = executor_named("numpy"), model_of(("color",), 1, "zero")
    given = (executor, scene("empty"), model, (2, 2))
    with pytest.raises(InputError, match="feature_sampler 'sobol': in a pipeline the first ray is that of"):
        Pipeline(*given, feature_spp=4, feature_sampler="sobol")
    with pytest.raises(InputError, match="feature_spp 4: in a pipeline the paths see through mirrors"):
        Pipeline(*given, feature_spp=4, show=("seen_albedo",))
    with Pipeline(*given, feature_spp=4) as pipeline:
        with pytest.raises(InputError, match="spp 4: features are of 4 camera rays: there must be fewer"):
            pipeline.draw(0, 4)
        with pytest.raises(InputError, match="first_sample 1: rays of net begin with the ray of sample 0"):
            pipeline.draw(0, 1, 1)
    with Pipeline(*given, feature_spp=1) as pipeline, Pipeline(*given) as plain:
        assert pipeline.path.digest == plain.path.digest


def test_what_writes_encoded_images_is_refused_elsewhere():
    programs = lower_scene(scene("empty"), SETTINGS)
    given = layers_of(("color",)), encoding_of(("color",), SCALES)
    with pytest.raises(CompileError, match="write sums, not encoded images"):
        compile_path(programs, "opengl", 1, *given)


# ---- what stays on the device --------------------------------------------------------------------------


def test_nothing_is_read_back_or_uploaded_in_between_on_opencl(executor_named, model_of, monkeypatch):
    executor, model = executor_named("opencl"), model_of(ALL, 3, "clamp")
    module, copied, uploaded = sys.modules[type(executor).__module__], [], []
    with Pipeline(
        executor, scene("cornell"), model, (9, 21), settings=SETTINGS, variant=with_rank(FULL, 5)
    ) as pipeline:
        pipeline.run()
        real_copy, real_buffer = module.cl.enqueue_copy, module.cl.Buffer

        def copy(queue, target, source, **options):
            copied.append(target.shape)
            return real_copy(queue, target, source, **options)

        def buffer(context, flags, *arguments, **options):
            uploaded.append((arguments, options))
            return real_buffer(context, flags, *arguments, **options)

        monkeypatch.setattr(module.cl, "enqueue_copy", copy)
        monkeypatch.setattr(module.cl, "Buffer", buffer)
        pipeline.draw(1)
        pipeline.passes.finish()
        assert (copied, uploaded) == ([], [])
        pipeline.picture()
        assert copied == [(9, 21, 3)]
        pipeline.image("depth")
        assert copied == [(9, 21, 3), (9, 21, 1)]
        assert uploaded == []


@pytest.mark.product
@pytest.mark.parametrize("name", ["opengl-egl", "opengl-osmesa"])
@pytest.mark.parametrize("rank", [0, 5])
def test_nothing_is_read_back_or_uploaded_in_between_on_opengl(
    executor_named, model_of, monkeypatch, name, rank
):
    executor, model = executor_named(name), model_of(ALL, 3, "clamp")
    module, read, made = sys.modules[type(executor).__module__], [], []
    with Pipeline(
        executor, scene("cornell"), model, (9, 21), settings=SETTINGS, variant=with_rank(FULL, rank)
    ) as pipeline:
        pipeline.run()
        kind, context = module.moderngl.Texture, module.moderngl.Context
        real_read, real_texture = kind.read, context.texture

        def record(self, *arguments, **options):
            read.append(self.size)
            return real_read(self, *arguments, **options)

        def texture(self, *arguments, **options):
            made.append(arguments)
            return real_texture(self, *arguments, **options)

        monkeypatch.setattr(kind, "read", record)
        monkeypatch.setattr(context, "texture", texture)
        pipeline.draw(1)
        pipeline.passes.finish()
        assert (read, made) == ([], [])
        pipeline.picture()
        assert read == [(21, 9)]
        pipeline.image("depth")
        assert read == [(21, 9)] * 2
        assert made == []


# ---- its life ------------------------------------------------------------------------------------------


def test_seed_samples_and_first_sample(executor, model_of):
    """Two samples are those of one and the next: their encoded mean lies between."""
    model = model_of(("normal", "color"), 1, "clamp")
    with Pipeline(executor, scene("cornell"), model, (6, 7), settings=SETTINGS) as pipeline:
        pipeline.draw(1)
        one = pipeline.image("normal")
        pipeline.draw(1, first_sample=1)
        two = pipeline.image("normal")
        pipeline.draw(1, spp=2)
        assert np.all(np.abs(pipeline.image("normal") - (one + two) / 2) <= 8 * 2.0**-24)
        colour = pipeline.image("color")
        pipeline.draw(2, spp=2)
        assert not np.array_equal(pipeline.image("color"), colour)


# ---- refusals ------------------------------------------------------------------------------------------


def test_refusals(executor, model_of):
    model = model_of(("color",), 1, "clamp")
    with Pipeline(executor, scene("empty"), model, (2, 3)) as pipeline:
        with pytest.raises(InputError, match="pipeline: has rendered no image yet"):
            pipeline.picture()
        with pytest.raises(InputError, match="feature image 'normal': is not one of color"):
            pipeline.image("normal")
        with pytest.raises(InputError, match="spp 17: a pipeline adds up in float32: at most 16"):
            pipeline.draw(spp=17)
        with pytest.raises(InputError, match="seed -1: must be an integer"):
            pipeline.draw(seed=-1)
        pipeline.draw()
    for use in (pipeline.draw, pipeline.picture, lambda: pipeline.image("color")):
        with pytest.raises(InputError, match=r"pipeline: closed \(open a new one"):
            use()
    pipeline.close()
    with pytest.raises(InputError, match="width 0: must be an integer"):
        Pipeline(executor, scene("empty"), model, (2, 0))
    with pytest.raises(InputError, match="feature 'heat': unknown"):
        Pipeline(executor, scene("empty"), model, (2, 2), show=("heat",))


@pytest.mark.needs("devices")
def test_kernels_in_another_language_are_refused(executor, model_of):
    model = model_of(("color",), 1, "clamp")
    other = "opencl" if executor.name == "numpy" else "numpy"
    with (
        open_executor(other) as elsewhere,
        Pipeline(elsewhere, scene("empty"), model, (2, 2)) as pipeline,
        pytest.raises(InputError, match=f"artifact for executor '{executor.name}': target '{other}'"),
    ):
        Passes(executor, pipeline.encode, pipeline.denoise, (2, 2))


def test_too_large_a_picture_is_refused(executor_named, model_of):
    model = model_of(("color",), 1, "clamp")
    with pytest.raises(
        InputError, match=r"texture for 'image_color' '65536 x 1 with 4 channels': this OpenGL"
    ):
        Pipeline(executor_named("opengl-egl"), scene("empty"), model, (1, 65536))
    with pytest.raises(InputError, match=r"size of the image on .* '65536 x 65536 with 3 channels': one im"):
        Pipeline(executor_named("opencl"), scene("empty"), model, (65536, 65536))


def test_a_pipeline_of_integers_shows_what_they_stand_for(executor, model_of):
    """Its pictures are those of the network on images that the device rounds: a step is 1 / 127."""
    model = model_of(("color", "normal"), 3, "clamp")
    whole = replace(model, siren=rounded(model.siren, 3))
    with Pipeline(executor, scene("cornell"), whole, (5, 7), settings=SETTINGS) as pipeline:
        found = pipeline.run(seed=3)
        shown = {name: pipeline.image(name) for name in whole.features}
    steps = {name: np.rint(image * 127).astype(np.float32) for name, image in shown.items()}
    assert all(np.array_equal(steps[n] / np.float32(127), image) for n, image in shown.items())
    joined = np.concatenate(list(steps.values()), axis=-1)
    windows = all_windows(pad(joined, whole.window), whole.window)
    assert found.tobytes() == denoise_pixel(whole.siren, windows).tobytes()
    with Pipeline(executor, scene("cornell"), model, (5, 7), settings=SETTINGS) as pipeline:
        pipeline.run(seed=3)
        for name, image in shown.items():
            # Half a step, and the rounding of 127 x + 1/2 in float32.
            assert np.abs(image - pipeline.image(name)).max() <= 0.5 / 127 + 2.0**-16


@pytest.mark.nightly(but=("numpy",))
def test_another_time_compiles_paths_alone(executor, model_of, monkeypatch):
    """The picture of another time is that of a pipeline made for it; encoding and denoiser stay built."""
    model, size = model_of(("color", "normal"), 3, "clamp"), (8, 12)
    with Pipeline(executor, scene("cornell", 2.0), model, size, settings=SETTINGS) as pipeline:
        wanted = pipeline.run(4)
    with Pipeline(executor, scene("cornell", 1.0), model, size, settings=SETTINGS) as pipeline:
        other = pipeline.run(4)
        kernels = pipeline.encode, pipeline.denoise
        pipeline.set_scene(scene("cornell", 2.0))
        assert np.array_equal(pipeline.run(4), wanted)
        assert kernels == (pipeline.encode, pipeline.denoise)
    assert np.abs(other - wanted).max() > 1e-3


def test_the_first_picture_waits_for_no_proof(executor_named, model_of):
    """PPL-15: the bound in its header is a valid one, without a certificate's search for a small one."""
    model, executor = model_of(("color", "normal"), 3, "clamp"), executor_named("numpy")
    with Pipeline(executor, scene("furnace"), model, (8, 12), settings=SETTINGS) as pipeline:
        made = pipeline.denoise
    assert made.certificate is None
    assert made.plan.unproven == "it was compiled to be run at once, without one"
    proven = compile_plan(replace(made.plan, proves=True))
    assert proven.certificate is not None
    assert all(0 < error < 1 / 255 for error in made.manifest["bound"]["output"])
    assert ir.digest(made.kernels[0].programs) == ir.digest(proven.kernels[0].programs)


def test_forgotten_kernels_are_built_again(executor, model_of):
    model = model_of(("color",), 3, "clamp")
    with Pipeline(executor, scene("lone_light"), model, (5, 4)) as pipeline:
        first = pipeline.run(seed=3)
        executor.forget()
        assert not executor._built
        assert np.array_equal(pipeline.run(seed=3), first)
