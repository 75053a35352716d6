// A network in which no operation rounds (WHO-1 to WHO-8, WHO-14).
//
// Its layers have integer weights (a list of rows), a factor and a bias for each row. All numbers are below
// 2^53, so that they are exact in doubles; words that wrap are cut to 32 bits.

import { clip, roundHalfEven } from "./numbers.mjs";
import { omegaOf, product } from "./network.mjs";
import { Refusal, require, requireInteger } from "./refusal.mjs";

const INPUT_LEVELS = 127;
const WEIGHT_LEVELS = 127;
const TURN = 2 ** 24;
const EXACT = 2 ** 24;
const MOST_FRACTION = 8;
const LARGEST_INT = 2 ** 31 - 1;
const MOST_INPUTS = 2 ** 13;
const COLOUR_STEPS = 2 ** 16;
const SPREAD = 1 / 100;

// WHO-5
const SINES = {
  127: { c1: 51053, c3: 20871, c5: 2332, shift: 24 },
  511: { c1: 51355, c3: 20996, c5: 2347, shift: 22 },
};

// WHO-2: a feature, rounded to float32, as an integer.
export function stepsOf(x) {
  return Math.floor(INPUT_LEVELS * Math.fround(x) + 0.5);
}

// WHO-5
export function wholeSine(phase, amplitude) {
  const { c1, c3, c5, shift } = SINES[amplitude];
  const folded = phase & 2 ** 22 ? ~phase : phase;
  const m = (folded >>> 6) & 0xffff;
  const z = Math.floor((m * m) / 2 ** 16);
  const q = c1 - Math.floor((z * (c3 - Math.floor((z * c5) / 2 ** 16))) / 2 ** 16);
  const magnitude = Math.floor((m * q + 2 ** (shift - 1)) / 2 ** shift);
  return phase & 2 ** 23 ? -magnitude : magnitude;
}

// WHO-4: a word that wraps.
export function phaseOf(sum, factor, bias) {
  return (Math.imul(sum, factor) + bias) >>> 0;
}

// WHO-6: a channel of the colour.
function colourOf(sum, factor, bias, fraction) {
  const u = clip(sum * factor + bias, 0, COLOUR_STEPS * 2 ** fraction);
  return Math.floor(u / 2 ** fraction) / COLOUR_STEPS;
}

// WHO-3 to WHO-6: what each layer gives; the last one is the colour.
export function forwardWhole(network, n) {
  const { layers, amplitude, fraction } = network;
  const outputs = [];
  let input = n;
  layers.forEach(({ weight, factor, bias }, l) => {
    const sums = weight.map((row) => product(row, input));
    const isLast = l === layers.length - 1;
    input = sums.map((sum, i) =>
      isLast ? colourOf(sum, factor[i], bias[i], fraction) : wholeSine(phaseOf(sum, factor[i], bias[i]), amplitude),
    );
    outputs.push(input);
  });
  return outputs;
}

// WHO-3: the largest input of a layer.
const largestInput = (layer, amplitude) => (layer === 0 ? INPUT_LEVELS : amplitude);

const magnitudes = (row) => row.reduce((total, weight) => total + Math.abs(weight), 0);

// WHO-1
export function checkAmplitude(amplitude) {
  require(Object.hasOwn(SINES, amplitude), `amplitude ${amplitude}: must be 127 or 511`);
}

// WHO-1, WHO-3, WHO-6
export function checkWhole({ layers, amplitude, fraction }) {
  checkAmplitude(amplitude);
  requireInteger(fraction, "fraction", 0, MOST_FRACTION);
  require(layers.length > 0, "a network must have a layer");
  layers.forEach((layer, l) => {
    const { weight, factor, bias } = layer;
    const isLast = l === layers.length - 1;
    const before = l === 0 ? weight[0].length : layers[l - 1].weight.length;
    require(weight.every((row) => row.length === before), `layer ${l}: must have an input for each output before`);
    require(factor.length === weight.length && bias.length === weight.length, `layer ${l}: rows differ in number`);
    weight.flat().forEach((q) => requireInteger(q, `a weight of layer ${l}`, -WEIGHT_LEVELS, WEIGHT_LEVELS));
    factor.forEach((m) => requireInteger(m, `a factor of layer ${l}`, 0, TURN - 1));
    bias.forEach((b) => requireInteger(b, `a bias of layer ${l}`, isLast ? -TURN : 0, TURN - 1));
    require(holdsSums(layer, largestInput(l, amplitude)), `layer ${l}: sums must be below 2^24`);
    if (isLast) require(holdsColour(layer, largestInput(l, amplitude)), "the last layer must not leave int32");
  });
}

// WHO-3
function holdsSums({ weight }, largest) {
  return weight.every((row) => magnitudes(row) * largest < EXACT);
}

// WHO-6
function holdsColour({ weight, factor, bias }, largest) {
  return weight.every((row, i) => magnitudes(row) * largest * factor[i] + Math.abs(bias[i]) <= LARGEST_INT);
}

