"""Faults at random times: kills, full disks, folders that cannot be written, lost workers, two at one output.

`make faults COUNT=300 SEED=1` runs as many and prints what it has found; a run is repeated by its seed, up to
the machine's speed. Each fault has an empty folder with a model and two frames:

1. the command runs once undisturbed for each kind, which gives the wanted bytes and a duration [`Case`];
2. it runs again and is disturbed [`FAULTS`];
3. a file under a final name has the wanted bytes, no process of it is left after GRACE_S, nothing shows a
   traceback, and after SIGINT and SIGTERM nothing hidden stays [`look`];
4. the command, repeated or resumed, ends well with the wanted bytes.

Started by root, half of the faults happen to another user [`Who`], and a full disk is a small file system of
its own [`Disk`]; what this machine does not allow is said.
"""

import argparse
import fnmatch
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

GRACE_S = 10.0
"""Seconds after which a process that is still there counts as one that stays: a guard, no speed."""

LIMIT_S = 240.0
"""Seconds after which a command counts as one that hangs."""

KILLS = {"KILL": signal.SIGKILL, "INT": signal.SIGINT, "TERM": signal.SIGTERM}
FAULTS = (*KILLS, "full", "too long", "read-only", "two", "revoked")
"""What can happen; each command meets all, those that have worker processes also a lost worker.

`full`: a file system without room; `too long`: files beyond a limit of length (RLIMIT_FSIZE)."""

USER = 65534
"""Number of the user who is not root: nobody."""

WHO_READS = (
    *("setpriv", f"--reuid={USER}", f"--regid={USER}", "--clear-groups", "--inh-caps=+dac_read_search"),
    *("--ambient-caps=+dac_read_search", "--bounding-set=-all,+dac_read_search"),
)
"""Runs a command as nobody who may read everything: Python may lie in root's home."""

ROOM_KIB = (0, 4, 8, 16, 32, 64, 128, 512)
"""Room on a disk that becomes full."""

ENOUGH = "256m"
"""Room on a disk after somebody has cleaned up."""

WITHOUT_RIGHTS = ("setpriv", "--bounding-set=-dac_override,-dac_read_search")
"""Runs a command of root's without the right to write where rights forbid it, as any other user."""

DATASET = ("dataset", "minicubes", "--frames", "2", "--test", "1", "--size", "24", "--spp", "8", "-o", "out")
TRAIN = ("train", "-i", "n.exr", "-t", "r.exr", "--steps", "40", "-o", "out.safetensors")
RENDER = ("render", "minicubes", "--width", "64", "--height", "64", "--spp", "32", "-o", "out.exr")
ANIMATE = ("animate", "m.safetensors", "--seconds", "0.4", "--fps", "5", "--size", "16")
BENCH = ("bench", "m.safetensors", "--quick", "--size", "16", "--frames", "1", "--reference-spp", "2")
ONCE = ("--repeats", "1", "--budget", "0.2", "--only", "numpy*")

RUN = "import sys; from wamnet.cli.entry import run; sys.exit(run())"
"""What starts a command after a prelude."""

SMALLER = (
    "from dataclasses import replace; from wamnet.cli.commands import demo; demo.QUICK = replace(demo.QUICK, "
    "size_px=12, test_frames=1, train_spp=2, reference_spp=2, feature_spp=1, steps=8)"
)
"""Prelude: a demonstration of some seconds."""

OFTEN = "from wamnet.cli.commands import train; train.CHECKPOINT_INTERVAL_S = 0.0"
"""Prelude: a checkpoint after every step that may have one."""


@dataclass
class Case:
    """A command, the files whose bytes are wanted, and patterns of the files that may also be there."""

    arguments: Sequence[str]
    exact: Sequence[str]
    besides: Sequence[str] = ()
    locks: bool = True
    prelude: str = ""
    workers: bool = False
    wanted: dict[str, bytes] = field(default_factory=dict)
    duration: float = 0.0


