// The page: takes what the dashboard tells, five times a second, and shows it; says so when it is old.

import { Chart, Motors } from "./charts.js";
import { Controls } from "./controls.js";
import { BoatMap } from "./map.js";
import { velocityOf } from "./motion.js";
import { keep, recall } from "./store.js";

const OLD_MS = 600; // as the dashboard has it
const KEPT_S = 900;
const $ = (id) => document.getElementById(id);
const FIXES = ["no GNSS", "no fix", "2D", "3D", "DGPS", "RTK float", "RTK fixed", "static", "PPP"];

let facts = null;
let latest = null;
let latestMs = 0;
let rows = [];
let lastPhase = null;
let track = 0;

setInterval(age, 100); // first of all: whatever fails below, the page never looks as if it were alive
const controls = new Controls();
const map = new BoatMap($("map"), $("map-picture"), (n, e) => controls.pick(n, e), (n, e) => {
  const boat = latest?.boat;
  if (boat) $("map-cursor").textContent = `${Math.hypot(n - boat.n_m, e - boat.e_m).toFixed(1)} m off the boat; Enter asks to move the station there`;
});
const distance = new Chart($("distance-chart"), "distance", "m", 1, false);
const heading = new Chart($("heading-chart"), "heading error", "deg", 5, true);
const motors = new Motors($("motors"));

// Without the sign of a zero.
const digitsOf = (value, digits) => value.toFixed(digits).replace(/^-(0(?:\.0*)?)$/, "$1");
const show = (value, digits, unit) => (value === null || value === undefined ? "–" : `${digitsOf(value, digits)} ${unit}`);
const showCourse = (degrees) => (degrees === null || degrees === undefined ? "–" : `${Math.round(degrees) % 360}°`);

function take(message) {
  if (message.kind === "boat") {
    facts = controls.facts = message;
    $("name").textContent = facts.name;
    document.title = `${facts.name} – asvhil`;
    controls.show();
  } else if (message.kind === "history") {
    rows = message.rows.map((row) => Object.fromEntries(message.fields.map((name, i) => [name, row[i]])));
    track = message.track;
    $("events").replaceChildren();
  } else if (message.kind === "live") {
    latest = controls.live = message;
    latestMs = performance.now();
    const boat = message.boat;
    if (message.track !== track) rows = []; // in metres from another place
    track = message.track;
    const last = rows.length ? rows[rows.length - 1].t : 0;
    if (!message.stale && boat.n_m !== undefined && message.t - last >= 1) {
      rows.push({ t: message.t, n_m: boat.n_m, e_m: boat.e_m, distance_m: boat.distance_m, heading_error_deg: boat.heading_error_deg });
      rows = rows.filter((row) => row.t > message.t - KEPT_S);
    }
    message.events.forEach(tellEvent);
    controls.showChoices();
    draw();
  }
}

function draw() {
  const { boat, t } = latest;
  const phase = latest.state === "emergency" ? "emergency" : latest.phase ?? "unknown";
  $("phase").dataset.phase = phase;
  $("phase-word").textContent = phase;
  $("reason").textContent = latest.reason;
  if (lastPhase !== `${phase}: ${latest.reason}`) {
    lastPhase = `${phase}: ${latest.reason}`;
    $("announce").textContent = lastPhase;
  }
  $("distance").textContent = show(boat.distance_m, 2, "m");
  $("heading-error").textContent = show(boat.heading_error_deg, 1, "°");
  if (facts && boat.n_m !== undefined) {
    map.draw(latest, rows.filter((row) => row.n_m !== null), facts);
    $("scale").textContent = map.last ? map.scale : "";
    motors.draw(boat, facts);
  }
  distance.draw(t, rows.map((row) => ({ t: row.t, value: row.distance_m })));
  heading.draw(t, rows.map((row) => ({ t: row.t, value: row.heading_error_deg })));
  list($("status"), state());
  notes();
}

