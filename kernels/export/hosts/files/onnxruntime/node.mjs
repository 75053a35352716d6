// The denoiser in ONNX Runtime for Node: npm install && node node.mjs
import { readFile } from "node:fs/promises";
import ort from "onnxruntime-node";
import { judge, load } from "./wamnet.js";

const held = await load(async (path) => new Uint8Array(await readFile(path)).buffer);
const { width, height, images: named } = held.manifest.check;
const session = await ort.InferenceSession.create(new Uint8Array(held.sources.denoise));
const given = Object.entries(named).map(([name, { channels }]) => (
  [name, new ort.Tensor("float32", held.images[`image_${name}`], [height, width, channels])]
));
const { result } = await session.run(Object.fromEntries(given));
const { right, text } = judge(held, result.data);
console.log(`ONNX Runtime for Node\n${text}\n${right ? "right" : "WRONG"}`);
process.exit(right ? 0 : 1);
