"""What is proven of the kernels of the shipped models: bounds for all frames, and whether texts are checked.

    python experiments/certified.py
    python experiments/certified.py --models minicubes --only opencl:fft:16,c:tile:8

Each kernel is compiled, its certificate checked by the independent checker, and its text by the reader
[spec/certificate.md, spec/text.md]. A Markdown table is printed: the largest bound of an output, in steps of
8 bits too, seconds of the checks, and what the reader says. Status 1 if a check fails.
"""

import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from lab.command import described
from lab.tables import markdown

from wamnet.compiler.artifact import CERTIFICATE_NAME, write
from wamnet.compiler.compile import compile_plan
from wamnet.compiler.proof.checker import check
from wamnet.compiler.reading.check import check_text
from wamnet.compiler.reading.lanes import Unread
from wamnet.compiler.schedules.names import split
from wamnet.compiler.variants import FULL, plan_model
from wamnet.models.model_file import load_model

ROOT = Path(__file__).parents[1]

MODELS = ("minicubes", "cornell", "glossy")
"""The shipped models."""

KERNELS = (
    "opencl:plain", "opencl:tile:16", "opencl:fft:16", "opencl:plain:whole8", "opencl:dot:16:whole8",
    "opengl:plain", "c:plain", "c:tile:8", "c:fft:8", "c:plain:whole8", "c:dot:16:whole8", "wgsl:plain",
    "wgsl:group:4", "cuda:plain", "cuda:group:4", "opencl:tile:16:whole8", "cuda:groupdot:4:whole8",
    "wgsl:groupdot:4:whole8", "opencl:groupdot:4:whole8", "glsl-vulkan:groupdot:4:whole8",
    "opencl:tile:16:rank16", "opengl:plain:rank16", "cuda:group:4:rank16",
)  # fmt: skip
"""Targets, schedules and variants."""

HEADS = (
    "model",
    "target",
    "schedule",
    "variant",
    "bound, all frames",
    "8-bit steps",
    "check, s",
    "text",
    "reading, s",
)


def row(model: str, name: str, folder: Path) -> list[str]:
    """Return a row of the table: of one kernel."""
    target, schedule, variant = split(name)
    network = load_model(ROOT / "models" / f"{model}.safetensors")
    plan = plan_model(network, target, schedule, variant or FULL)
    write(compile_plan(plan), folder)
    begun = sum(os.times()[:4])
    bound = max(check(folder / CERTIFICATE_NAME)["bound"]["output"])
    checked = sum(os.times()[:4])
    try:
        found = check_text(folder / CERTIFICATE_NAME)
        text = f"computes it: {found['sums']} sums"
    except Unread as error:
        text = f"not checked: {error}"
    read = sum(os.times()[:4])
    proven = "0: the same bits" if bound == 0 else f"{bound:.2g}"
    seconds = [f"{checked - begun:.1f}", text, f"{read - checked:.1f}"]
    return [model, target, schedule, variant or FULL, proven, f"{bound * 255:.2f}", *seconds]


def rows(models: Sequence[str], kernels: Sequence[str]) -> Iterator[list[str]]:
    """Yield the rows of the table."""
    for model in models:
        for name in kernels:
            with TemporaryDirectory() as folder:
                yield row(model, name, Path(folder))


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = described(__doc__)
    parser.add_argument("--models", default=",".join(MODELS), help="shipped models")
    parser.add_argument(
        "--only", default=",".join(KERNELS), help="target:schedule or target:schedule:variant"
    )
    options = parser.parse_args(arguments)
    print(markdown(HEADS, list(rows(options.models.split(","), options.only.split(",")))))


if __name__ == "__main__":
    sys.exit(main())
