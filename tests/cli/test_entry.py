"""Tests of the command's first moments: Ctrl-C while modules are imported is one line."""

import os
import signal
import subprocess
import sys

import pytest

CODE = (
    "import builtins, signal, sys\n"
    "from wamnet.cli import entry\n"
    "real = builtins.__import__\n"
    "def interrupted(name, *rest):\n"
    "    if name == {name!r}:\n"
    "        signal.raise_signal(signal.SIGINT)\n"
    "    return real(name, *rest)\n"
    "builtins.__import__ = interrupted\n"
    "sys.argv = ['wamnet', 'render', 'minicubes', '--width', '4', '--height', '4', '-o', 'a.exr']\n"
    "sys.exit(entry.run())\n"
)
"""The command, interrupted at its first import of a module."""


@pytest.mark.parametrize("name", ["typer", "numpy"])
def test_an_interrupt_of_the_imports_is_one_line(tmp_path, name) -> None:
    """It was a traceback of KeyboardInterrupt for the first tenths of a second."""
    command = [sys.executable, "-c", CODE.format(name=name)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    assert done.stderr == "wamnet: interrupted\n"
    assert done.returncode == 128 + signal.SIGINT
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["typer", "rich", "wamnet.cli.main"])
def test_a_base_installation_prints_what_to_install(tmp_path, name) -> None:
    """The base install ended in a traceback; a missing module of ours is a bug."""
    code = f"import sys; sys.modules[{name!r}] = None; from wamnet.cli import entry; sys.exit(entry.run())"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=60)
    line = (
        f"wamnet: error: Python package '{name}': missing, and needed for the command "
        "(install it: pip install 'wamnet[full]')\n"
    )
    assert (done.returncode, done.stderr) == (2, line) or (name[0] == "w" and "Traceback" in done.stderr)


def test_the_entry_imports_next_to_nothing(tmp_path) -> None:
    """What is imported before Ctrl-C is handled must be a matter of milliseconds."""
    code = "import sys; import wamnet.cli.entry; sys.exit('typer' in sys.modules or 'rich' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False, timeout=60).returncode == 0


def test_the_status_is_the_command_s(tmp_path) -> None:
    """SIGTERM while a dataclass was made ended in a kill by SIGINT: Python's own end, by its memory of it."""
    code = (
        "import sys; from wamnet.cli import entry, main\n"
        "def ended():\n"
        "    try: exec('import signal; signal.raise_signal(signal.SIGINT)')\n"
        "    except KeyboardInterrupt: return 143\n"
        "main.main = ended\n"
        "sys.exit(entry.run())\n"
    )
    (tmp_path / "ended.py").write_text(code)
    command = [sys.executable, "-m", "ended"]
    # The working folder is not a place of modules where PYTHONSAFEPATH is set, as in .ci/run.
    found = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, env=found, cwd=tmp_path, capture_output=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (143, b"")


STREAMS = (
    "import sys; from wamnet.cli import entry, main\n"
    "main.main = lambda: print('\\u00fc\\udcff', '\\u00fc', file=sys.stderr) or print('\\u00fc') or 7\n"
    "sys.exit(entry.run())\n"
)
"""A command that prints what not every encoding has."""


@pytest.mark.parametrize(
    ("encoding", "closed", "told"),
    [
        ("ascii", "", rb"\xfc\udcff \xfc"),
        ("latin-1", "", b"\xfc\\udcff \xfc"),
        ("utf-8", "", b"\xc3\xbc\\udcff \xc3\xbc"),
        ("utf-8", "2>&-", b""),
        ("ascii", "2>&- >&- <&-", b""),
    ],
)
def test_streams_take_any_text_and_may_be_closed(tmp_path, encoding, closed, told) -> None:
    """The file was written, and then a traceback of UnicodeEncodeError printed instead of its name."""
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    command = ["sh", "-c", f'"$@" {closed}', "sh", sys.executable, "-c", STREAMS]
    done = subprocess.run(
        command, env=environment, cwd=tmp_path, capture_output=True, check=False, timeout=60
    )
    assert (done.returncode, done.stderr.strip()) == (7, told)


def test_an_interrupt_while_an_object_is_deleted_is_not_lost() -> None:
    """Python printed it with a traceback, dropped it, and the command continued."""
    program = (
        "import signal, sys, time\n"
        "from wamnet.cli import main\n"
        "class Deleted:\n"
        "    def __del__(self): signal.raise_signal(signal.SIGINT)\n"
        "def work(*_, **__):\n"
        "    Deleted()\n"
        "    time.sleep(60)\n"
        "main.application = lambda _: work\n"
        "sys.exit(main.main([]))\n"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=50)
    assert done.returncode == 130
    assert done.stderr == "wamnet: interrupted\n"


def test_a_closed_stream_s_number_is_not_that_of_a_file(tmp_path) -> None:
    """What a driver in C prints would get into the first file that is opened."""
    code = (
        "import os, sys; from wamnet.cli import entry, main\n"
        "main.main = lambda: os.open('a', os.O_CREAT | os.O_WRONLY)\n"
        "sys.exit(entry.run())\n"
    )
    command = ["sh", "-c", '"$@" 2>&- >&- <&-', "sh", sys.executable, "-c", code]
    assert subprocess.run(command, cwd=tmp_path, check=False, timeout=60).returncode > 2
