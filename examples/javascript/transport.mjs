// Paths of light: from vertex to vertex (LTR-1 to LTR-11).

import { cameraBasis, cameraRay } from "./camera.mjs";
import { buildSky, sampleSky, skyPdf, skyRadiance } from "./environment.mjs";
import { buildGeometry, closestHit, isOccluded, lightRadiance, quadArea, spawnOrigin, surfaceAt } from "./geometry.mjs";
import { MATERIALS, SINGLE_PDF, siteOf } from "./materials.mjs";
import { LARGEST_WORD, pixelCounter, SAMPLER_NAMES, uniforms } from "./random.mjs";
import { require, requireInteger } from "./refusal.mjs";
import { discreteProbability, sampleDiscrete, sampleQuad } from "./sampling.mjs";
import { MISS } from "./shapes.mjs";
import {
  add,
  cross,
  dot,
  largest,
  largestMagnitude,
  multiply,
  negate,
  normalize,
  ONE,
  scale,
  subtract,
  sum,
  ZERO,
} from "./vectors.mjs";

const CAMERA_PDF = 1e30;
const LEAST_DENSITY = 1e-15;
const LEAST_SQUARE = 1e-30;
const LARGEST_RATIO = 1e15;
const ROULETTE_LIMIT = 0.95;
const SKY_SHARE = 0.5;
const LARGEST_DEPTH = 2 ** 31 - 1;

const HEURISTICS = { balance: 1, power: 2 };
const STRATEGIES = ["mis", "light", "bsdf"];

// LTR-6, LTR-8, LTR-9
export function checkSettings(settings) {
  requireInteger(settings.max_depth, "max_depth", 0, LARGEST_DEPTH);
  if (settings.roulette_depth !== null) requireInteger(settings.roulette_depth, "roulette_depth", 0, LARGEST_DEPTH);
  require(STRATEGIES.includes(settings.strategy), `strategy ${settings.strategy}: must be one of ${STRATEGIES}`);
  require(Object.hasOwn(HEURISTICS, settings.heuristic), `heuristic ${settings.heuristic}: unknown`);
  require(SAMPLER_NAMES.includes(settings.sampler), `sampler ${settings.sampler}: must be one of ${SAMPLER_NAMES}`);
}

// What is computed once for a scene and settings.
export function buildWorld(scene, settings) {
  checkSettings(settings);
  const geometry = buildGeometry(scene);
  const lamps = buildLamps(scene.lights);
  const sky = scene.environment && buildSky(scene.environment);
  return {
    geometry,
    lamps,
    sky,
    settings,
    background: scene.background,
    basis: cameraBasis(scene.camera),
    samplesLights: samplesLights(geometry, lamps, sky, settings),
    skyShare: !sky ? 0 : lamps.hasPower ? SKY_SHARE : 1,
  };
}

// LTR-3: lamps with the running sums of their power.
export function buildLamps(lights) {
  const weights = lights.map((light) => light.power * sum(light.color));
  const total = weights.reduce((all, weight) => all + weight, 0);
  let running = 0;
  const sums = weights.map((weight) => (running += weight) / total);
  if (sums.length > 0) sums[sums.length - 1] = 1;
  const list = lights.map((light) => ({
    corner: light.corner,
    edgeU: light.edge_u,
    edgeV: light.edge_v,
    ownNormal: quadNormal(light),
    area: quadArea(light),
    radiance: lightRadiance(light),
  }));
  return { list, sums, hasPower: total > 0 };
}

function quadNormal(quad) {
  return normalize(cross(quad.edge_u, quad.edge_v));
}

// LTR-10, SHD-4
function samplesLights(geometry, lamps, sky, settings) {
  const kinds = geometry.surfaces.filter((surface) => surface.material).map((surface) => surface.material.kind);
  const allSingle = kinds.length > 0 && kinds.every((kind) => MATERIALS[kind].isSingle);
  return settings.strategy !== "bsdf" && (lamps.hasPower || sky !== null) && !allSingle;
}

