"""Reading the texts of spectra: transforms, products and tiles, operation by operation (spec/text.md)."""

import json
import operator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kit import biased, untrained
from texts import NAME, changed, parts

from wamnet.compiler import artifact, targets
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.languages.c import C
from wamnet.compiler.languages.cuda import CUDA
from wamnet.compiler.languages.glsl import GLSLCompute
from wamnet.compiler.languages.glsl_buffers import Vulkan
from wamnet.compiler.languages.metal import Metal
from wamnet.compiler.languages.opencl import OpenCL
from wamnet.compiler.languages.wgsl import WGSL
from wamnet.compiler.proof import checker, spectra_checker
from wamnet.compiler.proof.evidence import Refused
from wamnet.compiler.reading.check import check_text, run_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.reading.spectra import Arithmetic, sums, transform
from wamnet.compiler.schedules import fft
from wamnet.compiler.schedules.passes import FourierPasses

IN_PASSES = {"opengl": GLSLCompute, "glsl-vulkan": Vulkan, "wgsl": WGSL, "cuda": CUDA, "metal": Metal}
"""Languages of the schedule in passes."""

FLOATS = Arithmetic(operator.add, operator.sub, operator.mul, float)


def model(border="zero", activation="sine", images=("color", "normal", "albedo", "position"), neurons=6):
    found = untrained((neurons, 5), images, 3, border, (1.0, 3.0), activation=activation)
    return biased(found)


def kernel(folder, target="opencl", points=8, tiles=2, **kwargs):
    """Write a kernel of small tiles, by vectors of 4 numbers and blocks of 6 pixels."""
    dialect = OpenCL() if target == "opencl" else C()
    tiny = fft.Fourier(dialect, "fft8", "small tiles", lanes=4, pixels=6, points=points, tiles=tiles)
    if words := IN_PASSES.get(target):
        tiny = FourierPasses(words(), "fftpasses:8", "small tiles", points=points)
    whole = targets.LANGUAGES[target]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fft, "COST", 0.0)
        patch.setitem(
            targets.LANGUAGES, target, replace(whole, schedules={**whole.schedules, tiny.name: tiny})
        )
        made = compile_program(lower(model(**kwargs)), target, schedule=tiny.name)
    assert made.manifest["schedule"]["name"] == tiny.name
    artifact.write(made, folder)
    return folder / NAME


@pytest.fixture(scope="module")
def opencl(tmp_path_factory):
    """Text, certificate, manifest and weights of OpenCL C."""
    return parts(kernel(tmp_path_factory.mktemp("opencl")))


@pytest.fixture(scope="module")
def c(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("c"), "c"))


# ---- what a text must compute ----------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize("n", [2, 4, 8, 16, 32])
def test_the_transform_that_is_required_is_fouriers(n, sign):
    given = np.random.default_rng(1).standard_normal((n, 2))
    found = [a + 1j * b for a, b in transform(FLOATS, [tuple(row) for row in given], sign)]
    numbers = given[:, 0] + 1j * given[:, 1]
    exact = np.fft.fft(numbers) if sign < 0 else np.fft.ifft(numbers) * n
    # Below a hundred operations on each of n numbers, of magnitudes around 1, each off by half an eps.
    assert np.abs(found - exact).max() < 50 * n * np.finfo(float).eps


@pytest.mark.parametrize("n", [4, 8, 16, 32])
def test_its_operations_are_those_that_the_bound_counts(n):
    """FOU-5: a coefficient of 1 is a sum, one above 2 a product with a factor, two operations."""
    deepest = Arithmetic(
        lambda a, b: np.maximum(a, b) + 1, lambda a, b: np.maximum(a, b) + 1, lambda a, _: a + 1, lambda _: 0
    )
    none = np.full(n, -np.inf)
    inputs = [(np.where(np.arange(n) == i, 0.0, none), none) for i in range(n)]
    depths = np.array([part for number in transform(deepest, inputs, 1) for part in number]).max(axis=0)
    coefficients = spectra_checker.layers(n)
    assert depths.tolist() == np.where(coefficients > 2, 2, np.round(coefficients)).sum(axis=0).tolist()