CASES = {
    "dataset": Case((*DATASET, "--workers", "1"), ["out/t*/*.exr"],
        ["out/manifest.json", "out/unfinished/*"]),
    "dataset-2": Case((*DATASET, "--workers", "2"), ["out/t*/*.exr"],
        ["out/manifest.json", "out/unfinished/*"], workers=True),
    "train": Case(TRAIN, ["out.safetensors"], ["out.checkpoint.safetensors"]),
    "train-often": Case(TRAIN, ["out.safetensors"], ["out.checkpoint.safetensors"], prelude=OFTEN),
    "animate": Case((*ANIMATE, "-o", "out"), ["out/*.png"]),
    "animate-gif": Case((*ANIMATE, "-o", "out.gif"), ["out.gif"], ["out.gif.frames/*.png"]),
    "export": Case(("export", "m.safetensors", "--target", "c", "-o", "out"), ["out/*"], locks=False),
    "compile": Case(("compile", "m.safetensors", "--target", "opencl", "-o", "out"), ["out/*"], locks=False),
    "render": Case((*RENDER, "--workers", "2"), ["out.exr"], locks=False, workers=True),
    "view": Case(("view", "m.safetensors", "-o", "out.html"), ["out.html"], locks=False),
    "tune": Case(("tune", "m.safetensors", "--size", "12", "--force", "--cache", "out"), ["none"],
        ["out/*.json"]),
    "demo": Case(("demo", "--quick", "-o", "out"), ["out/frames/t*/*.exr", "out/model.safetensors"],
        ["out/*"], prelude=SMALLER),
    "bench": Case((*BENCH, *ONCE, "-o", "out"), ["out/frames-*/t*/*.exr"], ["out/*"]),
}  # fmt: skip
"""The commands. Times are in the results of the last three: of those files only the others are compared."""

LONG = {"demo", "bench"}
"""Commands that take longer, and come half as often."""


@dataclass(frozen=True)
class Who:
    """Who runs a command: this process's user, or where that is root another with a home of its own."""

    home: Path | None = None
    before: Sequence[str] = ()

    def own(self, *paths: Path) -> None:
        """Give folders and what is in them to the user."""
        if self.home is not None:
            for path in (each for top in paths for each in (top, *top.rglob("*"))):
                os.chown(path, USER, USER)

    def become(self) -> None:
        """Be the user, in a child."""
        if self.home is not None and not self.before:
            os.setgroups([])
            os.setgid(USER)
            os.setuid(USER)

    def environment(self, folder: Path) -> dict[str, str]:
        """Return the variables of a command in a folder."""
        cache = folder.with_name(f"cache-{folder.name}")
        found = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "WAMNET_CACHE": f"{cache}"}
        if self.home is None:
            return found
        cache.mkdir(exist_ok=True)
        self.own(cache)
        kept = {name: value for name, value in found.items() if not name.startswith("XDG_")}
        return {**kept, "HOME": str(self.home), "TMPDIR": str(self.home)}


