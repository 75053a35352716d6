"""What all tests share: repeatable Hypothesis runs, executors as a fixture, golden files.

1. Hypothesis draws the same examples on every run, without a deadline: a test's result is a function of the
   code. HYPOTHESIS_PROFILE=long draws others on each run, HYPOTHESIS_EXAMPLES (2,000) in place of 100;
   --hypothesis-seed repeats them, as `.ci/long` says.
2. `executor` runs one test body on every executor of whole pipelines [`PIPELINES`], `denoiser` also on those
   that only denoise [`EXECUTORS`]; `mitsuba` and `chromium` give peers [`PEERS`]; some tests need packages
   that the usual set-up leaves out [`packages.needed`]. What is missing fails its tests when WAMNET_REQUIRE
   names it, as with `make test` and `.ci/run`; else they are skipped. Either way the summary says what was
   missing and why [`pytest_terminal_summary`]: nothing is left out in silence.
3. The user's cache folder is never touched: tests have one of their own, which their commands inherit. So
   they do the executor NumPy instead of `auto`: results do not depend on the machine.
   Measurements do not rest between runs [`no_rests`].
4. `golden` compares generated text with a file under tests/golden, or with its digest where another text or
   the shelf shows the language; only `--update-golden` writes one.
5. Processes stay small (tests/support/workers.py, tests/support/apart.py).
6. `--quick` runs what needs NumPy only (tests/support/quick.py), `--nightly` what takes long as well
   (tests/support/tiers.py). `--shuffle SEED` runs the tests in another order, the same for all workers.
"""

import hashlib
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from typing import Any

import hypothesis
import pytest
from packages import FOUND, PACKAGES, SANDBOX, required

pytest_plugins = ["quick", "apart", "workers", "tiers"]

PIPELINES = ("numpy", "opencl", "opengl-egl", "opengl-osmesa")
"""Executors on which every test of paths and pipelines runs; an OpenGL executor is named with the kind of its
context. C compiles each path kernel for seconds: fewer tests run its paths."""

EXECUTORS = (*PIPELINES, "c")
"""Every way to run a denoiser that the tests know."""

PEERS = ("mitsuba", "chromium")
"""Other programs that tests compare with or run pages in, under the policy of executors."""

# A shell that starts a run in the background lets it ignore Ctrl-C, and all that it starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

hypothesis.settings.register_profile("ci", derandomize=True, deadline=None, database=None, print_blob=True)
hypothesis.settings.register_profile(
    "long",
    hypothesis.settings.get_profile("ci"),
    derandomize=False,
    max_examples=int(os.environ.get("HYPOTHESIS_EXAMPLES", "2000")),
)
hypothesis.settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

_state_key = pytest.StashKey[dict[str, str]]()
"""Where a run keeps "ok (device)" or "MISSING: reason" of each executor that it has requested, by name."""


def required_executors() -> frozenset[str]:
    """Return the executors, peers and packages that WAMNET_REQUIRE lists; numpy needs no naming."""
    names = required()
    known = (*EXECUTORS, *PEERS, *PACKAGES, SANDBOX)
    if unknown := sorted(names - set(known)):
        raise pytest.UsageError(f"WAMNET_REQUIRE names {unknown}: it may list only {', '.join(known)}")
    return names


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--update-golden", action="store_true", help="write tests/golden instead of comparing with it"
    )
    parser.addoption(
        "--shuffle", type=int, metavar="SEED", help="run files, and tests of a file, in any order"
    )


def pytest_configure(config: pytest.Config) -> None:
    required_executors()
    config.stash[_state_key] = {}


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> Iterator[None]:
    """Shuffle files, and the tests of each file; those that share a fixture of a case stay together."""
    yield
    if (seed := config.getoption("--shuffle")) is not None:
        draw = Random(seed).random
        files = {path: draw() for path in dict.fromkeys(item.path for item in items)}
        items.sort(key=lambda item: (files[item.path], draw()))
        config.pluginmanager.get_plugin("funcmanage").pytest_collection_modifyitems(items=items)


# ---- executors ------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def executor_named(
    pytestconfig: pytest.Config, needs: Callable[[str], None], opened_executors: dict[str, Any]
) -> Callable[[str], Any]:
    """Give a function that opens an executor by its name, once a session, under the policy above."""
    state = pytestconfig.stash[_state_key]

    def open_once(name: str) -> Any:
        if name != "numpy":
            needs("devices")
        kind = "peer" if name in PEERS else "executor"
        if name not in state:
            opened_executors[name], state[name] = _open(name)
        if opened_executors[name] is not None:
            return opened_executors[name]
        if name in required_executors():
            way_out = "to do without it, list what you have: make test WAMNET_REQUIRE=opencl"
            pytest.fail(f"{kind} {name} is required and {state[name]}; {way_out}", pytrace=False)
        pytest.skip(f"{kind} {name} is {state[name]}")

    return open_once


