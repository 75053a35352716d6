// Pictures: paths, encoding, denoiser, one pass after another, in strips that never hold the page up.

const WEIGHT_COLUMNS = 1024; // texels in a row of the weight texture, as the kernels read it
const BATCH_MS = 40; // work that is handed to the device at once
const POLL_MS = 3; // between two looks at a fence
const QUICK_MS = 12; // what comes back sooner may have been done at once

/** Jobs in strips: each is a list of passes; one fence at a time. */
class Strips {
  constructor(device) {
    this.device = device;
    this.jobs = [];
    this.pixelMs = new Map(); // by shader, or a pass's own key: what a pixel is believed to cost
    this.sync = null;
  }

  /** Do passes {shader, target, textures, set}, or {processor, target, textures}; resolve with the milliseconds from the first strip on. */
  run(passes) {
    return new Promise((done, failed) => this.jobs.push({ passes, at: 0, row: 0, done, failed, start: 0 }));
  }

  get busy() {
    return this.jobs.length > 0;
  }

  /** Forget everything: the context is gone. */
  drop() {
    this.jobs.forEach((job) => job.failed(new Lost("while a picture was drawn")));
    this.jobs = [];
    this.sync = null;
    this.pixelMs.clear();
  }

  /** Once a frame of the screen: see whether the last batch is done, and hand out the next one. */
  tick(now) {
    if (this.sync) {
      if (!this.device.isPassed(this.sync)) {
        return;
      }
      this.sync = null;
      this.learn(now - this.handedAt);
    }
    const job = this.jobs[0];
    if (!job) {
      return;
    }
    if (job.at === job.passes.length) {
      this.jobs.shift();
      job.done(now - job.start);
      this.tick(now);
      return;
    }
    job.start = job.start || now;
    this.hand(job, now);
  }

  /** Hand out strips worth BATCH_MS. */
  hand(job, now) {
    this.batch = new Set();
    this.guess = 0;
    while (job.at < job.passes.length && this.guess < BATCH_MS) {
      const pass = job.passes[job.at];
      const size = pass.target.size;
      const key = pass.key || pass.shader || pass.processor;
      const known = this.pixelMs.has(key);
      if (!known && this.batch.size) {
        break; // drivers compile when they draw first: this row is measured alone
      }
      const cost = (known ? this.pixelMs.get(key) : 1) * size;
      // Devices shade squares of 2 x 2 pixels: a single row would cost as much as two.
      const least = pass.processor?.rows || 2;
      const fit = known ? Math.max(1, Math.floor((BATCH_MS - this.guess) / (least * cost))) : 1;
      const rows = Math.min(least * fit, size - job.row);
      if (pass.processor) {
        pass.processor.draw(pass.textures, pass.target, [job.row, rows]);
      } else {
        this.device.draw(pass.shader, pass.target, pass.textures, pass.set, [job.row, rows]);
      }
      this.batch.add(key);
      job.row += rows;
      if (job.row === size) {
        job.at += 1;
        job.row = 0;
      }
      if (!known) {
        this.pixelMs.set(key, BATCH_MS / (16 * size)); // from here on 16 rows, then as measured
        this.guess = BATCH_MS;
        this.batch.clear();
      }
      this.guess += cost * rows;
    }
    this.sync = this.device.fence();
    this.handedAt = now;
    this.poll();
  }

  /** Look at the fence between the frames of the screen too: a slow device must not wait for them. */
  poll() {
    const sync = this.sync;
    setTimeout(() => {
      if (sync && this.sync === sync) {
        this.tick(performance.now());
        if (this.sync === sync) {
          this.poll();
        }
      }
    }, POLL_MS);
  }

  /** Correct what pixels are believed to cost. */
  learn(ms) {
    const factor = ms <= QUICK_MS ? 0.5 : clamp(ms / Math.max(this.guess, 1), 0.5, 4);
    for (const key of this.batch) {
      this.pixelMs.set(key, this.pixelMs.get(key) * factor);
    }
  }
}

/** The shaders and textures of one scene and its networks. */
class Renderer {
  constructor(device, data) {
    this.device = device;
    this.data = data;
    this.strips = new Strips(device);
    this.build();
  }

  /** Start all that does not depend on a size; once more after the context was lost. */
  build() {
    const { device, data } = this;
    this.size = 0;
    this.shown = null;
    this.sums = [];
    this.between = [];
    this.whole = [];
    this.pictures = [];
    this.paths = data.paths.map((path) => device.compile(path.source));
    this.encoders = data.encoders.map((encoder) => device.compile(encoder.source));
    this.screen = device.compile(SCREEN);
    this.variants = new Map();
  }

