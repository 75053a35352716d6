"""Where the command begins: Ctrl-C is one line from the first moment, also while modules are imported.

Nothing is written and no process started before [`main`] of main.py runs, so that Ctrl-C may end the process
at once until then [`run`]. Modules in C turn an interrupt of their import into errors of their own: therefore
it is not raised meanwhile. Standard streams are there and take any text before anything is imported
[`_open_streams`]. A package that the base install lacks is one line [`_incomplete`].
"""

import atexit
import io
import os
import signal
import sys


def run() -> int:
    """Import and run the command line; return its exit status."""
    _open_streams()
    status = _run()
    # After SIGINT and SIGTERM.
    if status in (130, 143):
        # Python kills itself by SIGINT, whatever the status, if an interrupt that was handled long ago has
        # passed through `exec` of a text, as dataclasses use while modules are imported.
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status


def _open_streams() -> None:
    """Make a closed standard stream one that is empty, and show what an encoding lacks as escapes."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            # The next file that is opened would have this number, and get what drivers in C write to it.
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(number, "w" if number else "r", closefd=False))
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _run() -> int:
    """Import and run the command line, with Ctrl-C handled all the time."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, _end)
    try:
        from .main import main

        if ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return main()
    except KeyboardInterrupt:
        return _interrupted()
    except ModuleNotFoundError as error:
        return _incomplete(error)
    finally:
        if ours:
            # What Python does at its end is not work that could be lost; an interrupt then needs no words.
            signal.signal(signal.SIGINT, signal.SIG_DFL)


def _end(_number: int, _frame: object) -> None:
    """End the process at once."""
    os._exit(_interrupted())


def _incomplete(error: ModuleNotFoundError) -> int:
    """Print which package the base installation lacks, and how to install it; a module of ours is a bug."""
    if (error.name or "wamnet").startswith("wamnet"):
        raise error
    rule, fix = "missing, and needed for the command", "install it: pip install 'wamnet[full]'"
    sys.stderr.write(f"wamnet: error: Python package {error.name!r}: {rule} ({fix})\n")
    return 2


def _interrupted() -> int:
    """Say on standard error that the command was interrupted, and return its exit status."""
    sys.stderr.write("wamnet: interrupted\n")
    sys.stderr.flush()
    return 130
