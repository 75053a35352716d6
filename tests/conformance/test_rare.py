"""Cases that changes of a program survived: they come last, and decide what they are for."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.refimpl import rng
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import render
from wamnet.refimpl.light import scene as scene_module
from wamnet.refimpl.light.shapes.shape import LEAST_COMPONENT
from wamnet.refimpl.network import siren
from wamnet.refimpl.network import whole as reference
from wamnet.spec.conformance import functions
from wamnet.spec.conformance.kinds import FUNCTIONS, KINDS, light, views, whole
from wamnet.spec.conformance.kinds.views import SEED


def of_note(kind, part):
    return [case for case in KINDS[kind].make() if part in case.note]


def test_cases_are_numbered():
    cases = KINDS["network.forward"].make()
    assert [case.id for case in cases] == [f"network.forward/{n}" for n in range(len(cases))]


def test_rows_that_come_last_do():
    notes = [case.note for case in KINDS["intersection.slabs"].make()]
    drawn, later = FUNCTIONS["intersection.slabs"].draws, FUNCTIONS["intersection.slabs"].later
    assert notes[-len(later) - drawn :] == [""] * drawn + [row[0] for row in later]
    assert functions.drawn("intersection.slabs", 0).shape == (16,)


@pytest.mark.parametrize("name", views.OWN)
def test_scenes_of_the_vectors_are_written_as_files_are(name):
    assert scene_module.to_json(views.scene(name)) == views.scene_text(name)


def test_layers_and_inputs_that_do_not_fit_are_refused():
    for case in KINDS["network.forward"].make():
        if case.expected is not None:
            continue
        said = "the first layer takes 4 numbers" if "input" in case.note else "as many biases as rows"
        with pytest.raises(InputError, match=said):
            KINDS["network.forward"].answer(case.inputs)


def test_components_of_rays_are_between_the_guard_and_twice_it():
    for row in FUNCTIONS["intersection.slabs"].later:
        (case,) = of_note("intersection.slabs", row[0])
        # LEAST_COMPONENT is where ISC-5 begins to guard.
        least = np.min(np.abs(case.inputs["direction"]))
        assert LEAST_COMPONENT < least < 2.0 * LEAST_COMPONENT
        # A guard of twice the size would move a distance by a quarter at least, beyond each bound.
        assert all(np.all(out.bound <= np.abs(out.value).max() / 100) for out in case.expected.values())
        assert FUNCTIONS["intersection.slabs"].answer(case.inputs).keys() == case.expected.keys()


def test_integers_on_windows_do_not_tie():
    # Sums in any order are off by some 2^-48: a change by 2^-40 is more than what two programs differ by.
    for case in (*of_note("whole.rounded_on", "few steps"), *of_note("whole.rounded_on", "the best")):
        for scale in (1.0 - 2.0**-40, 1.0 + 2.0**-40):
            moved = {n: v * scale if n.startswith("weight_") else v for n, v in case.inputs.items()}
            found = whole._rounded_on({n: np.asarray(v, np.float64) for n, v in moved.items()})
            assert all(np.array_equal(found[name], out.value) for name, out in case.expected.items())


def test_windows_of_few_steps_are_decided_by_the_least_spread(monkeypatch):
    (quiet,) = of_note("whole.rounded_on", "few steps")
    monkeypatch.setattr(reference, "SPREAD", 2.0 * reference.SPREAD)
    found = whole._rounded_on(quiet.inputs)
    assert any(not np.array_equal(found[name], out.value) for name, out in quiet.expected.items())
    assert np.mean(np.var(reference.steps_of(np.asarray(quiet.inputs["windows"])), axis=0)) < 1.0


@pytest.mark.nightly
def test_the_first_of_two_equal_shapes_is_met():
    found = [int(case.expected["surface"].value) for case in of_note("path.arrive", "two equal")]
    assert found == [0, 0, 2, 2, 4]


@pytest.mark.nightly
def test_a_lamp_ends_a_path_and_a_dim_one_is_sampled():
    (lamp,), (floor,) = (
        of_note("path.scatter", "metal is the last kind"),
        of_note("path.scatter", "under a dim lamp"),
    )
    assert not lamp.expected["alive"].value
    assert np.all(np.asarray(floor.expected["radiance"].value) > np.asarray(floor.inputs["radiance"]))
    (dim,) = views.scene("rail").lights
    assert 0.0 < dim.power * sum(dim.color) < 1.0


def test_the_first_light_number_of_a_sample_is_a_half():
    (view,) = views.placed("tie")
    pixel = render.pixel_counter(np.array(view.x), np.array(view.y))
    number, *_ = rng.uniforms(rng.counter(SEED), pixel, rng.counter(view.sample), rng.counter(1), np.float64)
    assert float(np.squeeze(number)) == 0.5


def test_the_far_root_of_a_sphere_is_one():
    (case,) = of_note("intersection.sphere", "the far root is 1")
    assert float(np.asarray(case.expected["t"].value)) == 0.5
    middle = np.array(light.SPHERE_CENTER) - case.inputs["origin"]
    assert 2.0 * (middle @ case.inputs["direction"]) - 0.5 == 1.0


def test_a_factor_is_another_with_a_step_more_of_room(monkeypatch):
    (case,) = of_note("whole.rounded", "a flat row: two")
    factor = case.expected["factor_1"].value
    total = (
        np.abs(case.inputs["weight_1"]).sum() * reference._unit(siren.Siren((0, 0, 0), (), 1.0, 6.0), 1) / 511
    )
    rooms = [(2**24 - 1) // 511 - steps * 264 for steps in (2, 3)]
    assert [float(np.ceil(total / room)) for room in rooms] == [float(factor[0]), float(factor[0]) + 2.0]
