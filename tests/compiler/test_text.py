"""Reading kernels' texts: the compiler's own are accepted in each language, faults are not (spec/text.md)."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from texts import NAME, changed, kernel, model, parts, unnoticed

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.proof.evidence import Refused
from wamnet.compiler.reading import field, terms
from wamnet.compiler.reading.check import check_text, run_text
from wamnet.compiler.reading.lanes import Unread, Wrong, lanes_for
from wamnet.compiler.reading.languages import TITLES
from wamnet.compiler.reading.places import Place
from wamnet.compiler.reading.trusted import ROOM, trusted_files, trusted_lines
from wamnet.compiler.variants import plan_model


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("plain"), "opencl"))


@pytest.fixture(scope="module")
def tile(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("tile"), "opencl", "tile:8"))


@pytest.mark.parametrize("target", sorted(TITLES))
@pytest.mark.parametrize(("size", "border"), [(3, "zero"), (4, "clamp")])
def test_plain_texts_compute_what_is_certified(target, size, border, tmp_path):
    """TXT-1, TXT-7: every language that is read."""
    found = check_text(kernel(tmp_path, target, size=size, border=border))
    # Two images' rows of taps, the whole of the first layer, and the two others.
    assert found["sums"] == 2 * size + 3


@pytest.mark.product
@pytest.mark.parametrize(
    ("target", "schedule"),
    [
        ("c", "tile:8"), ("opencl", "tile:8"), ("opencl", "tile:16"), ("cuda", "tile:4"),
        ("glsl-vulkan", "tile:4"), ("metal", "tile:4"), ("wgsl", "tile:4"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("activation", ["sine", "relu"])
def test_register_tiles_compute_what_is_certified(target, schedule, activation, tmp_path):
    path = kernel(tmp_path, target, schedule, activation=activation)
    pixels = json.loads((tmp_path / "manifest.json").read_text())["schedule"]["pixels"]
    assert pixels > 1
    assert check_text(path)["sums"] == pixels * 9


@pytest.mark.parametrize(
    ("target", "schedule"),
    [
        ("glsl-es", "packed"), ("opengl", "group:1"), ("opengl", "group:4"), ("glsl-es", "inlined"),
        ("opengl", "inlined"),
    ],
)  # fmt: skip
def test_shaders_with_other_weights_or_groups_compute_what_is_certified(target, schedule, tmp_path):
    """TXT-7: every schedule of a language whose weights are read."""
    pixels = 4 if schedule == "group:4" else 1
    assert check_text(kernel(tmp_path, target, schedule))["sums"] == pixels * 9


def after(text):
    """Return the text of the next float32."""
    return f"{np.nextafter(np.float32(text.strip('()f')), np.float32(np.inf)):.9g}f"


@pytest.mark.parametrize(
    "changed_line",
    [
        lambda line, a, b: line.replace(a, after(a)),
        lambda line, a, b: line.replace(a, "?").replace(b, a).replace("?", b),
        lambda line, a, b: line.replace(a, "0.0f"),
        lambda line, a, b: line.replace("color.x", "color.y"),
        lambda line, a, b: line.replace("part1_0", "part1_1"),
        lambda line, a, b: f"{line} {line}",
        lambda line, a, b: line.replace("+=", "-="),
        lambda line, a, b: "",
        lambda line, a, b: line.replace(") *", ") * 1.0f *"),
        lambda line, a, b: f"if (x > 0) {{ {line} }}",
    ],
)
def test_wrong_constants_are_refused(changed_line, tmp_path):
    """TXT-7: weights that are constants are those of the certificate, to the bit, each in its place."""
    given = parts(kernel(tmp_path, "opengl", "inlined"))
    line, a, b = re.search(r"part1_0 \+= vec4\(([^ ]+), ([^ ]+), .*\* color\.x;", given[0]).group(0, 1, 2)
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(*changed(given, line, changed_line(line, a, b)))


@pytest.mark.parametrize(
    ("of", "stated"), [("inlined", "plain"), ("inlined", "packed"), ("plain", "inlined")]
)
def test_constants_are_weights_of_their_schedule_only(of, stated, tmp_path):
    """TXT-7: a host gives a text no weights only where its manifest says that they are constants."""
    text, held, manifest, weights = parts(kernel(tmp_path, "glsl-es", of))
    manifest["schedule"]["name"] = stated
    with pytest.raises(Refused, match=f"or weights, than schedule {stated}"):
        run_text(text, held, manifest, weights)


PLACES = [f"{name}:inline" for name in ("c", "cuda", "metal", "opencl")]
PLACES += [f"{name}:uniform" for name in ("metal", "opencl", "wgsl", "opengl", "glsl-es", "glsl-vulkan")]
"""Targets whose weights are in a table of the source, or in a uniform block."""


@pytest.mark.parametrize("target", PLACES)
def test_weights_in_tables_and_blocks_are_those_of_the_file(target, tmp_path):
    """TXT-7, and the same text under another place is refused."""
    path = kernel(tmp_path, target)
    assert check_text(path)["sums"] == 9
    source, held, manifest, weights = parts(path)
    for other in ("", ":inline", ":uniform"):
        named = manifest["target"].partition(":")[0] + other
        if named != target:
            with pytest.raises((Refused, Unread), match=r"another place|nothing defines"):
                run_text(source, held, {**manifest, "target": named}, weights)


@pytest.mark.parametrize(
    ("target", "old", "new", "why"),
    [
        ("c:inline", "weights[383]", "weights[384]", "has room for 384"),
        ("c:inline", "weights[383]", "weights[0577]", "frame|defines"),
        ("opencl:uniform", "16 * 96", "16 * 0140", "frame"),
        ("wgsl:uniform", "vec4<f32>, 96>", "vec4<f32>, 096>", "frame"),
        ("c:inline", "0.325407952f}", "-1u}", "not those of weights.bin"),
        ("c:inline", "#undef WINDOW_SIZE\n", "", "other constants"),
        ("c:inline", "0.325407952f}", "0.325407952f, 0.0f}", "not those of weights.bin"),
        ("c:inline", "0.325407952f}", "0.325407982f}", "not those of weights.bin"),
        ("opencl:inline", "0.325407952f}", "(-0.325407952f)}", "not those of weights.bin"),
        ("cuda:inline", ", 0.325407952f}", "}", "not those of weights.bin"),
        ("metal:inline", "0.325407952f}", "x}", "not those of weights.bin"),
        ("c:inline", "float *restrict result,", "float *restrict weights,", "frame"),
        ("c:inline", "image_normal,", "image_normal,\nconst float *restrict weights,", "frame|two places"),
        ("opencl:uniform", "16 * 96", "16 * 95", "has room for 95"),
        ("wgsl:uniform", "vec4<f32>, 96>", "vec4<f32>, 97>", "has room for 97"),
        ("wgsl:uniform", "[(324 + j) % 4]", "[(325 + j) % 4]", "another index"),
        ("glsl-vulkan:uniform", "[(324 + j) / 4]", "[(324 + j) / 3]", "another index"),
        ("glsl-es:uniform", "[(324 + j) / 4][(324 + j) % 4]", "[324 + j]", r"\S"),
        ("opengl:uniform", "uniform sampler2D image_color;", "uniform sampler2D weight_texture;", r"\S"),
    ],
)  # fmt: skip
def test_wrong_tables_and_blocks_are_refused(target, old, new, why, tmp_path):
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(parts(kernel(tmp_path, target)), old, new))


@pytest.mark.parametrize("target", ["c", "cuda", "opencl", "opengl", "wgsl"])
@pytest.mark.parametrize("size", [3, 4])
def test_texts_of_integers_compute_what_is_certified(target, size, tmp_path):
    plan = plan_model(model(size=size, border="clamp"), target, variant="whole8")
    artifact.write(compile_plan(plan), tmp_path)
    assert check_text(tmp_path / NAME)["sums"] == 3


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("part1[j] = 0.0f;", "v1[j] = 0.0f;", "read before it is written"),
        ("weights[(tap + c) * 6 + j]", "weights[(tap + c) * 6 + j + 1]", "never made"),
        ("v1[j] += part1[j];", "v1[j] += part1[j] + weights[0] - weights[0];", "never made"),
        ("height - 1);", "height);", "beyond its ends|never made"),
        ("x >= width || ", "", "not a frame of opencl"),
        ("t16 * t38", "t16 * t37", "t38 is computed and never read"),
        ("[(y * width + x) * 3 + i] =", "[(y * width + x) * 3 + i * 2 % 3] =", "not the program's"),
        ("i < 3; ++i) {\n        result", "i < 2; ++i) {\n        result", "without a result"),
        ("i < 3; ++i) {\n        result", "i < 3.5f; ++i) {\n        result", "loop over i has type float32"),
        ("0.318309873f", "0.318309903f", "the sums of %4 are never made"),
        ("* 3 + c]", "* 2 + c]", "two numbers of channels"),
        ("bool inside = row", "bool inside = x * 3 + width >= x * 3 + 1 && row", "more than the channels"),
        ("bool inside = row", "bool inside = (width - width) % 2 == 0 && row", "coordinates that cancel"),
    ],
)
def test_faults_are_named(plain, old, new, why):
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(plain, old, new))


@pytest.mark.parametrize(
    ("new", "why"),
    [
        ("int t0 = (int)(v4[0] * 1e+30f);", "t0 is computed and never read"),
        ("float a[2]; a[0] = v4[0];", "a is computed and never read"),
        ("float a = 1.0f; { float b = 1.0f; a = b; }", "a is computed and never read"),
        ("for (int i = 0; i < 3; ++i) { float t0 = v4[i]; }", "is computed and never read"),
        ("float a = v4[0]; float b = a; a = b;", "a is computed and never read"),
        ("float a = v4[0]; { float b = a; b = a + b; }", "is computed and never read"),
        ("float a = 1.0f; if (1 < 0) { v4[0] = a; }", "is never run"),
        ("for (int k = 0; k < 0; ++k) { v4[0] = 1.0f; }", "is never run"),
        ("if (x < width) { }", "an empty block"),
        ("v4[0 + 1] = v4[1];", "arithmetic that no kernel has"),
        ("v4[1 * 1] = v4[1];", "arithmetic that no kernel has"),
    ],
)
def test_what_nothing_reads_is_refused(plain, new, why):
    """TXT-6: it changes no result, but may be undefined."""
    name = re.findall(r"float (v\d+)\[3\];", plain[0])[-1]
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(plain, "    /* output", f"    {new.replace('v4', name)}\n    /* output"))


@pytest.mark.parametrize("new", ["(int)(v1[0] * 3.0f)", "((int)v1[0] * 65536)"])
def test_integers_that_are_not_the_program_s_are_refused(new, tmp_path):
    """TXT-6: what overflows is undefined, used or not."""
    plan = plan_model(model(border="clamp"), "opencl", variant="whole8")
    artifact.write(compile_plan(plan), tmp_path)
    given = parts(tmp_path / NAME)
    line = f"float a[2]; a[0] = (float){new}; a[1] = v1[0]; v1[0] = a[1];"
    with pytest.raises(Refused, match="not the program's may be beyond"):
        run_text(*changed(given, "    /* %2 to", f"    {line}\n    /* %2 to"))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("left + PATCH_WIDTH <= width && ", "", "beyond its ends"),
        ("i < PATCH_WIDTH * 3; ++i", "i < PATCH_WIDTH * 3 - 1; ++i", "before it is written, in some lanes"),
        ("dx < PATCH_WIDTH; ++dx", "dx < PATCH_WIDTH - 1; ++dx", "before it is written, in some lanes"),
        ("+ left) * 3 + i]", "+ left) * 3 + 0]", "another number far from"),
        ("+ dx * 3 + c] = inside", "+ dx * 3 + 2 - c] = inside", "another number far from"),
        (
            "    for (int dy = 0; dy < WINDOW",
            "float a[1]; if (within) { a[0] = 1.0f; } else { a[0] = 0.0f; } patch_color[0] = a[0];"
            "    for (int dy = 0; dy < WINDOW",
            "near borders only",
        ),
        (
            "i < 3; ++i) {\n            result[(y * width + x + p) * 3 + i] ",
            "i < 6; ++i) {\n            result[(y * width + x + p) * 3 + i % 3] ",
            "written twice",
        ),
    ],
)
def test_both_branches_at_borders_do_the_same(tile, old, new, why):
    """TXT-5: the branch near borders is run for all lanes, the other one for its own."""
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(tile, old, new))


READ = "inside ? image_color[(row * width + column) * 3 + c] : 0.0f"
"""What a kernel reads of an image."""

PRODUCT = "weights[(tap + c) * 6 + j] * value"
"""What it adds to a sum."""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (
            f"part1[j] += {PRODUCT};",
            f"""float a[1]; if (x >= 1) {{ float b = {PRODUCT}; if (x >= 2) {{ a[0] = b; }} }}
            else {{ a[0] = {PRODUCT}; }} part1[j] += a[0];""",
        ),
        (
            f"float value = {READ};",
            f"""float a[2]; if (x >= 1) {{ a[1] = {READ}; }} else {{ a[1] = {READ}; a[0] = {READ}; }}
            for (int t = 0; t < 2; ++t) {{ if (x >= t) {{
                if (t > 0) {{ a[0] = {READ.replace(" c]", " (c + 1 - t) % 3]")}; }}
                if (t < 1) {{ a[0] = {READ.replace(" c]", " (c + 1 - t) % 3]")}; }}
            }} }} float value = c < 1 ? a[0] : a[1];""",
        ),
    ],
    ids=["in fewer lanes than it is made for", "behind another turn's"],
)
def test_a_number_that_some_lanes_write_is_theirs_alone(plain, old, new):
    """TXT-5: in the other lanes an element is unwritten, or has another number."""
    with pytest.raises(Refused, match="several conditions on borders"):
        run_text(*changed(plain, old, new))


def test_a_sum_in_another_order_is_accepted(plain):
    """Any order is what the bound allows; parts of rows are not to be mixed."""
    turned = "for (int q = 0; q < 3; ++q) { int c = 2 - q;"
    assert run_text(*changed(plain, "for (int c = 0; c < 3; ++c) {", turned))
    turned = changed(plain, "part1[j] = 0.0f;", "if (dy == 0) { part1[j] = 0.0f; }")
    with pytest.raises(Refused, match="never made"):
        run_text(*turned)


def test_what_is_not_known_is_not_skipped(plain):
    with pytest.raises(Unread, match="no 'CLK_LOCAL_MEM_FENCE'"):
        run_text(*changed(plain, "float v1[6];", "float v1[6]; barrier(1);"))
    with pytest.raises(Unread, match="while is not declared"):
        run_text(*changed(plain, "float v1[6];", "while (x < 0) { x = 0; } float v1[6];"))


@pytest.mark.parametrize(("target", "schedule", "count"), [("opencl", "plain", 30), ("c", "tile:8", 6)])
def test_planted_faults_are_noticed(target, schedule, count, tmp_path, capsys):
    """TXT-8: what holds the reader."""
    assert unnoticed(parts(kernel(tmp_path, target, schedule)), count) == []


def products(*numbers):
    """Return products of weights and numbers of an image."""
    known = [field.hashed(name, np.array([[n]])) for n in numbers for name in ("weight", "image")]
    pairs = zip(known[::2], known[1::2], strict=True)
    return [terms.operate("multiply", terms.Term(w, draw=field.drawn(w)), terms.Term(x)) for w, x in pairs]


def test_numbers_that_cancel_are_seen():
    """(a + b) - b is a in a field; its magnitudes say otherwise."""
    a, b = products(1, 2)
    twice = terms.operate("subtract", terms.operate("add", a, b), b)
    assert np.array_equal(twice.value[0], a.value[0])
    assert not np.array_equal(twice.value[1], a.value[1])


def test_sums_do_not_depend_on_their_order():
    each = products(*range(5))
    one, other = each[0], each[-1]
    for term in each[1:]:
        one = terms.operate("add", one, term)
    for term in each[:-1]:
        other = terms.operate("add", term, other)
    assert np.array_equal(one.value, other.value)


def test_a_counter_that_leaves_32_bits_is_refused(plain):
    """Behind the last turn: 2147483646 + 2."""
    pattern = r"int i = 0; i < 3; \+\+i\) \{(\s+result\[.* \+ )i\] = (v\d+)\[i\]"
    turn = "(i - 2147483642) / 2"
    new = rf"int i = 2147483642; i < 2147483647; i += 2) {{\g<1>{turn}] = \g<2>[{turn}]"
    old = re.search(pattern, plain[0])[0]
    with pytest.raises(Refused, match="leaves 32 bits"):
        run_text(*changed(plain, old, re.sub(pattern, new, old)))


def test_two_conditions_on_borders_do_not_make_up_for_each_other(tile):
    """A tile near both borders, which none of the lanes is, would be left without its numbers."""
    (copy,) = re.findall(r"patch_color\[[^;]*= image_color\[\(row \* width \+ left\)[^;]*;", tile[0])
    wrong = f"if (top >= 1) {{ {copy} }} if (left + PATCH_WIDTH < width) {{ {copy} }}"
    with pytest.raises(Refused, match="patch_color is written by several conditions on borders"):
        run_text(*changed(tile, copy, wrong))


def test_lanes_decide_what_may_be_compared():
    lanes = lanes_for((4, 2), 1)
    lanes.channels = 2
    x, width, y = (Place.of(lanes, axis) for axis in (0, 1, 2))

    def less(a, b):
        return Place.compared(lanes, "less", a, b, None)

    def more(a, n):
        return Place.operated(lanes, "add", a, n, None)

    assert less(more(x, 4), width).any()
    with pytest.raises(Wrong, match="beyond 4"):
        less(more(x, 5), 0)
    with pytest.raises(Wrong, match="beyond 2"):
        less(more(y, 3), 0)
    with pytest.raises(Wrong, match="both axes"):
        less(x, y)
    with pytest.raises(Wrong, match="no lane decides"):
        less(more(x, width), 3)
    with pytest.raises(Unread, match="multiply of coordinates"):
        Place.operated(lanes, "multiply", x, width, None)


def test_lanes_have_every_case_of_an_axis():
    """TXT-5: each distance to both borders up to the axis' cap, and beyond it, the other axis far away."""
    lanes = lanes_for((3, 2), 1)
    x, width, y, height = lanes.known
    for at, size, others, extent, cap in ((x, width, y, height, 3), (y, height, x, width, 2)):
        far = (others > 3) & (extent - 1 - others > 3)
        known = zip(at[far], (size - 1 - at)[far], strict=True)
        cases = {(min(a, cap + 1), min(b, cap + 1)) for a, b in known}
        assert cases == {(a, b) for a in range(cap + 2) for b in range(cap + 2)}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("result[(y", "v5[0] = !(v5[0] < v5[1]) ? v5[1] : v5[0]; result[(y"),
        ("result[(y", "v5[0] = !x ? v5[1] : v5[0]; result[(y"),
        ("result[(y", "v5[0] = x ? v5[1] : v5[0]; result[(y"),
        ("i < 3; ++i) {\n        result", "i < (x ? 3 : 2); ++i) {\n        result"),
    ],
)
def test_the_opposite_of_a_number_is_no_constant(plain, old, new):
    """A number of a picture, or a coordinate, was taken for true."""
    name = re.findall(r"float (v\d+)\[3\];", plain[0])[-1]
    with pytest.raises(
        (Refused, Unread), match=r"branches on a number|must all be bool|begins with no token"
    ):
        run_text(*changed(plain, old, new.replace("v5", name)))


