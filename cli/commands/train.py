"""`wamnet train`: from pairs of a noisy frame and its reference to a model."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any

from ... import kernels
from ...compiler.core import sine
from ...compiler.variants import amplitude_of, parse, vary
from ...kernels.run.trainer import model_of_run
from ...models import model_file
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.frame import Frame
from ...refimpl.network import train as reference
from ...refimpl.network.denoise import Model
from ...refimpl.network.domain import LEAST_FRAMES, Domain, of_model
from ...refimpl.network.siren import Siren
from ...refimpl.network.train import PRESETS, Recipe, TrainState, check_recipe, whole_of, with_activation
from ..common import options
from ..common.executors import chosen
from ..common.inputs import CHECKPOINT_MARK, load_model
from ..common.options import Preset
from ..common.request import given
from ..common.terminal import hint_on_interrupt, progress, say
from ..files import dataset_files, exr
from ..files.alone import alone_at
from ..files.outputs import check_output

CHECKPOINT_INTERVAL_S = 30.0
"""Seconds between two checkpoints: what a power cut may cost. Ctrl-C costs nothing."""


@dataclass(frozen=True)
class Pairs:
    """What is trained on: single frames, or a data set."""

    inputs: list[Path] | None = None
    targets: list[Path] | None = None
    dataset: Path | None = None


@dataclass(frozen=True)
class Wanted:
    """The recipe; None for what the preset, or the checkpoint, has."""

    preset: Preset | None = None
    features: str | None = None
    rank: int | None = None
    begin: Path | None = None
    variant: str | None = None
    whole: bool = False
    activation: str | None = None
    steps: int | None = None
    seed: int | None = None

    def recipe(self, state: TrainState | None) -> Recipe:
        """Return the recipe, checked."""
        names = None if self.features is None else options.parse_names(self.features)
        choices = {"features": names, "steps": self.steps, "seed": self.seed, "rank": self.rank}
        recipe = choose_recipe(self.preset or "best", state, choices)
        if self.activation is not None:
            recipe = with_activation(recipe, self.activation)
        check_recipe(recipe)
        return recipe

    def network(self, state: TrainState | None) -> str | None:
        """Return the name of the variant, if one is named; a resumed run has its own."""
        if self.variant is not None and self.whole:
            raise InputError("--variant", self.variant, "--whole is short for whole8", "give one of them")
        name = "whole8" if self.whole else self.variant
        if name is not None and state is not None:
            raise InputError("--variant", name, "a resumed run keeps the checkpoint's", "leave it out")
        return name


def train(
    *,
    pairs: Pairs,
    output: Path = Path("model.safetensors"),
    wanted: Wanted,
    resume: bool = False,
    restart: bool = False,
    executor: options.TrainerName = "auto",
) -> None:
    """Train a network on noisy frames and their references, or on a data set."""
    inputs, targets, begin = pairs.inputs or [], pairs.targets or [], wanted.begin
    check_output(output, (".safetensors",), [*inputs, *targets])
    saved = checkpoint_path(output)
    check_output(saved)
    # Two runs would leave a model of one and a checkpoint of the other.
    with alone_at(output, "training a model"), alone_at(saved, "training a model"):
        check_begin(saved, wanted.preset, resume, restart)
        state = model_file.load_checkpoint(saved) if resume else None
        if begin is not None and state is not None:
            rule = "a resumed run continues from its checkpoint"
            raise InputError("--from", str(begin), rule, "leave it out")
        recipe, network = wanted.recipe(state), load_model(begin).siren if begin else None
        name = wanted.network(state)
        if name is not None:
            recipe, network = _of_variant(
                recipe, begin, name, given(wanted, "rank", "features", "activation")
            )
        frames = read_training(pairs.dataset, inputs, targets, recipe.features)
        if begin is not None and name is not None and whole_bits(name) and wanted.steps is None:
            model_file.save_model(output, whole_of(load_model(begin), frames, recipe.whole, recipe.seed))
            say(f"{output}: {begin} in integers, rounded on {len(frames)} frames")
            return
        by = chosen(executor, trains=True)
        with hint_on_interrupt(
            lambda: f"{saved}: --resume continues from it" if saved.exists() else "no step was done"
        ):
            trained, _ = fit(recipe, frames, output, state, network, by)
        if state is not None and recipe.steps != state.recipe.steps:
            before, now = state.recipe.steps, recipe.steps
            say(f"run extended from {before} to {now} steps: the model differs from one of a {now}-step run")
        say(f"{output}: {trained.step} steps; checkpoint in {saved}")
        say(f"{output}: {_said_of_domain(of_model(load_model(output)))}")


def whole_bits(name: str) -> int | None:
    """Return the bits of a variant that is only rounded to integers, or None for another one."""
    steps = parse(name).steps
    return int(steps[0][1]) if len(steps) == 1 and steps[0][0] == "whole" else None


def _of_variant(
    recipe: Recipe, begin: Path | None, name: str, others: Mapping[str, object]
) -> tuple[Recipe, Siren | None]:
    """Return recipe and first network of a variant; integers by themselves need no model to begin with."""
    bits = whole_bits(name)
    if begin is None and bits is not None:
        found = replace(recipe, whole=amplitude_of(bits))
        check_recipe(found)
        return found, None
    for each in others:
        raise InputError("--variant", name, f"it chooses what {each} does", f"leave out {each}")
    if begin is None:
        raise InputError("--variant", name, "is derived from a trained model", "name one with --from")
    return varied(recipe, load_model(begin), name)


def varied(recipe: Recipe, model: Model, name: str) -> tuple[Recipe, Siren]:
    """Return the recipe and the first network with which a variant of a model is trained."""
    varied, amplitude = vary(parse(name), model).floats
    if varied.degree != sine.DEGREE:
        rule = "the degree of a sine is chosen when a kernel is compiled, not trained"
        raise InputError("--variant", name, rule, "leave it out of the name here")
    if any(kind == "half" for kind, _ in varied.variant.steps):
        rule = "weights are rounded to halves when a kernel is compiled, not trained"
        raise InputError("--variant", name, rule, "leave it out of the name here")
    network = varied.model.siren
    found = replace(
        recipe,
        features=varied.model.features,
        window=varied.model.window,
        widths=network.widths[1:-1],
        omega_0_first=network.omega_0_first,
        omega_0_hidden=network.omega_0_hidden,
        rank=varied.rank,
        activation=network.activation,
        whole=amplitude,
    )
    check_recipe(found)
    return found, network


def check_begin(saved: Path, preset: Preset | None, resume: bool, restart: bool) -> None:
    """Refuse options that contradict each other, and to replace an earlier run's checkpoint unasked."""
    if resume and restart:
        raise InputError("--resume and --restart", NO_VALUE, "exclude each other", "choose one of them")
    if resume and preset is not None:
        rule = "cannot be combined with --resume, which uses the checkpoint's recipe"
        raise InputError("--preset", preset, rule, "leave it out, or start again with --restart")
    if saved.exists() and not (resume or restart):
        rule = "belongs to an earlier run, which would be lost"
        raise InputError(
            "checkpoint",
            str(saved),
            rule,
            "continue with --resume, replace it with --restart, or choose another -o",
        )


