"""House rules about imports: one direction, few dependencies, one name for each module."""

import ast
import sys
from collections import Counter
from collections.abc import Iterator

import budget

PEERS = {
    "torch": ("experiments/peers/peer_torch.py",),
    "onnx": ("kernels/export/onnx_export.py", "models/importing/graph.py"),
    "onnxruntime": ("experiments/peers/peer_onnxruntime.py", "kernels/export/onnx_export.py"),
    "openvino": ("experiments/peers/peer_openvino.py",),
    "tinygrad": ("experiments/peers/peer_tinygrad.py",),
    "halide": ("experiments/peers/peer_halide.py",),
    "pyoidn": ("experiments/peers/peer_oidn.py",),
    "mitsuba": ("experiments/peers/peer_mitsuba.py", "spec/conformance/renderers/mitsuba_process.py"),
    "bpy": ("experiments/peers/cycles_process.py", "models/blender/process.py"),
}
"""Packages that are compared with, and the only files of each; one file reads graphs of others by onnx."""

ALLOWED = {
    "refimpl": {"numpy"},
    "models": {"numpy", "safetensors", "onnx", "google", "bpy"},
    "compiler": {"numpy"},
    "kernels": {"numpy", "scipy", "pyopencl", "pocl", "moderngl", "wgpu", "PIL", *PEERS},
    "spec": {"numpy"},
    "cli": {
        "numpy",
        "OpenEXR",
        "PIL",
        "distributed",
        "imageio_ffmpeg",
        "typer",
        "click",
        "rich",
        "matplotlib",
        "jinja2",
    },
    "wamnet": {"numpy"},
}
"""What each part may import in addition to the standard library; its keys are in the order of imports."""

ORDER = tuple(ALLOWED)
OTHERS = {
    "spec/conformance/renderers": {"jinja2", "numpy", "scipy", "typer"},
    "experiments/peers": {"numpy", "wamnet_verify", *PEERS},
    "course": {"numpy", "typer", "wamnet_verify"},
}
"""What each other distribution may import in addition to the standard library and the package."""

PUBLIC = ("api", "kernel")
"""Modules of the folder `wamnet`, which are imported from beside the parts."""


def imports(source) -> Iterator[tuple[ast.AST, str]]:
    """Yield every import, also inside functions, as an absolute dotted name."""
    package = source.package
    for node in source.nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node, alias.name
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *(node.module or "").split(".")]).strip(".")
            for alias in node.names:
                yield node, f"{module}.{alias.name}"


ROOMS = {
    "refimpl": {"": (), "light": ("",), "network": ("",)},
    "models": {"": (), "importing": ("",), "data": (), "blender": ("", "data")},
    "compiler": {
        "core": (),
        "kernel": ("core",),
        "languages": ("core", "kernel"),
        "parsing": ("core", "kernel"),
        "proof": ("core",),
        "reading": ("core", "kernel", "parsing", "proof"),
        "schedules": ("core", "kernel", "languages", "proof"),
        "": ("core", "kernel", "languages", "proof", "schedules"),
        "scenes": ("core", "kernel", "languages", "proof", "schedules", ""),
        "training": ("core", "kernel", "languages", "proof", "schedules", ""),
    },
    "kernels": {
        "": (),
        "devices": ("",),
        "run": ("", "devices"),
        "judge": ("", "devices", "run"),
        "bench": ("", "devices", "run"),
        "export": ("", "devices", "run", "bench"),
    },
    "spec": {"conformance": ()},
    "cli": {
        "common": (),
        "files": ("common",),
        "reports": ("common", "files"),
        "commands": ("common", "files", "reports"),
        "": ("commands", "common"),
    },
    "wamnet": {"": ()},
}
"""The rooms of each part, which are its folders, and what each may import; "" is the part's own folder."""

MOST_FILES = 20
"""Most Python files of a folder."""


def test_rooms_are_small_and_import_one_way(house):
    """Imports for type checkers only may go the other way: they are not part of what runs.

    A part's own `__init__` hands out what its rooms have.
    """
    wrong, files = [], Counter()
    for source in house.parts():
        part, rooms = source.part, ROOMS[source.part]
        room = "/".join(source.path.split("/")[1:-1]).partition("/")[0]
        files[source.path.rpartition("/")[0]] += 1
        skipped = {id(node) for branch in checked_only(source.tree) for node in ast.walk(branch)}
        for node, name in imports(source):
            parts = name.split(".")
            if parts[:2] != ["wamnet", part] or id(node) in skipped or source.path == f"{part}/__init__.py":
                continue
            target = parts[2] if parts[2] in rooms else ""
            if target not in (room, *rooms[room]):
                wrong.append(source.at(node, f"room {room or part} imports {target or part}"))
    wrong += [f"{folder} has {count} modules" for folder, count in files.items() if count > MOST_FILES]
    house.refuse(wrong, "A room has at most 20 modules and imports those before it: move the code.")


