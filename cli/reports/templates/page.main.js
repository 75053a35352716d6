// The page: controls, keys and pointer, what is said to people, and the loop.

const SIZES = [64, 96, 128, 192, 256, 384, 512, 768, 1024];
const AUTO_START = 128; // every device gets this far in a moment
const AUTO_LARGEST = 512;
const AUTO_QUICK_MS = 20; // a larger picture is tried below this
const AUTO_SLOW_MS = 400; // a smaller one above this
const AUTO_FRAMES = 4; // frames before either is believed
const SLOW_MS = 60; // a device that needs more for a frame
const VERY_SLOW_MS = 1500; // a picture that takes longer is no animation
const REST_MS = 100; // is left this long, at most, to the rest of the page before the next one
const GRAB_PX = 18; // how near to the line a pointer takes hold of it
const DEGREES_PER_PX = 0.4;
const LABELS = {
  color: "1 sample per pixel",
  normal: "Normals",
  picture: "Denoised",
  reference: "Reference",
  difference: "Difference × 4",
};
const COMPARED = ["reference", "difference"]; // pictures that there are only while comparing
const MEASURE_MS = 400; // between two measurements of the distance from the reference
const TELL_MS = 250; // what is outside is said at most that often: a slider moves in many steps
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
const FREE = { yaw: [-180, 180], pitch: [-75, 75], distance: [0.4, 2], saturation: [0, 1], power: [0.25, 4] };
const LAMP = { hue: "Hue", saturation: "Saturation", power: "Power" }; // controls of a light
const REST = { yaw: 0, pitch: 0, distance: 1 };

const find = (id) => document.getElementById(id);

class Page {
  constructor(data) {
    this.data = data;
    data.numbers.rows = decodeFloats(data.numbers.rows);
    for (const one of data.variants) {
      if (typeof one.check === "string") {
        one.check = data.variants.find((other) => other.name === one.check).check; // another schedule of it
      }
    }
    this.state = {
      playing: data.times.length > 1 && !matchMedia("(prefers-reduced-motion: reduce)").matches,
      clock: 0,
      turn: { ...REST },
      colors: data.lights.map((light) => light.color),
      beyond: false, // of what the network has learned
      size: "auto",
      variant: data.variants[0].name,
      left: "color",
      right: "picture",
      wipe: 0.5,
      seed: 0,
      comparing: false,
      samples: COUNTS[1],
    };
    this.lamps = data.lights.map((light) => lampOf(light.color, light.color));
    this.auto = { size: AUTO_START, frames: 0, limit: AUTO_LARGEST };
    this.dirty = true;
    this.held = false; // a test draws; the loop leaves pictures alone
    this.times = [];
    this.checks = new Map();
    this.drawn = new Promise((done, failed) => Object.assign(this, { firstDrawn: done, firstFailed: failed }));
    this.drawn.catch(() => {}); // it has been told
  }

  // ---- starting ---------------------------------------------------------------------------------------

  async start() {
    this.fill();
    this.listen();
    this.poster();
    const canvas = find("picture");
    try {
      this.device = new Device(canvas, this.leastBuffers());
      this.renderer = new Renderer(this.device, this.data);
      this.reference = new Reference(this.renderer);
    } catch (error) {
      this.trouble(error);
      throw error;
    }
    canvas.addEventListener("webglcontextlost", (event) => this.lost(event));
    canvas.addEventListener("webglcontextrestored", () => this.restored());
    find("device").textContent = this.device.name;
    if (SOFTWARE.test(this.device.name) && this.data.variants.length > 1) {
      // As a shader the whole network takes a processor seconds.
      const { variants } = this.data;
      this.state.variant = (variants.find(({ passes }) => passes[0].module) || variants[1]).name;
    }
    find("variant").value = this.state.variant;
    requestAnimationFrame((now) => this.loop(now));
    await this.choose(this.state.variant);
    await this.drawn;
  }

  /** Textures that some pass draws into at once. */
  leastBuffers() {
    const { paths, encoders, variants } = this.data;
    const textures = paths.map((path) => Math.ceil(path.planes.length / 4));
    const counts = [...textures, ...encoders.map((e) => e.images.length)];
    return Math.max(...counts, ...variants.flatMap((v) => v.passes.map((pass) => pass.buffers)));
  }

