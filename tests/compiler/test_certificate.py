"""Certificates: what the checker accepts and refuses, and that their bounds hold."""

import ast
import inspect
import json
import math
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from kit import biased, untrained
from texts import certificate_of, leaves, put

from wamnet.compiler import artifact
from wamnet.compiler.compile import compile_program
from wamnet.compiler.core.ir import Type, sha256
from wamnet.compiler.core.lower import lower
from wamnet.compiler.core.trace import trace
from wamnet.compiler.proof import checker, evidence, scaled, sine_checker, spectra_checker
from wamnet.compiler.targets import language_named
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network import siren

NAME = artifact.CERTIFICATE_NAME
SPEC = Path(__file__).parents[2] / "spec"


def model(omega_0=3.0, activation="sine"):
    return untrained((6, 5), size=3, border="zero", omegas=(1.0, omega_0), activation=activation)


def written(folder, target="opencl", schedule="plain", **kwargs):
    """Write the kernel of a small model, and return the path of its certificate."""
    artifact.write(compile_program(lower(model(**kwargs)), target, schedule=schedule), folder)
    return folder / NAME


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return written(tmp_path_factory.mktemp("kernel"))


@pytest.fixture(scope="module")
def changed(path, tmp_path_factory):
    """Write another certificate, or manifest, beside a copy of the kernel's files."""
    folder = tmp_path_factory.mktemp("changed")

    def write(**others):
        for name in ("manifest.json", "weights.bin", "denoise.cl", NAME):
            given = others.get(name.replace(".", "_"))
            held = (path.parent / name).read_bytes() if given is None else given
            (folder / name).write_bytes(held if isinstance(held, bytes) else json.dumps(held).encode())
        return folder / NAME

    return write


@pytest.mark.parametrize(
    ("target", "schedule"),
    [
        ("opencl", "plain"),
        ("opencl", "tile:16"),
        ("opencl", "vector:16"),
        ("opengl", "inlined"),
        ("numpy", "plain"),
    ],
)
def test_certificates_of_all_schedules_hold(tmp_path, target, schedule):
    held = checker.check(written(tmp_path, target, schedule))
    assert max(held["bound"]["output"]) <= max(
        json.loads((tmp_path / "manifest.json").read_text())["bound"]["output"]
    )


@pytest.mark.parametrize(
    ("target", "profile"),
    [("opencl", "native"), ("cuda", "native"), ("c", "ieee-sine7")],
)
def test_certificates_of_all_profiles_hold(tmp_path, target, profile):
    """The checker knows every sine of which something is promised."""
    artifact.write(compile_program(lower(model()), language_named(target).under(profile)), tmp_path)
    held = checker.check(tmp_path / NAME)
    assert held["profile"] == profile
    assert target != "opencl" or held["sine"]["domain"] is None


