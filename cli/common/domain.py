"""Saying when a frame is outside of what a model has learned, and what is off about it.

1. What differs by name is known from what frame and model say [`inputs.unlike_training`].
2. Features are measured against the domain that the model states, if it states one [`check_domain`].
3. Of an animation each picture that is made is measured [`Watch`].
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ...refimpl.errors import InputError
from ...refimpl.frame import Frame
from ...refimpl.network.dataset import FEATURES
from ...refimpl.network.denoise import Model
from ...refimpl.network.domain import Distance, Domain, measure, measure_frame, of_model
from .inputs import unlike_training
from .terminal import say


def check_domain(
    path: Path, frame: Frame, model: Model, anyway: bool = False, say: Callable[[str], None] = say
) -> None:
    """Say what about the frame in `path` a model has not learned.

    Another program's frame that is outside of the domain is refused, unless it is to be denoised `anyway`.
    """
    foreign = not frame.info
    read = ", ".join(dict.fromkeys(layer for name in model.features for layer in FEATURES[name].layers))
    named, domain = unlike_training(model, frame.info), of_model(model)
    found = measure_frame(domain, model, frame) if domain else None
    is_outside = found is not None and found.is_outside
    if found and is_outside and foreign and not anyway:
        rule = (
            f"the model was trained on frames within {found.threshold:.3g}, and of this frame it "
            f"reads {read}; {farthest(found)}"
        )
        way_out = "export it as the training frames were, or give --anyway"
        raise InputError(f"{path}: distance from the model's domain", round(found.distance, 2), rule, way_out)
    if foreign:
        scene = model.info.get("trained_on_scene", "other frames")
        say(f"{path}: another program's frame, of which the model, trained on {scene}, reads {read}")
    if found and domain and is_outside:
        named = [f"outside the model's domain: {'; '.join([how_far(found, domain), *named])}"]
    for sentence in named:
        say(f"{path}: {sentence}")


def how_far(found: Distance, domain: Domain) -> str:
    """Return how far a frame is from a domain, and in what."""
    share = f"1 in {1.0 / domain.rate:.0f} frames like those of the training is beyond it"
    return f"distance {found.distance:.3g}, threshold {found.threshold:.3g} ({share}); {farthest(found)}"


def farthest(found: Distance) -> str:
    """Return which number of a frame is farthest off."""
    return (
        f"farthest off is the {found.statistic} of {found.channel}: "
        f"{found.value:.3g}, in training {found.middle:.3g}"
    )


@dataclass
class Watch:
    """The distances of an animation's pictures from the domain that a model states; of none without one."""

    model: Model
    pictures: list[tuple[str, Distance]] = field(default_factory=list, init=False)

    @cached_property
    def domain(self) -> Domain | None:
        """Return the domain."""
        return of_model(self.model)

    @property
    def features(self) -> tuple[str, ...]:
        """Return the features that are measured."""
        return self.domain.features if self.domain else ()

    def see_frame(self, name: str, frame: Frame) -> None:
        """Measure the frame of a picture of this name."""
        if self.domain:
            self.pictures.append((name, measure_frame(self.domain, self.model, frame)))

    def see_images(self, name: str, images: Any) -> None:
        """Measure the encoded features (H, W, channels) of a picture, by name."""
        if self.domain:
            image = np.concatenate([images[feature] for feature in self.features], axis=-1)
            self.pictures.append((name, measure(self.domain, image)))

    def report(self, output: Path) -> None:
        """Say how many pictures are outside, and what is off about the farthest."""
        beyond = [each for each in self.pictures if each[1].is_outside]
        if self.domain is None or not beyond:
            return
        name, found = max(beyond, key=lambda each: each[1].distance)
        count = f"{len(beyond)} of {len(self.pictures)} frames are outside the model's domain"
        say(f"{output}: {count}; the farthest is {name}: {how_far(found, self.domain)}")