  /** Compile what a variant needs, and check it; the picture before stays until it is ready. */
  async choose(name) {
    this.preparing = name;
    try {
      await this.prepare(name);
      this.state.variant = name;
      this.auto.frames = 0;
      this.dirty = true;
      if (!this.checks.has(name)) {
        this.say("Checking the network on this device.");
        this.checks.set(name, await this.renderer.check(name));
      }
      this.preparing = null;
      this.tellVariant();
      this.announced = 0; // it is ready when it has drawn: on a slow device that takes seconds
      this.dirty = true;
      this.say("Drawing the first picture.");
    } catch (error) {
      if (!(error instanceof Lost)) {
        this.trouble(error);
        throw error;
      }
    }
  }

  async prepare(name) {
    if (this.renderer.variant(name).ready) {
      return;
    }
    this.say("Compiling shaders. The page stays usable meanwhile.");
    await this.renderer.prepare(name, (done, all) => this.progress(done, all));
    this.progress(1, 1);
  }

  /** The context is lost: a driver was reset, or gave up on a shader. */
  lost(event) {
    event.preventDefault();
    this.renderer.strips.drop();
    this.renderer.ready = false;
    this.progress(1, 1);
    const { variants } = this.data;
    const facts = variants.find((one) => one.name === this.preparing);
    if (facts && facts.schedule === "inlined") {
      // A shader with all weights in its text may be too much to compile: take a short one.
      this.state.variant = variants.find((one) => one.schedule !== "inlined" && one.rank === facts.rank).name;
      find("variant").value = this.state.variant;
    }
    this.say("The graphics device was lost. If it does not come back in a moment, load the page again.");
  }

  restored() {
    this.device.setUp(this.leastBuffers());
    this.renderer.build();
    this.reference = new Reference(this.renderer);
    this.checks.clear();
    return this.choose(this.state.variant);
  }

  /** Show in plain words what keeps the page from working. */
  trouble(error) {
    find("trouble-what").textContent =
      error instanceof Missing ? error.message : `A shader was refused by this device: ${error.message}`;
    find("trouble").hidden = false;
    find("stage").hidden = true;
    find("controls").hidden = true;
    this.say("The page cannot run here.");
    this.progress(1, 1);
  }

  // ---- the loop ---------------------------------------------------------------------------------------

  loop(now) {
    requestAnimationFrame((next) => this.loop(next));
    const passed = Math.min(now - (this.before || now), 250) / 1000; // a hidden page does not leap ahead
    this.before = now;
    const { state, renderer } = this;
    if (!renderer.ready || this.device.gl.isContextLost()) {
      return;
    }
    if (state.playing && !this.held) {
      const { times } = this.data;
      state.clock = (state.clock + passed) % this.duration();
      this.tellTime();
      this.dirty = this.dirty || times.length > 1;
    }
    renderer.strips.tick(now);
    const rested = performance.now() >= (this.restUntil || 0);
    if (this.dirty && rested && !this.held && !this.reference.adding && !renderer.strips.busy && renderer.variant(state.variant).ready) {
      this.dirty = false;
      this.drawNext();
      renderer.strips.tick(now);
    } else if (this.isAdding() && rested && !this.held && !renderer.strips.busy) {
      this.addNext();
      renderer.strips.tick(now);
    }
  }

  // ---- the reference ----------------------------------------------------------------------------------

  /** Start or end the comparison with a reference of this moment. */
  compare(comparing) {
    const { state } = this;
    if (comparing === state.comparing) {
      return;
    }
    if (comparing && state.playing) {
      this.play(false);
    }
    const sides = comparing ? { left: "picture", right: "reference" } : this.sidesBefore;
    this.sidesBefore = { left: state.left, right: state.right };
    this.compared = null;
    this.change({ comparing, ...sides });
    find("left").value = sides.left;
    find("right").value = sides.right;
    for (const name of COMPARED) {
      document.querySelectorAll(`option[value=${name}]`).forEach((one) => (one.disabled = !comparing));
    }
    find("compare").textContent = comparing ? "End the comparison" : "Compare with the reference";
    find("compared").hidden = !comparing;
    this.tellWipe();
    this.tellCompared();
    if (comparing) {
      this.say(`Rendering a reference of ${state.samples} samples per pixel.`);
    }
  }