def test_a_certificate_is_what_its_schema_says(path):
    schema = json.loads((SPEC / "certificate.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.validate(certificate_of(path), schema)


def smaller_numbers(path):
    """Yield copies of a certificate in which one number is smaller, and its place."""
    held = certificate_of(path)
    places = leaves(held)
    assert len(places) > 50
    for place in places:
        for smaller in (lambda x: math.nextafter(x, -math.inf), lambda x: x / 2, lambda x: -x, lambda x: 0):
            yield put(held, place, smaller), place


def test_any_number_made_smaller_is_refused(path, changed):
    """By one unit in its last place, and by half: each number is the least that the checker takes."""
    for held, place in smaller_numbers(path):
        with pytest.raises(checker.Refused, match=": "):
            pytest.fail(f"{place}: {checker.check(changed(denoise_certificate_json=held))}")


# ---- spectra ---------------------------------------------------------------------------------------------


def spectral(folder, target="opencl", schedule="fft:16", activation="sine"):
    """Write a kernel of spectra: 12 channels, of which 6 are centred, and 5 pairs of neurons."""
    features = ("color", "normal", "albedo", "position")
    given = untrained((21, 6), features, 9, "zero", (2.0, 3.0), activation=activation)
    kernel = compile_program(lower(biased(given)), target, schedule=schedule)
    assert kernel.manifest["schedule"]["name"] == schedule
    artifact.write(kernel, folder)
    return folder / NAME


@pytest.fixture(scope="module")
def of_spectra(tmp_path_factory):
    return spectral(tmp_path_factory.mktemp("spectra"))


@pytest.mark.parametrize(
    ("target", "schedule", "activation"),
    [("opencl", "fft:16", "sine"), ("opencl", "fft:4", "relu"), ("c", "fft:8", "sine")],
)
def test_certificates_of_spectra_hold(tmp_path, target, schedule, activation):
    path = spectral(tmp_path, target, schedule, activation)
    held = checker.check(path)
    assert held["spectra"]["centres"] == [0.5, 0.5, 0.5, 0.0, 0.0, 0.0] * 2
    assert held["spectra"]["order"] != list(range(21))
    jsonschema.validate(held, json.loads((SPEC / "certificate.schema.json").read_text()))


def test_any_smaller_number_of_a_certificate_of_spectra_is_refused(of_spectra, tmp_path):
    for name in ("manifest.json", "weights.bin", "denoise.cl"):
        (tmp_path / name).write_bytes((of_spectra.parent / name).read_bytes())
    held = certificate_of(of_spectra)
    places = leaves(held)
    # Of neurons one in seven: each takes the checker a second.
    steps = [place for place in places if "step_bounds" in place]
    assert len(steps) == 12
    few = [place for place in places if place not in steps]
    for place in steps[::3] + few[::17]:
        (tmp_path / NAME).write_text(json.dumps(put(held, place, lambda x: math.nextafter(x, -math.inf))))
        with pytest.raises(checker.Refused, match=": "):
            pytest.fail(f"{place}: {checker.check(tmp_path / NAME)}")


def test_spectra_are_of_square_windows(of_spectra, tmp_path):
    """A program of a row of 81 taps has as many weights as one of 9 x 9."""
    held, manifest = certificate_of(of_spectra), json.loads((of_spectra.parent / "manifest.json").read_text())
    text = held["program"].replace("window 9x9", "window 1x81")
    arrays = {key: a.astype("<f4") for key, a in evidence.read(of_spectra)[3].items()}
    held |= {"program": text, "program_digest": evidence.digest_of(text, arrays), "centre": 40}
    manifest |= {"program": held["program_digest"]}
    manifest["window"] |= {"size": 81, "rows": 1, "columns": 81, "centre": 40}
    for name in ("weights.bin", "denoise.cl"):
        (tmp_path / name).write_bytes((of_spectra.parent / name).read_bytes())
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    (tmp_path / NAME).write_text(json.dumps(held))
    with pytest.raises(checker.Refused, match="spectra: a window along one axis"):
        checker.check(tmp_path / NAME)


@pytest.mark.parametrize(
    ("place", "value", "match"),
    [
        (("spectra", "points"), 16, "spectra: shape"),
        (("spectra", "points"), 64, "spectra: points"),
        (("spectra", "lanes"), 8, "spectra: shape"),
        (("spectra", "block"), 0, "lanes and block are counts"),
        (("spectra", "block"), 3, "step_bounds"),
        (("spectra", "centres", 0), 0.4, "centres in float32"),
        (("spectra", "centres", 0), 0.25, "step_bounds|rounding_bound"),
        (("spectra", "order", 0), 21, "spectra: order"),
        (("spectra", "table", "offset"), 32, "real at 0|step_bounds"),
        (("spectra", "table", "offset"), 10**9, "place in the weights"),
        (("spectra", "bias"), None, "centres without a bias"),
        (("spectra", "bias"), 0, "bound"),
        (("outputs", 1, "spectra", "scalings"), [1.0], "number of scalings"),
        (("outputs", 1, "spectra", "scalings", 0), -1.0, "must be positive"),
        (("outputs", 1, "spectra", "scalings", 0), 64.0, "step_bounds"),
    ],
)
def test_a_changed_step_of_spectra_is_refused_by_name(of_spectra, tmp_path, place, value, match):
    for name in ("manifest.json", "weights.bin", "denoise.cl"):
        (tmp_path / name).write_bytes((of_spectra.parent / name).read_bytes())
    (tmp_path / NAME).write_text(json.dumps(put(certificate_of(of_spectra), place, lambda _: value)))
    with pytest.raises(checker.Refused, match=match):
        checker.check(tmp_path / NAME)


def test_a_wrong_spectrum_in_the_weights_is_refused(of_spectra, tmp_path):
    """One number of the table a thousandth off, all digests made to agree: its step is above its bound."""
    held, manifest = certificate_of(of_spectra), json.loads((of_spectra.parent / "manifest.json").read_text())
    raw = np.frombuffer((of_spectra.parent / "weights.bin").read_bytes(), "<f4").copy()
    table = held["spectra"]["table"]
    part = raw[table["offset"] :][: math.prod(table["shape"])]
    part[np.abs(part).argmax()] *= np.float32(1.001)
    manifest["files"] = held["files"] = {**manifest["files"], "weights.bin": sha256(raw.tobytes())}
    (tmp_path / "weights.bin").write_bytes(raw.tobytes())
    (tmp_path / "denoise.cl").write_bytes((of_spectra.parent / "denoise.cl").read_bytes())
    (tmp_path / "manifest.json").write_text(json.dumps(manifest))
    (tmp_path / NAME).write_text(json.dumps(held))
    with pytest.raises(checker.Refused, match="spectra: step_bounds"):
        checker.check(tmp_path / NAME)


SPECTRAL_MUTANTS = {
    "factor": ("[2.8]", "[2.7]"),
    "eighth": ("[2.3]", "[2.2]"),
    "sums": ("*factor, 1.0, 1.0]", "*factor, 1.0]"),
    "unpacking": ("(low + 1) + 1 + centring", "(low + 1) + centring"),
    "centring": ("1 + centring)", "1)"),
    "table": ("np.sqrt(2 * ((after", "np.sqrt(1 * ((after"),
    "rounding of products": ("np.sqrt(2 * (norms(np.abs(bent))", "np.sqrt(1 * (norms(np.abs(bent))"),
    "additions": ("(2 if k else 1)", "1"),
    "blocks": ("if done else 0.0", "if done and not done else 0.0"),
    "pairs": ("after[self.both].max(axis=0)", "after[self.both].min(axis=0)"),
    "combination": ("back = np.sqrt(squares.sum()) + ", "back = "),
    "columns": ("squares.sum(axis=1)", "squares.sum(axis=1) / 2"),
    "rows": ("back += low *", "back += low / 2 *"),
    "mirrored": ("half == 0, 1.0, 2.0)", "half == 0, 1.0, 1.0)"),
}
"""A rule of each step made weaker, in the checker's text."""


@pytest.mark.parametrize("mutant", SPECTRAL_MUTANTS)
def test_each_rule_of_spectra_is_needed(of_spectra, monkeypatch, mutant):
    """A checker with a weaker rule finds a smaller number: what it takes, the real one refuses."""
    source, (old, new) = inspect.getsource(spectra_checker), SPECTRAL_MUTANTS[mutant]
    assert source.count(old) == 1, mutant
    weaker = dict(vars(spectra_checker))
    exec(compile(source.replace(old, new), "mutant", "exec"), weaker)
    held, raw = certificate_of(of_spectra), evidence.read(of_spectra)[4]
    arrays, output = evidence.read(of_spectra)[3], held["outputs"][0]
    low, high = np.tile(([0.0] * 3 + [-1.0] * 3) * 2, 81), np.ones(972)
    scales = np.array(output["spectra"]["scalings"]), 2.0 * np.array(output["scalings"][0])
    given = held["spectra"], arrays["W0"], arrays["b0"], raw, low, high
    found = [made(*given).steps(*scales) for made in (spectra_checker.Tables, weaker["Tables"])]
    assert sum(found[1]) < sum(found[0]) * (1 - 2.0**-10)


# ---- rectifiers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("omega_0", [1.0, 3.0])
@pytest.mark.parametrize("schedule", ["plain", "tile:16"])
def test_certificates_of_rectifiers_hold(tmp_path, schedule, omega_0):
    path = written(tmp_path, schedule=schedule, omega_0=omega_0, activation="relu")
    held = checker.check(path)
    assert "maximum" in held["program"]
    assert "sin " not in held["program"]
    jsonschema.validate(held, json.loads((SPEC / "certificate.schema.json").read_text()))


def clipped(network, window):
    """Return what a network does whose activation is the smaller of its argument and 1: no rectifier."""
    x = np.minimum(np.matmul(window, network.weights[0].T) + network.biases[0], 1.0)
    return np.matmul(x, network.weights[1].T) + network.biases[1]


def test_a_network_of_one_layer_has_a_certificate_but_of_spectra(tmp_path):
    """Sums from spectra have scalings between layers, of which it has none."""
    given = untrained((), ("color",), 12, "clamp")
    for schedule, proven in (("plain", True), ("fft:4", False)):
        kernel = compile_program(lower(given), "opencl", schedule)
        assert kernel.manifest["schedule"]["name"] == schedule
        assert (kernel.certificate is not None) == proven


def test_an_activation_that_no_proof_knows_has_a_bound_and_no_certificate():
    network = siren.init((9, 4, 3), 1.0, 1.0, 5)
    gather = lower(untrained((4,), ("color",), 3)).gather
    gather = replace(gather, images=(replace(gather.images[0], channels=1),))
    program = trace(lambda window: clipped(network, window), {"window": Type(shape=(9,))}, gather)
    kernel = compile_program(program, "opencl")
    assert kernel.certificate is None
    assert all(math.isfinite(error) for error in kernel.manifest["bound"]["output"])


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ("  %2 = ", "  %1 = ", "number of a line"),
        ("  %2 = ", "  %9 = ", "number of a line"),
        ("affine %0 ", "affine %1 ", "reads earlier lines"),
    ],
)
def test_a_program_whose_lines_mean_two_things_is_refused(path, old, new, why):
    """A value that is named twice is the last one for one reader, and the one above for another."""
    text = certificate_of(path)["program"]
    assert old in text
    with pytest.raises(checker.Refused, match=why):
        checker.network_of(text.replace(old, new, 1))


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, "0.5", True, None, [1.0]])
def test_what_is_no_number_is_refused(path, changed, value):
    held = put(certificate_of(path), ("outputs", 0, "error_bound"), lambda x: value)
    with pytest.raises((checker.Refused, InputError), match=r"must be"):
        checker.check(changed(denoise_certificate_json=held))


