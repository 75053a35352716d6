// How far an image is from its reference (MET-1 to MET-7). Images are arrays of rows, columns, channels.

import { require } from "./refusal.mjs";

const EPSILON = 0.01;
const WINDOW = 11;
const DEVIATION = 1.5;
const RANGE = 1;

// MET-1
function checkPair(image, reference) {
  require(String(image.shape) === String(reference.shape), "image and reference must have one shape");
  require(image.data.length > 0, "an image must not be empty");
  for (const { data } of [image, reference]) {
    require(data.every(Number.isFinite), "an image must have finite values");
  }
}

function meanOver(image, reference, term) {
  checkPair(image, reference);
  const total = image.data.reduce((sum, x, i) => sum + term(x, reference.data[i]), 0);
  return total / image.data.length;
}

// MET-3
export function mse(image, reference) {
  return meanOver(image, reference, (x, r) => (x - r) ** 2);
}

// MET-4
export function psnr(image, reference) {
  return 10 * Math.log10(RANGE ** 2 / mse(image, reference));
}

// MET-6
export function relmse(image, reference) {
  return meanOver(image, reference, (x, r) => (x - r) ** 2 / (r ** 2 + EPSILON));
}

// MET-7
export function smape(image, reference) {
  return meanOver(image, reference, (x, r) => Math.abs(x - r) / (Math.abs(x) + Math.abs(r) + EPSILON));
}

// MET-5: the weights of a window, normalised to sum 1.
function gaussianWindow() {
  const middle = Math.floor(WINDOW / 2);
  const weights = [];
  for (let i = -middle; i <= middle; i++) {
    for (let j = -middle; j <= middle; j++) {
      weights.push(Math.exp(-(i * i + j * j) / (2 * DEVIATION ** 2)));
    }
  }
  const total = weights.reduce((sum, weight) => sum + weight, 0);
  return weights.map((weight) => weight / total);
}

const WEIGHTS = gaussianWindow();

// MET-5
export function ssim(image, reference) {
  checkPair(image, reference);
  require(image.shape.length === 3, "an image must have rows, columns and channels");
  const [height, width, channels] = image.shape;
  require(height >= WINDOW && width >= WINDOW, "SSIM needs at least 11 rows and columns");
  let total = 0;
  let count = 0;
  for (let top = 0; top + WINDOW <= height; top++) {
    for (let left = 0; left + WINDOW <= width; left++) {
      for (let channel = 0; channel < channels; channel++) {
        total += windowSimilarity(image, reference, top, left, channel);
        count++;
      }
    }
  }
  return total / count;
}

function windowSimilarity(image, reference, top, left, channel) {
  const [, width, channels] = image.shape;
  let [meanX, meanR, meanXX, meanRR, meanXR] = [0, 0, 0, 0, 0];
  WEIGHTS.forEach((weight, tap) => {
    const row = top + Math.floor(tap / WINDOW);
    const column = left + (tap % WINDOW);
    const index = (row * width + column) * channels + channel;
    const [x, r] = [image.data[index], reference.data[index]];
    meanX += weight * x;
    meanR += weight * r;
    meanXX += weight * (x * x);
    meanRR += weight * (r * r);
    meanXR += weight * (x * r);
  });
  const [c1, c2] = [(0.01 * RANGE) ** 2, (0.03 * RANGE) ** 2];
  const varianceX = meanXX - meanX * meanX;
  const varianceR = meanRR - meanR * meanR;
  const covariance = meanXR - meanX * meanR;
  return (
    ((2 * meanX * meanR + c1) * (2 * covariance + c2)) /
    ((meanX * meanX + meanR * meanR + c1) * (varianceX + varianceR + c2))
  );
}
