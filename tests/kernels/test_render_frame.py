"""Tests of rendering by an executor's name: the reference's bits, in bands or shared, and the refusal."""

from __future__ import annotations

import pytest

from wamnet.kernels.render_frame import RENDERERS, render_frame
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.render import Job, join_rows, render
from wamnet.refimpl.scenes import canonical

SCENE = canonical("cornell")


@pytest.mark.parametrize("executor", RENDERERS)
def test_bands_are_the_frame(executor) -> None:
    """Rows rendered apart and joined are all rows, to the bit, where an executor can do bands at all."""
    job = Job(7, 5, 2, 3)
    whole = render_frame(executor, SCENE, job)
    assert whole.frame.height == 5
    if RENDERERS[executor].in_bands:
        parts = join_rows([render_frame(executor, SCENE, job, rows=rows) for rows in ((0, 2), (2, 5))])
        assert all((parts.frame[name] == values).all() for name, values in whole.frame.layers.items())


def test_numpy_is_the_reference() -> None:
    """Also with workers, and the samples are counted."""
    job, counted = Job(6, 4, 2), []
    want = render(SCENE, job).frame["color"]
    for workers in (1, 2, None):
        got = render_frame("numpy", SCENE, job, workers=workers, on_progress=counted.append)
        assert (got.frame["color"] == want).all()
    assert sum(counted) == 3 * 6 * 4 * 2


def test_an_unknown_executor_is_refused() -> None:
    """The names are listed."""
    text = "executor that renders is abacus: must be one of numpy.*; choose one of these"
    with pytest.raises(InputError, match=text):
        render_frame("abacus", SCENE, Job(2, 2))
