// The scope: what part of time is seen, trigger, cursors, and saving what is seen.

import { Panel, colour, groupsOf, short } from "./panels.js";
import { Trigger } from "./trigger.js";

const SPANS = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60];
const el = (id) => document.getElementById(id);

export class Scope {
  constructor(store, facts) {
    this.store = store;
    this.facts = facts;
    this.trigger = new Trigger();
    this.view = { from: 0, to: 5 };
    this.running = true;
    this.zoomed = false;
    this.cursors = { a: null, b: null };
    this.drawn = 0; // rows that have been on the screen
    this.dirty = true;
    this.fillControls();
    this.show(facts.pairs[0]);
  }

  get span() {
    return Number(el("span").value);
  }

  show(pair) {
    el("panels").replaceChildren();
    this.panels = groupsOf(this.facts, pair)
      .map((group) => new Panel(el("panels"), this.store, group, this));
    this.dirty = true;
  }

  rebuild() {
    this.panels?.forEach((panel) => panel.build());
    this.dirty = true;
  }

  fillControls() {
    const keep = this.store.room / this.facts.rate_hz;
    el("span").replaceChildren(...SPANS.filter((s) => s <= keep).map((s) => new Option(`${s} s`, s, false, s === 5)));
    el("trigger-source").replaceChildren(...this.facts.columns.map((name, at) => new Option(name, at)));
    const first = this.facts.pairs[0];
    const source = first ? this.facts.columns.indexOf(`master.${first.name}.position`) : 0;
    el("trigger-source").value = Math.max(0, source);
    for (const id of ["mode", "source", "edge", "level", "hysteresis", "before"]) {
      el(`trigger-${id}`).onchange = () => this.setTrigger();
    }
    el("span").onchange = () => { this.zoomed = false; this.dirty = true; };
    el("run").onclick = () => this.go("off" === this.trigger.mode ? undefined : this.trigger.mode);
    el("pause").onclick = () => this.pause();
    el("single").onclick = () => this.single();
    addEventListener("resize", () => { this.dirty = true; }); // paused, too
    el("all").onclick = () => { this.zoomed = false; this.dirty = true; if (!this.running) this.unzoom(); };
    el("clear").onclick = () => { this.cursors = { a: null, b: null }; this.dirty = true; };
    el("png").onclick = () => this.savePng();
    el("csv").onclick = () => this.saveCsv();
  }

  setTrigger() {
    const t = this.trigger;
    t.mode = el("trigger-mode").value;
    t.source = Number(el("trigger-source").value);
    t.edge = el("trigger-edge").value;
    t.level = Number(el("trigger-level").value) || 0;
    t.hysteresis = Math.abs(Number(el("trigger-hysteresis").value)) || 0;
    t.before = Math.min(100, Math.max(0, Number(el("trigger-before").value))) / 100;
    el("trigger-keys").hidden = t.mode === "off";
    this.go();
  }

  mark(which) {
    for (const id of ["run", "pause", "single"]) el(id).classList.toggle("on", id === which);
  }

  go() {
    this.trigger.reset(this.store.end);
    this.running = true;
    this.zoomed = false;
    this.mark("run");
    this.dirty = true;
  }

  pause() {
    this.running = false;
    this.mark("pause");
    this.dirty = true;
  }

  single() {
    if (this.trigger.mode === "off" || this.trigger.mode === "auto") el("trigger-mode").value = "once";
    this.setTrigger();
    this.trigger.mode = "once";
    this.mark("single");
  }

  zoom(from, to) {
    const least = 4 / this.facts.rate_hz;
    if (!(to - from > least)) return;
    this.whole ??= { ...this.view };
    if (this.running) this.pause();
    this.zoomed = true;
    this.view = { from, to };
    this.dirty = true;
  }

  unzoom() {
    if (this.whole) this.view = this.whole;
    this.whole = null;
  }

  setCursor(which, at) {
    this.cursors[which] = at;
    this.dirty = true;
  }

