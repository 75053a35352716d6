// A picture: the mean over the paths of each pixel, and their variance (RND-1, RND-4).

import { LARGEST_WORD } from "./random.mjs";
import { requireInteger } from "./refusal.mjs";
import { tracePath } from "./transport.mjs";

export function render(world, width, height, spp, seed) {
  requireInteger(width, "width", 1, 65536);
  requireInteger(height, "height", 1, 65536);
  requireInteger(spp, "spp", 1, LARGEST_WORD);
  requireInteger(seed, "seed", 0, LARGEST_WORD);
  const mean = [];
  const variance = [];
  for (let y = 0; y < height; y++) {
    const pixels = Array.from({ length: width }, (_, x) => renderPixel(world, width, height, x, y, spp, seed));
    mean.push(pixels.map((pixel) => pixel.mean));
    variance.push(pixels.map((pixel) => pixel.variance));
  }
  return { mean, variance, spp };
}

// RND-1, RND-4: sums of radiance, and of squared deviations by Welford's recurrence.
function renderPixel(world, width, height, x, y, spp, seed) {
  const total = [0, 0, 0];
  const squares = [0, 0, 0];
  for (let n = 0; n < spp; n++) {
    const { radiance } = tracePath(world, width, height, x, y, seed, n);
    for (let channel = 0; channel < 3; channel++) {
      if (n > 0) squares[channel] += (n * radiance[channel] - total[channel]) ** 2 / (n * (n + 1));
      total[channel] += radiance[channel];
    }
  }
  return {
    mean: total.map((channel) => channel / spp),
    variance: squares.map((channel) => channel / Math.max(spp - 1, 1)),
  };
}
