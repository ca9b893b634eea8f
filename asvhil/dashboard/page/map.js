// The map in local metres, north up: boat, track, station, radii, predicted path, fence, wind.

import { velocityOf } from "./motion.js";
import { Drawing, points } from "./svg.js";

const SIZE = 420;
const STEPS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000];
const RAD = Math.PI / 180;

export class BoatMap {
  // `onPick` gets north and east (m) of a place that was clicked or chosen by keys.
  constructor(box, picture, onPick, onCursor) {
    this.box = box;
    this.picture = picture;
    this.drawing = new Drawing(picture);
    this.onPick = onPick;
    this.onCursor = onCursor;
    this.span = null; // metres from side to side; null: fitted
    this.fitted = 30;
    this.centre = [0, 0];
    this.cursor = null;
    this.last = null;
    picture.addEventListener("click", (event) => {
      const place = this.place(event);
      if (place) this.pick(place);
    });
    box.addEventListener("keydown", (event) => this.key(event));
  }

  // The cross shows what is asked for, until that is decided.
  pick(place) {
    this.cursor = this.onPick(...place) ? place : null;
    this.redraw();
  }

  drop() { this.cursor = null; this.redraw(); }

  get width() { return this.span ?? this.fitted; }

  zoom(factor) { this.span = Math.min(Math.max(this.width * factor, 4), 4000); this.redraw(); }

  fit() { this.span = null; this.redraw(); }

  place(event) {
    const box = this.picture.getBoundingClientRect();
    const side = Math.min(box.width, box.height); // the picture is square and centred in its box
    const x = (event.clientX - box.left - (box.width - side) / 2) / side;
    const y = (event.clientY - box.top - (box.height - side) / 2) / side;
    if (!this.last || x < 0 || x > 1 || y < 0 || y > 1) return null;
    return [this.centre[0] + (0.5 - y) * this.width, this.centre[1] + (x - 0.5) * this.width];
  }