@pytest.mark.parametrize("or_else", ["", "else "])
def test_numbers_that_two_turns_write_are_read_in_order(plain, or_else):
    """Turn 5 reads what turn 2 writes; the one that writes last is turn 5 itself."""
    more = f"if (i < 2) {{ v50[i + 3] = t86; }} {or_else}{{ v50[i] = t86; }}"
    with pytest.raises(Refused, match="the sums of %8 are never made"):
        run_text(*changed(plain, "v86[i] = t86;", f"v86[i] = t86; {more}"))


@pytest.mark.parametrize(
    "new",
    [
        f"part1[j] += {PRODUCT}; if (c < 2) {{ part1[j] += {PRODUCT}; }}",
        f"part1[j] += {PRODUCT}; part1[j] += part1[j] * 0.5f;",
        f"if (c == 1) {{ part1[j] = 0.0f; }} part1[j] += {PRODUCT};",
        f"if (c != 1) {{ part1[j] += {PRODUCT}; }}",
        f"part1[(j + c) % 6] += {PRODUCT};",
        f"float a = part1[j]; part1[j] += {PRODUCT}; v1[j] += a - a;",
        f"part1[j] += {PRODUCT}; v1[j] = part1[j];",
        f"part1[0] += {PRODUCT};",
    ],
)
def test_sums_of_all_turns_are_those_of_each(plain, new):
    """TXT-10: turns that add to one number are run at once; what they add is read, or left out, by none."""
    with pytest.raises((Refused, Unread), match=r"never made|before it is written|not the program's"):
        run_text(*changed(plain, f"part1[j] += {PRODUCT};", new))


