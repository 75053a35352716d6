import { createRequire } from "node:module";
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";
const say = (words) => process.stdout.write(JSON.stringify(words) + "\n");
const [backend, featureLevel] = process.argv.slice(1);
let adapter;
try {
  const path = createRequire(process.cwd() + "/").resolve("webgpu");
  const { create, globals } = await import(pathToFileURL(path));
  Object.assign(globalThis, globals);
  globalThis.gpu = create([`backend=${backend}`]);
  adapter = await gpu.requestAdapter({ featureLevel });
} catch (error) {
  say({ missing: error.message });
  process.exit(0);
}
if (!adapter) {
  say({ missing: "Dawn has no adapter" });
  process.exit(0);
}
const { maxStorageBuffersPerShaderStage, maxStorageBufferBindingSize, maxBufferSize } = adapter.limits;
const requiredLimits = { maxStorageBuffersPerShaderStage, maxStorageBufferBindingSize, maxBufferSize };
const device = await adapter.requestDevice({ requiredLimits });
const made = new Map();
say({ device: adapter.info.device || adapter.info.description, described: adapter.info.description });

async function built({ source, entry, kinds }) {
  const key = entry + source;
  if (!made.has(key)) {
    device.pushErrorScope("validation");
    const module = device.createShaderModule({ code: source });
    const entries = Object.entries(kinds).map(([binding, type]) => (
      { binding: Number(binding), visibility: GPUShaderStage.COMPUTE, buffer: { type } }
    ));
    const bound = device.createBindGroupLayout({ entries });
    const layout = device.createPipelineLayout({ bindGroupLayouts: [bound] });
    const pipeline = device.createComputePipeline({ layout, compute: { module, entryPoint: entry } });
    const error = await device.popErrorScope();
    if (error) {
      throw error;
    }
    made.set(key, { pipeline, bound });
  }
  return made.get(key);
}

async function launched({ buffers, groups, kinds, ...kernel }) {
  const { pipeline, bound } = await built({ kinds, ...kernel });
  const { UNIFORM, STORAGE, COPY_SRC, COPY_DST, MAP_READ } = GPUBufferUsage;
  const held = Object.entries(buffers).map(([binding, text]) => {
    const bytes = Buffer.from(text, "base64");
    const usage = (kinds[binding] === "uniform" ? UNIFORM : STORAGE | COPY_SRC) | COPY_DST;
    const buffer = device.createBuffer({ size: bytes.length, usage });
    device.queue.writeBuffer(buffer, 0, bytes);
    return { binding, buffer, size: bytes.length };
  });
  const entries = held.map(({ binding, buffer }) => ({ binding: Number(binding), resource: { buffer } }));
  const group = device.createBindGroup({ layout: bound, entries });
  const encoder = device.createCommandEncoder();
  const compute = encoder.beginComputePass();
  compute.setPipeline(pipeline);
  compute.setBindGroup(0, group);
  compute.dispatchWorkgroups(...groups, 1);
  compute.end();
  const read = held.filter(({ binding }) => kinds[binding] === "storage").map((each) => {
    const copy = device.createBuffer({ size: each.size, usage: COPY_DST | MAP_READ });
    encoder.copyBufferToBuffer(each.buffer, 0, copy, 0, each.size);
    return { ...each, copy };
  });
  device.queue.submit([encoder.finish()]);
  const written = {};
  for (const { binding, copy } of read) {
    await copy.mapAsync(GPUMapMode.READ);
    written[binding] = Buffer.from(copy.getMappedRange().slice(0)).toString("base64");
    copy.destroy();
  }
  held.forEach(({ buffer }) => buffer.destroy());
  return { written };
}

for await (const line of createInterface({ input: process.stdin })) {
  const asked = JSON.parse(line);
  try {
    device.pushErrorScope("validation");
    const found = asked.buffers ? await launched(asked) : (await built(asked), {});
    const error = await device.popErrorScope();
    say(error ? { error: error.message } : found);
  } catch (error) {
    say({ error: error.message });
  }
}
process.exit(0);
