"""`wamnet certify`: check a certificate and the text beside it, and show where the error comes from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ...refimpl.errors import InputError
from ...refimpl.reading import read_file
from ..common.packages import need
from ..common.terminal import say, table

EXAMPLES = """Examples:

wamnet certify kernel-opencl/denoise.certificate.json

wamnet certify kernel-opencl

wamnet certify kernel-c --source denoise-mine.h"""
"""Shown below the help of `wamnet certify`."""

STATUS_REFUSED = 1
"""Exit status when a step of a certificate does not hold; others end in 2, as bad files do."""


def certify(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A denoise.certificate.json, or the folder of its kernel.",
            show_default=False,
        ),
    ],
    source: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Read this text in place of the kernel's own: one that was changed by hand."
        ),
    ] = None,
    text: Annotated[
        bool, typer.Option(help="Read the kernel's text too: does it compute the certified program?")
    ] = True,
) -> None:
    """Check the proof of a kernel's error bound, step by step, and that its text computes what was proven.

    The checker derives every number again, from the weights and the program, and shows what each layer adds.
    A reader then runs the text on unknowns, for pixels of pictures of any size, and compares every sum and
    every operation with the program's. Both share no code with the compiler. Status 0: all steps hold; 1: one
    does not, which is named; 2: the file is not a certificate.
    """
    from ...compiler.artifact import CERTIFICATE_NAME
    from ...compiler.proof.checker import check
    from ...compiler.proof.evidence import INTEGERS, Refused

    path = file / CERTIFICATE_NAME if file.is_dir() else file
    if not path.is_file():
        rule = "no such file"
        raise InputError(
            "certificate", str(path), rule, "kernels of profile ieee have one; see wamnet compile"
        )
    if source is not None:
        if not text:
            raise InputError(
                "option --source", str(source), "with --no-text nothing is read", "leave one out"
            )
        read_file(source, "kernel", "name a text in the kernel's language")
    try:
        held = check(path)
        if held["schema"] == INTEGERS:
            table(*sums_table(held))
            say("holds: no operation rounds; every number is the reference's, for all images of integers")
        else:
            table(*layers_table(held))
            bound = max(held["bound"]["output"])
            say(f"holds: |output - reference| <= {bound:g} for all images in their ranges, {steps_of(bound)}")
        if text:
            say(text_of(path, source))
    except Refused as step:
        say(f"refused: {step}")
        raise typer.Exit(STATUS_REFUSED) from None


def text_of(path: Path, source: Path | None = None) -> str:
    """Say what the reader found of the text beside a certificate, or of `source`; `Refused` if wrong."""
    from ...compiler.reading.check import check_text
    from ...compiler.reading.lanes import Unread

    need("pcpp", "to read the texts of kernels", "cli")
    try:
        found = check_text(path, source)
    except Unread as error:
        return f"text: not checked: this reader does not know {error}"
    return f"text: computes that program: {found['sums']} sums, at {found['lanes']} places that stand for all"


def sums_table(held: Any) -> tuple[str, tuple[str, ...], list[list[str]]]:
    """Return title, heads and rows: how large a partial sum of each affine map may be, in any order."""
    rows = [
        [str(layer), f"{max(sums):.8g}", f"{max(sums) / 2**24:.3f}"]
        for layer, sums in enumerate(held["sums"].values())
    ]
    return "Sums of integers", ("layer", "largest partial sum", "of 2^24"), rows


def layers_table(held: Any) -> tuple[str, tuple[str, ...], list[list[str]]]:
    """Return title, heads and rows: what each layer makes itself, and how much of it reaches the outputs."""
    reaches = [output["layer_bounds"] for output in held["outputs"]]
    rows = []
    for number, layer in enumerate(held["layers"]):
        share = [f"{reach[number]:.2e}" for reach in reaches]
        own = f"{max(layer['rounding_bound']):.2e}"
        sine = f"{held['sine']['error_bound']:.2e}" if number + 1 < len(held["layers"]) else ""
        rows.append([str(number), f"{layer['argument_bound']:.4g}", own, sine, *share])
    rows.append(["all", "", "", "", *(f"{output['error_bound']:.2e}" for output in held["outputs"])])
    heads = ("layer", "values up to", "rounding", "sine", *(f"output {o['output']}" for o in held["outputs"]))
    return "Where the error comes from", heads, rows


def steps_of(bound: float) -> str:
    """Say how much this is of half an 8-bit step, which decides between two neighbouring levels."""
    return f"{bound * 510:.2g} of half an 8-bit step"