@pytest.mark.parametrize(
    ("place", "value", "match"),
    [
        (("schema",), "wamnet-certificate-2", "schema is"),
        (("manifest_digest",), "0" * 64, "digest of the kernel"),
        (("program_digest",), "0" * 64, "digest of the program in the certificate"),
        (("files", "denoise.cl"), "0" * 64, "digest of denoise.cl"),
        (("profile",), "native", "and profile is"),
        (("sine", "text"), "a better one", "sine: nobody promises it"),
        (("sine", "domain"), 25600.0, "sine: nobody promises it"),
        (("layers", 1, "node"), 1, "layer 1: node"),
        (("outputs", 1, "output"), 0, "outputs is"),
        (("outputs", 0, "scalings", 0, 2), 0.0, "scalings must be positive"),
        (("outputs", 0, "scalings", 0, 2), -1.0, "scalings must be positive"),
        (("outputs", 0, "scalings", 0, 2), 1e-3, "output 0: .*norm"),
        (("outputs", 0, "scalings", 0), [1.0], "sizes of scalings"),
        (("parameters", "b0", "offset"), 1, "digest of the program in the certificate"),
        (("layers",), [], "layers is 0"),
    ],
)
def test_a_changed_step_is_refused_by_name(path, changed, place, value, match):
    held = put(certificate_of(path), place, lambda _: value)
    with pytest.raises(checker.Refused, match=match):
        checker.check(changed(denoise_certificate_json=held))


