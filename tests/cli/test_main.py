"""Tests of the command line as a whole: help, version, wrong options, errors, interrupts, processes."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import get_args

import pytest

from wamnet.cli import main as module
from wamnet.cli.common import options
from wamnet.cli.common.request import table
from wamnet.compiler.targets import DENOISERS, language_named
from wamnet.kernels import EXECUTORS
from wamnet.refimpl.errors import TrainingError
from wamnet.refimpl.light.scenes import CANONICAL
from wamnet.refimpl.light.transport import SAMPLERS
from wamnet.refimpl.network.train import PRESETS

COMMANDS = (
    "render", "scene", "dataset", "train", "compile", "denoise", "compare", "triage", "animate", "executors",
        "demo",
)  # fmt: skip

OF_BENCH = ("bench render", "bench train", "bench pipeline", "bench exports", "bench primitives")


def run_process(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run the installed command in a process of its own."""
    command = [sys.executable, "-m", "wamnet.cli", *arguments]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_help_lists_the_commands(wamnet, arguments) -> None:
    """Without a command, help is what is wanted."""
    outcome = wamnet(*arguments)
    assert outcome.status == 0
    assert all(command in outcome.out for command in COMMANDS)


@pytest.mark.parametrize(
    ("line", "completed"),
    [
        ("wamnet den", {"denoise"}),
        ("wamnet course g", {"grade"}),
        ("wamnet denoise --exec", {"--executor"}),
        ("wamnet denoise --executor open", {"opencl", "opengl"}),
    ],
)
def test_a_shell_completes_commands_options_and_choices(tmp_path, line, completed) -> None:
    """By the variables of typer's script for bash, which `--show-completion` prints."""
    words = line.split()
    position = {"COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    environment = os.environ | position | {"_WAMNET_COMPLETE": "complete_bash"}
    command = [sys.executable, "-m", "wamnet.cli"]
    done = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False, timeout=120
    )
    assert (done.returncode, set(done.stdout.split()), done.stderr) == (0, completed, "")


@pytest.mark.parametrize("command", [*COMMANDS, *OF_BENCH])
def test_each_help_has_examples(wamnet, command) -> None:
    """And defaults, where there are options."""
    outcome = wamnet(*command.split(), "--help")
    assert outcome.status == 0
    assert f"wamnet {command}" in outcome.out.split("Example")[1]
    assert "default:" in outcome.out or command == "executors"


def test_version(wamnet) -> None:
    """Name and number."""
    assert wamnet("--version").out.startswith("wamnet 0.")


def test_choices_equal_the_registries() -> None:
    """Help texts list choices without importing what is chosen from."""
    assert [name.value for name in options.ExecutorName] == list(EXECUTORS)
    assert set(get_args(options.Preset)) == set(PRESETS)
    assert list(get_args(options.Sampler)) == list(SAMPLERS)
    assert table()["names"]["scenes"].split(", ") == list(CANONICAL)
    assert table()["names"]["presets"].split(", ") == sorted(PRESETS)
    assert {language_named(target).name for target in get_args(options.Target)} <= set(DENOISERS)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["rendr"], "No such command 'rendr'"),
        (["render"], "Missing argument 'SCENE'; see wamnet render --help"),
        (["render", "minicubes", "--hight", "3"], "No such option: --hight"),
        (["render", "minicubes", "--width", "many"], "Invalid value for '--width'"),
        (["denoise", "m", "f", "--executor", "abacus"], "Invalid value for '--executor'"),
    ],
)
def test_wrong_options_are_one_line(refused, arguments, text) -> None:
    """Like all other errors."""
    assert text in refused(*arguments)


@pytest.mark.parametrize(("command", "distribution"), module.DISTRIBUTIONS.items())
def test_commands_of_other_distributions(refused, wamnet, monkeypatch, command, distribution) -> None:
    """Where they are not installed; the list of commands has them where they are."""
    group, _, name = command.partition(" ")
    assert (name or group) in wamnet(*[group] * bool(name), "--help").out
    monkeypatch.setattr(module, "entry_points", lambda group: [])
    assert f" {name or group} " not in wamnet(*[group] * bool(name), "--help").out
    assert refused(*command.split(), "check", "1") == (
        f"wamnet: error: command '{command}': distribution {distribution} is not installed "
        f"(install it: pip install {distribution})\n"
    )


class HalfMade:
    """An object whose `__init__` is cut short lacks attributes when it is deleted: of no use to anyone."""

    def __init__(self) -> None:
        raise KeyboardInterrupt

    def __del__(self) -> None:
        self.connection.close()


def fails(error: BaseException):
    """Return a command that fails."""

    def fail(*_args: object, **_options: object) -> None:
        raise error

    return fail


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (OSError(28, "No space left on device", "a.exr"), "No space left on device: a.exr\n"),
        (MemoryError(), "out of memory (use smaller frames"),
        (TrainingError("the loss\nis nan"), "the loss is nan\n"),
    ],
)
def test_errors_of_the_system_and_of_training_are_one_line(refused, monkeypatch, error, said) -> None:
    """A full disk is not a bug; an error of training is a plain sentence, perhaps over several lines."""
    monkeypatch.setattr(module, "application", lambda _: fails(error))
    assert said in refused("render").removeprefix("wamnet: error: ")


