"""Reading the texts of work groups: shared memory, barriers, and items that stand apart (spec/text.md)."""

import json

import numpy as np
import pytest
from texts import changed, kernel, parts

from wamnet.compiler.proof.evidence import Refused
from wamnet.compiler.reading.check import check_text, run_text
from wamnet.compiler.reading.lanes import Unread, Wrong, group_lanes
from wamnet.compiler.reading.places import Place

TARGETS = ("cuda", "glsl-vulkan", "metal", "opencl", "wgsl")


@pytest.fixture(scope="module", params=["wgsl", "opencl"])
def one(request, tmp_path_factory):
    """Text of one pixel an item, in the language of the parameter."""
    return parts(kernel(tmp_path_factory.mktemp("one"), request.param, "group:1"))


@pytest.fixture(scope="module")
def four(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("four"), "glsl-vulkan", "group:4"))


@pytest.mark.product
@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("schedule", ["group:1", "group:4"])
@pytest.mark.parametrize(("border", "activation", "size"), [("zero", "sine", 3), ("clamp", "relu", 4)])
def test_groups_compute_what_is_certified(target, schedule, border, activation, size, tmp_path):
    path = kernel(tmp_path, target, schedule, border=border, activation=activation, size=size)
    pixels = json.loads((tmp_path / "manifest.json").read_text())["schedule"]["pixels"]
    assert pixels == (4 if schedule == "group:4" else 1)
    assert check_text(path)["sums"] == pixels * (2 * size + 3)


@pytest.mark.parametrize("name", ["group:2", "group:1", "plain"])
def test_a_manifest_whose_schedule_has_other_pixels_is_refused(four, name):
    source, held, manifest, weights = four
    other = {**manifest, "schedule": {**manifest["schedule"], "name": name}}
    with pytest.raises(Refused, match=f"other work items, or weights, than schedule {name}"):
        run_text(source, held, other, weights)


@pytest.mark.parametrize("bytes_more", [-4, 4])
def test_a_manifest_states_the_memory_that_groups_share(four, bytes_more):
    source, held, manifest, weights = four
    schedule = {**manifest["schedule"], "shared_bytes": manifest["schedule"]["shared_bytes"] + bytes_more}
    with pytest.raises(Refused, match=r"its groups share \d+ bytes, not what its manifest says"):
        run_text(source, held, {**manifest, "schedule": schedule}, weights)


def lost(source, n):
    """Return a text without its barrier n."""
    wait = next(w for w in ("workgroupBarrier();", "barrier(CLK_LOCAL_MEM_FENCE);") if w in source)
    pieces = source.split(wait)
    assert len(pieces) == 4
    return wait.join(pieces[: n + 1]) + wait.join(pieces[n + 1 :])


