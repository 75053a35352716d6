// Random numbers as functions of counters: PCG4D and scrambled Sobol points.

export const LARGEST_WORD = 2 ** 32 - 1;

// RNG-2
export function pcg4d(x, y, z, w) {
  const start = [x, y, z, w].map((word) => Math.imul(word, 1664525) + 1013904223);
  const once = entangle(start);
  return entangle(once.map((word) => word ^ (word >>> 16)));
}

// RNG-2: the four sums, each with the words of the ones before.
function entangle([x, y, z, w]) {
  x = (x + Math.imul(y, w)) >>> 0;
  y = (y + Math.imul(z, x)) >>> 0;
  z = (z + Math.imul(x, y)) >>> 0;
  w = (w + Math.imul(y, z)) >>> 0;
  return [x, y, z, w];
}

// RNG-3
export function randomBlock(seed, pixel, sample, block) {
  return pcg4d(pixel, sample, block, seed);
}

// RNG-5
export function uniformFloat(word) {
  return (word >>> 8) / 2 ** 24;
}

// RNG-4
export function pixelCounter(x, y) {
  return (x + 65536 * y) >>> 0;
}

// SOB-1: polynomial degree, inner coefficients and first numbers of dimensions 1 to 3.
const POLYNOMIALS = [
  { degree: 1, inner: [], first: [1] },
  { degree: 2, inner: [1], first: [1, 3] },
  { degree: 3, inner: [0, 1], first: [1, 3, 1] },
];

// SOB-1: direction numbers v_k, one row a dimension.
const DIRECTIONS = [Array.from({ length: 32 }, (_, k) => 2 ** (31 - k)), ...POLYNOMIALS.map(directionNumbers)];

function directionNumbers({ degree, inner, first }) {
  // BigInt, because m_k has up to 32 bits and is shifted before it is combined.
  const m = first.map(BigInt);
  for (let k = degree; k < 32; k++) {
    let next = m[k - degree] ^ (m[k - degree] << BigInt(degree));
    for (let j = 1; j < degree; j++) {
      if (inner[j - 1]) next ^= m[k - j] << BigInt(j);
    }
    m.push(next);
  }
  return m.map((number, k) => Number(number << BigInt(31 - k)));
}

// SOB-1
export function sobolPoint(index) {
  return DIRECTIONS.map((row) => {
    let word = 0;
    for (let k = 0; k < 32; k++) {
      if ((index >>> k) & 1) word ^= row[k];
    }
    return word >>> 0;
  });
}

const MULTIPLIERS = [0x6c50b47c, 0xb82f1e52, 0xc7afe638, 0x8d22f6e6];

export function reverseBits(word) {
  let reversed = 0;
  for (let k = 0; k < 32; k++) {
    reversed = (reversed << 1) | ((word >>> k) & 1);
  }
  return reversed >>> 0;
}

// SOB-2
export function scramble(fraction, key) {
  let x = (reverseBits(fraction) + key) >>> 0;
  for (const multiplier of MULTIPLIERS) {
    x ^= Math.imul(x, multiplier);
  }
  return reverseBits(x);
}

// SOB-3
export function sobolBlock(seed, pixel, sample, block) {
  const [indexKey] = randomBlock(seed, pixel, 2 ** 32 - 1, block);
  const keys = randomBlock(seed, pixel, 2 ** 32 - 2, block);
  const point = sobolPoint(scramble(sample, indexKey));
  return point.map((coordinate, d) => scramble(coordinate, keys[d]));
}

const SAMPLERS = { pcg4d: randomBlock, sobol: sobolBlock };
export const SAMPLER_NAMES = Object.keys(SAMPLERS);

// RNG-6, SOB-3: the four floats of a block from the source that is named.
export function uniforms(sampler, seed, pixel, sample, block) {
  return SAMPLERS[sampler](seed, pixel, sample, block).map(uniformFloat);
}
