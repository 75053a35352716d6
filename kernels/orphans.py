"""Workers that end with the process that started them, however that ended.

A parent that is killed by SIGKILL can end nobody, and a worker that waits for work would wait for ever. The
system closes what the parent held open, which a thread of the worker waits for [`end_with_parent`].
"""

from __future__ import annotations

import multiprocessing
import os
import threading
from multiprocessing.connection import wait


def end_with_parent() -> None:
    """Let this process, which multiprocessing has started, end as soon as its parent has ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent.sentinel,), daemon=True).start()


def _end_after(sentinel: int) -> None:
    """Wait for the end of the parent, and end this process at once, whatever its other threads do."""
    wait([sentinel])
    os._exit(1)
