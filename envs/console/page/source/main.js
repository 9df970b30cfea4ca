// The console's page: a drive or a replay told by haustra.envs.console.server, or a run that a report holds.
import { Hand } from "./hand.js";
import { fromBase64, unpack } from "./message.js";
import { Outside } from "./outside.js";

const element = (name, about = {}, parent = null) => {
  const made = Object.assign(document.createElement(name), about);
  if (parent) parent.append(made);
  return made;
};
const shown = (value, digits = 1) => (Number.isFinite(value) ? value.toFixed(digits) : "–");

// Gauges: label, unit, what of a row, digits, where the bar ends, where it alarms.
const GAUGES = [
  ["inserted", "cm", (row) => row.insertion * 100, 1, 160],
  ["tip along the colon", "cm", (row) => row.tip_arc * 100, 1, 160],
  ["push", "N", (row) => row.push_force, 1, 43, 35],
  ["torque", "N m", (row) => row.torque, 2, 1],
  ["hardest on the wall", "N", (row) => row.wall_force, 1, 46.5, 14.1],
  ["pain over its threshold", "", (row) => row.pain, 2, 2, 1],
  ["people perforated", "%", (row) => row.p_perforation * 100, 2, 5, 1],
  ["gas", "L", (row) => row.gas_volume * 1000, 2, 4],
  ["water", "mL", (row) => row.water_volume * 1e6, 0, 500],
  ["polyps taken", "", (row) => row.polyps_taken, 0, 5],
  ["bleeding", "mm²", (row) => row.bleeding_mm2, 0, 100],
  ["magnet", "N", (row) => row.magnet_force, 2, 2],
  ["progress", "%", (row) => row.progress * 100, 0, 100],
  ["time", "s", (row) => row.time, 1, 600],
];

class View {
  constructor(scene, parent) {
    this.scene = scene;
    this.box = element("div", { className: "view" }, parent);
    const eye = element("div", { className: "pane" }, this.box);
    this.eye = element("canvas", { className: "eye" }, eye);
    this.tag = element("div", { className: "tag" }, eye);
    this.rate = element("div", { className: "tag right" }, eye);
    const outside = element("div", { className: "pane outside" }, this.box);
    this.outside = new Outside(element("canvas", {}, outside), scene);
    element("div", { className: "tag", textContent: scene.name }, outside);
    this.state = element("div", { className: "tag right" }, outside);
    this.legend = element("div", { className: "legend", textContent: "force on the wall, red from 15 N" }, outside);
    this.way = element("div", { className: "way" }, this.box);
    for (const [name, start, end] of scene.segments) {
      const part = element("div", { textContent: name }, this.way);
      part.style.left = `${(100 * start) / scene.length}%`;
      part.style.width = `${(100 * (end - start)) / scene.length}%`;
    }
    this.mark = element("em", {}, this.way);
    this.gauges = element("div", { className: "gauges" }, this.box);
    this.parts = {};
    this.frozen = false;
    this.times = [];
  }

  show(frame) {
    const { row } = frame;
    for (const [label, unit, of, digits, most, alarm] of GAUGES) {
      const value = of(row);
      if (!Number.isFinite(value)) continue;
      if (!this.parts[label]) {
        const box = element("div", { className: "gauge" }, this.gauges);
        this.parts[label] = [box, element("b", {}, box), element("span", { textContent: label }, box), element("i", {}, box)];
      }
      const [box, number, , bar] = this.parts[label];
      number.textContent = `${shown(value, digits)} ${unit}`;
      bar.style.setProperty("--share", Math.min(Math.abs(value) / most, 1));
      box.classList.toggle("alarm", alarm !== undefined && Math.abs(value) >= alarm);
    }
    const next = this.scene.landmarks.filter(([, arc]) => arc > row.tip_arc).sort((a, b) => a[1] - b[1])[0];
    const ahead = next ? ` · ${next[0].replaceAll("_", " ")} in ${shown((next[1] - row.tip_arc) * 100, 0)} cm` : "";
    this.tag.textContent = frame.segment.replaceAll("_", " ") + ahead;
    this.mark.style.left = `${(100 * row.tip_arc) / this.scene.length}%`;
    if (frame.arrays.gas) {
      // One pressure a segment: a station has that of its segment.
      const each = frame.arrays.gas, names = this.scene.segments;
      frame.arrays.gas = frame.arrays.pressed.map((_, i) => each[Math.min(Math.max(names.findIndex(([, , end]) => i * 0.02 <= end), 0), each.length - 1)]);
    }
    this.outside.update(frame.arrays);
  }

