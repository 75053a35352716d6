// Distributions: from uniform numbers to samples, and their densities.

import { add, cross, dot, length, scale } from "./vectors.mjs";

// SMP-1
export function concentricDisk(u0, u1) {
  const a = 2 * u0 - 1;
  const b = 2 * u1 - 1;
  const quarter = Math.PI / 4;
  let radius = b;
  let angle = Math.PI / 2 - (b === 0 ? 0 : (quarter * a) / b);
  if (Math.abs(a) > Math.abs(b)) {
    radius = a;
    angle = (quarter * b) / a;
  }
  return [radius * Math.cos(angle), radius * Math.sin(angle)];
}

// SMP-2
export function cosineHemisphere(u0, u1) {
  const [x, y] = concentricDisk(u0, u1);
  return [x, y, Math.sqrt(Math.max(0, 1 - x * x - y * y))];
}

// SMP-2
export function cosineHemispherePdf(cosine) {
  return cosine / Math.PI;
}

// SMP-3
export function sampleQuad(corner, edgeU, edgeV, u0, u1) {
  return add(add(corner, scale(edgeU, u0)), scale(edgeV, u1));
}

// SMP-3
export function quadPdf(edgeU, edgeV) {
  return 1 / length(cross(edgeU, edgeV));
}

// SMP-4: the last of the running sums is 1.
export function sampleDiscrete(sums, u) {
  let index = 0;
  while (index < sums.length - 1 && sums[index] <= u) index++;
  return index;
}

// SMP-4
export function discreteProbability(sums, index) {
  return sums[index] - (index > 0 ? sums[index - 1] : 0);
}

// SMP-5
export function tangentFrame(normal) {
  const [x, y, z] = normal;
  const s = z < 0 ? -1 : 1;
  const a = -1 / (s + z);
  const b = x * y * a;
  return { tangent: [1 + s * x * x * a, s * b, -s * x], bitangent: [b, s + y * y * a, -y] };
}

// SMP-6
export function toWorld(local, normal) {
  const { tangent, bitangent } = tangentFrame(normal);
  return add(add(scale(tangent, local[0]), scale(bitangent, local[1])), scale(normal, local[2]));
}

// SMP-6
export function toLocal(world, normal) {
  const { tangent, bitangent } = tangentFrame(normal);
  return [dot(world, tangent), dot(world, bitangent), dot(world, normal)];
}

// SMP-7
export function sphericalCauchy(u0, u1, concentration) {
  const v = (2 * u0) / (1 + 2 * concentration * (1 - u0));
  const azimuth = (2 * u1 - 1) * Math.PI;
  const sine = Math.sqrt(Math.max(0, v * (2 - v)));
  return [sine * Math.cos(azimuth), sine * Math.sin(azimuth), 1 - v];
}

// SMP-7: of a direction by 1 - cos of its angle to the middle of the lobe.
export function sphericalCauchyPdf(oneMinusCosine, concentration) {
  const spread = 1 + concentration * oneMinusCosine;
  return (1 + 2 * concentration) / (4 * Math.PI * spread * spread);
}
