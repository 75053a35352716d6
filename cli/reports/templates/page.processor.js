// The network as a module of WebAssembly, for devices whose shaders run on the processor anyway.
//
// Its images come from textures and its picture goes back into one: everything else stays as it is. A module
// imports nothing; behind its own data (__heap_base) lie weights, images and picture, and the pointers to them.

class Processor {
  constructor(device, pass) {
    this.device = device;
    this.pass = pass;
    this.size = 0;
    this.starting = WebAssembly.instantiate(decodeBase64(pass.module), {}).then(({ instance }) => {
      this.exports = instance.exports;
      this.exports._initialize?.();
    });
  }

  /** Make room for pictures of a size: images, weights and picture in the order of the kernel's arguments. */
  resize(size) {
    if (size === this.size) {
      return;
    }
    const { memory, __heap_base: free } = this.exports;
    const weights = decodeFloats(this.pass.weights);
    const lengths = this.pass.channels.map((channels) => channels * size * size);
    let end = Math.ceil(free.value / 64) * 64;
    const place = (floats) => {
      const start = end;
      end += 64 * Math.ceil(floats / 16);
      return start;
    };
    this.images = lengths.map(place);
    const weightsAt = place(weights.length);
    this.result = place(3 * size * size);
    this.pointers = place(lengths.length + 2);
    this.integers = place(2);
    memory.grow(Math.max(0, Math.ceil((end - memory.buffer.byteLength) / 65536)));
    new Float32Array(memory.buffer, weightsAt, weights.length).set(weights);
    const pointers = [...this.images, weightsAt, this.result];
    new Uint32Array(memory.buffer, this.pointers, pointers.length).set(pointers);
    new Uint32Array(memory.buffer, this.integers, 2).set([size, size]);
    this.size = size;
  }

  /** Compute rows of a picture from textures: the first ones fetch the images, the last ones store it. */
  draw(textures, target, [first, count]) {
    const { memory, wamnet_rows: rows } = this.exports;
    const { size } = target;
    const pixels = size * size;
    this.resize(size);
    const floats = (start, channels) => new Float32Array(memory.buffer, start, channels * pixels);
    if (first === 0) {
      this.pass.channels.forEach((channels, i) => {
        const rgba = this.device.readTexture(textures[i], size);
        const image = floats(this.images[i], channels);
        for (let pixel = 0; pixel < pixels; ++pixel) {
          for (let channel = 0; channel < channels; ++channel) {
            image[channels * pixel + channel] = rgba[4 * pixel + channel];
          }
        }
      });
    }
    rows(this.pointers, this.integers, first, first + count);
    if (first + count === size) {
      const picture = floats(this.result, 3);
      const rgba = new Float32Array(4 * pixels);
      for (let pixel = 0; pixel < pixels; ++pixel) {
        rgba.set(picture.subarray(3 * pixel, 3 * pixel + 3), 4 * pixel);
      }
      this.device.write(target.textures[0], size, rgba);
    }
  }
}
