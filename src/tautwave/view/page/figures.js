// The rig as it stands: arms as sticks in two views, one axis as a dial or a rail; walls and forces.

import { make } from "./schematic.js";
import { short } from "./panels.js";

const SIZE = 300;
const [AZIMUTH, ELEVATION] = [(-55 * Math.PI) / 180, (22 * Math.PI) / 180]; // as in a report
const LONGEST = 0.3; // of the picture, the longest arrow so far
const LEAST_FORCE = 1e-3; // [N], [N m] below it no arrow

const VIEWS = {
  obliquely: ([x, y, z]) => {
    const near = Math.cos(AZIMUTH) * x + Math.sin(AZIMUTH) * y;
    return [Math.cos(AZIMUTH) * y - Math.sin(AZIMUTH) * x, Math.cos(ELEVATION) * z - Math.sin(ELEVATION) * near];
  },
  "from above": ([x, y]) => [x, y],
};

const path = (points) => points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");

// An arrow from a place by a vector, in a picture of a size.
function arrow(line, [x, y], [dx, dy], size) {
  const length = Math.hypot(dx, dy);
  if (length < 0.01 * size) return line.setAttribute("d", "");
  const [ux, uy, s] = [dx / length, dy / length, Math.min(0.04 * size, 0.4 * length)];
  const tip = [x + dx, y + dy];
  const barb = (side) => [tip[0] - s * (ux + 0.5 * side * uy), tip[1] - s * (uy - 0.5 * side * ux)];
  line.setAttribute("d", `${path([[x, y], tip])}${path([barb(1), tip, barb(-1)])}`);
}

class ArmsView {
  constructor(svg, arms, name) {
    this.see = VIEWS[name];
    this.arms = arms;
    this.svg = svg;
    this.largest = LEAST_FORCE;
    this.reach = Math.max(...arms.map((arm) => arm.reach));
    this.scale = (0.5 * SIZE) / this.reach;
    this.least = [0, 0]; // of what was seen so far: the base, and where the arms have been
    this.most = [0, 0];
    this.parts = arms.map((arm) => {
      for (const wall of Object.values(arm.walls)) {
        for (const patch of wall.patches) svg.append(make("path", { d: `${path(patch.map((p) => this.at(p)))}Z`, class: "wall patch" }));
        for (const line of wall.lines) svg.append(make("path", { d: path(line.map((p) => this.at(p))), class: "wall" }));
      }
      const links = make("path", { class: `links ${arm.side}` });
      const joints = make("path", { class: `joints ${arm.side}` });
      svg.append(links, joints);
      return { links, joints, forces: {} };
    });
  }

  at(point) {
    const [x, y] = this.see(point);
    return [x * this.scale, -y * this.scale];
  }

  // Show all that was reached so far, in a square that grows and does not shrink.
  fit(places) {
    for (const place of places) {
      this.least = this.least.map((low, k) => Math.min(low, place[k]));
      this.most = this.most.map((high, k) => Math.max(high, place[k]));
    }
    const size = 1.35 * Math.max(0.15 * SIZE, ...this.most.map((high, k) => high - this.least[k]));
    const corner = this.most.map((high, k) => 0.5 * (high + this.least[k] - size));
    this.svg.setAttribute("viewBox", [...corner, size, size].map((v) => v.toFixed(1)).join(" "));
    return size;
  }

  pose(poses) {
    const all = poses.map(({ points }) => points.map((point) => this.at(point)));
    const size = this.fit(all.flat());
    poses.forEach(({ forces }, k) => {
      const part = this.parts[k];
      const places = all[k];
      part.links.setAttribute("d", path(places));
      part.joints.setAttribute("d", places.map(([x, y]) => `M${x.toFixed(1)} ${y.toFixed(1)}h0`).join(""));
      for (const [name, force] of Object.entries(forces)) {
        if (!part.forces[name]) {
          part.forces[name] = make("path", { class: `force ${name === "coupling" ? "coupling" : "wall"}` });
          this.svg.append(part.forces[name]);
        }
        const newtons = Math.hypot(...force);
        this.largest = Math.max(this.largest, newtons);
        const by = newtons > LEAST_FORCE ? (LONGEST * size) / (this.largest * this.scale) : 0;
        arrow(part.forces[name], places.at(-1), this.at(force.map((f) => f * by)), size);
      }
    });
  }
}

// One pair: both levers on a dial, or both carriages on a rail, their walls, the effort of the coupling.
class AxisView {
  constructor(svg, store, pair, range) {
    Object.assign(this, { svg, store, pair });
    this.rotary = pair.unit === "rad";
    this.largest = LEAST_FORCE;
    svg.setAttribute("viewBox", `${-SIZE / 2} ${-SIZE / 2} ${SIZE} ${this.rotary ? 0.7 * SIZE : 0.5 * SIZE}`);
    const low = [], high = [];
    for (const { range } of Object.values(pair.sides)) {
      if (range) { low.push(range[0]); high.push(range[1]); }
    }
    [this.low, this.high] = range ?? [low.length ? Math.min(...low) : -1, high.length ? Math.max(...high) : 1];
    this.parts = Object.keys(pair.sides).map((side, row) => {
      const wall = make("path", { class: "wall" });
      const body = make("path", { class: `links ${side}` });
      const force = make("path", { class: "force coupling" });
      const label = make("text", { x: -SIZE / 2 + 4, y: -SIZE / 2 + 16 + 18 * row, class: `soft ${side}` });
      svg.append(wall, body, force, label);
      return { side, row, wall, body, force, label };
    });
  }

