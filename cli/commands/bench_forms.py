"""Forms of a network that a benchmark trains before it measures them: ranks, windows, and both.

1. A form is cut from the model [compiler/variants.py] and trained further with the model's recipe, with fewer
   steps, on its own scales: images are encoded as the model's are [`start_of`].
2. Each is kept in a folder of its model, beside its checkpoint: an interrupted run resumes, and a form that
   is finished is read [`trained`].
3. The whole network is trained on as far too: what more steps give is not credited to a form [`FURTHER`].
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ...compiler import variants
from ...compiler.variants import digest_of
from ...kernels.bench.contenders import Variant
from ...kernels.run.curve import names_for
from ...models.model_file import load_checkpoint
from ...refimpl.errors import InputError
from ...refimpl.frame import Frame
from ...refimpl.network import dataset
from ...refimpl.network.denoise import Model
from ...refimpl.network.train import PRESETS, Recipe, TrainState, recipe_from_json, start
from ..common.inputs import load_model
from ..common.terminal import say
from . import train

FORMS = (
    *("full", "rank16", "rank12", "rank8", "window10", "window8", "window6"),
    *("window8+rank16", "window8+rank12", "window6+rank12"),
)
"""Forms that are trained; `full` is the control."""

QUICK_FORMS = ("full", "rank16", "window8+rank16")
"""Forms of a quick run."""

FURTHER = "further"
"""Name of the whole network after as many more steps."""


def planned(model: Model, names: Sequence[str], steps: int) -> dict[str, Variant]:
    """Return the forms that this model can have, by the names of variants, not trained yet."""
    found = {}
    for name in names_for(model, names):
        varied = variants.vary(variants.parse(name), model)
        text = f"{'the whole network' if varied.is_full else name}, trained for {steps} steps more"
        shown = FURTHER if varied.is_full else name
        found[name] = Variant(shown, text, varied.rank, model=varied.model, steps=steps)
    return found


def folder_of(model: Model, output: Path) -> Path:
    """Return the folder of a model's forms, in that of the results."""
    return output / f"forms-{digest_of(model)[:12]}"


def trained(
    model: Model, forms: dict[str, Variant], pairs: Sequence[tuple[Frame, Frame]], folder: Path, executor: str
) -> list[Variant]:
    """Return the forms after training on pairs of frames, which is done where the folder lacks it."""
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for name, form in forms.items():
        path = folder / f"{name}.safetensors"
        begin = start_of(model, name, form.steps, pairs)
        state = _kept(train.checkpoint_path(path), begin)
        if state.step < form.steps or not path.exists():
            say(f"form {form.name}: {form.steps - state.step} steps")
            train.fit(begin.recipe, pairs, path, state, executor=executor)
        found.append(replace(form, model=load_model(path)))
    return found


def start_of(model: Model, name: str, steps: int, pairs: Sequence[tuple[Frame, Frame]]) -> TrainState:
    """Return the state of a form before its first step, on the model's own scales."""
    recipe, network = train.varied(recipe_of(model, steps), model, name)
    scales = model.normalization
    data = dataset.build(pairs, recipe.features, recipe.window, scales)
    return start(recipe, scales, data.digest, network=network)


def recipe_of(model: Model, steps: int) -> Recipe:
    """Return the recipe that a model was trained by, or the best preset, with other steps."""
    text = model.info.get("recipe")
    known = recipe_from_json(text) if text else PRESETS["best"]
    # Another seed than that of the model's own training.
    return replace(known, steps=steps, seed=2, log_every=max(1, min(known.log_every, steps)))


def _kept(path: Path, begin: TrainState) -> TrainState:
    """Return the state of an earlier run of the same recipe on the same frames, or the first one."""
    with suppress(InputError):
        found = load_checkpoint(path)
        if (found.recipe, found.digest, found.normalization) == (
            begin.recipe,
            begin.digest,
            begin.normalization,
        ):
            return found
    return begin
