// The rig as a drawing: devices, what is between them, and where power flows now.

const SVG = "http://www.w3.org/2000/svg";
const OVER_S = 0.1; // powers are means over this time
const LEAST_W = 1e-6;
const TOP = 52;
const MIDDLE = TOP + 28;

export function make(tag, attributes, text) {
  const node = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  if (text !== undefined) node.textContent = text;
  return node;
}

export function watts(value) {
  const size = Math.abs(value);
  if (!(size >= LEAST_W)) return "0";
  const [by, unit] = size >= 1 ? [1, "W"] : size >= 1e-3 ? [1e3, "mW"] : [1e6, "µW"];
  return `${+(size * by).toPrecision(2)} ${unit}`;
}

function joules(value) {
  const size = Math.abs(value);
  if (!(size >= 1e-9)) return "0 J";
  const [by, unit] = size >= 1 ? [1, "J"] : size >= 1e-3 ? [1e3, "mJ"] : size >= 1e-6 ? [1e6, "µJ"] : [1e9, "nJ"];
  return `${(value * by).toPrecision(3)} ${unit}`.replace("-", "−");
}

export class Schematic {
  constructor(svg, store, facts) {
    this.svg = svg;
    this.store = store;
    this.facts = facts;
    this.flows = [];
    this.texts = [];
  }

  show(pair) {
    this.pair = pair;
    this.flows = [];
    this.texts = [];
    this.svg.replaceChildren();
    this.svg.closest("article").hidden = !pair; // a scene is drawn in its report
    if (!pair) return;
    const ends = pair.elements.filter((e) => /_(master|slave)$/.test(e));
    this.middle = pair.elements.filter((e) => !ends.includes(e) && e !== "operate");
    this.walls = {};
    this.ports = {};
    ["master", "slave"].forEach((side, at) => {
      const own = ends.filter((e) => e.endsWith(`_${side}`));
      this.ports[side] = own.filter((e) => e.startsWith("port"));
      this.walls[side] = own.filter((e) => !e.startsWith("port"));
      const x = at ? 530 : 0;
      this.box(x, TOP, 110, 56, side, side, pair.sides[side].driver);
      this.walls[side].forEach((name, n) => {
        const y = TOP + 96 + 60 * n;
        this.box(x, y, 110, 48, "wall", name.replace(/_(master|slave)$/, ""), null, name);
        const power = () => this.power(`${pair.name}.${name}.absorbed`);
        if (n === 0) this.flow(x + 30, TOP + 56, x + 30, y, power);
        else this.branch(at ? 530 : 110, y + 24, at ? -1 : 1, power);
      });
      const port = this.ports[side][0];
      const [outer, near, far, line] = at ? [530, 481, 411, 364] : [110, 159, 229, 276];
      if (port) {
        this.box(Math.min(near, far), TOP, 70, 56, "end", "port", null, port);
        this.flow(outer, MIDDLE, near, MIDDLE, () => this.intoPort(side));
        this.flow(far, MIDDLE, line, MIDDLE, () => this.intoLine(side));
      } else {
        this.flow(outer, MIDDLE, line, MIDDLE, () => this.intoPort(side));
      }
    });
    this.box(276, TOP, 88, 56, "middle", this.middle[0] ?? this.facts.law, null, this.middle[0]);
    this.middle.slice(1).forEach((name, n) => this.box(250, TOP + 96 + 60 * n, 140, 48, "middle", name, null, name));
    const rows = Math.max(this.walls.master.length, this.walls.slave.length, this.middle.length - 1);
    this.svg.setAttribute("viewBox", `-4 -4 648 ${TOP + 64 + (rows > 0 ? 28 + 60 * rows : 0)}`);
    const delay = this.facts.delay_s;
    const law = delay ? `${this.facts.law}, ${1e3 * delay} ms` : this.facts.law;
    this.svg.append(make("text", { x: 320, y: 16, "text-anchor": "middle", class: "soft" }, law));
  }

