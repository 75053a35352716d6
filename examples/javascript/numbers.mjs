// Numbers, arrays and files of requests and answers (CNF-2, CNF-5).

import { readFileSync } from "node:fs";
import { require } from "./refusal.mjs";

const HEXADECIMAL = /^(-?)0x([0-9a-f]+)(?:\.([0-9a-f]+))?p([+-][0-9]+)$/;

// CNF-2: one number, hexadecimal, decimal or not finite.
export function float(value) {
  if (typeof value === "number") return value;
  if (value === "inf") return Infinity;
  if (value === "-inf") return -Infinity;
  if (value === "nan") return NaN;
  const parts = HEXADECIMAL.exec(value);
  if (!parts) return Number(value);
  const [, sign, whole, fraction = "", exponent] = parts;
  const power = Number(exponent) - 4 * fraction.length;
  // Two factors, because one of 2^-1077 would underflow before it meets the digits.
  const half = Math.floor(power / 2);
  const magnitude = parseInt(whole + fraction, 16) * 2 ** half * 2 ** (power - half);
  return sign ? -magnitude : magnitude;
}

// CNF-2: a number, or lists of numbers of any depth.
export function floats(value) {
  return Array.isArray(value) ? value.map(floats) : float(value);
}

// CNF-5: a text, or the file that holds it.
export function text(value) {
  return typeof value === "object" && value !== null ? readFileSync(value.file, "utf8") : value;
}

// CNF-5: an array as its shape and its numbers in C order.
export function array(value) {
  if (!Array.isArray(value) && typeof value === "object" && value !== null) return arrayOfFile(value);
  const data = [];
  const shape = collect(value, data);
  return { shape, data };
}

function arrayOfFile({ file, shape }) {
  const bytes = readFileSync(file);
  const count = shape.reduce((product, side) => product * side, 1);
  require(bytes.length === 4 * count, `${file}: must have 4 bytes for each number of its shape`);
  const data = Array.from({ length: count }, (_, i) => bytes.readFloatLE(4 * i));
  return { shape, data };
}

function collect(value, data) {
  if (!Array.isArray(value)) {
    data.push(float(value));
    return [];
  }
  const inner = value.map((entry) => collect(entry, data));
  for (const shape of inner) {
    require(String(shape) === String(inner[0]), "rows of an array must have one length");
  }
  return [value.length, ...(inner[0] ?? [])];
}

// The numbers of an array as nested lists.
export function nested(data, shape) {
  if (shape.length === 1) return Array.from(data);
  const [first, ...rest] = shape;
  const size = rest.reduce((product, side) => product * side, 1);
  return Array.from({ length: first }, (_, i) => nested(data.slice(i * size, (i + 1) * size), rest));
}

// CNF-2: an answer, whose numbers that are not finite become texts.
export function answerText(answer) {
  return JSON.stringify(answer, (_, value) => {
    if (typeof value !== "number" || Number.isFinite(value)) return value;
    return Number.isNaN(value) ? "nan" : value > 0 ? "inf" : "-inf";
  });
}

// Half-way cases go to the even neighbour, as IEEE 754 rounds.
export function roundHalfEven(x) {
  const low = Math.floor(x);
  const rest = x - low;
  if (rest !== 0.5) return rest < 0.5 ? low : low + 1;
  return low % 2 === 0 ? low : low + 1;
}

export function clip(x, low, high) {
  return Math.min(Math.max(x, low), high);
}