  /** Everything that a variant needs, being compiled from the first call on. */
  variant(name) {
    if (!this.variants.has(name)) {
      const facts = this.data.variants.find((variant) => variant.name === name);
      const passes = facts.passes.map((pass) =>
        pass.module
          ? { ...pass, processor: this.processor(pass) }
          : { ...pass, shader: this.device.compile(pass.source), weights: this.weights(pass) },
      );
      this.variants.set(name, { name, facts, passes, ready: false });
    }
    return this.variants.get(name);
  }

  /** What computes a pass that is a module; spectra among its weights are made of another variant's. */
  processor({ module, weights, ...facts }) {
    const other = this.data.variants.find((variant) => variant.name === weights.of);
    const values = other ? transformed(decodeWeights(other.passes[0].weights), weights) : decodeFloats(weights);
    return new Processor(this.device, decodeBase64(module), values, facts);
  }

  /** A pass's weights as whole rows of texels of one float or four. */
  weights(pass) {
    const values = decodeWeights(pass.weights);
    const row = WEIGHT_COLUMNS * pass.texel;
    const rows = Math.max(1, Math.ceil(values.length / row));
    const padded = new Float32Array(rows * row);
    padded.set(values);
    return this.device.texture(WEIGHT_COLUMNS, rows, padded, pass.texel === 1);
  }

  /** Wait for shaders without holding anything up; `report` is told how many are done. */
  async compiled(shaders, report) {
    for (let done = 0; done < shaders.length; ++done) {
      report(done, shaders.length);
      await nextFrame();
      while (!this.device.isCompiled(shaders[done]) && !this.device.gl.isContextLost()) {
        await nextFrame();
      }
      this.device.finish(shaders[done]);
    }
  }

  async prepare(name, report) {
    const variant = this.variant(name);
    const common = [this.screen, ...this.paths, ...this.encoders];
    const waiting = variant.passes.flatMap((pass) => pass.shader || []);
    await this.compiled(this.ready ? waiting : [...common, ...waiting], report);
    await Promise.all(variant.passes.map((pass) => pass.processor?.starting));
    this.ready = variant.ready = true;
  }

  /** Make the targets for a size: what is drawn next must not destroy what is shown. */
  resize(size) {
    if (size === this.size) {
      return;
    }
    const { device, data } = this;
    const drawn = this.pictures.flatMap((one) => [...one.features, one.result]);
    [...this.sums, ...this.between, ...this.whole, ...drawn].forEach((target) => device.release(target));
    this.sums = data.paths.map((path) => device.target(size, Math.ceil(path.planes.length / 4)));
    this.between = [];
    this.whole = []; // features of a network of integers, which nobody sees
    this.pictures = [0, 1].map(() => ({
      features: this.encodersOf(1).map(({ encoder }) => device.target(size, encoder.images.length)),
      result: device.target(size, 1),
    }));
    this.shown = null;
    this.size = size;
  }

  /** Targets between the passes of a denoiser. */
  scratch(size, count) {
    const found = this.between.find((one) => one.size === size && one.textures.length === count);
    if (found) {
      return found;
    }
    this.between.push(this.device.target(size, count));
    return this.between[this.between.length - 1];
  }

  /** The passes of a denoiser on feature textures. */
  denoising(variant, images, result) {
    let given = images;
    return variant.passes.map((pass, number) => {
      const last = number === variant.passes.length - 1;
      const target = last ? result : this.scratch(result.size, pass.buffers);
      const reads = given;
      if (pass.processor) {
        return { processor: pass.processor, target, textures: pass.reads.map((name) => reads[name]) };
      }
      const textures = { weight_texture: pass.weights };
      pass.reads.forEach((name) => (textures[`image_${name}`] = reads[name]));
      given = Object.fromEntries(target.textures.map((texture, i) => [`horizontal_${i}`, texture]));
      return { shader: pass.shader, target, textures, set: () => {} };
    });
  }

  /** The pass that adds up samples of a moment, from a first one on, with one of the kernels of paths. */
  trace(number, { size, frame, seed, camera, colors }, first, samples) {
    const { gl } = this.device;
    const numbers = sceneNumbers(this.data, frame, camera, colors);
    const set = (place) => {
      for (const [name, value] of Object.entries({ width: size, height: size, first_row: 0, samples })) {
        gl.uniform1i(place(name), value);
      }
      gl.uniform1ui(place("first_sample"), first);
      gl.uniform1ui(place("seed_number"), seed);
      gl.uniform4fv(place("scene_numbers"), numbers);
    };
    return { shader: this.paths[number], target: this.sums[number], textures: {}, set };
  }

