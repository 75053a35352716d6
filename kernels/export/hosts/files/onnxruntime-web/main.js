// The denoiser in ONNX Runtime, as WebAssembly.
import * as ort from "onnxruntime-web";
import { page } from "./wamnet.js";

page(async ({ manifest, images, sources }) => {
  const { width, height, images: named } = manifest.check;
  ort.env.wasm.wasmPaths = new URL("./node_modules/onnxruntime-web/dist/", location.href).href;
  const session = await ort.InferenceSession.create(sources.denoise, { executionProviders: ["wasm"] });
  const given = Object.entries(named).map(([name, { channels }]) => (
    [name, new ort.Tensor("float32", images[`image_${name}`], [height, width, channels])]
  ));
  const { result } = await session.run(Object.fromEntries(given));
  return { found: result.data, device: `ONNX Runtime ${ort.env.versions.web}, wasm` };
});
