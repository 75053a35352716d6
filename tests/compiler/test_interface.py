"""What a kernel is bound to is said once [KER-23, interface.py]: sources and exports say the same."""

import re

import pytest
from kit import Kit

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.kernel import interface
from wamnet.compiler.scenes.encode_kernel import compile_encode
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import LANGUAGES, language_named
from wamnet.kernels.export import package
from wamnet.kernels.export.targets import TARGETS
from wamnet.refimpl.errors import CompileError
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network.dataset import Normalization

FEATURES = ("color", "normal")
LISTED = ("opencl", "cuda", "c")
"""Languages whose functions have a list of arguments."""

NUMBERED = {
    "metal": r"\*(\w+) \[\[buffer\((\d+)\)\]\]",
    "wgsl": r"@binding\((?P<number>\d+)\) var<storage, \w+> (?P<name>\w+):",
    "glsl-vulkan": r"binding = (?P<number>\d+)\) restrict \w*\s?buffer \w+ \{ \w+ (?P<name>\w+)\[\]",
    "glsl-compute": r"binding = (?P<number>\d+)\) restrict \w*\s?buffer \w+ \{ \w+ (?P<name>\w+)\[\]",
}
"""How a language whose arrays have numbers declares one."""


@pytest.fixture(scope="module")
def model():
    return Kit().model((6,), FEATURES)


def kernels(target, model):
    """Yield one kernel of each role that a target has."""
    yield compile_program(lower(model), target)
    if language_named(target).paths:
        programs = lower_scene(canonical("lone_light"), Settings(max_depth=1))
        yield compile_path(programs, target, groups=("color", "normal"))
    if language_named(target).paths:
        yield compile_encode(FEATURES, Normalization(), target)


def arguments(source, entry):
    """Return the names in the list of arguments of a function's definition."""
    lists = re.findall(rf"\b{entry}\(([^()]*)\)\s*\{{", source)
    return [re.split(r"[\s*]+", argument.strip())[-1] for argument in lists[-1].split(",")]


@pytest.mark.parametrize("target", LISTED)
def test_arguments_are_those_of_the_interface_in_its_order(target, model):
    for kernel in kernels(target, model):
        found = arguments(kernel.source, kernel.entry_point)
        arrays = [array.name for array in kernel.interface.arrays]
        wanted = [*arrays, *kernel.interface.integers]
        if target == "c" and kernel.interface.role == interface.PATH:
            part = re.search(r"typedef struct \{(.*?)\} wamnet_part;", kernel.source, re.DOTALL)[1]
            assert tuple(re.findall(r"(\w+);", part)) == kernel.interface.integers
            wanted = ["part", *arrays, "column", "row"]
        elif target == "c" and kernel.interface.role == interface.DENOISE:
            wanted = [*wanted, "x", "y"]
        assert found == wanted


@pytest.mark.parametrize("target", NUMBERED)
def test_numbers_are_those_of_the_interface(target, model):
    for kernel in kernels(target, model):
        matches = list(re.finditer(NUMBERED[target], kernel.source))
        pairs = [m.groupdict() or {"name": m[1], "number": m[2]} for m in matches]
        assert {each["name"]: int(each["number"]) for each in pairs} == kernel.interface.numbers()


@pytest.mark.parametrize("name", [name for name, row in TARGETS.items() if row.slots == "arguments"])
def test_an_export_lists_every_argument_of_its_kernels(name, model):
    """Exports for OpenCL did not name an encoding's strides: callers gave `sample_count` instead."""
    made = package.export(package.Request(model, name, canonical("lone_light")))
    sources = {"path": made.path, "encode": made.encoder, "denoise": made.denoiser}
    for kernel in made.manifest["kernels"]:
        bound = sorted(kernel["bindings"], key=lambda each: each["slot"])
        assert [each["slot"] for each in bound] == list(range(len(bound)))
        wanted = arguments(sources[kernel["role"]].source, kernel["entry_point"])
        assert [each["name"] for each in bound] == wanted


@pytest.mark.parametrize("target", [t.name for t in LANGUAGES.values() if not t.paths])
def test_a_target_without_a_role_is_refused(target):
    programs = lower_scene(canonical("lone_light"), Settings(max_depth=1))
    with pytest.raises(CompileError, match=f"target {target} has no path kernels"):
        compile_path(programs, target)
    with pytest.raises(CompileError, match=f"target {target} has no kernels that encode features"):
        compile_encode(FEATURES, Normalization(), target)