// WHO-1, WHO-3, WHO-6 of a last layer that has just been rounded.
function holdsLast(layer, largest) {
  const inRange = layer.factor.every((m) => m < TURN) && layer.bias.every((b) => b >= -TURN && b < TURN);
  return inRange && holdsSums(layer, largest) && holdsColour(layer, largest);
}

// WHO-7: the real weights of a layer in units of its factors, and the factors.
function scaledRows(weight, gain, largest) {
  const room = Math.floor((EXACT - 1) / largest) - 2 * weight[0].length;
  const real = weight.map((row) => row.map((w) => w * (gain / largest)));
  const factor = real.map((row) => {
    const greatest = row.reduce((most, r) => Math.max(most, Math.abs(r)), 0);
    return Math.max(1, Math.ceil(greatest / WEIGHT_LEVELS), Math.ceil(magnitudes(row) / room));
  });
  return { factor, scaled: real.map((row, i) => row.map((r) => r / factor[i])) };
}

// WHO-7: what a layer's sums are multiplied by: parts of a turn, or of a colour's step in the last layer.
function gainOf(network, layer, fraction) {
  const isLast = layer === network.layers.length - 1;
  return isLast ? COLOUR_STEPS * 2 ** fraction : (omegaOf(network, layer) / (2 * Math.PI)) * TURN;
}

const modulo = (x, divisor) => ((x % divisor) + divisor) % divisor;

// WHO-7: factors and biases of hidden layers are taken modulo a turn.
function asHidden({ weight, factor, bias }) {
  return { weight, factor: factor.map((m) => modulo(m, TURN)), bias: bias.map((b) => modulo(b, TURN)) };
}

// WHO-7, WHO-8: one layer, whose factors and biases are not yet taken modulo a turn.
function roundedLayer(network, l, size, amplitude, fraction) {
  const { weight, bias } = network.layers[l];
  const isLast = l === network.layers.length - 1;
  const gain = gainOf(network, l, fraction);
  const { factor, scaled } = scaledRows(weight, gain, largestInput(l, amplitude));
  const half = isLast ? 2 ** (fraction - 1) : 0;
  return {
    weight: scaled.map((row) => (l === 0 ? diffused(row, size) : row.map(roundHalfEven))),
    factor,
    bias: bias.map((b) => roundHalfEven(b * gain + half)),
    scaled,
  };
}

// WHO-7
export function rounded(network, size, amplitude) {
  const { layers } = network;
  checkAmplitude(amplitude);
  require(layers[0].weight[0].length % size ** 2 === 0, "the inputs must be taps of a window of this size");
  const widths = layers.flatMap(({ weight }) => [weight.length, weight[0].length]);
  require(Math.max(...widths) <= MOST_INPUTS, "a network of integers must have at most 2^13 numbers a layer");
  const last = layers.length - 1;
  const hidden = layers.slice(0, -1).map((_, l) => asHidden(roundedLayer(network, l, size, amplitude, 0)));
  for (let fraction = MOST_FRACTION; fraction >= 0; fraction--) {
    const { weight, factor, bias } = roundedLayer(network, last, size, amplitude, fraction);
    const layer = { weight, factor, bias };
    if (!holdsLast(layer, largestInput(last, amplitude))) continue;
    const result = { layers: [...hidden, layer], amplitude, fraction };
    checkWhole(result);
    return result;
  }
  throw new Refusal("the last layer holds its limits with no fraction");
}

// WHO-8: where a tap's error goes: rows below, columns ahead, and the share in sixteenths.
const SHARES = [
  { below: 0, ahead: 1, share: 7 },
  { below: 1, ahead: -1, share: 3 },
  { below: 1, ahead: 0, share: 5 },
  { below: 1, ahead: 1, share: 1 },
];

// WHO-8: a row of weights of the first layer, each channel by itself.
function diffused(row, size) {
  const channels = row.length / size ** 2;
  const values = [...row];
  const result = new Array(row.length);
  const indexOf = (y, x, channel) => (y * size + x) * channels + channel;
  for (let channel = 0; channel < channels; channel++) {
    for (let y = 0; y < size; y++) {
      const step = y % 2 === 0 ? 1 : -1;
      for (let i = 0; i < size; i++) {
        const x = step > 0 ? i : size - 1 - i;
        const index = indexOf(y, x, channel);
        result[index] = clip(roundHalfEven(values[index]), -WEIGHT_LEVELS, WEIGHT_LEVELS);
        const error = values[index] - result[index];
        const inside = SHARES.map(({ below, ahead, share }) => ({ y: y + below, x: x + ahead * step, share })).filter(
          (tap) => tap.y < size && tap.x >= 0 && tap.x < size,
        );
        const total = inside.reduce((all, tap) => all + tap.share, 0);
        for (const tap of inside) values[indexOf(tap.y, tap.x, channel)] += error * (tap.share / total);
      }
    }
  }
  return result;
}

const meanOf = (numbers) => numbers.reduce((total, x) => total + x, 0) / numbers.length;

