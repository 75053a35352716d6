"""Tests of workers whose parent is killed: none stays."""

import os
import signal
import subprocess
import sys
import time

import pytest
from faults import members

pytestmark = pytest.mark.needs("programs")

GRACE_S = 10.0
"""Seconds after which a process that is still there counts as one that stays: a guard, no speed."""

POOL = (
    "import sys; from wamnet.kernels.run.render_pool import render_parallel\n"
    "from wamnet.refimpl.light.render import Job; from wamnet.refimpl.light.scenes import canonical\n"
    "if __name__ == '__main__':\n"
    "    report = lambda samples: print('ready', flush=True)\n"
    "    render_parallel(canonical('minicubes'), Job(256, 256, 10000), workers=2, on_progress=report)\n"
)
"""A render on two processes that reports when they work."""

APART = (
    "import time; from wamnet.kernels.judge.triage import Apart\n"
    "if __name__ == '__main__':\n"
    "    with Apart('numpy'): print('ready', flush=True); time.sleep(600)\n"
)
"""An executor in a process of its own."""

CLUSTER = (
    "import time; from wamnet.cli.common.cluster import open_client\n"
    "if __name__ == '__main__':\n"
    "    with open_client(2, None): print('ready', flush=True); time.sleep(600)\n"
)
"""A Dask cluster of two processes."""


@pytest.mark.parametrize("code", [POOL, APART, CLUSTER], ids=["pool", "apart", "cluster"])
def test_workers_end_with_a_parent_that_is_killed(tmp_path, code) -> None:
    """Two workers of each killed render stayed for ever, with 53 MB each."""
    if code is CLUSTER:
        pytest.importorskip("distributed")
    (tmp_path / "run.py").write_text(code)
    command = [sys.executable, "run.py"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, cwd=tmp_path, stdout=pipe, start_new_session=True) as process:
        try:
            assert process.stdout.readline() == b"ready\n"
            assert len(members(process.pid)) > 1
            process.kill()
            process.wait()
            for _ in range(int(GRACE_S / 0.1)):
                if not (left := members(process.pid)):
                    break
                time.sleep(0.1)
            assert left == set()
        finally:
            for pid in members(process.pid):
                os.kill(pid, signal.SIGKILL)


@pytest.mark.parametrize("end", ["parent", "block"])
def test_what_a_program_has_started_ends_too(tmp_path, end) -> None:
    """A renderer's own children lived on after the time limit, and when the command was killed."""
    started = "sleep 600 & sleep 600 & echo $!; wait"
    code = (
        "import subprocess, time; from wamnet_verify.programs import running\n"
        f"with running(['sh', '-c', {started!r}], stdout=subprocess.PIPE) as process:\n"
        "    print(process.pid, process.stdout.readline().decode().strip(), flush=True)\n"
        f"    time.sleep({600 if end == 'parent' else 0})\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE) as process:
        group, child = map(int, process.stdout.readline().split())
        assert end == "block" or child in members(group)
        if end == "parent":
            process.kill()
        process.wait()
        for _ in range(int(GRACE_S / 0.1)):
            if not members(group):
                break
            time.sleep(0.1)
        assert members(group) == set()
