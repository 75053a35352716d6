"""The project's own answers through the same door: `python -m wamnet.spec.conformance.program`.

--executor reference   the reference in float64
--executor NAME        kernels on an executor (on_executor.py), or exported ones on what runs them here
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TextIO

from ...refimpl.errors import CompileError, ExecutorUnavailable, InputError
from .case import check_integers, given
from .kinds import KINDS
from .numbers import to_json

Answer = Callable[[str, Mapping[str, Any], str], Mapping[str, Any]]
"""(kind, inputs, profile) -> outputs."""

REFERENCE = "reference"
"""Name of the program that is the reference."""


def serve(requests: Iterable[str], answers: TextIO, name: str, kinds: Sequence[str], answer: Answer) -> None:
    """Answer each request with a line."""
    for line in requests:
        request = json.loads(line)
        kind, found = request["kind"], {"id": request.get("id")}
        if kind == "hello":
            found = {"program": name, "kinds": list(kinds)}
        elif kind not in kinds:
            found["unsupported"] = f"no kind {kind}"
        else:
            try:
                found["output"] = to_json(dict(answer(kind, request["input"], request["profile"])))
            except (InputError, CompileError) as error:
                found["refused"] = str(error)
        answers.write(json.dumps(found) + "\n")
        answers.flush()


def of_reference(kind: str, inputs: Mapping[str, Any], profile: str) -> Mapping[str, Any]:
    """Return the reference's answer."""
    check_integers(KINDS[kind], inputs)
    return KINDS[kind].answer({name: given(value) for name, value in inputs.items()})


def main(arguments: Sequence[str] | None = None) -> None:
    """Serve standard input."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--executor", default=REFERENCE)
    options = parser.parse_args(arguments)
    if options.executor == REFERENCE:
        serve(sys.stdin, sys.stdout, "wamnet, reference", list(KINDS), of_reference)
        return
    from ...kernels import open_executor
    from ...kernels.export.targets import RUNNERS
    from .on_executor import OnExecutor

    try:
        opened = RUNNERS[options.executor]() if options.executor in RUNNERS else None
        with opened or open_executor(options.executor) as executor:
            answers = OnExecutor(executor)
            name = f"wamnet, {options.executor} ({executor.device})"
            serve(sys.stdin, sys.stdout, name, answers.kinds, answers.answer)
    except ExecutorUnavailable as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
