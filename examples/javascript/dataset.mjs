// What the network sees: features, windows and draws (DAT-1 to DAT-10, SMO-1, SMO-2, FRM-5).

import { toDisplay } from "./encoding.mjs";
import { clip } from "./numbers.mjs";
import { randomBlock } from "./random.mjs";
import { require, requireInteger } from "./refusal.mjs";
import { smooth } from "./smoothing.mjs";

const HIGHLIGHT_STOPS = 4;
const SMOOTHING_LEVELS = 3;
const WHITES = 16;
const PIXEL_TAG = 0x50495845;
const LARGEST_SCALE = 1e18;
const LEAST_SCALE = 1e-18;
const LARGEST_STOPS = 64;
export const LARGEST_WINDOW = 64;
export const BORDERS = ["clamp", "zero"];

// DAT-1: encodings of one number x of a layer; `scales` are those of DAT-2.
const asColor = (x, scales) => toDisplay(x, scales.exposure_stops);
const asHighlight = (x, scales) => toDisplay(x, scales.exposure_stops - HIGHLIGHT_STOPS);
const asShare = (x) => clip(x, 0, 1);
const asSigned = (x) => clip(x, -1, 1);
const asDepth = (x, scales) => clip(x / scales.depth_scale, 0, 1);
const asPosition = (x, scales, channel) =>
  clip((x - scales.position_center[channel]) / scales.position_scale, -1, 1);

const feature = (layer, channels, encode) => ({ layer, channels, encode });

// SMO-1: colour smoothed, guided by these layers; `past` begins the names of those past mirrors and glass.
const smoothed = (past) => ({
  ...feature("color", 3, asColor),
  guides: { normal: `${past}normal`, albedo: `${past}albedo`, position: `${past}position`, depth: `${past}depth` },
});
const layersOf = ({ layer, guides = {} }) => [layer, ...Object.values(guides)];

// DAT-1: each feature's layer, channels and encoding.
export const FEATURES = {
  color: feature("color", 3, asColor),
  highlights: feature("color", 3, asHighlight),
  albedo: feature("albedo", 3, asShare),
  normal: feature("normal", 3, asSigned),
  direction: feature("direction", 3, asSigned),
  depth: feature("depth", 1, asDepth),
  position: feature("position", 3, asPosition),
  unshadowed: feature("unshadowed", 3, asColor),
  seen_albedo: feature("seen_albedo", 3, asShare),
  seen_normal: feature("seen_normal", 3, asSigned),
  seen_depth: feature("seen_depth", 1, asDepth),
  seen_position: feature("seen_position", 3, asPosition),
  seen_emission: feature("seen_emission", 3, asColor),
  history: feature("history", 3, asColor),
  history_weight: feature("history_weight", 1, asShare),
  smoothed: smoothed(""),
  seen_smoothed: smoothed("seen_"),
  sun: feature("sun", 3, asSigned),
  direct: feature("direct", 3, asColor),
};

// FRM-2: the layers that features are made of, and the channels of each.
export const LAYER_NAMES = [...new Set(Object.values(FEATURES).map(({ layer }) => layer))];
const channelsOfLayer = (layer) => FEATURES[layer].channels;

// DAT-9
export function checkFeatures(names) {
  require(names.length > 0, "features: must not be empty");
  for (const name of names) require(Object.hasOwn(FEATURES, name), `feature ${name}: unknown`);
  require(new Set(names).size === names.length, `features ${names}: must not repeat`);
}

export function channelsOf(names) {
  return names.reduce((count, name) => count + FEATURES[name].channels, 0);
}

// DAT-9
export function checkWindow(size, border) {
  requireInteger(size, "window size", 1, LARGEST_WINDOW);
  require(BORDERS.includes(border), `border ${border}: must be one of ${BORDERS}`);
}

// DAT-2, MOD-6
export function checkScales(scales) {
  for (const name of ["depth_scale", "position_scale"]) {
    const inRange = scales[name] >= LEAST_SCALE && scales[name] <= LARGEST_SCALE;
    require(inRange, `${name} ${scales[name]}: must be in [1e-18, 1e18]`);
  }
  const centered = scales.position_center.every((x) => Math.abs(x) <= LARGEST_SCALE);
  require(centered, `position_center ${scales.position_center}: must be at most 1e18 in magnitude`);
  const stops = scales.exposure_stops;
  require(Math.abs(stops) <= LARGEST_STOPS, `exposure_stops ${stops}: must be in [-64, 64]`);
}

