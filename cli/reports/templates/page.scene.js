// The scene's numbers: which of them are uniforms of the path kernel, and what they are now.
//
// A kernel has every number of the scene as a constant but those that may move. Of these, what follows time
// stands in a table, one row for each moment; camera and lights are computed here as the reference does
// (refimpl/light/camera.py, refimpl/light/transport.py): in 64 bits, rounded to 32 once.

const radians = (degrees) => (degrees * Math.PI) / 180;
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

function normalize(a) {
  const length = Math.sqrt(dot(a, a));
  return a.map((x) => x / length);
}

/** Return bytes from base64. */
function decodeBase64(text) {
  return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
}

/** Return floats from base64; the numbers are little-endian, as all machines with browsers are. */
function decodeFloats(text) {
  return new Float32Array(decodeBase64(text).buffer);
}

/** The camera's axes, as refimpl/light/camera.py: camera_basis. */
function cameraBasis(camera) {
  const forward = normalize(camera.look_at.map((x, i) => x - camera.position[i]));
  const right = normalize(cross(forward, camera.up));
  return { position: camera.position, right, up: cross(right, forward), forward };
}

/** The scene's camera turned around what it looks at; at rest it is the scene's own, to the bit. */
function orbit(camera, turn) {
  if (turn.yaw === 0 && turn.pitch === 0 && turn.distance === 1) {
    return camera;
  }
  const away = camera.position.map((x, i) => x - camera.look_at[i]);
  const radius = Math.sqrt(dot(away, away)) * turn.distance;
  const yaw = Math.atan2(away[0], away[2]) + radians(turn.yaw);
  const start = Math.atan2(away[1], Math.hypot(away[0], away[2]));
  const steepest = radians(85); // straight from above, `up` would be no direction
  const pitch = Math.max(-steepest, Math.min(steepest, start + radians(turn.pitch)));
  const offset = [
    Math.sin(yaw) * Math.cos(pitch),
    Math.sin(pitch),
    Math.cos(yaw) * Math.cos(pitch),
  ];
  return { ...camera, position: camera.look_at.map((x, i) => x + radius * offset[i]) };
}

/** Radiance of the lights, and the tables by which one is picked, as refimpl/light/transport.py: _build_lights. */
function lightTables(lights, colors, share) {
  const radiance = lights.flatMap((light, i) =>
    colors[i].map((c) => (light.power * c) / (Math.PI * light.area)),
  );
  const weights = lights.map((light, i) => light.power * (colors[i][0] + colors[i][1] + colors[i][2]));
  const total = weights.reduce((sum, weight) => sum + weight, 0);
  let sum = 0;
  const cumulative = weights.map((weight) => Math.fround((sum += weight) / total));
  cumulative[cumulative.length - 1] = 1;
  const probability = cumulative.map((end, i) => {
    return Math.fround(share * Math.fround(end - (i ? cumulative[i - 1] : 0)));
  });
  return { radiance, cumulative, probability };
}

/** Return the uniforms of the path kernel: a row of the table, then camera and lights in their places. */
function sceneNumbers(data, frame, camera, colors) {
  const { names, still, moving, rows } = data.numbers;
  const values = Float32Array.from(still);
  moving.forEach((place, i) => (values[place] = rows[frame * moving.length + i]));
  const tables = { camera: cameraBasis(camera) };
  if (data.lights.length) {
    tables["world.lights"] = lightTables(data.lights, colors, data.share);
  }
  names.forEach(([path, index], place) => {
    const dotted = path.lastIndexOf(".");
    const table = tables[path.slice(0, dotted)];
    if (table) {
      values[place] = table[path.slice(dotted + 1)][index];
    }
  });
  const padded = new Float32Array(4 * Math.max(1, Math.ceil(values.length / 4)));
  padded.set(values);
  return padded;
}

/** A colour's hue and saturation with the mean of a lamp's own channels, as refimpl/light/variation.py. */
function asBright(color, own) {
  const sum = (channels) => channels.reduce((total, channel) => total + channel, 0);
  // A black lamp has no hue: a trace of light makes it grey.
  const lit = color.map((channel) => Math.max(channel, 1e-3));
  return lit.map((channel) => (channel * sum(own)) / sum(lit));
}

const mean = (color) => color.reduce((sum, channel) => sum + channel, 0) / color.length;

/** Hue and saturation (HSV of linear RGB, each in [0, 1]) of a colour; grey has the hue 0. */
function hueAndSaturation(color) {
  const most = Math.max(...color);
  const span = most - Math.min(...color);
  if (span === 0) {
    return { hue: 0, saturation: 0 };
  }
  const at = color.indexOf(most);
  const sixths = (2 * at + (color[(at + 1) % 3] - color[(at + 2) % 3]) / span + 6) % 6;
  return { hue: sixths / 6, saturation: span / most };
}