@pytest.mark.parametrize(("n", "why"), [(0, "reads what another writes"), (1, "writes what another reads")])
def test_a_lost_barrier_is_a_race(one, n, why):
    """No barrier of a kernel is without a purpose: a tile is filled, read, and filled again."""
    source, *others = one
    with pytest.raises((Refused, Unread), match=why):
        run_text(lost(source, n), *others)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("    barrier();", "    if (x < width) { barrier(); }", "barrier inside a branch"),
        ("    barrier(", "    if (local_x < 3) { return; }\n    barrier(", "return is not declared"),
        ("for (int i = item;", "for (int i = item + 1;", "before it is written"),
        ("i += GROUP_WIDTH * GROUP_HEIGHT", "i += GROUP_WIDTH", "two items write"),
        ("i < PLANE;", "i < PLANE - 1;", "before it is written"),
        ("i < PLANE;", "i < PLANE * 4;", "two items write"),
        ("[2 * PLANE + i]", "[3 * PLANE + i]", "beyond its"),
        ("TILE_WIDTH + local_x + dx", "TILE_WIDTH + local_x + dx + 1", "never made|written"),
        ("2 * PLANE + at", "2 * PLANE + at + PLANE", "beyond its"),
        ("top + i / TILE_WIDTH", "top + i / (TILE_WIDTH - 1)", "never made|with 0"),
        ("at + 2 * GROUP_WIDTH", "at + 3 * GROUP_WIDTH", "never made|with 0"),
        ("if (x + 3 * GROUP_WIDTH < width &&", "if (x + 3 * GROUP_WIDTH <= width &&", "beyond the picture"),
        ("if (x + 3 * GROUP_WIDTH < width &&", "if (x + 3 * GROUP_WIDTH < width - 1 &&", "without a result"),
        (
            "if (x + 3 * GROUP_WIDTH < width &&",
            "if (width - x + local_x == 29 && y == local_y && x + 3 * GROUP_WIDTH < width &&",
            "near a border only",
        ),
        ("(y * width + x + 2 * GROUP_WIDTH)", "(y * width + x + 2)", "not its own"),
        ("shared float", "float", "not a frame of"),
        ("local_size_y = GROUP_HEIGHT", "local_size_y = GROUP_HEIGHT + 1", "not a frame of"),
        ("gl_LocalInvocationID.x", "gl_LocalInvocationID.y", "not a frame of"),
        ("(x < width && y", "(local_x < width && y", "beyond the picture"),
    ],
)
def test_faults_of_groups_are_named(four, old, new, why):
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(four, old, new))


@pytest.mark.parametrize(
    "new",
    [
        "v1_0_0 += (float4)(weights[6] * t);",
        "float4 m = w[1]; float4 s = m * t; v1_0_0 += (float4)(s.z);",
        "float4 m = w[1]; float4 s = m * t; float4 z = (float4)(1.0f, 1.0f, 1.0f, s.z); v1_0_0 += z;",
        "float4 z = (float4)(1.0f, 1.0f, 1.0f, t); v1_0_0 += w[1] * z;",
    ],
)
def test_weights_that_fill_up_vectors_are_in_no_sum(tmp_path, new):
    """TXT-6: six neurons fill two vectors; a product of a 0 with what is infinite is no number."""
    given = parts(kernel(tmp_path, "opencl", "group:1"))
    old = "        v1_0_0 += part_0_0;"
    line = f"{old}\n        float t = 3.0e+38f * 3.0e+38f;\n        {new}"
    with pytest.raises((Refused, Unread), match=r"never made|a vector of weights"):
        run_text(*changed(given, old, line))


def test_operations_on_lanes_and_factors_are_declared_precise(four):
    """TXT-1: also one for each lane, and the factor of a weight."""
    whole = "vec4 elementwise_90(vec4 v87)\n{\n"
    assert whole in four[0]
    lanes = ", ".join(f"max(v87.{lane}, 0.0f)" for lane in "xyzw")
    line = f"    vec4 t = vec4({lanes});\n"
    with pytest.raises(Unread, match="t is not declared PRECISE"):
        run_text(*changed(four, whole, whole + line))
    with pytest.raises(Unread, match="v50_0_0 is not declared PRECISE"):
        run_text(*changed(four, "v50_0_0 += m * v49_0_0.x;", "v50_0_0 += m * max(v49_0_0.x, (-1.0f));"))


def test_constants_as_large_as_a_group_are_refused(four):
    """No lane's group begins between 0 and far away: no constant may tell such groups apart."""
    old = "tile[i] = inside ?"
    assert run_text(*changed(four, old, "tile[i] = inside && left >= -1 ?"))
    for case in ("left - 32 >= 0", "left > 0 && width < 34"):
        with pytest.raises(Unread, match="as large as a group"):
            run_text(*changed(four, old, f"tile[i] = inside && {case} ?"))


