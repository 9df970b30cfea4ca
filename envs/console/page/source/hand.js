// What the person asks for: keys held down, sticks on the screen, a gamepad. Shares of levers from -1 to 1, by name.
const NAMED = {
  push: ["KeyW", "KeyS"], roll: ["KeyD", "KeyA"], up: ["ArrowUp", "ArrowDown"], left: ["ArrowLeft", "ArrowRight"],
  gas: ["KeyE", "KeyQ"], water: ["KeyG", ""],
};
const OTHERS = [["KeyW", "KeyS"], ["KeyD", "KeyA"], ["ArrowUp", "ArrowDown"], ["ArrowLeft", "ArrowRight"], ["KeyE", "KeyQ"], ["KeyU", "KeyJ"], ["KeyI", "KeyK"], ["Digit1", "Digit2"], ["Digit3", "Digit4"], ["Digit5", "Digit6"]];
const BEAT = 80; // the hand is said so often although nothing changed [ms]
const DEAD = 0.12; // a gamepad's stick within this is let go

export class Hand {
  constructor(levers, say) {
    this.levers = levers;
    this.say = say;
    this.keys = {};
    const own = levers.every(({ name }) => NAMED[name]);
    levers.forEach(({ name }, i) => { this.keys[name] = own ? NAMED[name] : OTHERS[i] || []; });
    this.held = new Set();
    this.sticks = {};
    this.pressed = [];
    window.addEventListener("keydown", (event) => this._key(event, true));
    window.addEventListener("keyup", (event) => this._key(event, false));
    for (const gone of ["blur", "pagehide"]) window.addEventListener(gone, () => this.letGo());
    setInterval(() => this.tell(), BEAT);
    const poll = () => { this._gamepad(); requestAnimationFrame(poll); };
    poll();
  }

  letGo() {
    this.held.clear();
    this.sticks = {};
    this.tell();
  }

  shares() {
    const found = {};
    for (const { name } of this.levers) {
      const [more, less] = this.keys[name];
      const share = (this.held.has(more) ? 1 : 0) - (this.held.has(less) ? 1 : 0) + (this.sticks[name] || 0) + ((this.pad || {})[name] || 0);
      if (share) found[name] = Math.max(-1, Math.min(1, share));
    }
    return found;
  }

  tell() {
    this.say({ hand: this.shares(), t: performance.now() });
  }

  stick(name, share) {
    this.sticks[name] = share;
    this.tell();
  }

  _key(event, down) {
    if (event.ctrlKey || event.metaKey || event.altKey || /INPUT|SELECT|TEXTAREA/.test(event.target.tagName)) return;
    const known = Object.values(this.keys).some((pair) => pair.includes(event.code));
    if (!known) return;
    event.preventDefault();
    if (down === this.held.has(event.code)) return;
    if (down) this.held.add(event.code); else this.held.delete(event.code);
    this.tell();
  }

  _gamepad() {
    const pad = [...(navigator.getGamepads ? navigator.getGamepads() : [])].find((one) => one && one.connected);
    if (!pad) { this.pad = null; return; }
    const soft = (value) => (Math.abs(value) < DEAD ? 0 : (value - Math.sign(value) * DEAD) / (1 - DEAD));
    const [x, y, turnX, turnY] = pad.axes.map(soft);
    const trigger = (number) => (pad.buttons[number] ? pad.buttons[number].value : 0);
    const six = [-y, x, -turnY, -turnX, trigger(7) - trigger(6), (trigger(5) || 0) - (trigger(4) || 0)];
    const before = JSON.stringify(this.pad);
    this.pad = {};
    this.levers.forEach(({ name }, i) => { this.pad[name] = six[i] || 0; });
    if (JSON.stringify(this.pad) !== before) this.tell();
    const down = pad.buttons.map((button) => button.pressed);
    down.forEach((now, number) => { if (now && !this.pressed[number] && this.onButton) this.onButton(number); });
    this.pressed = down;
  }
}