def test_a_sum_that_turns_never_have_is_not_a_part(plain):
    """TXT-3, TXT-10: each column adds its products, and then the whole of a row of the other image."""
    kept = changed(plain, "part1[6];", "part1[6]; float part_1[18];")
    kept = changed(kept, "v1[j] += part1[j];", "part_1[dy * 6 + j] = part1[j];")
    row = "for (int j = 0; j < 6; ++j) { part1[j] += part_1[dx * 6 + j]; }"
    (end,) = re.findall(r"\(tap \+ 3 \+ c\) \* 6 \+ j\][^}]*}\s*}\n", kept[0])
    with pytest.raises(Refused, match=r"image normal, row 0 are never made|sums of %1 are never made"):
        run_text(*changed(kept, end, f"{end} if (dy == 0) {{ {row} }}"))
    row = f"for (int dx = 0; dx < 3; ++dx) {{ {row} }}"
    (end,) = re.findall(r"\(tap \+ 3 \+ c\) \* 6 \+ j\](?:[^}]*}){3}\n", kept[0])
    assert run_text(*changed(kept, end, f"{end} if (dy == 0) {{ {row} }}"))


def test_constants_of_type_double_are_not_read(plain):
    """C takes 0.5 for a double; GLSL takes it for a float."""
    with pytest.raises(Unread, match="begins with no token"):
        run_text(*changed(plain, "+ 0.5f", "+ 0.5"))


