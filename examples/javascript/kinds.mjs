// The kinds of test vectors, each a function from a request's input to the outputs by name.

import { cameraBasis, cameraRay } from "./camera.mjs";
import { sceneDigest } from "./canonical.mjs";
import { checkWindow, drawPixels, featureImage, LAYER_NAMES, smoothedColor, windowAt } from "./dataset.mjs";
import { expose, srgbEncode, toDisplay } from "./encoding.mjs";
import { buildSky, sampleSky, skyPdf, skyRadiance, sunShare } from "./environment.mjs";
import { buildGeometry, closestHit, isOccluded, lightRadiance, surfaceAt } from "./geometry.mjs";
import { fresnel, ggx, MATERIALS, refract, schlick, visibleNormal } from "./materials.mjs";
import * as metrics from "./metrics.mjs";
import { parametersDigest, readModel, widthsOf } from "./model_file.mjs";
import { adamRun, adamStep, denoise, forward, initNetwork, lossAndGradients } from "./network.mjs";
import { array, float, floats, nested, text } from "./numbers.mjs";
import { pcg4d, randomBlock, scramble, sobolBlock, sobolPoint, uniformFloat } from "./random.mjs";
import { require, requireInteger } from "./refusal.mjs";
import { render } from "./render.mjs";
import {
  concentricDisk,
  cosineHemisphere,
  cosineHemispherePdf,
  discreteProbability,
  quadPdf,
  sampleDiscrete,
  sampleQuad,
  sphericalCauchy,
  sphericalCauchyPdf,
  tangentFrame,
  toLocal,
  toWorld,
} from "./sampling.mjs";
import { cameraFromText, sceneFromText } from "./scene.mjs";
import { makeQuad, slabs, sphereDistance } from "./shapes.mjs";
import { emittedSine } from "./sine.mjs";
import {
  arrive,
  buildLamps,
  buildWorld,
  lightPdf,
  misWeight,
  scatter,
  startPath,
  tracePath,
  unshadowed,
} from "./transport.mjs";
import { cross, dot, largest, normalize, ONE, rotate, scale, smallest, ZERO } from "./vectors.mjs";
import { checkWhole, forwardWhole, rounded, roundedOn, stepsOf, wholeSine } from "./whole.mjs";

const IDENTITY = [
  [1, 0, 0],
  [0, 1, 0],
  [0, 0, 1],
];
const TURNED = [
  [0.8, 0.6, 0],
  [-0.6, 0.8, 0],
  [0, 0, 1],
];
const WHITE = { reflectance: ONE, emission: ZERO, material: null };

// Numbers that the titles of kinds state.
const CAMERA = { position: [0.5, 1, 4], look_at: [0, -0.2, 0], up: [0, 1, 0], vertical_fov_deg: 41 };
const SUMS = [0.125, 0.125, 0.625, 1];
const BOX = { center: [0.25, -0.5, 0.125], half_extent: [0.5, 0.75, 1], ...WHITE };
const QUAD = { corner: [-0.5, 0.25, -0.75], edge_u: [1.5, 0, 0.25], edge_v: [0.25, 0, 2] };
const SPHERE = { center: [0.25, -0.5, 0.125], radius: 0.75 };
const EMPTY = { room: null, boxes: [], spheres: [], quads: [], lights: [] };
const ROOM = {
  low: [-2, -1, -3],
  high: [2, 1.5, 3],
  reflectances: Array(6).fill(ONE),
  emission: ZERO,
  materials: [],
};
const NEAREST = {
  ...EMPTY,
  boxes: [{ center: [0, -0.5, 0], half_extent: [1, 0.5, 1], rotation: IDENTITY, ...WHITE }],
  spheres: [{ center: [0, 0.5, 0], radius: 0.5, ...WHITE }],
  quads: [{ corner: [-1, 1, -1], edge_u: [2, 0, 0], edge_v: [0, 0, 2], ...WHITE }],
};
const HALL = {
  ...NEAREST,
  room: { ...ROOM, low: [-3, -1, -3], high: [3, 3, 3] },
  lights: [{ corner: [-0.5, 2, -0.5], edge_u: [1, 0, 0], edge_v: [0, 0, 1], color: ONE, power: 1 }],
};
const SKY = buildSky({
  zenith: [0.16, 0.3, 0.62],
  horizon: [0.62, 0.7, 0.8],
  ground: [0.18, 0.16, 0.14],
  sun_direction: [0.6, 0.8, 0],
  sun_irradiance: [2.6, 2.2, 1.6],
  sun_concentration: 64,
});
// The lamps of scenes/terrace.json, half of whose light samples go to its sky.
const TERRACE = buildLamps([
  { corner: [0.25, 1.75, 0.25], edge_u: [0.5, 0, 0], edge_v: [0, 0, 0.5], color: [1, 0.75, 0.5], power: 12 },
  { corner: [-1.25, 1, 0.25], edge_u: [0, 0.5, 0], edge_v: [0.5, 0, 0.125], color: [0.25, 0.5, 1], power: 4 },
]);

