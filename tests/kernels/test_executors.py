"""Every executor against the float64 reference, with the bound that the compiler computes for each pixel."""

import gc
import os
import subprocess
import sys
from contextlib import ExitStack

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kit import networks, pictures

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.trace import trace
from wamnet.compiler.targets import language_named
from wamnet.kernels import denoise_on, open_executor
from wamnet.kernels.devices import llvmpipe
from wamnet.kernels.devices.kernel import black
from wamnet.refimpl import frame
from wamnet.refimpl.errors import CompileError, InputError
from wamnet.refimpl.network import denoise
from wamnet.refimpl.network.activation import ACTIVATIONS
from wamnet.refimpl.network.window import Window

EXAMPLES = settings.default.max_examples // 10
"""Each example compiles a kernel, up to a second on Mesa: a tenth of what other tests draw."""


@st.composite
def cases(draw):
    """Draw a network, how its images look, and images."""
    case = draw(networks(12, 9, 4, wide=True))
    images = pictures(case["channels"], tuple(min(n, 14) for n in case["shape"]), case["seed"])
    kind = draw(st.sampled_from(["random", "constant", "extreme"]))
    if kind != "random":
        change = np.sign if kind == "extreme" else lambda x: np.full_like(x, x.flat[0] / 2)
        images = {name: 2 * change(values) for name, values in images.items()}
    return {
        **case,
        "images": images,
        "omegas": draw(st.tuples(st.floats(1, 30), st.floats(1, 30))),
        "scale": draw(st.sampled_from([0.25, 1.0, 3.0])),
        "activation": draw(st.sampled_from(sorted(ACTIVATIONS))),
    }


@pytest.mark.product
@settings(max_examples=EXAMPLES)
@given(case=cases())
def test_error_is_within_the_bound(denoiser, kit, case):
    """KER-3 too: windows reach beyond every side of these images, under both border rules."""
    network = kit.network(case["widths"], case["omegas"], case["seed"], case["scale"], case["activation"])
    program = kit.denoiser(network, case["channels"], case["size"], case["border"])
    (seen,) = interpret(program, {"window": kit.windows(program, case["images"])}, np.float64).values()
    assert ((seen > 0) & (seen < 1)).all()
    assert kit.excess(denoiser, program, case["images"]) <= 1


@pytest.mark.parametrize(("hidden", "runs"), [([64], False), ([48, 48], True)])
def test_mesa_s_loops_are_complete_or_refused(executor_named, kit, hidden, runs):
    """llvmpipe ends loops after 65535 iterations in all: sums over five images have more with 64 neurons."""
    executor = executor_named("opengl-egl")
    channels = dict.fromkeys("abcde", 3)
    program = kit.denoiser(kit.network([960, *hidden, 3], (3.0, 3.0)), channels, 8, "clamp")
    random = np.random.default_rng(7)
    images = {name: random.uniform(-1, 1, (3, 4, 3)).astype(np.float32) for name in channels}
    artifact = compile_program(program, executor.name)
    if not runs and llvmpipe.NAME in executor.device:
        with pytest.raises(
            CompileError, match=r"loops take 69\d+ iterations.*use executor c, opencl or numpy"
        ):
            executor.build(artifact)
    else:
        assert kit.excess(executor, program, images, artifact) <= 1


def test_iterations_of_loops():
    """What is unrolled counts as nothing, another loop once more than its body."""
    inner = "for (int j = 0; j < {} ; ++j) {{\n x;\n}}\n".replace(" ;", ";").format
    outer = "#define SIZE 5\nfor (int i = 0; i < SIZE; ++i) {{\n{}}}\n".format
    assert llvmpipe.iterations(outer(inner(32))) == 0
    assert llvmpipe.iterations(outer(inner(33))) == 5 * 34 + 6
    assert llvmpipe.iterations("void main()\n{\n" + inner(40) + inner(50) + "}\n") == 41 + 51


def test_target_s_own_sine_on_opencl(executor_named, kit):
    executor = executor_named("opencl")
    program = kit.denoiser(kit.network([27, 8, 8, 3], (9.0, 9.0)), {"a": 3}, 3, "clamp")
    images = {"a": np.random.default_rng(6).uniform(-2, 2, (9, 9, 3)).astype(np.float32)}
    assert (
        kit.excess(
            executor, program, images, compile_program(program, language_named("opencl").under("native"))
        )
        <= 1
    )


