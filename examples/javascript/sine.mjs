// The emitted sine, in single precision (SIN-1, SIN-4, SIN-7).

import { clip, float, floats } from "./numbers.mjs";

const { fround, floor, abs } = Math;

const DOMAIN = 12800;
const INVERSE_PI = float("0x1.45f306p-2");
// SIN-1: pi in three parts of 12 bits.
const PI_PARTS = floats(["0x1.922p+1", "-0x1.2aep-17", "-0x1.deap-30"]);
// SIN-4: c1, c3, ... c11 of degree 11.
const COEFFICIENTS = floats([
  "0x1p+0",
  "-0x1.555556p-3",
  "0x1.111132p-7",
  "-0x1.a0221p-13",
  "0x1.72915ap-19",
  "-0x1.b0e154p-26",
]);

// SIN-4: Horner's rule in the square of the reduced argument.
function polynomial(r) {
  const z = fround(r * r);
  let q = COEFFICIENTS.at(-1);
  for (const coefficient of COEFFICIENTS.slice(1, -1).reverse()) {
    q = fround(coefficient + fround(z * q));
  }
  return fround(r + fround(r * fround(z * q)));
}

// SIN-1
export function emittedSine(argument) {
  const x = fround(argument);
  if (!Number.isFinite(x)) return NaN;
  if (abs(x) > DOMAIN) return 0;
  const k = floor(fround(fround(x * INVERSE_PI) + 0.5));
  const r = PI_PARTS.reduce((rest, part) => fround(rest - fround(k * part)), x);
  const sign = 1 - 2 * (k - 2 * floor(k / 2));
  return clip(sign * polynomial(r), -1, 1);
}
