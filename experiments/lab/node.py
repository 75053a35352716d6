"""A kernel as a WebAssembly module in Node, whose engine is that of Chromium: its picture, and seconds."""

import json
import subprocess
from collections.abc import Mapping
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wamnet.compiler.artifact import Artifact
from wamnet.kernels.run.page import module_of
from wamnet.refimpl.errors import ExecutorUnavailable

PROGRAM = """
import { readFileSync, writeFileSync } from "node:fs";
const read = (name) => readFileSync(`${process.argv[2]}/${name}`);
const floats = (name) => new Float32Array(new Uint8Array(read(name)).buffer);
const { width, height, images, channels, launches } = JSON.parse(read("size.json"));
const spent = () => (process.cpuUsage().user + process.cpuUsage().system) / 1e6;
const begun = spent();
const module = new Module(read("denoise.wasm"), floats("weights"), channels);
await module.starting;
module.resize(width, height);
images.forEach((name, i) => module.image(i).set(floats(name)));
module.compute(0, height);
const first = spent() - begun;
writeFileSync(`${process.argv[2]}/result`, module.picture());
const [taken, worked] = [[], []];
for (let i = 0; i < launches; ++i) {
  const [start, before] = [performance.now(), spent()];
  module.compute(0, height);
  taken.push((performance.now() - start) / 1000);
  worked.push(spent() - before);
}
console.log(JSON.stringify({ first, taken, worked, version: process.version }));
"""
"""Runs a kernel in a folder as the page does, by its class Module: on one thread."""

PAGE = resources.files("wamnet.cli.reports") / "templates/page.processor.js"
"""The page's script, which stands before the program."""


def run(
    artifact: Artifact, images: Mapping[str, NDArray[np.float32]], folder: Path, launches: int
) -> tuple[NDArray[np.float32], dict[str, object]]:
    """Return a picture (H, W, 3), and seconds of the first one and of launches."""
    height, width = next(iter(images.values())).shape[:2]
    given = {f"image_{name}": image for name, image in images.items()} | {"weights": artifact.weights}
    for name, numbers in given.items():
        (folder / name).write_bytes(np.ascontiguousarray(numbers, "<f4").tobytes())
    names = [array.name for array in artifact.interface.arrays if array.name in given][:-1]
    channels = [given[name].shape[-1] for name in names]
    size = {"width": width, "height": height, "images": names, "channels": channels, "launches": launches}
    (folder / "size.json").write_text(json.dumps(size), encoding="utf-8")
    (folder / "denoise.wasm").write_bytes(module_of(artifact))
    (folder / "run.mjs").write_text(PAGE.read_text(encoding="utf-8") + PROGRAM, encoding="utf-8")
    try:
        done = subprocess.run(
            ["node", folder / "run.mjs", folder], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        told = getattr(error, "stderr", "") or str(error)
        raise ExecutorUnavailable(f"node: {told[:300]}; install Node.js") from None
    picture = np.frombuffer((folder / "result").read_bytes(), "<f4").reshape(height, width, 3)
    return picture, json.loads(done.stdout)