@pytest.mark.parametrize(
    ("columns", "match"),
    [
        ({"step": 6, "count": 10**18}, "W0: more numbers than weights.bin has"),
        ({"step": 6, "count": -1}, "W0: counts and steps are integers"),
        ({"step": 6, "count": True}, "W0: counts and steps are integers"),
        ({"step": 6, "count": 54.0}, "W0: counts and steps are integers"),
        ({"step": 0.5, "count": 54}, "W0: counts and steps are integers"),
        ({"step": "6", "count": 54}, "W0: counts and steps are integers"),
        ({"step": 5, "count": 54}, "digest of the program in the certificate"),
        ({"step": 6, "count": 0}, "must be a complete certificate"),
        ({"step": -6, "count": 54}, "must be a complete certificate"),
        ({"step": 10**40, "count": 54}, "must be a complete certificate"),
        ({"step": 6, "count": 53}, "must be a complete certificate"),
        ({"step": 6}, "must be a complete certificate"),
        (54, "must be a complete certificate"),
    ],
)
def test_places_of_no_weights_are_refused(path, changed, columns, match):
    """CER-5: each with one error, before anything as long as a stated count is made."""
    held = certificate_of(path)
    assert held["parameters"]["W0"]["columns"] == {"step": 6, "count": 54}
    held = put(held, ("parameters", "W0", "columns"), lambda _: columns)
    with pytest.raises((checker.Refused, InputError), match=match):
        checker.check(changed(denoise_certificate_json=held))


