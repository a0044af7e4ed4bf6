// Commands, episodes, tuning and the journal: what a person asks for, and what came of it.

import { plain, short } from "./panels.js";

const el = (id) => document.getElementById(id);
const HINTS = {
  engage: "Align where needed, then couple the pairs once all axes stand",
  clutch: "Let go: the master is free, the slave is held",
  hold: "Hold every axis by certified damping",
  rest: "Back to idle; acknowledges a fault",
};

const NO_TOKEN = "without the token one may only look, and stop: open the address that was printed";
const MAX_ENTRIES = 200;

function entryItem(entry, again, mark) {
  const item = document.createElement("li");
  const time = document.createElement("time");
  time.textContent = `${entry.at_s.toFixed(2)} s`;
  if (entry.word === "fault" || entry.word === "blocked" || entry.refused) item.className = "bad";
  if (mark) item.classList.add("cause");
  const said = entry.text ? `: ${entry.text}` : "";
  item.append(time, `${mark ? `${mark}, ` : ""}${entry.word} (${entry.source})${said}${again}`);
  return item;
}

export class Controls {
  constructor(facts, send) {
    this.facts = facts;
    this.send = send;
    this.may = facts.may;
    this.cut = ""; // why nothing can be asked of the run now
    this.state = null;
    this.episode = 0;
    this.faults = null;
    this.faulted = false;
    this.kinds = new Map();
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
    el("tuning").oninput = () => this.enable();
    this.enable();
  }

  button(word) {
    const button = document.createElement("button");
    button.textContent = word;
    button.dataset.word = word;
    button.onclick = () => this.command(word);
    return button;
  }

  scaleButton(scale) {
    const button = document.createElement("button");
    button.textContent = plain(scale);
    button.dataset.hint = "The slave's motion times this, from where it is; the journal says whether the pairs let go for it";
    button.value = scale;
    button.onclick = () => this.command(`scale ${scale}`);
    return button;
  }

  command(line) {
    this.send({ op: "command", line });
  }

  reach(why) {
    this.cut = why;
    this.enable();
  }

  allow(may) {
    this.may = may;
    this.enable();
  }

  // The state as the newest row has it.
  show(state, episode, scale, person) {
    for (const button of this.scales) button.classList.toggle("on", Number(button.value) === scale);
    if (state === this.state && episode === this.episode && person === this.person) return;
    if (this.state !== null && state !== this.state) this.beep(state);
    this.state = state;
    this.episode = episode;
    this.person = person;
    this.enable();
  }

  leadsAlready(word) {
    return word === (this.person ? "take_over" : "hand_back");
  }

  // Why every command would be refused now.
  barred() {
    return this.cut || (this.may ? "" : NO_TOKEN);
  }

  // Why a command would be refused now, "" where it would not.
  refusal(word) {
    const barred = this.barred();
    if (barred) return barred;
    if (this.leadsAlready(word)) return this.facts.leads_already[word];
    if (word === "engage" && this.faulted) return this.facts.after_fault;
    return this.facts.refusals[this.state]?.[word] ?? "";
  }

  enable() {
    const words = [];
    const set = (button, why, word) => {
      button.disabled = Boolean(why);
      button.title = why || (HINTS[word] ?? button.dataset.hint ?? "");
      if (why && word) words.push(word);
    };
    for (const button of el("commands").children) set(button, this.refusal(button.dataset.word), button.dataset.word);
    for (const button of this.scales) set(button, this.refusal("scale"));
    const none = this.episode ? "" : "episode success, failed: no episode is running";
    const runs = this.episode ? `episode ${this.episode} is running; end it first, with success or failed` : this.refusal("episode");
    const barred = this.barred();
    set(el("episode-begin"), barred || runs, this.episode ? "" : "episode");
    for (const id of ["episode-success", "episode-failed"]) set(el(id), barred || none);
    set(el("apply"), barred || (this.asked().length ? "" : "write a new value first"));
    const why = [];
    if (barred) {
      why.push(barred);
    } else {
      if (this.faulted) why.push(this.facts.after_fault);
      const others = words.filter((word) => !(this.faulted && word === "engage") && !this.leadsAlready(word));
      why.push(...words.filter((word) => this.leadsAlready(word)).map((word) => this.facts.leads_already[word]));
      if (others.length) why.push(`not possible while ${this.state}: ${others.join(", ")}`);
      if (this.facts.dead_men.length) why.push(`engages only while held: ${this.facts.dead_men.join(", ")}`);
    }
    el("why").replaceChildren(...why.map((text) => {
      const item = document.createElement("li");
      item.textContent = text;
      return item;
    }));
  }

  // -- journal ------------------------------------------------------------------------------

  // What came since: counts, kinds of entries, and the first cause of what is not acknowledged.
  soFar(said) {
    for (const [place, entry, times, last] of said.kinds) this.kinds.set(place, { entry, times, last });
    if (said.faulted !== this.faulted) {
      this.faulted = said.faulted;
      this.enable();
    }
    if (this.faults !== null && said.faults > this.faults) this.beep("fault");
    this.faults = said.faults;
    if (!said.kinds.length && this.cause === said.cause?.at_s) return;
    this.cause = said.cause?.at_s;
    const shown = ({ entry, times }) => times > 1 || entry.at_s !== said.cause?.at_s; // the cause is on top
    const newest = [...this.kinds.values()].filter(shown).sort((a, b) => b.last - a.last).slice(0, MAX_ENTRIES);
    const items = newest.map(({ entry, times, last }) => entryItem(entry, times > 1 ? ` (x ${times}, last ${last.toFixed(2)} s)` : ""));
    if (said.cause) items.unshift(entryItem(said.cause, "", "first cause"));
    el("entries").replaceChildren(...items);
    el("news").hidden = !items.length;
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
      this.send({ op: "tune", values: Object.fromEntries(this.asked()) });
    };
  }

  // New values that were written, by path.
  asked() {
    return this.rows.filter(({ input }) => input?.value).map(({ one, input }) => [one.path, Number(input.value)]);
  }

  tuned() {
    for (const { input } of this.rows) if (input) input.value = "";
    this.enable();
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
