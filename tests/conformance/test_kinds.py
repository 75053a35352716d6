"""Kinds: the reference answers its own vectors, wrong references are caught, executors pass."""

import io
import json
import re
from collections import Counter
from dataclasses import asdict

import numpy as np
import pytest

from wamnet.refimpl import encoding, metrics, rng
from wamnet.refimpl.light import camera, environment, intersection, sampling, transport
from wamnet.refimpl.light.materials import conductor, dielectric
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import adam, dataset, siren, smoothing, window
from wamnet.spec.conformance import case, numbers, program, report, run, vectors
from wamnet.spec.conformance.functions import Field, Function
from wamnet.spec.conformance.kinds import FUNCTIONS, KINDS, paths
from wamnet.spec.conformance.numbers import to_json
from wamnet.spec.conformance.on_executor import OnExecutor


def judged(kind: str, answer) -> list[run.Verdict]:
    """Hold the answers of a function (kind, inputs, profile) to the vectors of a kind, without a process."""
    _, cases = case.load(vectors.FOLDER / f"{kind}.json")
    requests = [
        json.dumps({"id": c.id, "kind": kind, "profile": "ieee", "input": dict(c.inputs)}) for c in cases
    ]
    answers = io.StringIO()
    program.serve(requests, answers, "here", [kind], answer)
    return [
        run.judge(kind, c, json.loads(line))
        for c, line in zip(cases, answers.getvalue().splitlines(), strict=True)
    ]


@pytest.mark.parametrize("kind", KINDS)
def test_the_reference_answers_its_own_vectors(kind):
    wrong = [v for v in judged(kind, program.of_reference) if v.verdict != "pass"]
    assert not wrong


def answered(kind: str, **changes) -> dict:
    """Return the reference's answer to the first vector of a kind with some inputs changed."""
    _, cases = case.load(vectors.FOLDER / f"{kind}.json")
    request = {"id": "0", "kind": kind, "profile": "ieee", "input": {**cases[0].inputs, **changes}}
    answers = io.StringIO()
    program.serve([json.dumps(request)], answers, "here", [kind], program.of_reference)
    return json.loads(answers.getvalue())


@pytest.mark.parametrize(("x", "y"), [(-1, 0), (4, 0), (0, -1), (0, 4), (2**40, 0)])
def test_the_window_of_a_pixel_outside_is_refused(x, y):
    """NumPy took an index of -1 for the last pixel, and raised an error of its own beyond the end."""
    assert "output" in answered("image.window", x=3, y=3)
    refused = answered("image.window", x=x, y=y)["refused"]
    assert re.match(r"[xy] -?\d+: the image has the pixels 0 to 3 on this axis \(ask for", refused)


@pytest.mark.parametrize("image", [[], [[]], [[0, 1]], [[[0.5]]], [[[True]]], 1, "a", [[[0]], [[0], [1]]]])
def test_the_window_of_no_image_is_refused(image):
    assert "must be integers [H][W][C]" in answered("image.window", image=image, x=0, y=0)["refused"]


@pytest.mark.parametrize("value", [True, False, 1.0, 1.5, "1", "0x1p+0", None, [1]])
@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("random.block", "seed"),
        ("image.window", "x"),
        ("image.window", "size"),
        ("path.start", "width"),
        ("path.scatter", "depth"),
        ("picture.exact", "spp"),
        ("whole.sine", "amplitude"),
    ],
)
def test_integers_of_a_request_are_integers_of_json(kind, name, value):
    """A seed that was true counted as 1."""
    refused = answered(kind, **{name: value})["refused"]
    assert refused.startswith(f"{name} {value!r}: must be an integer of JSON (write it")


def test_the_radiance_of_a_whole_path_has_no_light_sample_of_its_last_vertex():
    """Where roulette ends a path, as where the depth does: after the vertex's emission, as the page says."""
    ended = 0
    for sample in range(8):
        scene = (vectors.FOLDER / "scenes/cornell.json").read_text()
        numbers = {"width": 16, "height": 16, "x": 8, "y": 8, "seed": 20, "sample": sample}
        inputs = {"scene": scene, "settings": asdict(Settings(roulette_depth=0)), **numbers}
        found = paths.whole(inputs)
        count = len(found["t"])
        inputs["settings"]["max_depth"] = count - 1
        assert np.array_equal(found["radiance"], paths.whole(inputs)["radiance"])
        ended += count <= Settings().max_depth
    assert ended


# ---- mutants ----------------------------------------------------------------------------------------------


def biased(function):
    """Return a sampler whose points are drawn from three quarters of the light."""
    return lambda u0, *rest: function(u0 * 0.75, *rest)