// LTR-5
export function misWeight(pdf, other, heuristic) {
  const ratio = Math.min(other / Math.max(pdf, LEAST_DENSITY), LARGEST_RATIO);
  return 1 / (1 + ratio ** HEURISTICS[heuristic]);
}

// LTR-3: the density per steradian of a point of a lamp; `share` of the light samples go to lamps (ENV-4).
export function lightPdf(lamps, lamp, square, cosine, share) {
  const probability = discreteProbability(lamps.sums, lamp) * share;
  return (probability * square) / (lamps.list[lamp].area * Math.max(cosine, LEAST_DENSITY));
}

// RND-5, LTR-1, RNG-7
export function startPath(world, width, height, x, y, seed, sample) {
  requireInteger(width, "width", 1, 65536);
  requireInteger(height, "height", 1, 65536);
  requireInteger(x, "x", 0, width - 1);
  requireInteger(y, "y", 0, height - 1);
  requireInteger(seed, "seed", 0, LARGEST_WORD);
  requireInteger(sample, "sample", 0, LARGEST_WORD);
  const pixel = pixelCounter(x, y);
  const [u, v] = uniforms(world.settings.sampler, seed, pixel, sample, 0);
  const { origin, direction } = cameraRay(world.basis, width, height, x, y, u, v);
  return { pixel, origin, direction, beta: ONE, radiance: ZERO, pdf: CAMERA_PDF };
}

// LTR-2: the weight of light that a direction of this density found, where a light sample has density q.
function emissionWeight(world, pdf, q) {
  if (!world.samplesLights) return 1;
  if (world.settings.strategy === "light") return pdf >= SINGLE_PDF ? 1 : 0;
  return misWeight(pdf, q, world.settings.heuristic);
}

// LTR-2, ENV-5: the next surface of a path, and the radiance with the surface's emission.
export function arrive(world, path) {
  const hit = closestHit(world.geometry, path.origin, path.direction);
  const surface = surfaceAt(world.geometry, hit, path.origin, path.direction);
  const seen = emissionOnArrival(world, path, hit, surface);
  const { point, normal, reflectance } = surface;
  const radiance = add(path.radiance, multiply(path.beta, seen));
  return { point, normal, reflectance, t: hit.t, surface: hit.surface, radiance };
}

function emissionOnArrival(world, path, hit, surface) {
  const { direction, pdf } = path;
  if (hit.t >= MISS) {
    if (!world.sky) return world.background;
    const weight = emissionWeight(world, pdf, world.skyShare * skyPdf(world.sky, direction));
    return scale(skyRadiance(world.sky, direction), weight);
  }
  const { lamp } = world.geometry.surfaces[hit.surface];
  if (lamp === undefined) return surface.emission;
  const square = Math.max(hit.t * hit.t, LEAST_SQUARE);
  const cosine = Math.abs(dot(surface.normal, direction));
  const q = world.lamps.hasPower ? lightPdf(world.lamps, lamp, square, cosine, 1 - world.skyShare) : 0;
  return scale(surface.emission, emissionWeight(world, pdf, q));
}

// LTR-3, ENV-4: a light sample as direction, distance, both ends' cosines, radiance and density.
function sampleLight(world, origin, choice, u0, u1) {
  const { sky, lamps, skyShare } = world;
  if (choice < skyShare) {
    const wi = sampleSky(sky, choice / skyShare, u0, u1);
    return { wi, distance: MISS, cosine: 1, radiance: skyRadiance(sky, wi), pdf: skyShare * skyPdf(sky, wi) };
  }
  const lamp = sampleDiscrete(lamps.sums, (choice - skyShare) / (1 - skyShare));
  const { corner, edgeU, edgeV, ownNormal, radiance } = lamps.list[lamp];
  const point = sampleQuad(corner, edgeU, edgeV, u0, u1);
  const lifted = spawnOrigin(point, ownNormal, largestMagnitude(origin));
  const way = subtract(lifted, origin);
  const square = Math.max(dot(way, way), LEAST_SQUARE);
  const distance = Math.sqrt(square);
  const wi = scale(way, 1 / distance);
  const cosine = Math.max(0, -dot(ownNormal, wi));
  return { wi, distance, cosine, radiance, pdf: lightPdf(lamps, lamp, square, cosine, 1 - skyShare) };
}

