"""`wamnet bench`: speed against error of all kernels, forms of the network and peers that are installed."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...refimpl.errors import NO_VALUE, InputError
from ..common import packages
from ..common.effort import said_of_measuring
from ..common.executors import fastest
from ..common.inputs import load_model, trained_scene
from ..common.options import ExecutorName, parse_names
from ..common.terminal import hint_on_interrupt, progress, say, table
from ..files.alone import working_in
from ..files.outputs import check_output, replacing, unwritable, write_text
from ..reports import bench_report, machine
from . import bench_forms, bench_frames
from .bench_frames import Frames

if TYPE_CHECKING:
    from ...kernels.bench.contender import Variant
    from ...kernels.bench.contest import Contest, Request
    from ...refimpl.network.denoise import Model

EXAMPLES = """Examples:

wamnet bench -o speed

wamnet bench --train-variants --size 512 -o speed

wamnet bench model.safetensors --dataset cubes -o speed

wamnet bench --quick --only 'opencl:*,torch.compile' -o speed

wamnet bench --synthetic --size 512 --sizes 256,512,1024,2048,4096 --repeats 3 -o speed"""
"""Shown below the help of `wamnet bench`."""

PEER_PACKAGES = ("torch", "onnxruntime", "onnx", "openvino", "tinygrad", "halide", "pyoidn")
"""Packages of peers whose versions the result names."""

QUICK = {"size": 256, "repeats": 3, "budget": 4.0, "frames": 2, "reference_spp": 64, "steps": 500}
"""What --quick takes for options that are not given: some 25 s on two cores."""

USUAL = {"size": 1024, "repeats": 5, "budget": 30.0, "frames": 4, "reference_spp": 256, "steps": 3000}
"""What is taken otherwise: the paper's size of picture."""

SHIPPED = "minicubes"
"""Model that is measured when none is named."""

PAPER = "paper"
"""Name of the paper's network with its initial weights; a model of this name is measured on noise."""

MOST_FRAMES = 100
"""More test frames than anybody waits for."""

MOST_REPEATS = 1000
"""More rounds than anybody waits for; a typing error is refused before."""

JSON_NAME, TEXT_NAME = "bench.json", "bench.md"
"""Files of the result in the output folder, in addition to the plots."""


ModelFile = Annotated[
    Path | None,
    typer.Argument(
        metavar="MODEL",
        help="Trained model (.safetensors) or bundled model; paper: the paper's network, untrained, "
        "on noise.",
        show_default=SHIPPED,
    ),
]
Folder = Annotated[Path, typer.Option("-o", "--output", metavar="FOLDER", help="Output folder.")]
DataSet = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Data set to measure on (its test frames).",
        show_default="frames of the model's scene, rendered into the output folder",
    ),
]
Size = Annotated[
    int | None,
    typer.Option(help="Width and height of the image, in pixels.", show_default="1024; quick: 256"),
]
Sizes = Annotated[
    str,
    typer.Option(
        metavar="N,N,...", help="Further image sizes, to show how the cost scales.", show_default="none"
    ),
]
Only = Annotated[
    str,
    typer.Option(
        metavar="NAME,...", help="Run only these; * matches any characters.", show_default="all available"
    ),
]
Executors = Annotated[
    list[ExecutorName] | None,
    typer.Option(help="Run only this backend's kernels, and the baselines. Repeatable.", show_default="all"),
]
Features = Annotated[
    str,
    typer.Option(
        metavar="NAME,...",
        help="Input features of the untrained network of --synthetic.",
        show_default="color,normal, as in the paper",
    ),
]
Repeats = Annotated[
    int | None, typer.Option(help="Number of interleaved rounds.", show_default="5; quick: 3")
]
Budget = Annotated[
    float | None,
    typer.Option(
        metavar="S",
        help="Time budget per program and size, in seconds; slower ones get fewer repetitions, or none.",
        show_default="30; quick: 4",
    ),
]
FirstRuns = Annotated[
    bool, typer.Option("--first-runs", help="Also measure compilation with empty disk caches.")
]
Synthetic = Annotated[
    bool,
    typer.Option(
        "--synthetic",
        help="Use noise instead of frames, to measure times only; without MODEL, with the paper's "
        "untrained network.",
    ),
]
TrainVariants = Annotated[
    bool,
    typer.Option(
        "--train-variants",
        help="Also benchmark low-rank and small-window variants, fine-tuned from the model and "
        "cached in the folder.",
    ),
]
Steps = Annotated[
    int | None, typer.Option(help="Fine-tuning steps per variant.", show_default="3000; quick: 500")
]
TestFrames = Annotated[
    int | None,
    typer.Option("--frames", help="Number of test frames to render.", show_default="4; quick: 2"),
]
ReferenceSpp = Annotated[
    int | None,
    typer.Option(help="Paths per pixel of the reference images.", show_default="256; quick: 64"),
]
Quick = Annotated[
    bool, typer.Option("--quick", help="Reduced run: one schedule per device and few baselines.")
]


