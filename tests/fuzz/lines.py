"""Command lines: other values of every option, and commands that want a process of their own.

1. A line runs in a child [forks.py], in a folder that has all good files [`Good`], a pipe, a folder, a link.
2. What has not ended after BEGUN_S has been accepted, and works: it gets Ctrl-C, and must end in 130.
3. The status must be 0, 1, 2 or 130; 2 comes with one error in one line, and nothing shows a traceback or
   control characters. What the child has started must end with it.
"""

import json
import os
import shutil
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from forks import Wrong, in_child
from targets import CommandRefused, Good, Target

BEGUN_S = 1.5
"""Seconds after which a command has looked at all its options, and gets Ctrl-C."""

LINES: Sequence[str] = (
    "render minicubes --width 2 --height 2 --spp 1 --feature-spp 2 --seed 1 --time 0 --yaw 1 --pitch 1 "
    "--distance 1.1 --light 1=1,1,1 --max-depth 2 --sampler sobol --dtype float32 --executor numpy "
    "--workers 1 --exposure 0 -o out.png",
    "scene minicubes --time 0.5 --set time=0.5 --yaw 3 --pitch 4 --distance 2 --light 1=1,1,0 -o out.json",
    "dataset minicubes --frames 1 --test 1 --outside 1 --size 4 --spp 1 --test-spp 1 --feature-spp 2 "
    "--start 0 --seconds 8 --arc 2 --yaw -3:3 --pitch 0:1 --distance 1:1.1 --saturation 0:0.5 --power 0.5:2 "
    "--seed 1 --max-depth 2 --executor numpy --sampler pcg4d --workers 1 -o out",
    "train -i frame.exr -t frame.exr --preset short --features color,depth --rank 0 --steps 1 --seed 1 "
    "--executor numpy -o out.safetensors",
    "train --dataset set --from model.safetensors --variant rank1 --steps 1 -o out.safetensors",
    "compile model.safetensors --target c --profile ieee --schedule plain --variant rank1 -o out",
    "compile furnace --target opencl --time 0 --set albedo=0.5 --max-depth 2 --sampler pcg4d --lanes 1 -o o",
    "compile model.safetensors --target c --max-error 0.9 --curve curve.json -o out",
    "compile model.safetensors --target c --max-ms 9 --max-loss-db 9 --frames set --size 16 -o out",
    "listing model.safetensors --target c --profile ieee -o out.txt",
    "export model.safetensors --target c --profile ieee --variant rank1 --weights buffer -o out",
    "export model.safetensors --target glsl --scene minicubes --time 0 --set time=1 --max-depth 2 "
    "--sampler pcg4d -o out",
    "certify kernel",
    "denoise model.safetensors frame.exr --executor numpy --profile ieee --schedule plain --rank 1 -o o.exr",
    "denoise model.safetensors frame.exr --executor numpy --variant hidden1+rank1 -o out.png",
    "compare picture.png picture.png --json --exposure 0",
    "compare --paths minicubes --executor opencl --width 4 --height 4 --sample 0 --spp 2 --seed 1 "
    "--max-depth 2 --time 0 --set time=1",
    "triage model.safetensors frame.exr --executor opencl --profile ieee --schedules plain --kernel kernel "
    "-o out",
    "animate model.safetensors --scene minicubes --start 0 --seconds 0.2 --fps 5 --size 4 --reference-spp 1 "
    "--seed 1 --feature-spp 2 --set warm=1,1,1 --yaw 1 --pitch 1 --distance 1 --light 1=1,1,1 "
    "--executor numpy --renderer numpy --rank 1 -o out.gif",
    "view model.safetensors --scene minicubes --fast model.safetensors --set warm=1,1,1 --port 0 "
    "--no-browser -o out.html",
    "tune model.safetensors --executor numpy --size 4 --rank 1 --force --cache out",
    "bench model.safetensors --size 8 --sizes 4,8 --only numpy* --executor numpy --repeats 1 --budget 1 "
    "--steps 1 --frames 1 --reference-spp 1 --quick -o out",
    "bench paper --synthetic --features color,normal --size 8 --only numpy* -o out",
    "bench model.safetensors --quick --size 4 --dataset set --only numpy* --budget 1 --repeats 1 -o out",
    "bench render --scenes furnace --by numpy --workers 1 --size 4 --spp 1 --depth 2 --repeats 1",
    "bench train --presets short --trainers numpy --size 32 --frames 1 --seconds 0.01 --repeats 1",
    "bench pipeline --scene furnace --executors numpy --sizes 4 --features color --hidden 4 --window 3 "
    "--feature-rays 2 --repeats 1",
    "bench exports --model model.safetensors --scene furnace --targets onnx --places",
    "bench primitives --executors opencl --kinds quads --counts 1 --size 4 --spp 1 --repeats 1",
    "executors",
    "conformance --executor reference --profile ieee -k random.block/1 --timeout 3 --json out.json "
    "--junit out.xml --track track.json",
    "conformance --executor numpy --vectors vectors --timeout 9",
    "demo --size 8 -o out",
    "demo --quick -o out",
)
"""A line of each command, with all its options."""