class Disk:
    """A folder on a file system of its own, of little room; needs root, who may mount."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def room(self, size: str) -> None:
        """Make the file system, or change its room."""
        again = "remount," if self.folder.is_mount() else ""
        options = f"{again}size={size},mode=0777"
        subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", self.folder], check=True)

    def free(self) -> int:
        """Return the room that is left, in bytes."""
        found = os.statvfs(self.folder)
        return found.f_bavail * found.f_frsize

    def leave(self) -> None:
        """Give the file system back."""
        if self.folder.is_mount():
            subprocess.run(["umount", "-l", self.folder], check=True)

    @classmethod
    def possible(cls, folder: Path) -> bool:
        """Tell whether this process may mount."""
        if os.geteuid() != 0 or not shutil.which("mount"):
            return False
        done = subprocess.run(["mount", "-t", "tmpfs", "tmpfs", folder], check=False, capture_output=True)
        cls(folder).leave()
        return done.returncode == 0


def prepare(folder: Path) -> None:
    """Make a small model and two frames, which all runs begin with."""
    import numpy as np

    from wamnet.cli.files import exr
    from wamnet.models.model_file import save_model
    from wamnet.refimpl.light.render import Job, render
    from wamnet.refimpl.light.scenes import canonical
    from wamnet.refimpl.network import siren
    from wamnet.refimpl.network.dataset import Normalization
    from wamnet.refimpl.network.denoise import Model
    from wamnet.refimpl.network.window import Window

    scene = canonical("minicubes", time=1.0)
    for name, spp in (("n.exr", 1), ("r.exr", 8)):
        exr.write_frame(folder / name, render(scene, Job(16, 16, spp, spp)).frame)
    network = siren.init((4 * 4 * 6, 8, 3), 2.0, 2.0, 5, np.float32)
    info = {"trained_on_scene": "minicubes"}
    model = Model(network, ("color", "normal"), Window(4, "clamp"), Normalization(), info)
    save_model(folder / "m.safetensors", model)


def members(session: int) -> set[int]:
    """Return the processes of a session that have not ended."""
    found = set()
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, of = path.read_text().rpartition(")")[2].split()[:4]
        except OSError:  # it has ended meanwhile
            continue
        if int(of) == session and state != "Z":
            found.add(int(path.parent.name))
    return found


def start(
    case: Case,
    folder: Path,
    who: Who,
    more: Sequence[str] = (),
    preexec: Callable[[], None] | None = None,
    before: Sequence[str] = (),
) -> subprocess.Popen[bytes]:
    """Start a command in a session of its own; what it says waits in a pipe, which is larger."""
    begin = ["-c", f"{case.prelude}; {RUN}"] if case.prelude else ["-m", "wamnet.cli"]
    command = [*before, *who.before, sys.executable, *begin, *case.arguments, *more]

    def prepare() -> None:
        if preexec is not None:
            preexec()
        who.become()

    return subprocess.Popen(
        command,
        cwd=folder,
        env=who.environment(folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
        preexec_fn=prepare,  # noqa: PLW1509 - this program has one thread
    )


def end(process: subprocess.Popen[bytes]) -> tuple[int, str, set[int]]:
    """Wait for the end; return status, what was said, and the processes that stayed, which are ended."""
    try:
        process.wait(LIMIT_S)
    except subprocess.TimeoutExpired:
        return -1000, "it hangs", _swept(process.pid)
    for _ in range(int(GRACE_S / 0.1)):
        if not members(process.pid):
            break
        time.sleep(0.1)
    left = _swept(process.pid)
    assert process.stdout is not None
    with process.stdout as pipe:
        return process.returncode, pipe.read().decode(errors="replace"), left


def _swept(session: int) -> set[int]:
    """Return the processes of a session, and end them."""
    left = members(session)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    return left


def matches(name: str, patterns: Sequence[str]) -> bool:
    """Tell whether a name matches one of the patterns."""
    return any(fnmatch.fnmatchcase(name, pattern) for pattern in patterns)


def look(case: Case, folder: Path, inputs: set[str], whole: bool, hidden: bool) -> list[str]:
    """Return what is wrong with the files in a folder; `whole`: all must be there, `hidden`: may stay."""
    wrong, seen = [], set()
    for path in folder.rglob("*"):
        name = path.relative_to(folder).as_posix()
        if path.is_dir() or name in inputs:
            continue
        if path.name.startswith("."):
            wrong += [] if hidden else [f"hidden file stays: {name}"]
        elif matches(name, case.exact):
            seen.add(name)
            if path.read_bytes() != case.wanted.get(name):
                wrong.append(f"other bytes than wanted: {name}")
        elif not matches(name, case.besides):
            wrong.append(f"unknown file: {name}")
    missing = case.wanted.keys() - seen if whole else ()
    return [*wrong, *(f"missing: {name}" for name in missing)]


class Bench:
    """A folder for all runs: inputs, and the wanted files of each command."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.number = folder, 0
        self.inputs, home = folder / "inputs", folder / "home"
        self.inputs.mkdir()
        home.mkdir()
        prepare(self.inputs)
        self.names = {path.name for path in self.inputs.iterdir()}
        self.mounts = Disk.possible(home)
        ways = (Who(home), Who(home, WHO_READS)) if os.geteuid() == 0 else ()
        self.other = next((who for who in ways if _can_run(who)), None)

    def cannot(self) -> list[str]:
        """Return what this machine does not allow."""
        is_root = os.geteuid() == 0
        found = [] if self.mounts else ["full: no file system can be mounted; too long stands for it"]
        found += ["another user: it cannot read this Python"] if is_root and not self.other else []
        if self.other is not None and self.other.before:
            found.append("another user without all rights of root: it may read everything, as Python needs")
        found += [] if not is_root or shutil.which(WITHOUT_RIGHTS[0]) else ["read-only by root: no setpriv"]
        return found

    def fresh(self, who: Who, disk: bool = False) -> Path:
        """Return a new folder with the inputs, if wanted a disk of its own."""
        self.number += 1
        folder = self.folder / str(self.number)
        folder.mkdir()
        if disk:
            Disk(folder).room(ENOUGH)
        shutil.copytree(self.inputs, folder, dirs_exist_ok=True)
        who.own(folder)
        return folder

    def undisturbed(self, case: Case) -> None:
        """Run a command once, for its bytes and its duration."""
        folder, began = self.fresh(Who()), time.monotonic()
        status, said, _ = end(start(case, folder, Who()))
        case.duration = time.monotonic() - began
        if status:
            raise RuntimeError(f"{' '.join(case.arguments)}: status {status}: {said}")
        files = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
        case.wanted = {name: p.read_bytes() for name, p in files.items() if matches(name, case.exact)}

    def fault(self, case: Case, kind: str, draw: random.Random, who: Who) -> list[str] | None:
        """Let a fault happen; return what went wrong, or None where this machine cannot have it."""
        if kind == "full" and not self.mounts:
            return None
        folder = self.fresh(who, disk=kind == "full")
        try:
            if kind == "two":
                return self._two(case, folder, draw, who)
            if kind == "read-only":
                return self._read_only(case, folder, who)
            return self._one(case, folder, kind, draw, who)
        finally:
            Disk(folder).leave()
            folder.chmod(0o755)
            shutil.rmtree(folder)
            shutil.rmtree(folder.with_name(f"cache-{folder.name}"), ignore_errors=True)

    def _one(self, case: Case, folder: Path, kind: str, draw: random.Random, who: Who) -> list[str]:
        """Kill the command or one of its workers, or let the disk be full."""
        most, disk = draw.choice([0, 300, 3000, 30000]), Disk(folder)
        if kind == "full":
            room = disk.free()
            used = int(ENOUGH[:-1]) * 2**20 - room
            disk.room(str(used + 1024 * draw.choice(ROOM_KIB)))

        def limit() -> None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, resource.RLIM_INFINITY))

        process = start(case, folder, who, preexec=limit if kind == "too long" else None)
        if kind in KILLS or kind == "revoked":
            time.sleep(draw.uniform(0.15, 1.05 * case.duration))
        if kind == "revoked":
            _revoke(process, draw.choice([signal.SIGKILL, signal.SIGTERM]))
        elif kind in KILLS and process.poll() is None:
            # Ctrl-C reaches all processes of a terminal.
            everybody = kind == "INT" and draw.random() < 0.5
            (os.killpg if everybody else os.kill)(process.pid, KILLS[kind])
        status, said, left = end(process)
        wrong = [f"{len(left)} processes stay"] if left else []
        wrong += _words(kind, status, said)
        wrong += look(case, folder, self.names, whole=status == 0, hidden=kind == "KILL" or status < 0)
        if kind == "full":
            disk.room(ENOUGH)
        return wrong + self._again(case, folder, who)

    def _again(self, case: Case, folder: Path, who: Who) -> list[str]:
        """Repeat the command, or resume it, and hold the result to the wanted one."""
        more = []
        if case.arguments[0] == "train" and (folder / "out.checkpoint.safetensors").exists():
            more = ["--resume"]
        if case.arguments[0] == "export" and (folder / "out").exists():
            return look(case, folder, self.names, whole=True, hidden=True)
        status, said, _ = end(start(case, folder, who, more))
        wrong = [f"again: status {status}: {said[-400:]}"] if status else []
        return wrong + [f"again: {what}" for what in look(case, folder, self.names, True, hidden=True)]

    def _two(self, case: Case, folder: Path, draw: random.Random, who: Who) -> list[str]:
        """Let two processes have one output."""
        one = start(case, folder, who)
        time.sleep(draw.uniform(0.0, 0.5 * case.duration))
        two = start(case, folder, who)
        ends = [end(process) for process in (one, two)]
        wrong = [f"status {status}: {said[-300:]}" for status, said, _ in ends if status not in (0, 2)]
        if all(status for status, _, _ in ends):
            wrong.append("both are refused")
        refusals = [said for status, said, _ in ends if status == 2]
        known = ("another process is ", "is not empty", "from an earlier run", "holds something else")
        wrong += [f"other words: {said}" for said in refusals if not any(word in said for word in known)]
        if case.locks and not refusals and case.arguments[0] in ("train",):
            wrong.append("none is refused")
        return wrong + look(case, folder, self.names, whole=True, hidden=False)

    def _read_only(self, case: Case, folder: Path, who: Who) -> list[str] | None:
        """Let the folder be one in which the user may not write."""
        folder.chmod(0o555)
        is_root = os.geteuid() == 0 and who.home is None
        if is_root and not shutil.which(WITHOUT_RIGHTS[0]):
            return None
        status, said, left = end(start(case, folder, who, before=WITHOUT_RIGHTS if is_root else ()))
        wrong = [f"{len(left)} processes stay"] if left else []
        if case.arguments[0] != "tune" and (status != 2 or said.count("wamnet: error: ") != 1):
            wrong.append(f"status {status}: {said[-300:]}")
        folder.chmod(0o755)
        return wrong + look(case, folder, self.names, whole=False, hidden=False)


