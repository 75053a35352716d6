"""Cases that changes of a program survived: they come last, and decide what they are for."""

from __future__ import annotations

import numpy as np
import pytest

from wamnet.refimpl import rng
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scene as scene_module
from wamnet.refimpl.light.shapes.shape import LEAST_COMPONENT
from wamnet.refimpl.network import siren
from wamnet.refimpl.network import whole as reference
from wamnet.spec.conformance.case import FOLDER, given, load
from wamnet.spec.conformance.kinds import KINDS, light
from wamnet.spec.conformance.numbers import from_json


def cases(kind):
    return load(FOLDER / f"{kind}.json")[1]


def of_note(kind, part):
    return [case for case in cases(kind) if part in case.note]


def inputs(case):
    return {name: given(value) for name, value in case.inputs.items()}


def value(case, name):
    return from_json(case.expected[name].value, name)


def test_cases_are_numbered():
    assert [case.id for case in cases("network.forward")] == [f"network.forward/{n}" for n in range(22)]


def test_layers_and_inputs_that_do_not_fit_are_refused():
    for case in cases("network.forward"):
        if case.expected is not None:
            continue
        said = "the first layer takes 4 numbers" if "input" in case.note else "as many biases as rows"
        with pytest.raises(InputError, match=said):
            KINDS["network.forward"].answer(inputs(case))


def test_components_of_rays_are_between_the_guard_and_twice_it():
    found = [case for n in ("-1.25", "1.75") for case in of_note("intersection.slabs", f"of {n}e-15")]
    assert len(found) == 6
    for case in found:
        # LEAST_COMPONENT is where ISC-5 begins to guard.
        least = np.min(np.abs(inputs(case)["direction"]))
        assert LEAST_COMPONENT < least < 2.0 * LEAST_COMPONENT
        # A guard of twice the size would move a distance by a quarter at least, beyond each bound.
        for name, out in case.expected.items():
            assert np.all(from_json(out.bound, name) <= np.abs(value(case, name)).max() / 100)


def test_integers_on_windows_do_not_tie():
    # Sums in any order are off by some 2^-48: a change by 2^-40 is more than what two programs differ by.
    for case in (*of_note("whole.rounded_on", "few steps"), *of_note("whole.rounded_on", "the best")):
        for scale in (1.0 - 2.0**-40, 1.0 + 2.0**-40):
            moved = {n: v * scale if n.startswith("weight_") else v for n, v in inputs(case).items()}
            found = KINDS["whole.rounded_on"].answer(moved)
            assert all(np.array_equal(found[name], value(case, name)) for name in case.expected)


def test_windows_of_few_steps_are_decided_by_the_least_spread(monkeypatch):
    (quiet,) = of_note("whole.rounded_on", "few steps")
    monkeypatch.setattr(reference, "SPREAD", 2.0 * reference.SPREAD)
    found = KINDS["whole.rounded_on"].answer(inputs(quiet))
    assert any(not np.array_equal(found[name], value(quiet, name)) for name in quiet.expected)
    assert np.mean(np.var(reference.steps_of(inputs(quiet)["windows"]), axis=0)) < 1.0


def test_the_first_of_two_equal_shapes_is_met():
    assert [value(case, "surface") for case in of_note("path.arrive", "two equal")] == [0, 0, 2, 2, 4]


def test_a_lamp_ends_a_path_and_a_dim_one_is_sampled():
    (lamp,), (floor,) = (
        of_note("path.scatter", "metal is the last kind"),
        of_note("path.scatter", "under a dim lamp"),
    )
    assert not lamp.expected["alive"].value
    assert np.all(value(floor, "radiance") > inputs(floor)["radiance"])
    (dim,) = scene_module.from_json((FOLDER / "scenes/rail.json").read_text()).lights
    assert 0.0 < dim.power * sum(dim.color) < 1.0


def test_the_first_light_number_of_a_sample_is_a_half():
    """A lamp is chosen at the threshold between two."""
    tie = next(case.inputs for case in cases("path.scatter") if case.inputs["sample"] == 24091914)
    block = (rng.counter(int(tie[name])) for name in ("seed", "pixel", "sample"))
    number, *_ = rng.uniforms(*block, rng.counter(1), np.float64)
    assert float(np.squeeze(number)) == 0.5


def test_the_far_root_of_a_sphere_is_one():
    (case,) = of_note("intersection.sphere", "the far root is 1")
    assert value(case, "t") == 0.5
    ray = inputs(case)
    middle = np.array(light.SPHERE_CENTER) - ray["origin"]
    assert 2.0 * (middle @ ray["direction"]) - 0.5 == 1.0


def test_a_factor_is_another_with_a_step_more_of_room():
    (case,) = of_note("whole.rounded", "a flat row: two")
    factor = value(case, "factor_1")
    unit = reference._unit(siren.Siren((0, 0, 0), (), 1.0, 6.0), 1)
    total = np.abs(inputs(case)["weight_1"]).sum() * unit / 511
    rooms = [(2**24 - 1) // 511 - steps * 264 for steps in (2, 3)]
    assert [float(np.ceil(total / room)) for room in rooms] == [float(factor[0]), float(factor[0]) + 2.0]