@pytest.mark.parametrize("name", ["numpy", "opengl-egl", "opengl-osmesa"])
def test_target_s_own_sine_without_promise_runs_but_has_no_bound(executor_named, kit, name):
    executor = executor_named(name)
    program = kit.denoiser(kit.network([27, 8, 3], (9.0, 9.0)), {"a": 3}, 3, "clamp")
    artifact = compile_program(program, language_named(executor.name).under("native"))
    found = executor.run(artifact, {"a": np.full((3, 4, 3), 0.5, np.float32)})
    assert ((found >= 0) & (found <= 1)).all()
    assert artifact.manifest["bound"]["output"] is None
    assert "promises nothing" in artifact.source


def test_row_0_is_the_top_row_and_columns_are_not_mirrored(denoiser, kit):
    image = np.arange(5 * 7, dtype=np.float32).reshape(5, 7, 1) / 64
    artifact = compile_program(kit.program(lambda x: x * 1.0, {"a": 1}), denoiser.name)
    assert np.array_equal(denoiser.run(artifact, {"a": image}), image)


def test_denoise_on_equals_the_definition(denoiser, kit):
    """Whole frames: the float64 `denoise` is the reference, the bound the a-priori one, over all images."""
    random = np.random.default_rng(7)
    model = kit.model(border="zero")
    noisy = frame.Frame(
        {
            "color": random.uniform(0, 4, (6, 11, 3)).astype(np.float32),
            "normal": random.uniform(-1, 1, (6, 11, 3)).astype(np.float32),
        }
    )
    result = denoise_on(denoiser, model, noisy)
    bound = compile_program(lower(model), denoiser.name).manifest["bound"]["output"]
    assert result.image.shape == (6, 11, 3)
    assert result.device == denoiser.device
    assert (np.abs(result.image - denoise.denoise(model, noisy, np.float64)) <= bound).all()


# ---- refusals ----------------------------------------------------------------------------------------


@pytest.fixture
def small(executor, kit):
    return executor, compile_program(kit.program(lambda x: x * 2.0, {"a": 3}), executor.name)


@pytest.mark.parametrize(
    ("images", "message"),
    [
        ({}, "images for the kernel '': must be a"),
        ({"b": np.zeros((2, 2, 3), np.float32)}, "images for the kernel 'b': must be a"),
        (
            {"a": np.zeros((2, 2, 1), np.float32)},
            r"image 'a' 'float32 of shape \(2, 2, 1\)': must be float32 of",
        ),
        ({"a": np.zeros((2, 2, 3))}, "image 'a' 'float64 of shape"),
        ({"a": np.zeros((0, 2, 3), np.float32)}, "image 'a' 'float32 of shape"),
        (
            {"a": np.full((2, 2, 3), np.nan, np.float32)},
            "image 'a' at row 0, column 0 .*: all values must be",
        ),
        (
            {"a": np.float32([[[0, 0, 0], [2, -2, 0]], [[0, -2.0000002, 0], [9, 9, 9]]])},
            r"image 'a' at row 1, column 0 \[0.0, -2.000000.*\]: the kernel's bound holds for values in "
            r"\[-2.0, 2.0\] \(encode the frame's",
        ),
    ],
)
def test_wrong_images_are_refused(small, images, message):
    executor, artifact = small
    with pytest.raises(InputError, match=message):
        executor.run(artifact, images)


def test_kernel_in_another_language_is_refused(small, kit):
    executor, _ = small
    other = "opencl" if executor.name == "numpy" else "numpy"
    artifact = compile_program(kit.program(lambda x: x * 2.0, {"a": 3}), other)
    with pytest.raises(InputError, match=f"artifact for executor '{executor.name}': target '{other}'"):
        executor.run(artifact, {"a": np.zeros((2, 2, 3), np.float32)})


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["opencl", "opengl-egl"])
def test_source_that_does_not_compile_is_told_with_the_log(executor_named, kit, name):
    executor = executor_named(name)
    artifact = compile_program(kit.program(lambda x: x * 2.0, {"a": 3}), executor.name)
    broken = kit.with_source(artifact, "int y = ", "int y = nonsense + ")
    with pytest.raises(CompileError, match=r"(?s)cannot build the kernel: .*nonsense"):
        executor.run(broken, {"a": np.zeros((2, 2, 3), np.float32)})


# ---- the limits of devices ---------------------------------------------------------------------------