def lines(good: Good) -> list[Target]:
    """Return the commands' options, each command a target, and files that are read by commands apart."""
    names = dict.fromkeys(line.split()[0] for line in LINES)
    targets = [
        Target(
            f"options, {name}",
            "words",
            [_listed(line) for line in LINES if line.split()[0] == name],
            use,
            0.3,
        )
        for name in names
        for use in [partial(_options, good)]
    ]
    return targets + [
        Target(f"apart, {name}", way, [good.read(file)], partial(_apart, good, file, line), 0.3)
        for name, way, file, line in APART
    ]


APART: Sequence[tuple[str, str, str, str]] = (
    (
        "triage",
        "safetensors",
        "model.safetensors",
        "triage model.safetensors frame.exr --executor numpy --schedules plain -o out",
    ),
    (
        "triage, kernel",
        "json",
        "kernel/manifest.json",
        "triage model.safetensors frame.exr --executor opencl --kernel kernel -o out",
    ),
    (
        "animate",
        "safetensors",
        "model.safetensors",
        "animate model.safetensors --seconds 0.2 --fps 5 --size 4 -o out.gif",
    ),
    ("view", "safetensors", "model.safetensors", "view model.safetensors -o out.html"),
    (
        "dataset, scene",
        "json",
        "scene.json",
        "dataset scene.json --frames 1 --test 0 --size 4 --spp 1 -o out",
    ),
    ("view, scene", "json", "scene.json", "view model.safetensors --scene scene.json -o out.html"),
    ("export, scene", "json", "scene.json", "export model.safetensors --target c --scene scene.json -o out"),
    (
        "train, from",
        "safetensors",
        "model.safetensors",
        "train --dataset set --from model.safetensors --variant rank1 --steps 1",
    ),
    (
        "tune",
        "safetensors",
        "model.safetensors",
        "tune model.safetensors --executor numpy --size 4 --cache out",
    ),
    (
        "bench",
        "safetensors",
        "model.safetensors",
        "bench model.safetensors --quick --size 8 --frames 1 --reference-spp 1 --repeats 1 --only numpy* "
        "-o out",
    ),
    (
        "dataset, begun",
        "json",
        "set/manifest.json",
        f"{LINES[2].split(' --frames')[0]} --frames 1 --test 1 "
        "--size 4 --spp 1 --executor numpy --workers 1 -o set",
    ),
    (
        "conformance --track",
        "json",
        "track.json",
        "conformance --executor reference -k random.block/1 --track track.json",
    ),
    (
        "conformance, vectors",
        "json",
        "vectors/metric.mse.json",
        "conformance --executor reference --vectors vectors",
    ),
    ("demo, plan", "json", "begun/plan.json", "demo --quick -o begun"),
)
"""Name, way to change, the good file that is changed, and the command, in a folder of good files."""


def _listed(line: str) -> bytes:
    """Return a line as a list of words."""
    return json.dumps(line.split()).encode()


def _options(good: Good, content: bytes, folder: Path) -> None:
    """Run a line; its words are data."""
    prepare(good, folder)
    check(*in_child(json.loads(content), folder, BEGUN_S))


def _apart(good: Good, file: str, line: str, content: bytes, folder: Path) -> None:
    """Run a command on a changed file instead of a good one."""
    prepare(good, folder)
    (folder / file).write_bytes(content)
    check(*in_child(line.split(), folder, BEGUN_S))


def prepare(good: Good, folder: Path) -> None:
    """Put all good files into a folder, and things that are not files."""
    shutil.copytree(good.folder, folder, dirs_exist_ok=True)
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    (folder / "link").symlink_to("picture.png")


def check(status: int, said: str, left: bool) -> None:
    """Insist on an end as commands have it; raise a refusal for status 2, else a finding."""
    if "Traceback" in said or status not in (0, 1, 2, 130):
        raise Wrong(f"status {status}, it said {said[-400:]!r}")
    if status == 2 and (said.count("wamnet: error: ") != 1 or "wamnet: error: " not in said.splitlines()[-1]):
        raise Wrong(f"no error in one line: {said[-400:]!r}")
    if left:
        raise Wrong("a process of it was left")
    shown = said.replace("\n", "")
    if not shown.isprintable():
        raise Wrong(f"control characters reach the terminal: {ascii(shown)[:300]}")
    if status == 2:
        raise CommandRefused(said)
