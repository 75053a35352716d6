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
  constructor(device, bytes, weights, channels) {
    this.device = device;
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

/** Weights of a kernel in tiles from those of the packed one: a block of neurons after another, and the rows of the
 * first matrix image by image. `places`: [place, neurons, place in blocks, blocks, rows, neurons of a block]. */
function inBlocks(packed, { count, places }, channels) {
  const values = new Float32Array(count);
  const order = byImage(channels, places[0][4]);
  places.forEach(([from, neurons, to, blocks, rows, width], number) => {
    for (let block = 0; block < blocks; ++block) {
      for (let row = 0; row < rows; ++row) {
        const start = from + neurons * (number === 0 ? order[row] : row);
        const some = packed.subarray(start + block * width, start + Math.min((block + 1) * width, neurons));
        values.set(some, to + (block * rows + row) * width);
      }
    }
  });
  return values;
}

/** For each input of the window, image by image, then pixel by pixel, its number pixel by pixel, then image by image. */
function byImage(channels, inputs) {
  const image = channels.flatMap((count, i) => Array(count).fill(i)); // of each channel of a pixel
  const of = (n) => image[n % image.length];
  return Array.from({ length: inputs }, (_, n) => n).sort((a, b) => of(a) - of(b) || a - b);
}
