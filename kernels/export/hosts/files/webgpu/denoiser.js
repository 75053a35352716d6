// The export's kernels on a device of WebGPU, as the manifest binds them.

// Runs all kernels of the denoiser on the check pair; returns (height, width, 3) numbers.
export async function denoised(device, { manifest, images, sources, weights, sums }) {
  const { width, height } = manifest.check;
  const runner = new Runner(device, sources);
  const buffers = {};
  for (const [name, array] of Object.entries(images)) {
    buffers[name] = runner.buffer(array);
  }
  for (const kernel of manifest.kernels.filter(({ role }) => !["path", "encode"].includes(role))) {
    const result = runner.empty(width * height * kernel.bindings.find(({ name }) => name === "result").shape[2]);
    const given = { ...buffers, result, weights: weights[kernel.role] && runner.buffer(weights[kernel.role]) };
    await runner.run(kernel, given, { width, height });
    buffers[`image_${kernel.role}`] = result; // of the first kernel of a rank: the next one's image
  }
  const found = await runner.read(buffers.image_denoise);
  return { found, paths: sums ? await pathsAlike(runner, manifest, sums) : "" };
}

// The share of the sums over paths that are the reference's except for rounding.
async function pathsAlike(runner, { check, kernels }, sums) {
  const { width, height } = check;
  const kernel = kernels.find(({ role }) => role === "path");
  const written = runner.empty(sums.length);
  const integers = { width, height, first_row: 0, rows: height, first_sample: 0, samples: 1 };
  await runner.run(kernel, { sums: written }, { ...integers, seed_number: check.sums.seed });
  const found = await runner.read(written);
  const alike = found.filter((value, i) => Math.abs(value - sums[i]) <= 6e-4 * Math.max(1, Math.abs(sums[i])));
  if (!(alike.length >= 0.98 * sums.length)) {
    throw new Error(`only ${alike.length} of ${sums.length} sums of paths are the reference's`);
  }
  return `paths: ${alike.length} of ${sums.length} sums are the reference's\n`;
}

class Runner {
  constructor(device, sources) {
    this.device = device;
    this.sources = sources;
  }

  // A buffer that holds an array.
  buffer(array, usage = GPUBufferUsage.STORAGE) {
    const made = this.device.createBuffer({ size: array.byteLength, usage: usage | GPUBufferUsage.COPY_DST });
    this.device.queue.writeBuffer(made, 0, array);
    return made;
  }

  // A buffer for so many numbers that a kernel writes.
  empty(count) {
    return this.device.createBuffer({ size: 4 * count, usage: GPUBufferUsage.STORAGE | GPUBufferUsage.COPY_SRC });
  }

  // Runs a kernel on buffers and integers by name.
  async run({ role, entry_point: entryPoint, bindings, schedule = {} }, buffers, integers) {
    const { device } = this;
    const module = device.createShaderModule({ code: this.sources[role] });
    const kinds = { read: "read-only-storage", write: "storage" };
    const layout = device.createBindGroupLayout({
      entries: bindings.map(({ slot, type, access }) => ({
        binding: slot,
        visibility: GPUShaderStage.COMPUTE,
        buffer: { type: type.includes("uniform") ? "uniform" : kinds[access] },
      })),
    });
    const pipeline = await device.createComputePipelineAsync({
      layout: device.createPipelineLayout({ bindGroupLayouts: [layout] }),
      compute: { module, entryPoint },
    });
    const sizes = bindings.find(({ name }) => name === "sizes").shape.map((name) => integers[name]);
    const padded = new Int32Array(Math.ceil(sizes.length / 4) * 4); // a uniform buffer has multiples of 16 bytes
    padded.set(sizes);
    const given = { ...buffers, sizes: this.buffer(padded, GPUBufferUsage.UNIFORM) };
    const entries = bindings.map(({ slot, name }) => ({ binding: slot, resource: { buffer: given[name] } }));
    const { group = [8, 8], pixels = 1, rows = 1 } = schedule; // items of a group, pixels of an item
    const encoder = device.createCommandEncoder();
    const pass = encoder.beginComputePass();
    pass.setPipeline(pipeline);
    pass.setBindGroup(0, device.createBindGroup({ layout, entries }));
    pass.dispatchWorkgroups(
      Math.ceil(integers.width / (group[0] * pixels)),
      Math.ceil(integers.height / (group[1] * rows)),
    );
    pass.end();
    device.queue.submit([encoder.finish()]);
  }

  // The numbers of a buffer.
  async read(buffer) {
    const { COPY_DST, MAP_READ } = GPUBufferUsage;
    const copy = this.device.createBuffer({ size: buffer.size, usage: COPY_DST | MAP_READ });
    const encoder = this.device.createCommandEncoder();
    encoder.copyBufferToBuffer(buffer, 0, copy, 0, buffer.size);
    this.device.queue.submit([encoder.finish()]);
    await copy.mapAsync(GPUMapMode.READ);
    return new Float32Array(copy.getMappedRange().slice(0));
  }
}
