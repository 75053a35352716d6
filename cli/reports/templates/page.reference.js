// A clean reference of the moment that is shown: samples are added up, pass after pass, while people watch.
//
// The noisy picture is sample 0 of each pixel; the reference has samples 1, 2, ... of the same kernel, so that it
// knows nothing of the noise it is compared with. Its mean is encoded as the network's colour is.

const PASS_SAMPLES = 4; // added up by one pass of the path kernel
const JOB_MS = 120; // a job of several passes takes about this long; then the picture is shown
const MOST_PASSES = 64; // of a job
const COUNTS = [64, 256, 1024, 4096]; // samples a pixel to choose from

class Reference {
  constructor(renderer) {
    this.renderer = renderer;
    this.planes = renderer.data.paths[0].planes;
    this.encoder = renderer.data.encoders.findIndex(
      (one) => one.levels === 1 && one.images.some(({ name }) => name === "color"),
    );
    this.place = renderer.data.encoders[this.encoder].images.findIndex(({ name }) => name === "color");
    // Colour's planes are in one texture, the first ones of the kernel that follows whole paths.
    this.texture = Math.floor(this.planes.indexOf("color_r") / 4);
    this.adder = renderer.device.compile(ADDER);
    renderer.device.finish(this.adder);
    this.size = 0;
    this.count = 0;
    this.passes = 1;
    this.adding = false;
    this.moment = null;
  }

  /** Begin with another moment, as it was drawn. */
  start(moment) {
    const { renderer, renderer: { device } } = this;
    if (this.size !== moment.size) {
      this.release();
      this.sums = [0, 1].map(() => device.target(moment.size, 1));
      this.encoded = device.target(moment.size, renderer.data.encoders[this.encoder].images.length);
      this.size = moment.size;
    }
    this.moment = moment;
    this.count = 0;
  }

  /** Whether the samples are of this moment. */
  isOf({ size, frame, seed, camera, colors }) {
    const key = (one) => JSON.stringify([one.size, one.frame, one.seed, one.camera, one.colors]);
    return this.moment !== null && key(this.moment) === key({ size, frame, seed, camera, colors });
  }

  release() {
    if (this.size) {
      [...this.sums, this.encoded].forEach((target) => this.renderer.device.release(target));
    }
    this.size = 0;
  }

  /** Add samples, at most up to a number of them, and encode the mean. */
  async add(wanted) {
    const { renderer, renderer: { device } } = this;
    const scratch = renderer.sums[0];
    const passes = [];
    let { count } = this;
    for (let i = 0; i < this.passes && count < wanted; ++i) {
      const samples = Math.min(PASS_SAMPLES, wanted - count);
      passes.push({ ...renderer.trace(0, this.moment, 1 + count, samples), key: `reference ${samples}` });
      const [before, after] = this.sums;
      const keeps = count > 0;
      passes.push({
        shader: this.adder,
        target: after,
        textures: { before: before.textures[0], more: scratch.textures[this.texture] },
        set: (place) => device.gl.uniform1i(place("keeps"), keeps ? 1 : 0),
      });
      this.sums = [after, before];
      count += samples;
    }
    const textures = Object.fromEntries(scratch.textures.map((texture, i) => [`sums_${i}`, texture]));
    textures[`sums_${this.texture}`] = this.sums[0].textures[0];
    const set = (place) => device.gl.uniform1i(place("sample_count"), count);
    passes.push({ shader: renderer.encoders[this.encoder], target: this.encoded, textures, set });
    this.adding = true; // a job is done a moment before this is known here
    const ms = await renderer.strips.run(passes).finally(() => (this.adding = false));
    this.count = count;
    this.passes = clamp(Math.round((this.passes * JOB_MS) / Math.max(ms, 1)), 1, Math.min(MOST_PASSES, 2 * this.passes));
  }

  /** The encoded mean, as a texture of the screen; null before there is one. */
  get image() {
    return this.count ? this.encoded.textures[this.place] : null;
  }

  /** Distances from the reference, of the noisy picture and of the denoised one: decibels, and the latter's rms. */
  measure() {
    const { renderer, renderer: { device } } = this;
    const wanted = device.read(this.encoded, this.place);
    const [noisy, denoised] = ["color", "picture"].map((name) => meanSquare(renderer.read(name), wanted));
    return { noisy: decibels(noisy), denoised: decibels(denoised), rms: Math.sqrt(denoised) };
  }
}

/** The mean squared difference of two pictures' colours (RGBA, of which A means nothing). */
function meanSquare(found, wanted) {
  let sum = 0;
  for (let i = 0; i < wanted.length; i += 4) {
    for (let channel = 0; channel < 3; ++channel) {
      sum += (found[i + channel] - wanted[i + channel]) ** 2;
    }
  }
  return sum / (0.75 * wanted.length);
}

/** The peak signal-to-noise ratio of colours in [0, 1], as refimpl/metrics.py: psnr. */
function decibels(mse) {
  return -10 * Math.log10(mse);
}

const ADDER = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D before;
uniform sampler2D more;
uniform int keeps;
out vec4 sum;
void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    sum = texelFetch(more, at, 0);
    if (keeps == 1) {
        sum += texelFetch(before, at, 0);
    }
}
`;