def wide(kit, width):
    """Return a program with one hidden layer of `width` numbers over a window of one number."""
    first, last = np.full((width, 1), 0.01, np.float32), np.full((1, width), 0.5 / width, np.float32)
    return kit.program(lambda x: np.matmul(np.sin(np.matmul(x, first.T)), last.T), {"a": 1})


@pytest.mark.parametrize("width", [1_000, 30_000, 120_000])
def test_wide_layers_run_on_opencl(executor_named, kit, width):
    """Arrays of 8 bytes a neuron: groups of 64 pixels would need up to 60 MB of a thread's 8 MB stack.

    The picture is small, for the reference holds all neurons of all pixels; a group has its arrays anyway.
    """
    program = wide(kit, width)
    images = {"a": np.random.default_rng(2).uniform(-2, 2, (1, 3, 1)).astype(np.float32)}
    assert kit.excess(executor_named("opencl"), program, images) <= 1


def test_too_wide_a_layer_is_refused_on_a_processor(executor_named, kit):
    executor = executor_named("opencl")
    if "pthread" not in executor.device and "cpu" not in executor.device.lower():
        pytest.skip(f"{executor.device} is not a processor: its arrays lie on no stack")
    with pytest.raises(
        CompileError,
        match=r"arrays take 1200004 bytes per pixel; at most 1048576",
    ):
        executor.build(compile_program(wide(kit, 150_000), "opencl"))


def test_weights_that_no_texture_holds(executor_named, kit, monkeypatch):
    executor = executor_named("opengl-egl")
    monkeypatch.setitem(executor._context.info, "GL_MAX_TEXTURE_SIZE", 4)
    with pytest.raises(
        CompileError, match="6002 weights fill 6 rows of a texture: this OpenGL takes at most 4"
    ):
        executor.build(compile_program(wide(kit, 3_001), "opengl"))


@pytest.mark.parametrize("size", [(65536, 16384), (2**20, 2**20)])
def test_picture_beyond_a_buffer_is_refused_before_it_is_copied(executor_named, kit, size):
    executor = executor_named("opencl")
    artifact = compile_program(kit.program(lambda x: x[..., 0], {"a": 2}), "opencl")
    with pytest.raises(
        InputError,
        match=rf"size of the image on .* '{size[1]} x {size[0]} with 2 channels': one image must",
    ):
        executor.check_size(artifact, size)


def test_device_that_runs_out_of_memory_is_told_on_one_line(executor_named, kit, monkeypatch):
    executor = executor_named("opencl")
    artifact = compile_program(kit.program(lambda x: x * 1.5, {"a": 1}), "opencl")
    executor.build(artifact)

    def full(name, array):
        raise MemoryError("no\nmemory")

    monkeypatch.setattr(executor, "_store", full)
    with pytest.raises(InputError, match=r"'3 x 2': the device cannot run it: no memory \(split the image"):
        executor.run(artifact, {"a": np.zeros((2, 3, 1), np.float32)})


@pytest.mark.parametrize("name", ["opencl", "opengl-egl"])
def test_old_kernels_are_given_back(executor_named, kit, monkeypatch, name):
    executor = executor_named(name)
    monkeypatch.setattr(sys.modules[type(executor).__mro__[1].__module__], "KEPT_KERNELS", 2)
    artifacts = [
        compile_program(kit.program(lambda x, f=f: x * f, {"a": 1}), executor.name) for f in (1.1, 1.2, 1.3)
    ]
    for artifact in (artifacts[0], artifacts[1], artifacts[0], artifacts[2]):
        executor.build(artifact)
    assert list(executor._built) == [artifacts[0].digest, artifacts[2].digest]
    image = np.full((2, 2, 1), 0.5, np.float32)
    assert kit.excess(executor, kit.program(lambda x: x * 1.2, {"a": 1}), {"a": image}, artifacts[1]) <= 1


WITHOUT_PRECISE = """
import numpy as np
from wamnet import kernels
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Gather, Image, Type
from wamnet.compiler.core.trace import trace
from wamnet.compiler.targets import language_named
from wamnet.refimpl.network.window import Window

gather = Gather(Window(1, "clamp"), (Image("a", 1, -1.0, 1.0),))
program = trace(lambda x: np.sin(x), {"window": Type(shape=(1,))}, gather)
image = {"a": np.ones((1, 1, 1), np.float32)}
with kernels.open_executor("opengl", context="egl") as executor:
    print(executor.run(compile_program(program, language_named("opengl").under("native")), image).item())
    try:
        executor.run(compile_program(program, "opengl"), image)
    except Exception as error:
        print(type(error).__name__, error)
"""