MUTANTS = {
    "counters in another order": (rng, "random_block", lambda s, p, n, b: rng.pcg4d(p, b, n, s),
        "random.block", "RNG-3"),
    "floats of 23 bits": (rng, "MANTISSA_BITS", 23, "random.float", "RNG-5"),
    "gamma of 2.2": (encoding, "GAMMA", 2.2, "encoding.display", "ENC-5"),
    "epsilon of 1e-7": (adam, "EPSILON", 1e-7, "adam.step", "ADM-1"),
    "beta_2 of 0.99": (adam, "BETA_2", 0.99, "adam.run", "ADM-1"),
    "rows from below": (camera, "camera_ray",
        lambda b, x, y, u, v, w, h, true=camera.camera_ray: true(b, x, h - 1 - y, u, v, w, h), "camera.ray",
        "CAM-2"),
    "biased light sampling": (sampling, "sample_quad", biased(sampling.sample_quad), "path.scatter", "LTR-4"),
    "no offset from surfaces": (intersection, "SPAWN_OFFSET", 0.0, "path.scatter", "ISC-9"),
    "weights the other way round": (transport, "mis_weight",
        lambda s, p, q, true=transport.mis_weight: true(s, q, p), "path.arrive", "LTR-2"),
    "the other heuristic": (transport, "HEURISTICS", {"balance": 2, "power": 1}, "transport.mis_weight",
        "LTR-5"),
    "roulette at 0.9": (transport, "ROULETTE_LIMIT", 0.5, "path.scatter", "LTR-9"),
    "a sky upside down": (environment, "radiance", lambda s, d, true=environment.radiance: true(s, -d),
        "sky.radiance", "ENV-1"),
    "F without its fifth power": (conductor, "schlick", lambda r, c: r, "material.conductor", "CDR-3"),
    "half of Fresnel": (dielectric, "fresnel", lambda c, f, r: 0.0 * c, "material.dielectric", "DIE-4"),
    "NaN of a frame kept": (dataset, "known", lambda values: values, "image.features", "DAT-10"),
    "borders the other way": (window, "BORDERS", {"clamp": "reflect", "zero": "constant"}, "image.window",
        "DAT-5"),
    "a flat spline": (smoothing, "SPLINE", (0.2,) * 5, "image.smoothed", "SMO-3"),
    "positions by another share of depth": (smoothing, "GUIDES",
        {"normal": 0.5, "albedo": 0.2, "position": 0.0801}, "image.smoothed", "SMO-3"),
    "depths down to 1e-7": (smoothing, "LEAST_DEPTH", 1e-7, "image.smoothed", "SMO-3"),
    "guides up to 1.001e9": (smoothing, "FARTHEST", 1.001e9, "image.smoothed", "SMO-3"),
    "gaps of 1 at all levels": (smoothing, "smooth_once",
        lambda c, g, f, gap, true=smoothing.smooth_once: true(c, g, f, 1), "image.smoothed", "SMO-3"),
    "positions by the other pixel's depth": (smoothing, "weight",
        lambda here, there, factors, true=smoothing.weight: true(here, there, factors[:, ::-1]),
        "image.smoothed", "SMO-3"),
    "two levels": (dataset, "LEVELS", 2, "image.features", "SMO-1"),
    "light clipped to 15 times white": (smoothing, "WHITES", 15.0, "image.features", "SMO-2"),
    "the centre one pixel off": (window.Window, "before", property(lambda w: (w.size - 1) // 2),
        "image.window", "DAT-4"),
    "omega_0 outside the bracket": (siren, "_omega_0", lambda s, layer: 1.0, "network.forward", "SIR-2"),
    "biases without their own tag": (siren, "BIAS_TAG", siren.WEIGHT_TAG, "network.init", "SIR-5"),
    "PSNR by the natural logarithm": (metrics, "math",
        type("math", (), {"log10": staticmethod(np.log), "inf": np.inf}), "metric.psnr", "MET-4"),
    "SSIM's K2 of 0.3": (metrics, "K2", 0.3, "metric.ssim", "MET-5"),
    "relMSE's epsilon of 0.001": (metrics, "RELMSE_EPSILON", 1e-3, "metric.relmse", "MET-6"),
}  # fmt: skip
"""Wrong references: module, name, what replaces it, the kind that notices, the clause blamed."""


@pytest.mark.parametrize("name", MUTANTS)
def test_mutants_of_the_reference_are_caught_and_blamed(monkeypatch, name):
    owner, attribute, value, kind, clause = MUTANTS[name]
    monkeypatch.setattr(owner, attribute, value)
    if attribute == "before":
        monkeypatch.setattr(owner, "after", property(lambda w: w.size - (w.size - 1) // 2 - 1))
    if attribute == "EPSILON":
        monkeypatch.setattr(adam.update, "__defaults__", (*adam.update.__defaults__[:-1], value))
    if attribute == "BETA_2":
        monkeypatch.setattr(adam.step, "__defaults__", (adam.BETA_1, value, adam.EPSILON))
    failed = {v.clause for v in judged(kind, program.of_reference) if v.failed}
    assert clause in failed


@pytest.mark.parametrize(
    ("kind", "note", "clause"),
    [
        ("file.camera", "as JSON is written", "RDG-3"),
        ("file.camera", "a key in escapes", "RDG-2"),
        ("file.scene", "camera only", "SCN-6"),
        # The first scene with a list of records.
        ("file.scene", "a sphere: its .radius", "RDG-3"),
        ("file.scene", "a box: its .rotation", "BOX-1"),
        ("file.scene", "what may be left out is", "SCN-6"),
        ("image.smoothed", "a row, level 1: the spline and its gap", "FRM-5"),
        ("file.scene", "background left out", "SCN-6"),
        ("picture.exact", "terrace", "RND-6"),
    ],
)
def test_a_valid_input_that_is_refused_is_blamed_on_the_rule(kind, note, clause):
    _, cases = case.load(vectors.FOLDER / f"{kind}.json")
    found = next(c for c in cases if c.note == note)
    verdict = run.judge(kind, found, {"refused": "no"})
    assert (verdict.verdict, verdict.clause) == ("fail", clause)
    assert clause in found.clauses


MADE_OF = (
    ("random.pcg4d", "random.block"),
    ("random.scrambled", "random.sobol"),
    ("random.point", "random.sobol"),
    ("sampling.to_world", "sampling.cosine_hemisphere"),
    ("camera.axes", "camera.ray"),
    ("intersection.slabs", "intersection.box"),
    ("material.ggx", "material.conductor"),
    ("material.fresnel", "material.dielectric"),
    ("transport.light_pdf", "path.arrive"),
    ("encoding.srgb", "encoding.display"),
    ("encoding.shown", "image.features"),
    ("image.smoothed", "image.features"),
    ("intersection.occluded", "path.scatter"),
    ("intersection.nearest", "intersection.occluded"),
)
"""Kinds of functions that clauses share, and kinds that are made of them."""


@pytest.mark.parametrize(("part", "whole"), MADE_OF)
def test_what_a_kind_is_made_of_is_looked_at_first(part, whole):
    verdicts = [run.Verdict(f"{kind}/0", kind, "CNF-1", "fail") for kind in (whole, part)]
    assert report.first_blamed(verdicts).kind == part


@pytest.mark.parametrize("index", range(4))
def test_a_large_variance_excuses_nothing(index):
    kind, cases = case.load(vectors.FOLDER / "picture.rendered.json")
    true = program.of_reference(kind, cases[index].inputs, "ieee")
    answer = {**true, "mean": np.asarray(true["mean"]) / 2, "variance": np.asarray(true["variance"]) * 1e6}
    assert run.judge(kind, cases[index], {"output": to_json(answer)}).verdict == "fail"


def test_blocks_are_means_of_their_pixels():
    image = np.arange(16.0).reshape(4, 4, 1)
    mean, variance = numbers.mean_and_variance(image, np.ones((4, 4, 1)), 2)
    assert mean[..., 0].tolist() == [[2.5, 4.5], [10.5, 12.5]]
    assert np.all(variance == 0.25)


# ---- undecided --------------------------------------------------------------------------------------------


def test_a_decision_on_its_threshold_is_accepted_either_way():
    """x is just below sqrt(3): float32 rounds x^2 to 3, float64 to less."""
    step = Function(
        "k",
        "t",
        {"x": Field("number")},
        {"y": Field("1 or 2")},
        lambda given, dtype: {"y": np.where(given["x"] * given["x"] < 3.0, 1.0 + 0.0 * given["x"], 2.0)},
    )
    near, far = (step.kind().made({"clause": "RNG-3", "input": {"x": x}}) for x in (3.0**0.5, 1.0))
    assert near.flags == ("undecided",)
    values = {
        float(near.expected["y"].value),
        *(float(other["value"]) for other in near.expected["y"].accepted),
    }
    assert values == {1.0, 2.0}
    assert (far.flags, far.expected["y"].accepted, float(far.expected["y"].bound)) == ((), (), 0.0)


# ---- executors --------------------------------------------------------------------------------------------


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["numpy"])
@pytest.mark.needs("time")
def test_an_executor_passes_all_that_it_supports(executor_named, name):
    answers = OnExecutor(executor_named(name))
    assert set(answers.kinds) >= set(FUNCTIONS)
    for kind in answers.kinds:
        count = Counter(v.verdict for v in judged(kind, answers.answer))
        assert set(count) == {"pass"}, kind


SOME = (
    "random.block",
    "sine",
    "sampling.concentric_disk",
    "intersection.box",
    "material.dielectric",
    "picture.denoised",
)
"""Kinds that every executor is tested with here; the command tests all."""


def test_an_executor_keeps_its_profile(executor_named):
    """Others use it, and may have made plans for it."""
    executor = executor_named("numpy")
    found = [OnExecutor(executor).answer("sine", {"x": "0x1p+0"}, name) for name in ("ieee", "ieee-sine5")]
    assert found[0] != found[1]
    assert executor.profile == "ieee"


@pytest.mark.nightly(but=("numpy", "opengl-osmesa"))
def test_executors_pass(executor):
    answers = OnExecutor(executor)
    for kind in (k for k in SOME if k in answers.kinds):
        wrong = [v for v in judged(kind, answers.answer) if v.verdict != "pass"]
        assert not wrong
