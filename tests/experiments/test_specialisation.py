"""What a kernel that is made for one scene saves: the laden scene shows the same, and holds everything."""

from __future__ import annotations

import numpy as np
import pytest
import specialisation

from wamnet.refimpl.light import scene, scenes
from wamnet.refimpl.light.materials import MATERIALS
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.transport import Settings


@pytest.mark.parametrize("name", scenes.CANONICAL)
def test_a_laden_scene_shows_the_same(name):
    """Its first hits are those of the scene, to the bit: nothing of what it holds more is seen."""
    own = scenes.canonical(name, time=specialisation.TIME_S)
    other = scene.validate(specialisation.laden(own))
    job = Job(24, 16, 2, 3, Settings(max_depth=0))
    frames = [render(each, job).frame for each in (own, other)]
    for layer in ("albedo", "normal", "depth"):
        assert np.array_equal(frames[0][layer], frames[1][layer])
    more = {
        each: len(getattr(other, each)) - len(getattr(own, each)) for each in ("boxes", "spheres", "quads")
    }
    # A quad is not closed: it has no glass.
    assert more == {"boxes": len(MATERIALS), "spheres": len(MATERIALS), "quads": len(MATERIALS) - 1}


def test_it_prints_its_table(executor_named, capsys):
    executor_named("opencl")
    specialisation.main(["--executors", "opencl", "--scenes", "empty", "--size", "32", "--repeats", "1"])
    *_, line = capsys.readouterr().out.strip().splitlines()
    cells = [cell.strip() for cell in line.strip("|").split("|")]
    assert cells[:2] == ["opencl", "empty"]
    own, laden = (int(cell.replace(",", "")) for cell in cells[2:4])
    assert own < laden / 4
