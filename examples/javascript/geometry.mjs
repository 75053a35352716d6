// The surfaces of a scene, and the nearest one that a ray meets.

import { makeBox, makeQuad, makeRoom, makeSphere, MISS } from "./shapes.mjs";
import { add, cross, dot, largestMagnitude, length, scale, ZERO } from "./vectors.mjs";

const SPAWN_OFFSET = 64 * 2 ** -24;
const MATTE = { kind: "lambertian" };

// ISC-1: primitives in order, each with the number of its first surface; and what each surface is made of.
export function buildGeometry(scene) {
  const primitives = [];
  const surfaces = [];
  if (scene.room) {
    primitives.push({ shape: makeRoom(scene.room), first: 0 });
    scene.room.reflectances.forEach((reflectance, wall) => {
      const { emission, materials } = scene.room;
      surfaces.push({ reflectance, emission, material: materials[wall] ?? MATTE });
    });
  }
  const addSurface = (shape, surface) => {
    primitives.push({ shape, first: surfaces.length });
    surfaces.push(surface);
  };
  const addShape = (shape, { reflectance, emission, material }) =>
    addSurface(shape, { reflectance, emission, material: material ?? MATTE, center: shape.center });
  for (const box of groupedByRotation(scene.boxes)) addShape(makeBox(box), box);
  for (const sphere of scene.spheres) addShape(makeSphere(sphere), sphere);
  for (const quad of scene.quads) addShape(makeQuad(quad), quad);
  scene.lights.forEach((light, lamp) => {
    const shape = makeQuad(light);
    addSurface(shape, { reflectance: ZERO, emission: lightRadiance(light), lamp, ownNormal: shape.ownNormal });
  });
  return { primitives, surfaces };
}

// ISC-1: boxes of one rotation follow each other, rotations in the order of their first use.
function groupedByRotation(boxes) {
  const groups = [];
  for (const box of boxes) {
    const group = groups.find(([first]) => sameRotation(first.rotation, box.rotation));
    if (group) group.push(box);
    else groups.push([box]);
  }
  return groups.flat();
}

function sameRotation(a, b) {
  return a.flat().every((entry, i) => entry === b.flat()[i]);
}

// SCN-5
export function lightRadiance(light) {
  const factor = light.power / (Math.PI * quadArea(light));
  return scale(light.color, factor);
}

export function quadArea(quad) {
  return length(cross(quad.edge_u, quad.edge_v));
}

// ISC-1, ISC-2
export function closestHit(geometry, origin, direction) {
  let nearest = { t: MISS, surface: geometry.surfaces.length };
  for (const { shape, first } of geometry.primitives) {
    const met = shape.meet(origin, direction);
    if (met.t < nearest.t) nearest = { ...met, shape, surface: first + (met.wall ?? 0) };
  }
  return nearest;
}

// ISC-2, ISC-8, ISC-14: point, normal, reflectance and emission of a hit.
export function surfaceAt(geometry, hit, origin, direction) {
  if (hit.t >= MISS) return { point: ZERO, normal: ZERO, reflectance: ZERO, emission: ZERO };
  const { reflectance, emission, ownNormal } = geometry.surfaces[hit.surface];
  const point = add(origin, scale(direction, hit.t));
  const normal = hit.shape.normal(hit, point, direction);
  const isBehind = ownNormal !== undefined && dot(ownNormal, direction) > 0;
  return { point, normal, reflectance, emission: isBehind ? ZERO : emission };
}

// ISC-9
export function spawnOrigin(point, normal, t) {
  return add(point, scale(normal, SPAWN_OFFSET * (largestMagnitude(point) + t)));
}

// ISC-10
export function isOccluded(geometry, origin, direction, distance) {
  return geometry.primitives.some(({ shape }) => shape.meet(origin, direction).t < distance);
}
