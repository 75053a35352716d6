// The page: WebGPU of the browser.
import { denoised } from "./denoiser.js";
import { page } from "./wamnet.js";

page(async (held) => {
  const adapter = await navigator.gpu?.requestAdapter();
  if (!adapter) {
    throw new Error("this browser has no device of WebGPU");
  }
  const { vendor, architecture, description } = adapter.info;
  const { found, paths } = await denoised(await adapter.requestDevice(), held);
  return { found, device: `${paths}WebGPU, ${[vendor, architecture, description].filter(Boolean).join(" ")}` };
});