  isAdding() {
    const { state, reference, moment } = this;
    if (!state.comparing || !moment || this.preparing || reference.adding) {
      return false;
    }
    if (!reference.isOf(moment)) {
      reference.start(moment);
      this.compared = null;
    }
    return reference.count < state.samples;
  }

  async addNext() {
    const { reference, state } = this;
    try {
      await reference.add(state.samples);
    } catch (error) {
      if (!(error instanceof Lost)) {
        this.trouble(error);
        throw error;
      }
      return;
    }
    if (!state.comparing) {
      return;
    }
    this.show();
    const now = performance.now();
    const done = reference.count >= state.samples;
    if (done || !this.compared || now - this.comparedAt > MEASURE_MS) {
      this.comparedAt = now;
      this.compared = reference.measure();
    }
    this.tellCompared();
    if (done) {
      const { noisy, denoised } = this.compared;
      const told = `${noisy.toFixed(1)} dB, the denoised one ${denoised.toFixed(1)} dB`;
      this.say(`The reference has ${reference.count} samples per pixel: the noisy picture has ${told}.`);
    }
  }

  tellCompared() {
    const { compared, reference, state } = this;
    const count = compared ? reference.count : 0;
    find("counted").textContent = `${count} of ${state.samples} samples`;
    find("counting").max = state.samples;
    find("counting").value = count;
    for (const name of ["noisy", "denoised"]) {
      find(`${name}-psnr`).textContent = compared ? `${compared[name].toFixed(1)} dB` : "-";
    }
    find("denoised-rms").textContent = compared ? compared.rms.toFixed(4) : "-";
  }

  async drawNext() {
    const { state } = this;
    state.seed = state.playing ? (state.seed + 1) >>> 0 : state.seed;
    const size = state.size === "auto" ? this.auto.size : state.size;
    try {
      const request = this.request(size);
      const ms = await this.renderer.draw(request);
      this.moment = request;
      this.compared = null; // the reference may be the same, the picture is another
      this.restUntil = performance.now() + (ms > SLOW_MS ? Math.min(REST_MS, ms / 4) : 0);
      this.measured(size, ms);
      this.show();
      find("poster").hidden = true;
      this.firstDrawn();
      this.announce(ms);
    } catch (error) {
      if (!(error instanceof Lost)) {
        this.trouble(error);
        this.firstFailed(error);
        throw error;
      }
    }
  }

  /** Say once that a network is ready, and with its second picture how slow it is where that is seen: the first
   * one has waited for the driver's compiler too. */
  announce(ms) {
    if (this.preparing || this.announced > 1) {
      return;
    }
    if (++this.announced === 1) {
      this.say(`Ready. The animation is ${this.state.playing ? "playing" : "paused"}.`);
    } else if (ms > VERY_SLOW_MS) {
      this.say(`A picture takes ${(ms / 1000).toFixed(0)} s here.`);
    }
  }

  request(size) {
    const { state, data } = this;
    const camera = orbit(data.camera, state.turn);
    const { colors, seed, variant } = state;
    return { size, frame: this.frame(), seed, camera, colors, variant };
  }

  duration() {
    const { times } = this.data;
    return times.length > 1 ? (times[1] - times[0]) * times.length : 1;
  }

  frame() {
    const { times } = this.data;
    return Math.floor((this.state.clock / this.duration()) * times.length) % times.length;
  }