function state() {
  const { boat, computer } = latest;
  const known = boat.armed !== undefined;
  const links = latest.notes.find((note) => note.subject === "links");
  const log = latest.notes.find((note) => note.subject === "log");
  const wind = boat.wind_n_mps === null || !known ? "–" : windText(boat);
  const place = latest.station_deg ? `${latest.station_deg.lat.toFixed(7)}, ${latest.station_deg.lon.toFixed(7)}` : "none is held";
  return [
    ["armed", !known || boat.armed === null ? "–" : boat.armed ? "armed" : "not armed"],
    ["mode", (latest.mode || "–").replace(/, (not )?armed$/, "")],
    ["fix", known && boat.fix !== null ? `${FIXES[boat.fix] ?? boat.fix}${boat.satellites === null ? "" : `, ${boat.satellites} satellites`}` : "–"],
    ["battery", known && boat.battery_v !== null ? `${boat.battery_v.toFixed(1)} V${boat.battery_percent === null ? "" : `, ${boat.battery_percent} %`}` : "–"],
    ["heading, speed", known ? `${showCourse(boat.heading_deg)}, ${boat.u_mps === null ? "–" : Math.hypot(boat.u_mps, boat.v_mps).toFixed(2)} m/s` : "–"],
    ["uncertainty", known ? `${show(boat.position_std_m, 2, "m")}, ${show(boat.heading_std_deg, 1, "°")}${boat.estimate_ok === 0 ? ", not valid" : ""}` : "–"],
    ["station", place + motionText(boat)],
    ["docking window", dockingText(boat)],
    ["energy", energyText(boat)],
    ["true wind", wind],
    ["solver", known && boat.solve_iterations !== null ? `${boat.solve_ok ? "solved" : "no solution"}, ${boat.solve_iterations} iterations, ${show(boat.solve_ms, 1, "ms")}` : "–"],
    ["controller", facts?.controller ?? "–"],
    ["sensors", latest.sources.replaceAll(", ", "\n") || "–"],
    ["links", links?.text.replaceAll(", ", "\n") ?? "–"],
    ["recorder", log ? log.text : computer && computer.disk_free_mib !== null ? `recording, ${computer.disk_free_mib} MiB free` : "–"],
    ["computer", computer ? computerText(computer) : "–"],
  ];
}

function motionText(boat) {
  const { speed, toward } = velocityOf(boat);
  return speed ? `\nmoves at ${speed.toFixed(2)} m/s toward ${showCourse(toward)}` : "";
}

function dockingText(boat) {
  if (boat.dock_open === null || boat.dock_open === undefined) return "–";
  if (boat.dock_open === 0) return "not open";
  const likely = [[30, boat.dock_30], [60, boat.dock_60], [150, boat.dock_150]].filter(([, p]) => p !== null);
  const stays = likely.map(([seconds, p]) => `${seconds} s: ${Math.round(100 * p)} %`).join(", ");
  return `open for ${Math.round(boat.dock_open)} s${stays ? `; stays open for another ${stays}` : ""}`;
}

function energyText(boat) {
  const by = boat.w_measured ? "measured" : "curve";
  const parts = [[boat.hold_wh, 1, "Wh in this hold"], [boat.mean_w, 0, `W (${by})`], [boat.hours_left, 1, "h left"]];
  const known = parts.filter(([value]) => value !== null && value !== undefined);
  return known.map(([value, digits, unit]) => `${value.toFixed(digits)} ${unit}`).join(", ") || "–";
}

function windText(boat) {
  const from = (Math.atan2(-boat.wind_e_mps, -boat.wind_n_mps) * 180) / Math.PI;
  const speed = Math.hypot(boat.wind_n_mps, boat.wind_e_mps);
  return `${speed.toFixed(1)} m/s from ${Math.round((from + 360) % 360)}°, gusts to ${(speed + 2 * (boat.wind_std_mps ?? 0)).toFixed(1)}${boat.wind_ok ? "" : " (from the drift)"}`;
}