// LTR-4: what a light sample adds to the radiance.
function directLight(world, site, material, origin, numbers) {
  const light = sampleLight(world, origin, ...numbers);
  if (dot(site.normal, light.wi) <= 0 || light.cosine <= 0) return ZERO;
  if (isOccluded(world.geometry, origin, light.wi, light.distance)) return ZERO;
  const { strategy, heuristic } = world.settings;
  const weight = strategy === "light" ? 1 : misWeight(light.pdf, material.pdf(site, light.wi), heuristic);
  const value = material.value(site, light.wi);
  return scale(multiply(value, light.radiance), weight / light.pdf);
}

// LTR-7 to LTR-10: a path leaves a surface.
export function scatter(world, path, vertex, counters, depth) {
  const surface = world.geometry.surfaces[vertex.surface];
  if (surface === undefined || surface.lamp !== undefined) {
    return { ...path, radiance: vertex.radiance, alive: false };
  }
  const { seed, sample, pixel } = counters;
  const { sampler, roulette_depth: rouletteDepth } = world.settings;
  const lightNumbers = uniforms(sampler, seed, pixel, sample, 1 + 2 * depth);
  const [u0, u1, choice] = uniforms(sampler, seed, pixel, sample, 2 + 2 * depth);
  const { point, normal, reflectance, t } = vertex;
  const material = MATERIALS[surface.material.kind];
  const site = siteOf(surface, point, normal, reflectance, path.direction, path.beta);

  const above = spawnOrigin(point, normal, t);
  let radiance = vertex.radiance;
  if (world.samplesLights) {
    radiance = add(radiance, directLight(world, site, material, above, lightNumbers.slice(0, 3)));
  }

  const scattered = material.sample(site, u0, u1, choice);
  const origin = scattered.isTransmitted ? spawnOrigin(point, negate(normal), t) : above;
  const { direction, pdf } = scattered;
  let { beta } = scattered;
  let alive = largest(beta) > 0;
  if (alive && rouletteDepth !== null && depth >= rouletteDepth) {
    const q = Math.min(largest(beta), ROULETTE_LIMIT);
    alive = lightNumbers[3] < q;
    beta = scale(beta, 1 / q);
  }
  return { origin, direction, beta, radiance, pdf, alive };
}

// LTR-8: a whole path: its vertices, each with the throughput on arrival, and its radiance. The light sample of
// a scattering after which the path ends still counts.
export function tracePath(world, width, height, x, y, seed, sample) {
  let path = startPath(world, width, height, x, y, seed, sample);
  const counters = { seed, sample, pixel: path.pixel };
  const vertices = [];
  for (let depth = 0; ; depth++) {
    const vertex = arrive(world, path);
    vertices.push({ ...vertex, beta: path.beta });
    if (depth === world.settings.max_depth) return { vertices, radiance: vertex.radiance };
    path = scatter(world, path, vertex, counters, depth);
    if (!path.alive) return { vertices, radiance: path.radiance };
  }
}

// LTR-11
export function unshadowed(lamps, point, normal, reflectance) {
  let gathered = ZERO;
  for (const { corner, edgeU, edgeV, ownNormal, area, radiance } of lamps.list) {
    const way = subtract(sampleQuad(corner, edgeU, edgeV, 0.5, 0.5), point);
    const square = Math.max(dot(way, way), LEAST_SQUARE);
    const wi = scale(way, 1 / Math.sqrt(square));
    const cosines = Math.max(0, dot(normal, wi)) * Math.max(0, -dot(ownNormal, wi));
    gathered = add(gathered, scale(radiance, (area * cosines) / (square + area / Math.PI)));
  }
  return multiply(scale(reflectance, 1 / Math.PI), gathered);
}