// WHO-14: rounded on windows, layer by layer.
export function roundedOn(network, size, amplitude, windows) {
  const plain = rounded(network, size, amplitude);
  const { fraction } = plain;
  let floatInputs = windows;
  let wholeInputs = windows.map((window) => window.map(stepsOf));
  const layers = [];
  network.layers.forEach((layer, l) => {
    const isLast = l === network.layers.length - 1;
    const gain = gainOf(network, l, fraction);
    const { factor, scaled } = scaledRows(layer.weight, gain, largestInput(l, amplitude));
    const statistics = statisticsOf(wholeInputs);
    const weight = [];
    const bias = [];
    layer.weight.forEach((row, i) => {
      const sums = floatInputs.map((x) => product(row, x) * (gain / factor[i]));
      const real = leastSquares(statistics, wholeInputs, sums, scaled[i]);
      const q = nearest(statistics, real);
      weight.push(q);
      const moved = layer.bias[i] * gain + factor[i] * (meanOf(sums) - product(q, statistics.means));
      bias.push(roundHalfEven(moved + (isLast ? 2 ** (fraction - 1) : 0)));
    });
    const made = isLast ? { weight, factor, bias } : asHidden({ weight, factor, bias });
    layers.push(made);
    if (isLast) return;
    floatInputs = floatInputs.map((x) => hiddenLayer(network, l, x));
    wholeInputs = wholeInputs.map((n) => hiddenWhole(made, amplitude, n));
  });
  const result = { layers, amplitude, fraction };
  const holds = layers.every((layer, l) => holdsSums(layer, largestInput(l, amplitude)));
  return holds && holdsLast(layers.at(-1), largestInput(layers.length - 1, amplitude)) ? result : plain;
}

// What the trained network gives in a hidden layer.
function hiddenLayer(network, l, x) {
  const { weight, bias } = network.layers[l];
  return weight.map((row, i) => Math.sin(omegaOf(network, l) * (product(row, x) + bias[i])));
}

function hiddenWhole({ weight, factor, bias }, amplitude, n) {
  return weight.map((row, i) => wholeSine(phaseOf(product(row, n), factor[i], bias[i]), amplitude));
}

// WHO-14: means and covariance of a layer's integers, and the order in which weights are chosen.
function statisticsOf(inputs) {
  const size = inputs[0].length;
  const means = Array.from({ length: size }, (_, j) => meanOf(inputs.map((n) => n[j])));
  const centered = inputs.map((n) => n.map((x, j) => x - means[j]));
  const covariance = Array.from({ length: size }, (_, i) =>
    Array.from({ length: size }, (_, j) => meanOf(centered.map((n) => n[i] * n[j]))),
  );
  const variances = covariance.map((row, i) => row[i]);
  const ridge = SPREAD * Math.max(meanOf(variances), 1);
  covariance.forEach((row, i) => (row[i] += ridge));
  // The factor is of inputs in ascending order, so that the last one, of the largest variance, comes first.
  const order = variances.map((_, i) => i).sort((a, b) => variances[a] - variances[b]);
  return { means, centered, order, upper: cholesky(order.map((i) => order.map((j) => covariance[i][j]))) };
}

// Upper triangular R with R^T R = C.
function cholesky(matrix) {
  const size = matrix.length;
  const upper = matrix.map((row) => row.map(() => 0));
  for (let i = 0; i < size; i++) {
    for (let j = i; j < size; j++) {
      let rest = matrix[i][j];
      for (let k = 0; k < i; k++) rest -= upper[k][i] * upper[k][j];
      upper[i][j] = i === j ? Math.sqrt(rest) : rest / upper[i][i];
    }
  }
  return upper;
}

// WHO-14: the real weights of a row, in the inputs' own order.
function leastSquares({ centered, order, upper }, inputs, sums, scaled) {
  const residues = inputs.map((n, k) => sums[k] - product(scaled, n));
  const target = order.map((i) => meanOf(centered.map((n, k) => n[i] * residues[k])));
  const size = target.length;
  // R^T y = target, then R x = y.
  const y = [];
  for (let i = 0; i < size; i++) {
    let rest = target[i];
    for (let k = 0; k < i; k++) rest -= upper[k][i] * y[k];
    y.push(rest / upper[i][i]);
  }
  const x = new Array(size).fill(0);
  for (let i = size - 1; i >= 0; i--) {
    let rest = y[i];
    for (let k = i + 1; k < size; k++) rest -= upper[i][k] * x[k];
    x[i] = rest / upper[i][i];
  }
  const real = [...scaled];
  order.forEach((input, i) => (real[input] += x[i]));
  return real;
}

// WHO-14: integers near the real weights, each with what the ones before it have left.
function nearest({ order, upper }, real) {
  const w = order.map((input) => real[input]);
  const q = new Array(w.length);
  for (let i = w.length - 1; i >= 0; i--) {
    let shift = 0;
    for (let j = i + 1; j < w.length; j++) shift += (upper[i][j] * (w[j] - q[j])) / upper[i][i];
    q[i] = clip(roundHalfEven(w[i] + shift), -WEIGHT_LEVELS, WEIGHT_LEVELS);
  }
  const result = new Array(w.length);
  order.forEach((input, i) => (result[input] = q[i]));
  return result;
}
