"""`wamnet bench`: speed against error of all kernels, forms of the network and peers that are installed."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..refimpl.errors import InputError
from . import bench_report, machine, packages
from .inputs import load_model, need_layers
from .options import ExecutorName, parse_names
from .outputs import check_output, replacing, unwritable, write_text
from .terminal import hint_on_interrupt, progress, say, table

if TYPE_CHECKING:
    from ..kernels.bench.contest import Contest, Request
    from ..refimpl.denoise import Model
    from ..refimpl.frame import Frame

EXAMPLES = """Examples:

wamnet bench -o speed

wamnet bench model.safetensors --dataset cubes -o speed

wamnet bench --quick --only 'opencl:*,torch.compile' -o speed

wamnet bench --size 512 --sizes 256,512,1024,2048,4096 --repeats 3 -o speed"""
"""Shown below the help of `wamnet bench`."""

PEER_PACKAGES = ("torch", "onnxruntime", "onnx", "tinygrad", "pyoidn")
"""Packages of peers whose versions the result names."""

QUICK = {"size": 256, "repeats": 3, "budget": 4.0}
"""What --quick takes for options that are not given: some 25 s on two cores."""

USUAL = {"size": 1024, "repeats": 5, "budget": 30.0}
"""What is taken otherwise: the paper's size of picture."""

MOST_REPEATS = 1000
"""More rounds than anybody waits for; a typing error is told before."""

JSON_NAME, TEXT_NAME = "bench.json", "bench.md"
"""Files of the result in the output folder, besides the plots."""


ModelFile = Annotated[
    Path | None,
    typer.Argument(
        metavar="MODEL",
        help="Trained model (.safetensors); without one the paper's network, untrained.",
        show_default=False,
    ),
]
Folder = Annotated[Path, typer.Option("-o", "--output", metavar="FOLDER", help="Folder of the results.")]
DataSet = Annotated[
    Path | None,
    typer.Option(
        metavar="FOLDER",
        help="Data set on whose test frames quality is measured; needs MODEL.",
        show_default=False,
    ),
]
Size = Annotated[
    int | None, typer.Option(help="Width and height of the picture.", show_default="1024; quick: 256")
]
Sizes = Annotated[
    str, typer.Option(metavar="N,N,...", help="Further sizes: how cost grows.", show_default="none")
]
Only = Annotated[
    str,
    typer.Option(
        metavar="NAME,...", help="Only these; * stands for any letters.", show_default="all there are"
    ),
]
Executors = Annotated[
    list[ExecutorName] | None,
    typer.Option(
        help="Only the kernels of this executor, beside the peers; repeat for more.", show_default="all"
    ),
]
Features = Annotated[
    str,
    typer.Option(
        metavar="NAME,...",
        help="What the network sees that is taken without MODEL.",
        show_default="color,normal: the paper's",
    ),
]
Repeats = Annotated[
    int | None, typer.Option(help="Rounds; in each, all take turns.", show_default="5; quick: 3")
]
Budget = Annotated[
    float | None,
    typer.Option(
        metavar="S",
        help="Seconds that one of them may take at one size; what is slower takes fewer turns, or none.",
        show_default="30; quick: 4",
    ),
]
FirstRuns = Annotated[
    bool, typer.Option("--first-runs", help="Also measure compilation with empty caches on disk.")
]
Quick = Annotated[bool, typer.Option("--quick", help="A reduced run: one schedule a device, few peers.")]


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
    first_runs: FirstRuns = False,
    quick: Quick = False,
) -> None:
    r"""Measure speed against error: kernels, schedules, forms of the network, and peers, in turns in one run.

    Peers that are installed take part: PyTorch, ONNX Runtime, tinygrad on the same OpenCL device, and Open
    Image Denoise, which is another denoiser. [bold]pip install 'wamnet\[peers]'[/] brings them. Errors are
    against the full network in float64. Predictions come from operations, sines and bytes and the machine's
    measured rates.
    """
    packages.need("matplotlib", "for the plots", "report")
    check_folder(output)
    usual = QUICK if quick else USUAL
    request = _request(
        model,
        dataset,
        parse_names(features),
        size=int(usual["size"] if size is None else size),
        sizes=_sizes(sizes),
        repeats=int(usual["repeats"] if repeats is None else repeats),
        budget_s=usual["budget"] if budget is None else budget,
        quick=quick,
        first_runs=first_runs,
    )
    data = measure(request, parse_names(only), [name.value for name in executor or []], output)
    tell(data, output)


def measure(
    request: Request,
    only: Sequence[str] = (),
    executors: Sequence[str] = (),
    output: Path | None = None,
    command: str = "",
) -> dict[str, Any]:
    """Return what a benchmark finds, and write it into the folder `output`, also after an interrupt."""
    from ..kernels.bench import contenders
    from ..kernels.bench.contender import Tools
    from ..kernels.bench.contest import Contest

    with Tools() as tools, progress("measuring", 1.0) as advance:
        everybody = contenders.of_machine(tools, request.size, request.quick and not only)
        taking_part = contenders.chosen(everybody, only, executors)
        if output:
            make_folder(output)
        contest = Contest(request, taking_part, tools, told=lambda what, share: advance(share))
        hint = f"what was measured until then is in {output}" if output else "nothing is kept"
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


def _request(model: Path | None, folder: Path | None, features: Sequence[str], **numbers: Any) -> Request:
    """Return what is to be measured, or refuse it."""
    from ..kernels.bench import workload
    from ..kernels.bench.contest import Request

    check_numbers(numbers)
    if model is not None and features:
        rule = "a model says itself what it sees"
        raise InputError("--features", ",".join(features), rule, "leave it out")
    network = load_model(model) if model else workload.paper_model(features or workload.FEATURES)
    return Request(network, pairs=_pairs(model, network, folder), **numbers)


def _pairs(path: Path | None, model: Model, folder: Path | None) -> tuple[tuple[Frame, Frame], ...]:
    """Return the unseen frames of a data set with their references."""
    from . import dataset_files

    if folder is None:
        return ()
    if path is None:
        rule = "the quality of a network that is not trained says nothing"
        raise InputError("--dataset", str(folder), rule, "give MODEL too, or leave it out")
    pairs = dataset_files.read_pairs(folder, "test")
    if not pairs:
        raise InputError("data set", str(folder), "it has no test frames", "make one with --test 1")
    for noisy, _ in pairs:
        need_layers(folder, noisy, model.features, "the model was trained with it", "make another data set")
    return tuple(pairs)


def check_numbers(numbers: dict[str, Any]) -> None:
    """Refuse numbers that no run can have."""
    from ..kernels.bench.workload import check_size

    for size in (numbers["size"], *numbers["sizes"]):
        check_size(size)
    if not 1 <= numbers["repeats"] <= MOST_REPEATS:
        rule = f"it must be from 1 to {MOST_REPEATS}"
        raise InputError("--repeats", numbers["repeats"], rule, "for example --repeats 5")
    if not 0.0 < numbers["budget_s"] < float("inf"):
        raise InputError("--budget", numbers["budget_s"], "it must be positive and finite", "give seconds")


def _sizes(text: str) -> tuple[int, ...]:
    """Return the sizes in a text like 256,512."""
    try:
        return tuple(int(part) for part in parse_names(text))
    except ValueError:
        rule = "it must be whole numbers with commas"
        raise InputError("--sizes", text, rule, "for example --sizes 256,512,1024") from None


def check_folder(output: Path) -> None:
    """Refuse an output folder in which the results cannot be written."""
    if output.exists() and not output.is_dir():
        raise InputError("output folder", str(output), "it is a file", "choose another with -o")
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