@pytest.mark.parametrize(("channels", "block"), [(6, 3), (7, 2), (1, 1)])
def test_the_sums_that_are_required_are_those_of_the_window(channels, block):
    """With the spectra of FOU-4, in float64, in the order of CER-7."""
    rng, n, size, count, lanes, pairs = np.random.default_rng(2), 8, 3, 6, 2, -(-channels // 2)
    tile, weight = rng.standard_normal((n, n, channels)), rng.standard_normal((count, size, size, channels))
    spectrum = np.conj(np.fft.fft2(weight, (n, n), axes=(1, 2))) / (2 * n**2)
    table = np.zeros((n // 2 + 1, 2, n, pairs, 2, 2, 2 * lanes))
    patch = np.zeros((2, n, n, 1, pairs))
    for channel in range(channels):
        half, pair = divmod(channel, pairs)
        patch[half, :, :, 0, pair] = tile[..., channel]
        for j in range(count):
            own = spectrum[j, :, : n // 2 + 1, channel].T
            at = np.s_[:, j // (2 * lanes), :, pair, half]
            table[at][..., 0, j % (2 * lanes)], table[at][..., 1, j % (2 * lanes)] = own.real, own.imag
    out = n - size + 1
    found = sums(FLOATS, tuple(patch), table, out, block).reshape(out, out, -1)[..., :count]
    exact = [
        [[(tile[y : y + 3, x : x + 3] * w).sum() for w in weight] for x in range(out)] for y in range(out)
    ]
    # 448 numbers of magnitudes below 10, a hundred operations each: off by half an eps.
    assert np.abs(found - exact).max() < 448 * 10 * 50 * np.finfo(float).eps


# ---- texts -----------------------------------------------------------------------------------------------


@pytest.mark.nightly(but=("1-kwargs1-c", "2-kwargs0-opencl", "2-kwargs2-c"))
@pytest.mark.parametrize("target", ["opencl", "c"])
@pytest.mark.parametrize(
    ("tiles", "kwargs"),
    [
        (2, {}),
        (1, {"border": "clamp", "activation": "relu"}),
        (2, {"images": ("color", "normal", "albedo"), "neurons": 10}),
    ],
)
def test_texts_of_spectra_compute_what_is_certified(target, tiles, kwargs, tmp_path):
    """TXT-9: blocks of pairs, a channel without a partner, two groups of neurons."""
    path = kernel(tmp_path, target, tiles=tiles, **kwargs)
    assert checker.check(path)
    assert check_text(path)["sums"] == 3 * 36 * tiles


def test_the_loops_of_a_host_are_read(c):
    for old, new in (
        ("y += OUT", "y += 1"),
        ("x += TILES * OUT", "x += OUT"),
        ("y < height", "y < height - 1"),
    ):
        with pytest.raises((Refused, Unread), match=r"its work items are of|not a frame of c"):
            run_text(*changed(c, old, new))


def test_work_items_are_those_of_the_manifest(opencl):
    with pytest.raises(Refused, match="its work items are of"):
        run_text(*changed(opencl, "(int)get_global_id(1) * OUT", "(int)get_global_id(1) * POINTS"))


def test_products_in_another_order_are_refused(opencl):
    """The bound is one of partial sums in this order."""
    source, *others = opencl
    pieces = source.split("real[t][0] += w0 * a;"), source.split("real[t][0] += w4 * c;")
    assert [len(p) for p in pieces] == [2, 2]
    turned = source.replace("real[t][0] += w0 * a;", "@").replace(
        "real[t][0] += w4 * c;", "real[t][0] += w0 * a;"
    )
    with pytest.raises(Refused, match="never made"):
        run_text(turned.replace("@", "real[t][0] += w4 * c;"), *others)


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        (" = sin %1 ", " = sin %0 ", "no meaning"),
        (" = affine %3 ", " = affine %0 ", "not the only one"),
        ("  %1 = affine %0 {bias=b0, weight=W0}", "  %1 = affine %0 {weight=W0}", "another bias"),
    ],
)
def test_programs_that_read_the_window_otherwise_are_not_read(opencl, old, new, why):
    source, held, *others = opencl
    assert old in held["program"]
    with pytest.raises((Refused, Unread), match=why):
        run_text(source, {**held, "program": held["program"].replace(old, new)}, *others)


def test_tiles_of_other_sizes_are_not_read(opencl):
    source, held, manifest, weights = opencl
    with pytest.raises(Unread, match="6 x 6"):
        run_text(source, held, {**manifest, "schedule": {**manifest["schedule"], "rows": 5}}, weights)


def test_the_operands_of_a_sum_may_be_exchanged(opencl):
    assert run_text(*changed(opencl, "* 4] = a + c;", "* 4] = c + a;"))
    assert run_text(*changed(opencl, "real[t][0] += w0 * a;", "real[t][0] = a * w0 + real[t][0];"))


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("bias",), 0), (("order",), [1, 0, 2, 3, 4, 5]), (("block",), 1), (("centres", 0), 0.25),
        (("table", "offset"), 4),
    ],
)  # fmt: skip
def test_a_text_is_held_against_what_its_certificate_says(opencl, place, value):
    source, held, *others = opencl
    spectra = {**held["spectra"], "table": dict(held["spectra"]["table"])}
    spectra["centres"] = list(spectra["centres"])
    at = spectra
    for key in place[:-1]:
        at = at[key]
    assert at[place[-1]] != value
    at[place[-1]] = value
    with pytest.raises(Refused, match="never made"):
        run_text(source, {**held, "spectra": spectra}, *others)


