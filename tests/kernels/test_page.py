"""The data of a web page: what it holds, and what is refused."""

import base64
from dataclasses import asdict, replace

import numpy as np
import pytest

from wamnet.compiler.plan import Expected
from wamnet.kernels.run import page as P
from wamnet.refimpl.errors import CompileError, InputError
from wamnet.refimpl.frame import HISTORY
from wamnet.refimpl.light import scenes
from wamnet.refimpl.light.scene import Sphere
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import Ranges
from wamnet.refimpl.network import dataset

SETTINGS = Settings(max_depth=1)
OF_ONE_PICTURE = tuple(
    name
    for name, feature in dataset.FEATURES.items()
    if name not in (*HISTORY, "sun", "direct") and not feature.guides
)
SCALES = dataset.Normalization(0.0, 12.0, (0.0, 0.0, 0.0), 6.0)


def animation(name, *times):
    return P.Animation(times, tuple(scenes.canonical(name, time=time) for time in times))


@pytest.fixture(scope="module")
def model_of(kit):
    """Give a function that returns a small model of some features."""
    return lambda *features: kit.model((6,), features, scales=SCALES)


def floats(text, kind="<f4"):
    return np.frombuffer(base64.b64decode(text), kind)


def test_rows_are_the_moments_and_numbers_keep_their_places():
    moments = animation("minicubes", 0.1, 0.9, 2.3)
    inputs, numbers = P.moving_numbers(moments, SETTINGS)
    rows = floats(numbers["rows"]).reshape(3, -1)
    for scene, row in zip(moments.scenes, rows, strict=True):
        assert np.array_equal(inputs.values(scene)[numbers["moving"]], row)
        still = np.delete(inputs.values(scene), numbers["moving"])
        assert np.array_equal(still, np.delete(np.float32(numbers["still"]), numbers["moving"]))
    paths = [path for path, _ in numbers["names"]]
    assert {paths[place] for place in numbers["moving"]} == {"world.geometry.groups.0.rotation"}
    assert "world.geometry.emission" not in paths, "a page computes the lights' tables"
    assert sum(path.startswith("camera.") for path in paths) >= 9


def test_a_still_scene_has_one_row_without_numbers():
    _, numbers = P.moving_numbers(animation("cornell", 0.0), SETTINGS)
    assert numbers["moving"] == []
    assert floats(numbers["rows"]).size == 0


