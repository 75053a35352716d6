"""Whole exports: files, manifest and pair of every target; what runs them holds them to their bound."""

import hashlib
import json
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from kit import untrained

from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.scene_inputs import tables_of
from wamnet.compiler.variants import parse, vary
from wamnet.kernels.bench.workload import random_model
from wamnet.kernels.export import check, check_pair, targets, tools
from wamnet.kernels.export.motion import FORMULAS, KINDS, Motion, drawn
from wamnet.kernels.export.package import Request, export
from wamnet.kernels.run.denoise_on import images_of
from wamnet.refimpl.errors import CompileError, ExecutorUnavailable, InputError
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.network import domain

pytestmark = pytest.mark.apart  # drivers and runtimes of many targets stay in memory

ROOT = Path(__file__).resolve().parents[3]
"""The repository's root folder."""


def model(hidden=(8,), features=("color", "normal"), size=4):
    """An untrained network whose outputs are near the middle: clipped ones would hide errors."""
    found = untrained(hidden, features, size)
    biases = (*found.siren.biases[:-1], np.full(3, 0.5, np.float32))
    return replace(found, siren=replace(found.siren, biases=biases))


SCENE = canonical("lone_light")
"""A small scene: test_runners.py has a large one."""


@cache
def made(target):
    """Return an export, with a scene where the target has paths."""
    scene = None if target == "onnx" else SCENE
    return export(Request(model(), target, scene, settings=Settings(max_depth=1)))


@pytest.fixture(scope="module", params=targets.NAMES)
def exported(request):
    try:
        return made(request.param)
    except ExecutorUnavailable as error:
        pytest.skip(str(error))


def test_an_export_keeps_its_bound_where_it_is_run(exported):
    """EXP-4, EXP-6, EXP-10, EXP-11: the pair's picture within its bound; the paths' sums within 2 %."""
    verdict = check.check(exported)
    assert verdict.holds, verdict.wrong
    if "missing" in verdict.executed:
        pytest.skip(verdict.executed)
    assert verdict.share <= 1
    assert verdict.error > 0, "clipped outputs would hide errors"
    assert exported.target == "onnx" or verdict.paths >= check_pair.PATHS_ALIKE


