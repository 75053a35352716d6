// Scene files: reading and rules (SCN-1 to SCN-9). The text and the digest are in canonical.mjs.

import { parseJson } from "./json.mjs";
import {
  boundedNumber,
  list,
  matrix,
  number,
  optional,
  orNull,
  record,
  required,
  text,
  texts,
  vector,
} from "./records.mjs";
import { require } from "./refusal.mjs";
import { cross, dot, length, subtract, sum } from "./vectors.mjs";

const IDENTITY = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
const BLACK = [0, 0, 0];
const WALLS = 6;
const LEAST_SINE = 1e-6;
const ROTATION_TOLERANCE = 1e-6;
const LARGEST_CONCENTRATION = 1e6;

// SCN-6: the numbers of each kind of material, in order.
const MATERIAL_FIELDS = {
  lambertian: {},
  mirror: {},
  conductor: { roughness: optional(boundedNumber, 0.2) },
  dielectric: { ior: optional(boundedNumber, 1.5) },
};

function material(value, path) {
  require(value instanceof Map, `${path}: must be an object`);
  const kind = text(value.get("kind") ?? null, `${path}.kind`);
  require(Object.hasOwn(MATERIAL_FIELDS, kind), `${path}.kind ${kind}: unknown material`);
  return record({ kind: required(text), ...MATERIAL_FIELDS[kind] })(value, path);
}

const surfaceFields = { emission: optional(vector, BLACK), material: optional(orNull(material), null) };

// SCN-6: the keys of each object in the order of the canonical text.
export const FIELDS = {
  camera: {
    position: required(vector),
    look_at: required(vector),
    up: optional(vector, [0, 1, 0]),
    vertical_fov_deg: optional(boundedNumber, 40),
  },
  room: {
    low: required(vector),
    high: required(vector),
    reflectances: required(list(vector, WALLS)),
    emission: optional(vector, BLACK),
    materials: optional(list(orNull(material)), []),
  },
  box: {
    center: required(vector),
    half_extent: required(vector),
    reflectance: required(vector),
    rotation: optional(matrix, IDENTITY),
    ...surfaceFields,
  },
  sphere: {
    center: required(vector),
    radius: required(boundedNumber),
    reflectance: required(vector),
    ...surfaceFields,
  },
  quad: {
    corner: required(vector),
    edge_u: required(vector),
    edge_v: required(vector),
    reflectance: required(vector),
    ...surfaceFields,
  },
  light: {
    corner: required(vector),
    edge_u: required(vector),
    edge_v: required(vector),
    color: required(vector),
    power: required(boundedNumber),
  },
  sky: {
    zenith: required(vector),
    horizon: required(vector),
    ground: required(vector),
    sun_direction: optional(vector, [0, 1, 0]),
    sun_irradiance: optional(vector, BLACK),
    sun_concentration: optional(boundedNumber, 1000),
  },
};

const readCamera = record(FIELDS.camera);
const readScene = record({
  format: required(text),
  version: required(number),
  name: required(text),
  camera: required(readCamera),
  room: optional(orNull(record(FIELDS.room)), null),
  boxes: optional(list(record(FIELDS.box)), []),
  spheres: optional(list(record(FIELDS.sphere)), []),
  quads: optional(list(record(FIELDS.quad)), []),
  lights: optional(list(record(FIELDS.light)), []),
  background: optional(vector, BLACK),
  environment: optional(orNull(record(FIELDS.sky)), null),
  info: optional(texts, new Map()),
});

// SCN-6
export function sceneFromText(sceneText) {
  const scene = readScene(parseJson(sceneText), "scene");
  require(scene.format === "wamnet-scene", `format ${scene.format}: must be wamnet-scene`);
  require(scene.version === 1, `version ${scene.version}: must be 1`);
  checkScene(scene);
  return scene;
}

// SCN-6
export function cameraFromText(cameraText) {
  const camera = readCamera(parseJson(cameraText), "camera");
  checkCamera(camera);
  return camera;
}

// SCN-7
function checkScene(scene) {
  checkCamera(scene.camera);
  if (scene.room) checkRoom(scene.room);
  scene.boxes.forEach((box, i) => checkBox(box, `boxes[${i}]`));
  scene.spheres.forEach((sphere, i) => checkSphere(sphere, `spheres[${i}]`));
  scene.quads.forEach((quad, i) => checkQuad(quad, `quads[${i}]`));
  scene.lights.forEach((light, i) => checkLight(light, `lights[${i}]`));
  checkNotNegative(scene.background, "background");
  if (scene.environment) checkSky(scene.environment, scene.background);
}

