"""`wamnet bench`: speed against error of all kernels, forms of the network and peers that are installed."""

import json
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...kernels.bench import contenders, workload
from ...kernels.bench.contenders import Tools, Variant
from ...kernels.bench.contest import Contest, Request
from ...kernels.bench.workload import check_size
from ...refimpl.errors import NO_VALUE, InputError
from ...refimpl.network.denoise import Model
from ..common import packages
from ..common.executors import chosen
from ..common.inputs import load_model, trained_scene
from ..common.options import ExecutorName, parse_names
from ..common.terminal import hint_on_interrupt, progress, say, table
from ..files.alone import working_in
from ..files.outputs import check_output, replacing, visible, write_text
from ..reports import bench_report, machine
from . import bench_frames
from .bench_frames import Frames

QUICK = {"size": 256, "repeats": 3, "budget": 4.0, "frames": 2, "reference_spp": 64, "steps": 500}
"""What --quick takes for options that are not given: some 25 s on two cores."""

USUAL = {"size": 1024, "repeats": 5, "budget": 30.0, "frames": 4, "reference_spp": 256, "steps": 3000}
"""What is taken otherwise: the paper's size of picture."""

SHIPPED = "minicubes"
"""Model that is measured when none is named."""

PAPER = "paper"
"""Name of the paper's network with its initial weights; a model of this name is measured on noise."""

JSON_NAME, TEXT_NAME = "bench.json", "bench.md"
"""Files of the result in the output folder, in addition to the plots."""


@dataclass(frozen=True)
class Wanted:
    """What a caller wants measured; a number that is not given is that of `QUICK` or `USUAL`."""

    model: Path | None = None
    output: Path = Path("wamnet-bench")
    dataset: Path | None = None
    size: int | None = None
    sizes: str = ""
    only: str = ""
    executor: list[ExecutorName] | None = None
    features: str = ""
    repeats: int | None = None
    budget: float | None = None
    synthetic: bool = False
    train_variants: bool = False
    steps: int | None = None
    frames: int | None = None
    reference_spp: int | None = None
    first_runs: bool = False
    quick: bool = False

    def number(self, name: str) -> Any:
        """Return a number that is given, or the usual one."""
        given = getattr(self, name)
        return (QUICK if self.quick else USUAL)[name] if given is None else given

    @property
    def parties(self) -> tuple[Sequence[str], Sequence[str]]:
        """Return the patterns of names and the executors that take part; empty: all."""
        return parse_names(self.only), [each.value for each in self.executor or []]

    @property
    def all_sizes(self) -> tuple[int, ...]:
        """Return the size, and the further ones."""
        try:
            return self.number("size"), *map(int, parse_names(self.sizes))
        except ValueError:
            rule = "must be integers with commas"
            raise InputError("--sizes", self.sizes, rule, "for example --sizes 256,512,1024") from None

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
        if self.is_paper:
            return PAPER, workload.paper_model(parse_names(self.features) or workload.FEATURES)
        if self.features:
            rule = "a trained model says itself what it sees"
            raise InputError("--features", self.features, rule, "leave it out, or use --synthetic")
        path = self.model or Path(SHIPPED)
        return path.name, load_model(path)

    def check(self, network: Model) -> None:
        """Refuse what needs frames where there are none."""
        if self.on_noise and self.dataset is not None:
            rule = "noise is measured in its place"
            raise InputError("--dataset", str(self.dataset), rule, "leave it out, or name a trained model")
        has_frames = not self.on_noise and (self.dataset is not None or trained_scene(network) is not None)
        if self.train_variants and not has_frames:
            rule = "forms are trained on frames, and there are none"
            raise InputError("--train-variants", NO_VALUE, rule, "name a trained model, and its --dataset")

    def pairs(self, network: Model) -> Frames:
        """Return the frames that are measured; none where it is noise, which is said."""
        if self.on_noise:
            return Frames()
        if self.dataset is not None:
            return bench_frames.of_folder(self.dataset, network)
        if trained_scene(network) is None:
            say("no frames: the model does not name one canonical scene; give --dataset")
            return Frames()
        numbers = (self.number(name) for name in ("size", "frames", "reference_spp"))
        return bench_frames.rendered(network, self.output, *numbers)

    def forms(self, network: Model) -> dict[str, Variant]:
        """Return the forms that are to be trained and take part; refuse names that nobody has."""
        names = bench_frames.QUICK_FORMS if self.quick else bench_frames.FORMS
        planned = bench_frames.planned(network, names if self.train_variants else (), self.number("steps"))
        with Tools() as tools:
            quick = self.quick and not self.only
            everybody = contenders.of_machine(tools, self.number("size"), quick, list(planned.values()))
        found = {each.variant for each in contenders.chosen(everybody, *self.parties)}
        return {name: form for name, form in planned.items() if form in found}

    def train(self, network: Model, forms: dict[str, Variant]) -> list[Variant]:
        """Return the forms, trained."""
        if not forms:
            return []
        if self.dataset is not None:
            pairs = bench_frames.of_folder(self.dataset, network, "train").pairs
        else:
            pairs = tuple(bench_frames.for_training(network, self.output))
        folder = bench_frames.folder_of(network, self.output)
        return bench_frames.trained(network, forms, pairs, folder, chosen(trains=True, work="trainer"))

    def request(self, name: str, network: Model, frames: Frames) -> Request:
        """Return what is to be measured."""
        size, *sizes = self.all_sizes
        facts = frames.as_data() if frames.pairs else {}
        numbers = (self.number("repeats"), tuple(sizes), frames.pairs, facts, name, self.number("budget"))
        return Request(network, size, *numbers, quick=self.quick, first_runs=self.first_runs)


