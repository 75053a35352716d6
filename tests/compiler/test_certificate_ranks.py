"""First layers of low rank: both kernels have a certificate, and both sources are checked (CER-9, TXT-7)."""

import base64
import inspect
import json
import math
import shutil
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from texts import NAME, certificate_of, changed, leaves, model, parts, put, unnoticed

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_plan, compile_program
from wamnet.compiler.core.interpret import interpret
from wamnet.compiler.core.lower import lower
from wamnet.compiler.plan import plan_program
from wamnet.compiler.proof import checker, evidence
from wamnet.compiler.proof.evidence import FIRST_PASS, Refused
from wamnet.compiler.reading.check import check_text, common_names, run_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.reading.languages import TITLES
from wamnet.compiler.schedules import schedules
from wamnet.kernels.devices.numpy_executor import NumpyExecutor
from wamnet.refimpl.errors import InputError

SCHEMA = json.loads((Path(__file__).parents[2] / "spec/certificate.schema.json").read_text())


def kernels(folder, target="opencl", schedule="plain", rank=6, **kwargs):
    """Write both kernels of a small model; return the path of the second one's certificate."""
    artifact.write(compile_program(lower(model(**kwargs)), target, schedule, rank), folder)
    return folder / NAME


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return kernels(tmp_path_factory.mktemp("ranks"), omegas=(2.0, 3.0))


WAYS = [(target, "plain", "zero") for target in sorted(TITLES)]
WAYS += [("opencl", "tile:8", "clamp"), ("c", "tile:8", "zero"), ("opengl", "inlined", "clamp")]
WAYS += [("glsl-es", "packed", "zero"), ("cuda", "group:2", "clamp"), ("wgsl", "group:4", "zero")]
"""Languages and schedules; borders in turn."""


@pytest.mark.parametrize(("target", "schedule", "border"), WAYS)
def test_both_kernels_are_certified_and_compute_what_is(target, schedule, border, tmp_path):
    path = kernels(tmp_path, target, schedule, border=border)
    first = path.with_name(FIRST_PASS + NAME)
    for each in (first, path):
        jsonschema.validate(checker.check(each), SCHEMA)
    found = [check_text(each)["sums"] for each in (first, path)]
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    pixels = [each["schedule"].get("pixels", 1) for each in (manifest["factored"]["horizontal"], manifest)]
    # Two images' row of taps and their sum; three rows of taps, their sum, and two layers behind.
    assert found == [3 * pixels[0], 3 * pixels[0] + 6 * pixels[1]]


@pytest.mark.parametrize("rank", [1, 3, 11, 18])
@pytest.mark.parametrize(("border", "activation"), [("zero", "sine"), ("clamp", "relu")])
def test_the_bound_holds(rank, border, activation):
    """Both kernels against the program that was cut, at corners of the images' ranges; of rank 18 exactly."""
    plan = plan_program(lower(model(border=border, activation=activation)), "numpy", rank=rank)
    random, proof, kernel = np.random.default_rng(rank), plan.bound.proof, compile_plan(plan)
    corners = random.choice([0.0, 0.5, 1.0], (11, 9, 6)).astype(np.float32)
    images = {"color": corners[..., :3], "normal": 2 * corners[..., 3:] - 1}
    windows = schedules.windows(plan.analysed.gather, images)
    found = NumpyExecutor().run(kernel, images)
    (expected,) = interpret(plan.analysed, {"window": windows}, np.float64).values()
    assert (np.abs(found - expected).max(axis=(0, 1)) <= proof.bound).all()


def copied(path, folder, held=None, manifest=None, first=None):
    """Write the kernels of a certificate with some files changed; return its path."""
    for file in path.parent.iterdir():
        shutil.copy(file, folder)
    for name, content in ((NAME, held), ("manifest.json", manifest), (FIRST_PASS + NAME, first)):
        if content is not None:
            (folder / name).write_text(json.dumps(content))
    return folder / NAME