def test_ctrl_c_and_a_bug(wamnet, monkeypatch) -> None:
    """Status 130 and no traceback, which a bug keeps: what no user can cause is not hidden."""
    for command in (fails(KeyboardInterrupt()), lambda *_args, **_options: HalfMade()):
        monkeypatch.setattr(module, "application", lambda _, command=command: command)
        assert wamnet("render") == (130, "", "wamnet: interrupted\n")
    monkeypatch.setattr(module, "application", lambda _: fails(ZeroDivisionError("a bug")))
    with pytest.raises(ZeroDivisionError, match="a bug"):
        wamnet("render")
    monkeypatch.undo()
    monkeypatch.setattr("wamnet.cli.commands.render.load_scene", fails(KeyboardInterrupt()))
    assert wamnet("render", "minicubes").status == 130


def test_as_a_process(tmp_path) -> None:
    """The exit status reaches the shell; standard output stays empty when something is wrong."""
    done = run_process("render", "nowhere", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("wamnet: error: scene 'nowhere': unknown (choose one of")
    assert run_process("--version", cwd=tmp_path).returncode == 0


def test_help_imports_nothing_heavy(tmp_path) -> None:
    """Help texts appear at once, those of commands too: no NumPy, no plots, no device.

    `bench` also lists the commands of another distribution, which is imported for that.
    """
    named = [path for path, lines in table().items() if "call" in lines]
    commands = ["", *(path for path in named if not path.startswith("bench"))]
    code = (
        f"import sys; from wamnet.cli.main import main; [main([*c.split(), '--help']) for c in {commands}]; "
        "sys.exit(bool({'numpy', 'matplotlib', 'pyopencl', 'OpenEXR', 'PIL'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, check=False, timeout=120
    )
    assert done.returncode == 0
    assert done.stdout.count(b"Usage: ") == len(commands)


@pytest.mark.parametrize("path", [path for path, lines in table().items() if "call" in lines])
def test_help_without_the_bodies_of_commands_is_the_same(wamnet, monkeypatch, path) -> None:
    """What is left of a module for its help says what the whole module does."""
    short = wamnet(*path.split(), "--help").out
    monkeypatch.setattr(module.signatures, "package", lambda: "wamnet.cli.commands")
    assert wamnet(*path.split(), "--help").out == short
    assert "Usage" in short


def test_help_may_be_a_value(refused) -> None:
    """The command that has it runs."""
    assert "output file '--help': must end in .exr or .png" in refused("render", "minicubes", "-o", "--help")


def test_a_worker_that_is_killed_is_one_line(tmp_path) -> None:
    """As the system does when the memory ends."""
    code = (
        "import sys, os; import wamnet.kernels.run.render_pool as pool; from wamnet.cli.main import main\n"
        "if __name__ == '__main__':\n"
        "    pool._render_band = os._exit; pool.bands = lambda job, workers: [7, 8]\n"
        "    submit = pool.ProcessPoolExecutor.submit\n"
        "    pool.ProcessPoolExecutor.submit = lambda self, f, scene, job, rows: submit(self, f, rows)\n"
        "    sys.exit(main(['render', 'minicubes', '--spp', '64', '--workers', '2', '-o', 'a.exr']))\n"
    )
    (tmp_path / "run.py").write_text(code)
    command = [sys.executable, "run.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 2
    assert done.stderr.startswith("wamnet: error: workers 2: one of these processes was ended from outside")
    assert done.stderr.count("\n") == 1


@pytest.mark.nightly(but=("2-killpg-0.9", "15-kill-1.3", "2-kill-4.0"))
@pytest.mark.parametrize("seconds", [0.9, 1.3, 1.8, 4.0])
@pytest.mark.parametrize(
    ("number", "send"), [(signal.SIGTERM, "kill"), (signal.SIGINT, "killpg"), (signal.SIGINT, "kill")]
)
def test_signals_end_the_workers(tmp_path, number, send, seconds) -> None:
    """To the parent, as of a program that knows one process, or to all as of a terminal, while the workers
    start and later: no process is left, no file, whole or half, and no traceback."""
    arguments = ("render", "minicubes", "--spp", "100000", "--workers", "2", "-o", "a.exr")
    code = (
        "import sys; from wamnet.cli.main import main\n"
        "if __name__ == '__main__':\n"
        "    print('ready', flush=True); sys.exit(main(sys.argv[1:]))\n"
    )
    (tmp_path / "run.py").write_text(code)
    work = tmp_path / "work"
    work.mkdir()
    command = [sys.executable, str(tmp_path / "run.py"), *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=work, stdout=pipe, stderr=pipe, start_new_session=True) as process:
        try:
            process.stdout.readline()
            time.sleep(seconds)
            assert process.poll() is None
            getattr(os, send)(process.pid, number)
            # The workers have these pipes too: the reading ends when the last of them has ended.
            _, errors = process.communicate(timeout=30)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 128 + number
    assert errors == b"wamnet: interrupted\n"
    assert not list(work.iterdir())