CIRCLES = (
    {"kernels.devices.opengl_executor", "kernels.devices.registry"},
    {"refimpl.light.scene", "refimpl.light.shapes.box", "refimpl.light.shapes.shape"},
)  # fmt: skip
"""Modules that import each other today, also inside functions or for type checkers. No circle is added."""


def reached(graph, module):
    """Return the modules that a module imports, directly or by others."""
    found, ahead = set(), [module]
    while ahead:
        new = graph[ahead.pop()] - found
        found |= new
        ahead += new
    return found


def circles(graph):
    """Return the groups of modules that import each other; `graph`: what each one imports."""
    every = {module: reached(graph, module) for module in graph}
    return {frozenset(m for m in every[one] if one in every[m]) for one in graph if one in every[one]}


def test_no_circle_of_imports_is_added(house):
    modules = {source.path.removesuffix(".py").replace("/", "."): source for source in house.parts()}
    graph = {
        module: {
            own
            for _, name in imports(source)
            for end in (name, name.rpartition(".")[0])
            if (own := end.removeprefix("wamnet.")) in modules and own != module
        }
        for module, source in modules.items()
    }
    assert sum(map(len, graph.values())) > len(graph), "imports are found"
    added = [sorted(found) for found in circles(graph) if not any(found <= known for known in CIRCLES)]
    assert added == [], "Modules import each other: move what both need to a module below them."


def test_the_wheel_does_not_grow():
    total = sum(map(budget.lines, budget.packages().values()))
    assert total <= budget.MAX_LINES, "The wheel has more lines than MAX_LINES: remove some elsewhere."
    assert budget.MAX_LINES - total <= budget.SLACK, (
        f"The wheel has {total} lines: lower MAX_LINES in tests/support/budget.py."
    )


def checked_only(tree):
    """Yield what is under `if TYPE_CHECKING`."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            yield from node.body


def test_imports_go_one_way(house):
    wrong = []
    for source in house.parts():
        for node, name in imports(source):
            top, _, rest = name.partition(".")
            target = rest.partition(".")[0]
            target = "wamnet" if target in PUBLIC else target
            if top == "wamnet" and (target not in ORDER or ORDER.index(target) > ORDER.index(source.part)):
                wrong.append(source.at(node, f"{source.part} imports {target}"))
    house.refuse(wrong, f"Imports go {' <- '.join(ORDER)}: move the code to the later part.")


def test_parts_import_only_what_they_may(house):
    wrong = []
    for source in house.installed():
        own, allowed = source.package[0], (ALLOWED | OTHERS)[source.part]
        for node, name in imports(source):
            top = name.partition(".")[0]
            if top not in sys.stdlib_module_names | {"wamnet", own} | allowed:
                wrong.append(source.at(node, f"{source.part} imports {top}"))
    house.refuse(
        wrong, "A part imports only what test_layering.py's table allows: do without, or move the code."
    )


def test_peers_are_used_in_their_file_only(house):
    """And only when they are used: nothing that is installed needs them."""
    wrong = []
    for source in house.installed():
        at_import = {id(node) for node in source.tree.body}
        for node, name in imports(source):
            place = PEERS.get(name.partition(".")[0])
            if place and (source.path not in place or id(node) in at_import):
                wrong.append(source.at(node, name))
    house.refuse(wrong, "A peer is imported in its own file, by the function that opens it.")


def test_no_bare_imports(house):
    wrong = [
        source.at(node, name)
        for source in house.python()
        for node, name in imports(source)
        if name.partition(".")[0] in set(ORDER) - {"wamnet", "models"}
    ]
    house.refuse(
        wrong, "A bare import makes a second copy of a module: import wamnet.refimpl, or relatively inside."
    )


def test_imports_inside_are_relative(house):
    wrong = [
        source.at(node, "absolute import of wamnet")
        for source in house.parts()
        for node in source.nodes
        if (isinstance(node, ast.ImportFrom) and not node.level and (node.module or "").startswith("wamnet"))
        or (isinstance(node, ast.Import) and any(alias.name.startswith("wamnet") for alias in node.names))
    ]
    house.refuse(
        wrong,
        "Inside the package imports are relative, so that they match the folders: from ..refimpl import x.",
    )


def test_no_hidden_random_state(house):
    wrong = [
        source.at(node, ast.unparse(node))
        for source in house.parts()
        for node in source.nodes
        if isinstance(node, ast.Attribute) and ast.unparse(node) in {"np.random", "numpy.random"}
    ]
    house.refuse(
        wrong, "No function owns a random generator: take random numbers as arguments, from refimpl/rng.py."
    )
