// The network as a module of WebAssembly, for devices whose shaders run on the processor anyway.

/** A kernel of C: behind the module's own data (__heap_base) lie images, weights and picture, and pointers to them. */
class Module {
  constructor(bytes, weights, channels) {
    this.weights = weights;
    this.channels = channels; // of each image
    this.pixels = 0;
    this.starting = WebAssembly.instantiate(bytes, {}).then(({ instance }) => {
      this.exports = instance.exports;
    });
  }

  /** Make room for pictures of a size. */
  resize(width, height) {
    const { memory, __heap_base: free } = this.exports;
    let end = Math.ceil(free.value / 64) * 64;
    const place = (numbers) => {
      const start = end;
      end += 64 * Math.ceil(numbers / 16);
      return start;
    };
    this.pixels = width * height;
    const images = this.channels.map((channels) => place(channels * this.pixels));
    const weights = place(this.weights.length);
    this.places = [...images, weights, place(3 * this.pixels)];
    this.pointers = place(this.places.length);
    this.integers = place(2);
    memory.grow(Math.max(0, Math.ceil((end - memory.buffer.byteLength) / 65536)));
    new Float32Array(memory.buffer, weights, this.weights.length).set(this.weights);
    new Uint32Array(memory.buffer, this.pointers, this.places.length).set(this.places);
    new Uint32Array(memory.buffer, this.integers, 2).set([width, height]);
  }

  /** The floats of an image, to be filled. */
  image(i) {
    return new Float32Array(this.exports.memory.buffer, this.places[i], this.channels[i] * this.pixels);
  }

  /** The floats of the picture. */
  picture() {
    return new Float32Array(this.exports.memory.buffer, this.places[this.places.length - 1], 3 * this.pixels);
  }

  compute(first, count) {
    this.exports.wamnet_rows(this.pointers, this.integers, first, first + count);
  }
}

/** A module whose images come from textures, and whose picture goes back into one. */
class Processor {
  constructor(device, bytes, weights, { channels, rows }) {
    this.device = device;
    this.rows = rows; // that are computed together
    this.module = new Module(bytes, weights, channels);
    this.starting = this.module.starting;
  }

  /** Compute rows of a picture from textures: the first ones fetch the images, the last ones store it. */
  draw(textures, target, [first, count]) {
    const { module } = this;
    const { size } = target;
    if (module.pixels !== size * size) {
      module.resize(size, size);
    }
    if (first === 0) {
      module.channels.forEach((channels, i) => {
        const rgba = this.device.readTexture(textures[i], size);
        const image = module.image(i);
        for (let at = 0; at < image.length; ++at) {
          image[at] = rgba[4 * Math.floor(at / channels) + (at % channels)];
        }
      });
    }
    module.compute(first, count);
    if (first + count === size) {
      const picture = module.picture();
      const rgba = new Float32Array(4 * module.pixels);
      for (let at = 0; at < picture.length; ++at) {
        rgba[4 * Math.floor(at / 3) + (at % 3)] = picture[at];
      }
      this.device.write(target.textures[0], size, rgba);
    }
  }
}

/** Weights of a kernel with transforms: the spectra of the packed one's (FOU-4), as
 * compiler/schedules/fft.py: Transformed.stored, and all others. */
function transformed(packed, { from, to, window, order, others }) {
  const [columns, groups, points, pairs, halves, parts, lanes] = to.shape;
  const [inputs, neurons] = from.shape;
  const channels = inputs / (window * window);
  const rest = decodeFloats(others);
  const count = to.shape.reduce((a, b) => a * b);
  const values = new Float32Array(rest.length + count);
  values.set(rest.subarray(0, to.offset));
  values.set(rest.subarray(to.offset), to.offset + count);
  const turns = Float64Array.from({ length: points }, (_, k) => (2 * Math.PI * k) / points);
  const [cosines, sines] = [turns.map(Math.cos), turns.map(Math.sin)];
  const [real, imaginary] = [new Float64Array(window), new Float64Array(window)]; // of each row of the window
  const transformRows = (neuron, c, k) => {
    for (let y = 0; y < window; ++y) {
      real[y] = imaginary[y] = 0;
      for (let x = 0; x < window; ++x) {
        const weight = packed[from.offset + neurons * ((y * window + x) * channels + c) + neuron];
        real[y] += weight * cosines[(k * x) % points];
        imaginary[y] += weight * sines[(k * x) % points];
      }
    }
  };
  const store = (at, k, f) => {
    let [a, b] = [0, 0];
    for (let y = 0; y < window; ++y) {
      const turn = (f * y) % points;
      a += real[y] * cosines[turn] - imaginary[y] * sines[turn];
      b += real[y] * sines[turn] + imaginary[y] * cosines[turn];
    }
    values[at] = a / (2 * points * points);
    // A frequency that is its own negative is real.
    values[at + lanes] = (2 * k) % points || (2 * f) % points ? b / (2 * points * points) : 0;
  };
  order.forEach((neuron, place) => {
    for (let c = 0; c < channels; ++c) {
      for (let k = 0; k < columns; ++k) {
        transformRows(neuron, c, k);
        for (let f = 0; f < points; ++f) {
          const row = (k * groups + Math.floor(place / lanes)) * points + f;
          const pair = (row * pairs + (c % pairs)) * halves + Math.floor(c / pairs);
          store(to.offset + pair * parts * lanes + (place % lanes), k, f);
        }
      }
    }
  });
  return values;
}
