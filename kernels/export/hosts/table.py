"""The hosts of `wamnet export --host`, one row each."""

from __future__ import annotations

from collections.abc import Mapping

from ....refimpl.errors import InputError, choice
from .headers import calling, launching
from .host import EIGHT_BITS, Host, page

PAGE = ("wamnet.js", "serve.mjs")
"""What pages share, beside the page itself [`page`]."""

BROWSE = "npm install && npm start"
"""How a page is shown."""

PAGES_NEED = "Node with npm, and a browser with WebGL 2; it serves the page at the address that it prints"
"""What engines on WebGL need."""

ON_PAGE = "both on the page"
"""Where pages draw."""


def _on_webgl(name: str, engine: str, imports: tuple[str, str], ranks: bool = False) -> Host:
    """Return the row of an engine on WebGL."""
    files, made = ("main.js", "package.json"), page(engine, imports)
    text = f"a page with {engine}"
    return Host(name, text, "glsl-es", files, BROWSE, PAGES_NEED, ON_PAGE, PAGE, made, ranks=ranks)


ROWS = (
    Host(
        "c",
        "a program in C99",
        "c",
        ("main.c", "Makefile", "wasi.mjs"),
        "make run",
        "make and a C compiler; for `make wasm` zig and Node",
        "seen.ppm, and with a scene picture.ppm",
        made={"host.h": calling},
        scenes=True,
    ),
    Host(
        "cpp",
        "a program in C++17",
        "c",
        ("main.cpp", "Makefile"),
        "make run",
        "make and a C++ compiler",
        "seen.ppm, and with a scene picture.ppm",
        made={"host.h": calling},
        scenes=True,
    ),
    Host(
        "blender",
        "an add-on for Blender 4.2 or newer",
        "c",
        ("__init__.py", "denoiser.py", "check.py", "library.c", "Makefile"),
        "make run",
        "make, a C compiler, and Blender, or Python with the package bpy",
        "seen.ppm",
        ("wamnet_check.py",),
        {"host.h": calling},
        features=("color", "highlights", "normal", "albedo", "position", "depth"),
    ),
    Host(
        "opencl",
        "a program in C99 that loads OpenCL's library itself",
        "opencl",
        ("main.c", "cl.h", "Makefile"),
        "make run",
        "make, a C compiler, and OpenCL's loader with a driver (ocl-icd-libopencl1, pocl-opencl-icd)",
        "seen.ppm",
        ("common.h",),
        {"host.h": launching},
        schedule="tile:8",  # spectra need more of a thread's stack than some drivers give it
    ),
    Host(
        "vulkan",
        "a program in C99 for Vulkan 1.0",
        "spirv",
        ("main.c", "Makefile"),
        "make run",
        "make, a C compiler, and Vulkan's headers, loader and driver (libvulkan-dev, mesa-vulkan-drivers)",
        "seen.ppm",
        ("common.h",),
        {"host.h": launching},
    ),
    Host(
        "webgpu",
        "a page, and a program of Node without one",
        "wgsl",
        ("main.js", "denoiser.js", "node.mjs", "package.json"),
        BROWSE,
        "Node with npm, and a browser with WebGPU; without one: npm install && node node.mjs",
        ON_PAGE,
        PAGE,
        page("WebGPU"),
        scenes=True,
    ),
    _on_webgl("three", "three.js", ("three", "three/build/three.module.js"), ranks=True),
    _on_webgl("babylon", "Babylon.js", ("@babylonjs/core/", "@babylonjs/core/")),
    _on_webgl("playcanvas", "PlayCanvas", ("playcanvas", "playcanvas/build/playcanvas.mjs")),
    Host(
        "godot",
        "a project of Godot 4",
        "godot",
        ("project.godot", "main.tscn", "main.gd"),
        "godot --path . -- --once",
        "Godot 4.2 or newer, and Godot 3 refuses the project",
        "the window, without `-- --once`",
        storage=EIGHT_BITS,
        ranks=False,
    ),
    Host(
        "onnxruntime-web",
        "a page with ONNX Runtime, as WebAssembly",
        "onnx",
        ("main.js", "package.json"),
        BROWSE,
        "Node with npm, and a browser",
        ON_PAGE,
        PAGE,
        page("ONNX Runtime", ("onnxruntime-web", "onnxruntime-web/dist/ort.wasm.min.mjs")),
    ),
    Host(
        "onnxruntime",
        "a program for ONNX Runtime in Python, and one for Node",
        "onnx",
        ("check.py", "node.mjs", "package.json"),
        "python3 check.py",
        "Python with numpy and onnxruntime; for Node: npm install && node node.mjs",
        "seen.ppm",
        ("wamnet.js", "wamnet_check.py"),
    ),
    Host(
        "openvino",
        "a program for OpenVINO in Python",
        "onnx",
        ("check.py",),
        "python3 check.py",
        "Python with numpy and openvino",
        "seen.ppm",
        ("wamnet_check.py",),
    ),
)
"""All rows."""

HOSTS: Mapping[str, Host] = {row.name: row for row in ROWS}
"""All hosts by name."""


def host_named(name: str) -> Host:
    """Return a host, or refuse a name that nobody has."""
    if name not in HOSTS:
        raise InputError("--host", name, "unknown", choice(name, HOSTS))
    return HOSTS[name]
