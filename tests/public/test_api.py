"""The public module: each function against what it stands for, and its errors."""

import subprocess
import sys

import numpy as np
import pytest

import wamnet
from wamnet.refimpl.encoding import from_display
from wamnet.refimpl.network import siren
from wamnet.refimpl.network import train as reference_training
from wamnet.refimpl.network.dataset import Normalization
from wamnet.refimpl.network.denoise import Model
from wamnet.refimpl.network.denoise import denoise as reference
from wamnet.refimpl.network.window import Window


@pytest.fixture(scope="module")
def frame():
    return wamnet.render("minicubes", time=2.5, width=24, height=16, executor="numpy")


@pytest.fixture(scope="module")
def model(frame):
    features = ("color", "normal", "albedo")
    return wamnet.train(frame, frame, preset="short", steps=3, features=features, executor="numpy")


@pytest.mark.needs("programs")
def test_importing_it_imports_nothing_else():
    code = "import sys, wamnet; dir(wamnet); print('numpy' in sys.modules, 'typer' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False"]


def test_names_are_there_and_documented():
    assert sorted(wamnet.__all__) == dir(wamnet)
    for name in wamnet.__all__:
        assert getattr(wamnet, name).__doc__
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        wamnet.nothing  # noqa: B018 - that it is not there


def test_a_bundled_model_loads_by_name(tmp_path):
    model = wamnet.load("cornell")
    assert repr(model).count("\n") == 1
    assert "trained on scene cornell" in repr(model)
    assert wamnet.load(model) is model
    with pytest.raises(wamnet.WamnetError, match="choose one of cornell, cornell-basic, glossy"):
        wamnet.load("spheres")
    with pytest.raises(wamnet.WamnetError, match="not found"):
        wamnet.load(tmp_path / "none.safetensors")


def test_rendering_is_the_references(frame):
    from wamnet.refimpl.light.render import Job, render
    from wamnet.refimpl.light.scenes import canonical

    expected = render(canonical("minicubes", time=2.5), Job(24, 16)).frame
    assert all(np.array_equal(frame[name], expected[name]) for name in expected.layers)


def test_denoising_takes_arrays_by_name(frame, model):
    """Of the reference, and linear or display-encoded."""
    expected = reference(model, frame)
    layers = {name: frame[name] for name in model.features}
    encoded = wamnet.denoise(model, executor="numpy", encoded=True, **layers)
    assert np.array_equal(encoded, expected)
    assert encoded.dtype == np.float32
    linear = wamnet.denoise(model, frame, executor="numpy")
    assert linear.dtype == np.float32
    assert np.array_equal(linear, wamnet.denoise(model, layers, executor="numpy"))
    exposure = model.normalization.exposure_stops
    assert np.array_equal(linear, from_display(encoded, exposure))


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        ({"normal": None}, "layer 'normal'"),
        ({"normal": np.zeros((2, 2, 3), np.float32)}, "size"),
        ({"albedo": np.zeros((16, 24, 3), np.uint8)}, "layers are floats"),
        ({"albdo": np.zeros((16, 24, 3), np.float32)}, "albdo"),
    ],
)
def test_layers_that_do_not_fit(frame, model, change, rule):
    layers = {**{name: frame[name] for name in model.features}, **change}
    layers = {name: array for name, array in layers.items() if array is not None}
    with pytest.raises(wamnet.WamnetError, match=rule):
        wamnet.denoise(model, executor="numpy", **layers)


def test_training_is_the_references(frame, model):
    from dataclasses import replace

    recipe = replace(reference_training.SHORT, steps=3, features=("color", "normal", "albedo"))
    expected = reference_training.model_of(reference_training.train(recipe, [(frame, frame)]))
    for mine, its in zip(model.siren.weights, expected.siren.weights, strict=True):
        assert np.array_equal(mine, its)
    assert model.info["trained_on_scene"] == "minicubes"
    with pytest.raises(wamnet.WamnetError, match="each of 2 noisy frames"):
        wamnet.train([frame, frame], frame)
    with pytest.raises(wamnet.WamnetError, match="choose one of best"):
        wamnet.train(frame, frame, preset="good")


