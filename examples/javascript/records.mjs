// Records in JSON: each field is read by a function of its value and its path (RDG-3).

import { JsonNumber } from "./json.mjs";
import { require } from "./refusal.mjs";

const LARGEST_NUMBER = 1e12;

export function text(value, path) {
  require(typeof value === "string", `${path}: must be a text`);
  return value;
}

export function number(value, path) {
  require(value instanceof JsonNumber, `${path}: must be a number`);
  return value.value;
}

// SCN-7
export function boundedNumber(value, path) {
  const x = number(value, path);
  require(Math.abs(x) <= LARGEST_NUMBER, `${path}: must be at most 1e12 in magnitude`);
  return x;
}

// RDG-3: a count is written without a point.
export function count(value, path) {
  require(value instanceof JsonNumber && value.isInteger, `${path}: must be an integer`);
  return value.value;
}

export function list(readEntry, size = null) {
  return (value, path) => {
    require(Array.isArray(value), `${path}: must be a list`);
    require(size === null || value.length === size, `${path}: must have ${size} entries`);
    return value.map((entry, i) => readEntry(entry, `${path}[${i}]`));
  };
}

export const vector = list(boundedNumber, 3);
export const matrix = list(vector, 3);

export function orNull(read) {
  return (value, path) => (value === null ? null : read(value, path));
}

// Texts by name, in the order of the file.
export function texts(value, path) {
  require(value instanceof Map, `${path}: must be an object`);
  return new Map([...value].map(([key, entry]) => [key, text(entry, `${path}.${key}`)]));
}

// A record by its fields in order: a reader for each, and a default where the key may be missing.
export function record(fields) {
  return (value, path) => {
    require(value instanceof Map, `${path}: must be an object`);
    for (const key of value.keys()) {
      require(Object.hasOwn(fields, key), `${path}.${key}: unknown key`);
    }
    const result = {};
    for (const [key, field] of Object.entries(fields)) {
      if (value.has(key)) {
        result[key] = field.read(value.get(key), `${path}.${key}`);
      } else {
        require(Object.hasOwn(field, "missing"), `${path}.${key}: missing`);
        result[key] = structuredClone(field.missing);
      }
    }
    return result;
  };
}

export const required = (read) => ({ read });
export const optional = (read, missing) => ({ read, missing });
