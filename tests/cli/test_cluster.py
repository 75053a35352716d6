"""Tests of sharing tasks: here and on real Dask clusters, with a worker killed, and with nobody there."""

import contextlib
import importlib
import os
import signal
import socket
import sys
import time
import types
from functools import partial
from operator import neg

import pytest

from wamnet.cli.common import cluster
from wamnet.refimpl.errors import InputError
from wamnet.refimpl.light.render import Job

TASKS = list(range(20))


def gather(results: dict):
    """Return a function that keeps each result once."""

    def keep(task, result) -> None:
        assert task not in results
        results[task] = result

    return keep


def test_on_a_scheduler_and_its_refusals(monkeypatch) -> None:
    """Processes of this machine found by their scheduler's address; a worker's error is this process's."""
    with cluster.open_client(1, None) as own:
        with cluster.open_client(1, own.scheduler.address) as client:
            results: dict = {}
            cluster.do_on_cluster(client, TASKS, neg, gather(results))
            assert results == {task: -task for task in TASKS}
            cluster.do_on_cluster(client, [], neg, gather(results))
        with pytest.raises(InputError, match="seed -1: must be an integer from 0 to"):
            cluster.do_on_cluster(own, [-1], partial(Job, 2, 2, 1), gather(results))
        own.retire_workers(list(own.scheduler_info()["workers"]), close_workers=True)
        monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
        with (
            pytest.raises(InputError, match=r"this scheduler has no worker \(start one: dask worker tcp"),
            cluster.open_client(1, own.scheduler.address),
        ):
            pass


def test_a_worker_that_a_task_kills() -> None:
    """The scheduler gives up after a few workers, and that is one line."""
    with (
        cluster.open_client(1, None) as client,
        pytest.raises(InputError, match=r"several workers died during the same task.* \(use fewer"),
    ):
        cluster.do_on_cluster(client, [9], lambda number: os.kill(os.getpid(), number), lambda *_: None)


@pytest.mark.parametrize(
    "error", [RuntimeError("Nanny failed to start."), OSError("no port"), TimeoutError()]
)
def test_workers_that_do_not_start(monkeypatch, error) -> None:
    """A worker that was killed before it had begun: a traceback of Dask's, and status 1."""

    def fails(**_):
        raise error

    monkeypatch.setattr("distributed.LocalCluster", fails)
    rule = r"worker processes 2: one of them ended, .* \(run the same command again to resume"
    with pytest.raises(InputError, match=rule), cluster.open_client(2, None):
        pass


def test_a_worker_without_the_package(monkeypatch) -> None:
    """A function whose module only this process has, as where a worker lacks wamnet: a line, no waiting."""
    module = types.ModuleType("only_here")
    exec("def do(task): return task", module.__dict__)
    monkeypatch.setitem(sys.modules, "only_here", module)
    with (
        cluster.open_client(1, None) as client,
        pytest.raises(InputError, match="package 'only_here' on a worker: missing"),
    ):
        cluster.do_on_cluster(client, [1], module.do, lambda *_: None)


def test_nobody_is_there(monkeypatch) -> None:
    """An address without a scheduler; a text that is not an address."""
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    for wrong in (address, "nonsense://x"):
        with (
            pytest.raises(InputError, match=f"--scheduler '{wrong}': no Dask scheduler answers there"),
            cluster.open_client(1, wrong),
        ):
            pass


def test_without_the_package(monkeypatch) -> None:
    """The usual line, with the way to do without."""
    monkeypatch.setitem(sys.modules, "distributed", None)
    text = r"'distributed': missing, and needed .*--workers 1.* \(install it: pip install 'wamnet\[full\]'"
    with pytest.raises(InputError, match=text), cluster.open_client(2, None):
        pass


@pytest.mark.nightly
def test_the_tasks_of_a_lost_worker_are_done_again() -> None:
    """One of two workers is killed while it has tasks; every task still has its result, once."""
    results: dict = {}
    keep = gather(results)

    def slow(task: int) -> int:
        time.sleep(0.1)
        return task

    with cluster.open_client(2, None) as client:
        pids = client.run(os.getpid)

        def kill_first(task, result) -> None:
            keep(task, result)
            if len(results) == 1:
                busy = [worker for worker, tasks in client.processing().items() if tasks]
                os.kill(pids[busy[0]], signal.SIGKILL)

        cluster.do_on_cluster(client, TASKS, slow, kill_first)
        assert set(client.run(os.getpid).values()) != set(pids.values())
    assert results == {task: task for task in TASKS}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_waits_until_workers_have_started(monkeypatch, number) -> None:
    """SIGTERM meanwhile: a traceback of Dask's at the end of Python, where it closed what was half made."""
    done = []

    class Half:
        def __init__(self, **_):
            signal.raise_signal(number)
            done.append("started")

        def close(self):
            done.append("closed")

    def end(*_):
        raise KeyboardInterrupt

    before = signal.signal(number, end)
    monkeypatch.setattr("distributed.LocalCluster", Half)
    try:
        with pytest.raises(KeyboardInterrupt), cluster.open_client(2, None):
            done.append("works")
    finally:
        signal.signal(number, before)
    assert done == ["started", "closed"]


def test_a_worker_that_is_being_started_keeps_no_cluster_open(monkeypatch) -> None:
    """Dask's assertion and a traceback hid what the command had to say."""

    class Open:
        def __init__(self, **_):
            self.status = "running"
            opened.append(self)

        def close(self):
            raise AssertionError("Status.init")

    opened: list[Open] = []
    monkeypatch.setattr("distributed.LocalCluster", Open)
    monkeypatch.setattr("distributed.Client", contextlib.nullcontext)
    with pytest.raises(InputError, match="fewer"), cluster.open_client(2, None):
        raise InputError("cluster", 2, "rule", "use fewer")
    assert opened[0].status == importlib.import_module("distributed").Status.closed
