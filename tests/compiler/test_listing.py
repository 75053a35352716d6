"""Listings: each line of a kernel knows the line of the reference that it came from, and costs it nothing."""

import inspect
from pathlib import Path

import numpy as np
import pytest
from kit import untrained

from wamnet.compiler.compile import compile_program
from wamnet.compiler.core import ir
from wamnet.compiler.core.listing import SKELETON, Line, as_text, lines_of, within
from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.trace import trace
from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.compiler.targets import language_named
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.shapes import quad
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import siren

ROOT = Path(siren.__file__).parents[2]

MODEL = untrained((4,), ("color",), 2)


def reference(place: str) -> str:
    """Return the text of a place."""
    path, _, line = place.rpartition(":")
    return (ROOT / path).read_text().splitlines()[int(line) - 1].strip()


def kernel_lines(profile: str, target: str = "opencl") -> list[Line]:
    kernel = compile_program(lower(MODEL, keep_places=True), language_named(target).under(profile))
    return lines_of(kernel.source, {"": kernel.programs})


def lines_under(lines: list[Line], reference_text: str) -> list[str]:
    """Return the kernel's statements that came from a line of the reference."""
    return [
        line.text.strip() for line in lines if line.places and reference(line.places[-1]) == reference_text
    ]


@pytest.mark.parametrize("target", ["opencl", "opengl", "c"])
def test_a_layer_s_lines(target):
    lines = kernel_lines("native", target)
    affine = lines_under(lines, "x = np.matmul(x, weight.T) + bias")
    assert [line for line in affine if line.startswith("/*")] == [
        "/* %1: affine map W0 from 12 to 4 */",
        "/* %5: affine map W1 from 4 to 3 */",
    ]
    sine = lines_under(lines, "x = activate(_omega_0(siren, layer) * x)")
    assert sum("sin" in line for line in sine) == 1
    assert any("2.0f * v1[i]" in line for line in sine)


def test_what_a_pass_puts_in_has_the_places_of_what_was_there():
    """The emitted sine's operations have the place of the line that contains the sine."""
    sine = lines_under(kernel_lines("ieee"), "x = activate(_omega_0(siren, layer) * x)")
    assert sum("floor(" in line for line in sine) == 2


def test_every_operation_of_a_path_is_asked_for_by_the_reference():
    programs = lower_scene(canonical("lone_light"), Settings(), keep_places=True)
    for part in programs.parts.values():
        # The pixel's counter is computed by lower_scene.py itself.
        bare = [node.op for node in part.nodes if not node.places]
        assert set(bare) <= {"input", "constant", "multiply", "add", "convert"}, bare
    kernel = compile_path(programs, language_named("opencl").under("native"), groups=("color",))
    lines = lines_of(kernel.source, kernel.programs.parts)
    source, first = inspect.getsourcelines(quad.quad_distance)
    own = [
        line
        for line in lines
        if any(
            within(place, "refimpl/light/shapes/quad.py", first, first + len(source) - 1)
            for place in line.places
        )
    ]
    assert {line.part for line in own} == {"arrive", "scatter"}
    assert all(" = " in line.text for line in own)


@pytest.mark.parametrize("profile", ["native", "ieee"])
def test_places_change_no_bit_of_a_kernel(profile):
    with_places, without = lower(MODEL, keep_places=True), lower(MODEL)
    assert ir.digest(with_places) == ir.digest(without)
    assert with_places.nodes == without.nodes
    kernels = [
        compile_program(program, language_named("opencl").under(profile))
        for program in (with_places, without)
    ]
    assert kernels[0].source == kernels[1].source
    assert kernels[0].manifest == kernels[1].manifest


def test_a_listing_as_text():
    lines = [Line("{"), Line("  t1 = x;", "", ("a.py:1", "b.py:2")), Line("  t2 = y;", "", ("b.py:2",))]
    assert as_text(lines, {"b.py:2": " return z"}.__getitem__) == (
        f"{SKELETON}\n    | {{\nb.py:2: return z\n    |   t1 = x;\n    |   t2 = y;\n"
    )


@pytest.mark.parametrize(
    ("place", "inside"), [("a.py:3", True), ("a.py:5", True), ("a.py:6", False), ("b.py:4", False)]
)
def test_a_place_is_within_lines(place, inside):
    assert within(place, "a.py", 3, 5) is inside


def test_a_line_of_another_block_is_not_taken_for_a_node():
    program = trace(lambda x: np.sin(x) + 1.0, {"x": ir.Type()}, keep_places=False)
    source = "/* other: of no program */\nfloat t1 = 0;\n/* one: a block */\nfloat t2 = t1;"
    assert [line.part for line in lines_of(source, {"one": program})] == ["", "", "one", "one"]


def test_places_are_asked_for_by_name():
    """What moves in a scene was once passed as the argument that requests the places, and taken for a yes."""
    with pytest.raises(TypeError, match="positional arguments"):
        lower_scene(canonical("empty"), Settings(), None, None, True)  # type: ignore[misc]