# ---- wrong texts -----------------------------------------------------------------------------------------

FAULTS = json.loads(Path(__file__).with_name("spectra_faults.json").read_text())
"""What a person who edits a transform, a product, a tile or a manifest may do wrong.

Of texts: what, the targets that have the text, which text, and what instead; of entry points: by target,
which text, and what instead; of hosts: what, which launches,
the number of one, its key, and by how much.
"""

WRONG = [(what, target, old, new) for what, names, old, new in FAULTS["texts"] for target in names.split()]

USUAL = [f"{names.split()[-1]}: {what}" for what, names, *_ in FAULTS["texts"][::10]]
"""One or two of each part of a kernel, in one language; a fault takes a second to read."""

ENTRIES = {f"{t}-{k}": (t, *each) for t, some in FAULTS["entries"].items() for k, each in enumerate(some)}
"""Faults of entry points; each run has every third, of all parts of a text in some language."""


@pytest.fixture(scope="module")
def opengl(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("opengl"), "opengl"))


def test_texts_of_passes_compute_what_is_certified(opengl, tmp_path):
    """TXT-12: one tile, of all images' pixels at its border."""
    assert run_text(*opengl)["sums"] == 3 * 36
    vulkan = parts(kernel(tmp_path, "glsl-vulkan", border="clamp", neurons=18))
    assert run_text(*vulkan)["sums"] == 3 * 36
    for old, new in (("+ line - WINDOW_CENTRE", "+ line"), ("* 3 + 1] = ", "* 3 + 2] = ")):
        with pytest.raises(Refused, match=r"not the program's|without a result|a product with 0"):
            run_text(*changed(vulkan, old, new))


@pytest.fixture(scope="module")
def wgsl(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("wgsl"), "wgsl"))


@pytest.fixture(scope="module")
def cuda(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("cuda"), "cuda"))


@pytest.fixture(scope="module")
def metal(tmp_path_factory):
    return parts(kernel(tmp_path_factory.mktemp("metal"), "metal"))


@pytest.mark.parametrize("target", ["wgsl", "cuda", "metal"])
def test_passes_may_be_entry_points(target, request):
    """TXT-12: each launch is one, of the manifest's name; each has the memory between them."""
    assert run_text(*request.getfixturevalue(target))["sums"] == 3 * 36


@pytest.mark.nightly(but=[*ENTRIES][::3])
@pytest.mark.parametrize(("target", "old", "new"), ENTRIES.values(), ids=ENTRIES)
def test_wrong_entry_points_are_refused(target, old, new, request):
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(*changed(request.getfixturevalue(target), old, new))


@pytest.mark.nightly(but=USUAL)
@pytest.mark.parametrize(("what", "target", "old", "new"), WRONG, ids=[f"{t}: {w}" for w, t, *_ in WRONG])
def test_wrong_texts_of_spectra_are_refused(what, target, old, new, request):
    """TXT-8: a wrong sign, place, part, border, number of turns, or host."""
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(*changed(request.getfixturevalue(target), old, new))


@pytest.mark.parametrize(("what", "of", "number", "key", "more"), FAULTS["hosts"])
def test_hosts_of_other_launches_are_refused(what, of, number, key, more, opengl):
    source, held, manifest, weights = opengl
    launches = [dict(each) for each in manifest["schedule"][of]]
    launches[number][key] += more
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(source, held, {**manifest, "schedule": {**manifest["schedule"], of: launches}}, weights)


@pytest.mark.parametrize("array", ["rows", "columns", "products", "back", "sums"])
def test_hosts_of_less_memory_are_refused(array, opengl):
    source, held, manifest, weights = opengl
    memory = {**manifest["schedule"]["memory"]}
    memory[array] -= 2
    with pytest.raises((Refused, Unread), match=r"\S"):
        run_text(source, held, {**manifest, "schedule": {**manifest["schedule"], "memory": memory}}, weights)


def test_entry_points_of_another_order_are_refused(wgsl):
    source, held, manifest, weights = wgsl
    entries = [*reversed(manifest["schedule"]["entries"])]
    schedule = {**manifest["schedule"], "entries": entries}
    with pytest.raises(Refused, match="than its manifest says"):
        run_text(source, held, {**manifest, "schedule": schedule}, weights)


@pytest.mark.parametrize(
    ("key", "value"),
    [("entries", "main_1"), ("arrays", ["columns"]), ("arrays", ["back", "columns"]), ("items", 16)],
)
def test_hosts_of_other_facts_are_refused(key, value, opengl):
    source, held, manifest, weights = opengl
    stated = manifest["schedule"][key]
    changed = value if key == "items" else [stated[0], value, *stated[2:]]
    with pytest.raises(Refused, match="than its manifest says"):
        run_text(source, held, {**manifest, "schedule": {**manifest["schedule"], key: changed}}, weights)
