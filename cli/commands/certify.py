"""`wamnet certify`: check a certificate and the text beside it, and show where the error comes from."""

from pathlib import Path
from typing import Any

import typer

from ...compiler.artifact import CERTIFICATE_NAME
from ...compiler.proof.checker import check
from ...compiler.proof.evidence import INTEGERS, Refused
from ...compiler.reading.check import check_text
from ...compiler.reading.lanes import Unread
from ...compiler.reading.trusted import trusted_lines
from ...refimpl.errors import InputError
from ...refimpl.reading import read_file
from ..common.terminal import STATUS_WRONG, progress, say, table

ASSUMED = (
    "assumed: compiler and device keep to the language's standard and IEEE 754's float32, rounded to "
    "nearest; the host calls the kernel as the manifest says, with finite values in the stated ranges"
)
"""What a verified source rests on."""


def certify(
    file: Path,
    source: Path | None = None,
    text: bool = True,
) -> None:
    """Check the proof of a kernel's error bound, and that its source computes the certified program."""
    inside = [file / CERTIFICATE_NAME, file / "denoise" / CERTIFICATE_NAME] if file.is_dir() else [file]
    path = next(filter(Path.is_file, inside), inside[0])
    if not path.is_file():
        raise InputError("certificate", str(path), "not found", "only kernels of profile ieee have one")
    if source is not None:
        if not text:
            raise InputError(
                "option --source", str(source), "with --no-text no source is checked", "leave one out"
            )
        read_file(source, "kernel", "name a text in the kernel's language")
    try:
        show(check(path))
        if text:
            with progress("checking the source", None):
                done = check_text(path, source)
            say(f"source: computes the certified program: {done['sums']} sums, at {done['lanes']} positions")
            say(f"trusted: {trusted_lines()} lines of Python, which import nothing of what writes kernels")
            say(ASSUMED)
    except Refused as step:
        say(f"rejected: {step}")
        raise typer.Exit(STATUS_WRONG) from None
    except Unread as error:
        say(f"source: not checked: the checker does not support {error}")
        raise typer.Exit(3) from None


def show(held: Any) -> None:
    """Print what a certificate proves, and its table."""
    if held["schema"] == INTEGERS:
        # A partial sum of each affine map, in any order.
        most = [max(each) for each in held["sums"].values()]
        sums = [(str(layer), f"{value:.8g}", f"{value / 2**24:.3f}") for layer, value in enumerate(most)]
        table("Sums of integers", ("layer", "largest partial sum", "of 2^24"), sums)
        say("holds: no operation rounds; every value equals the reference's, for all integer images")
        return
    # What each layer makes itself, and how much of it reaches the outputs.
    outputs, rows = held["outputs"], list[tuple[str, ...]]()
    for number, layer in enumerate(held["layers"]):
        share = [f"{output['layer_bounds'][number]:.2e}" for output in outputs]
        own = f"{max(layer['rounding_bound']):.2e}"
        sine = f"{held['sine']['error_bound']:.2e}" if number + 1 < len(held["layers"]) else ""
        rows.append((str(number), f"{layer['argument_bound']:.4g}", own, sine, *share))
    rows.append(("all", "", "", "", *(f"{output['error_bound']:.2e}" for output in outputs)))
    heads = ("layer", "values up to", "rounding", "sine", *(f"output {o['output']}" for o in outputs))
    table("Where the error comes from", heads, rows)
    # Half an 8-bit step decides between two neighbouring levels.
    bound = max(held["bound"]["output"])
    steps = f"{bound * 510:.2g} of half an 8-bit step"
    say(f"holds: |output - reference| <= {bound:g} for all images in their ranges, {steps}")