  /** Keep frames/s, and fit the size to the device. */
  measured(size, ms) {
    const now = performance.now();
    this.times = [...this.times.filter((one) => now - one.at < 1000), { at: now, ms }];
    if (now - (this.toldAt || 0) > 400 || this.times.length === 1) {
      this.toldAt = now;
      const mean = this.times.reduce((sum, one) => sum + one.ms, 0) / this.times.length;
      const span = now - this.times[0].at;
      const rate = this.times.length > 1 ? (1000 * (this.times.length - 1)) / span : 1000 / Math.max(ms, 1);
      find("rate").textContent = this.state.playing ? rate.toFixed(rate < 10 ? 1 : 0) : "paused";
      find("milliseconds").textContent = `${mean.toFixed(0)} ms`;
      find("pixels").textContent = `${size} × ${size}`;
    }
    const { auto } = this;
    if (this.state.comparing || this.state.size !== "auto" || ++auto.frames < AUTO_FRAMES) {
      return;
    }
    const place = SIZES.indexOf(size);
    if (ms > AUTO_SLOW_MS && place > 0) {
      auto.limit = auto.size = SIZES[place - 1];
      auto.frames = 0;
    } else if (ms < AUTO_QUICK_MS && size < auto.limit) {
      auto.size = SIZES[place + 1];
      auto.frames = 0;
    }
  }

  show() {
    const { left, right, wipe } = this.state;
    const { image } = this.reference;
    const clean = this.state.comparing && this.reference.size === this.renderer.size ? image : null;
    this.renderer.show(left, right, wipe, clean);
    if (clean && !this.compared && !this.renderer.strips.busy) {
      this.compared = this.reference.measure(); // after another network was chosen
      this.tellCompared();
    }
  }

  // ---- what is said -----------------------------------------------------------------------------------

  say(text) {
    find("status").textContent = find("poster-text").textContent = text;
  }

  /** Until a picture is drawn, show the reference's small one, which the page carries for its check. */
  poster() {
    const { check, variants } = this.data;
    const canvas = find("poster-picture");
    canvas.width = canvas.height = check.size;
    const context = canvas.getContext("2d");
    const image = context.createImageData(check.size, check.size);
    image.data.fill(255);
    decodeFloats(variants[0].check.expected).forEach((value, i) => {
      image.data[4 * Math.floor(i / 3) + (i % 3)] = 255 * value; // rounded, and clamped
    });
    context.putImageData(image, 0, 0);
  }

  progress(done, all) {
    find("progress").hidden = done >= all;
    find("progress").max = all;
    find("progress").value = done;
    const bar = find("poster-progress");
    bar.max = all;
    if (done < all) {
      bar.value = done;
    } else {
      bar.removeAttribute("value"); // busy, for nobody knows how long
    }
    find("progress-text").textContent = done < all ? `shader ${done + 1} of ${all}` : "";
  }

  tellTime() {
    const time = this.data.times[this.frame()];
    const slider = find("time");
    slider.value = this.frame();
    slider.setAttribute("aria-valuetext", `${time.toFixed(2)} seconds`);
    find("time-value").textContent = `${time.toFixed(2)} s`;
    this.tellOutside();
  }

  tellTurn() {
    const { yaw, pitch, distance } = this.state.turn;
    const told = { yaw: `${yaw.toFixed(0)}°`, pitch: `${pitch.toFixed(0)}°`, distance: `× ${distance.toFixed(2)}` };
    const spoken = { yaw: `${yaw.toFixed(0)} degrees`, pitch: `${pitch.toFixed(0)} degrees` };
    for (const name of Object.keys(told)) {
      find(name).value = this.state.turn[name];
      find(`${name}-value`).textContent = told[name];
      find(name).setAttribute("aria-valuetext", spoken[name] || `${distance.toFixed(2)} times`);
    }
  }

  tellWipe() {
    const percent = Math.round(100 * this.state.wipe);
    find("line").style.left = `${100 * this.state.wipe}%`;
    find("wipe").value = percent;
    const [left, right] = [LABELS[this.state.left], LABELS[this.state.right]];
    find("wipe").setAttribute("aria-valuetext", `${percent} percent ${left}, the rest ${right}`);
    find("left-label").textContent = left;
    find("right-label").textContent = right;
    find("left-label").style.opacity = this.state.wipe > 0.04 ? 1 : 0;
    find("right-label").style.opacity = this.state.wipe < 0.96 ? 1 : 0;
  }

  /** Say what of the picture the network has not learned, soon. */
  tellOutside() {
    this.telling = this.telling || setTimeout(() => {
      this.telling = null;
      find("outside").textContent = this.outside(this.state.turn, this.state.colors);
    }, TELL_MS);
  }

