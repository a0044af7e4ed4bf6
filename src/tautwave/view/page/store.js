// Rows as they came, at the full rate: one Float64Array a column, the newest minute of them.

const MAX_BYTES = 96e6;
const KEEP_S = 60;

export class Store {
  constructor(columns, rate) {
    this.columns = columns;
    this.width = columns.length;
    this.room = Math.max(1024, Math.min(Math.ceil(rate * KEEP_S), Math.floor(MAX_BYTES / (8 * this.width))));
    this.data = columns.map(() => new Float64Array(this.room));
    this.time = this.data[columns.indexOf("time_s")];
    this.end = 0; // rows received; row k is in slot k % room
    this.missed = 0; // rows of the run that this page did not get
    this.first = null; // number in the run of the first row that came
    this.last = null;
  }

  get begin() {
    return Math.max(0, this.end - this.room);
  }

  push(first, missed, rows) {
    const count = rows.length / this.width;
    for (let k = 0; k < count; k++) {
      const at = (this.end + k) % this.room;
      for (let c = 0; c < this.width; c++) this.data[c][at] = rows[k * this.width + c];
    }
    this.end += count;
    this.missed = missed;
    if (this.first === null) this.first = first;
    this.last = first + count - 1;
  }

  value(column, row) {
    return this.data[column][row % this.room];
  }

  newest(name) {
    const column = this.columns.indexOf(name);
    return column < 0 || !this.end ? undefined : this.value(column, this.end - 1);
  }

  timeOf(row) {
    return this.time[row % this.room];
  }

  // The first row at or after a time [s]; rows are in order of time.
  rowAt(time) {
    let low = this.begin;
    let high = this.end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.timeOf(middle) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  // Least and greatest of every column in each of `count` parts of the rows, so that no peak is
  // lost to the width of a screen. With fewer rows than that: the rows.
  shape(columns, from, to, count) {
    const rows = Math.max(0, to - from);
    if (rows <= 2 * count) {
      const x = new Float64Array(rows);
      for (let k = 0; k < rows; k++) x[k] = this.timeOf(from + k);
      const series = columns.map((c) => {
        const y = new Float64Array(rows);
        for (let k = 0; k < rows; k++) y[k] = this.value(c, from + k);
        return y;
      });
      return [x, ...series];
    }
    // Parts keep their rows while time goes on, else the curves would shimmer.
    const size = Math.ceil(rows / count);
    const start = Math.floor(from / size);
    const parts = Math.floor((to - 1) / size) - start + 1;
    const x = new Float64Array(2 * parts);
    const series = columns.map(() => new Float64Array(2 * parts));
    for (let p = 0; p < parts; p++) {
      const a = Math.max(from, (start + p) * size);
      const b = Math.min(to, (start + p + 1) * size);
      x[2 * p] = this.timeOf(a);
      x[2 * p + 1] = this.timeOf(b - 1);
      columns.forEach((c, i) => {
        let low = Infinity;
        let high = -Infinity;
        for (let k = a; k < b; k++) {
          const v = this.value(c, k);
          if (v < low) low = v;
          if (v > high) high = v;
        }
        const rising = this.value(c, b - 1) >= this.value(c, a);
        series[i][2 * p] = rising ? low : high;
        series[i][2 * p + 1] = rising ? high : low;
      });
    }
    return [x, ...series];
  }
}