// Inputs of which all are numbers, or lists of them, are read at once.
function ofFloats(answer) {
  return (input) => answer(Object.fromEntries(Object.entries(input).map(([name, value]) => [name, floats(value)])));
}

const random = {
  "random.pcg4d": ({ x, y, z, w }) => ({ words: pcg4d(x, y, z, w) }),
  "random.float": ({ word }) => ({ float: uniformFloat(word) }),
  "random.block": ({ seed, pixel, sample, block }) => {
    const words = randomBlock(seed, pixel, sample, block);
    return { words, floats: words.map(uniformFloat) };
  },
  "random.scrambled": ({ fraction, key }) => ({ words: [scramble(fraction, key)] }),
  "random.point": ({ index }) => ({ words: sobolPoint(index) }),
  "random.sobol": ({ seed, pixel, sample, block }) => ({
    floats: sobolBlock(seed, pixel, sample, block).map(uniformFloat),
  }),
};

const light = {
  "encoding.exposed": ({ linear, exposure_stops: stops }) => ({ exposed: expose(linear, stops) }),
  "encoding.srgb": ({ linear }) => ({ encoded: srgbEncode(linear) }),
  "encoding.display": ({ linear }) => ({ encoded: toDisplay(linear, 0) }),
  "encoding.shown": ({ linear, exposure_stops: stops }) => ({ encoded: toDisplay(linear, stops) }),
  "vector": ({ a, b, c }) => ({
    inner: dot(a, b),
    outer: cross(a, b),
    scaled: scale(a, b[0]),
    unit: normalize(a),
    rotated: rotate([a, b, c], c),
    largest: largest(a),
    smallest: smallest(a),
  }),
  "camera.axes": (camera) => {
    const { forward: ahead, right, up, tanHalfFov } = cameraBasis(camera);
    return { forward: ahead, right, up, tan_half_fov: tanHalfFov };
  },
  "camera.ray": ({ x, y, u, v }) => cameraRay(cameraBasis(CAMERA), 97, 64, x, y, u, v),
  "sampling.concentric_disk": ({ u0, u1 }) => {
    const [x, y] = concentricDisk(u0, u1);
    return { x, y };
  },
  "sampling.cosine_hemisphere": ({ u0, u1 }) => {
    const direction = cosineHemisphere(u0, u1);
    return { direction, pdf: cosineHemispherePdf(direction[2]) };
  },
  "sampling.spherical_cauchy": ({ u0, u1, concentration }) => {
    const direction = sphericalCauchy(u0, u1, concentration);
    return { direction, pdf: sphericalCauchyPdf(1 - direction[2], concentration) };
  },
  "sampling.quad": ({ u0, u1, corner, edge_u: edgeU, edge_v: edgeV }) => ({
    point: sampleQuad(corner, edgeU, edgeV, u0, u1),
    pdf: quadPdf(edgeU, edgeV),
  }),
  "sampling.discrete": ({ u0 }) => {
    const index = sampleDiscrete(SUMS, u0);
    return { index, probability: discreteProbability(SUMS, index) };
  },
  "sampling.tangent_frame": ({ normal }) => tangentFrame(normal),
  "sampling.to_world": ({ vector, normal }) => ({ world: toWorld(vector, normal), local: toLocal(vector, normal) }),
  "sky.share": (sky) => ({ share: sunShare(sky) }),
  "sky.radiance": ({ direction }) => ({ radiance: skyRadiance(SKY, direction), pdf: skyPdf(SKY, direction) }),
  "sky.sample": ({ u0, u1, u_choice: choice }) => ({ direction: sampleSky(SKY, choice, u0, u1) }),
  "sine": ({ x }) => ({ sin: emittedSine(x) }),
};