/** A colour with a hue and a saturation, `power` times as bright as `own`, as refimpl/light/variation.py: lamp_color. */
function lampColor(own, { hue, saturation, power = 1 }) {
  const pure = [5, 3, 1].map((n) => {
    const k = (n + 6 * hue) % 6;
    return 1 - saturation * Math.max(0, Math.min(k, 4 - k, 1));
  });
  const factor = (power * mean(own)) / mean(pure);
  return pure.map((channel) => channel * factor);
}

/** What a lamp of this colour is, beside its own: hue, saturation, and power as a factor. */
function lampOf(color, own) {
  return { ...hueAndSaturation(color), power: mean(color) / mean(own) };
}

const BRIGHTNESS_TOLERANCE = 0.02; // both by rounding to eight bits, as refimpl/light/variation.py
const SATURATION_TOLERANCE = 0.005;

/**
 * What of a picture a network has not learned, as refimpl/light/variation.py: outside. Each with its subject and the
 * range; `all`: what could be said, for the longest sentence.
 */
function outside(ranges, turnSeconds, { time, turn, colors }, lights, all = false) {
  const found = [];
  const number = (x, digits) => String(Number(x.toFixed(digits)));
  const check = (subject, text, value, [low, high], show, slack = 0) => {
    if (all || value < low - slack || value > high + slack) {
      found.push({ subject, text, range: `${show(low)} to ${show(high)}` });
    }
  };
  const [start, end] = ranges.time_s;
  if (end - start < turnSeconds) {
    const passed = (((time - start) % turnSeconds) + turnSeconds) % turnSeconds;
    check("the time is", "another", start + passed, [start, end], (x) => `${number(x, 2)} s`);
  }
  const degrees = (x) => `${number(x, 1)}°`;
  check("the camera is", `${degrees(turn.yaw)} to the side`, turn.yaw, ranges.yaw_deg, degrees);
  const height = (x) => (x < 0 ? `${degrees(-x)} down` : `${degrees(x)} up`);
  check("the camera is", height(turn.pitch), turn.pitch, ranges.pitch_deg, height);
  const factor = (x) => number(x, 2);
  const away = `${factor(turn.distance)} times as far away`;
  check("the camera is", away, turn.distance, ranges.distance, factor);
  colors.forEach((color, i) => {
    const subject = `light ${i + 1} is`;
    const own = lights[i].color;
    const power = mean(color) / mean(own);
    const scale = ranges.power ? power : 1;
    const isOwn = color.every((channel, k) => Math.abs(channel - scale * own[k]) <= 1e-6 * Math.max(channel, scale * own[k]));
    if (isOwn && !ranges.power) {
      return;
    }
    if (!isOwn && !ranges.saturation) {
      found.push({ subject, text: "of another colour", range: "its own" });
      return;
    }
    if (!isOwn) {
      const { saturation } = hueAndSaturation(color);
      const percent = (x) => `${Math.round(100 * x)} %`;
      check(subject, `${percent(saturation)} saturated`, saturation, ranges.saturation, percent, SATURATION_TOLERANCE);
    }
    const [low, high] = ranges.power || [1, 1];
    if (all || power < low * (1 - BRIGHTNESS_TOLERANCE) || power > high * (1 + BRIGHTNESS_TOLERANCE)) {
      const range = ranges.power ? `${factor(low)} to ${factor(high)}` : "its own power";
      found.push({ subject, text: `${factor(power)} times as bright as its own`, range });
    }
  });
  return found;
}

/** One sentence of what is outside; nothing for nothing. */
function outsideSentence(found) {
  const parts = found.map(({ subject, text, range }, i) => {
    const same = i > 0 && found[i - 1].subject === subject;
    return `${same ? "" : `${subject} `}${text} (${i ? "" : "learned: "}${range})`;
  });
  return parts.length
    ? `Outside of what the network has learned: ${parts.join(", ")}. Expect errors.`
    : "";
}

/** What a network that has learned from features of more rays than the page traces makes of them. */
function raysSentence(rays, traced) {
  return rays > traced
    ? `This network has learned from features of ${rays} rays per pixel, and the page traces ${traced}: edges are rougher here.`
    : "";
}

/** sRGB's curve (IEC 61966-2-1), for colours that are chosen as one sees them. */
function linearFromHex(hex) {
  return [1, 3, 5].map((start) => {
    const s = parseInt(hex.slice(start, start + 2), 16) / 255;
    return s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
  });
}

function hexFromLinear(color) {
  const digits = color.map((c) => {
    const s = c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055;
    return Math.round(255 * Math.max(0, Math.min(1, s))).toString(16).padStart(2, "0");
  });
  return `#${digits.join("")}`;
}