  /** The sentence for a camera and colours at this time; empty inside, and where the network does not say. */
  outside(turn, colors, all = false) {
    const { data } = this;
    const { ranges } = this.facts();
    const moment = { time: data.times[this.frame()], turn, colors };
    return ranges ? outsideSentence(outside(ranges, data.turn_s, moment, data.lights, all)) : "";
  }

  /** Keep room for the longest sentence, so that nothing below it moves when it appears; inside there is none. */
  reserveOutside() {
    const pure = this.data.lights.map(({ color }) => lampColor(color, { hue: 0, saturation: 1, power: 0.25 }));
    const longest = this.outside({ yaw: -179, pitch: -75, distance: 0.45 }, pure, true);
    find("outside-room").textContent = this.state.beyond ? longest : "";
  }

  /** What camera and lights may be: what the network has learned, all there is beyond; null: nothing but its own. */
  limits() {
    const { ranges } = this.facts();
    if (!ranges || this.state.beyond) {
      return FREE;
    }
    const { yaw_deg: yaw, pitch_deg: pitch, distance, saturation, power } = ranges;
    return { yaw, pitch, distance, saturation, power };
  }

  facts() {
    return this.data.variants.find((one) => one.name === this.state.variant);
  }

  /** Give the controls the limits, say what was learned beside them, and bring camera and lights inside. */
  limit() {
    const limits = this.limits();
    const { ranges } = this.facts();
    const learned = ranges && { ...ranges, yaw: ranges.yaw_deg, pitch: ranges.pitch_deg };
    const set = (id, name) => {
      const pair = limits[name] || [0, 0];
      Object.assign(find(id), { min: pair[0], max: pair[1], disabled: pair[0] === pair[1] });
      find(`${id}-range`).textContent = learned && learned[name] ? rangeText(name, learned[name]) : "";
    };
    ["yaw", "pitch", "distance"].forEach((name) => set(name, name));
    this.data.lights.forEach((_, i) => {
      ["saturation", "power"].forEach((name) => {
        set(`light-${i}-${name}`, name);
        find(`light-${i}-${name}`).parentElement.hidden = !limits[name];
      });
      find(`light-${i}-hue`).parentElement.hidden = !limits.saturation;
      find(`light-${i}`).disabled = !limits.saturation;
    });
    find("beyond-row").hidden = !ranges;
    find("beyond").checked = this.state.beyond;
    this.turn(this.state.turn);
    this.data.lights.forEach((light, i) => {
      const isOwn = this.state.colors[i] === light.color;
      this.light(i, isOwn ? null : this.lamps[i]);
    });
    this.reserveOutside();
  }

  goBeyond(beyond) {
    this.state.beyond = beyond;
    this.limit();
  }

  /** Give a light a hue, a saturation and a power, inside of the limits; null: its own. */
  light(i, values) {
    const own = this.data.lights[i].color;
    const { saturation = null, power = null } = this.limits();
    const lamp = values ? { ...this.lamps[i], ...values } : lampOf(own, own);
    const at = lampOf(own, own);
    if (values) {
      lamp.saturation = saturation ? clamp(lamp.saturation, ...saturation) : at.saturation;
      lamp.hue = saturation ? lamp.hue : at.hue;
      lamp.power = power ? clamp(lamp.power, ...power) : 1;
    }
    this.lamps[i] = lamp;
    const color = values ? lampColor(own, lamp) : own;
    this.change({ colors: this.state.colors.map((old, k) => (k === i ? color : old)) });
    this.tellLight(i);
  }

  tellLight(i) {
    const { hue, saturation, power } = this.lamps[i];
    const color = this.state.colors[i];
    find(`light-${i}`).value = hexFromLinear(color.map((channel) => channel / Math.max(1, ...color)));
    const told = {
      hue: [360 * hue, `${Math.round(360 * hue)}°`],
      saturation: [saturation, `${Math.round(100 * saturation)} %`],
      power: [power, `× ${power.toFixed(2)}`],
    };
    for (const [name, [value, text]] of Object.entries(told)) {
      find(`light-${i}-${name}`).value = value;
      find(`light-${i}-${name}`).setAttribute("aria-valuetext", text);
      find(`light-${i}-${name}-value`).textContent = text;
    }
  }

