// Commands, episodes, tuning and the journal: what a person asks for, and what came of it.

import { plain, short } from "./panels.js";

const el = (id) => document.getElementById(id);
const HINTS = {
  engage: "Align where needed, then couple the pairs once all axes stand",
  clutch: "Let go: the master is free, the slave is held",
  hold: "Hold every axis by certified damping",
  rest: "Back to idle; acknowledges a fault",
};

export class Controls {
  constructor(facts, send) {
    this.facts = facts;
    this.send = send;
    this.may = facts.may;
    this.state = null;
    this.episode = 0;
    this.seen = 0;
    this.operated = facts.commands.length > 1;
    el("operate").hidden = !this.operated;
    el("commands").replaceChildren(
      ...facts.commands.filter((word) => !["stop", "scale", "episode"].includes(word)).map((word) => this.button(word)),
    );
    el("scales").hidden = !facts.commands.includes("scale");
    this.scales = facts.scales.map((scale) => this.scaleButton(scale));
    el("scales").querySelector(".group").replaceChildren(...this.scales);
    el("episode").onsubmit = (event) => {
      event.preventDefault();
      const name = el("episode-name").value.trim().replace(/\s+/g, "-");
      const task = el("episode-task").value.trim();
      this.command(`episode ${name || (task && "episode")} ${task}`.trim());
    };
    el("episode-success").onclick = () => this.command("episode success");
    el("episode-failed").onclick = () => this.command("episode failed");
    this.fillTuning();
    this.enable();
  }

  button(word) {
    const button = document.createElement("button");
    button.textContent = word;
    button.title = HINTS[word] ?? "";
    button.dataset.word = word;
    button.onclick = () => this.command(word);
    return button;
  }

  scaleButton(scale) {
    const button = document.createElement("button");
    button.textContent = plain(scale);
    button.title = "The slave's motion times this, from where it is; the journal says whether the pairs let go for it";
    button.value = scale;
    button.onclick = () => this.command(`scale ${scale}`);
    return button;
  }

  command(line) {
    this.send({ op: "command", line });
  }

  allow(may) {
    this.may = may;
    this.enable();
  }

  // The state as the newest row has it.
  show(state, episode, scale) {
    for (const button of this.scales) button.classList.toggle("on", Number(button.value) === scale);
    if (state === this.state && episode === this.episode) return;
    if (this.state !== null && state !== this.state) this.beep(state);
    this.state = state;
    this.episode = episode;
    this.enable();
  }

  enable() {
    const possible = this.facts.possible[this.state] ?? [];
    for (const button of el("commands").children) {
      button.disabled = !this.may || !possible.includes(button.dataset.word);
    }
    for (const button of this.scales) button.disabled = !this.may || !possible.includes("scale");
    el("episode-begin").disabled = !this.may || this.episode > 0;
    for (const id of ["episode-success", "episode-failed"]) el(id).disabled = !this.may || !this.episode;
    el("apply").disabled = !this.may;
  }

  // -- journal ------------------------------------------------------------------------------

  news(entries) {
    for (const [number, entry] of entries) {
      if (number <= this.seen) continue;
      this.seen = number;
      const item = document.createElement("li");
      const time = document.createElement("time");
      time.textContent = `${entry.at_s.toFixed(2)} s`;
      const said = entry.text ? `: ${entry.text}` : "";
      const bad = entry.word === "fault" || entry.word === "blocked" || entry.refused;
      if (bad) item.className = "bad";
      item.append(time, `${entry.word} (${entry.source})${said}`);
      el("entries").prepend(item);
      if (entry.word === "fault") this.beep("fault");
    }
    while (el("entries").children.length > 200) el("entries").lastChild.remove();
    el("news").hidden = !el("entries").children.length;
  }

  // -- tuning -------------------------------------------------------------------------------

  fillTuning() {
    const tunables = this.facts.tunables ?? [];
    el("tuning").hidden = !tunables.length;
    this.rows = tunables.map((one) => {
      const row = document.createElement("tr");
      const name = document.createElement("td");
      name.textContent = one.path.replace(/^coupling\.pairs\./, "");
      const when = document.createElement("div");
      when.className = "small";
      when.textContent = one.column ? `${one.when}, ${plain(one.low)} to ${plain(one.high)} ${one.unit}` : one.when;
      name.append(when);
      const now = document.createElement("td");
      now.textContent = one.column ? "" : String(one.value);
      const cell = document.createElement("td");
      let input = null;
      if (one.column) {
        input = document.createElement("input");
        input.type = "number";
        input.step = "any";
        input.setAttribute("aria-label", one.path);
        cell.append(input);
      } else {
        row.className = "fixed";
      }
      row.append(name, now, cell);
      return { one, row, now, input };
    });
    el("tunables").replaceChildren(...this.rows.map((row) => row.row));
    el("tuning").querySelector("form").onsubmit = (event) => {
      event.preventDefault();
      const values = {};
      for (const { one, input } of this.rows) {
        if (input && input.value !== "") values[one.path] = Number(input.value);
      }
      this.send({ op: "tune", values });
    };
  }

  tuned() {
    for (const { input } of this.rows) if (input) input.value = "";
  }

  showTuning(store) {
    for (const { one, now } of this.rows) {
      const value = store.newest(one.column);
      if (value !== undefined) now.textContent = plain(value);
    }
  }

  // -- sounds -------------------------------------------------------------------------------

  beep(what) {
    const tones = { engaged: [660, 880], clutched: [660, 440], fault: [220, 220, 220], holding: [440] }[what];
    if (!tones || !el("sound").checked) return;
    this.audio ??= new AudioContext();
    tones.forEach((hertz, n) => {
      const tone = this.audio.createOscillator();
      const gain = this.audio.createGain();
      gain.gain.value = 0.08;
      tone.frequency.value = hertz;
      tone.connect(gain).connect(this.audio.destination);
      tone.start(this.audio.currentTime + 0.13 * n);
      tone.stop(this.audio.currentTime + 0.13 * n + 0.1);
    });
  }
}
