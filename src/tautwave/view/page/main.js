// The page of a run: one socket in, and what it brings given to scope, drawing and buttons.

import { Controls } from "./controls.js";
import { Figures } from "./figures.js";
import { Schematic } from "./schematic.js";
import { Scope } from "./scope.js";
import { Store } from "./store.js";

const el = (id) => document.getElementById(id);
const HEADER = 2; // floats before the rows of a message

// The token comes behind #, which is not sent to the server; it is kept for reloading, out of sight.
const token = location.hash.slice(1) || sessionStorage.getItem("token") || "";
sessionStorage.setItem("token", token);
history.replaceState(null, "", location.pathname);

const app = { ended: false, hear: (said) => hear[said.op](said), showState, showCertificate };
window.tautwave = app; // for scripts and for the curious

function note(text, kind) {
  el("note").textContent = text;
  el("note").className = kind;
  el("note").hidden = !text;
}

function badge(id, text, kind) {
  el(id).textContent = text;
  el(id).className = `badge ${kind ?? ""}`;
  el(id).hidden = !text;
}

// How a state is seen: a rig that does what was asked, one that waits, one that is kept from it.
const LEVELS = { running: "good", engaged: "good", holding: "note" };
const CERTIFIED = { ok: "good", note: "note", bad: "bad" };

function showState(state) {
  const faulted = app.soFar?.faulted;
  if (app.ended) badge("state", "");
  else badge("state", faulted ? `${state} after a fault` : state, faulted ? "bad" : LEVELS[state]);
}

function showCertificate(certificate) {
  if (!certificate) return;
  const text = `${certificate.require.replaceAll("_", " ")}: ${certificate.state}`;
  badge("certificate", certificate.severity === "bad" ? "not certified" : text, CERTIFIED[certificate.severity]);
  el("certificate").title = certificate.sentences.join("\n");
}

function begin(facts) {
  app.facts = facts;
  app.store = new Store(facts.columns, facts.rate_hz);
  app.scope = new Scope(app.store, facts);
  app.schematic = new Schematic(el("schematic"), app.store, facts);
  app.figures = new Figures(el("figures"), app.store, facts, send);
  app.controls = new Controls(facts, send);
  document.title = `${facts.rig} – tautwave`;
  el("rig").textContent = facts.rig;
  el("rig").title = facts.rig;
  showCertificate(facts.certificate);
  el("pair").replaceChildren(...facts.pairs.map((pair, at) => new Option(pair.name, at)));
  el("pair").hidden = facts.pairs.length < 2;
  el("pair").onchange = () => {
    const pair = facts.pairs[Number(el("pair").value)];
    app.schematic.show(pair);
    app.scope.show(pair);
    app.figures.show(pair);
  };
  app.schematic.show(facts.pairs[0]);
}

// Engaged time, faults, stops and cut-off moments, as the server has counted them.
function soFar(said) {
  app.soFar = said;
  app.controls?.soFar(said);
  const times = (count, noun) => (count ? [`${count} ${noun}${count === 1 ? "" : "s"}`] : []);
  const parts = [...times(said.faults, "fault"), ...times(said.stops, "stop")];
  if (said.cut_off) parts.push(`cut off ${times(said.cut_off, "time")}`);
  badge("events", parts.join(", "), said.faulted ? "bad" : said.faults || said.cut_off ? "note" : "");
  el("events").title = said.cause ? said.cause.text : "";
}

// The sound of a run that has ended, to be heard as often as wanted.
async function playable(said) {
  const bytes = Uint8Array.from(atob(said.wav), (letter) => letter.charCodeAt(0));
  app.audio ??= new AudioContext();
  try {
    app.heard = await app.audio.decodeAudioData(bytes.buffer);
  } catch (error) {
    return note(`The sound could not be read (${error.message}); it is output.wav in ${said.directory}.`, "refused");
  }
  tellEnd(said.directory);
  const button = el("listen");
  button.textContent = `play the sound (${app.heard.duration.toFixed(1)} s)`;
  button.hidden = false;
  button.onclick = () => {
    app.playing?.stop();
    app.playing = new AudioBufferSourceNode(app.audio, { buffer: app.heard });
    app.playing.connect(app.audio.destination);
    app.audio.resume();
    app.playing.start();
  };
}

