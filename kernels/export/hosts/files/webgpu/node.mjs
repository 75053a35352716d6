// The same without a page: Dawn, which is Chromium's WebGPU, in Node. `npm install && node node.mjs`
import { readFile } from "node:fs/promises";
import { create, globals } from "webgpu";
import { denoised } from "./denoiser.js";
import { judge, load } from "./wamnet.js";

Object.assign(globalThis, globals);
globalThis.gpu = create([]); // is kept: nothing is answered once it is gone
const adapter = await gpu.requestAdapter();
if (!adapter) {
  console.error("Dawn has no device: it needs a driver of Vulkan, Metal or Direct3D 12");
  process.exit(2);
}
const held = await load(async (path) => new Uint8Array(await readFile(path)).buffer);
const { found, paths } = await denoised(await adapter.requestDevice(), held);
const { right, text } = judge(held, found);
console.log(`${paths}Dawn, ${adapter.info.device} ${adapter.info.description}\n${text}\n${right ? "right" : "WRONG"}`);
process.exit(right ? 0 : 1);