  tellVariant() {
    const facts = this.facts();
    const check = this.checks.get(facts.name);
    const number = (x) => (x === 0 ? "0" : x.toExponential(1).replace("e-", "\u00a0·\u00a010⁻").replace(/⁻(\d+)$/, raised));
    find("variant").value = facts.name;
    find("products").textContent = facts.products.toLocaleString("en");
    find("bound").textContent = facts.bound === null ? "none" : number(facts.bound);
    find("first-difference").textContent =
      facts.name === this.data.variants[0].name ? "it is the full one" : `${(100 * facts.rms_to_first).toFixed(1)} %`;
    find("unknown-ranges").hidden = facts.ranges !== null;
    find("rays").textContent = raysSentence(facts.rays, this.data.rays);
    this.limit();
    this.tellOutside();
    if (check) {
      const held = check.bits ? check.bits.same : check.share <= 1;
      find("error").textContent = check.bits
        ? bitsSentence(check.bits)
        : `${number(check.error)}, ${held ? "within" : "NOT within"} ${number(check.bound)}`;
      find("error").classList.toggle("bad", !held);
      find("digest").textContent = check.bits ? check.bits.digest : "";
    }
    find("of-floats").hidden = facts.check.sha256 !== null;
    find("of-integers").hidden = facts.check.sha256 === null;
  }

  tellPlaying() {
    find("play").textContent = this.state.playing ? "Pause" : "Play";
  }

  // ---- controls ---------------------------------------------------------------------------------------

  /** Fill in what depends on the data. */
  fill() {
    const { data } = this;
    const option = (value, text) => new Option(text, value);
    for (const side of ["left", "right"]) {
      find(side).append(...Object.keys(LABELS).map((name) => option(name, LABELS[name])));
      COMPARED.forEach((name) => (find(side).querySelector(`[value=${name}]`).disabled = true));
      find(side).value = this.state[side];
    }
    find("size").append(
      option("auto", "as the device can"),
      ...SIZES.map((size) => option(size, `${size} × ${size}`)),
    );
    find("samples").append(...COUNTS.map((count) => option(count, `${count} samples per pixel`)));
    find("samples").value = this.state.samples;
    find("variant").append(...data.variants.map((one) => option(one.name, variantText(one))));
    find("time").max = data.times.length - 1;
    find("animation").hidden = data.times.length < 2;
    find("lights").hidden = data.lights.length === 0;
    data.lights.forEach((light, i) => find("light-list").append(this.lightRow(light, i)));
    this.tellTime();
    this.limit();
    this.tellWipe();
    this.tellPlaying();
  }

  /** The controls of a light: a colour to pick, and sliders. */
  lightRow(light, i) {
    const lamp = document.createElement("div");
    lamp.className = "lamp";
    const input = document.createElement("input");
    Object.assign(input, { type: "color", id: `light-${i}`, value: hexFromLinear(light.color) });
    input.addEventListener("input", () => {
      const isOwn = input.value === hexFromLinear(light.color);
      const picked = lampOf(asBright(linearFromHex(input.value), light.color), light.color);
      this.light(i, isOwn ? null : { ...picked, power: this.lamps[i].power });
    });
    lamp.append(row(`Light ${i + 1}`, input));
    for (const [name, label] of Object.entries(LAMP)) {
      const slider = document.createElement("input");
      const [id, step] = [`light-${i}-${name}`, name === "hue" ? 1 : 0.01];
      Object.assign(slider, { type: "range", id, min: 0, max: 360, step });
      slider.setAttribute("aria-label", `${label} of light ${i + 1}`);
      slider.setAttribute("aria-describedby", `${id}-range`);
      const unit = name === "hue" ? 360 : 1;
      slider.addEventListener("input", () => this.light(i, { [name]: Number(slider.value) / unit }));
      const line = row(label, slider);
      const [output, range] = [document.createElement("output"), document.createElement("small")];
      Object.assign(output, { id: `${id}-value`, htmlFor: id });
      range.id = `${id}-range`;
      if (name === "hue") {
        range.className = "hues";
      }
      line.append(output, range);
      lamp.append(line);
    }
    return lamp;
  }

  /** Take new values, and draw what they change. */
  change(values) {
    Object.assign(this.state, values);
    this.dirty = true;
    this.tellOutside();
  }

