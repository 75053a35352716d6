"""The models that come with the package, on every executor, on noisy frames of their own scenes.

1. All that is particular to a model is read from its file: scene, ranges, rays, features. A frame is drawn
   from its ranges, or shows the time farthest from training times [`unseen`]; its size is odd [`shown`].
2. Each executor denoises it within the bound of the manifest around the float64 reference.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from wamnet import models
from wamnet.cli.common.inputs import load_model, unlike_training
from wamnet.compiler.compile import compile_plan, compile_program
from wamnet.compiler.core.ir import Program
from wamnet.compiler.core.lower import lower
from wamnet.compiler.plan import plan_program
from wamnet.compiler.scenes.encode_kernel import sees
from wamnet.compiler.targets import DENOISERS, LANGUAGES
from wamnet.kernels import denoise_on
from wamnet.kernels.run.denoise_on import images_of
from wamnet.kernels.run.render_frame import render_frame
from wamnet.models.data.draws import drawn
from wamnet.refimpl.frame import Frame
from wamnet.refimpl.light.render import Job
from wamnet.refimpl.light.scene import Scene
from wamnet.refimpl.light.scenes import canonical
from wamnet.refimpl.light.transport import Settings
from wamnet.refimpl.light.variation import RANGES, ranges_from_json, varied
from wamnet.refimpl.network.denoise import Model, denoise, learned_shadow_rays

MODELS = [name for name in models.names() if not name.endswith("-basic") or name == "glossy-basic"]
"""All bundled models, but those of the form of another one, with other weights."""

WIDTH, HEIGHT = 40, 27
"""Size of a frame in pixels: more than one tile of spectra (21 x 21), and no multiple of any tile."""

SEED = 4_000_000_007
"""Seed of the noise, which no training has."""


DISPLAY_STEP = 1 / 255
"""Distance of two neighbouring colours of an 8-bit display."""


# ---- models and their frames ---------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Trained:
    """A model, a noisy frame of its scene, and its program and images."""

    model: Model
    frame: Frame
    program: Program
    images: Mapping[str, np.ndarray]


def first_of(model: Model, name: str, default: str) -> str:
    """Return the first of the values that training had."""
    return model.info.get(f"trained_on_{name}", default).split(", ")[0]


def unseen_time(model: Model) -> float:
    """Return the middle of the widest gap between training times, in seconds."""
    times = np.unique([float(time) for time in model.info["trained_on_time"].split(", ")])
    gaps = np.diff(times)
    return float(times[gaps.argmax()] + gaps.max() / 2) if len(gaps) else float(times[0] + 0.1)


def unseen(model: Model) -> Scene:
    """Return a model's scene as no training frame shows it: time, camera and lamps of another sequence."""
    name, ranges = first_of(model, "scene", ""), model.info.get(f"trained_on_{RANGES}")
    if ranges is None:
        return canonical(name, time=unseen_time(model))
    (draw,) = drawn(SEED, ranges_from_json(ranges), canonical(name).lights, 0, 1)
    return varied(canonical(name, time=draw.time_s), draw.variation)


def shown(model: Model) -> Frame:
    """Return a noisy frame of the scene that a model is for, rendered as those that it has learned from."""
    settings = Settings(max_depth=int(first_of(model, "max_depth", str(Settings().max_depth))))
    spp, rays = (int(first_of(model, name, "1")) for name in ("spp", "feature_spp"))
    more = {"shadow_rays": learned_shadow_rays(model), "seen": sees(model.features)}
    job = Job(WIDTH, HEIGHT, spp, SEED, settings, feature_spp=rays, **more)
    return render_frame("numpy", unseen(model), job).frame


@cache
def trained(name: str) -> Trained:
    """Return a model with its frame, once a session."""
    model = load_model(Path(name))
    frame = shown(model)
    return Trained(model, frame, lower(model), images_of(model, frame))


# ---- kernels within their bounds -----------------------------------------------------------------------


@pytest.mark.nightly(but=("opencl-glossy", "c-cornell", "opengl-egl-minicubes"))
@pytest.mark.parametrize("name", MODELS)
def test_whole_frames_equal_the_definition(denoiser, name):
    """As users run it: encoding and choice of the schedule included, under the bound of the manifest."""
    case = trained(name)
    wanted = denoise(case.model, case.frame, np.float64)
    bound = compile_program(case.program, denoiser.name).manifest["bound"]["output"]
    found = denoise_on(denoiser, case.model, case.frame).image
    assert (np.abs(found - wanted) <= bound).all()
    assert wanted.std() > 0.05, "the picture is nearly constant: it would hide a wrong kernel"


@pytest.mark.nightly(but="opencl-glossy")
@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("target", DENOISERS)
def test_certified_bounds_are_below_a_step_of_a_display(name, target):
    """Over all pictures, of all schedules that hold the model; of the shelf's: test_certify_shelf.py."""
    program = lower(load_model(Path(name)))
    plans = [plan_program(program, target, schedule=each) for each in LANGUAGES[target].schedules]
    shared = [plan for plan in plans if plan.shares_bound]
    for plan in (*shared[:1], *(plan for plan in plans if not plan.shares_bound)):
        assert compile_plan(plan).certificate is not None
        assert max(plan.bound.output) < DISPLAY_STEP


# ---- frames and faults ---------------------------------------------------------------------------------


@pytest.mark.nightly(but=("glossy", "cornell", "minicubes"))
@pytest.mark.parametrize("name", MODELS)
def test_frames_show_what_the_model_is_for_and_has_not_seen(name):
    case = trained(name)
    assert unlike_training(case.model, case.frame.info) == []
    for fact in ("time", "seed"):
        assert case.frame.info[fact] not in case.model.info.get(f"trained_on_{fact}", "").split(", ")
    for feature, image in case.images.items():
        assert np.ptp(image) > 0.1, f"{feature} is nearly constant"