def test_any_smaller_number_is_refused(path, tmp_path):
    """Of both certificates, and of what the manifest says of the cut."""
    manifest = certificate_of(path.with_name("manifest.json"))
    texts = {"held": certificate_of(path), "first": certificate_of(path.with_name(FIRST_PASS + NAME))}
    less = [(key, text, place) for key, text in texts.items() for place in leaves(text)]
    less += [("manifest", manifest, ("factored", "cut", key)) for key in ("first_layer", "of")]
    less += [("manifest", manifest, ("factored", "horizontal", "bound", "output", n)) for n in range(6)]
    assert len(less) > 80
    ways = {"manifest": lambda x: 0.99 * x}
    for key, text, place in less:
        smaller = {key: put(text, place, ways.get(key, lambda x: math.nextafter(x, -1.0)))}
        with pytest.raises(Refused, match=": "):
            pytest.fail(f"{key} {place}: {checker.check(copied(path, tmp_path, **smaller))}")


H = ("factored", "horizontal")


@pytest.mark.parametrize(
    ("key", "place", "value", "match"),
    [
        ("manifest", ("digest",), "0" * 64, "digest of both kernels"),
        ("manifest", (*H, "digest"), "0" * 64, "digest of both kernels"),
        ("manifest", ("factored", "rank"), 5, "rank"),
        ("manifest", ("factored", "cut", "against"), lambda _: {}, "strings"),
        ("manifest", ("factored", "cut"), lambda cut: {**cut, "to": 1}, "states of the rank"),
        ("manifest", ("factored", "horizontal"), lambda first: {**first, "to": 1}, "unknown keys"),
        ("manifest", ("factored", "program"), "0" * 64, "digest of the program that was cut"),
        ("manifest", (*H, "target"), "c", "first kernel: target"),
        ("manifest", (*H, "profile", "text"), "", "first kernel: profile"),
        ("manifest", (*H, "window", "centre"), 2, "centre"),
        ("manifest", (*H, "window", "columns"), 2, "manifest: window"),
        ("manifest", ("window", "rows"), 2, "manifest: window"),
        ("manifest", ("images", 0, "high"), 1e9, "manifest: images"),
        ("manifest", (*H, "files", "weights.bin"), "0" * 64, "files of the first kernel"),
        ("manifest", ("files", f"{FIRST_PASS}denoise.cl"), "0" * 64, "files of the first kernel"),
        ("held", ("factored", "parameters", "W0", "base64"), "AAAA" * 2, "."),
        ("held", ("factored", "parameters"), {}, "."),
        ("held", ("factored", "program"), "program\n", "."),
        ("first", ("program_digest",), "0" * 64, "digest of the program"),
        ("first", ("outputs", 0, "scalings"), [[1.0]], "sizes of scalings"),
        ("held", ("bound", "against"), evidence.AGAINST[0], "bound: against"),
        ("manifest", ("factored", "rank"), 6.0, "of the rank"),
        ("manifest", ("window", "size"), 4, "window"),
        ("manifest", ("window", "rows"), 3.0, "integers above"),
        ("manifest", ("entry_point",), "other", "entry point"),
        (
            "held",
            ("factored", "program"),
            lambda text: f"{text}  %0 = nothing\n",
            "program that was cut|lines of no kind",
        ),
    ],
)
def test_other_kernels_are_refused_by_name(path, tmp_path, key, place, value, match):
    manifest = json.loads((path.parent / "manifest.json").read_text())
    texts = {"held": certificate_of(path), "first": certificate_of(path.with_name(FIRST_PASS + NAME))}
    other = put({**texts, "manifest": manifest}[key], place, value if callable(value) else lambda _: value)
    held = copied(path, tmp_path, **{key: other})
    with pytest.raises((Refused, InputError), match=match):
        checker.check(held) and check_text(held)