def bench(wanted: Wanted) -> None:
    """Measure speed against error: kernels, schedules, variants of the network, and baselines."""
    packages.need("matplotlib", "for the plots")
    output = wanted.output
    for name in (JSON_NAME, TEXT_NAME) if visible(output) or output.exists() else ():
        check_output(output / name)
    for size in wanted.all_sizes:
        check_size(size)
    name, network = wanted.network()
    wanted.check(network)
    forms = wanted.forms(network)
    with working_in(output, "measuring"):
        with hint_on_interrupt(lambda: f"{output}: the same command resumes"):
            shown = wanted.pairs(network)
            trained = wanted.train(network, forms)
        request = wanted.request(name, network, shown)
        tell(measure(request, *wanted.parties, output, forms=trained), output)


def measure(
    request: Request,
    only: Sequence[str] = (),
    executors: Sequence[str] = (),
    output: Path | None = None,
    command: str = "",
    forms: Sequence[Variant] = (),
) -> dict[str, Any]:
    """Return what a benchmark finds, and write it into the folder `output`, also after an interrupt."""
    with Tools() as tools, progress("measuring", 1.0) as advance:
        everybody = contenders.of_machine(tools, request.size, request.quick and not only, forms)
        taking_part = contenders.chosen(everybody, only, executors)
        contest = Contest(request, taking_part, tools, told=advance)
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
    peers = ("torch", "onnxruntime", "onnx", "openvino", "tinygrad", "halide", "pyoidn")
    return {
        **contest.as_data(),
        "command": text,
        "interrupted": interrupted,
        "machine": machine.describe(),
        "versions": machine.versions(peers),
    }


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
    heads, rows = bench_report.speed_table(data)
    # A terminal has no room for more.
    kept = [k for k, head in enumerate(heads) if head not in ("range", "frames/s", "compile, s")]
    shown = [tuple(row[k] for k in kept) for row in rows]
    table(f"{data['size_px']}x{data['size_px']}", [heads[k] for k in kept], shown)
    for line in bench_report.notes(data):
        say(line)
    say(f"results: {output / JSON_NAME}, {output / TEXT_NAME}")