  turn(values) {
    const turn = { ...this.state.turn, ...values };
    const limits = this.limits();
    turn.yaw = ((((turn.yaw + 180) % 360) + 360) % 360) - 180;
    for (const name of Object.keys(REST)) {
      turn[name] = clamp(turn[name], ...limits[name]);
    }
    this.change({ turn });
    this.tellTurn();
  }

  play(playing) {
    if (playing) {
      this.compare(false);
    }
    this.change({ playing });
    this.tellPlaying();
    this.say(playing ? "The animation is playing." : "The animation is paused.");
    this.times = [];
  }

  step(frames) {
    const { times } = this.data;
    const frame = (this.frame() + frames + times.length) % times.length;
    this.seek(frame);
  }

  seek(frame) {
    if (this.state.playing) {
      this.play(false);
    }
    this.change({ clock: ((frame + 0.5) * this.duration()) / this.data.times.length });
    this.tellTime();
  }

  wipeTo(share) {
    this.state.wipe = clamp(share, 0, 1);
    this.tellWipe();
    if (this.renderer && this.renderer.ready && !this.device.gl.isContextLost()) {
      this.show();
    }
  }

  listen() {
    const on = (id, event, action) => find(id).addEventListener(event, (e) => action(e.target.value, e));
    on("play", "click", () => this.play(!this.state.playing));
    on("time", "input", (value) => this.seek(Number(value)));
    on("wipe", "input", (value) => this.wipeTo(value / 100));
    for (const name of ["yaw", "pitch", "distance"]) {
      on(name, "input", (value) => this.turn({ [name]: Number(value) }));
    }
    on("camera-reset", "click", () => this.turn(REST));
    on("lights-reset", "click", () => {
      this.data.lights.forEach((_, i) => this.light(i, null));
    });
    find("beyond").addEventListener("change", (event) => this.goBeyond(event.target.checked));
    on("size", "change", (value) => {
      this.times = [];
      this.change({ size: value === "auto" ? value : Number(value) });
    });
    on("compare", "click", () => this.compare(!this.state.comparing));
    on("samples", "change", (value) => {
      this.state.samples = Number(value); // more are added to those that there are
      this.tellCompared();
    });
    on("variant", "change", (value) => this.choose(value));
    for (const side of ["left", "right"]) {
      on(side, "change", (value) => {
        this.state[side] = value;
        this.wipeTo(this.state.wipe);
      });
    }
    this.listenToPicture(find("picture"));
  }

  /** Drag to turn, drag the line to wipe, two fingers to come closer; keys do all of it. */
  listenToPicture(canvas) {
    let held = null;
    const pointers = new Map();
    const share = (event) => {
      const box = canvas.getBoundingClientRect();
      return (event.clientX - box.left) / box.width;
    };
    const apart = () => {
      const [a, b] = [...pointers.values()];
      return Math.max(1, Math.hypot(a.x - b.x, a.y - b.y));
    };
    canvas.addEventListener("pointerdown", (event) => {
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      const width = canvas.getBoundingClientRect().width;
      const near = Math.abs(share(event) - this.state.wipe) * width <= GRAB_PX;
      held = { near, x: event.clientX, y: event.clientY, turn: this.state.turn };
      held.apart = pointers.size === 2 ? apart() : null;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!held || !pointers.has(event.pointerId)) {
        return;
      }
      pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      if (held.apart) {
        this.turn({ distance: (held.turn.distance * held.apart) / apart() });
      } else if (held.near) {
        this.wipeTo(share(event));
      } else {
        const yaw = held.turn.yaw - DEGREES_PER_PX * (event.clientX - held.x);
        const pitch = held.turn.pitch + DEGREES_PER_PX * (event.clientY - held.y);
        this.turn({ yaw, pitch });
      }
    });
    for (const name of ["pointerup", "pointercancel"]) {
      canvas.addEventListener(name, (event) => {
        pointers.delete(event.pointerId);
        held = null; // what is left of two fingers turns nothing
      });
    }
    canvas.addEventListener("keydown", (event) => {
      const { yaw, pitch, distance } = this.state.turn;
      const keys = {
        ArrowLeft: () => this.turn({ yaw: yaw - 5 }),
        ArrowRight: () => this.turn({ yaw: yaw + 5 }),
        ArrowUp: () => this.turn({ pitch: pitch + 5 }),
        ArrowDown: () => this.turn({ pitch: pitch - 5 }),
        "+": () => this.turn({ distance: distance / 1.1 }),
        "-": () => this.turn({ distance: distance * 1.1 }),
        0: () => this.turn(REST),
        " ": () => this.data.times.length > 1 && this.play(!this.state.playing),
        ",": () => this.step(-1),
        ".": () => this.step(1),
        a: () => this.wipeTo(this.state.wipe - 0.05),
        d: () => this.wipeTo(this.state.wipe + 0.05),
      };
      if (keys[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) {
        event.preventDefault();
        keys[event.key]();
      }
    });
  }
}