  /** Draw a frame; resolve with the milliseconds that it took. */
  async draw({ variant, ...moment }) {
    const { gl } = this.device;
    this.resize(moment.size);
    const picture = this.pictures[this.shown === this.pictures[0] ? 1 : 0];
    const images = this.images(picture);
    const tracing = this.paths.map((_, i) => this.trace(i, moment, 0, 1));
    const sums = this.sums.map((target) =>
      Object.fromEntries(target.textures.map((texture, i) => [`sums_${i}`, texture])),
    );
    const encode = (levels, targets) =>
      this.encodersOf(levels).map(({ encoder, shader }, i) => ({
        shader,
        target: targets[i],
        textures: sums[encoder.path],
        set: (place) => gl.uniform1i(place("sample_count"), 1),
      }));
    const chosen = this.variant(variant);
    const { levels } = chosen.facts;
    const encoding = encode(1, picture.features);
    let read = images;
    if (levels > 1) {
      this.whole = this.whole.length
        ? this.whole
        : this.encodersOf(levels).map(({ encoder }) => this.device.target(moment.size, encoder.images.length));
      encoding.push(...encode(levels, this.whole));
      read = this.imagesIn(this.whole, levels);
    }
    const denoising = this.denoising(chosen, read, picture.result);
    const ms = await this.strips.run([...tracing, ...encoding, ...denoising]);
    // A picture of another size may have been begun meanwhile: this one's textures are gone then.
    this.shown = this.pictures.includes(picture) ? picture : this.shown;
    return ms;
  }

  /** The encoders of features as numbers up to 1, or as integers up to `levels`, with their shaders. */
  encodersOf(levels) {
    const all = this.data.encoders.map((encoder, i) => ({ encoder, shader: this.encoders[i] }));
    return all.filter(({ encoder }) => encoder.levels === levels);
  }

  /** Feature textures by name. */
  images(picture) {
    return this.imagesIn(picture.features, 1);
  }

  imagesIn(targets, levels) {
    const pairs = this.encodersOf(levels).flatMap(({ encoder }, i) =>
      encoder.images.map((image, k) => [image.name, targets[i].textures[k]]),
    );
    return Object.fromEntries(pairs);
  }

  /** Denoise the picture that the page carries: the largest error and error / bound, and whether its bits are
   * the reference's where each is promised. */
  async check(name) {
    const variant = this.variant(name);
    const { size, images } = this.data.check;
    const { device } = this;
    const textures = Object.fromEntries(
      Object.entries(images).map(([image, { channels, values }]) => {
        const floats = steps(decodeFloats(values), variant.facts.levels);
        const rgba = new Float32Array(4 * size * size);
        for (let pixel = 0; pixel < size * size; ++pixel) {
          rgba.set(floats.subarray(pixel * channels, (pixel + 1) * channels), 4 * pixel);
        }
        return [image, device.texture(size, size, rgba)];
      }),
    );
    const result = device.target(size, 1);
    await this.strips.run(this.denoising(variant, textures, result));
    const found = device.read(result, 0);
    Object.values(textures).forEach((texture) => device.gl.deleteTexture(texture));
    device.release(result);
    const expected = decodeFloats(variant.facts.check.expected);
    const whole = variant.facts.check.bound === null; // of integers no number may be off
    const bound = whole ? new Float32Array(expected.length) : decodeFloats(variant.facts.check.bound);
    let error = 0;
    let share = 0;
    expected.forEach((value, i) => {
      const off = Math.abs(found[4 * Math.floor(i / 3) + (i % 3)] - value);
      error = off <= error ? error : off; // a NaN stays
      const part = off === 0 ? 0 : off / bound[i]; // a bound may be 0
      share = part <= share ? share : part;
    });
    const { sha256 } = variant.facts.check;
    const bits = sha256 && (await compareBits(found, expected, size, sha256));
    return { error, share, bits, bound: bound.reduce((a, b) => Math.max(a, b)) };
  }

