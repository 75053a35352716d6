// Rays and single shapes: boxes, rooms, spheres and quads.

import { add, cross, dot, negate, normalize, rotate, rotateBack, scale, subtract } from "./vectors.mjs";

export const MISS = 1e30;
const LEAST_COMPONENT = 1e-15;
// ISC-12
const CANCELLED = 16 * 2 ** -53;

// ISC-5
export function awayFromZero(x) {
  if (Math.abs(x) >= LEAST_COMPONENT) return x;
  return x < 0 ? -LEAST_COMPONENT : LEAST_COMPONENT;
}

// ISC-8: the normal on the side of the ray's origin.
function facing(normal, direction) {
  return dot(normal, direction) > 0 ? negate(normal) : normal;
}

// ISC-3: distances at which a ray enters and leaves the slabs of a box parallel to the axes.
export function slabs(center, half, origin, direction) {
  const enter = [];
  const leave = [];
  for (let k = 0; k < 3; k++) {
    const inverse = 1 / awayFromZero(direction[k]);
    const middle = (center[k] - origin[k]) * inverse;
    const reach = half[k] * Math.abs(inverse);
    enter.push(middle - reach);
    leave.push(middle + reach);
  }
  return { enter, leave };
}

// The first axis with the greatest, and with the least number.
const greatestAxis = (a) => a.indexOf(Math.max(...a));
const leastAxis = (a) => a.indexOf(Math.min(...a));

// ISC-4, ISC-8: distance and the axis of the face that gave it.
function meetSlabs(center, half, origin, direction) {
  const { enter, leave } = slabs(center, half, origin, direction);
  const near = Math.max(...enter);
  const far = Math.min(...leave);
  return { hit: near <= far && far > 0, near, far, nearAxis: greatestAxis(enter), farAxis: leastAxis(leave) };
}

// ISC-8: the normal in the box's own axes.
function axisNormal(axis, direction) {
  const normal = [0, 0, 0];
  normal[axis] = direction[axis] > 0 ? -1 : 1;
  return normal;
}

// ISC-12: the centre in the box's axes.
function turnedCenter(rotation, center) {
  return rotation.map((row) => {
    const coordinate = dot(row, center);
    const magnitude = Math.abs(row[0] * center[0]) + Math.abs(row[1] * center[1]) + Math.abs(row[2] * center[2]);
    return Math.abs(coordinate) < CANCELLED * magnitude ? 0 : coordinate;
  });
}

// Every shape answers a ray with its distance and with what else the hit needs, and a hit with its normal.

// ISC-4
export function makeBox({ center, half_extent: half, rotation }) {
  const turned = turnedCenter(rotation, center);
  return {
    center,
    meet(origin, direction) {
      const met = meetSlabs(turned, half, rotate(rotation, origin), rotate(rotation, direction));
      if (!met.hit) return { t: MISS };
      return met.near > 0 ? { t: met.near, axis: met.nearAxis } : { t: met.far, axis: met.farAxis };
    },
    normal(met, point, direction) {
      return rotateBack(rotation, axisNormal(met.axis, rotate(rotation, direction)));
    },
  };
}

// SCN-2, ISC-13
export function makeRoom({ low, high }) {
  const center = scale(add(low, high), 0.5);
  const half = scale(subtract(high, low), 0.5);
  return {
    center,
    meet(origin, direction) {
      const met = meetSlabs(center, half, origin, direction);
      if (!met.hit) return { t: MISS };
      return { t: met.far, axis: met.farAxis, wall: 2 * met.farAxis + (direction[met.farAxis] > 0 ? 1 : 0) };
    },
    normal(met, point, direction) {
      return axisNormal(met.axis, direction);
    },
  };
}

// ISC-6
export function sphereDistance(center, radius, origin, direction) {
  const f = subtract(origin, center);
  const b = -dot(f, direction);
  const beside = add(f, scale(direction, b));
  const discriminant = radius * radius - dot(beside, beside);
  if (!(discriminant > 0)) return MISS;
  const root = Math.sqrt(discriminant);
  const q = b < 0 ? b - root : b + root;
  const other = (dot(f, f) - radius * radius) / (q === 0 ? LEAST_COMPONENT : q);
  const near = Math.min(q, other);
  const far = Math.max(q, other);
  if (near > 0) return near;
  return far > 0 ? far : MISS;
}

// ISC-6
export function makeSphere({ center, radius }) {
  return {
    center,
    meet(origin, direction) {
      return { t: sphereDistance(center, radius, origin, direction) };
    },
    normal(met, point, direction) {
      return facing(scale(subtract(point, center), 1 / radius), direction);
    },
  };
}

// ISC-7: what is computed once for a quad or a light.
export function makeQuad({ corner, edge_u: edgeU, edge_v: edgeV }) {
  const spanned = cross(edgeU, edgeV);
  const square = dot(spanned, spanned);
  const ownNormal = normalize(spanned);
  const dualU = scale(cross(edgeV, spanned), 1 / square);
  const dualV = scale(cross(spanned, edgeU), 1 / square);
  return {
    ownNormal,
    meet(origin, direction) {
      const t = dot(subtract(corner, origin), ownNormal) / awayFromZero(dot(direction, ownNormal));
      const offset = subtract(add(origin, scale(direction, t)), corner);
      const a = dot(offset, dualU);
      const b = dot(offset, dualV);
      const inside = a >= 0 && a <= 1 && b >= 0 && b <= 1;
      return { t: t > 0 && inside ? t : MISS };
    },
    normal(met, point, direction) {
      return facing(ownNormal, direction);
    },
  };
}
