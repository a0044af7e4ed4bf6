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

const app = { ended: false, hearSoFar: soFar };
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
  const certificate = facts.certificate;
  if (certificate) {
    const good = certificate.passed === true;
    badge("certificate", good ? `${certificate.require.replaceAll("_", " ")}: ${certificate.state}` : "not certified", good ? "good" : "bad");
    el("certificate").title = certificate.sentences.join("\n");
  }
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
  badge("events", parts.join(", "), said.faults || said.cut_off ? "bad" : "");
  el("events").title = said.cause ? said.cause.text : "";
}

// The sound of a run that has ended, to be heard as often as wanted.
async function playable(said) {
  const bytes = Uint8Array.from(atob(said.wav), (letter) => letter.charCodeAt(0));
  app.audio ??= new AudioContext();
  app.heard = await app.audio.decodeAudioData(bytes.buffer);
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
    note(`The run has ended. ${app.facts?.pointer && !app.facts.pairs.length ? "Its sound comes in some seconds. " : ""}What is seen here can still be saved; tautwave report ${said.directory} has everything.`, "done");
    app.scope?.pause();
  },
};

function send(fields) {
  if (app.socket?.readyState === WebSocket.OPEN) app.socket.send(JSON.stringify(fields));
  else note("not sent: no connection to the run", "refused");
}

function connect() {
  const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`);
  app.socket = socket;
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    badge("link", "connected", "good");
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
  if (!app.ended) badge("state", app.soFar?.faulted ? `${state} after a fault` : state, app.soFar?.faulted ? "bad" : state === "engaged" || state === "running" ? "good" : "");
  app.controls.show(state, store.newest("operation.episode") ?? 0, store.newest("operation.scale"));
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