def test_features_are_encoded_in_passes_of_four(model_of):
    """These have 15 channels: as many as four buffers hold, in one kernel of paths."""
    features = ("color", "normal", "albedo", "position", "unshadowed")
    data = P.page_data(animation("cornell", 0.0), P.networks_of(model_of(*features), rank=2), SETTINGS)
    names = [[image["name"] for image in encoder["images"]] for encoder in data["encoders"]]
    assert names == 2 * [[*features[:4]], ["unshadowed"]]
    assert [encoder["levels"] for encoder in data["encoders"]] == [1, 1, 127, 127]
    (path,) = data["paths"]
    assert len(path["planes"]) == 15
    vectors = -(-len(data["numbers"]["names"]) // 4)
    assert f"uniform vec4 scene_numbers[{vectors}];" in path["source"]
    assert data["lights"] == [{"color": [1.0, 0.78, 0.5], "power": 14.0, "area": 0.25}]


def test_all_features_take_a_second_kernel_that_ends_at_the_first_hit(model_of):
    model = model_of(*dataset.FIRST_HITS)
    data = P.page_data(animation("cornell", 0.0), P.networks_of(model, rank=2), SETTINGS)
    whole, first_hit = data["paths"]
    assert len(whole["planes"]) + len(first_hit["planes"]) == 19
    assert [path["settings"]["max_depth"] for path in data["paths"]] == [SETTINGS.max_depth, 0]
    assert "color_r" in whole["planes"]
    encoded = [[image["name"] for image in encoder["images"]] for encoder in data["encoders"]]
    for encoder, names in zip(data["encoders"], encoded, strict=True):
        assert set(P.planes_of(names)) <= set(data["paths"][encoder["path"]]["planes"])
    assert sorted(name for names in encoded for name in names) == sorted(2 * [*dataset.FIRST_HITS])


def test_a_second_kernel_follows_what_is_seen(model_of):
    """RND-2e: paths past four mirrors at most, without light samples; colour's path has those that fit."""
    data = P.page_data(animation("glossy", 0.0), P.networks_of(model_of(*OF_ONE_PICTURE), rank=2), SETTINGS)
    whole, *others = data["paths"]
    assert "seen_depth" in {plane for seen in others for plane in seen["planes"]}
    for seen in others:
        assert seen["settings"] == {**whole["settings"], "strategy": "bsdf"}
        assert "way_going" in seen["source"]
    assert "way_going" not in whole["source"]
    one = P.page_data(
        animation("glossy", 0.0), P.networks_of(model_of("color", "seen_normal"), rank=2), SETTINGS
    )
    assert len(one["paths"]) == 1


@pytest.mark.parametrize("start", range(len(OF_ONE_PICTURE)))
def test_parts_fit_into_the_buffers_and_colour_is_in_the_first(start):
    """Whatever order a model names its features in, each is in one part."""
    names = [*OF_ONE_PICTURE]
    features = [*names[start:], *names[:start]]
    parts = P.drawn_together(features)
    assert sorted(name for part in parts for name in part) == sorted(features)
    assert all(0 < len(P.planes_of(part)) <= 4 * P.MOST_BUFFERS for part in parts)
    assert "color" in parts[0]


def test_what_a_page_shows_is_encoded_though_no_network_reads_it(model_of):
    data = P.page_data(animation("empty", 0.0), P.networks_of(model_of("depth")), SETTINGS)
    assert [image["name"] for image in data["encoders"][0]["images"]] == ["color", "depth", "normal"]
    assert data["variants"][0]["passes"][0]["reads"] == ["depth"]
    assert set(data["check"]["images"]) == {"depth", "color", "normal"}


def test_variants_say_what_they_cost_and_how_far_they_are(model_of):
    networks = P.networks_of(model_of("color"), rank=1)
    images = {"color": np.random.default_rng(0).uniform(0, 1, (8, 8, 3)).astype(np.float32)}
    made = [P.variant(network, images) for network in networks[:3]]
    (full, fast, texture), held = zip(*made, strict=True)
    assert full["products"] == 27 * 6 + 6 * 3
    assert fast["products"] == texture["products"] == 9 + 3 * 6 + 6 * 3
    assert (fast["weights"], texture["schedule"], fast["schedule"]) == (0, "packed", "inlined")
    assert np.array_equal(held[1].value, held[2].value)
    assert np.ptp(held[0].value - held[1].value) > 0, "a cut to rank 1 leaves something out"
    for one, expected in made:
        assert np.array_equal(floats(one["check"]["expected"]), expected.value.ravel().astype("<f4"))
        assert 0 < floats(one["check"]["bound"]).max() <= one["bound"]


def test_ranges_are_those_of_the_scene_that_was_learned(model_of):
    """A model that says none, or has learned another scene, has none here."""
    ranges = Ranges(yaw_deg=(-24.0, 24.0), saturation=(0.0, 0.5))
    said = {"trained_on_ranges": ranges.to_json()}
    model = model_of("color")
    for info, found in (
        ({}, None),
        (said, asdict(ranges)),
        ({**said, "trained_on_scene": "empty, cornell"}, asdict(ranges)),
        ({**said, "trained_on_scene": "minicubes"}, None),
    ):
        assert P.learned_ranges(replace(model, info=info), "cornell") == found
    with pytest.raises(InputError, match=r"ranges .*: must be a JSON object"):
        P.learned_ranges(replace(model, info={"trained_on_ranges": "[]"}), "cornell")
    networks = P.networks_of(model, replace(model, info=said), rank=1)
    data = P.page_data(animation("cornell", 0.0), networks, SETTINGS)
    assert [one["ranges"] for one in data["variants"]] == [None, asdict(ranges), asdict(ranges), None]
    assert data["turn_s"] == scenes.TURN_SECONDS


def test_the_bound_is_rounded_up():
    exact = np.array([1e-7, 0.1, 1 / 3, 0.0])
    found = Expected(np.zeros(4), exact).most_from(np.zeros(4)).astype(np.float64)
    assert np.all(found >= exact)
    assert found[-1] == 0.0


def test_models_that_need_two_encodings_are_refused(model_of):
    model = model_of("color")
    other = replace(model, normalization=replace(SCALES, depth_scale=2.0))
    with pytest.raises(InputError, match="one page encodes once"):
        P.page_data(animation("empty", 0.0), P.networks_of(model, other), SETTINGS)


def test_too_many_moving_numbers_are_refused():
    base = scenes.canonical("cornell")
    balls = [
        tuple(Sphere((0.1 * i + move, 0.2 * i, 0.3 * i - move), 0.05, (0.5,) * 3) for i in range(450))
        for move in (0.0, 0.01)
    ]
    moments = P.Animation((0.0, 1.0), tuple(replace(base, spheres=spheres) for spheres in balls))
    with pytest.raises(InputError, match=r"of its numbers move; a shader has uniforms for 800"):
        P.moving_numbers(moments, SETTINGS)


def test_a_scene_that_changes_its_form_is_refused():
    with pytest.raises(CompileError, match="its layout differs"):
        P.moving_numbers(animation("glossy", 0.0, 0.1), SETTINGS)


def test_shadow_rays_are_those_of_the_model_s_training(model_of):
    """PTK-22: by the kernel of paths, as many as the facts of the training say, or one."""
    model = replace(model_of("color", "direct"), info={"trained_on_shadow_rays": "2, 3"})
    data = P.page_data(animation("cornell", 0.0), P.networks_of(model, rank=2), SETTINGS)
    (path,) = data["paths"]
    assert "direct_b" in path["planes"]
    assert "by 3 shadow rays of each camera ray" in path["source"]
    assert np.any(floats(data["check"]["images"]["direct"]["values"]) > 0.0)