  // A place at a position, `out` of the lever's length.
  at(position, row, out = 1) {
    if (this.rotary) {
      const length = 0.42 * SIZE * out;
      return [length * Math.sin(position), 0.12 * SIZE - length * Math.cos(position)];
    }
    const share = (position - this.low) / (this.high - this.low || 1);
    return [(share - 0.5) * 0.9 * SIZE, -0.25 * SIZE + 26 * row + 30];
  }

  // Where on the axis a point of the picture is.
  placeOf([x, y]) {
    if (this.rotary) return Math.atan2(x, 0.12 * SIZE - y);
    return this.low + (x / (0.9 * SIZE) + 0.5) * (this.high - this.low);
  }

  draw() {
    const { store, pair } = this;
    for (const { side, row, wall, body, force, label } of this.parts) {
      const axis = `${side}.${pair.name}`;
      const position = store.newest(`${axis}.position`);
      if (position === undefined || !Number.isFinite(position)) continue;
      const place = this.at(position, row);
      if (this.rotary) body.setAttribute("d", path([this.at(0, row, 0), place]));
      else body.setAttribute("d", `M${place[0] - 8} ${place[1]}h16`);
      const own = store.newest(`tuning.${axis}.wall_position`) ?? pair.sides[side].wall;
      const walls = [own, pair.sides[side].met].filter((where) => Number.isFinite(where)).map((where) => {
        const [x, y] = this.at(where, row);
        return this.rotary ? path([this.at(where, row, 0.25), this.at(where, row, 1.08)]) : `M${x} ${y - 12}v24`;
      });
      wall.setAttribute("d", walls.join(""));
      const effort = -(store.newest(`${axis}.port_effort`) ?? 0); // the port's resists
      const size = Math.abs(effort);
      this.largest = Math.max(this.largest, size);
      const length = size > LEAST_FORCE ? (effort / this.largest) * 0.6 * LONGEST * SIZE : 0;
      const along = this.rotary ? [Math.cos(position), Math.sin(position)] : [1, 0];
      arrow(force, place, along.map((a) => a * length), SIZE);
      label.textContent = `${side} ${short(position)} ${pair.unit}, ${short(effort)} ${pair.effort}`;
    }
  }
}

// A scene on a line: the axis that touches it, and its nodes at their places, each in a row.
class SceneView extends AxisView {
  constructor(svg, store, axis, range) {
    super(svg, store, axis, range);
    const nodes = store.columns.filter((name) => /^scene\.at\.[^.]+$/.test(name));
    svg.setAttribute("viewBox", `${-SIZE / 2} ${-SIZE / 2} ${SIZE} ${0.5 * SIZE + 9 * Math.min(nodes.length, 10)}`);
    this.nodes = nodes.map((column, k) => {
      const dot = make("path", { class: "joints node" });
      svg.append(dot);
      return { column, dot, y: -0.25 * SIZE + 56 + (k % 10) * 9 };
    });
    svg.append(make("path", { d: `M${-0.45 * SIZE} ${-0.25 * SIZE + 44}h${0.9 * SIZE}`, class: "ground" }));
  }

  draw() {
    super.draw();
    for (const { column, dot, y } of this.nodes) {
      const place = this.store.newest(column);
      if (Number.isFinite(place)) dot.setAttribute("d", `M${this.at(place, 0)[0].toFixed(1)} ${y}h0`);
    }
  }
}

export class Figures {
  constructor(host, store, facts, send) {
    Object.assign(this, { host, store, send });
    this.arms = facts.arms ?? [];
    this.ranges = facts.pointer;
    this.scene = facts.axes[0];
    this.show(facts.pairs[0]);
  }

  // The mouse or a finger on the picture leads the hand of its axis, for as long as it is pressed.
  follow(svg, view, name) {
    if (!this.ranges?.[name]) return;
    svg.classList.add("led");
    svg.dataset.led = name;
    let place = null;
    const said = () => place !== null && this.send({ op: "pointer", places: { [name]: place } });
    const move = (event) => {
      const [low, high] = this.ranges[name];
      const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      place = Math.min(high, Math.max(low, view.placeOf([point.x, point.y])));
      said();
    };
    svg.onpointerdown = (event) => {
      svg.setPointerCapture(event.pointerId);
      move(event);
    };
    svg.onpointermove = (event) => { if (place !== null) move(event); };
    svg.onpointerup = svg.onpointercancel = () => {
      if (place !== null) this.send({ op: "pointer", places: null });
      place = null;
    };
    clearInterval(this.again);
    this.again = setInterval(said, 100); // a pointer that rests is still there
  }

  svg(label, caption) {
    const svg = make("svg", { role: "img", "aria-label": label });
    const figure = document.createElement("figure");
    figure.append(svg);
    if (caption) figure.append(Object.assign(document.createElement("figcaption"), { className: "small", textContent: caption }));
    this.host.append(figure);
    return svg;
  }

  show(pair) {
    this.host.replaceChildren();
    this.axis = null;
    this.views = [];
    if (this.arms.length) {
      const names = this.arms.every((arm) => arm.flat) ? ["from above"] : Object.keys(VIEWS);
      this.views = names.map((name) => new ArmsView(this.svg(`Arms, seen ${name}`, `seen ${name}`), this.arms, name));
    } else if (pair ?? this.scene) {
      const shown = pair ?? this.scene;
      const range = this.ranges?.[shown.name];
      const svg = this.svg(`Axes of ${shown.name}`, range ? "press and drag here: the pointer leads the hand by a spring" : "");
      this.axis = new (pair ? AxisView : SceneView)(svg, this.store, shown, range);
      this.follow(svg, this.axis, shown.name);
    }
    this.host.closest("article").hidden = !this.axis && !this.views.length;
  }

  pose(poses) {
    for (const view of this.views) view.pose(poses);
  }

  draw() {
    this.axis?.draw();
  }
}
