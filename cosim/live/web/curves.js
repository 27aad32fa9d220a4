"use strict";
/* The rows of the last seconds, curves of them over the drive's phase, and two cursors. */

const KEPT = 3 * RATE; // rows

class History {
  constructor() {
    this.rows = new Float32Array(KEPT * OUTPUT_COUNT);
    this.clear();
  }

  clear() {
    this.first = this.last = 0; // numbers of rows; the first is the oldest, the last the newest
    this.turned = this.origin = 0;
    this.frequency = 1;
  }

  add({ rows, count, last, origin, frequency }) {
    for (let k = 0; k < count; k++) {
      const place = ((last - count + 1 + k) % KEPT) * OUTPUT_COUNT;
      this.rows.set(rows.subarray(k * OUTPUT_COUNT, (k + 1) * OUTPUT_COUNT), place);
    }
    if (!this.last) this.first = last - count + 1;
    this.last = last;
    this.first = Math.max(this.first, last - KEPT + 1);
    if (frequency !== this.frequency) this.turned = last - count; // older rows had another period
    Object.assign(this, { origin, frequency });
  }

  value(row, column) {
    return this.rows[(row % KEPT) * OUTPUT_COUNT + column];
  }

  now() {
    return Object.fromEntries(COLUMNS.map((name, k) => [name, this.value(this.last, k)]));
  }

  phase(row) {
    return (row / RATE - this.origin) * this.frequency;
  }
}

const PANELS = [
  { name: "voltages, V", unit: "V", lines: [["V1", "command", "a", 1], ["coil", "coil_voltage", "b", 1]], least: 1 },
  { name: "current, A", unit: "A", lines: [["coil", "coil_current", "a", 1]], least: 0.1 },
  { name: "heights, mm", unit: "mm", lines: [["surface", "z_surface", "a", 1e3], ["ram", "z_ram", "d", 1e3], ["part", "z_part", "b", 1e3]], least: 0.2 },
  { name: "velocities, mm/s", unit: "mm/s", lines: [["surface", "v_surface", "a", 1e3], ["ram", "v_ram", "d", 1e3], ["part", "v_part", "b", 1e3]], least: 20 },
  { name: "acceleration, m/s²", unit: "m/s²", lines: [["instant", "a_surface", "d", 1], ["mean of 4 ms", "mean", "a", 1]], least: 20, bend: 40 },
];
const HALF = Math.round(0.002 * RATE); // rows of half of the 4 ms that a camera's reading spans
const V_SURFACE = COLUMNS.indexOf("v_surface");

class Curves {
  constructor(place, tell) {
    this.cursors = [0.25, 0.75]; // shares of the window
    this.tell = tell;
    this.limits = PANELS.map(() => null);
    this.canvases = PANELS.map((panel) => {
      const canvas = document.createElement("canvas");
      canvas.tabIndex = 0;
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", `${panel.name}; arrow keys move cursor A, with shift cursor B`);
      place.append(canvas);
      this._grab(canvas);
      return canvas;
    });
  }

