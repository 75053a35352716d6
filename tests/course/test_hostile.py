"""Hostile answers: none is graded above its functions, leaves its process, or costs another student."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import answers
import packages
import pytest

from wamnet_course.grading import Limits, grade_class
from wamnet_course.labs import LABS, lab_named

pytestmark = pytest.mark.needs("programs")

LAB = lab_named("1")

RIGHT = (answers.COURSE / "solutions" / LAB.file).read_text()

LINES = "".join(f'{{"check": "{check.name}", "wrong": null}}\\n' for check in LAB.checks) + '{"end": true}\\n'
"""What an earlier grader took for the results of all checks."""

LENGTHS = """
import os, struct
def write(*messages):
    for fd in range(3, 40):
        for message in messages:
            try:
                os.write(fd, struct.pack("<I", len(message)) + message)
            except OSError:
                break
"""
"""Writes messages to all descriptors, one of which the grader reads."""

HOSTILE = {
    # Forged: the function is wrong, and the rest says otherwise.
    "main": "import __main__\n__main__.outcome = lambda *a: None",
    "modules": "import sys\nfor m in list(sys.modules.values()):\n"
    "    for n in ('expect', 'hold', 'outcome'):\n        if hasattr(m, n): setattr(m, n, lambda *a: None)",
    "numpy": "import numpy as np\nnp.all = np.allclose = lambda *a, **k: True",
    "lines": f"import os\nfor fd in range(40):\n    try: os.write(fd, {LINES!r}.encode())\n"
    "    except OSError: pass\nos._exit(0)",
    "frames": "import sys\nf = sys._getframe()\nwhile f:\n    f.f_locals.update(wrong=None, answer=None)\n"
    "    f = f.f_back",
    "objects": "import gc\nfor o in gc.get_objects():\n    if type(o) is dict and 'checks' in o: o.clear()",
    "exits": "import os\nos._exit(0)",
    "equal": "class Equal(float):\n    __eq__ = __le__ = __lt__ = lambda *a: True\n"
    "    __array_ufunc__ = lambda *a, **k: True\ndef meet_sphere(*a): return Equal(77)",
    "writes": f"{LENGTHS}\nwrite(b'1', b'[]', b'[1, 2]', b'[' * 9999, b'null', b'\\xff', b'')",
    "calls": f"{LENGTHS}\nwrite(*[b'[\"call\", [0]]'] * 9)",
    "raises": f"{LENGTHS}\nwrite(b'[\"raised\", [[], 1, 1e999]]')",
    "records": f'{LENGTHS}\nwrite(b\'["value", {{"record": ["os:system", [["a", "id"]]]}}]\')',
    "lengths": "import os\nfor fd in range(3, 9):\n"
    "    try: os.write(fd, b'\\xff' * 40000)\n    except OSError: pass",
    # Outside of the process: files, processes, network.
    "reads": "open('CLASS/zz_right/lab01_sphere.py').read()",
    "neighbour": "import glob\nfor p in glob.glob('/proc/[0-9]*/cmdline'):\n    open(p).read()\n"
    "exec(open(glob.glob('/**/zz_right/*.py', recursive=True)[0]).read())",
    "opens": "import os\nos.write(os.open('CANARY/x', os.O_WRONLY | os.O_CREAT), b'x')",
    "handle": "import os\nd = os.open('CANARY', os.O_RDONLY)\nos.remove('victim', dir_fd=d)",
    "deletes": "import shutil\nfor p in ('CLASS', 'CANARY', '/'): shutil.rmtree(p, ignore_errors=True)",
    "database": "import sqlite3\nsqlite3.connect('CANARY/x').execute('create table t(a)')",
    "pipes": "import os\nos.mkfifo('CANARY/x')",
    "library": "import ctypes\nctypes.CDLL(None).open(b'CANARY/x', 0o101, 0o600)",
    "starts": "import os\nos.system('touch CANARY/x')\nos.posix_spawn('/usr/bin/id', ['id'], {})",
    "spawns": "import multiprocessing\nmultiprocessing.get_context('spawn').Process(target=print).start()",
    "forks": "import ctypes\nc = ctypes.CDLL(None)\nassert c.fork() == -1\nassert c.syscall(435, 0, 0) == -1",
    "connects": "import socket\nsocket.socket(type=socket.SOCK_DGRAM).sendto(b'x', ('127.0.0.1', 9))",
    "shares": "from multiprocessing.shared_memory import SharedMemory\nSharedMemory('wamnet', True, 9)",
    # Other processes.
    "kills": "import os, signal\nfor p in [os.getppid(), *range(1, 9), -1]:\n"
    "    try: os.kill(p, signal.SIGKILL)\n    except OSError: pass",
    "limits": "import os, resource\nresource.prlimit(os.getppid(), resource.RLIMIT_CPU, (1, 1))",
    "handles": "import os, signal\nsignal.pidfd_send_signal(os.pidfd_open(os.getppid()), signal.SIGKILL)",
    "owns": "import fcntl, os\nfor fd in range(9):\n    fcntl.fcntl(fd, fcntl.F_SETOWN, os.getppid())\n"
    "    fcntl.fcntl(fd, 10, 9)",
    # Resources.
    "disk": "i = 0\nwhile True:\n    open(f'x{i}', 'wb').write(bytes(1 << 20))\n    i += 1",
    "folders": "import os\nfor i in range(3000):\n    os.mkdir('d')\n    os.chdir('d')",
    "threads": "from threading import Thread\nfrom time import sleep\nfor i in range(5000):\n"
    "    Thread(target=sleep, args=(99,)).start()",
    "prints": "while True: print('x' * 4096)",
    "calls back": "import sys\nsys.setrecursionlimit(10**9)\ndef meet_sphere(*a): return meet_sphere(*a)",
    "sizes": "import numpy as np\ndef meet_sphere(*a): return np.zeros((0, 2**40))",
    "names": "raise type('\\x1b]0;x\\x07', (ValueError,), {})('\\udcff \\x1b[2J \\x00 \\u202e')",
}
"""By kind: what is put after a wrong answer; CLASS and CANARY are folders outside of the student's."""