@pytest.mark.nightly(but=("c", "wgsl"))
@pytest.mark.parametrize("target", [name for name, row in targets.TARGETS.items() if not row.single])
def test_a_path_kernel_traces_the_rays_that_the_model_has_learned_from(target):
    """EXP-15: 16 at random are 4 spread evenly; sums and images of the pair are those of such a frame."""
    many = replace(model(), info={"trained_on_feature_spp": "16"})
    scene, settings = canonical("cornell", time=0.5), Settings(max_depth=1)
    try:
        made = export(Request(many, target, scene, settings=settings))
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    schema = json.loads((ROOT / "spec/export.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(made.manifest)
    assert made.manifest["scene"]["feature_rays"] == {"count": 4, "sampler": "net"}
    assert "the path kernel traces 4, spread evenly (net)" in made.files["README.md"].decode()
    height, width, _ = made.pair.output.shape
    rays = {"feature_spp": 4, "feature_sampler": "net"}
    frame = render(scene, Job(width, height, 1, check_pair.SEED, settings, **rays)).frame
    for name, image in images_of(many, frame).items():
        # The frame's means are rounded once to float32, the pair's sums three times.
        assert np.abs(made.pair.images[name] - image).max() <= 8 * 2.0**-24, name
    verdict = check.check(made)
    assert verdict.holds, verdict.wrong
    if "missing" in verdict.executed:
        pytest.skip(verdict.executed)
    assert verdict.paths >= check_pair.PATHS_ALIKE


MOVING = Motion(
    (0.3, 0.9, 1.4), tuple(canonical("cornell", time=t) for t in (0.3, 0.9, 1.4)), ("time", "camera")
)
"""Two turning blocks, seen from anywhere."""


def moving(target):
    """Return an export of a scene that moves."""
    settings = Settings(max_depth=1)
    return export(Request(model(), target, MOVING.scenes[0], settings=settings, motion=MOVING))


PATHS = [name for name, row in targets.TARGETS.items() if not row.single]
"""Targets whose scenes can move."""


@pytest.mark.nightly(but=("c", "opencl"))
@pytest.mark.parametrize("target", PATHS)
def test_a_scene_that_moves_is_exported_for_all_moments(target):
    """EXP-13: table, formulas and bindings of the numbers; two moments are run, and are not the same."""
    try:
        made = moving(target)
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    schema = json.loads((ROOT / "spec/export.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(made.manifest)
    numbers, (path, *_) = made.manifest["scene"]["numbers"], made.manifest["kernels"]
    moments, count = numbers["rows"]["shape"]
    rows = np.frombuffer(made.files[numbers["rows"]["file"]], "<f4").reshape(moments, count)
    assert (moments, numbers["times"]) == (3, [0.3, 0.9, 1.4])
    assert rows[0].tolist() == [each["value"] for each in numbers["list"]]
    assert np.ptp(rows, axis=0).any()
    assert {each["formula"] for each in numbers["list"]} >= {
        FORMULAS["camera.up"],
        FORMULAS["camera.position"],
    }
    (bound,) = (each for each in path["bindings"] if each["name"] == "scene_numbers")
    assert (bound["access"], bound["shape"]) == ("read", [count])
    told = json.loads(made.files["check/check.json"])["sums"]
    (moment,) = told["moments"]
    assert moment["scene_numbers"] == rows[1].tolist()
    first, other = (
        np.frombuffer(made.files[f"check/{name}"], "<f4") for name in (told["file"], moment["file"])
    )
    assert first.size == other.size
    assert np.abs(first - other).max() > 0.1
    readme = made.files["README.md"].decode()
    assert "## What moves" in readme
    assert "`sums.0.f32` are those of another moment" in readme
    verdict = check.check(made)
    assert verdict.holds, verdict.wrong
    if "missing" in verdict.executed:
        pytest.skip(verdict.executed)
    assert verdict.paths >= check_pair.PATHS_ALIKE


def test_a_moment_that_is_not_given_is_found():
    """A kernel that reads the first number in place of the second draws neither moment."""
    whole = moving("c")
    source = whole.path.source.replace("scene_numbers[1]", "scene_numbers[0]")
    assert source != whole.path.source
    manifest = {**whole.path.manifest, "digest": "1" * 64}
    verdict = check.check(replace(whole, path=replace(whole.path, source=source, manifest=manifest)))
    assert "paths' sums agree" in verdict.wrong


def test_what_moves_is_refused_where_it_cannot():
    with pytest.raises(
        InputError, match=r"--moving 'doors': unknown \(choose one of time, camera, lights, pos"
    ):
        Motion((0.0,), (SCENE,), ("doors",))
    still = Motion((0.0, 1.0), (SCENE, SCENE))
    with pytest.raises(InputError, match="--moving 'time': changes nothing in scene lone_light"):
        export(Request(model(), "c", SCENE, motion=still))
    with pytest.raises(
        InputError, match=r"--moving 'time, camera': the passes of target godot have no place"
    ):
        moving("godot")


def test_the_domain_is_exported():
    """DOM-6: the manifest has what the model states, the README its threshold; without one neither."""
    rng = np.random.default_rng(1)
    found = domain.domain_of([rng.random((5, 4, 6)) for _ in range(9)], ("color", "normal"))
    stating = replace(model(), info={domain.DOMAIN: domain.to_json(found)})
    made = export(Request(stating, "glsl"))
    schema = json.loads((ROOT / "spec/export.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(made.manifest)
    assert domain.from_json(json.dumps(made.manifest["model"]["domain"])) == found
    assert f"a frame farther than {found.threshold:.3g}" in made.files["README.md"].decode()
    plain = export(Request(model(), "glsl"))
    assert "domain" not in plain.manifest["model"]
    assert "Domain" not in plain.files["README.md"].decode()


def test_the_manifest_is_of_the_schema_and_names_every_file(exported):
    """EXP-8: all that the clause lists."""
    schema = json.loads((ROOT / "spec/export.schema.json").read_text())
    contents = exported.contents()
    manifest = json.loads(contents["manifest.json"])
    jsonschema.Draft202012Validator(schema).validate(manifest)
    hashes = {n: hashlib.sha256(data).hexdigest() for n, data in contents.items() if n != "manifest.json"}
    assert manifest["files"] == hashes
    assert manifest["file_bytes"] == {name: len(contents[name]) for name in hashes}
    named = {name for kernel in manifest["kernels"] for name in kernel["files"]}
    assert named <= set(hashes)
    assert manifest["kernels"][-1]["role"] == "denoise"
    assert "are yours" in manifest["licence"]
    readme = contents["README.md"].decode()
    assert all(name in readme for name in named)
    assert "may hold 2^31 numbers or more" in readme
    assert "{" not in readme.partition("## Integration")[2].partition("```")[0]


def test_the_pair_s_files_are_as_they_say(exported):
    """EXP-9: shapes, and bounds that are not zero."""
    told = json.loads(exported.files["check/check.json"])
    pixels = told["width"] * told["height"]
    for name, image in told["images"].items():
        data = np.frombuffer(exported.files[f"check/{image['file']}"], "<f4")
        assert data.size == pixels * image["channels"], name
    output, bound = (np.frombuffer(exported.files[f"check/{n}.f32"], "<f4") for n in ("output", "bound"))
    assert output.size == bound.size == 3 * pixels
    assert (bound > 0).all()
    assert told["width"] > model().window.size, "the pair shows borders and what is between"


@pytest.mark.parametrize("target", ["c", "shadertoy", "onnx"])
def test_an_export_is_the_same_to_the_byte(target):
    assert made(target).contents() == made.__wrapped__(target).contents()


@pytest.mark.parametrize("target", ["wgsl", "c", "glsl-es"])
def test_a_fault_in_the_weights_is_found(target):
    """One weight of 800 is off by a tenth."""
    whole = made(target)
    weights = whole.denoiser.weights.copy()
    weights[3] += 0.1
    wrong = replace(whole.denoiser, weights=weights, manifest={**whole.denoiser.manifest, "digest": "0" * 64})
    verdict = check.check(replace(whole, denoiser=wrong))
    if "missing" in verdict.executed:
        pytest.skip(verdict.executed)
    assert not verdict.holds
    assert "times the bound" in verdict.wrong


def test_what_a_tool_refuses_is_a_verdict():
    whole = made("c")
    files = {**whole.files, "denoise/denoise.h": b"int wamnet(int x) { return x + 1.5; }\n"}
    verdict = check.check(replace(whole, files=files))
    assert verdict.wrong.startswith("cc rejects the kernel")


# ---- places of weights, variants, limits -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("target", "place"),
    [(row.name, place) for row in targets.TARGETS.values() for place in [*row.places][1:]],
)
def test_other_places_of_weights_keep_the_bound(target, place):
    """EXP-7: each place that a target has is compiled, run where possible, and checked against the bound."""
    try:
        whole = export(Request(model(), target, weights=place))
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    assert whole.manifest["weights"]["where"] == place
    verdict = check.check(whole)
    assert verdict.holds, verdict.wrong
    if "missing" in verdict.executed:
        assert (target, place) in {("opencl", "inline"), ("glsl", "uniform"), ("glsl-es", "uniform")} or (
            "not installed" in verdict.executed
        )


@pytest.mark.product
@pytest.mark.parametrize(
    ("target", "schedule"),
    [
        (row.name, schedule)
        for row in targets.TARGETS.values()
        for schedule in next(iter(row.places.values())).schedules[1:]
    ],
)
def test_other_schedules_keep_the_bound(target, schedule):
    """EXP-12: each schedule that a target has is compiled, run, and checked against the bound.

    Spectra pay for large windows only, and bytes hold integers only.
    """
    shown = model(size=12) if schedule.startswith("fft") else model()
    if schedule in targets.BYTES:
        shown = vary(parse("whole8"), shown).model
    try:
        whole = export(Request(shown, target, schedule=schedule))
    except ExecutorUnavailable as error:
        pytest.skip(str(error))
    kernel = whole.manifest["kernels"][-1]
    assert kernel["schedule"]["name"] == schedule
    readme = whole.files["README.md"].decode()
    assert f"* Schedule: {schedule}: " in readme
    code = readme.partition("## Integration")[2].partition("## Check")[0]
    if "group" in kernel["schedule"]:
        width, height = kernel["schedule"]["group"]
        columns = kernel["schedule"]["pixels"]
        numbers = (columns, width, height) if target == "opencl" else (columns * width, height)
        assert all(str(number) in code for number in numbers)
    verdict = check.check(whole)
    assert verdict.holds, verdict.wrong


def test_the_usual_schedule_gives_way_and_says_why():
    """A first layer in two passes has more channels between them than a tile holds."""
    whole = export(Request(model(), "cuda", variant="rank6"))
    picked = whole.manifest["kernels"][-1]["schedule"]
    assert (picked["name"], picked["asked"]) == ("plain", "group:4")
    assert "a tile holds 4 channels at once" in picked["reason"]
    assert picked["reason"] in whole.files["README.md"].decode()


@pytest.mark.parametrize("target", ["wgsl", "cuda", "metal", "glsl-es"])
def test_a_variant_of_low_rank_is_two_kernels(target):
    whole = export(Request(model(), target, variant="rank2"))
    assert [k["role"] for k in whole.manifest["kernels"]] == ["horizontal", "denoise"]
    verdict = check.check(whole)
    assert verdict.holds, verdict.wrong


@pytest.mark.parametrize(
    ("request_", "told"),
    [
        (Request(model(), "abacus"), r"--target 'abacus': unknown \(choose one of opencl, .*, html"),
        (Request(model(), "webgpu"), r"--target 'webgpu': unknown \(a host's name: use --host webgpu"),
        (
            Request(model(), "wgsl", weights="texture"),
            "--weights 'texture': is not available for target wgsl",
        ),
        (Request(model(), "onnx", SCENE), "--scene 'lone_light': a graph denoises"),
        (Request(model(), "onnx", weights="buffer"), "--weights 'buffer': the graph contains them"),
        (Request(model(), "onnx", schedule="plain"), "--schedule 'plain': the runtime schedules it"),
        (
            Request(model(), "wgsl", schedule="tile:16"),
            "--schedule 'tile:16': is not available for target wgsl",
        ),
        (
            Request(model(), "cuda", weights="inline", schedule="group:1"),
            "--schedule 'group:1': is not available for target cuda with --weights inline",
        ),
        (
            Request(model(), "cuda", variant="rank6", schedule="group:4"),
            "--schedule 'group:4': cannot hold this model: a tile holds 4 channels at once",
        ),
        (
            Request(model((48,)), "glsl-es", weights="uniform"),
            r"GL_MAX_UNIFORM_BLOCK_SIZE 19212: glsl-es takes at most 16384 \(use another place",
        ),
        (
            Request(model((700,)), "glsl-es", weights="inline"),
            "weights that a driver compiles in reasonable time 70003: glsl-es takes at most 65536",
        ),
        (Request(model(), "shadertoy", variant="rank2"), "--variant 'rank2': target shadertoy has one pass"),
        (
            Request(model((4,), ("color", "normal", "albedo", "position", "direction")), "shadertoy"),
            "buffers of a Shadertoy, A to D 5: shadertoy takes at most 4",
        ),
    ],
    ids=lambda value: value.target + value.weights if isinstance(value, Request) else "",
)
def test_refusals_name_the_limit(request_, told):
    with pytest.raises(InputError, match=told):
        export(request_)


def test_ways_out_are_those_of_an_export():
    """It has no --executor; a target of one pass takes no rank; a limit's name is a thing, no sentence."""
    for row in targets.ROWS:
        places = [place.limit for place in row.places.values()]
        for limit in filter(None, (*places, row.most_images, row.source)):
            assert "executor" not in limit.way_out
            assert not (row.single and limit is row.source and "rank" in limit.way_out)
            assert ":" not in limit.name
    with pytest.raises(CompileError, match="use a smaller rank, or OpenCL or C, which have no such limit"):
        export(Request(model((48,)), "glsl-es", variant="rank20"))


def test_a_tool_that_is_missing_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(ExecutorUnavailable, match="cc is not installed: apt-get install gcc"):
        tools.run("cc", "--version", folder=tmp_path)
    verdict = check.check(made("c"))
    assert "missing: cc is not installed" in verdict.compiled


def test_a_kernel_that_a_tool_refuses(tmp_path):
    if not shutil.which("glslangValidator"):
        pytest.skip("glslangValidator is not installed")
    with pytest.raises(CompileError, match=r"glslangValidator rejects the kernel: .*error"):
        tools.spirv("#version 450\nvoid main() { flaot x; }")


def test_halves_are_beside_the_weights_where_they_are_the_same_numbers():
    """EXP-17: widened, 16 bits hold what the kernel reads; an export of the full network has no such file."""
    whole, full = (export(Request(random_model(), "c", variant=name)) for name in ("half16", "full"))
    halves = np.frombuffer(whole.files["denoise/weights16.bin"], "<f2")
    assert (halves.astype("<f4") == np.frombuffer(whole.files["denoise/weights.bin"], "<f4")).all()
    assert whole.manifest["weights"]["half"] == "denoise/weights16.bin"
    assert "denoise/weights16.bin" in whole.contents()["README.md"].decode()
    assert "half" not in full.manifest["weights"]
    assert "denoise/weights16.bin" not in full.files
    schema = json.loads((ROOT / "spec/export.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(whole.manifest)


@pytest.mark.parametrize("kind", KINDS[1:])
def test_what_is_drawn_shows_which_numbers_move(kind):
    """EXP-13: the formulas give the numbers of a scene that was not among those drawn, rounded once."""
    scene, settings = canonical("minicubes", time=0.3), Settings()
    motion = Motion((0.3,), (scene,), (kind,))
    inputs, new = motion.inputs(settings), drawn(scene, (kind,), 99)
    tables = {path for places in inputs.places for path, _ in places}
    begins = {"camera": ("camera.",), "lights": ("world.lights.", "world.geometry.emission")}
    wanted = begins.get(kind, ("world.geometry.groups.", "world.lights.corner"))
    assert all(path.startswith(wanted) for path in tables)
    programs = lower_scene(scene, settings, moving=inputs)
    assert all(each["formula"] for each in motion.facts(programs)["list"])
    assert inputs.fits(tables_of(scene, settings), tables_of(new, settings))
    assert not np.array_equal(motion.other(settings), inputs.values(scene))


def test_the_rays_of_features_are_stated_without_a_scene():
    """A host that brings its own features has to know how many rays they are averaged over."""
    made = export(Request(replace(model(), info={"trained_on_feature_spp": "16"}), "glsl"))
    told = "The model was trained on features averaged over 16 camera rays per pixel: give it such images"
    assert told in made.files["README.md"].decode()
    assert "camera rays" not in export(Request(model(), "glsl")).files["README.md"].decode()
