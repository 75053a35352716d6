// What all pages share: the export's files, the comparison with the reference, and the two pictures.
//
// manifest.json says all that differs from model to model. Arrays are (height, width, channels), rows from the top.

// Everything that a host needs; `read` gives the bytes of a file of this folder.
export async function load(read = fetched) {
  const floats = async (path) => new Float32Array(await read(path));
  const text = async (path) => new TextDecoder().decode(await read(path));
  const manifest = JSON.parse(await text("manifest.json"));
  const { check, kernels } = manifest;
  const images = {};
  for (const [name, { file }] of Object.entries(check.images)) {
    images[`image_${name}`] = await floats(`check/${file}`);
  }
  const sources = {}, weights = {};
  for (const { role, files, bindings } of kernels) {
    sources[role] = files[0].endsWith(".onnx") ? await read(files[0]) : await text(files[0]);
    if (bindings.some(({ name }) => name === "weights")) {
      weights[role] = await floats(`${role}/weights.bin`);
    }
  }
  const sums = check.sums ? await floats(`check/${check.sums.file}`) : null;
  const [expected, bound] = [await floats("check/output.f32"), await floats("check/bound.f32")];
  return { manifest, images, sources, weights, sums, expected, bound };
}

async function fetched(path) {
  const answer = await fetch(path);
  if (!answer.ok) {
    throw new Error(`${path} cannot be read: start the page by \`node serve.mjs\` in the export's folder`);
  }
  return answer.arrayBuffer();
}

// A picture (height, width, 3) against the reference's: written so that NaN is wrong.
export function judge({ manifest, expected, bound }, found) {
  const { added } = manifest.host.storage;
  let [worst, most, wrong] = [0, 0, 0];
  expected.forEach((value, i) => {
    const error = Math.abs(found[i] - value), allowed = bound[i] + added;
    wrong += error <= allowed ? 0 : 1;
    worst = error <= worst ? worst : error;
    most = Math.max(most, allowed);
  });
  const numbers = `largest error ${worst.toPrecision(3)}, allowed ${most.toPrecision(3)}`;
  return { right: wrong === 0, text: `${numbers}; ${wrong} of ${expected.length} numbers are wrong` };
}

// ---- textures of WebGL

// An array (count, channels) as texels of four numbers.
export function texels(array, channels) {
  const found = new Float32Array((array.length / channels) * 4);
  for (let i = 0; i < array.length; ++i) {
    found[Math.floor(i / channels) * 4 + (i % channels)] = array[i];
  }
  return found;
}

// Weights as texels of one number, 1024 in a row, filled up with zeros.
export function weightTexels(weights) {
  const height = Math.ceil(weights.length / 1024);
  const data = new Float32Array(1024 * height);
  data.set(weights);
  return { data, width: 1024, height };
}

// The first three numbers of each texel.
export function colours(texels) {
  return Float32Array.from({ length: (texels.length / 4) * 3 }, (_, i) => texels[Math.floor(i / 3) * 4 + (i % 3)]);
}

// A shader without its first line, for engines that write `#version 300 es` themselves.
export function versionless(source) {
  return source.replace(/^#version .*\n/, "");
}

// ---- the page

// A picture (height, width, 3): it is encoded for the display already.
function draw(name, picture, width, height) {
  const canvas = document.getElementById(name);
  [canvas.width, canvas.height] = [width, height];
  const data = canvas.getContext("2d").createImageData(width, height);
  for (let i = 0; i < width * height * 4; ++i) {
    data.data[i] = i % 4 === 3 ? 255 : 255 * picture[Math.floor(i / 4) * 3 + (i % 4)] + 0.5;
  }
  canvas.getContext("2d").putImageData(data, 0, 0);
}

// Runs a host on the check pair and says on the page, and to serve.mjs, what it found.
export async function page(denoise) {
  let told;
  try {
    const held = await load();
    const { width, height, images } = held.manifest.check;
    const [first] = Object.keys(images);
    draw("noisy", held.images[`image_${first}`], width, height);
    const { found, device } = await denoise(held);
    draw("denoised", found, width, height);
    const { right, text } = judge(held, found);
    told = `${device}\n${text}\n${right ? "right" : "WRONG"}`;
  } catch (error) {
    told = `${error}\n${error.stack}\nWRONG`;
  }
  document.getElementById("verdict").textContent = told;
  await fetch("verdict", { method: "POST", body: told }).catch(() => {});
}
