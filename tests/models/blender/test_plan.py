"""DSF-13: which frames of a film a data set has, with which seeds; and what is refused."""

from dataclasses import replace

import pytest

from wamnet.models.blender.plan import LARGEST_SEED, Animation, Request, drawn, plan
from wamnet.refimpl.errors import InputError

FILM = Animation("5.0", "hall", "ViewLayer", 1, 48, 1, 24.0, 384, 288, "BOX", "CPU")
"""Two seconds."""

REQUEST = Request("hall.blend", "0" * 64, FILM, 8, 3, 2, 0.5, 25, 1, 16, 64, 5)
"""Half a second of the film is left out."""


def test_frames_are_different_ones_of_the_film():
    frames = plan(REQUEST)
    numbers = {split: [f.frame for f in frames if f.split == split] for split in ("train", "test", "outside")}
    assert [len(found) for found in numbers.values()] == [8, 3, 2]
    inside = numbers["train"] + numbers["test"]
    assert len(set(inside)) == 11
    assert all(1 <= number <= 36 for number in inside)
    assert len(set(numbers["outside"])) == 2
    assert all(37 <= number <= 48 for number in numbers["outside"])
    # Steps of the golden ratio: the gaps of n points on a circle are of three lengths at most, of which the
    # largest is below 3 / n of it; whole frames add one.
    places = sorted(numbers["train"])
    gaps = [b - a for a, b in zip(places, [*places[1:], places[0] + 36], strict=True)]
    assert max(gaps) < 3 * 36 / 8 + 1


def test_seeds_samples_and_sizes():
    frames = plan(REQUEST)
    seeds = [shot.seed for frame in frames for shot in frame.pictures.values()]
    assert seeds == list(range(5, 5 + 26))
    assert {f.pictures["noisy"].spp for f in frames} == {1}
    assert [f.pictures["target"].spp for f in frames] == [16] * 8 + [64] * 5
    shot = frames[8].pictures["target"]
    assert (shot.name, shot.rows, shot.samples) == ("test/00000-target.exr", (0, 72), 96 * 72 * 64)
    assert shot.as_question() == {
        "frame": frames[8].frame,
        "spp": 64,
        "seed": 22,
        "percent": 25,
        "width": 96,
        "height": 72,
    }


def test_every_frame_of_a_film_may_be_drawn():
    """Also where the sequence takes long to meet the last one."""
    for count in (1, 2, 3, 17, 100):
        assert sorted(drawn(range(count), 1, count, "frames")) == list(range(count))
    assert drawn([], 1, 0, "frames") == []
    assert drawn([4, 6, 8], 1, 2, "frames") == drawn([4, 6, 8], 1, 3, "frames")[:2]


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"frames": 0}, "frames 0: must be 1 or more"),
        ({"frames": 34}, "number of frames and test frames 37: the animation has 36 frames"),
        ({"outside_frames": 13}, "frames outside, which --arc holds 13: the animation has 12"),
        ({"arc_s": 2.0}, "arc_s 2.0"),
        ({"percent": 0}, "percent 0"),
        ({"percent": 10_000}, "at most 16384 pixels"),
        ({"noisy_spp": 0}, "noisy_spp 0"),
        ({"seed": LARGEST_SEED - 24}, "seed .* "),
    ],
)
def test_what_means_nothing_is_refused(changed, told):
    with pytest.raises(InputError, match=told):
        plan(replace(REQUEST, **changed))


def test_the_largest_seed_is_allowed():
    last = plan(replace(REQUEST, seed=LARGEST_SEED - 25))[-1]
    assert last.pictures["target"].seed == LARGEST_SEED
