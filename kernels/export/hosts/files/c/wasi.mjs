// Runs host.wasm in Node, with the folder of the export as its own.
import { readFile } from "node:fs/promises";
import { WASI } from "node:wasi";

const wasi = new WASI({ version: "preview1", args: ["host"], preopens: { ".": "." } });
const module = await WebAssembly.compile(await readFile("host.wasm"));
const instance = await WebAssembly.instantiate(module, wasi.getImportObject());
process.exitCode = wasi.start(instance);
