// The scope's panels: which columns, how they are drawn, their values at the cursors.

const OTHER = ["--line", "--wall", "--filter", "--damper", "--limit", "--soft"];
const HEIGHT = 150;
const FLAT = 0.01; // of a line that does not move, what is seen above and below it

export function colour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

// Colour by what a column belongs to, as in the figures of a report: master blue, slave vermilion.
function styleOf(name, used) {
  const side = /(^|[._])(master|slave)([._]|$)/.exec(name)?.[2];
  const wanted = /wall/.test(name) ? "--wall" : /\.line\./.test(name) ? "--line" : side ? `--${side}` : OTHER[used.size % OTHER.length];
  const dashed = used.has(wanted);
  used.add(wanted);
  return { variable: wanted, dashed: dashed || (/wall/.test(name) && side === "slave") };
}

export function short(value) {
  if (value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2).replace("-", "−");
  return value.toPrecision(4).replace("-", "−");
}

// The same without zeros that say nothing: of what a person has written.
export function plain(value) {
  return String(+value.toPrecision(6)).replace("-", "−");
}

// Of a rig without pairs: a scene and the axes that touch it.
function sceneGroups(facts) {
  const axes = facts.columns.map((name) => /^master\.([^.]+)\.position$/.exec(name)?.[1]).filter(Boolean);
  const of = (...names) => axes.flatMap((axis) => names.map((name) => name.replace("*", axis)));
  return [
    { title: "Positions", unit: "rad, m", names: of("master.*.position") },
    { title: "Efforts", unit: "N m, N", names: of("master.*.commanded", "scene.asked.*") },
    { title: "Energy", unit: "J", names: [...of("master.*.port_energy"), "scene.kinetic", "scene.stored"] },
    { title: "Timing", unit: "µs", names: ["lateness_us", "compute_us"] },
  ];
}

export function groupsOf(facts, pair) {
  const has = new Set(facts.columns);
  const some = (...names) => names.filter((name) => has.has(name));
  if (!pair) return sceneGroups(facts).map((group) => ({ ...group, names: some(...group.names) })).filter((group) => group.names.length);
  const ends = (what) => some(`master.${pair.name}.${what}`, `slave.${pair.name}.${what}`);
  const groups = [
    { title: "Tracking", unit: pair.unit, names: ends("position") },
    { title: "Effort", unit: pair.effort, names: [...ends("port_effort"), ...ends("wall_effort")] },
    { title: "Waves", unit: "√W", names: [...ends("wave_in"), ...ends("wave_out")] },
    {
      title: "Energy", unit: "J",
      names: [...ends("port_energy"), ...pair.elements.map((e) => `${pair.name}.${e}.stored`).filter((n) => has.has(n) && !n.includes(".operate."))],
    },
    { title: "Timing", unit: "µs", names: some("lateness_us", "compute_us") },
  ];
  return groups.filter((group) => group.names.length);
}

export class Panel {
  constructor(host, store, group, scope) {
    this.store = store;
    this.scope = scope;
    this.group = group;
    this.box = document.createElement("div");
    this.box.className = "panel";
    this.head = document.createElement("div");
    this.head.className = "panel-head";
    this.plotBox = document.createElement("div");
    this.box.append(this.head, this.plotBox);
    host.append(this.box);
    this.build();
  }

  build() {
    this.plot?.destroy();
    const used = new Set();
    this.columns = this.group.names.map((name) => this.store.columns.indexOf(name));
    this.styles = this.group.names.map((name) => styleOf(name, used));
    this.buildHead();
    const soft = colour("--soft");
    const grid = { stroke: colour("--grid"), width: 1 };
    const axis = { stroke: soft, grid, ticks: grid, font: "11px system-ui, sans-serif" };
    this.plot = new uPlot(
      {
        width: this.plotBox.clientWidth || 600,
        height: HEIGHT,
        legend: { show: false },
        scales: {
          x: { time: false, range: () => [this.scope.view.from, this.scope.view.to] },
          y: { range: (u, low, high) => (low < high ? uPlot.rangeNum(low, high, 0.1, true) : [(low ?? 0) - FLAT, (high ?? 0) + FLAT]) },
        },
        axes: [
          { ...axis, size: 26, values: (u, ticks) => ticks.map((t) => `${+t.toFixed(6)} s`) },
          { ...axis, size: 66, space: 26, values: (u, ticks) => ticks.map((t) => (t !== 0 && (Math.abs(t) < 1e-3 || Math.abs(t) >= 1e5) ? t.toExponential(1) : String(+t.toPrecision(6))).replace("-", "−")) },
        ],
        cursor: { sync: { key: "scope" }, drag: { x: true, y: false, setScale: false }, points: { show: false } },
        hooks: { draw: [(u) => this.scope.drawMarks(u)], setSelect: [(u) => this.select(u)] },
        series: [
          {},
          ...this.styles.map((style) => ({
            stroke: colour(style.variable), width: 1.4, dash: style.dashed ? [6, 4] : undefined,
            points: { show: false }, paths: uPlot.paths.linear(), spanGaps: false,
          })),
        ],
      },
      [[], ...this.columns.map(() => [])],
      this.plotBox,
    );
    this.plot.over.addEventListener("click", (event) => this.click(event));
    this.plot.over.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
  }