  key(event) {
    const moves = { ArrowUp: [1, 0], ArrowDown: [-1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };
    const move = moves[event.key];
    if (event.key === "Escape") this.cursor = null;
    else if (event.key === "+") this.zoom(0.5);
    else if (event.key === "-") this.zoom(2);
    else if (event.key === "Enter" && this.cursor) this.pick(this.cursor);
    else if (move && this.last) {
      const step = this.step() / (event.shiftKey ? 1 : 5);
      const from = this.cursor ?? this.anchor();
      this.cursor = [from[0] + move[0] * step, from[1] + move[1] * step];
      this.onCursor(...this.cursor);
    } else return;
    event.preventDefault();
    this.redraw();
  }

  anchor() {
    const { boat } = this.last;
    return boat.station_n_m !== null ? [boat.station_n_m, boat.station_e_m] : [boat.n_m ?? 0, boat.e_m ?? 0];
  }

  step() { return STEPS.find((step) => this.width / step <= 8) ?? 1000; }

  redraw() { if (this.last) this.draw(this.last, this.track, this.facts); }

  draw(live, track, facts) {
    const boat = live.boat;
    if (boat.n_m === undefined || !facts) return;
    if (boat.n_m === null) return this.drawNothing();
    Object.assign(this, { last: live, track, facts });
    const held = boat.station_n_m !== null;
    this.centre = this.anchor();
    const distance = held ? Math.hypot(boat.n_m - boat.station_n_m, boat.e_m - boat.station_e_m) : 0;
    const wanted = Math.max(2.6 * distance, 6 * facts.length_m, 12);
    if (wanted > this.fitted || wanted < this.fitted / 2.5) this.fitted = wanted * 1.25;
    const k = SIZE / this.width;
    const x = (e) => SIZE / 2 + (e - this.centre[1]) * k;
    const y = (n) => SIZE / 2 - (n - this.centre[0]) * k;
    const d = this.drawing;
    d.begin(SIZE, SIZE);
    this.grid(d, x, y);
    if (live.fence_m.length) d.node("fence", "polygon", { class: "fence", points: points(live.fence_m.map(([n, e]) => [x(e), y(n)])) });
    if (track.length) d.node("track", "polyline", { class: "track", points: points(track.map((row) => [x(row.e_m), y(row.n_m)])) });
    if (held) this.station(d, x, y, k, boat, facts);
    if (live.plan.length) {
      d.node("plan", "polyline", { class: "plan", points: points(live.plan.map(([n, e]) => [x(e), y(n)])) });
    }
    this.boat(d, x(boat.e_m), y(boat.n_m), k, boat, facts);
    this.wind(d, boat);
    if (this.cursor) {
      const [cx, cy] = [x(this.cursor[1]), y(this.cursor[0])];
      d.node("cursor", "path", { class: "cursor", d: `M${cx - 14} ${cy}H${cx + 14}M${cx} ${cy - 14}V${cy + 14}` });
    }
    d.end();
    this.describe(boat, held, distance);
  }

  grid(d, x, y) {
    const step = this.step();
    const half = this.width / 2;
    for (let i = Math.ceil((this.centre[1] - half) / step); i * step <= this.centre[1] + half; i++) {
      d.node(`gx${i}`, "line", { class: "grid", x1: x(i * step), x2: x(i * step), y1: 0, y2: SIZE });
    }
    for (let i = Math.ceil((this.centre[0] - half) / step); i * step <= this.centre[0] + half; i++) {
      d.node(`gy${i}`, "line", { class: "grid", x1: 0, x2: SIZE, y1: y(i * step), y2: y(i * step) });
    }
    this.scale = `one square ${step} m`;
    d.node("north", "text", { x: SIZE - 18, y: 18, "text-anchor": "middle" }, "N");
    d.node("needle", "path", { class: "axis", d: `M${SIZE - 18} 40V22M${SIZE - 22} 28L${SIZE - 18} 22L${SIZE - 14} 28` });
  }

  station(d, x, y, k, boat, facts) {
    const [sx, sy] = [x(boat.station_e_m), y(boat.station_n_m)];
    for (const [name, metres] of facts.radii) {
      d.node(`r${name}`, "circle", { class: "radius", cx: sx, cy: sy, r: metres * k });
      if (metres * k < SIZE * 0.48) d.node(`t${name}`, "text", { class: "faint", x: sx, y: sy - metres * k - 3, "text-anchor": "middle" }, `${name} ${metres} m`);
    }
    const psi = boat.station_heading_deg * RAD;
    const reach = Math.max(facts.length_m * k, 24);
    d.node("station", "circle", { class: "station", cx: sx, cy: sy, r: 7 });
    d.node("towards", "line", { class: "station", x1: sx, y1: sy, x2: sx + reach * Math.sin(psi), y2: sy - reach * Math.cos(psi) });
    this.motion(d, sx, sy, boat);
  }

  // Where the station goes, longer the faster it is.
  motion(d, sx, sy, boat) {
    const { speed, toward } = velocityOf(boat);
    if (!speed) return;
    const long = Math.min(30 + 100 * speed, 120);
    const at = `translate(${sx.toFixed(1)} ${sy.toFixed(1)}) rotate(${toward.toFixed(1)})`;
    d.node("moving", "path", { class: "moving", transform: at, d: `M0 -9V${-long}M-7 ${9 - long}L0 ${-long}L7 ${9 - long}` });
    const [right, down] = [Math.sin(toward * RAD), -Math.cos(toward * RAD)];
    const anchor = right > 0.3 ? "start" : right < -0.3 ? "end" : "middle";
    d.node("movingtext", "text", { x: sx + right * (long + 6), y: sy + down * (long + 12) + 4, "text-anchor": anchor }, `${speed.toFixed(2)} m/s`);
  }

  // Hollow where the estimate is not valid: it may be elsewhere.
  boat(d, bx, by, k, boat, facts) {
    const long = Math.max(facts.length_m * k, 22) / 2;
    const wide = Math.max(facts.width_m * k, 11) / 2;
    const shape = `M0 ${-long}L${wide} ${-long * 0.3}L${wide} ${long}L0 ${long * 0.75}L${-wide} ${long}L${-wide} ${-long * 0.3}Z`;
    const kind = boat.estimate_ok === 1 ? "boat" : "boat unsure";
    d.node("boat", "path", { class: kind, d: shape, transform: `translate(${bx.toFixed(1)} ${by.toFixed(1)}) rotate(${(boat.heading_deg ?? 0).toFixed(1)})` });
  }

  // In the corner, pointing where the air goes; the thin arrow goes as far as gusts of two standard deviations.
  wind(d, boat) {
    if (boat.wind_n_mps === null) return;
    const speed = Math.hypot(boat.wind_n_mps, boat.wind_e_mps);
    const toward = Math.atan2(boat.wind_e_mps, boat.wind_n_mps) / RAD;
    const long = (mps) => Math.min(6 * mps, 70);
    const [a, b] = [long(speed), long(speed + 2 * (boat.wind_std_mps ?? 0))];
    const at = `translate(46 46) rotate(${toward.toFixed(1)})`;
    d.node("gust", "path", { class: "gust", transform: at, d: `M0 ${b / 2}V${-b / 2}M-6 ${7 - b / 2}L0 ${-b / 2}L6 ${7 - b / 2}` });
    d.node("wind", "path", { class: "wind", transform: at, d: `M0 ${b / 2}V${b / 2 - a}M-6 ${b / 2 - a + 8}L0 ${b / 2 - a}L6 ${b / 2 - a + 8}` });
    d.node("windtext", "text", { x: 46, y: 98, "text-anchor": "middle" }, `wind ${speed.toFixed(1)} m/s`);
  }

  // Neither the boat nor the place of anything else is known.
  drawNothing() {
    this.last = null;
    this.cursor = null;
    this.drawing.begin(SIZE, SIZE);
    this.drawing.node("unknown", "text", { x: SIZE / 2, y: SIZE / 2, "text-anchor": "middle" }, "position not known");
    this.drawing.end();
    this.label("Map: position not known.");
  }

  describe(boat, held, distance) {
    const where = held ? `${distance.toFixed(1)} m from the station` : "no station is held";
    const { speed, toward } = velocityOf(boat);
    const moves = speed ? ` The station moves at ${speed.toFixed(2)} m/s toward ${Math.round(toward) % 360} degrees.` : "";
    const unsure = boat.estimate_ok === 1 ? "" : " Position and heading are not valid.";
    this.label(`Map, north up: the boat heads ${Math.round(boat.heading_deg ?? 0)} degrees, ${where}.${unsure}${moves}`);
  }

  label(text) {
    if (this.picture.getAttribute("aria-label") !== text) this.picture.setAttribute("aria-label", text);
  }
}