@pytest.fixture(scope="module")
def graded(tmp_path_factory):
    """Give the results of a class of hostile students and right ones by name; no other file changes."""
    packages.needed_sandbox()
    base = tmp_path_factory.mktemp("hostile")
    canary, folder = base / "canary", base / "class"
    canary.mkdir()
    (canary / "victim").write_text("v")
    for name, text in {**HOSTILE, "zz_right": "", "0_right": ""}.items():
        (folder / name).mkdir(parents=True)
        head = RIGHT if "right" in name else RIGHT.replace("np.where(", "np.maximum(")
        text = text.replace("CANARY", str(canary)).replace("CLASS", str(folder))
        (folder / name / LAB.file).write_text(f"{head}\n{text}\n", errors="surrogatepass")
    before = {path: path.is_file() and path.read_bytes() for path in base.rglob("*")}
    students = grade_class(folder, (LAB,), Limits(seconds=2, memory_mb=300), workers=2)
    assert {path: path.is_file() and path.read_bytes() for path in base.rglob("*")} == before
    return {student.name: student.of(LAB) for student in students}


@pytest.mark.nightly
@pytest.mark.parametrize("name", HOSTILE)
def test_nothing_is_forged(graded, name):
    """A wrong function may pass the checks that it passes without the rest, and no other."""
    honest = {"a ray that misses", "a ray that looks away"}
    passed = {check for check, wrong in graded[name].checks if wrong is None}
    assert passed <= honest, passed


@pytest.mark.nightly
def test_others_get_what_they_earn(graded):
    for name in ("0_right", "zz_right"):
        assert graded[name].right, graded[name].first


# ---- data ------------------------------------------------------------------------------------------------