  buildHead() {
    const title = document.createElement("b");
    title.textContent = `${this.group.title}${this.group.unit ? ` [${this.group.unit}]` : ""}`;
    this.keys = this.group.names.map((name, i) => {
      const key = document.createElement("span");
      key.className = "key";
      const mark = document.createElement("i");
      mark.style.borderTopColor = `var(${this.styles[i].variable})`;
      if (this.styles[i].dashed) mark.className = "dashed";
      const text = document.createElement("span");
      key.append(mark, document.createTextNode(`${name} `), text);
      return { box: key, text };
    });
    this.head.replaceChildren(title, ...this.keys.map((key) => key.box), this.chooser());
  }

  chooser() {
    const details = document.createElement("details");
    const summary = document.createElement("summary");
    summary.textContent = "signals";
    const box = document.createElement("div");
    box.className = "chooser";
    const search = document.createElement("input");
    search.type = "search";
    search.placeholder = "find";
    search.setAttribute("aria-label", "Find a signal");
    const labels = this.store.columns.map((name) => {
      const label = document.createElement("label");
      const tick = document.createElement("input");
      tick.type = "checkbox";
      tick.checked = this.group.names.includes(name);
      tick.addEventListener("change", () => this.choose(name, tick.checked));
      label.append(tick, ` ${name}`);
      return label;
    });
    search.addEventListener("input", () => {
      labels.forEach((label) => { label.hidden = !label.textContent.includes(search.value); });
    });
    box.append(search, ...labels);
    details.append(summary, box);
    return details;
  }

  choose(name, wanted) {
    const names = this.group.names.filter((other) => other !== name);
    if (wanted) names.push(name);
    this.group.names = names;
    const open = this.head.querySelector("details");
    this.build();
    this.head.querySelector("details").replaceWith(open); // it stays open, as it is
    this.scope.dirty = true;
  }

  select(u) {
    if (u.select.width < 4) return;
    const from = u.posToVal(u.select.left, "x");
    const to = u.posToVal(u.select.left + u.select.width, "x");
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.scope.zoom(from, to);
    this.dragged = true;
  }

  click(event) {
    if (this.dragged) {
      this.dragged = false; // the end of a zoom is no click
      return;
    }
    const at = this.plot.posToVal(event.offsetX, "x");
    this.scope.setCursor(event.shiftKey ? "b" : "a", at);
  }

  wheel(event) {
    event.preventDefault();
    const { from, to } = this.scope.view;
    const at = this.plot.posToVal(event.offsetX, "x");
    const by = event.deltaY > 0 ? 1.25 : 0.8;
    this.scope.zoom(at - (at - from) * by, at + (to - at) * by);
  }

  draw(from, to) {
    const width = this.plotBox.clientWidth;
    if (width && width !== this.plot.width) this.plot.setSize({ width, height: HEIGHT });
    this.plot.setData(this.store.shape(this.columns, from, to, Math.max(100, Math.floor(width / 1.5))));
  }

  showValues(rows) {
    this.keys.forEach((key, i) => {
      const values = rows.map((row) => (row === null ? undefined : this.store.value(this.columns[i], row)));
      let text = short(values[0]);
      if (rows.length > 1) text = `A ${short(values[0])}  B ${short(values[1])}  Δ ${short(values[1] - values[0])}`;
      key.text.textContent = text;
    });
  }
}