@pytest.fixture(scope="session", params=PIPELINES)
def executor(request: pytest.FixtureRequest, executor_named: Callable[[str], Any]) -> Any:
    """Give each executor of whole pipelines in turn: one test body for all of them."""
    return executor_named(request.param)


@pytest.fixture(scope="session", params=EXECUTORS)
def denoiser(request: pytest.FixtureRequest, executor_named: Callable[[str], Any]) -> Any:
    """Give each executor of denoisers in turn."""
    return executor_named(request.param)


@pytest.fixture(scope="session")
def kit() -> Any:
    """Give what tests of executors share."""
    from kit import Kit

    return Kit()


@pytest.fixture(scope="session")
def mitsuba(executor_named: Callable[[str], Any]) -> Any:
    """Give the module `mitsuba` in its scalar variant, which needs no other library."""
    return executor_named("mitsuba")


@pytest.fixture(scope="session")
def chromium(executor_named: Callable[[str], Any]) -> Any:
    """Give a headless browser."""
    return executor_named("chromium")


def _open_mitsuba() -> tuple[Any, str]:
    """Return the module and what it is."""
    from wamnet_peers import peer_mitsuba

    peer = peer_mitsuba.open_mitsuba("scalar_rgb")
    return peer, f"version {peer.__version__}, {peer.variant()}"


def _open_chromium() -> tuple[Any, str]:
    """Return the browser and what it is."""
    from browser import Chromium

    peer = Chromium()
    return peer, peer.device


OPENED = {"mitsuba": _open_mitsuba, "chromium": _open_chromium}
"""How peers are opened."""


def _open(name: str) -> tuple[Any, str]:
    """Return the executor or peer and "ok (device)", or None and "MISSING: reason"."""
    from wamnet import kernels
    from wamnet.refimpl.errors import ExecutorUnavailable

    if name in PEERS:
        try:
            peer, text = OPENED[name]()
        except ExecutorUnavailable as error:
            return None, f"MISSING: {error}"
        return peer, f"ok ({text})"
    kind, _, context = name.partition("-")
    try:
        executor = kernels.open_executor(kind, **({"context": context} if context else {}))
    except ExecutorUnavailable as error:
        return None, f"MISSING: {error}"
    return executor.__enter__(), f"ok ({executor.device})"


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Hand what a worker process has found to the process that writes the summary."""
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput["executors"] = session.config.stash[_state_key] | FOUND


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any) -> None:
    """Collect what one worker process has found; a process that crashed has nothing to tell."""
    node.config.stash[_state_key].update(getattr(node, "workeroutput", {}).get("executors", {}))


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Say of each executor whether it ran; loudly when it did not."""
    state = config.stash[_state_key] | FOUND
    if not state:
        return
    terminalreporter.section("executors")
    for name in (*EXECUTORS, *PEERS, *PACKAGES, SANDBOX):
        text = state.get(name, "not requested by any test that ran")
        colour = {"ok": {"green": True}, "MISSING": {"red": True, "bold": True}}.get(
            text.partition(" ")[0].rstrip(":"), {}
        )
        terminalreporter.write_line(f"{name}: {text}", **colour)


# ---- time ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="session", autouse=True)
def no_rests() -> Iterator[None]:
    """Let measurements follow each other at once: no test asserts a time, and all would wait minutes."""
    from wamnet.kernels import measure

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(measure, "rest", lambda seconds: None)
        yield


# ---- cache ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Use a folder of this test run instead of the user's cache."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("WAMNET_CACHE", str(folder))
        patch.setenv("WAMNET_EXECUTOR", "numpy")
        yield folder


# ---- golden files ---------------------------------------------------------------------------------------


@pytest.fixture
def golden(pytestconfig: pytest.Config) -> Callable[[str, str], None]:
    """Give `check(name, text)`: the text must equal tests/golden/<name> to the byte; a missing file fails.

    Where <name>.sha256 is there instead, as `sha256sum` writes it, the digest must be equal, and a text that
    differs, or --update-golden, is written to out/golden: compare it with that of the last commit.
    """
    folder = Path(__file__).parent / "golden"

    def check(name: str, text: str) -> None:
        path, data = folder / name, text.encode()
        if digest := (folder / f"{name}.sha256").exists():
            path, data = folder / f"{name}.sha256", f"{hashlib.sha256(data).hexdigest()}  {name}\n".encode()
        update, old = pytestconfig.getoption("--update-golden"), path.read_bytes() if path.exists() else None
        if digest and (update or old != data):
            out = Path(__file__).parents[1] / "out/golden"
            out.mkdir(parents=True, exist_ok=True)
            (out / name).write_text(text, encoding="utf-8", newline="\n")
        if update:
            path.write_bytes(old := data)
        way_out = (
            "run pytest --update-golden, read the difference with git diff, and commit it if it is meant"
        )
        assert old is not None, f"tests/golden/{name} does not exist; {way_out}"
        assert old == data, f"the text is not that of tests/golden/{path.name}; {way_out}"

    return check