@pytest.mark.needs("programs")
def test_a_kernel_is_compiled_saved_and_certified(tmp_path):
    model = Model(siren.init([27, 4, 4, 3], 2.0, 2.0, seed=5), ("color",), Window(3), Normalization())
    kernel = wamnet.compile(model, "c", schedule="tile:8")
    assert (kernel.target, kernel.schedule) == ("c", "tile:8")
    assert f"{kernel.weights.size} weights" in repr(kernel)
    assert kernel.bound is not None
    files = kernel.save(tmp_path / "kernel")
    assert kernel.source in [path.read_text() for path in files if path.suffix == ".h"]
    certificate = wamnet.certify(tmp_path / "kernel")
    assert certificate == wamnet.certify(kernel)
    assert np.all(np.less_equal(certificate.bound, kernel.bound))
    (tmp_path / "kernel/manifest.json").write_text("{}")
    with pytest.raises(wamnet.WamnetError, match="certificate"):
        wamnet.certify(tmp_path / "kernel")
    with pytest.raises(wamnet.CertificateError, match="no certificate"):
        wamnet.certify(tmp_path)
    with pytest.raises(wamnet.WamnetError, match="choose one of glsl, numpy, opencl"):
        wamnet.compile(model, "fortran")
    with pytest.raises(wamnet.WamnetError, match=r"exact was removed; use .* whole8"):
        wamnet.compile("minicubes", "c", profile="exact")


def test_an_export_is_a_folder(model, tmp_path):
    folder = wamnet.export(model, tmp_path / "wgsl", target="wgsl")
    assert (folder / "denoise/manifest.json").is_file()
    with pytest.raises(wamnet.WamnetError, match="not empty"):
        wamnet.export(model, folder, target="wgsl")
    with pytest.raises(wamnet.WamnetError, match="target="):
        wamnet.export(model, tmp_path / "nowhere")


def tone(pixel):
    """Compress luminance (Reinhard et al. 2002)."""
    luminance = 0.2126 * pixel[..., 0] + 0.7152 * pixel[..., 1] + 0.0722 * pixel[..., 2]
    return np.stack([pixel[..., i] / (1.0 + luminance) for i in range(3)], axis=-1)


def test_a_function_of_the_callers_becomes_a_kernel():
    function = wamnet.trace(tone, {"color": 3}, ranges={"color": (0.0, 4.0)})
    assert repr(function).splitlines()[2] == "  image color: 3 in [0.0, 4.0]"
    kernel = function.compile("numpy")
    image = np.random.default_rng(1).uniform(0, 4, (5, 7, 3)).astype(np.float32)
    exact = tone(image.astype(np.float64))
    assert kernel.bound is not None
    assert np.abs(kernel.run(color=image) - exact).max() <= max(kernel.bound)
    assert "texelFetch(image_color" in function.compile("glsl").source
    with pytest.raises(wamnet.WamnetError, match="a decision"):
        wamnet.trace(lambda pixel: pixel if pixel[..., 0] > 0 else -pixel, {"color": 3})
    with pytest.raises(wamnet.WamnetError, match="name an image"):
        wamnet.trace(tone, {"color": 3}, ranges={"colour": (0, 1)})


@pytest.mark.needs("devices")
def test_a_function_with_a_window_runs_on_a_device():
    weights = np.full(9, 0.125, np.float32)

    def mean(window):
        return window @ weights[:, None]

    kernel = wamnet.trace(mean, {"depth": 1}, window=3).compile("c")
    image = np.random.default_rng(2).uniform(0, 1, (6, 5, 1)).astype(np.float32)
    inside = 0.125 * np.sum(
        [image[y : y + 4, x : x + 3].astype(np.float64) for y in range(3) for x in range(3)], axis=0
    )
    assert kernel.bound is not None
    assert np.abs(kernel.run(depth=image)[1:-1, 1:-1] - inside).max() <= max(kernel.bound)


def test_executors_are_those_that_open():
    assert wamnet.executors()["numpy"].startswith("NumPy")