@pytest.mark.parametrize("name", [FIRST_PASS + NAME, f"{FIRST_PASS}denoise.cl", f"{FIRST_PASS}weights.bin"])
def test_a_missing_file_of_the_first_kernel_is_told(path, tmp_path, name):
    held = copied(path, tmp_path)
    (tmp_path / name).unlink()
    with pytest.raises(InputError, match="not found"):
        checker.check(held)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("window 3x3", "window 2x3", "window"),
        ("border zero", "border clamp", "border|window"),
        ("in [-1.0, 1.0]", "in [-0.5, 0.5]", "first kernel: window and images"),
        ("{value=3.0}", "{value=2.0}", "what it does with the first layer"),
        ("= sin %", "= cos %", "what it does with the first layer"),
        ("output color", "output other", "what it does with the first layer"),
    ],
)
def test_another_program_that_was_cut_is_refused(path, tmp_path, old, new, match):
    """With its digest: what holds is not the digest, but what both kernels compute."""
    held, _, _, arrays, _ = evidence.read(path)
    raw = certificate_of(path.with_name("manifest.json"))
    text = held["factored"]["program"]
    assert old in text
    held["factored"]["program"] = text = text.replace(old, new, 1)
    weights = evidence.parameters_of(held["factored"], [])
    floats = {name: array.astype("<f4") for name, array in arrays.items()} | weights
    raw["factored"]["program"] = evidence.digest_of(text, floats)
    with pytest.raises(Refused, match=match):
        checker.check(copied(path, tmp_path, held, raw))


def test_other_weights_of_the_program_that_was_cut_are_refused(path, tmp_path):
    """One of them moved by a hundredth, with its digest: the cut leaves out more than is stated."""
    held, _, _, arrays, _ = evidence.read(path)
    raw = certificate_of(path.with_name("manifest.json"))
    weight = evidence.parameters_of(held["factored"], [])["W0"].copy()
    weight[0, np.abs(weight[0]).argmax()] *= np.float32(1.01)
    held["factored"]["parameters"]["W0"]["base64"] = base64.b64encode(weight.tobytes()).decode()
    floats = {name: array.astype("<f4") for name, array in arrays.items()} | {"W0": weight}
    raw["factored"]["program"] = evidence.digest_of(held["factored"]["program"], floats)
    with pytest.raises(Refused, match=r"manifest: cut|bound"):
        checker.check(copied(path, tmp_path, held, raw))


RULES = {
    "what the first kernel's error makes": ("@ np.tile(error, rows)", "@ np.tile(0 * error, rows)"),
    "what the rank leaves out": ("off @ largest\n", "0 * off @ largest\n"),
    "float64's rounding of the product": ("(rank + 2) * 2.0**-52", "0.0 * (rank + 2)"),
    "what the first kernel may write": ("(least - error, most + error)", "(0.5 * least, 0.5 * most)"),
    "both are passed on": ("passed + left, least", "left, least"),
    "times omega_0": ("scale * passed, scale * reach", "passed, scale * reach"),
}
"""A rule made weaker, in the checker's text."""


@pytest.mark.parametrize("rule", RULES)
def test_each_rule_is_needed(path, rule):
    """A checker with a weaker rule finds a smaller number: what it takes, the real one refuses."""
    source, (old, new) = inspect.getsource(checker), RULES[rule]
    assert source.count(old) == 1, rule
    weaker = dict(vars(checker))
    exec(compile(source.replace(old, new), "mutant", "exec"), weaker)
    held, _, text, arrays, _ = evidence.read(path)
    _, _, first_text, first_arrays, _ = evidence.read(path.with_name(FIRST_PASS + NAME))
    weight = evidence.parameters_of(held["factored"], [])["W0"].astype(np.float64)
    layers, box = checker.network_of(text)
    promise = checker.PROMISES[held["sine"]["text"]]

    def errors(of):
        texts = held["factored"]["program"], first_text, text
        cut = of["cut_steps"](texts, (weight, first_arrays, arrays), promise)
        return of["layer_steps"](layers, box, arrays, promise, None, cut)[1][0]

    found = [errors(of) for of in (vars(checker), weaker)]
    assert (found[1] <= found[0]).all()
    assert found[1].sum() < found[0].sum()


def test_integers_are_of_one_kernel(path, tmp_path):
    """A certificate of integers beside the files of two kernels, whatever its digests say."""
    held = {**certificate_of(path), "schema": evidence.INTEGERS}
    held["bound"]["against"] = evidence.AGAINST[1]
    with pytest.raises(Refused, match="integers of two kernels"):
        checker.check(copied(path, tmp_path, held))