function computerText(computer) {
  const parts = [["load", computer.load_percent, "%"], ["", computer.temperature_degc, "°C"], ["memory free", computer.ram_free_mib, "MiB"]];
  return parts.filter(([, value]) => value !== null).map(([name, value, unit]) => `${name} ${value} ${unit}`.trim()).join(", ");
}

function list(root, pairs) {
  pairs.forEach(([name, text], i) => {
    let [term, value] = [root.children[2 * i], root.children[2 * i + 1]];
    if (!term) {
      term = root.appendChild(document.createElement("dt"));
      value = root.appendChild(document.createElement("dd"));
      value.id = `state-${name.replace(/\W+/g, "-")}`;
    }
    if (term.textContent !== name) term.textContent = name;
    if (value.textContent !== text) value.textContent = text;
  });
}

function notes() {
  const found = latest.notes.filter((note) => note.subject !== "links" || !note.ok);
  const text = found.map((note) => `${note.ok}${note.subject}: ${note.text}`).join("\n");
  if ($("notes").dataset.text === text) return;
  $("notes").dataset.text = text;
  $("notes").replaceChildren(...(found.length ? found : [{ subject: "none", text: "", ok: true }]).map((note) => {
    const item = document.createElement("li");
    item.textContent = note.text ? `${note.subject}: ${note.text}` : note.subject;
    item.className = note.ok ? "" : "wrong";
    return item;
  }));
}

function tellEvent(event) {
  const item = document.createElement("li");
  const time = document.createElement("time");
  time.textContent = new Date((event.t + latest.behind_s) * 1000).toLocaleTimeString([], { hour12: false });
  item.append(time, event.text);
  if (!event.ok) {
    item.className = "wrong";
    $("announce").textContent = event.text;
  }
  $("events").prepend(item);
  while ($("events").children.length > 200) $("events").lastChild.remove();
}

function age() {
  const silentMs = performance.now() - latestMs;
  const oldMs = (latest?.age_s ?? 0) * 1000 + silentMs;
  let text = "";
  if (!latest) text = "NO DATA: no connection to the dashboard";
  else if (silentMs > OLD_MS) text = `OLD DATA, ${(oldMs / 1000).toFixed(0)} s: the dashboard is silent`;
  else if (latest.age_s === null) text = `NO DATA: ${latest.trouble}`;
  else if (oldMs > OLD_MS) text = `OLD DATA, ${(oldMs / 1000).toFixed(0)} s: the daemon is silent${latest.trouble ? ` (${latest.trouble})` : ""}`;
  const box = $("stale");
  if (box.hidden !== !text) box.hidden = !text;
  if (text && box.textContent !== text) box.textContent = text;
  document.body.classList.toggle("old", Boolean(text));
}

function connect() {
  const address = new URL("live", location.href);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  address.hash = "";
  const socket = new WebSocket(address);
  socket.addEventListener("message", (event) => take(JSON.parse(event.data)));
  socket.addEventListener("close", () => setTimeout(connect, 500));
}

function theme(wanted) {
  const dark = wanted === "dark";
  document.documentElement.dataset.theme = wanted;
  $("theme").textContent = dark ? "Light" : "Dark";
  $("theme").setAttribute("aria-label", dark ? "Light colours" : "Dark colours");
}

$("theme").addEventListener("click", () => {
  const wanted = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
  keep("localStorage", "theme", wanted);
  theme(wanted);
});
$("nearer").addEventListener("click", () => map.zoom(0.5));
$("farther").addEventListener("click", () => map.zoom(2));
$("fit").addEventListener("click", () => map.fit());
$("confirm").addEventListener("close", () => {
  map.drop();
  $("map-cursor").textContent = "";
});
theme(recall("localStorage", "theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
controls.show();
connect();