def shared(path, folder, stated):
    """Copy a kernel, its weights one folder up; the manifest says that they are in the folder `stated`."""
    (folder / "kernel").mkdir()
    for file in path.parent.iterdir():
        parent = folder if file.name == "weights.bin" else folder / "kernel"
        (parent / file.name).write_bytes(file.read_bytes())
    manifest = json.loads((path.parent / "manifest.json").read_text())
    manifest["weights"] |= {} if stated is None else {"folder": stated}
    (folder / "kernel/manifest.json").write_text(json.dumps(manifest))
    return folder / "kernel" / NAME


def test_weights_may_be_one_folder_up(path, tmp_path):
    assert checker.check(shared(path, tmp_path, ".."))["bound"] == certificate_of(path)["bound"]
    (tmp_path / "weights.bin").write_bytes(bytes((tmp_path / "weights.bin").stat().st_size))
    with pytest.raises(checker.Refused, match=r"digest of weights.bin"):
        checker.check(tmp_path / "kernel" / NAME)


@pytest.mark.parametrize("stated", ["../..", "/", "../x", "", [".."], {}, 1, "..\0"])
def test_weights_elsewhere_are_refused(path, tmp_path, stated):
    with pytest.raises(checker.Refused, match=r"folder of weights.bin is \. or \.\."):
        checker.check(shared(path, tmp_path, stated))


def test_scalings_whose_products_overflow_are_refused_and_lapack_is_not_asked(path, changed, monkeypatch):
    """It would print a complaint of its own about numbers that are not finite."""
    held = certificate_of(path)
    for at, scale in ((0, 1e-308), (1, 1e308)):
        held = put(held, ("outputs", 0, "scalings", at), lambda old, scale=scale: [scale] * len(old))
    norm = np.linalg.norm
    monkeypatch.setattr(np.linalg, "norm", lambda x, *rest: norm(x, *rest) if np.isfinite(x).all() else 1 / 0)
    with pytest.raises(checker.Refused, match="output 0: layer 1, scaled, is not finite"):
        checker.check(changed(denoise_certificate_json=held))


def test_other_weights_are_refused(path, changed):
    """A bit in the file; and the same with all digests of files made to agree: the program's does not."""
    raw = bytearray((path.parent / "weights.bin").read_bytes())
    raw[5] ^= 1
    with pytest.raises(checker.Refused, match=r"digest of weights.bin"):
        checker.check(changed(weights_bin=bytes(raw)))
    manifest = json.loads((path.parent / "manifest.json").read_text())
    digests = {**manifest["files"], "weights.bin": sha256(bytes(raw))}
    held = {**certificate_of(path), "files": digests}
    manifest["files"] = digests
    with pytest.raises(checker.Refused, match="digest of the program in the certificate"):
        checker.check(changed(weights_bin=bytes(raw), denoise_certificate_json=held, manifest_json=manifest))


