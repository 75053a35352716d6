"""Where the command begins: Ctrl-C is one line from the first moment, also while modules are imported.

Nothing is written and no process started before [`main`] of main.py runs, so that Ctrl-C may end the process
at once until then [`run`]. Modules in C turn an interrupt of their import into errors of their own: therefore
it is not raised meanwhile.
"""

import os
import signal
import sys


def run() -> int:
    """Import and run the command line; return its exit status."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, _end)
    from .main import main

    try:
        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return main()
    except KeyboardInterrupt:
        return _interrupted()
    finally:
        if ours:
            # What Python does at its end is no work that could be lost; an interrupt then needs no words.
            signal.signal(signal.SIGINT, signal.SIG_DFL)


def _end(_number: int, _frame: object) -> None:
    """End the process at once."""
    os._exit(_interrupted())


def _interrupted() -> int:
    """Say on standard error that the command was interrupted, and return its exit status."""
    sys.stderr.write("wamnet: interrupted\n")
    sys.stderr.flush()
    return 130
