// A scope's trigger: looks at every row, fires at the first one past a level on its edge.

export class Trigger {
  constructor() {
    this.mode = "off"; // off, auto, normal, once
    this.source = 0;
    this.level = 0;
    this.edge = "rising"; // rising, falling, either
    this.hysteresis = 0;
    this.before = 0.2; // share of the span before the trigger
    this.reset(0);
  }

  reset(row) {
    this.next = row; // the next row to look at
    this.armed = { rising: false, falling: false };
    this.hit = null; // the row at which it fired
    this.done = false; // `once` has fired, and its picture is complete
  }

  // Look at the rows up to `end`; stop at the first hit. Its picture has to be complete before the
  // next one is looked for, so that it does not move while it is drawn.
  look(store, end, spanRows) {
    if (this.mode === "off" || this.done) {
      this.next = end;
      return;
    }
    this.next = Math.max(this.next, store.begin);
    if (this.hit !== null && end < this.hit + (1 - this.before) * spanRows) return;
    if (this.hit !== null && this.mode === "once") {
      this.done = true;
      return;
    }
    const rising = this.edge !== "falling";
    const falling = this.edge !== "rising";
    for (; this.next < end; this.next++) {
      const v = store.value(this.source, this.next);
      const up = this.armed.rising && v >= this.level;
      const down = this.armed.falling && v <= this.level;
      // Armed again only beyond the hysteresis, or noise at the level would fire it.
      if (v < this.level - this.hysteresis) this.armed.rising = true;
      if (v > this.level + this.hysteresis) this.armed.falling = true;
      if (up) this.armed.rising = false;
      if (down) this.armed.falling = false;
      if ((up && rising) || (down && falling)) {
        this.hit = this.next++;
        return;
      }
    }
  }

  // `auto` goes on without a trigger once none has come for a span.
  waits(end, spanRows) {
    if (this.mode === "off") return false;
    if (this.mode !== "auto") return true;
    return this.hit !== null && end - this.hit < 2 * spanRows;
  }
}