  /** Show two images of the last picture, left and right of a line at `wipe` (0 to 1); `reference`: a texture. */
  show(left, right, wipe, reference = null) {
    if (!this.shown) {
      return;
    }
    const { gl } = this.device;
    if (gl.canvas.width !== this.size) {
      gl.canvas.width = gl.canvas.height = this.size;
    }
    const denoised = this.shown.result.textures[0];
    const clean = reference || denoised;
    const images = { ...this.images(this.shown), picture: denoised, reference: clean, difference: denoised };
    const textures = { left: images[left], right: images[right], clean };
    this.device.draw(this.screen, null, textures, (place) => {
      gl.uniform1f(place("wipe"), wipe);
      gl.uniform2f(place("is_signed"), left === "normal" ? 1 : 0, right === "normal" ? 1 : 0);
      gl.uniform2f(place("is_difference"), left === "difference" ? 1 : 0, right === "difference" ? 1 : 0);
    });
  }

  /** Floats of an image of the last picture ("whole_color": as a network of integers reads it), or of the path kernels' sums ("sums_0", ...), for tests. */
  read(name) {
    if (name === "picture") {
      return this.device.read(this.shown.result, 0);
    }
    if (name.startsWith("sums_")) {
      const places = this.sums.flatMap((target) => target.textures.map((_, i) => [target, i]));
      return this.device.read(...places[Number(name.slice(5))]);
    }
    const [levels, targets] = name.startsWith("whole_") ? [127, this.whole] : [1, this.shown.features];
    for (const [i, { encoder }] of this.encodersOf(levels).entries()) {
      const number = encoder.images.findIndex((image) => image.name === name.replace("whole_", ""));
      if (number >= 0) {
        return this.device.read(targets[i], number);
      }
    }
    throw new Error(`there is no image ${name}`);
  }
}

const SCREEN = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D left;
uniform sampler2D right;
uniform float wipe;
uniform sampler2D clean;
uniform vec2 is_signed;
uniform vec2 is_difference;
out vec4 color;
void main()
{
    ivec2 size = textureSize(left, 0);
    ivec2 at = ivec2(int(gl_FragCoord.x), size.y - 1 - int(gl_FragCoord.y));
    vec3 l = texelFetch(left, at, 0).rgb;
    vec3 r = texelFetch(right, at, 0).rgb;
    l = mix(l, 0.5 + 0.5 * l, is_signed.x);
    r = mix(r, 0.5 + 0.5 * r, is_signed.y);
    vec3 c = texelFetch(clean, at, 0).rgb;
    l = mix(l, 4.0 * abs(l - c), is_difference.x);
    r = mix(r, 4.0 * abs(r - c), is_difference.y);
    color = vec4(gl_FragCoord.x < wipe * float(size.x) ? l : r, 1.0);
}
`;

/** Compare the bits of a picture (RGBA) with the reference's (RGB): digest, and the first other number. */
async function compareBits(found, expected, size, sha256) {
  const rgb = Float32Array.from(expected, (_, i) => found[4 * Math.floor(i / 3) + (i % 3)]);
  const [mine, wanted] = [rgb, Float32Array.from(expected)].map((values) => new Uint32Array(values.buffer));
  const at = mine.findIndex((word, i) => word !== wanted[i]);
  const pixel = Math.floor(at / 3);
  const place = { x: pixel % size, y: Math.floor(pixel / size), channel: at % 3 };
  const first = at < 0 ? null : { ...place, found: rgb[at], wanted: expected[at] };
  // Browsers hash on pages that they trust: a file's, this machine's, or one that came encrypted.
  const hash = globalThis.crypto?.subtle && (await crypto.subtle.digest("SHA-256", rgb));
  const digits = hash && Array.from(new Uint8Array(hash), (byte) => byte.toString(16).padStart(2, "0"));
  const digest = digits ? digits.join("") : first ? "" : sha256;
  return { first, digest, same: !first && digest === sha256 };
}

/** Weights from base64 of floats; or from bytes of integers, with those of more bits by their places. */
function decodeWeights(text) {
  if (typeof text === "string") {
    return decodeFloats(text);
  }
  const values = Float32Array.from(new Int8Array(decodeBase64(text.bytes).buffer));
  text.large.forEach(([place, value]) => (values[place] = value));
  return values;
}

/** Features as a network reads them: as they are, or integers, as refimpl/network/whole.py: steps_of. */
function steps(values, levels) {
  return levels === 1
    ? values
    : values.map((x) => clamp(Math.floor(levels * x + 0.5), -levels, levels));
}

function clamp(x, low, high) {
  return Math.max(low, Math.min(high, x));
}

function nextFrame() {
  return new Promise((done) => requestAnimationFrame(done));
}