@pytest.mark.parametrize(
    "between", [["horizontal: 5"], ["horizontal_0: 2", "horizontal_1: 4"], ["horizontal_0: 6"]]
)
def test_images_between_are_those_that_the_first_kernel_writes(path, between):
    """KER-15: one, or of four channels each; not fewer or others, with as many channels together or not."""
    held, _, text, arrays, _ = evidence.read(path)
    _, _, first_text, first_arrays, _ = evidence.read(path.with_name(FIRST_PASS + NAME))
    weight = evidence.parameters_of(held["factored"], [])["W0"].astype(np.float64)
    (line,) = (line for line in text.splitlines() if line.startswith("  image horizontal: 6"))
    ends = line.partition(" in ")[2]
    text = text.replace(line, "\n".join(f"  image {each} in {ends}" for each in between))
    with pytest.raises(Refused, match=r"images are the first one's result|numbers in a window"):
        checker.cut_steps(
            (held["factored"]["program"], first_text, text), (weight, first_arrays, arrays), None
        )


@pytest.mark.parametrize("target", ["c:inline", "opencl:inline"])
def test_tables_of_both_kernels_are_read(target, tmp_path):
    assert check_text(kernels(tmp_path, target))["sums"] == 9


def text_of(path, first):
    """Return what `run_text` takes of the first kernel, or of the second one."""
    source, *others = parts(path.with_name(FIRST_PASS + NAME) if first else path)
    return common_names(source) if "wamnet_horizontal_" in source else source, *others


@pytest.mark.parametrize(
    ("target", "first", "old", "new", "why"),
    [
        ("opengl", True, "result_1[1]", "result_1[0]", "written twice|without"),
        ("opengl", True, "result_1[0]", "result_0[4]", "is no number of one"),
        ("opengl", True, "result_0[0] = v1[0]", "result_0[0] = v1[1]", "not the program's"),
        ("opengl", True, "location = 1", "location = 2", "colour buffers"),
        ("opengl", True, "out vec4 result_1", "out vec4 result_0", "colour buffers"),
        ("glsl-es", True, "    result_1 = vec4(0.0, 0.0, 0.0, 1.0);\n", "", "colour buffers|frame"),
        ("glsl-es", False, "vec4 result;", "vec4 result_0;", "colour buffers|frame"),
        ("glsl-es", False, "image_horizontal_1, ivec2", "image_horizontal_0, ivec2", "never made"),
        ("opencl", True, "WINDOW_COLUMNS 3", "WINDOW_COLUMNS 2", "never made"),
        ("opencl", True, "CENTRE_ROW 0", "CENTRE_ROW 1", "never made|beyond"),
        ("opencl", False, "CENTRE_COLUMN 0", "CENTRE_COLUMN 1", "never made|beyond"),
        ("opencl", False, "y + dy", "x + dy", r"\S"),
    ],
)  # fmt: skip
def test_faults_of_both_kernels_are_refused(target, first, old, new, why, tmp_path):
    given = text_of(kernels(tmp_path, target), first)
    with pytest.raises((Refused, Unread), match=why):
        run_text(*changed(given, old, new))


def test_names_of_both_headers_are_apart(tmp_path):
    """KER-16: a first kernel that calls a function of the second one is refused."""
    source = (kernels(tmp_path, "c").parent / f"{FIRST_PASS}denoise.h").read_text()
    assert "wamnet_pixel" in common_names(source)
    for old in ("wamnet_horizontal_clamp(y", "WAMNET_HORIZONTAL_H"):
        assert old in source
        with pytest.raises(Unread, match="names of the second kernel"):
            common_names(source.replace(old, old.replace("_horizontal", "").replace("HORIZONTAL", "DENOISE")))


@pytest.mark.parametrize("first", [True, False])
@pytest.mark.parametrize("target", ["opencl", "opengl"])
def test_planted_faults_are_found(target, first, tmp_path):
    """The first kernel has one row of taps: signs of what is 0 say nothing."""
    given = text_of(kernels(tmp_path, target), first)
    lines = [given[0][fault.start :].partition("\n")[0] for fault in unnoticed(given, 60)]
    assert [line for line in lines if not (first and "CENTRE_ROW, 0, height" in line)] == []