function checkCamera(camera) {
  const fov = camera.vertical_fov_deg;
  require(fov > 0 && fov < 180, `camera.vertical_fov_deg ${fov}: must be in (0, 180)`);
  const forward = subtract(camera.look_at, camera.position);
  require(length(forward) > 0, "camera.look_at: must not be the position");
  require(spansArea(forward, camera.up), "camera.up: must not be along the view");
}

function checkRoom(room) {
  for (let axis = 0; axis < 3; axis++) {
    require(room.low[axis] < room.high[axis], `room.low[${axis}]: must be below room.high`);
  }
  room.reflectances.forEach((reflectance, i) => checkReflectance(reflectance, `room.reflectances[${i}]`));
  checkNotNegative(room.emission, "room.emission");
  require([0, WALLS].includes(room.materials.length), "room.materials: must be six or none");
  room.materials.forEach((entry, i) => checkMaterial(entry, `room.materials[${i}]`, false));
}

// BOX-1
function checkBox(box, path) {
  require(box.half_extent.every((half) => half > 0), `${path}.half_extent: must be positive`);
  require(isRotation(box.rotation), `${path}.rotation: must be a rotation`);
  checkSurface(box, path, true);
}

// SPH-1
function checkSphere(sphere, path) {
  require(sphere.radius > 0, `${path}.radius: must be positive`);
  checkSurface(sphere, path, true);
}

// QUA-1
function checkQuad(quad, path) {
  require(spansArea(quad.edge_u, quad.edge_v), `${path}.edge_v: edges must span an area`);
  checkSurface(quad, path, false);
}

// SCN-5
function checkLight(light, path) {
  require(spansArea(light.edge_u, light.edge_v), `${path}.edge_v: edges must span an area`);
  checkNotNegative(light.color, `${path}.color`);
  require(light.power >= 0, `${path}.power: must not be negative`);
}

// SCN-9
function checkSky(sky, background) {
  for (const name of ["zenith", "horizon", "ground", "sun_irradiance"]) {
    checkNotNegative(sky[name], `environment.${name}`);
  }
  require(length(sky.sun_direction) > 0, "environment.sun_direction: must not be 0");
  const concentration = sky.sun_concentration;
  require(
    concentration >= 0 && concentration <= LARGEST_CONCENTRATION,
    `environment.sun_concentration ${concentration}: must be in [0, 1e6]`,
  );
  require(sum(background) === 0, "background: must be 0 beside a sky");
}

function checkSurface(shape, path, closed) {
  checkReflectance(shape.reflectance, `${path}.reflectance`);
  checkNotNegative(shape.emission, `${path}.emission`);
  checkMaterial(shape.material, `${path}.material`, closed);
}

// SCN-4, SCN-7
function checkMaterial(entry, path, closed) {
  if (entry === null) return;
  if (entry.kind === "conductor") {
    const alpha = entry.roughness;
    require(alpha >= 0.001 && alpha <= 1, `${path}.roughness ${alpha}: must be in [0.001, 1]`);
  }
  if (entry.kind === "dielectric") {
    require(closed, `${path}: glass needs a box or a sphere`);
    require(entry.ior >= 1 && entry.ior <= 4, `${path}.ior ${entry.ior}: must be in [1, 4]`);
  }
}

function checkReflectance(reflectance, path) {
  require(reflectance.every((share) => share >= 0 && share <= 1), `${path}: must be in [0, 1]`);
}

function checkNotNegative(color, path) {
  require(color.every((channel) => channel >= 0), `${path}: must not be negative`);
}

// SHP-3
function spansArea(a, b) {
  return length(cross(a, b)) > LEAST_SINE * (length(a) * length(b));
}

// BOX-1
function isRotation(rows) {
  for (let i = 0; i < 3; i++) {
    for (let j = 0; j < 3; j++) {
      const deviation = Math.abs(dot(rows[i], rows[j]) - (i === j ? 1 : 0));
      if (!(deviation <= ROTATION_TOLERANCE)) return false;
    }
  }
  return dot(cross(rows[0], rows[1]), rows[2]) >= 0;
}
