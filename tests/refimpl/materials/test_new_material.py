"""How a material is added (MAT-1): a file and a line of the registry."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from wamnet.compiler.scenes.lower_scene import lower_scene
from wamnet.compiler.scenes.path_kernel import compile_path
from wamnet.kernels import open_executor, render_on
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light import scene
from wamnet.refimpl.light.materials import MATERIALS
from wamnet.refimpl.light.materials.material import SINGLE_PDF, Scattered, Single, Site
from wamnet.refimpl.light.render import Job, render
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.vectors import Floats


@dataclass(frozen=True)
class CatsEye(Single):
    """Light goes back where it came from. Place 1: a file."""

    kind = "cats_eye"

    @staticmethod
    def sample(site: Site, u0: Floats, u1: Floats, u_choice: Floats) -> Scattered:
        """Return the directions back along the paths."""
        return Scattered(site.wo, site.tinted, np.full_like(u0, SINGLE_PDF), None)


CORNELL = canonical("cornell")
SCENE = replace(CORNELL, boxes=(replace(CORNELL.boxes[0], material=CatsEye()), *CORNELL.boxes[1:]))


def test_a_file_and_a_line_are_all_that_a_new_material_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes name it, both languages of paths have it, and programs show it as the reference does."""
    with pytest.raises(InputError, match=r"material.kind 'cats_eye': unknown material"):
        scene.from_json(scene.to_json(SCENE))
    monkeypatch.setitem(MATERIALS, CatsEye.kind, CatsEye)  # type: ignore[arg-type]
    assert scene.from_json(scene.to_json(SCENE)) == SCENE
    programs = lower_scene(SCENE, Settings())
    for target in ("opencl", "opengl"):
        assert compile_path(programs, target).source != compile_path(CATS_EYES_CLOSED, target).source
    # Of one sample: kernels round the sum of several.
    job = Job(16, 16, 1, settings=Settings(max_depth=3))
    with open_executor("numpy") as executor:
        found = render_on(executor, SCENE, job)
    wanted = render(SCENE, job).frame.layers
    assert np.array_equal(found.frame.layers["unshadowed"], wanted["unshadowed"])
    # A colour is a sum of light, all of it positive; fewer than 128 operations, u each, lead to it.
    assert (np.abs(found.frame.layers["color"] - wanted["color"]) <= 128 * 2.0**-24 * wanted["color"]).all()


CATS_EYES_CLOSED = lower_scene(CORNELL, Settings())
"""The same scene without the material."""
