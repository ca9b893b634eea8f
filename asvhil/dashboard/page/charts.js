// Lines over time, and bars of the motors.

import { Drawing, points } from "./svg.js";

const HEIGHT = 104;
const LEFT = 46;
const SPAN_S = 300;

// Two digits, and all before the point.
const labelOf = (value) => (Math.abs(value) < 10 ? value.toPrecision(2).replace(/\.0$/, "") : value.toFixed(0));

export class Chart {
  constructor(root, name, unit, least, symmetric) {
    Object.assign(this, { root, name, unit, least, symmetric });
    this.drawing = new Drawing(root);
  }

  // `rows` of {t, value}; null values part the line.
  draw(now, rows) {
    const seen = rows.filter((row) => row.t > now - SPAN_S);
    const known = seen.filter((row) => row.value !== null);
    const most = Math.max(this.least, ...known.map((row) => Math.abs(row.value)));
    const [low, high] = this.symmetric ? [-most, most] : [0, most];
    const width = this.root.clientWidth || 400;
    const x = (t) => width - ((now - t) / SPAN_S) * (width - LEFT);
    const y = (value) => 8 + ((high - value) / (high - low)) * (HEIGHT - 26);
    const d = this.drawing;
    d.begin(width, HEIGHT);
    for (const value of this.symmetric ? [low, 0, high] : [0, high / 2, high]) {
      d.node(`g${value === 0 ? 0 : value > 0 ? (value === high ? 2 : 1) : -1}`, "line", { class: "grid", x1: LEFT, x2: width, y1: y(value), y2: y(value) });
      d.node(`l${value === 0 ? 0 : value > 0 ? (value === high ? 2 : 1) : -1}`, "text", { class: "faint", x: LEFT - 4, y: y(value) + 4, "text-anchor": "end" }, labelOf(value));
    }
    d.node("title", "text", { x: LEFT + 4, y: 14 }, `${this.name} (${this.unit})`);
    d.node("from", "text", { class: "faint", x: LEFT, y: HEIGHT - 2 }, `${SPAN_S / 60} min ago`);
    d.node("to", "text", { class: "faint", x: width, y: HEIGHT - 2, "text-anchor": "end" }, "now");
    let piece = [];
    let count = 0;
    const close = () => {
      if (piece.length > 1) d.node(`p${count++}`, "polyline", { class: "line", points: points(piece) });
      piece = [];
    };
    let before = null;
    for (const row of seen) {
      if (row.value === null || (before !== null && row.t - before > 5)) close();
      if (row.value !== null) piece.push([x(row.t), y(row.value)]);
      before = row.t;
    }
    close();
    d.end();
    this.describe(known);
  }

  describe(known) {
    const values = known.map((row) => row.value);
    const text = values.length
      ? `${this.name} of the last ${SPAN_S / 60} minutes: ${Math.min(...values).toFixed(1)} to ${Math.max(...values).toFixed(1)} ${this.unit}`
      : `${this.name}: nothing yet`;
    if (this.root.getAttribute("aria-label") !== text) this.root.setAttribute("aria-label", text);
  }
}

const thrustOf = (curve, command) => {
  for (let i = 1; i < curve.length; i++) {
    const [c0, f0] = curve[i - 1];
    const [c1, f1] = curve[i];
    if (command <= c1 || i === curve.length - 1) return f0 + ((f1 - f0) * (Math.min(Math.max(command, c0), c1) - c0)) / (c1 - c0);
  }
  return 0;
};

export class Motors {
  constructor(root) {
    this.root = root;
    this.drawing = new Drawing(root);
  }

  draw(boat, facts) {
    const d = this.drawing;
    const [low, rest, high] = facts.pulses_us;
    const most = Math.max(...facts.thrust.map(([, force]) => Math.abs(force)));
    const words = [];
    const width = this.root.clientWidth || 400;
    d.begin(width, 140);
    ["port", "starboard"].forEach((side, i) => {
      const us = boat[`${side}_us`] ?? null;
      const command = us === null ? null : us >= rest ? (us - rest) / (high - rest) : (us - rest) / (rest - low);
      const force = command === null ? null : thrustOf(facts.thrust, command);
      const top = 20 + i * 66;
      d.node(`${side}n`, "text", { x: 0, y: top }, side);
      const said = us === null ? "released" : `${Math.round(us)} µs, ${force.toFixed(Math.abs(force) < 100 ? 1 : 0)} N`;
      d.node(`${side}v`, "text", { x: width, y: top, "text-anchor": "end" }, said);
      this.bar(d, `${side}p`, "bar", top + 6, command ?? 0, "pulse", width);
      this.bar(d, `${side}t`, "bar thrust", top + 26, force === null ? 0 : force / most, "thrust", width);
      words.push(`${side} ${said}`);
    });
    d.end();
    this.root.setAttribute("aria-label", `Motors: ${words.join("; ")}`);
  }

  // From the middle to the left astern, to the right ahead.
  bar(d, key, kind, top, share, name, width) {
    const half = (width - 60) / 2;
    const middle = width - half;
    const long = Math.min(Math.max(share, -1), 1) * half;
    d.node(`${key}f`, "rect", { class: "grid", x: middle - half, y: top, width: 2 * half, height: 15 });
    d.node(key, "rect", { class: kind, x: Math.min(middle, middle + long), y: top, width: Math.abs(long), height: 15 });
    d.node(`${key}0`, "line", { class: "axis", x1: middle, x2: middle, y1: top - 1, y2: top + 16 });
    d.node(`${key}w`, "text", { class: "faint", x: 0, y: top + 12 }, name);
  }
}
