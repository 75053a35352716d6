// The network of sines, its gradient, Adam, and denoising.
//
// A network has layers of weights (a list of rows) and biases, and omegas for the first and the other layers.

import { featureImage, windowAt } from "./dataset.mjs";
import { clip } from "./numbers.mjs";
import { LARGEST_WORD, randomBlock, uniformFloat } from "./random.mjs";
import { require, requireInteger } from "./refusal.mjs";

const WEIGHT_TAG = 0x57454947;
const BIAS_TAG = 0x42494153;
const LARGEST_OMEGA = 1e12;

// ACT-1
const ACTIVATIONS = {
  sine: { value: Math.sin, slope: Math.cos },
  relu: { value: (a) => Math.max(a, 0), slope: (a) => (a > 0 ? 1 : 0) },
};
export const ACTIVATION_NAMES = Object.keys(ACTIVATIONS);

export const omegaOf = (network, layer) => (layer === 0 ? network.omegaFirst : network.omegaHidden);

export function checkOmega(omega, name) {
  require(omega > 0 && omega <= LARGEST_OMEGA, `${name} ${omega}: must be in (0, 1e12]`);
}

// SIR-3 to SIR-5
export function initNetwork(widths, omegaFirst, omegaHidden, seed) {
  require(widths.length >= 2, "widths: must have an input and an output");
  widths.forEach((width) => requireInteger(width, "width", 1, LARGEST_WORD));
  checkOmega(omegaFirst, "omega_0_first");
  checkOmega(omegaHidden, "omega_0_hidden");
  requireInteger(seed, "seed", 0, LARGEST_WORD);
  const layers = [];
  for (let l = 0; l + 1 < widths.length; l++) {
    const [inputs, outputs] = [widths[l], widths[l + 1]];
    const bound = l === 0 ? 1 / inputs : Math.sqrt(6 / inputs) / omegaHidden;
    const weight = Array.from({ length: outputs }, (_, row) =>
      Array.from({ length: inputs }, (_, column) =>
        Math.fround(signedUniform(seed, l, WEIGHT_TAG, row * inputs + column) * bound),
      ),
    );
    const bias = Array.from({ length: outputs }, (_, row) =>
      Math.fround(signedUniform(seed, l, BIAS_TAG, row) / Math.sqrt(inputs)),
    );
    layers.push({ weight, bias });
  }
  return { layers, omegaFirst, omegaHidden };
}

// SIR-5: number i of a layer, in [-1, 1).
function signedUniform(seed, layer, tag, i) {
  return 2 * uniformFloat(randomBlock(seed, Math.floor(i / 4), layer, tag)[i % 4]) - 1;
}

export function product(row, x) {
  return row.reduce((total, weight, i) => total + weight * x[i], 0);
}

// SIR-2: what each layer gives, and the arguments of its activation.
export function forward(network, x) {
  const { value } = ACTIVATIONS[network.activation ?? "sine"];
  const last = network.layers.length - 1;
  const outputs = [];
  const sums = [];
  let input = x;
  network.layers.forEach(({ weight, bias }, l) => {
    const affine = weight.map((row, i) => product(row, input) + bias[i]);
    sums.push(l < last ? affine.map((sum) => omegaOf(network, l) * sum) : affine);
    input = l < last ? sums[l].map(value) : affine;
    outputs.push(input);
  });
  return { outputs, sums };
}

// TRN-3, SIR-7: the mean squared error of a minibatch and its derivatives.
export function lossAndGradients(network, inputs, targets) {
  const { slope } = ACTIVATIONS[network.activation ?? "sine"];
  const last = network.layers.length - 1;
  const gradients = network.layers.map(({ weight, bias }) => ({
    weight: weight.map((row) => row.map(() => 0)),
    bias: bias.map(() => 0),
  }));
  const count = targets.length * targets[0].length;
  let loss = 0;
  inputs.forEach((x, n) => {
    const { outputs, sums } = forward(network, x);
    const error = outputs[last].map((y, c) => y - targets[n][c]);
    loss += error.reduce((total, e) => total + e * e, 0);
    let dy = error.map((e) => e * (2 / count));
    for (let l = last; l >= 0; l--) {
      const dz = l === last ? dy : dy.map((d, i) => d * slope(sums[l][i]) * omegaOf(network, l));
      const input = l === 0 ? x : outputs[l - 1];
      dz.forEach((d, i) => {
        gradients[l].bias[i] += d;
        input.forEach((value, j) => (gradients[l].weight[i][j] += d * value));
      });
      dy = input.map((_, j) => dz.reduce((total, d, i) => total + d * network.layers[l].weight[i][j], 0));
    }
  });
  return { loss: loss / count, gradients };
}

// ADM-2
const BETA_1 = 0.9;
const BETA_2 = 0.999;
const EPSILON = 1e-8;

// ADM-1: one parameter through one step; growths are 1 - beta^t.
export function adamStep(theta, g, m, v, learningRate, growth1, growth2) {
  const nextM = BETA_1 * m + (1 - BETA_1) * g;
  const nextV = BETA_2 * v + (1 - BETA_2) * (g * g);
  const step = (learningRate * (nextM / growth1)) / (Math.sqrt(nextV / growth2) + EPSILON);
  return { theta: theta - step, m: nextM, v: nextV };
}

// ADM-1: several steps from moments of zero, one row of gradients a step.
export function adamRun(theta, gradients, learningRate) {
  let states = theta.map((value) => ({ theta: value, m: 0, v: 0 }));
  return gradients.map((row, k) => {
    const [growth1, growth2] = [1 - BETA_1 ** (k + 1), 1 - BETA_2 ** (k + 1)];
    states = states.map(({ theta, m, v }, i) => adamStep(theta, row[i], m, v, learningRate, growth1, growth2));
    return states;
  });
}

// DEN-2, DEN-3: the picture of a frame, as rows of pixels.
export function denoise(model, layers) {
  const image = featureImage(layers, model.features, model.normalization);
  const [height, width] = image.shape;
  return Array.from({ length: height }, (_, y) =>
    Array.from({ length: width }, (_, x) => {
      const window = windowAt(image, model.window.size, model.window.border, x, y);
      return forward(model.network, window).outputs.at(-1).map((channel) => clip(channel, 0, 1));
    }),
  );
}
