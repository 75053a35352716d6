// Means of pixels that are alike (SMO-3).

import { clip } from "./numbers.mjs";

const SPLINE = [1 / 16, 1 / 4, 3 / 8, 1 / 4, 1 / 16];
const REACH = 2;
const SIGMAS = { normal: 0.5, albedo: 0.2 };
const POSITION_SHARE = 0.08;
const LEAST_DEPTH = 1e-6;
const FARTHEST = 1e9;

// How far apart two pixels p and q are in one guide, squared.
function squareApart(guide, p, q) {
  let sum = 0;
  for (let channel = 0; channel < 3; channel++) sum += (guide[3 * q + channel] - guide[3 * p + channel]) ** 2;
  return sum;
}

function clipped(guides) {
  const found = { depth: guides.depth.map((z) => clip(z, LEAST_DEPTH, FARTHEST)) };
  for (const name of ["normal", "albedo", "position"]) {
    found[name] = guides[name].map((x) => clip(x, -FARTHEST, FARTHEST));
  }
  return found;
}

// The weight of pixel q for pixel p, without the spline's.
function likeness({ normal, albedo, position, depth }, p, q) {
  const sum =
    squareApart(normal, p, q) / SIGMAS.normal ** 2 +
    squareApart(albedo, p, q) / SIGMAS.albedo ** 2 +
    squareApart(position, p, q) / (POSITION_SHARE * depth[p]) ** 2;
  return Math.exp(-sum / 2);
}

// The weights of 25 pixels, and their numbers.
function tapsOf(guides, height, width, y, x, gap) {
  const taps = [];
  for (let dy = -REACH; dy <= REACH; dy++) {
    for (let dx = -REACH; dx <= REACH; dx++) {
      const row = clip(y + gap * dy, 0, height - 1);
      const q = row * width + clip(x + gap * dx, 0, width - 1);
      taps.push({ q, weight: SPLINE[dy + REACH] * SPLINE[dx + REACH] * likeness(guides, y * width + x, q) });
    }
  }
  return taps;
}

// SMO-3: `color` and the guides are numbers in C order, without NaN.
export function smooth(color, guides, height, width, levels) {
  const compared = clipped(guides);
  let data = color;
  for (let level = 0; level < levels; level++) {
    const next = [];
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        const taps = tapsOf(compared, height, width, y, x, 2 ** level);
        const weights = taps.reduce((sum, { weight }) => sum + weight, 0);
        for (let channel = 0; channel < 3; channel++) {
          next.push(taps.reduce((sum, { q, weight }) => sum + weight * data[3 * q + channel], 0) / weights);
        }
      }
    }
    data = next;
  }
  return data;
}