def bench(
    model: ModelFile = None,
    output: Folder = Path("wamnet-bench"),
    dataset: DataSet = None,
    size: Size = None,
    sizes: Sizes = "",
    only: Only = "",
    executor: Executors = None,
    features: Features = "",
    repeats: Repeats = None,
    budget: Budget = None,
    synthetic: Synthetic = False,
    train_variants: TrainVariants = False,
    steps: Steps = None,
    frames: TestFrames = None,
    reference_spp: ReferenceSpp = None,
    first_runs: FirstRuns = False,
    quick: Quick = False,
) -> None:
    """Measure speed against error: kernels, schedules, variants of the network, and baselines.

    All programs are interleaved, so that drift of the machine affects them alike.

    The bundled mini-cubes model is measured on unseen frames of its scene; another model on its training
    scene or a data set. Installed baselines are included: PyTorch, ONNX Runtime, OpenVINO, Halide,
    tinygrad, and Open Image Denoise: [bold]pip install torch onnxruntime openvino halide tinygrad
    pyoidn[/]. Errors are measured against float64, PSNR against the references. Predicted times follow from
    measured rates.
    """
    packages.need("matplotlib", "for the plots")
    check_folder(output)
    usual = QUICK if quick else USUAL
    given = {"frames": frames, "reference_spp": reference_spp, "steps": steps}
    counts = {name: int(usual[name] if value is None else value) for name, value in given.items()}
    check_counts(counts)
    what = Wanted(model, dataset, parse_names(features), synthetic, train_variants)
    name, network = what.network()
    numbers: dict[str, Any] = {
        "size": int(usual["size"] if size is None else size),
        "sizes": _sizes(sizes),
        "repeats": int(usual["repeats"] if repeats is None else repeats),
        "budget_s": usual["budget"] if budget is None else budget,
    }
    check_numbers(numbers)
    what.check(network)
    executors = [each.value for each in executor or []]
    taking_part = parse_names(only), executors
    forms = _forms(network, train_variants, quick, counts["steps"])
    forms = _needed(forms, *taking_part, size=numbers["size"], quick=quick)
    with working_in(output, "measuring"):
        with hint_on_interrupt(lambda: f"{output}: the same command resumes"):
            shown = what.frames(network, output, numbers["size"], counts)
            trained = what.train(network, forms, output)
        request = _request(name, network, shown, quick=quick, first_runs=first_runs, **numbers)
        tell(measure(request, *taking_part, output, forms=trained), output)


