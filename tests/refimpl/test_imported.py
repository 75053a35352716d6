"""Imported networks: the steps, a picture by hand, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from wamnet.refimpl.errors import InputError
from wamnet.refimpl.network.denoise import check_model
from wamnet.refimpl.network.imported import STEPS, Imported, Source, Step, check_imported, evaluate
from wamnet.refimpl.network.window import Window

WINDOW = Window(3, "zero")


def network(*steps, low=-np.inf, high=np.inf):
    """Return a network whose first layer adds up a window of one channel, others doubling it."""
    weights = (np.ones((1, 9), np.float32), *[np.full((1, 1), 2, np.float32)] * len(steps))
    biases = (np.zeros(1, np.float32),) * len(weights)
    return Imported(weights, biases, 1.0, 1.0, "sine", steps, low, high, (Source("x", 1, -1.0, 1.0),))


@pytest.mark.parametrize(
    ("step", "values"),
    [
        (Step("sine", (0.5,)), np.sin([-1.0, 0.0, 1.5])),
        (Step("relu", (-1.0,)), [-1.0, 0.0, 3.0]),
        (Step("leaky", (0.25,)), [-0.5, 0.0, 3.0]),
        (Step("clip", (-1.0, 2.0)), [-1.0, 0.0, 2.0]),
    ],
)
def test_steps(step, values):
    found = STEPS[step.kind].forward(np.array([-2.0, 0.0, 3.0]), *step.numbers)
    assert np.array_equal(found, values)


def test_a_picture_by_hand():
    """Sums of windows with zeros outside are 4, 6 and 9 at corners, sides and inside of ones."""
    image = {"x": np.ones((3, 3, 1))}
    sums = np.array([[4.0, 6.0, 4.0], [6.0, 9.0, 6.0], [4.0, 6.0, 4.0]])
    assert np.array_equal(evaluate(network(), WINDOW, image)[..., 0], sums)
    clipped = network(Step("relu", (5.0,)), high=15.0)
    assert np.array_equal(
        evaluate(clipped, WINDOW, image)[..., 0], np.minimum(2 * np.maximum(sums, 5.0), 15.0)
    )


WRONG = {
    "no image": ({"sources": ()}, "names of the images .*: at least one"),
    "a name": ({"sources": (Source("1", 1, 0.0, 1.0),)}, "names of the images '1': at least one"),
    "two signs": ({"sources": (Source("a__b", 1, 0.0, 1.0),)}, "names of the images 'a__b': at least one"),
    "a long name": ({"sources": (Source("a" * 41, 1, 0.0, 1.0),)}, "names of the images 'a+': at least one"),
    "channels": ({"sources": (Source("x", 0, 0.0, 1.0),)}, "channels of image x 0: 1 to 1024"),
    "range": ({"sources": (Source("x", 1, 1.0, 1.0),)}, "range of image x .*: two numbers in order"),
    "inputs": ({"sources": (Source("x", 2, 0.0, 1.0),)}, "inputs of the first layer 9: 3 x 3 pixels of 2"),
    "steps": ({"steps": ()}, "number of steps 0: one after each of the 2 layers but the last"),
    "kind": ({"steps": (Step("tanh", ()),)}, "step of layer 0 'tanh': a known one"),
    "numbers": ({"steps": (Step("sine", (0.0,)),)}, "step of layer 0, sine .*: a scale other than 0"),
    "slope": ({"steps": (Step("leaky", (1.5,)),)}, r"a slope in \[0, 1\]"),
    "not float32": ({"steps": (Step("relu", (0.1,)),)}, "a floor, exact in float32"),
    "clip": ({"low": 1.0, "high": 0.0}, "clip .*: must be float32 values, low < high"),
    "no number": ({"low": float("nan")}, "clip .*: must be float32 values, low < high"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_means_nothing_is_refused(case):
    changes, told = WRONG[case]
    right = network(Step("relu", (0.0,)))
    check_imported(right, WINDOW)
    with pytest.raises(InputError, match=told):
        check_imported(replace(right, **changes), WINDOW)


def test_many_outputs_are_refused():
    many = replace(network(), weights=(np.ones((5, 9), np.float32),), biases=(np.zeros(5, np.float32),))
    with pytest.raises(InputError, match="outputs of the last layer 5: at most 4"):
        check_imported(many, WINDOW)


def test_a_model_of_it_is_checked():
    from wamnet.models.model_file import imported_model

    model = imported_model(network(), WINDOW, {})
    check_model(model)
    assert model.is_imported
    with pytest.raises(InputError, match="inputs of the first layer 9"):
        check_model(replace(model, window=Window(5, "zero")))