// The nearest hit of a ray in a scene.
function nearestHit(scene, { origin, direction }) {
  const geometry = buildGeometry({ ...EMPTY, ...scene });
  const hit = closestHit(geometry, origin, direction);
  const { normal } = surfaceAt(geometry, hit, origin, direction);
  return { t: hit.t, normal, surface: hit.surface };
}

const intersection = {
  "intersection.sphere": ({ origin, direction }) => ({
    t: sphereDistance(SPHERE.center, SPHERE.radius, origin, direction),
  }),
  "intersection.quad": ({ origin, direction }) => ({ t: makeQuad(QUAD).meet(origin, direction).t }),
  "intersection.slabs": ({ origin, direction }) => slabs(BOX.center, BOX.half_extent, origin, direction),
  "intersection.box": (ray) => nearestHit({ boxes: [{ ...BOX, rotation: IDENTITY }] }, ray),
  "intersection.turned_box": (ray) => nearestHit({ boxes: [{ ...BOX, rotation: TURNED }] }, ray),
  "intersection.room": (ray) => nearestHit({ room: ROOM }, ray),
  "intersection.nearest": (ray) => nearestHit(NEAREST, ray),
  "intersection.occluded": ({ origin, direction, distance }) => ({
    occluded: Number(isOccluded(buildGeometry(HALL), origin, direction, distance)),
  }),
};

// A surface of this material sends a path on.
function sampled(kind, input) {
  const { wo, normal, reflectance, u0, u1, u_choice: choice, roughness, ior, outside } = input;
  const site = { wo, normal, reflectance, beta: ONE, roughness, ior, isOutside: outside === 1 };
  const { direction, beta, pdf } = MATERIALS[kind].sample(site, u0, u1, choice);
  return { direction, beta, pdf };
}

const material = {
  "material.ggx": ({ m, roughness }) => ({ density: ggx(m, roughness) }),
  "material.schlick": ({ reflectance, cosine }) => ({ reflected: schlick(reflectance, cosine) }),
  "material.visible_normal": ({ u0, u1, wo, roughness }) => ({ m: visibleNormal(wo, roughness, u0, u1) }),
  "material.refracted": ({ wo, normal, ratio }) => {
    const { direction, behind } = refract(wo, normal, ratio);
    return { direction, cosine: behind };
  },
  "material.fresnel": ({ cosine, behind, ratio }) => ({ share: fresnel(cosine, behind, ratio) }),
  "material.lambertian": (input) => sampled("lambertian", input),
  "material.mirror": (input) => sampled("mirror", input),
  "material.conductor": (input) => sampled("conductor", input),
  "material.dielectric": (input) => sampled("dielectric", input),
  "material.conductor_value": ({ wi, ...rest }) => {
    const site = { ...rest, beta: ONE };
    return { value: MATERIALS.conductor.value(site, wi), pdf: MATERIALS.conductor.pdf(site, wi) };
  },
};

const transport = {
  "transport.lamp": (lamp) => ({ radiance: lightRadiance(lamp) }),
  "transport.light_pdf": ({ square, cosine }) => ({
    lamp_0: lightPdf(TERRACE, 0, square, cosine, 0.5),
    lamp_1: lightPdf(TERRACE, 1, square, cosine, 0.5),
  }),
  "transport.mis_weight": ({ pdf, other }) => ({
    balance: misWeight(pdf, other, "balance"),
    power: misWeight(pdf, other, "power"),
  }),
  "transport.unshadowed": ({ point, normal, reflectance }) => ({
    unshadowed: unshadowed(TERRACE, point, normal, reflectance),
  }),
};

const worldOf = (input) => buildWorld(sceneFromText(text(input.scene)), input.settings);

const pathOf = (input) => ({
  origin: floats(input.origin),
  direction: floats(input.direction),
  beta: floats(input.beta),
  radiance: floats(input.radiance),
  pdf: float(input.pdf),
});

const vertexOf = (input) => ({
  point: floats(input.point),
  normal: floats(input.normal),
  reflectance: floats(input.reflectance),
  t: float(input.t),
  surface: input.surface,
  radiance: floats(input.radiance),
});

const VERTEX_OUTPUTS = ["t", "surface", "point", "normal", "reflectance", "beta", "radiance"];

