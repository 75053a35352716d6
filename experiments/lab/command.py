"""How every experiment begins: the same options, and errors as the `wamnet` command tells them.

1. `--scale` chooses among the sizes that the experiment offers; `-o` names the folder of its results; frames
   and networks that several experiments share lie in `--cache` [`parser`].
2. Records keep the command that made them, without its folders [`line`].
3. What a user can cause ends with one line on standard error and status 2; Ctrl-C with status 130 [`begin`].
"""

import argparse
import resource
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from wamnet.refimpl.errors import WamnetError

SCALES = ("small", "paper")
"""Minutes on two cores, or the paper's sizes."""

SEEDS = (0, 1, 2)
"""Seeds of the repetitions that the spread comes from."""

HIDDEN_SCALE = "toy"
"""A scale for tests: seconds, and numbers that mean nothing."""


FOLDERS = ("-o", "--output", "--cache")
"""Options that say where files are, not what is in them."""

SCRIPTS = "experiments"
"""The folder of the programs whose commands are kept."""


def line(arguments: Sequence[str] | None = None) -> str:
    """Return the command of this process as typed in the repository's root, without folders of results.

    Nothing is returned for a program outside the project, such as a test's. `arguments`: those of
    the process, its script first, unless they are given.
    """
    script, *rest = sys.argv if arguments is None else arguments
    path = Path(script)
    if path.suffix != ".py" or path.parent.name != SCRIPTS:
        return ""
    kept = [
        text
        for before, text in zip(["", *rest], rest, strict=False)
        if before not in FOLDERS and text.partition("=")[0] not in FOLDERS
    ]
    return shlex.join(["python", f"{path.parent.name}/{path.name}", *kept])


def described(text: str | None, **how: str) -> argparse.ArgumentParser:
    """Return a parser whose help is a module's docstring."""
    form = argparse.RawDescriptionHelpFormatter
    return argparse.ArgumentParser(description=text, formatter_class=form, **how)


def parser(text: str, name: str) -> argparse.ArgumentParser:
    """Return a parser with the options that all experiments have; `text` is the module's docstring."""
    made = described(text, prog=f"python experiments/{name}.py")
    made.add_argument(
        "--scale",
        choices=(*SCALES, HIDDEN_SCALE),
        default=SCALES[0],
        metavar="{small,paper}",
        help="minutes on two cores, or the paper's sizes",
    )
    made.add_argument("-o", "--output", type=Path, default=Path("out") / name, help="folder of the results")
    made.add_argument("--cache", type=Path, default=Path("out/lab"), help="folder of frames and networks")
    made.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS), help="what is repeated")
    made.add_argument(
        "--executor", choices=("opencl", "numpy"), default="opencl", help="what renders, trains and denoises"
    )
    return made


def begin(main: Callable[[Sequence[str] | None], None], arguments: Sequence[str] | None = None) -> None:
    """Run an experiment; tell errors in one line and leave with a status."""
    try:
        main(arguments)
    except WamnetError as error:
        sys.stderr.write(f"wamnet: {error}\n")
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        sys.stderr.write("wamnet: interrupted\n")
        raise SystemExit(130) from None


def spent() -> float:
    """Return the seconds of processors that this process and its compilers have taken."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