@dataclass(frozen=True)
class Wanted:
    """What a caller wants measured: a model or none, a data set or none, and whether forms are trained."""

    model: Path | None
    dataset: Path | None
    features: Sequence[str]
    synthetic: bool
    trains: bool

    @property
    def on_noise(self) -> bool:
        """Return whether noise is denoised."""
        return self.synthetic or self.is_paper

    @property
    def is_paper(self) -> bool:
        """Return whether the network is the paper's, with its initial weights."""
        return str(self.model) == PAPER or (self.synthetic and self.model is None)

    def network(self) -> tuple[str, Model]:
        """Return the model and its name, or refuse features that do not go with it."""
        from ...kernels.bench import workload

        if self.is_paper:
            return PAPER, workload.paper_model(self.features or workload.FEATURES)
        if self.features:
            rule = "a trained model says itself what it sees"
            raise InputError("--features", ",".join(self.features), rule, "leave it out, or use --synthetic")
        path = self.model or Path(SHIPPED)
        return path.name, load_model(path)

    def check(self, network: Model) -> None:
        """Refuse what needs frames where there are none."""
        if self.on_noise and self.dataset is not None:
            rule = "noise is measured in its place"
            raise InputError("--dataset", str(self.dataset), rule, "leave it out, or name a trained model")
        if self.trains and (self.on_noise or not self._has_frames(network)):
            rule = "forms are trained on frames, and there are none"
            raise InputError("--train-variants", NO_VALUE, rule, "name a trained model, and its --dataset")

    def _has_frames(self, network: Model) -> bool:
        """Return whether there is a data set, or a scene to render."""
        return self.dataset is not None or trained_scene(network) is not None

    def frames(self, network: Model, output: Path, size: int, counts: dict[str, int]) -> Frames:
        """Return the frames that are measured; none where it is noise, which is said."""
        if self.on_noise:
            return Frames()
        if self.dataset is not None:
            return bench_frames.of_folder(self.dataset, network)
        if trained_scene(network) is None:
            say("no frames: the model does not name one canonical scene; give --dataset")
            return Frames()
        return bench_frames.rendered(network, output, size, counts["frames"], counts["reference_spp"])

    def train(self, network: Model, forms: dict[str, Variant], output: Path) -> list[Variant]:
        """Return the forms, trained."""
        if not forms:
            return []
        if self.dataset is not None:
            pairs = bench_frames.of_folder(self.dataset, network, "train").pairs
        else:
            pairs = tuple(bench_frames.for_training(network, output))
        folder = bench_forms.folder_of(network, output)
        return bench_forms.trained(network, forms, pairs, folder, fastest(trains=True, work="trainer"))


def _forms(network: Model, wanted: bool, quick: bool, steps: int) -> dict[str, Variant]:
    """Return the forms that are to be trained."""
    names = bench_forms.QUICK_FORMS if quick else bench_forms.FORMS
    return bench_forms.planned(network, names, steps) if wanted else {}


def _needed(
    forms: dict[str, Variant], only: Sequence[str], executors: Sequence[str], size: int, quick: bool
) -> dict[str, Variant]:
    """Return the forms that take part; refuse names that nobody has before anything is rendered."""
    from ...kernels.bench import contenders
    from ...kernels.bench.contender import Tools

    with Tools() as tools:
        everybody = contenders.of_machine(tools, size, quick and not only, list(forms.values()))
    found = {each.variant for each in contenders.chosen(everybody, only, executors)}
    return {name: form for name, form in forms.items() if form in found}


def measure(
    request: Request,
    only: Sequence[str] = (),
    executors: Sequence[str] = (),
    output: Path | None = None,
    command: str = "",
    forms: Sequence[Variant] = (),
) -> dict[str, Any]:
    """Return what a benchmark finds, and write it into the folder `output`, also after an interrupt."""
    from ...kernels.bench import contenders
    from ...kernels.bench.contender import Tools
    from ...kernels.bench.contest import Contest

    with Tools() as tools, progress("measuring", 1.0) as advance:
        everybody = contenders.of_machine(tools, request.size, request.quick and not only, forms)
        taking_part = contenders.chosen(everybody, only, executors)
        sizes = sorted({request.size, *request.sizes})
        for line in said_of_measuring(len(taking_part), sizes, request.budget_s):
            say(line)
        if output:
            make_folder(output)
        contest = Contest(request, taking_part, tools, told=lambda what, share: advance(share))
        hint = f"{output}: has the results so far" if output else "nothing is kept"
        with hint_on_interrupt(lambda: hint):
            try:
                contest.run()
            except KeyboardInterrupt:
                if output:
                    write(_finished(contest, command, interrupted=True), output)
                raise
    data = _finished(contest, command, interrupted=False)
    if output:
        write(data, output)
    return data