const path = {
  "path.start": (input) => {
    const { width, height, x, y, seed, sample } = input;
    const { pixel, origin, direction } = startPath(worldOf(input), width, height, x, y, seed, sample);
    return { pixel, origin, direction };
  },
  "path.arrive": (input) => arrive(worldOf(input), pathOf(input)),
  "path.scatter": (input) => {
    const counters = { seed: input.seed, sample: input.sample, pixel: input.pixel };
    return scatter(worldOf(input), pathOf(input), vertexOf(input), counters, input.depth);
  },
  "path.whole": (input) => {
    const { width, height, x, y, seed, sample } = input;
    const { vertices } = tracePath(worldOf(input), width, height, x, y, seed, sample);
    return Object.fromEntries(VERTEX_OUTPUTS.map((name) => [name, vertices.map((vertex) => vertex[name])]));
  },
  "picture.exact": (input) => render(worldOf(input), input.width, input.height, input.spp, input.seed),
  "picture.rendered": (input) => render(worldOf(input), input.width, input.height, input.spp, input.seed),
};

// The layers of parameters in a request: NAME_0, NAME_1, ...
function layersOf(input, names) {
  const layers = [];
  for (let l = 0; `weight_${l}` in input; l++) {
    layers.push(Object.fromEntries(names.map((name) => [name, floats(input[`${name}_${l}`])])));
  }
  return layers;
}

// SIR-1: a layer takes what the one before gives, and has as many biases as rows.
function networkOf(input) {
  const layers = layersOf(input, ["weight", "bias"]);
  layers.forEach(({ weight, bias }, l) => {
    const wide = l > 0 ? layers[l - 1].weight.length : weight[0]?.length;
    const fits = weight.every((row) => row.length === wide) && bias.length === weight.length;
    require(fits, `layer ${l} does not fit`);
  });
  return { layers, omegaFirst: float(input.omega_0_first), omegaHidden: float(input.omega_0_hidden) };
}

// Outputs by name and layer: weight_0, bias_0, weight_1, ...
function namedByLayer(layers, names, prefix = "") {
  return Object.fromEntries(layers.flatMap((layer, l) => names.map((name) => [`${prefix}${name}_${l}`, layer[name]])));
}

function frameOf(input) {
  return Object.fromEntries(LAYER_NAMES.filter((name) => name in input).map((name) => [name, array(input[name])]));
}

const scalesOf = (input) => ({
  exposure_stops: float(input.exposure_stops),
  depth_scale: float(input.depth_scale),
  position_center: floats(input.position_center),
  position_scale: float(input.position_scale),
});

const metric = (name) => (input) => ({ value: metrics[name](array(input.image), array(input.reference)) });

const network = {
  "network.init": (input) => {
    const omegas = [float(input.omega_0_first), float(input.omega_0_hidden)];
    const { layers } = initNetwork(input.widths, ...omegas, input.seed);
    return namedByLayer(layers, ["weight", "bias"]);
  },
  "network.forward": (input) => {
    const given = networkOf(input);
    require(input.x.length === given.layers[0].weight[0].length, "x does not fit the first layer");
    const { outputs } = forward(given, floats(input.x));
    return Object.fromEntries(outputs.map((output, l) => [`layer_${l}`, output]));
  },
  "network.gradient": (input) => {
    const { loss, gradients } = lossAndGradients(networkOf(input), floats(input.x), floats(input.target));
    return { loss, ...namedByLayer(gradients, ["weight", "bias"], "d") };
  },
  "adam.step": ofFloats(({ theta, g, m, v, learning_rate: rate, growth_1: growth1, growth_2: growth2 }) =>
    adamStep(theta, g, m, v, rate, growth1, growth2),
  ),
  "adam.run": ofFloats(({ theta, gradients, learning_rate: rate }) => {
    const states = adamRun(theta, gradients, rate);
    const output = (name) => states.map((row) => row.map((state) => state[name]));
    return { theta: output("theta"), m: output("m"), v: output("v") };
  }),
  "image.features": (input) => {
    const { shape, data } = featureImage(frameOf(input), text(input.features).split(","), scalesOf(input));
    return { image: nested(data, shape) };
  },
  "image.smoothed": (input) => {
    requireInteger(input.levels, "levels", 0, 20);
    const { shape, data } = smoothedColor(frameOf(input), input.levels);
    return { color: nested(data, shape) };
  },
  "image.window": (input) => {
    const image = array(input.image);
    checkWindow(input.size, input.border);
    requireInteger(input.x, "x", 0, image.shape[1] - 1);
    requireInteger(input.y, "y", 0, image.shape[0] - 1);
    return { window: windowAt(image, input.size, input.border, input.x, input.y) };
  },
  "image.draws": ({ seed, stream, count, shapes }) => drawPixels(seed, stream, count, shapes),
  "metric.mse": metric("mse"),
  "metric.psnr": metric("psnr"),
  "metric.ssim": metric("ssim"),
  "metric.relmse": metric("relmse"),
  "metric.smape": metric("smape"),
};

