// What changes something on the boat: with a token, and after a second word.

import { NO_TOKEN, forgetToken, keepToken, keptToken, tokenOfAddress } from "./token.js";

const STOPPING = ["neutral", "release"];
const AGAIN_MS = 3000;
const CHOICES = {
  policy: (words) => `Have the heading follow ${words}? The boat may turn.`,
  effort: (words) => `Keep the station with ${words} effort?`,
};
const $ = (id) => document.getElementById(id);

export class Controls {
  constructor() {
    this.facts = null;
    this.live = null;
    this.take();
    this.neutralTimer = null; // runs while the next press sends
    this.waiting = new Set(); // what ends each request that is under way
    window.addEventListener("hashchange", () => {
      this.take();
      this.show();
    });
    $("token-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.unlock($("token").value.trim());
      $("token").value = "";
      this.show();
    });
    $("neutral").addEventListener("click", () => this.neutral());
    $("hold").addEventListener("click", () => this.confirm("Hold the boat where it is now? The motors start.", { action: "hold" }));
    $("release").addEventListener("click", () => this.confirm("Release the motors to the pilot? The boat drifts, or obeys the sticks.", { action: "release" }));
    $("heading-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const heading = Number($("heading-wish").value);
      this.confirmStation(`Turn the station to a heading of ${heading}°?`, { action: "heading", heading_deg: heading });
    });
    $("drift-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const [speed, course, way] = ["speed", "course", "way"].map((name) => Number($(`drift-${name}`).value));
      const end = way > 0 ? `for ${way} m` : "until told otherwise";
      this.confirmStation(`Have the station move at ${speed} m/s toward ${course}°, ${end}? The boat goes with it.`,
        { action: "drift", speed_mps: speed, course_deg: course, way_m: way });
    });
    $("follow-form").addEventListener("submit", (event) => {
      event.preventDefault();
      const system = Number($("follow-system").value);
      this.confirmStation(`Have the station follow system ${system}, by its FOLLOW_TARGET messages? The boat goes with it.`,
        { action: "follow", system_id: system });
    });
    $("stay").addEventListener("click", () => this.confirmStation("Have the station stay where it is now?", { action: "stay" }));
    for (const [name, question] of Object.entries(CHOICES)) {
      $(name).addEventListener("change", () => this.confirm(question($(name).selectedOptions[0].textContent), { action: name, [name]: $(name).value }));
    }
    $("confirm-no").addEventListener("click", () => $("confirm").close());
    $("confirm-yes").addEventListener("click", () => { $("confirm").close(); this.send(this.asked); });
  }

  // The token of the address stays out of the history, and of what is shown or shared.
  take() {
    const found = tokenOfAddress(location.hash);
    if (found !== null) {
      history.replaceState(null, "", location.pathname + location.search);
      this.unlock(found);
    } else this.token = keptToken();
  }

  // What is no token is told at once, and that of before stays.
  unlock(text) {
    const good = keepToken(text);
    this.token = keptToken();
    this.say(good ? "" : NO_TOKEN, good);
  }

  get open() { return Boolean(this.facts?.controllable && this.token); }

  show() {
    for (const id of ["neutral", "hold", "release", "heading", "drift", "stay", "follow"]) $(id).disabled = !this.open;
    this.showChoices();
    $("token-form").hidden = this.open || !this.facts?.controllable;
    $("locked").textContent = this.lockedWords();
  }

  // Why the controls are shut, and what opens them.
  lockedWords() {
    if (!this.facts || this.open) return "";
    if (!this.facts.controllable) return "This page only shows: it was started without controls.";
    return this.facts.token_in_file ? "The token stands in the file that asvhil dashboard was given with --token-file." :
      "The token stands on the terminal of asvhil dashboard.";
  }

  // What is in force, unless a question about it is open; a daemon without such a choice leaves it closed.
  showChoices() {
    if ($("confirm").open) return;
    for (const name of Object.keys(CHOICES)) {
      const now = this.live?.choices[name] ?? null;
      $(name).disabled = !this.open || now === null;
      if (now !== null && $(name).value !== now) $(name).value = now;
    }
  }

  // Whether there is anything to confirm.
  pick(n, e) {
    const boat = this.live?.boat;
    if (!this.open || !boat || boat.station_n_m === null) {
      this.say(this.open ? "No station is held: hold first, then move it." : "Locked: the station is moved with the token.", false);
      return false;
    }
    if (this.live.leader) {
      this.say(`The station follows system ${this.live.leader}: have it stay, then move it.`, false);
      return false;
    }
    const away = Math.hypot(n - boat.n_m, e - boat.e_m);
    const far = this.facts.farthest_m;
    const warn = away > far ? ` That is beyond the ${far} m of the config, and will be refused.` : "";
    this.confirm(`Move the station to ${away.toFixed(1)} m from the boat?${warn}`, { action: "move", n_m: n, e_m: e });
    return true;
  }

  // What is asked of the station: where none is held there is nothing to ask.
  confirmStation(text, body) {
    if (typeof this.live?.boat.station_n_m !== "number") this.say("No station is held: hold first, then have it move or turn.", false);
    else this.confirm(text, body);
  }

  // An emergency has no time for a dialog: pressed twice.
  neutral() {
    if (this.neutralTimer !== null) {
      this.settle();
      return this.send({ action: "neutral" });
    }
    $("neutral").textContent = "Press again: neutral";
    this.neutralTimer = setTimeout(() => this.settle(), AGAIN_MS);
  }

  settle() {
    clearTimeout(this.neutralTimer);
    this.neutralTimer = null;
    $("neutral").textContent = "Neutral now";
  }

  confirm(text, body) {
    this.asked = body;
    $("confirm-text").textContent = text;
    $("confirm").showModal();
    $("confirm-no").focus();
  }

  async send(body) {
    this.say(`${body.action}: asked …`, true);
    // A browser sends some six requests at a time: what stops the motors must not wait for one of them.
    if (STOPPING.includes(body.action)) for (const other of this.waiting) other.abort();
    const end = new AbortController();
    this.waiting.add(end);
    try {
      const answer = await fetch("control", {
        method: "POST",
        signal: end.signal,
        headers: { "Content-Type": "application/json", Authorization: `Bearer ${this.token}` },
        body: JSON.stringify(body),
      });
      const said = await answer.json();
      if (answer.status === 403) {
        this.token = "";
        forgetToken();
        this.show();
      }
      this.say(`${body.action}: ${said.words ?? said.error}`, answer.ok);
    } catch {
      if (!end.signal.aborted) this.say(`${body.action}: the dashboard does not answer`, false);
    } finally {
      this.waiting.delete(end);
    }
  }

  say(text, ok) {
    $("answer").textContent = text;
    $("answer").classList.toggle("wrong", !ok);
  }
}
