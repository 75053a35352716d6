"""Pictures before a frame: the layers are those of the definition, whoever renders, and a request says so."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.kernels.run import before
from wamnet.models.data import frame_plan
from wamnet.models.data.frame_plan import Request
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.frame import HISTORY
from wamnet.refimpl.light import history, scenes
from wamnet.refimpl.light.render import Job, render

REQUEST = Request("minicubes", frames=1, test_frames=0, size_px=12, spp=2, before=3)


def pictures():
    """Return the noisy picture and the target of the request's frame."""
    (frame,) = frame_plan.plan(REQUEST)
    return frame.pictures["noisy"], frame.pictures["target"]


def by_definition(picture, count):
    """Return the history of a picture, step by step."""
    past = None
    for k in range(count, -1, -1):
        scene, job = picture.scene_at(-k / before.PER_S), replace(picture.job, first_sample=k)
        color = render(scene, job).frame["color"]
        past = history.begin(scene, job, color) if past is None else history.follow(past, scene, job, color)
    return past


def test_a_noisy_picture_has_the_history_of_those_before_it():
    noisy, target = pictures()
    (task,) = noisy.tasks()
    frame, wanted = before.carry_out(task), by_definition(noisy, 3)
    for name, values in history.layers_of(wanted).items():
        assert np.array_equal(frame[name], values)
    assert np.array_equal(frame["color"], render(noisy.scene, noisy.job).frame["color"])
    assert float(frame["history_weight"].max()) > 0.5  # of four samples: 1 - 1/4 where all of them are known
    assert task.samples == 4 * 12 * 12
    (other,) = target.tasks()
    assert not any(name in before.carry_out(other) for name in HISTORY)


def test_pictures_before_have_samples_of_their_own():
    """A history of equal samples would be the noise itself."""
    job = Job(8, 8, 1, 5, feature_spp=4, seen=True)
    earlier = list(before.jobs_before(job, 3))
    assert [each.first_sample for each in earlier] == [3, 2, 1]
    assert all((each.feature_spp, each.seen, each.seed) == (0, False, 5) for each in earlier)


def test_large_noisy_pictures_are_one_task_with_pictures_before():
    request = replace(REQUEST, size_px=4096)
    (frame,) = frame_plan.plan(request)
    (plain,) = frame_plan.plan(replace(request, before=0))
    assert len(frame.pictures["noisy"].tasks()) == 1 < len(plain.pictures["noisy"].tasks())
    assert len(frame.pictures["target"].tasks()) == len(plain.pictures["target"].tasks())


def test_a_request_says_what_is_before_only_if_something_is():
    assert REQUEST.as_data()["before"] == 3
    assert "before" not in replace(REQUEST, before=0).as_data()


@pytest.mark.parametrize("count", [-1, frame_plan.MOST_BEFORE + 1])
def test_numbers_that_mean_nothing_are_refused(count):
    with pytest.raises(InputError, match=f"before {count}: must be from 0 to 256 frames"):
        frame_plan.plan(replace(REQUEST, before=count))


def test_a_film_of_other_primitives_is_refused():
    film, job = before.Film(), Job(4, 4)
    for scene in (scenes.canonical("minicubes"),):
        film.add(scene, job, render(scene, job).frame)
    other = scenes.canonical("cornell")
    with pytest.raises(InputError, match="primitives of the previous scene"):
        film.add(other, job, render(other, job).frame)


@pytest.mark.parametrize(
    ("features", "wanted"), [(("color", "normal"), False), (("history", "normal"), True), ((), False)]
)
def test_who_wants_a_history(features, wanted):
    assert before.wants(features) is wanted