def choose_recipe(preset: str, state: TrainState | None, choices: dict[str, Any]) -> Recipe:
    """Return the checkpoint's recipe, or the preset's, with the choices that were made (not None)."""
    base = PRESETS[preset] if state is None else state.recipe
    return replace(base, **{name: value for name, value in choices.items() if value is not None})


def read_training(
    dataset: Path | None, inputs: Sequence[Path], targets: Sequence[Path], features: Sequence[str]
) -> list[tuple[Frame, Frame]]:
    """Read the pairs to train on: a data set's, or those of the named frames; one of the two.

    Noisy frames must have the layers of the features.
    """
    if dataset is None and not inputs and not targets:
        raise InputError("training frames", NO_VALUE, "missing", "give -i and -t, or --dataset")
    if dataset is not None and (inputs or targets):
        rule = "cannot be combined with -i and -t"
        raise InputError("--dataset", str(dataset), rule, "choose one of them")
    if dataset is not None:
        return dataset_files.read_pairs(dataset, tell=say)
    if len(inputs) != len(targets):
        rule = f"each --input needs its --target, and there are {len(inputs)} inputs"
        raise InputError("number of targets", len(targets), rule, "repeat -i and -t in the same order")
    pairs = []
    for noisy, target in zip(inputs, targets, strict=True):
        pair = exr.read_frame(noisy, tell=say), exr.read_frame(target, tell=say)
        way_out = "render or export it too, or choose other --features"
        exr.need_layers(noisy, pair[0], features, "the network is to see it", way_out)
        exr.need_layers(target, pair[1], ("color",), "it is what the network learns", "export it too")
        pairs.append(pair)
    return pairs


def fit(
    recipe: Recipe,
    pairs: Sequence[tuple[Frame, Frame]],
    output: Path,
    state: TrainState | None = None,
    network: Siren | None = None,
    executor: str = "numpy",
) -> tuple[TrainState, float]:
    """Train with a progress bar and checkpoints beside `output`; write the model there. Seconds come too.

    The run continues from `state`, or begins with the weights of `network`, or with random ones.
    """
    saved, seen = checkpoint_path(output), state.step if state is not None else 0
    started = kept = monotonic()
    with progress("training", recipe.steps - seen, "steps") as advance:

        def on_progress(now: TrainState, _loss: float) -> None:
            nonlocal kept, seen
            advance(now.step - seen)
            seen = now.step
            if monotonic() - kept > CHECKPOINT_INTERVAL_S:
                model_file.save_checkpoint(saved, now)
                kept = monotonic()

        with ExitStack() as opened:
            train: Callable[..., TrainState] = reference.train
            if executor != "numpy":
                train = partial(kernels.train_on, opened.enter_context(kernels.open_executor(executor)))
            state = train(
                recipe,
                pairs,
                state=state,
                network=network,
                on_progress=on_progress,
                on_checkpoint=lambda now: model_file.save_checkpoint(saved, now),
            )
    seconds = monotonic() - started
    model_file.save_model(output, model_of_run(state, pairs))
    return state, seconds


def _said_of_domain(domain: Domain | None) -> str:
    """Return what a model states as its domain."""
    if domain is None:
        lacks = f"no domain, for which {LEAST_FRAMES} frames are needed"
        return f"{lacks}: a frame unlike them may pass unnoticed"
    share = f"of frames like them 1 in {1.0 / domain.rate:.0f} is farther"
    return f"its domain is that of {domain.frames} frames, up to distance {domain.threshold:.3g}; {share}"


def checkpoint_path(output: Path) -> Path:
    """Return the file beside a model that keeps the state of its training: NAME.checkpoint.safetensors."""
    return output.with_suffix(CHECKPOINT_MARK + output.suffix)
