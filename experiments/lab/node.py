"""A kernel as a WebAssembly module in Node, whose engine is that of Chromium: its picture, and seconds."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wamnet.compiler.artifact import Artifact
from wamnet.kernels.run.webassembly import module_of
from wamnet.refimpl.errors import ExecutorUnavailable

PROGRAM = """
import { readFileSync, writeFileSync } from "node:fs";
const folder = process.argv[2];
const { width, height, arrays, launches } = JSON.parse(readFileSync(`${folder}/size.json`));
const begun = performance.now();
const { instance } = await WebAssembly.instantiate(readFileSync(`${folder}/denoise.wasm`), {});
const { memory, wamnet_rows: rows, __heap_base: free } = instance.exports;
let end = Math.ceil(free.value / 64) * 64;
const place = (bytes) => { const start = end; end += 64 * Math.ceil(bytes / 64); return start; };
const given = arrays.map((name) => new Uint8Array(readFileSync(`${folder}/${name}`)));
const places = given.map((data) => place(data.length));
const result = place(12 * width * height);
const pointers = place(4 * (places.length + 1));
const integers = place(8);
memory.grow(Math.max(0, Math.ceil((end - memory.buffer.byteLength) / 65536)));
given.forEach((data, i) => new Uint8Array(memory.buffer).set(data, places[i]));
new Uint32Array(memory.buffer, pointers, places.length + 1).set([...places, result]);
new Uint32Array(memory.buffer, integers, 2).set([width, height]);
rows(pointers, integers, 0, height);
const first = performance.now() - begun;
writeFileSync(`${folder}/result`, new Uint8Array(memory.buffer, result, 12 * width * height));
const taken = [];
for (let i = 0; i < launches; ++i) {
  const start = performance.now();
  rows(pointers, integers, 0, height);
  taken.push((performance.now() - start) / 1000);
}
console.log(JSON.stringify({ first: first / 1000, taken, version: process.version }));
"""
"""Runs the module in a folder: on one thread, as a page does."""


def run(
    artifact: Artifact, images: Mapping[str, NDArray[np.float32]], folder: Path, launches: int
) -> tuple[NDArray[np.float32], dict[str, object]]:
    """Return a picture (H, W, 3), and seconds of the first one and of launches."""
    height, width = next(iter(images.values())).shape[:2]
    names = [array.name for array in artifact.interface.arrays][:-1]
    given = {f"image_{name}": image for name, image in images.items()} | {"weights": artifact.weights}
    for name in names:
        (folder / name).write_bytes(np.ascontiguousarray(given[name], "<f4").tobytes())
    size = {"width": width, "height": height, "arrays": names, "launches": launches}
    (folder / "size.json").write_text(json.dumps(size), encoding="utf-8")
    (folder / "denoise.wasm").write_bytes(module_of(artifact))
    (folder / "run.mjs").write_text(PROGRAM, encoding="utf-8")
    try:
        done = subprocess.run(
            ["node", folder / "run.mjs", folder], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError) as error:
        told = getattr(error, "stderr", "") or str(error)
        raise ExecutorUnavailable(f"node: {told[:300]}; install Node.js") from None
    picture = np.frombuffer((folder / "result").read_bytes(), "<f4").reshape(height, width, 3)
    return picture, json.loads(done.stdout)
