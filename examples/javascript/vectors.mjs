// Vectors of three numbers (VEC-1 to VEC-7).

export const ZERO = [0, 0, 0];
export const ONE = [1, 1, 1];

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const multiply = (a, b) => [a[0] * b[0], a[1] * b[1], a[2] * b[2]];
export const scale = (a, factor) => [a[0] * factor, a[1] * factor, a[2] * factor];
export const negate = (a) => [-a[0], -a[1], -a[2]];
export const sum = (a) => a[0] + a[1] + a[2];

// VEC-2
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

// VEC-7
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

export const length = (a) => Math.sqrt(dot(a, a));

// VEC-3
export function normalize(a) {
  const size = length(a);
  return [a[0] / size, a[1] / size, a[2] / size];
}

// VEC-4: the matrix is a list of rows.
export const rotate = (matrix, a) => [dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)];

// The inverse of a rotation: its transpose.
export function rotateBack(matrix, a) {
  const [x, y, z] = matrix;
  return add(add(scale(x, a[0]), scale(y, a[1])), scale(z, a[2]));
}

// VEC-7
export const largest = (a) => Math.max(Math.max(a[0], a[1]), a[2]);
export const smallest = (a) => Math.min(Math.min(a[0], a[1]), a[2]);

export const largestMagnitude = (a) => largest(a.map(Math.abs));
