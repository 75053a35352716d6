"""Opening executors: names, options, and what is said when something is missing."""

import builtins
import sys
from types import SimpleNamespace

import pytest

from wamnet import kernels
from wamnet.kernels.devices import registry
from wamnet.refimpl.errors import ExecutorUnavailable, InputError


@pytest.mark.parametrize(
    ("needed", "name", "options", "message"),
    [
        ("numpy", "metal", {}, r"executor 'metal': unknown \(choose one of numpy, opencl, opengl, c"),
        ("opencl", "opencl", {"device": "abacus"}, "no device matches 'abacus'; choose a part of one of: "),
        (
            "opengl-egl",
            "opengl",
            {"context": "glx"},
            "context 'glx': unknown .choose one of auto, egl",
        ),
    ],
)
def test_what_is_not_there_is_told_with_the_choices(executor_named, needed, name, options, message):
    executor_named(needed)
    with pytest.raises((InputError, ExecutorUnavailable), match=message):
        kernels.open_executor(name, **options)


@pytest.mark.parametrize(("name", "package"), [("opencl", "pyopencl"), ("opengl", "moderngl")])
def test_missing_package_is_named_with_the_way_to_get_it(monkeypatch, name, package):
    real = builtins.__import__

    def without(module, *args, **options):
        if module == package:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)
        return real(module, *args, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.delitem(sys.modules, f"{registry.__package__}.{name}_executor", raising=False)
    with pytest.raises(
        ExecutorUnavailable, match=rf"{name}: package {package} .* pip install 'wamnet\[{name}\]'"
    ):
        kernels.open_executor(name)


def test_opencl_device_is_chosen_by_a_part_of_its_name(executor_named, monkeypatch):
    device = executor_named("opencl").device
    monkeypatch.setenv("WAMNET_OPENCL_DEVICE", device[-5:].upper())
    with kernels.open_executor("opencl") as executor:
        assert executor.device == device


@pytest.mark.parametrize(
    ("profile", "rounding", "message"),
    [
        ("EMBEDDED_PROFILE", True, "box has EMBEDDED_PROFILE: error bounds need FULL_PROFILE and round"),
        ("FULL_PROFILE", False, "box has FULL_PROFILE, not rounding to nearest: error bounds need FULL_"),
    ],
)
def test_opencl_device_with_other_arithmetic(executor_named, monkeypatch, profile, rounding, message):
    executor_named("opencl")
    from wamnet.kernels.devices import opencl_executor

    nearest = opencl_executor.cl.device_fp_config.ROUND_TO_NEAREST if rounding else 0
    device = SimpleNamespace(profile=profile, single_fp_config=nearest)
    monkeypatch.setattr(opencl_executor, "_choose", lambda wanted: device)
    monkeypatch.setattr(opencl_executor, "_describe", lambda device: "box")
    with pytest.raises(ExecutorUnavailable, match=message):
        kernels.open_executor("opencl")


def test_no_opengl_context_names_what_was_tried(executor_named, monkeypatch):
    executor_named("opengl-egl")
    from wamnet.kernels.devices import opengl_executor

    def fails():
        raise OSError("no library")

    monkeypatch.setattr(opengl_executor, "CONTEXTS", {"egl": fails, "osmesa": fails})
    with pytest.raises(
        ExecutorUnavailable, match=r"egl: no library; install libegl1.*osmesa: no library; install"
    ):
        kernels.open_executor("opengl")


@pytest.mark.parametrize(
    ("function", "message"),
    [
        ("OSMesaCreateContextAttribs", "gives no OpenGL 3.3 core"),
        ("OSMesaMakeCurrent", "does not make its context"),
    ],
)
def test_osmesa_that_refuses(executor_named, monkeypatch, function, message):
    executor_named("opengl-osmesa")
    from wamnet.kernels.devices import osmesa

    library = osmesa._load()
    setattr(library, function, lambda *_: 0)
    monkeypatch.setattr(osmesa, "_load", lambda: library)
    with pytest.raises(OSError, match=message):
        osmesa.OSMesaContext()


def test_automatic_context_opens_one(executor_named):
    executor_named("opengl-egl")
    with kernels.open_executor("opengl") as executor:
        assert "through" in executor.device


class Device:
    """An executor that opens."""

    def __init__(self, trains: bool = False, device: str = "llvmpipe (LLVM 15.0.6, 256 bits)") -> None:
        self.trains, self.device = trains, device

    def __enter__(self) -> "Device":
        return self

    def __exit__(self, *_error: object) -> None:
        """Close nothing."""


@pytest.mark.parametrize(
    ("there", "trains", "name", "passed"),
    [
        ({"opencl": Device(), "c": Device()}, False, "opencl", []),
        ({"c": Device(), "opengl": Device()}, False, "c", ["opencl: missing"]),
        ({"opengl": Device()}, False, "opengl", ["opencl: missing", "c: missing"]),
        (
            {"opengl": Device(device="softpipe through egl")},
            False,
            "numpy",
            ["opencl", "c", "opengl: softpipe through egl interprets shaders"],
        ),
        ({}, False, "numpy", ["opencl: missing", "c: missing", "opengl: missing"]),
        ({"opencl": Device(trains=True)}, True, "opencl", []),
        ({"opencl": Device()}, True, "numpy", ["opencl: it does not train", "c: missing", "opengl: missing"]),
    ],
)
def test_the_fastest_that_opens_is_chosen(monkeypatch, there, trains, name, passed) -> None:
    """In the measured order; an interpreter of shaders is slower than NumPy; all passed over have reasons."""

    def opened(name: str) -> Device:
        if name not in there:
            raise ExecutorUnavailable(f"{name}: missing")
        return there[name]

    monkeypatch.setattr(registry, "open_executor", opened)
    found, reasons = registry.fastest(trains)
    assert found == name
    assert len(reasons) == len(passed)
    assert all(reason.startswith(begin) for reason, begin in zip(reasons, passed, strict=True))


def test_no_opencl_platform(executor_named, monkeypatch):
    executor_named("opencl")
    from wamnet.kernels.devices import opencl_executor

    monkeypatch.setattr(opencl_executor.cl, "get_platforms", list)
    with pytest.raises(
        ExecutorUnavailable, match=r"no platform is installed; pip install 'wamnet\[opencl\]'"
    ):
        kernels.open_executor("opencl")


def test_opencl_platform_that_fails_is_passed_over(executor_named, monkeypatch):
    device = executor_named("opencl").device
    from wamnet.kernels.devices import opencl_executor

    class Broken:
        def get_devices(self):
            raise opencl_executor.cl.LogicError("clGetDeviceIDs failed")

    real = opencl_executor.cl.get_platforms()
    monkeypatch.setattr(opencl_executor.cl, "get_platforms", lambda: [Broken(), *real])
    with kernels.open_executor("opencl") as executor:
        assert executor.device == device


@pytest.mark.parametrize(("newest", "asked"), [(430, [430]), (330, [430, 330])])
def test_driver_that_gives_the_required_version_is_asked_for_compute_shaders(
    executor_named, monkeypatch, newest, asked
):
    executor_named("opengl-egl")
    from wamnet.kernels.devices import opengl_executor

    required = []

    def create(require, **options):
        required.append(require)
        if require > newest:
            raise ValueError(f"version {require} is not supported")
        return SimpleNamespace(version_code=require)

    monkeypatch.setattr(opengl_executor.moderngl, "create_context", create)
    assert opengl_executor.CONTEXTS["egl"]().version_code == newest
    assert required == asked


def test_osmesa_library_that_is_missing(monkeypatch):
    from wamnet.kernels.devices import osmesa

    monkeypatch.setattr(osmesa, "LIBRARIES", ("libnowhere.so",))
    monkeypatch.setattr(osmesa.ctypes.util, "find_library", lambda name: None)
    with pytest.raises(OSError, match=r"no library libnowhere\.so"):
        osmesa.OSMesaContext()
