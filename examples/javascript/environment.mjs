// The sky: a gradient and the sun's lobe (ENV-1 to ENV-3).

import { sphericalCauchy, sphericalCauchyPdf, toWorld } from "./sampling.mjs";
import { add, dot, normalize, scale, subtract, sum } from "./vectors.mjs";

export function buildSky(sky) {
  return { ...sky, sun: normalize(sky.sun_direction), share: sunShare(sky) };
}

// ENV-2: the sun's share in the light of all directions.
export function sunShare(sky) {
  const sun = sum(sky.sun_irradiance);
  const gradient = Math.PI * (sum(sky.zenith) + 2 * sum(sky.horizon) + sum(sky.ground));
  return sun + gradient > 0 ? sun / (sun + gradient) : 0;
}

// ENV-1
function lobeDensity(sky, direction) {
  const apart = subtract(direction, sky.sun);
  return sphericalCauchyPdf(dot(apart, apart) / 2, sky.sun_concentration);
}

// ENV-1
export function skyRadiance(sky, direction) {
  const height = direction[1];
  const end = height > 0 ? sky.zenith : sky.ground;
  const gradient = add(sky.horizon, scale(subtract(end, sky.horizon), Math.abs(height)));
  return add(gradient, scale(sky.sun_irradiance, lobeDensity(sky, direction)));
}

// ENV-2
export function sampleSky(sky, choice, u0, u1) {
  const concentration = choice < sky.share ? sky.sun_concentration : 0;
  return toWorld(sphericalCauchy(u0, u1, concentration), sky.sun);
}

// ENV-3
export function skyPdf(sky, direction) {
  return sky.share * lobeDensity(sky, direction) + (1 - sky.share) / (4 * Math.PI);
}
