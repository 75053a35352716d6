"""The web site, built once for all tests of a session; it takes a minute, so that these tests are nightly."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

BUILD = Path(__file__).resolve().parents[2] / "docs/site/build.py"
"""What builds it."""

LONGEST_WAIT_S = 600
"""After so many seconds another process that builds the site counts as gone."""


def pytest_itemcollected(item: pytest.Item) -> None:
    """Mark what needs the built site; tests of its parts run always."""
    if "site" in getattr(item, "fixturenames", ()):
        item.add_marker(pytest.mark.nightly)


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the folder of the built site; of several processes one builds it, the others wait for it."""
    own = tmp_path_factory.getbasetemp()
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own
    folder, failed = shared / "site", shared / "site.failed"
    try:
        (shared / "site.lock").mkdir()
    except FileExistsError:
        for _ in range(LONGEST_WAIT_S):
            if folder.exists() or failed.exists():
                break
            time.sleep(1)
        assert folder.exists(), "another process could not build the site; its message says why"
        return folder
    try:
        # In a process of its own: MkDocs takes hundreds of megabytes.
        done = subprocess.run([sys.executable, BUILD, folder], stderr=subprocess.PIPE, text=True, check=False)
        assert done.returncode == 0, done.stderr
    except BaseException:
        failed.touch()
        raise
    return folder