  box(x, y, width, height, kind, name, note, element) {
    this.svg.append(make("rect", { x, y, width, height, rx: 7, class: kind }));
    const [upper, lower] = [y + 0.4 * height, y + 0.76 * height]; // base lines
    const title = make("text", { x: x + width / 2, y: upper, "text-anchor": "middle" }, shorten(name, width));
    title.append(make("title", {}, name));
    this.svg.append(title);
    if (note) this.svg.append(make("text", { x: x + width / 2, y: lower, "text-anchor": "middle", class: "soft" }, shorten(note, width)));
    if (element) {
      const text = make("text", { x: x + width / 2, y: lower, "text-anchor": "middle", class: "soft" });
      this.svg.append(text);
      this.texts.push({ text, value: () => joules(this.store.newest(`${this.pair.name}.${element}.stored`) ?? 0) });
    }
  }

  flow(x1, y1, x2, y2, power) {
    const line = make("line", { x1, y1, x2, y2, class: "flow" });
    const tip = make("path", { class: "tip" });
    const level = y1 === y2;
    const label = make("text", {
      x: level ? (x1 + x2) / 2 : x1 + 14, y: level ? TOP - 9 : (y1 + y2) / 2 + 5,
      "text-anchor": level ? "middle" : "start", class: "soft",
    });
    this.svg.append(line, tip, label);
    this.flows.push({ tip, line, label, power, x1, y1, x2, y2 });
  }

  // A flow from a device into a box that is not the first below it, around those above.
  branch(edge, y, inwards, power) {
    const [trunk, label] = [edge + 32 * inwards, edge + 40 * inwards];
    this.svg.append(make("path", { d: `M${edge} ${TOP + 46}H${trunk}V${y}`, class: "trunk" }));
    this.flow(trunk, y, edge, y, power);
    const place = { x: label, y: y + 5, "text-anchor": inwards > 0 ? "start" : "end" };
    for (const [key, value] of Object.entries(place)) this.flows.at(-1).label.setAttribute(key, value);
  }

  // Mean power of a column that counts energy [W].
  power(name) {
    const { store } = this;
    const column = store.columns.indexOf(name);
    const last = store.end - 1;
    const first = Math.max(store.begin, last - Math.round(OVER_S * this.facts.rate_hz));
    if (column < 0) return NaN; // another site's
    if (last <= first) return 0;
    return (store.value(column, last) - store.value(column, first)) / (store.timeOf(last) - store.timeOf(first));
  }

  intoPort(side) {
    const walls = this.walls[side].map((e) => this.power(`${this.pair.name}.${e}.absorbed`));
    return this.power(`${side}.${this.pair.name}.port_energy`) - walls.reduce((a, b) => a + b, 0);
  }

  intoLine(side) {
    const ports = this.ports[side].map((e) => this.power(`${this.pair.name}.${e}.absorbed`));
    return this.intoPort(side) - ports.reduce((a, b) => a + b, 0);
  }

  draw() {
    for (const { text, value } of this.texts) text.textContent = value();
    for (const { line, tip, label, power, x1, y1, x2, y2 } of this.flows) {
      const value = power();
      const size = Math.abs(value);
      const flows = size >= LEAST_W;
      const width = flows ? Math.min(9, 1.5 + 1.1 * Math.log10(size / LEAST_W)) : 1;
      line.setAttribute("stroke-width", width);
      line.setAttribute("opacity", flows ? 1 : 0.35);
      label.textContent = Number.isNaN(value) ? "" : watts(value);
      tip.setAttribute("visibility", flows ? "visible" : "hidden");
      const [fx, fy, tx, ty] = value >= 0 ? [x1, y1, x2, y2] : [x2, y2, x1, y1];
      const length = Math.hypot(tx - fx, ty - fy);
      const [ux, uy] = [(tx - fx) / length, (ty - fy) / length];
      const s = 5 + width;
      const [bx, by] = [tx - ux * s, ty - uy * s];
      line.setAttribute("x1", fx);
      line.setAttribute("y1", fy);
      line.setAttribute("x2", flows ? bx : tx);
      line.setAttribute("y2", flows ? by : ty);
      tip.setAttribute("d", `M${tx} ${ty}L${bx - uy * s * 0.6} ${by + ux * s * 0.6}L${bx + uy * s * 0.6} ${by - ux * s * 0.6}Z`);
    }
  }
}

function shorten(text, width) {
  const most = Math.floor(width / 8.5);
  return text.length <= most ? text : `${text.slice(0, most - 1)}…`;
}