function tellEnd(directory) {
  const cause = app.soFar?.faulted ? app.soFar.cause.text : "";
  const scene = app.facts?.pointer && !app.facts.pairs.length;
  const sound = app.heard ? "Its sound can be played below the picture. " : "Its sound comes in some seconds. ";
  const kept = `What is seen here can still be saved; tautwave report ${directory} has everything.`;
  note(`The run has ended${cause ? `: ${cause}` : ""}. ${scene ? sound : ""}${kept}`, cause ? "refused" : "done");
}

function engagedTime(now) {
  const { soFar: said } = app;
  if (!said?.operated || said.from_s === null) return [];
  const whole = now - said.from_s;
  const since = said.from_s > 1 ? ` since ${said.from_s.toFixed(0)} s` : "";
  if (!said.engaged_s) return [`never engaged${since}`];
  return [`engaged ${said.engaged_s.toFixed(1)} of ${whole.toFixed(1)} s${since}`];
}

function rows(buffer) {
  const numbers = new Float64Array(buffer);
  app.store.push(numbers[0], numbers[1], numbers.subarray(HEADER));
}

const hear = {
  hello: begin,
  may: (said) => app.controls?.allow(said.may),
  so_far: soFar,
  drawn: (said) => app.figures?.pose(said.arms),
  note: (said) => note(said.text, said.kind),
  tuned: (said) => { note(said.text, "done"); app.controls.tuned(); },
  sound: playable,
  ended: (said) => {
    app.ended = true;
    badge("state", "");
    badge("link", "the run has ended", "");
    tellEnd(said.directory);
    reachable();
    app.scope?.pause();
  },
};

// Why nothing can be asked of the run now, "" where it can.
function cut() {
  if (app.ended) return "the run has ended";
  return app.socket?.readyState === WebSocket.OPEN ? "" : "no connection to the run";
}

function send(fields) {
  const why = cut();
  if (!why) app.socket.send(JSON.stringify(fields));
  else if (fields.op !== "pointer") note(`not sent: ${why}`, "refused");
}

function reachable() {
  const why = cut();
  el("stop").disabled = Boolean(why);
  el("stop").title = why || "Ramp down and end the run; anyone may";
  app.controls?.reach(why);
}

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  app.socket = socket;
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    badge("link", "connected", "good");
    reachable();
    socket.send(JSON.stringify({ op: "hello", token }));
  };
  socket.onmessage = (event) => {
    if (typeof event.data === "string") {
      const said = JSON.parse(event.data);
      hear[said.op]?.(said);
    } else {
      rows(event.data);
    }
  };
  socket.onclose = () => {
    if (app.ended) return;
    badge("link", "no connection", "bad");
    reachable();
    setTimeout(connect, 1000);
  };
}

let slow = 0;
function frame(now) {
  requestAnimationFrame(frame);
  if (!app.store?.end) return;
  app.scope.draw();
  app.figures.draw();
  if (now < slow) return;
  slow = now + 100; // numbers that change faster cannot be read
  const { store, facts } = app;
  const code = store.newest("operation.state");
  const state = code === undefined ? "running" : facts.states[code];
  showState(state);
  app.controls.show(state, store.newest("operation.episode") ?? 0, store.newest("operation.scale"), store.newest("operation.intervention"));
  app.controls.showTuning(store);
  app.schematic.draw();
  const episode = store.newest("operation.episode");
  const at = store.newest("time_s");
  const parts = [`${at.toFixed(1)} s`, ...engagedTime(at), `${facts.rate_hz} Hz`, `late ${store.newest("lateness_us")?.toFixed(0)} µs`];
  if (episode) parts.push(`episode ${episode}`);
  if (store.missed) parts.push(`${store.missed} rows not seen`);
  if (!app.controls.may) parts.push("looking only");
  el("health").textContent = parts.join(" · ");
}

el("stop").onclick = () => send({ op: "command", line: "stop" });
document.addEventListener("keydown", (event) => {
  if (event.target.matches("input, select, textarea")) return;
  if (event.key === "Escape") el("pause").click();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => app.scope?.rebuild());
connect();
requestAnimationFrame(frame);