def test_another_source_is_refused(path, changed):
    source = (path.parent / "denoise.cl").read_bytes()
    with pytest.raises(checker.Refused, match=r"digest of denoise.cl"):
        checker.check(changed(denoise_cl=source[:-1] + b" "))


@pytest.mark.parametrize(
    ("place", "value", "match"),
    [
        (("schema",), "wamnet-artifact-9", "schema"),
        (("window", "size"), 5, "window"),
        (("window", "border"), "clamp", "window"),
        (("window", "centre"), True, "integers"),
        (("images", 0, "name"), "normal", "images"),
        (("images", 0, "channels"), 4, "images"),
        (("images", 0, "channels"), 3.0, "integers"),
        (("images", 0, "high"), 1000.0, "images"),
        (("images", 1, "low"), -100.0, "images"),
        (("images",), [], "images"),
        (("images",), lambda images: images[::-1], "manifest: images"),
        (("bound", "output", 1), lambda bound: bound / 2, "manifest: bound"),
        (("output", "name"), "normal", "output"),
        (("output", "channels"), "3", "integers"),
        (("schedule", "pixels"), "1", "integers"),
        (("schedule", "pixels"), -1, "integers"),
        (("schedule", "name"), ["plain"], "texts"),
        (("target",), {}, "texts"),
        (("weights", "count"), 1, "numbers of weights"),
        (("sine", "domain"), 1e9, "sine"),
        (("sine", "error"), 1e-12, "error of the sine"),
    ],
)
def test_a_manifest_of_another_program_is_refused(path, changed, place, value, match):
    """CER-5: a host calls the kernel as the manifest says."""
    manifest = json.loads((path.parent / "manifest.json").read_text())
    with pytest.raises(checker.Refused, match=match):
        checker.check(
            changed(manifest_json=put(manifest, place, value if callable(value) else lambda _: value))
        )


@pytest.mark.parametrize("key", ["schedule", "target", "images", "window", "output", "weights"])
def test_a_manifest_without_a_key_is_told(path, changed, key):
    manifest = json.loads((path.parent / "manifest.json").read_text())
    del manifest[key]
    with pytest.raises(InputError, match="certificate"):
        checker.check(changed(manifest_json=manifest))


@pytest.mark.parametrize("cut", [0, 1, 40, 400, -2])
def test_a_truncated_file_is_no_certificate(path, changed, cut):
    with pytest.raises(InputError, match="is not acceptable JSON"):
        checker.check(changed(denoise_certificate_json=path.read_bytes()[:cut]))


def test_any_key_left_out_is_told(path, changed):
    held = certificate_of(path)
    for name in held:
        with pytest.raises(
            (InputError, checker.Refused), match=r"must be|promises|acceptable JSON|earlier version"
        ):
            checker.check(changed(denoise_certificate_json={k: v for k, v in held.items() if k != name}))


def test_the_checker_shares_no_code_with_the_compiler_and_is_short():
    """At most 585 lines of code, its texts not counted."""
    own, total = {"evidence", "integer_checker", "sine_checker", "spectra_checker"}, 0
    for module in (checker, evidence, sine_checker, spectra_checker):
        source = inspect.getsource(module)
        tree = ast.parse(source)
        relative = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level}
        assert relative <= {"refimpl.reading", *own}
        statements = [node for node in ast.walk(tree) if isinstance(node, ast.Expr)]
        texts = [node for node in statements if isinstance(node.value, ast.Constant)]
        skipped = {n for text in texts for n in range(text.lineno, text.end_lineno + 1)}
        lines = [line for n, line in enumerate(source.splitlines(), 1) if n not in skipped]
        total += sum(bool(line.strip()) for line in lines)
    assert total <= 585