@pytest.mark.parametrize(
    ("target", "old", "new", "why"),
    [
        ("glsl-es", "precision highp float", "precision mediump float", "not a frame of"),
        (
            "opengl",
            "void main()",
            "layout(origin_upper_left) in vec4 gl_FragCoord; void main()",
            "not a frame of",
        ),
        ("glsl-es", "ivec2(column, row), 0)", "ivec2(column, row), 1)", "no '0'"),
        ("opengl", "uniform sampler2D weight_texture;\n", "", "read and not declared"),
        ("wgsl", "@binding(3)", "@binding(5)", "other numbers"),
        ("glsl-vulkan", "binding = 3)", "binding = 5)", "other numbers"),
        ("metal", "[[buffer(3)]]", "[[buffer(5)]]", "other numbers"),
        ("cuda", "image_color,", "image_swapped,", "image_swapped are not stated"),
    ],
)
def test_what_a_host_relies_on_is_read(target, old, new, why, tmp_path):
    """TXT-6, TXT-8: precision, levels of textures, bindings and places of arguments."""
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(parts(kernel(tmp_path, target)), old, new))


def test_arguments_in_another_order_are_refused(plain):
    source, *others = plain
    turned = source.replace("image_color,", "image_x,", 1).replace("image_normal,", "image_color,", 1)
    with pytest.raises(Refused, match="arguments"):
        run_text(turned.replace("image_x,", "image_normal,", 1), *others)


def test_what_is_trusted_is_what_the_checkers_load():
    """TXT-8: nothing that writes kernels, or that gives the compiler's operations their meaning."""
    checkers = "import sys, wamnet.compiler.proof.checker, wamnet.compiler.reading.check"
    shown = "print(*(m.__file__ for name, m in sys.modules.items() if name.startswith('wamnet.')))"
    python = [sys.executable, "-c", f"{checkers}; {shown}"]
    loaded = subprocess.run(python, capture_output=True, text=True, check=True).stdout.split()
    assert {Path(name) for name in loaded if not name.endswith("__init__.py")} == {*trusted_files()}
    rooms = {path.relative_to(ROOM).parts[:-1] for path in trusted_files()}
    compiler = {("compiler", room) for room in ("kernel", "parsing", "proof", "reading")}
    assert rooms == {("refimpl",), *compiler}
    assert trusted_lines() == sum(len(path.read_text().splitlines()) for path in trusted_files())