const modelOf = (content) => readModel(Buffer.from(text(content), "base64"));

const file = {
  "file.camera": (input) => cameraFromText(text(input.text)),
  "file.scene": (input) => ({ digest: sceneDigest(sceneFromText(text(input.text))) }),
  "file.model": (input) => {
    const model = modelOf(input.content);
    return {
      digest: parametersDigest(model.network),
      widths: widthsOf(model.network),
      features: model.features.join(","),
      window: model.window.size,
      border: model.window.border,
      omega_0: [model.network.omegaFirst, model.network.omegaHidden],
    };
  },
  "picture.denoised": (input) => ({ picture: denoise(modelOf(input.model), frameOf(input)) }),
};

const wholeOutputs = ({ layers, fraction }) => ({
  ...namedByLayer(layers, ["weight", "factor", "bias"]),
  fraction,
});

const whole = {
  "whole.input": (input) => ({ n: floats(input.x).map(stepsOf) }),
  "whole.sine": ({ amplitude, phase }) => ({ value: phase.map((word) => wholeSine(word, amplitude)) }),
  "whole.forward": (input) => {
    const { amplitude, fraction, n } = input;
    const integers = { layers: layersOf(input, ["weight", "factor", "bias"]), amplitude, fraction };
    checkWhole(integers);
    const outputs = forwardWhole(integers, n);
    const color = outputs.pop();
    return { ...Object.fromEntries(outputs.map((output, l) => [`layer_${l}`, output])), color };
  },
  "whole.rounded": (input) => wholeOutputs(rounded(networkOf(input), input.size, input.amplitude)),
  "whole.rounded_on": (input) =>
    wholeOutputs(roundedOn(networkOf(input), input.size, input.amplitude, floats(input.windows))),
};

function mapValues(group, change) {
  return Object.fromEntries(Object.entries(group).map(([key, value]) => [key, change(value)]));
}

// CNF-9: inputs that are one integer each.
const PIXEL = ["width", "height", "x", "y", "seed", "sample"];
const RENDERED = ["width", "height", "spp", "seed"];
const INTEGERS = {
  "random.pcg4d": ["x", "y", "z", "w"],
  "random.float": ["word"],
  "random.block": ["seed", "pixel", "sample", "block"],
  "random.scrambled": ["fraction", "key"],
  "random.point": ["index"],
  "random.sobol": ["seed", "pixel", "sample", "block"],
  "path.start": PIXEL,
  "path.scatter": ["seed", "sample", "pixel", "depth", "surface"],
  "path.whole": PIXEL,
  "picture.exact": RENDERED,
  "picture.rendered": RENDERED,
  "network.init": ["seed"],
  "image.smoothed": ["levels"],
  "image.window": ["size", "x", "y"],
  "image.draws": ["seed", "stream", "count"],
  "whole.sine": ["amplitude"],
  "whole.forward": ["amplitude", "fraction"],
  "whole.rounded": ["size", "amplitude"],
  "whole.rounded_on": ["size", "amplitude"],
};

function withIntegers([kind, answer]) {
  const names = INTEGERS[kind] ?? [];
  const checked = (input) => {
    for (const name of names) require(Number.isInteger(input[name]), `${name} ${input[name]}: must be an integer`);
    return answer(input);
  };
  return [kind, checked];
}

export const KINDS = Object.fromEntries(
  Object.entries({
    ...random,
    ...mapValues({ ...light, ...intersection, ...material, ...transport }, ofFloats),
    ...path,
    ...network,
    ...file,
    ...whole,
  }).map(withIntegers),
);