  async picture(message) {
    const now = performance.now();
    this.times = [...this.times.filter((time) => now - time < 2000), now];
    this.rate.textContent = `${(this.times.length / 2).toFixed(0)} pictures/s${this.frozen ? " · frozen" : ""}`;
    if (this.frozen) return;
    const drawn = await createImageBitmap(new Blob([message.arrays.jpeg], { type: "image/jpeg" }));
    if (this.eye.width !== drawn.width) { this.eye.width = drawn.width; this.eye.height = drawn.height; }
    this.eye.getContext("2d").drawImage(drawn, 0, 0);
    drawn.close();
  }
}

class Console {
  constructor() {
    this.views = [];
    this.stats = { pictures: 0, frames: 0, latencies: [], reconnects: 0, refused: [] };
    this.echo = 0;
    this.parent = document.getElementById("views");
    this.foot = document.getElementById("foot");
    this.veil = document.getElementById("veil");
    this.connect();
  }

  connect() {
    const token = new URLSearchParams(location.search).get("token") || "";
    this.socket = new WebSocket(`ws://${location.host}/socket?token=${encodeURIComponent(token)}`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.veil.hidden = true; };
    // The server sends more of a kind once this is drawn, so that nothing waits in between.
    this.socket.onmessage = async (event) => { const message = unpack(event.data); await this.hear(message); this.say({ drawn: message.kind }); };
    this.socket.onclose = () => {
      this.veil.textContent = "The connection is lost. The hand has let go; the drive waits.";
      this.veil.hidden = false;
      this.stats.reconnects += 1;
      setTimeout(() => this.connect(), 700);
    };
  }