  _grab(canvas) {
    let which = -1;
    const share = (event) => (event.offsetX - LEFT) / (canvas.clientWidth - LEFT - RIGHT);
    const move = (event) => { this.cursors[which] = Math.max(0, Math.min(1, share(event))); };
    canvas.addEventListener("pointerdown", (event) => {
      const [a, b] = this.cursors.map((at) => Math.abs(at - share(event)));
      which = a <= b ? 0 : 1;
      canvas.setPointerCapture(event.pointerId);
      move(event);
    });
    canvas.addEventListener("pointermove", (event) => { if (which >= 0) move(event); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { which = -1; });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.002, ArrowRight: 0.002 }[event.key];
      if (!step) return;
      event.preventDefault();
      const k = event.shiftKey ? 1 : 0;
      this.cursors[k] = Math.max(0, Math.min(1, this.cursors[k] + step));
    });
  }

  /* The curves of `periods` periods, newest parts over the last ones'; `other`, a run to compare. */
  draw(history, periods, { slow, onSurface, other, budget }) {
    periods = Math.max(1, Math.min(periods, Math.floor(history.frequency * 2.4)));
    const span = periods / history.frequency * RATE; // rows of the window
    // In real time whole windows up to the last period's end; slowly, the present one over the last.
    const last = slow ? history.last : Math.floor((Math.floor(history.phase(history.last)) / history.frequency + history.origin) * RATE);
    const first = Math.max(history.first, last - Math.floor(span) + 1, history.turned + 1);
    this.window = { history, periods, first, last, span, slow };
    const now = this.share(history.last);
    this.base = {};
    for (const name of ["z_surface", "z_part"]) this.base[name] = history.value(first, COLUMNS.indexOf(name));
    this.onSurface = onSurface;
    PANELS.forEach((panel, k) => this._panel(k, panel, { now, slow, other, budget }));
    this._measure();
  }

  /* Where a row is in the window. */
  share(row) {
    const { history, periods, last, span, slow } = this.window, phase = history.phase(row) / periods;
    return slow ? phase - Math.floor(phase) : 1 - (last - row) / span;
  }

  _value(name, factor) {
    const { history } = this.window;
    if (name === "mean") {
      return (row) => (row - HALF < history.first || row + HALF > history.last ? NaN
        : (history.value(row + HALF, V_SURFACE) - history.value(row - HALF, V_SURFACE)) / (2 * HALF) * RATE);
    }
    const column = COLUMNS.indexOf(name);
    if (name === "z_part" && this.onSurface) {
      const surface = COLUMNS.indexOf("z_surface"), base = this.base.z_part - this.base.z_surface;
      return (row) => factor * (history.value(row, column) - history.value(row, surface) - base);
    }
    // The part travels: its way since the window's begin is drawn, from where the surface is.
    const base = name === "z_part" ? this.base.z_part - this.base.z_surface : 0;
    return (row) => factor * (history.value(row, column) - base);
  }

  _lines(panel) {
    const only = this.onSurface && panel.unit === "mm";
    return only ? [["part on surface", "z_part", "b", 1e3]] : panel.lines;
  }

  _panel(k, panel, { now, slow, other, budget }) {
    const { ink, width, height } = inked(this.canvases[k]), colour = colours();
    const { first, last: newest, span } = this.window, right = width - RIGHT, wide = right - LEFT;
    const lines = this._lines(panel), columns = Math.max(1, Math.floor(wide));
    const shapes = lines.map(([, name, , factor]) => {
      // Lowest and highest of each column of pixels.
      const low = new Float32Array(columns).fill(Infinity), high = new Float32Array(columns).fill(-Infinity);
      const value = this._value(name, factor), stride = Math.max(1, Math.floor(span / columns / 40));
      for (let row = first; row <= newest; row += stride) {
        const x = Math.max(0, Math.min(columns - 1, Math.floor(this.share(row) * columns))), v = value(row);
        if (v < low[x]) low[x] = v;
        if (v > high[x]) high[x] = v;
      }
      return { low, high };
    });
    const others = other ? lines.map(([, name, , factor]) => other.line(name, factor, this.onSurface)) : [];
    let least = Infinity, most = -Infinity;
    for (const { low, high } of shapes) for (let x = 0; x < columns; x++) {
      if (low[x] < least) least = low[x];
      if (high[x] > most) most = high[x];
    }
    for (const line of others) for (const [, v] of line ?? []) { least = Math.min(least, v); most = Math.max(most, v); }
    if (!(most >= least)) [least, most] = [-1, 1];
    if (most - least < panel.least) [least, most] = [(least + most - panel.least) / 2, (least + most + panel.least) / 2];
    // The limits follow at once outwards, slowly inwards, so that a curve does not pump.
    const before = this.limits[k], ease = (new_, old) => old + 0.04 * (new_ - old);
    const own = before && before.lines === lines.length
      ? { low: Math.min(least, ease(least, before.low)), high: Math.max(most, ease(most, before.high)) }
      : { low: least, high: most };
    this.limits[k] = { ...own, lines: lines.length };
    const margin = 0.06 * (own.high - own.low), low = own.low - margin, high = own.high + margin;
    const top = 18, bottom = height - 4;
    const bend = panel.bend ? (v) => Math.asinh(v / panel.bend) : (v) => v;
    const y = (v) => bottom - (bend(v) - bend(low)) / (bend(high) - bend(low)) * (bottom - top);

    ink.font = "11.5px system-ui, sans-serif";
    ink.textBaseline = "middle";
    ink.strokeStyle = colour("line");
    ink.fillStyle = colour("soft");
    ink.textAlign = "right";
    const step = niceStep((high - low) / 5), levels = panel.bend ? [-1000, -100, 0, 100, 1000].filter((v) => v > low && v < high) : [];
    for (let v = Math.ceil(low / step) * step; v <= high && !panel.bend; v += step) levels.push(v);
    ink.beginPath();
    for (const v of levels) {
      ink.moveTo(LEFT, y(v));
      ink.lineTo(right, y(v));
      ink.fillText(String(Number((Math.abs(v) < step / 1e3 ? 0 : v).toPrecision(4))), LEFT - 5, Math.max(top, Math.min(bottom - 6, y(v))));
    }
    for (let n = 0; n <= this.window.periods; n++) {
      const x = LEFT + wide * n / this.window.periods;
      ink.moveTo(x, top);
      ink.lineTo(x, bottom);
    }
    ink.stroke();
    ink.save();
    ink.beginPath();
    ink.rect(LEFT, top - 2, wide, bottom - top + 4);
    ink.clip();
    if (panel.unit === "m/s²" && budget) this._slips(ink, budget, y, right, colour);
    const gap = slow ? now : -1;
    shapes.forEach(({ low, high }, n) => {
      ink.strokeStyle = colour(lines[n][2]);
      ink.lineWidth = 1.4;
      ink.beginPath();
      let last = -9, at = null;
      for (let x = 0; x < columns; x++) {
        if (low[x] > high[x]) continue;
        const joined = x - last < 3 + columns / Math.max(1, span) * 2 && !(gap >= 0 && last < gap * columns && x > gap * columns);
        const near = at === null || Math.abs(y(low[x]) - at) < Math.abs(y(high[x]) - at);
        const ends = y(low[x]) - y(high[x]) < 1 ? [high[x]] : near ? [low[x], high[x]] : [high[x], low[x]];
        at = y(ends.at(-1));
        if (!joined) ink.moveTo(LEFT + x, y(ends[0]));
        for (const v of ends) ink.lineTo(LEFT + x, y(v));
        last = x;
      }
      ink.stroke();
    });
    others.forEach((line, n) => {
      if (!line) return;
      ink.strokeStyle = colour(lines[n][2]);
      ink.setLineDash([5, 4]);
      ink.beginPath();
      line.forEach(([phase, v], at) => {
        const x = LEFT + wide * phase / this.window.periods;
        if (at && phase > line[at - 1][0]) ink.lineTo(x, y(v)); else ink.moveTo(x, y(v));
      });
      ink.stroke();
      ink.setLineDash([]);
    });
    ink.restore();
    ink.lineWidth = 1;
    if (slow) {
      ink.strokeStyle = colour("ink");
      ink.beginPath();
      ink.moveTo(LEFT + now * wide, top);
      ink.lineTo(LEFT + now * wide, bottom);
      ink.stroke();
    }
    ink.strokeStyle = ink.fillStyle = colour("warn");
    ink.setLineDash([3, 3]);
    ink.textAlign = "center";
    this.cursors.forEach((share, n) => {
      const x = LEFT + share * wide;
      ink.beginPath();
      ink.moveTo(x, top);
      ink.lineTo(x, bottom);
      ink.stroke();
      ink.fillText("AB"[n], x > right - 14 ? x - 7 : x + 7, top + 5);
    });
    ink.setLineDash([]);
    ink.textAlign = "left";
    ink.fillStyle = colour("ink");
    ink.fillText(panel.name, LEFT, 8);
    let x = LEFT + ink.measureText(panel.name).width + 14;
    for (const [name, , of] of lines) {
      ink.fillStyle = colour(of);
      ink.fillRect(x, 7, 12, 2.5);
      ink.fillText(name, x + 16, 8);
      x += ink.measureText(name).width + 28;
    }
  }

  _slips(ink, budget, y, right, colour) {
    ink.setLineDash([2, 4]);
    ink.strokeStyle = ink.fillStyle = colour("c");
    ink.textAlign = "right";
    for (const [way, ends] of Object.entries(budget)) for (const end of ends) {
      ink.beginPath();
      ink.moveTo(LEFT, y(end));
      ink.lineTo(right, y(end));
      ink.stroke();
      ink.fillText(`slips ${way}`, right - (way === "up" ? 4 : 70), y(end) + (end < 0 ? 7 : -6));
    }
    ink.setLineDash([]);
  }

  /* The row that is drawn at a share of the window. */
  _row(share) {
    const { first, last, span } = this.window, back = this.share(last) - share;
    const row = last - Math.round((back - (back < 0 ? -1 : 0)) * span);
    return row < first ? null : row;
  }

  _measure() {
    const [a, b] = this.cursors.map((share) => this._row(share)), { span } = this.window;
    const time = (this.cursors[1] - this.cursors[0]) * span / RATE;
    const words = [`B−A ${(time * 1e3).toFixed(2)} ms (${time ? (1 / Math.abs(time)).toFixed(1) : "∞"} Hz)`];
    if (a !== null && b !== null) {
      for (const panel of PANELS) for (const [label, name, , factor] of this._lines(panel)) {
        if (name === "mean") continue;
        const value = this._value(name, factor), from = value(a), to = value(b);
        const digits = panel.unit === "mm" || panel.unit === "A" ? 3 : 1;
        const what = panel.lines.length > 1 || panel.unit === "A" ? `${label} ` : "";
        words.push(`${what}${from.toFixed(digits)} → ${to.toFixed(digits)} ${panel.unit}`);
      }
    }
    this.tell(words);
  }
}

const LEFT = 46, RIGHT = 8;

function niceStep(rough) {
  const ten = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find((n) => n * ten >= rough) * ten;
}