def _finished(contest: Contest, command: str, interrupted: bool) -> dict[str, Any]:
    """Return a contest's data with what is known of the run."""
    text = command or " ".join(["wamnet", *map(shlex.quote, sys.argv[1:])])
    return {
        **contest.as_data(),
        "command": text,
        "interrupted": interrupted,
        "machine": machine.describe(),
        "versions": machine.versions(PEER_PACKAGES),
    }


def _request(name: str, network: Model, frames: Frames, **numbers: Any) -> Request:
    """Return what is to be measured."""
    from ...kernels.bench.contest import Request

    facts = frames.as_data() if frames.pairs else {}
    return Request(network, pairs=frames.pairs, frames=facts, name=name, **numbers)


def check_counts(counts: dict[str, int]) -> None:
    """Refuse numbers of frames, samples and steps that make none."""
    most = {"frames": MOST_FRAMES, "reference_spp": 1 << 20, "steps": 1 << 20}
    for name, value in counts.items():
        if not 1 <= value <= most[name]:
            option = f"--{name.replace('_', '-')}"
            rule = f"must be from 1 to {most[name]}"
            raise InputError(option, value, rule, f"for example {option} {USUAL[name]}")


def check_numbers(numbers: dict[str, Any]) -> None:
    """Refuse numbers that no run can have."""
    from ...kernels.bench.workload import check_size

    for size in (numbers["size"], *numbers["sizes"]):
        check_size(size)
    if not 1 <= numbers["repeats"] <= MOST_REPEATS:
        rule = f"must be from 1 to {MOST_REPEATS}"
        raise InputError("--repeats", numbers["repeats"], rule, "for example --repeats 5")
    if not 0.0 < numbers["budget_s"] < float("inf"):
        raise InputError("--budget", numbers["budget_s"], "must be positive and finite", "give seconds")


def _sizes(text: str) -> tuple[int, ...]:
    """Return the sizes in a text like 256,512."""
    try:
        return tuple(int(part) for part in parse_names(text))
    except ValueError:
        rule = "must be integers with commas"
        raise InputError("--sizes", text, rule, "for example --sizes 256,512,1024") from None


def check_folder(output: Path) -> None:
    """Refuse an output folder in which the results cannot be written."""
    if output.exists() and not output.is_dir():
        raise InputError("output folder", str(output), "is a file", "choose another with -o")
    if output.is_dir():
        for name in (JSON_NAME, TEXT_NAME):
            check_output(output / name)


def make_folder(output: Path) -> None:
    """Make the output folder, before anything is measured."""
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise unwritable(output, error, "output folder") from None


def write(data: dict[str, Any], output: Path) -> None:
    """Write the result as JSON, Markdown and plots into a folder."""
    write_text(output / JSON_NAME, json.dumps(data, indent=1, allow_nan=False) + "\n")
    drawn = bench_report.draw(data, bench_report.PRINTED)
    for name, picture in drawn.items():
        with replacing(output / f"bench-{name}.png") as new:
            new.write_bytes(picture)
    write_text(output / TEXT_NAME, bench_report.markdown(data, [f"bench-{name}.png" for name in drawn]))


def tell(data: dict[str, Any], output: Path) -> None:
    """Print the table, what was left out, and where the results are."""
    heads, rows = bench_report.short_table(data)
    table(f"{data['size_px']}x{data['size_px']}", heads, rows)
    for line in bench_report.notes(data):
        say(line)
    say(f"results: {output / JSON_NAME}, {output / TEXT_NAME}")
