// Model files: safetensors containers of a network and of what it sees (MOD-1 to MOD-6).

import { createHash } from "node:crypto";
import { channelsOf, checkFeatures, checkScales, checkWindow } from "./dataset.mjs";
import { parseJson } from "./json.mjs";
import { ACTIVATION_NAMES, checkOmega } from "./network.mjs";
import { count, list, number, record, required, text } from "./records.mjs";
import { require, Refusal } from "./refusal.mjs";

const LARGEST_FILE_BYTES = 256 * 2 ** 20;
const LARGEST_PARAMETER = 1e12;
// Version 3, of models of integers, is left out: no kind of vectors asks for its facts.
const VERSIONS = ["1", "2"];
const WEIGHT_SUFFIX = ".weight";
const JSON_NUMBER = /^-?(?:0|[1-9][0-9]*)(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?$/;

// How the numbers of a tensor are read, and their size in bytes.
const TYPES = {
  F64: { bytes: 8, read: (data, at) => data.readDoubleLE(at) },
  F32: { bytes: 4, read: (data, at) => data.readFloatLE(at) },
};
// Tensors of other types may be in a file, and are not read.
const OTHER_TYPES = { I64: 8, U64: 8, I32: 4, U32: 4, F16: 2, BF16: 2, I16: 2, U16: 2, I8: 1, U8: 1, F8_E5M2: 1, F8_E4M3: 1, BOOL: 1 };

const readTensor = record({
  dtype: required(text),
  shape: required(list(count)),
  data_offsets: required(list(count, 2)),
});
const readWindow = record({ size: required(count), border: required(text) });
const readScales = record({
  exposure_stops: required(number),
  depth_scale: required(number),
  position_center: required(list(number, 3)),
  position_scale: required(number),
});

// MOD-6: the container's tensors by name, its texts, and its bytes after the header.
function readContainer(bytes) {
  require(bytes.length <= LARGEST_FILE_BYTES, "a model must have at most 256 MiB");
  require(bytes.length >= 8, "a model must begin with the length of its header");
  const length = bytes.readBigUInt64LE(0);
  require(length <= BigInt(bytes.length - 8), "the header must be inside of the file");
  const end = 8 + Number(length);
  const headerText = decodeUtf8(bytes.subarray(8, end));
  require(headerText.startsWith("{"), "the header must begin with {");
  const header = parseJson(headerText);
  require(header instanceof Map, "the header must be an object");
  const data = bytes.subarray(end);
  const tensors = new Map();
  const texts = new Map();
  for (const [name, entry] of header) {
    if (name !== "__metadata__") {
      tensors.set(name, readTensor(entry, name));
      continue;
    }
    require(entry instanceof Map, "__metadata__: must be an object");
    for (const [key, value] of entry) texts.set(key, text(value, key));
  }
  checkPlaces(tensors, data.length);
  return { tensors, texts, data };
}

function decodeUtf8(bytes) {
  try {
    return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(bytes);
  } catch {
    throw new Refusal("the header must be UTF-8");
  }
}

// Tensors fill the bytes after the header, without overlaps and gaps.
function checkPlaces(tensors, size) {
  const [beginOf, endOf] = [(tensor) => tensor.data_offsets[0], (tensor) => tensor.data_offsets[1]];
  const sorted = [...tensors].sort(([, a], [, b]) => beginOf(a) - beginOf(b) || endOf(a) - endOf(b));
  let at = 0;
  for (const [name, tensor] of sorted) {
    const { dtype, shape } = tensor;
    const [begin, end] = tensor.data_offsets;
    const itemBytes = TYPES[dtype]?.bytes ?? OTHER_TYPES[dtype];
    require(itemBytes !== undefined, `${name}: unknown type ${dtype}`);
    require(shape.every((side) => side >= 0), `${name}: a side must not be negative`);
    const needed = shape.reduce((product, side) => product * side, itemBytes);
    require(begin === at && end - begin === needed, `${name}: must follow the tensor before, with all of its numbers`);
    at = end;
  }
  require(at === size, "nothing may follow the tensors");
}

// A tensor of this number of axes: its rows of numbers, or its numbers.
function tensorOf(container, name, axes) {
  const tensor = container.tensors.get(name);
  require(tensor !== undefined, `${name}: missing`);
  const { dtype, shape } = tensor;
  require(Object.hasOwn(TYPES, dtype), `${name}: must be of type ${Object.keys(TYPES).join(" or ")}`);
  require(shape.length === axes && shape.every((side) => side > 0), `${name}: must have ${axes} axes, none empty`);
  const { bytes, read } = TYPES[dtype];
  const size = shape.reduce((product, side) => product * side, 1);
  const numbers = Array.from({ length: size }, (_, i) => read(container.data, tensor.data_offsets[0] + i * bytes));
  if (axes === 1) return { dtype, values: numbers };
  const [rows, columns] = shape;
  const values = Array.from({ length: rows }, (_, row) => numbers.slice(row * columns, (row + 1) * columns));
  return { dtype, values };
}

function textOf(container, name) {
  require(container.texts.has(name), `${name}: missing`);
  return container.texts.get(name);
}

// MOD-2: a decimal is a number of JSON, without spaces.
function decimalOf(container, name) {
  const decimal = textOf(container, name);
  require(JSON_NUMBER.test(decimal), `${name}: must be a number of JSON`);
  return parseJson(decimal).value;
}

// MOD-2, MOD-6
export function readModel(bytes) {
  const container = readContainer(bytes);
  require(textOf(container, "format") === "wamnet-model", "format: must be wamnet-model");
  const version = textOf(container, "version");
  require(VERSIONS.includes(version), `version ${version}: must be one of ${VERSIONS}`);
  const features = list(text)(parseJson(textOf(container, "features")), "features");
  checkFeatures(features);
  const window = readWindow(parseJson(textOf(container, "window")), "window");
  checkWindow(window.size, window.border);
  const normalization = readScales(parseJson(textOf(container, "normalization")), "normalization");
  checkScales(normalization);
  const network = readNetwork(container, version);
  checkShape(network.layers, window.size ** 2 * channelsOf(features));
  return { network, features, window, normalization };
}

// MOD-6: the layers are counted by the tensors that have the name of a weight.
function layerCount(container) {
  const names = [...container.tensors.keys()].filter((name) => name.endsWith(WEIGHT_SUFFIX));
  require(names.length > 0, "a model must have a layer");
  return names.length;
}

function readNetwork(container, version) {
  const activation = version === "2" ? textOf(container, "activation") : (container.texts.get("activation") ?? "sine");
  require(ACTIVATION_NAMES.includes(activation), `activation ${activation}: must be one of ${ACTIVATION_NAMES}`);
  require(version === "2" || activation === "sine", "activation: version 1 has the sine only");
  const omegaFirst = decimalOf(container, "omega_0_first");
  const omegaHidden = decimalOf(container, "omega_0_hidden");
  checkOmega(omegaFirst, "omega_0_first");
  checkOmega(omegaHidden, "omega_0_hidden");
  const types = new Set();
  const layers = Array.from({ length: layerCount(container) }, (_, l) => {
    const weight = tensorOf(container, `layer${l}.weight`, 2);
    const bias = tensorOf(container, `layer${l}.bias`, 1);
    types.add(weight.dtype).add(bias.dtype);
    const parameters = [...weight.values.flat(), ...bias.values];
    const bounded = parameters.every((parameter) => Math.abs(parameter) <= LARGEST_PARAMETER);
    require(bounded, `layer${l}: parameters must be finite and at most 1e12 in magnitude`);
    return { weight: weight.values, bias: bias.values };
  });
  require(types.size === 1, "all parameters must be of one type");
  return { layers, omegaFirst, omegaHidden, activation };
}

// SIR-1, DEN-1
function checkShape(layers, inputs) {
  let expected = inputs;
  layers.forEach(({ weight, bias }, l) => {
    require(weight[0].length === expected, `layer${l}.weight: must have ${expected} inputs`);
    require(bias.length === weight.length, `layer${l}.bias: must have a number for each output`);
    expected = weight.length;
  });
  require(expected === 3, "the last layer must have 3 outputs");
}

// The parameters' digest: layer by layer, weights, then biases, as float64.
export function parametersDigest(network) {
  const parameters = network.layers.flatMap(({ weight, bias }) => [...weight.flat(), ...bias]);
  return createHash("sha256").update(Buffer.from(Float64Array.from(parameters).buffer)).digest("hex");
}

export function widthsOf(network) {
  return [network.layers[0].weight[0].length, ...network.layers.map(({ bias }) => bias.length)];
}