@pytest.mark.parametrize(("a", "b"), [(23, 7), (5, 9)])
def test_conditions_near_borders_of_both_axes_are_refused(four, a, b):
    """TXT-5: no lane is near both. A reader that drew pairs of distances accepted nearly all of these."""
    old, both = "tile[i] = inside", f"left == width - {a} && top == height - {b}"
    for case in (f"!({both})", f"({both} || x < width)"):
        with pytest.raises(Unread, match="begins with no token"):
            run_text(*changed(four, old, f"{old} && {case}"))
    with pytest.raises(Refused, match="near a border only"):
        run_text(*changed(four, old, f"{old} && {both}"))
    with pytest.raises(Unread, match="begins with no token"):
        run_text(*changed(four, old, f"{old} && (left != width - {a} || top != height - {b})"))
    line = "tile[i] = inside ? image_color[(row * width + column) * 3 + 0] : 0.0f;"
    wrong = line.replace("+ column)", "+ max(min(column, width - 2), 0))")
    with pytest.raises(Refused, match="in some groups only"):  # of the last column all but the first row
        run_text(*changed(four, line, f"{wrong} if (tile_row >= 1) {{ {line} }}"))
    with pytest.raises(Refused, match="both axes"):
        run_text(*changed(four, old, f"{old} && left + top != width + height - {a + b}"))
    with pytest.raises(Refused, match="another axis"):
        run_text(*changed(four, "tile[i] =", "tile[i + min(x, 0)] ="))


def test_a_barrier_of_other_memory_is_refused(tmp_path):
    given = parts(kernel(tmp_path, "opencl", "group:1"))
    with pytest.raises(Unread, match="no 'CLK_LOCAL_MEM_FENCE'"):
        run_text(*changed(given, "CLK_LOCAL_MEM_FENCE", "CLK_GLOBAL_MEM_FENCE"))


def test_a_sum_in_a_branch_is_refused(four):
    """What all items share is read by those alone that have written it."""
    with pytest.raises(Refused, match="before it is written"):
        run_text(*changed(four, "v1_0_0 += part_0_0;", "if (local_x < 3) { v1_0_0 += part_0_0; }"))


def test_an_item_of_its_own_sum_is_refused(four):
    """Sums are compared over all lanes at once: one item that differs is enough."""
    old = "int at = (local_y + dy) * TILE_WIDTH + local_x + dx"
    new = f"int t0 = item == 37 && left > 0 ? 1 : 0; {old} + t0"
    with pytest.raises((Refused, Unread), match="a choice of coordinates"):
        run_text(*changed(four, old, new))


def test_places_of_an_item_are_told_apart(tmp_path):
    """Their names and attributes are those of the compiler's own kernels."""
    source, *others = parts(kernel(tmp_path, "wgsl", "group:1"))
    for new in (("(local_invocation_id)", "(workgroup_id)"), ("item_place", "invocation")):
        with pytest.raises(Unread, match="not a frame of"):
            run_text(source.replace(*new), *others)


def test_groups_have_every_case_of_a_row():
    lanes = group_lanes((4, 2), 2, 3)
    x, width, y, height = lanes.known
    far = (y > 5) & (height - y > 5)
    cases = {(a > 0, min(b, 12)) for a, b in zip(x[far], (width - x)[far], strict=True)}
    assert cases == {(a, b) for a in (False, True) for b in range(1, 13)}
    assert x[0] > 5
    assert all(
        len({*np.flatnonzero(near)} & {*np.flatnonzero(~far)}) == 0 for near in (x == 0, width - x < 13)
    )
    assert set(zip(*lanes.inside.tolist(), strict=True)) == {(a, b) for a in range(4) for b in range(2)}


def test_constants_beyond_a_group_and_its_window_are_refused():
    lanes = group_lanes((4, 2), 1, 3)
    far = Place.operated(lanes, "add", Place.of(lanes, 0), 8, None)
    with pytest.raises(Wrong, match="beyond"):
        Place.compared(lanes, "less", far, Place.of(lanes, 1), None)
