"""Independent tasks on processes of this machine, or on a running Dask scheduler.

1. A cluster does them in any order [`do_on_cluster`]: workers of this machine, or those that a scheduler at
   an address has [`open_client`]. A task whose worker is lost is done again by another; the scheduler does
   that.
2. Only a few more tasks than there are workers are under way at a time, so that neither the scheduler nor
   this process keeps many results.
"""

import logging
import pickle
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

from ...kernels.orphans import starting_workers
from ...models.writing import signals_wait
from ...refimpl.errors import NO_VALUE, InputError
from .packages import need

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

PURPOSE = "to share the work (one process, --workers 1, needs it not)"
"""What Dask is needed for, and the way to do without."""

CONNECT_S = 10.0
"""Seconds in which a scheduler must answer and have a worker: longer than a network's hiccup."""


def do_on_cluster(
    client: Any,
    tasks: Sequence[_Task],
    do: Callable[[_Task], _Result],
    on_result: Callable[[_Task, _Result], None],
) -> None:
    """Do the tasks on a Dask client's workers; `do` must be importable there. Results come in any order."""
    distributed = need("distributed", PURPOSE)
    cloudpickle = need("cloudpickle", PURPOSE)

    def call(parcel: bytes) -> _Result:
        """Do a task on a worker: a nested function travels whole, and needs nothing there but Python.

        A worker without this package then answers with an error. Were the task sent as it is, Dask would drop
        the connection when it could not read it, and this process would wait for ever.
        """
        function, argument = pickle.loads(parcel)
        result: _Result = function(argument)
        return result

    waiting = iter(tasks)
    under_way: dict[Any, _Task] = {}
    finished = distributed.as_completed(loop=client.loop, with_results=True)
    try:
        while True:
            threads = max(1, sum(client.nthreads().values()))
            # For each thread one at work, one waiting, one whose result travels.
            for task in islice(waiting, max(0, 3 * threads - len(under_way))):
                future = client.submit(call, cloudpickle.dumps((do, task)), pure=False)
                under_way[future] = task
                finished.add(future)
            if not under_way:
                return
            future, result = next(finished)
            on_result(under_way.pop(future), result)
            del future, result  # lets the scheduler forget it
    except ImportError as error:
        rule = "missing"
        way_out = "install it there: pip install 'wamnet[full]'"
        raise InputError(f"Python package {error.name!r} on a worker", NO_VALUE, rule, way_out) from None
    except distributed.KilledWorker:
        rule = "several workers died during the same task, perhaps for lack of memory"
        raise InputError("cluster", NO_VALUE, rule, "use fewer workers") from None
    except (distributed.comm.CommClosedError, distributed.CancelledError):
        rule = "the connection was lost"
        raise InputError("Dask scheduler", NO_VALUE, rule, "run the same command again to resume") from None


@contextmanager
def open_client(workers: int, scheduler: str | None) -> Iterator[Any]:
    """Yield a Dask client: of the scheduler at an address, or of `workers` processes that end with it."""
    distributed = need("distributed", PURPOSE)
    with _quiet_logs():
        if scheduler is not None:
            with _connected(distributed, scheduler) as client:
                yield client
            return
        cluster = None
        try:
            # Dask leaves a cluster half made, or half closed, that complains when Python ends.
            with signals_wait():
                cluster = _local(distributed, workers)
            with distributed.Client(cluster) as client:
                yield client
        finally:
            if cluster is not None:
                # When all else is closed Dask asserts that each worker is, too. The successor of a lost one
                # may not be: it has no process, and Dask would wait for it once more at the end of Python.
                with signals_wait():
                    try:
                        cluster.close()
                    except AssertionError:
                        cluster.status = distributed.Status.closed


def _local(distributed: Any, workers: int) -> Any:
    """Return a cluster of processes of this machine, or say that they did not start."""
    try:
        with starting_workers():
            return distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,
            )
    except (RuntimeError, OSError, TimeoutError):
        rule = "one of them ended, or did not answer, before it had begun"
        way_out = "run the same command again to resume, perhaps with fewer --workers"
        raise InputError("worker processes", workers, rule, way_out) from None


@contextmanager
def _connected(distributed: Any, scheduler: str) -> Iterator[Any]:
    """Yield a client of a scheduler that has a worker, or say what is not there."""
    try:
        client = distributed.Client(scheduler, timeout=CONNECT_S)
    except (OSError, ValueError, TimeoutError):
        rule = "no Dask scheduler answers there"
        raise InputError(
            "--scheduler", scheduler, rule, "start one: dask scheduler; or leave it out"
        ) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_S)
        except TimeoutError:
            rule = "this scheduler has no worker"
            raise InputError("--scheduler", scheduler, rule, f"start one: dask worker {scheduler}") from None
        yield client


@contextmanager
def _quiet_logs() -> Iterator[None]:
    """Silence Dask's log in this process: what matters arrives as an error."""
    loggers = [logging.getLogger(name) for name in ("distributed", "tornado.application", "asyncio")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)