// FRM-5: the common size of the layers that the features need.
function frameSize(layers, needed) {
  let size = null;
  for (const layer of needed) {
    require(layers[layer] !== undefined, `the frame has no layer ${layer}`);
    const { shape } = layers[layer];
    const channels = channelsOfLayer(layer);
    require(shape.length === 3 && shape[2] === channels, `layer ${layer}: must have ${channels} channels`);
    require(shape[0] > 0 && shape[1] > 0, `layer ${layer}: must have a pixel`);
    size ??= shape;
    require(shape[0] === size[0] && shape[1] === size[1], `layer ${layer}: must have the size of the others`);
  }
  return { height: size[0], width: size[1] };
}

// DAT-10
const known = (data) => data.map((x) => (Number.isNaN(x) ? 0 : x));

// SMO-3: the colour of a frame after some levels, guided by its layers.
export function smoothedColor(layers, levels, { layer, guides } = FEATURES.smoothed) {
  const { height, width } = frameSize(layers, layersOf({ layer, guides }));
  const compared = Object.fromEntries(Object.entries(guides).map(([name, from]) => [name, known(layers[from].data)]));
  return { shape: [height, width, 3], data: smooth(layers[layer].data, compared, height, width, levels) };
}

// SMO-1, SMO-2: the numbers of which a feature is the encoding.
function numbersOf(layers, source, scales) {
  const { data } = layers[source.layer];
  if (!source.guides) return data;
  const brightest = WHITES * 2 ** -scales.exposure_stops;
  const color = { ...layers.color, data: known(data).map((x) => clip(x, 0, brightest)) };
  return smoothedColor({ ...layers, color }, SMOOTHING_LEVELS, source).data;
}

// DAT-3, DAT-10: an image as its shape and its numbers in C order.
export function featureImage(layers, names, scales) {
  checkFeatures(names);
  checkScales(scales);
  const sources = names.map((name) => FEATURES[name]);
  const { height, width } = frameSize(layers, sources.flatMap(layersOf));
  const numbers = sources.map((source) => numbersOf(layers, source, scales));
  const data = [];
  for (let pixel = 0; pixel < height * width; pixel++) {
    for (const [index, { channels, encode }] of sources.entries()) {
      for (let channel = 0; channel < channels; channel++) {
        const x = numbers[index][pixel * channels + channel];
        data.push(Math.fround(encode(Number.isNaN(x) ? 0 : x, scales, channel)));
      }
    }
  }
  return { shape: [height, width, channelsOf(names)], data };
}

// DAT-4 to DAT-6
export function windowAt(image, size, border, x, y) {
  const [height, width, channels] = image.shape;
  const before = Math.floor(size / 2);
  const taps = [];
  for (let dy = 0; dy < size; dy++) {
    for (let dx = 0; dx < size; dx++) {
      const row = y + dy - before;
      const column = x + dx - before;
      const isInside = row >= 0 && row < height && column >= 0 && column < width;
      const pixel = clip(row, 0, height - 1) * width + clip(column, 0, width - 1);
      for (let channel = 0; channel < channels; channel++) {
        taps.push(isInside || border === "clamp" ? image.data[pixel * channels + channel] : 0);
      }
    }
  }
  return taps;
}

// DAT-8: pixels of frames of these heights and widths.
export function drawPixels(seed, stream, count, shapes) {
  const sizes = shapes.map(([height, width]) => height * width);
  const total = sizes.reduce((all, size) => all + size, 0);
  const draws = { frame: [], y: [], x: [] };
  for (let i = 0; i < count; i++) {
    const word = randomBlock(seed, Math.floor(i / 4), stream, PIXEL_TAG)[i % 4];
    // BigInt, because the product may have more than 53 bits.
    let pixel = Number((BigInt(word) * BigInt(total)) >> 32n);
    let frame = 0;
    while (pixel >= sizes[frame]) pixel -= sizes[frame++];
    const width = shapes[frame][1];
    draws.frame.push(frame);
    draws.y.push(Math.floor(pixel / width));
    draws.x.push(pixel % width);
  }
  return draws;
}