def _can_run(who: Who) -> bool:
    """Tell whether another user can run the program at all: it may lie in root's own home."""
    assert who.home is not None
    who.own(who.home)
    command = [*who.before, sys.executable, "-c", "import wamnet.cli.main, numpy"]
    try:
        with subprocess.Popen(
            command,
            cwd=who.home,
            stderr=subprocess.DEVNULL,
            preexec_fn=who.become,  # noqa: PLW1509 - this program has one thread
        ) as process:
            return process.wait(LIMIT_S) == 0
    except OSError:
        return False


def _revoke(process: subprocess.Popen[bytes], number: int) -> None:
    """End a worker of a process, as soon as there is one."""
    while process.poll() is None:
        for worker in sorted(members(process.pid) - {process.pid}):
            try:
                words = Path(f"/proc/{worker}/cmdline").read_bytes()
                if b"spawn_main" in words:
                    os.kill(worker, number)
                    return
            except (OSError, ProcessLookupError):  # it has ended meanwhile
                continue
        time.sleep(0.02)


def _words(kind: str, status: int, said: str) -> list[str]:
    """Return what is wrong with a status and with what was said."""
    wrong = [f"traceback: {said[-400:]}"] if "Traceback" in said else []
    usual = {"KILL": {-9, 0}, "INT": {130, 0, -2}, "TERM": {143, 0, -15}}.get(kind, {0, 2})
    # LLVM inside PoCL aborts where it cannot write; what is left must be right all the same.
    aborted = kind in ("full", "too long") and status == -6 and "LLVM ERROR" in said
    if status not in usual and not aborted:
        wrong.append(f"status {status}: {said[-300:]}")
    if status == 2 and said.count("wamnet: error: ") != 1:
        wrong.append(f"no error in one line: {said[-300:]}")
    return wrong


