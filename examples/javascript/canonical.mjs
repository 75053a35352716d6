// The canonical text of a scene and its digest (SCN-6, SCN-8, SCN-10).

import { createHash } from "node:crypto";
import { FIELDS } from "./scene.mjs";

const SHORT_ESCAPES = { '"': '\\"', "\\": "\\\\", "\b": "\\b", "\t": "\\t", "\n": "\\n", "\f": "\\f", "\r": "\\r" };

// SCN-8
export function sceneDigest(scene) {
  return createHash("sha256").update(oneLine(canonicalEntries(scene))).digest("hex");
}

// SCN-6: what the digest is of, as [key, value] pairs in their order.
function canonicalEntries(scene) {
  const entries = [
    ["name", scene.name],
    ["camera", shape(scene.camera, FIELDS.camera)],
    ["room", scene.room && shape(scene.room, FIELDS.room)],
    ["boxes", scene.boxes.map((box) => shape(box, FIELDS.box))],
    ["spheres", scene.spheres.map((sphere) => shape(sphere, FIELDS.sphere))],
    ["quads", scene.quads.map((quad) => shape(quad, FIELDS.quad))],
    ["lights", scene.lights.map((light) => shape(light, FIELDS.light))],
    ["background", scene.background],
  ];
  if (scene.environment) entries.push(["environment", shape(scene.environment, FIELDS.sky)]);
  return new Map(entries);
}

function shape(record, fields) {
  const entries = new Map();
  for (const key of Object.keys(fields)) {
    if (key === "material") {
      if (record.material) entries.set(key, material(record.material));
    } else if (key === "materials") {
      if (record.materials.length > 0) entries.set(key, record.materials.map((entry) => entry && material(entry)));
    } else {
      entries.set(key, record[key]);
    }
  }
  return entries;
}

const material = (entry) => new Map(Object.entries(entry));

// SCN-8
function oneLine(value) {
  if (value === null) return "null";
  if (typeof value === "string") return textLiteral(value);
  if (typeof value === "number") return numberLiteral(value);
  if (Array.isArray(value)) return `[${value.map(oneLine).join(", ")}]`;
  return `{${[...value].map(([key, entry]) => `${textLiteral(key)}: ${oneLine(entry)}`).join(", ")}}`;
}

// SCN-10: JavaScript finds the fewest digits, but writes them in another form.
function numberLiteral(x) {
  const sign = x < 0 || Object.is(x, -0) ? "-" : "";
  const [mantissa, exponentText] = Math.abs(x).toExponential().split("e");
  const digits = mantissa.replace(".", "");
  const exponent = Number(exponentText);
  if (exponent < -4 || exponent >= 16) {
    const power = String(Math.abs(exponent)).padStart(2, "0");
    return `${sign}${mantissa}e${exponent < 0 ? "-" : "+"}${power}`;
  }
  if (exponent < 0) return `${sign}0.${"0".repeat(-exponent - 1)}${digits}`;
  const whole = digits.slice(0, exponent + 1).padEnd(exponent + 1, "0");
  return `${sign}${whole}.${digits.slice(exponent + 1) || "0"}`;
}

// SCN-10
function textLiteral(text) {
  let literal = "";
  for (let i = 0; i < text.length; i++) {
    const character = text[i];
    if (Object.hasOwn(SHORT_ESCAPES, character)) literal += SHORT_ESCAPES[character];
    else if (character >= " " && character <= "~") literal += character;
    else literal += `\\u${text.charCodeAt(i).toString(16).padStart(4, "0")}`;
  }
  return `"${literal}"`;
}