  say(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  hear(message) {
    const view = this.views[message.view];
    switch (message.kind) {
      case "scene":
        if (view) return;
        this.views[message.view] = new View(message, this.parent);
        this.parent.classList.toggle("many", message.views > 1);
        if (message.view === 0) this.build(message);
        break;
      case "frame":
        this.stats.frames += 1;
        if (view) view.show(message);
        if (message.view === 0) this.follow(message);
        break;
      case "picture":
        this.stats.pictures += 1;
        if (message.echo && message.echo !== this.echo) {
          this.echo = message.echo;
          this.stats.latencies = [...this.stats.latencies.slice(-999), performance.now() - message.echo];
        }
        if (view) return view.picture(message);
        break;
      case "refused":
        this.stats.refused.push(message.say);
        this.note.textContent = message.say;
        break;
      case "ended":
        this.veil.textContent = `The simulation has ended: ${message.say}`;
        this.veil.hidden = false;
    }
  }

  // What a person can press, besides levers.
  build(scene) {
    const { foot } = this;
    const button = (text, act) => {
      const made = element("button", { textContent: text, onclick: () => { act(); made.blur(); } }, foot);
      return made;
    };
    this.pause = button("run ␣", () => this.say({ pause: !this.last.paused }));
    const speeds = element("select", { title: "speed", onchange: () => { this.say({ speed: Number(speeds.value) }); speeds.blur(); } }, foot);
    for (const speed of scene.speeds) element("option", { value: speed, textContent: `${speed}×` }, speeds);
    speeds.value = 1;
    this.speeds = speeds;
    const colours = element("select", { title: "colours of the wall", onchange: () => this.colour(colours.value) }, foot);
    for (const [value, text] of [["pressed", "force"], ["pain", "pain"], ["gas", "gas"]]) element("option", { value, textContent: text }, colours);
    this.frozen = button("freeze F", () => this.freeze());
    if (scene.mode === "drive") this.buildDrive(scene, button); else this.buildReplay(scene);
    this.note = element("span", { className: "keys" }, foot);
    window.addEventListener("keydown", (event) => {
      if (event.repeat || event.ctrlKey || event.metaKey || /INPUT|SELECT/.test(event.target.tagName)) return;
      const act = (this.acts || {})[event.code] || { Space: () => this.say({ pause: !this.last.paused }), KeyF: () => this.freeze() }[event.code];
      if (act) { event.preventDefault(); act(); }
    });
  }

  buildDrive(scene, button) {
    this.hand = new Hand(scene.levers, (message) => this.say(message));
    const knobs = scene.levers.filter(({ knob }) => knob).map(({ name }) => name);
    const names = scene.levers.map(({ name }) => name);
    const back = () => this.say({ back: 10 }), restart = () => this.say({ restart: "start" });
    const slow = () => this.say({ speed: this.last.speed === 0.25 ? 1 : 0.25 });
    const assist = () => this.say({ assist: !this.last.assisted });
    const lock = () => { const locked = this.last.locked.every(Boolean); this.say({ lock: Object.fromEntries(knobs.map((name) => [name, !locked])) }); };
    button("back 10 s ⌫", back);
    button("restart R", restart);
    button("mark M", () => this.say({ mark: `at ${shown(this.last.row.time)} s` }));
    this.marks = element("select", { title: "restart from a place", onchange: () => { this.say({ restart: this.marks.value }); this.marks.blur(); } }, this.foot);
    this.assisted = button("driver helps T", assist);
    if (knobs.length) this.locks = button("knobs locked L", lock);
    this.acts = { Backspace: back, KeyR: restart, KeyT: assist, KeyL: lock, KeyZ: slow, KeyM: () => this.say({ mark: `at ${shown(this.last.row.time)} s` }) };
    this.inputs = {};
    for (const { name, unit, low, high, choices } of scene.conditions) {
      const label = element("label", { textContent: `${name.replaceAll("_", " ")} ` }, this.foot);
      const input = choices.length ? element("select", {}, label) : element("input", { type: "number", min: low, max: high, step: "any", title: unit }, label);
      for (const choice of choices) element("option", { value: choice, textContent: choice }, input);
      input.onchange = () => { this.say({ change: { [name]: choices.length ? input.value : Number(input.value) } }); input.blur(); };
      this.inputs[name] = input;
      const turn = { posture: "KeyO", pressed: "KeyP" }[name];
      if (turn) this.acts[turn] = () => this.say({ change: { [name]: choices[(choices.indexOf(this.last.conditions[name]) + 1) % choices.length] } });
    }
    if (this.inputs.instrument) {
      // What is in the channel: B brings out the next instrument, X closes it and opens it again.
      const hold = (value) => this.say({ change: { instrument: value } });
      const open = ["none", "snare", "forceps"], now = () => this.last.conditions.instrument;
      this.acts.KeyB = () => hold(open[(open.indexOf(now().replace(" closed", "")) + 1) % open.length]);
      this.acts.KeyX = () => { if (now() !== "none") hold(now().endsWith("closed") ? now().replace(" closed", "") : `${now()} closed`); };
    }
    this.stick("push · roll", names[1], names[0], 1);
    if (names.length > 3) this.stick("knobs", names[3], names[2], -1);
    if (names.includes("gas")) { this.held("insufflate E", "gas", 1); this.held("suck Q", "gas", -1); }
    if (names.includes("water")) this.held("water G", "water", 1);
    this.hand.onButton = (number) => ({ 0: lock, 1: assist, 2: () => this.freeze(), 8: back, 9: () => this.say({ pause: !this.last.paused }) }[number] || (() => {}))();
    const keys = element("span", { className: "keys" }, this.foot);
    for (const name of names) {
      const pair = this.hand.keys[name].filter(Boolean).map((code) => code.replace(/Key|Arrow|Digit/, ""));
      if (pair.length) keys.append(...pair.flatMap((key) => [element("kbd", { textContent: key }), " "]), `${name}  `);
    }
    keys.append(`· Z slow · O posture · P press the belly ${this.inputs.instrument ? "· B instrument · X close it " : ""}· gamepad: sticks and triggers`);
  }

  buildReplay(scene) {
    this.slider = element("input", { type: "range", className: "slider", min: 0, max: scene.duration, step: "any", value: 0 }, this.foot);
    this.slider.oninput = () => this.say({ pause: true, seek: Number(this.slider.value) });
    this.clock = element("span", {}, this.foot);
    if (scene.corrections.length) element("span", { className: "keys", textContent: `corrected at ${scene.corrections.slice(0, 12).map((time) => shown(time)).join(", ")} s` }, this.foot);
    this.acts = { ArrowLeft: () => this.say({ seek: this.last.time - 1 }), ArrowRight: () => this.say({ seek: this.last.time + 1 }) };
  }

  // A button that holds a lever while it is pressed.
  held(text, lever, share) {
    const made = element("button", { textContent: text, className: "held" }, this.foot);
    made.dataset.name = text;
    const letGo = () => { made.classList.remove("on"); this.hand.stick(lever, 0); };
    made.onpointerdown = (event) => { made.setPointerCapture(event.pointerId); made.classList.add("on"); this.hand.stick(lever, share); };
    made.onpointerup = made.onpointercancel = () => { letGo(); made.blur(); };
  }

  stick(name, across, along, sign) {
    const box = element("div", { className: "stick" }, this.foot), knob = element("i", {}, box);
    box.dataset.name = name;
    const move = (event) => {
      const { left, top, width } = box.getBoundingClientRect(), half = width / 2;
      let x = (event.clientX - left) / half - 1, y = (event.clientY - top) / half - 1;
      const size = Math.max(1, Math.hypot(x, y));
      x /= size; y /= size;
      knob.style.transform = `translate(${x * half * 0.6}px, ${y * half * 0.6}px)`;
      this.hand.stick(across, sign * x);
      this.hand.stick(along, -y);
    };
    const end = () => { knob.style.transform = ""; this.hand.stick(across, 0); this.hand.stick(along, 0); };
    box.onpointerdown = (event) => { box.setPointerCapture(event.pointerId); move(event); box.onpointermove = move; };
    box.onpointerup = box.onpointercancel = () => { box.onpointermove = null; end(); };
  }

  colour(shows) {
    const legends = { pressed: "force on the wall, red from 15 N", pain: "pain, red from twice the threshold", gas: "gas, blue from 4 kPa" };
    for (const view of this.views) { view.outside.shows = shows; view.legend.textContent = legends[shows]; }
  }

  freeze() {
    for (const view of this.views) view.frozen = !view.frozen;
    this.frozen.classList.toggle("on", this.views[0].frozen);
  }

  // Follow what the simulation says of itself.
  follow(frame) {
    this.last = frame;
    this.pause.textContent = frame.paused ? "run ␣" : "pause ␣";
    if (document.activeElement !== this.speeds) this.speeds.value = frame.speed;
    if (this.slider) {
      if (document.activeElement !== this.slider || !frame.paused) this.slider.value = frame.time;
      this.clock.textContent = `${shown(frame.time)} s`;
      return;
    }
    this.assisted.classList.toggle("on", frame.assisted);
    if (this.locks) this.locks.classList.toggle("on", frame.locked.every(Boolean));
    const said = [frame.sound ? "" : "diverged: go back", frame.correcting ? "you correct" : frame.assisted ? "driver drives" : "", frame.recording ? "● recording" : "", frame.paused ? "paused" : ""];
    this.views[0].state.textContent = said.filter(Boolean).join(" · ");
    if (frame.said && frame.said !== this.said) this.note.textContent = frame.said;
    this.said = frame.said;
    if (this.marks.length !== frame.marks.length) {
      this.marks.replaceChildren(...frame.marks.map((mark) => element("option", { value: mark, textContent: mark })));
    }
    for (const [name, input] of Object.entries(this.inputs)) {
      const value = frame.conditions[name];
      if (document.activeElement !== input) input.value = typeof value === "number" ? Number(value.toPrecision(4)) : value;
    }
  }
}

// A run that a report holds: one scene, and frames one behind the other.
class Player {
  constructor(box) {
    const messages = JSON.parse(box.querySelector("script").textContent).map(fromBase64);
    this.frames = messages.slice(1);
    this.outside = new Outside(element("canvas", {}, box), messages[0]);
    const bar = element("div", { className: "bar" }, box);
    const button = element("button", { textContent: "▶" }, bar);
    this.slider = element("input", { type: "range", min: 0, max: this.frames.length - 1, step: 1, value: this.frames.length - 1 }, bar);
    this.said = element("span", {}, bar);
    this.slider.oninput = () => this.show(Number(this.slider.value));
    button.onclick = () => {
      clearInterval(this.timer);
      if (this.timer) { this.timer = null; button.textContent = "▶"; return; }
      button.textContent = "❚❚";
      this.timer = setInterval(() => this.show((Number(this.slider.value) + 1) % this.frames.length), 100);
    };
    this.show(this.frames.length - 1);
  }

  show(number) {
    const frame = this.frames[number];
    this.slider.value = number;
    this.said.textContent = `${shown(frame.row.time)} s · tip ${shown(frame.row.tip_arc * 100, 0)} cm in · ${shown(frame.row.wall_force)} N`;
    this.outside.update(frame.arrays);
  }
}

const players = document.querySelectorAll(".player");
if (players.length) window.haustraPlayers = [...players].map((box) => new Player(box));
else if (document.getElementById("views")) window.haustra = new Console();