def _say(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def run(count: int, seed: int, only: Sequence[str], folder: Path, until_s: float = float("inf")) -> int:
    """Let faults happen, tell each that goes wrong, and return how many have."""
    draw, bench, began = random.Random(seed), Bench(folder), time.monotonic()
    names = list(only) or list(CASES)
    for name in names:
        bench.undisturbed(CASES[name])
        _say(f"{name}: undisturbed, {CASES[name].duration:.1f} s")
    for line in bench.cannot():
        _say(f"NOT TRIED HERE: {line}")
    weights = [1 if name in LONG else 2 for name in names]
    done, failed, missing, others = Counter(), 0, Counter(), 0
    for index in range(count):
        if time.monotonic() - began > until_s:
            break
        name = draw.choices(names, weights)[0]
        kind = draw.choice(FAULTS if CASES[name].workers else FAULTS[:-1])
        who = (bench.other if draw.random() < 0.5 else None) or Who()
        wrong = bench.fault(CASES[name], kind, random.Random(f"{seed}/{index}"), who)
        if wrong is None:
            missing[kind] += 1
            continue
        done[name, kind] += 1
        others += who.home is not None
        failed += bool(wrong)
        for what in wrong:
            _say(f"WRONG, fault {index}, {name}, {kind}, {'nobody' if who.home else 'own user'}: {what}")
    for name in names:
        _say(f"{name}: " + ", ".join(f"{done[name, kind]} {kind}" for kind in FAULTS if done[name, kind]))
    for kind, times in missing.items():
        _say(f"NOT TRIED: {times} of {kind}")
    _say("in all: " + ", ".join(f"{sum(done[n, kind] for n in names)} {kind}" for kind in FAULTS))
    _say(f"faults: {sum(done.values())} done, {others} as another user, {failed} went wrong; seed {seed}")
    return failed


def main() -> int:
    """Run the faults that the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=random.randrange(2**32))
    parser.add_argument("--only", nargs="*", choices=list(CASES), default=[])
    parser.add_argument("--seconds", type=float, default=float("inf"), help="begin none later than that")
    options = parser.parse_args()
    _say(f"seed {options.seed}")
    with tempfile.TemporaryDirectory(prefix="faults-") as name:
        Path(name).chmod(0o755)
        return min(1, run(options.count, options.seed, options.only, Path(name), options.seconds))


if __name__ == "__main__":
    sys.exit(main())