ANSWERS = (
    *("None", "3", "True", "'x'", "b'x'", "1j", "[]", "()", "{}", "float('nan')", "float('inf')", "10**400"),
    *("np.array([])", "np.zeros((0, 3))", "np.full((2, 3), np.nan)", "np.array(['x'])", "np.array([None])"),
    *("(np.zeros(3), np.zeros(3))", "(1, 2, 3)", "[np.zeros((5, 4))] * 3", "{'linear': 1e999}", "len"),
    *("a[0]", "a", "[[]] * 3", "np.broadcast_to(1.0, (7, 7))", "type('T', (tuple,), {})((1, 2))"),
)
"""Results of every kind, of which none is right for a whole lab."""


@pytest.mark.nightly(but=("lab01_sphere", "extra3_suite"))
@pytest.mark.parametrize("lab", LABS, ids=[lab.name for lab in LABS])
def test_data_of_any_kind_is_a_finding(lab, tmp_path, monkeypatch):
    """No result ends a check with something else than a finding, and none makes a lab right."""
    monkeypatch.chdir(tmp_path)
    names = [line[4:].partition("(")[0] for line in lab.skeleton.splitlines() if line.startswith("def ")]
    # A lab that asks the reference thousands of times gets some of them.
    for result in ANSWERS[:: 5 if lab.name == "extra3_suite" else 1]:
        text = "import numpy as np\n" + "".join(f"def {name}(*a):\n    return {result}\n" for name in names)
        wrong = answers.finding(lab, text, tmp_path)
        assert wrong is not None, result
        assert "something else than an answer" not in str(wrong), result


# ---- the command -----------------------------------------------------------------------------------------


def descendants(process: int) -> set[int]:
    """Return the numbers of a process's children, and of theirs."""
    found = set()
    for task in Path(f"/proc/{process}/task").glob("*/children"):
        for child in map(int, task.read_text().split()):
            found |= {child} | descendants(child)
    return found


def alive(process: int) -> bool:
    """Tell whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.nightly(but=("9-sandbox", "15-trusted"))
@pytest.mark.parametrize("option", [[], ["--trusted"]], ids=["sandbox", "trusted"])
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_no_process_and_no_file_outlives_the_command(option, number, tmp_path):
    if not option:
        packages.needed_sandbox()
    (tmp_path / "class/ada").mkdir(parents=True)
    (tmp_path / "temporary").mkdir()
    (tmp_path / "class/ada" / LAB.file).write_text("import time\ntime.sleep(600)\n")
    words = ["course", "grade", "class", "-o", "out", "--lab", "1", *option]
    command = [sys.executable, "-m", "wamnet.cli", *words]
    environment = {**os.environ, "TMPDIR": str(tmp_path / "temporary")}
    process = subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL)
    started = set()
    # The command, a grader of it, and the student's process, in the sandbox under two more.
    while len(started) < (2 if option else 4) and process.poll() is None:
        started = descendants(process.pid)
        time.sleep(0.05)
    process.send_signal(number)
    process.wait()
    for _ in range(100):
        if not any(map(alive, started)):
            break
        time.sleep(0.1)
    assert not [number for number in started if alive(number)]
    assert list((tmp_path / "temporary").iterdir()) == []


def test_a_large_answer_does_not_fill_the_machine_s_memory(tmp_path):
    """An answer of a megabyte is broadcast by the grader to gigabytes."""
    packages.needed_sandbox()
    lab = lab_named("5")
    right = (answers.COURSE / "solutions" / lab.file).read_text()
    bomb = "def picture(*a):\n    return np.zeros((2**20, 1, 1, 1), bool), np.zeros(3)\n"
    for name, text in {"ada": bomb, "bob": ""}.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / lab.file).write_text(f"{right}\n{text}")
    ada, bob = (student.of(lab) for student in grade_class(tmp_path, (lab,), workers=1))
    assert any("MemoryError" in str(wrong) for _, wrong in ada.checks)
    assert bob.right