/** A labelled row for a control. */
function row(text, control) {
  const line = document.createElement("div");
  line.className = "row";
  const label = document.createElement("label");
  Object.assign(label, { htmlFor: control.id, textContent: text });
  line.append(label, control);
  return line;
}

/** A range that a network has learned, in words. */
function rangeText(name, pair) {
  const show = {
    saturation: (x) => `${Math.round(100 * x)} %`,
    yaw: (x) => `${Number(x.toFixed(1))}°`,
    pitch: (x) => `${Number(x.toFixed(1))}°`,
  };
  const text = show[name] || ((x) => `× ${Number(x.toFixed(2))}`);
  return `learned: ${pair.map(text).join(" to ")}`;
}

function raised(_, digits) {
  return `⁻${digits.replace(/\d/g, (digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit])}`;
}

/** What is said of a network each of whose bits is promised. */
function bitsSentence({ same, first }) {
  if (same) {
    return "none: the same bits as the reference";
  }
  if (!first) {
    return "NOT the bits of the reference: another SHA-256";
  }
  const place = `pixel (${first.x}, ${first.y}), ${["red", "green", "blue"][first.channel]}`;
  return `NOT the bits of the reference: ${place} is ${first.found}, not ${first.wanted}`;
}

function variantText(variant) {
  const place = variant.schedule === "packed" ? ", weights in a texture" : "";
  if (variant.levels > 1) {
    return "integers of 8 bits";
  }
  const full = variant.passes[0].module ? "full, on the processor" : "full";
  return variant.rank ? `fast, rank ${variant.rank}${place}` : full;
}

/** For tests and for the curious: draw a given moment and read its floats. */
function hook(page, started) {
  return {
    ready: started,
    page,
    parts: { Strips, REST, decodeFloats, outside, asBright, lampColor, lampOf },
    /** Stop the loop's own pictures, and draw one: {size, frame, seed, turn, colors, variant}. */
    async draw(options) {
      page.held = true;
      while (page.renderer.strips.busy) {
        await nextFrame();
      }
      const { state } = page;
      if (options.variant && options.variant !== state.variant) {
        await page.choose(options.variant);
      }
      const camera = orbit(page.data.camera, { ...REST, ...options.turn });
      const colors = options.colors || page.data.lights.map((light) => light.color);
      const { size = 64, frame = 0, seed = 0 } = options;
      await page.renderer.draw({ size, frame, seed, camera, colors, variant: state.variant });
      page.show();
      return { camera, colors, time: page.data.times[frame] };
    },
    /** Floats (RGBA, rows from the top) of an image as base64. */
    read(name) {
      const { reference } = page;
      const floats =
        name === "reference" ? page.device.read(reference.encoded, reference.place)
        : name === "reference_sums" ? page.device.read(reference.sums[0], 0)
        : page.renderer.read(name);
      const bytes = new Uint8Array(floats.buffer);
      let text = "";
      for (let i = 0; i < bytes.length; i += 4096) {
        text += String.fromCharCode(...bytes.subarray(i, i + 4096));
      }
      return btoa(text);
    },
    go() {
      page.held = false;
    },
  };
}

document.body.classList.toggle("embedded", window.parent !== window);
const page = new Page(JSON.parse(find("data").textContent));
const started = page.start();
started.catch(() => {}); // it has been told; the hook's promise tells tests
window.wamnet = hook(page, started);