  // Called for each picture; does nothing if there is nothing new.
  draw() {
    const { store, trigger } = this;
    if (!store.end) return;
    if (this.running) {
      if (store.end === this.drawn && !this.dirty) return;
      const rows = this.span * this.facts.rate_hz;
      trigger.look(store, store.end, rows);
      if (trigger.waits(store.end, rows)) {
        if (trigger.hit !== null) {
          const at = store.timeOf(trigger.hit);
          this.view = { from: at - trigger.before * this.span, to: at + (1 - trigger.before) * this.span };
        }
        if (trigger.done) this.pause();
      } else {
        const from = Math.max(store.timeOf(store.begin), store.timeOf(store.end - 1) - this.span);
        this.view = { from, to: from + this.span };
      }
      this.whole = null;
      this.tellTrigger();
    } else if (!this.dirty) {
      return;
    }
    this.drawn = store.end;
    this.dirty = false;
    const { a, b } = this.cursors;
    el("cursor-state").textContent = a === null || b === null ? "" : `B − A: ${short(b - a)} s, ${short(1 / Math.abs(b - a))} Hz`;
    const from = Math.max(store.begin, store.rowAt(this.view.from) - 1);
    const to = Math.min(store.end, store.rowAt(this.view.to) + 1);
    for (const panel of this.panels) {
      panel.draw(from, to);
      panel.showValues(this.valueRows());
    }
  }

  valueRows() {
    const { a, b } = this.cursors;
    if (a === null && b === null) return [this.running ? this.store.end - 1 : Math.min(this.store.end - 1, this.store.rowAt(this.view.to))];
    const rows = [a, b].filter((at) => at !== null).map((at) => Math.min(this.store.end - 1, this.store.rowAt(at)));
    return rows;
  }

  tellTrigger() {
    const t = this.trigger;
    el("trigger-state").textContent = t.hit === null ? "waiting" : `at ${this.store.timeOf(t.hit).toFixed(4)} s`;
  }

  drawMarks(u) {
    const marks = [
      [this.cursors.a, "--soft", "A"], [this.cursors.b, "--soft", "B"],
      [this.trigger.mode !== "off" && this.trigger.hit !== null ? this.store.timeOf(this.trigger.hit) : null, "--limit", "T"],
    ];
    const { ctx, bbox } = u;
    for (const [at, variable, name] of marks) {
      if (at === null || at < this.view.from || at > this.view.to) continue;
      const x = Math.round(u.valToPos(at, "x", true));
      ctx.save();
      ctx.strokeStyle = ctx.fillStyle = colour(variable);
      ctx.lineWidth = devicePixelRatio;
      ctx.setLineDash([4 * devicePixelRatio, 3 * devicePixelRatio]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
      ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
      ctx.fillText(name, x + 3 * devicePixelRatio, bbox.top + 11 * devicePixelRatio);
      ctx.restore();
    }
  }

  picture() {
    const scale = devicePixelRatio;
    const head = 22 * scale;
    const plots = this.panels.map((panel) => panel.plot.ctx.canvas);
    const canvas = document.createElement("canvas");
    canvas.width = Math.max(...plots.map((plot) => plot.width));
    canvas.height = plots.reduce((sum, plot) => sum + plot.height + head, 0);
    const ctx = canvas.getContext("2d");
    ctx.fillStyle = colour("--paper");
    ctx.fillRect(0, 0, canvas.width, canvas.height);
    let top = 0;
    this.panels.forEach((panel, i) => {
      let x = 8 * scale;
      const write = (text, variable, bold) => {
        ctx.font = `${bold ? "bold " : ""}${12 * scale}px system-ui, sans-serif`;
        ctx.fillStyle = colour(variable);
        ctx.fillText(text, x, top + 15 * scale);
        x += ctx.measureText(text).width + 14 * scale;
      };
      write(`${panel.group.title} [${panel.group.unit}]`, "--ink", true);
      panel.group.names.forEach((name, n) => write(name, panel.styles[n].variable, false));
      ctx.drawImage(plots[i], 0, top + head);
      top += plots[i].height + head;
    });
    return canvas;
  }

  savePng() {
    this.picture().toBlob((blob) => this.save(blob, "png"));
  }

  // The rows that are seen, at the full rate, of the columns that are seen.
  csv() {
    const names = ["time_s", ...new Set(this.panels.flatMap((panel) => panel.group.names))];
    const columns = names.map((name) => this.facts.columns.indexOf(name));
    const lines = [names.join(",")];
    const to = this.store.rowAt(this.view.to + 1e-9);
    for (let row = this.store.rowAt(this.view.from); row < to; row++) {
      lines.push(columns.map((c) => this.store.value(c, row)).join(","));
    }
    return `${lines.join("\n")}\n`;
  }

  saveCsv() {
    this.save(new Blob([this.csv()], { type: "text/csv" }), "csv");
  }

  save(blob, suffix) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `${this.facts.rig.replace(/[^\w.-]+/g, "-") || "run"}-${this.view.from.toFixed(3)}s.${suffix}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }
}