def test_bounded_kernel_is_refused_without_precise(executor_named):
    """Mesa hides the extension that brings `precise`: the profile without a bound runs, the other not."""
    executor_named("opengl-egl")
    outcome = subprocess.run(
        [sys.executable, "-c", WITHOUT_PRECISE],
        env={**os.environ, "MESA_EXTENSION_OVERRIDE": "-GL_ARB_gpu_shader5"},
        capture_output=True,
        text=True,
        check=True,
    )
    value, refusal = outcome.stdout.splitlines()
    assert abs(float(value) - np.sin(1.0)) <= 1e-3  # a GPU's own sine is right to 2^-11 at least
    assert refusal.startswith("CompileError")
    assert "lacks GL_ARB_gpu_shader5, which the error bound needs (`precise`): use profile native" in refusal


def test_too_large_a_texture_is_refused(executor_named, kit):
    executor = executor_named("opengl-egl")
    artifact = compile_program(kit.program(lambda x: x * 2.0, {"a": 1}), "opengl")
    with pytest.raises(
        InputError, match="texture for 'a' '100000 x 1 with 1 channels': this OpenGL takes at most"
    ):
        executor.run(artifact, {"a": np.zeros((1, 100000, 1), np.float32)})


def test_two_contexts_that_open_before_either_runs(executor_named):
    """EGL took its context for the current one, and drew in OSMesa: black, or another kernel's picture."""
    kinds = ("egl", "osmesa")
    for kind in kinds:
        executor_named(f"opengl-{kind}")  # or the test is skipped
    gather = Gather(Window(1, "clamp"), (Image("a", 1, 0.0, 1.0),))
    artifacts = [
        compile_program(trace(lambda x, f=factor: x * f, {"window": Type(shape=(1,))}, gather), "opengl")
        for factor in (2.0, 3.0)
    ]
    with ExitStack() as opened:
        found = [opened.enter_context(open_executor("opengl", context=kind)) for kind in kinds]
        for executor in found:
            for artifact, factor in zip(artifacts, (2.0, 3.0), strict=True):
                picture = executor.run(artifact, {"a": np.full((2, 2, 1), 0.25, np.float32)})
                assert np.array_equal(picture, np.full((2, 2, 1), 0.25 * factor, np.float32))


def test_a_refused_texture_gives_the_others_back(executor_named, kit, monkeypatch):
    executor = executor_named("opengl-egl")
    artifact = compile_program(kit.program(lambda x: x * 1.5, {"a": 1, "b": 1}), "opengl")
    executor.build(artifact, (3, 3))
    made = []
    real = executor._texture

    def texture(name, shape, content):
        if name == "b":
            raise InputError("texture", name, "refused", "none")
        made.append(real(name, shape, content))
        return made[-1]

    monkeypatch.setattr(executor, "_texture", texture)
    with pytest.raises(InputError, match="texture 'b"):
        executor.run(artifact, {name: np.zeros((3, 3, 1), np.float32) for name in "ab"})
    assert [type(thing.mglo).__name__ for thing in made] == ["InvalidObject"]


def test_opengl_keeps_nothing_of_a_picture_s_size(kit):
    """Textures and framebuffers of thirty sizes are given back; what lives is the weights."""
    moderngl = pytest.importorskip("moderngl")
    program = kit.denoiser(kit.network([27, 4, 3], (2.0, 2.0)), {"a": 3}, 3, "clamp")
    artifact = compile_program(program, language_named("opengl").under("native"))

    def living():
        kinds = (moderngl.Texture, moderngl.Framebuffer, moderngl.Buffer)
        # By type: isinstance would ask other packages' lazy objects for their class.
        things = [thing for thing in gc.get_objects() if type(thing) in kinds]
        return sum(not isinstance(thing.mglo, moderngl.mgl.InvalidObject) for thing in things)

    with open_executor("opengl") as executor:

        def run(size):
            executor.build(artifact, size)
            executor.run(artifact, black(artifact, size))

        run((5, 4))
        before = living()
        for number in range(30):
            run((6 + number, 40 - number))
        assert living() == before
        assert before > 0
