// Linear light and the display (ENC-1 to ENC-5).

import { clip } from "./numbers.mjs";

// ENC-1, ENC-3
export function srgbEncode(x) {
  return x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055;
}

// ENC-4
export function expose(x, stops) {
  return x * 2 ** stops;
}

// ENC-5
export function toDisplay(x, stops) {
  return srgbEncode(clip(expose(x, stops), 0, 1));
}