def test_kernels_without_a_proof_have_no_certificate():
    """GLSL promises nothing of its own sine."""
    for rank in (0, 2):
        kernel = compile_program(lower(model()), language_named("opengl").under("native"), rank=rank)
        assert kernel.certificate is None
        assert kernel.manifest["certificate"] is None
        assert not [name for name in kernel.contents() if name.endswith("json")]


@pytest.mark.parametrize("seed", range(5))
def test_norms_in_whole_numbers(seed):
    """The largest singular value, a little below it and a little above; and a matrix of rank 1."""
    random = np.random.default_rng(seed)
    matrix = np.float32(random.normal(size=(4, 6))).astype(np.float64)
    if seed == 4:
        matrix = np.outer(np.arange(1.0, 5.0), np.arange(1.0, 7.0))
    after, before = random.integers(1, 256, 4) / 64, random.integers(1, 256, 6) / 64
    norm = np.linalg.norm(after[:, None] * matrix / before, 2)
    assert checker.norm_is_below(norm * (1 + 1e-12), after, matrix, before)
    assert not checker.norm_is_below(norm * (1 - 1e-12), after, matrix, before)


def test_scalings_are_sound_and_gain(path):
    """Any positive scalings bound the true worst case over signs; those found beat plain norms."""
    random = np.random.default_rng(3)
    matrices = [random.normal(size=(5, 6)), random.normal(size=(5, 5)), random.normal(size=(1, 5))]
    own = [random.uniform(0, 1, 6), random.uniform(0, 0.1, 5), random.uniform(0, 0.1, 5), np.zeros(1)]
    found = scaled.amplified(matrices, own, scaled.scalings(matrices, own[0]))
    plain = scaled.amplified(matrices, own, [np.ones(6), np.ones(5), np.ones(5)])
    assert found <= plain
    worst = 0.0
    for _ in range(3000):
        e = own[0] * random.choice([-1, 1], 6)
        for matrix, error in zip(matrices, own[1:], strict=True):
            e = random.choice([-1, 1], len(error)) * (matrix @ e) + error * random.choice([-1, 1], len(error))
        worst = max(worst, abs(float(e[0])))
    assert worst <= found


def test_any_smaller_number_of_a_rectifier_s_certificate_is_refused(tmp_path):
    path = written(tmp_path, activation="relu")
    for held, place in smaller_numbers(path):
        path.write_text(json.dumps(held))
        with pytest.raises(checker.Refused, match=": "):
            pytest.fail(f"{place}: {checker.check(path)}")


def test_another_floor_of_a_rectifier_is_another_program(tmp_path):
    path = written(tmp_path, activation="relu")
    text = path.read_text()
    assert text.count("{value=0.0}") == 1
    path.write_text(text.replace("{value=0.0}", "{value=-8.0}"))
    with pytest.raises(checker.Refused, match="digest of the program"):
        checker.check(path)


@pytest.mark.parametrize("stated", [None, "."])
def test_weights_above_are_not_found_unless_the_manifest_says_so(path, tmp_path, stated):
    with pytest.raises(InputError, match=r"weights\.bin"):
        checker.check(shared(path, tmp_path, stated))


def test_other_weights_of_the_same_form_have_other_numbers(path, tmp_path):
    """The numbers of another model's proof, with that model's digests left in place."""
    other = written(tmp_path, omega_0=4.0)
    held = {
        **certificate_of(other),
        **{name: certificate_of(path)[name] for name in ("layers", "outputs", "bound")},
    }
    other.write_text(json.dumps(held))
    with pytest.raises(checker.Refused, match="layer 1"):
        checker.check(other)


@pytest.mark.parametrize("data", [b"", b"\xff\x00", b"[]", b"{}", b"null", b'{"schema": 1}', b"[" * 100000])
def test_garbage_is_no_certificate(changed, data):
    with pytest.raises(
        (InputError, checker.Refused), match=r"must be|promises|acceptable JSON|earlier version"
    ):
        checker.check(changed(denoise_certificate_json=data))
