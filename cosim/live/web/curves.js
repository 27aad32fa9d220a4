/* The rows of the last seconds, curves of them over the drive's phase, and what is laid over them. */

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

  /* The row at a phase within the newest whole period. */
  inPeriod(phase) {
    const begin = (Math.floor(this.phase(this.last)) - 1) / this.frequency + this.origin;
    return Math.round((begin + (phase - Math.floor(phase)) / this.frequency) * RATE);
  }
}

/* A run of the server, or a trial's record: `waveforms` by name, in steps of `step` from `begin` on, s;
   null where nothing is known. */
class Overlay {
  constructor(found, dash, names) {
    Object.assign(this, found, { dash, names, shift: 0, lift: 0, rest: 0 });
  }

  values(name) {
    return this.waveforms[has(this.names, name) ? this.names[name] : name];
  }

  phase(k) {
    return (this.begin + k * this.step) * this.frequency + this.shift;
  }

  /* What is known of a waveform, each with what the page's newest period has at its phase. */
  pairs(name, history) {
    const own = COLUMNS.indexOf(name), row = (k) => history.inPeriod(this.phase(k));
    return (this.values(name) ?? []).flatMap((x, k) => (x === null ? [] : [[x, history.value(row(k), own)]]));
  }

  /* A record's phase and origin of heights are not known: those at which the surface, else another waveform, agrees best. */
  fit(history) {
    const name = ["v_surface", "coil_current", "v_part", "command", "coil_voltage"].find((one) => this.values(one));
    const agree = Array.from({ length: 200 }, (_, n) => {
      this.shift = n / 200;
      return this.pairs(name, history).reduce((all, [x, y]) => all - (x - y) ** 2, 0);
    });
    Object.assign(this, { shift: agree.indexOf(Math.max(...agree)) / 200, rest: history.value(history.inPeriod(0), Z_SURFACE) });
    this.lift = this.pairs("z_surface", history).reduce((mean, [x, y], _, { length }) => mean + (x - y) / length, 0);
  }

  /* Root of the mean squared difference of a waveform to the newest period, and that of itself. */
  off(name, history) {
    const pairs = this.pairs(name, history), root = (of) => Math.sqrt(pairs.reduce((all, pair) => all + of(pair) ** 2, 0) / pairs.length);
    return pairs.length ? [root(([x, y]) => x - y), root(([x]) => x)] : null;
  }

  /* Points of the last periods: share of the window, and value. */
  points(name, factor, periods, onSurface) {
    const values = this.values(name), { z_part: part, z_surface: surface } = this.waveforms;
    if (!values || (name === "z_part" && onSurface && !surface)) return [];
    const begin = Math.max(0, values.length - Math.round(periods / this.frequency / this.step));
    const known = part?.findIndex((x, k) => k >= begin && x !== null && surface?.[k] !== null); // the part begins at the surface
    const height = name.startsWith("z_") ? this.lift : 0, travelled = name === "z_part" ? part[known] - (surface?.[known] ?? this.rest) : 0;
    const found = [];
    for (let k = begin, last = 0; k < values.length; k++) {
      const phase = this.phase(k) / periods, share = phase - Math.floor(phase);
      const on = name === "z_part" && onSurface ? (surface[k] ?? NaN) - height : 0;
      if (share < last) found.push([share, NaN]);
      found.push([share, values[k] === null ? NaN : factor * (values[k] - height - travelled - on)]);
      last = share;
    }
    return found;
  }
}

const PANELS = [
  { name: "voltages, V", unit: "V", lines: [["V1", "command", "a", 1], ["coil", "coil_voltage", "b", 1]], least: 1 },
  { name: "current, A", unit: "A", lines: [["coil", "coil_current", "a", 1]], least: 0.1 },
  { name: "heights, mm", unit: "mm", lines: [["surface", "z_surface", "a", 1e3], ["ram", "z_ram", "d", 1e3], ["part", "z_part", "b", 1e3]], least: 0.2 },
  { name: "velocities, mm/s", unit: "mm/s", lines: [["surface", "v_surface", "a", 1e3], ["ram", "v_ram", "d", 1e3], ["part", "v_part", "b", 1e3]], least: 20 },
  { name: "acceleration, m/s²", unit: "m/s²", lines: [["instant", "a_surface", "d", 1], ["camera", "camera", "a", 1]], least: 20, bend: 40 },
];
const SLIPS = { up: ["slips going up", "c"], down: ["slips going down", "b"] };
const FRAME = RATE / DATA.frame_rate; // rows
const CAMERA = [2, -1, -2, -1, 2]; // times heights frame by frame over 7 frames squared, as cosim/trials/camera.py
const Z_SURFACE = COLUMNS.indexOf("z_surface");

class Curves {
  constructor(place, tell) {
    this.cursors = new Cursors([0.25, 0.75], () => {}); // in shares of the window
    this.tell = tell;
    this.limits = PANELS.map(() => null);
    this.plots = PANELS.map((panel) => new Plot(place, panel.name, "arrow keys move cursor A, with shift cursor B"));
    for (const plot of this.plots) this.cursors.add(plot);
  }

  /* The curves of `periods` periods, newest parts over the last ones'; `others`, laid over them. */
  draw(history, periods, { slow, onSurface, others, budget }) {
    periods = Math.max(1, Math.min(periods, Math.floor(history.frequency * 2.4)));
    const span = periods / history.frequency * RATE; // rows of the window
    // In real time whole windows up to the last period's end; slowly, the present one over the last.
    const last = slow ? history.last : Math.floor((Math.floor(history.phase(history.last)) / history.frequency + history.origin) * RATE);
    const first = Math.max(history.first, last - Math.floor(span) + 1, history.turned + 1);
    this.window = { history, periods, first, last, span, slow };
    this.base = {};
    for (const name of ["z_surface", "z_part"]) this.base[name] = history.value(first, COLUMNS.indexOf(name));
    this.onSurface = onSurface;
    const alone = [["part on surface", "z_part", "b", 1e3]];
    this.panels = PANELS.map((panel) => (onSurface && panel.unit === "mm" ? { ...panel, lines: alone } : panel));
    this.panels.forEach((panel, k) => this._panel(k, panel, others, budget));
    this._measure();
  }

  /* Where a row is in the window. */
  share(row) {
    const { history, periods, last, span, slow } = this.window, phase = history.phase(row) / periods;
    return slow ? phase - Math.floor(phase) : 1 - (last - row) / span;
  }

  value(name, factor) {
    const { history } = this.window;
    if (name === "camera") {
      return (row) => (row - 2 * FRAME < history.first || row + 2 * FRAME > history.last ? NaN
        : CAMERA.reduce((all, times, k) => all + times * history.value(row + (k - 2) * FRAME, Z_SURFACE), 0) / 7 * DATA.frame_rate ** 2);
    }
    const column = COLUMNS.indexOf(name);
    // The part travels: its way since the window's begin is drawn, from where the surface is.
    const base = name === "z_part" ? this.base.z_part - this.base.z_surface : 0;
    const on = name === "z_part" && this.onSurface ? (row) => history.value(row, Z_SURFACE) : () => 0;
    return (row) => factor * (history.value(row, column) - base - on(row));
  }

  /* Lowest and highest of each column of pixels. */
  _shape(name, factor, columns) {
    const { first, last, span } = this.window, value = this.value(name, factor), found = new Envelope(columns);
    const stride = Math.max(1, Math.floor(span / columns / 40));
    for (let row = first; row <= last; row += stride) found.put(Math.floor(this.share(row) * columns), value(row));
    return found;
  }

  _panel(k, panel, others, budget) {
    const plot = this.plots[k], { lines } = panel, { periods, span, slow, history } = this.window;
    const columns = Math.max(1, Math.floor(plot.canvas.clientWidth - LEFT - RIGHT));
    const shapes = lines.map(([, name, , factor]) => this._shape(name, factor, columns));
    const laid = others.flatMap((other) => lines.map(([, name, of, factor]) =>
      ({ dash: other.dash, of, points: other.points(name, factor, periods, this.onSurface) })));
    let [least, most] = extent([...shapes.flatMap(({ low, high }) => [...low, ...high]), ...laid.flatMap(({ points }) => points.map(([, v]) => v))]);
    if (!(most >= least)) [least, most] = [-1, 1];
    if (most - least < panel.least) [least, most] = [(least + most - panel.least) / 2, (least + most + panel.least) / 2];
    // The limits follow at once outwards, slowly inwards, so that a curve does not pump.
    const before = this.limits[k]?.lines === lines.length ? this.limits[k] : { least, most };
    least = Math.min(least, before.least + 0.04 * (least - before.least));
    most = Math.max(most, before.most + 0.04 * (most - before.most));
    this.limits[k] = { least, most, lines: lines.length };
    const long = 1e3 * span / RATE, upright = ticks(0, long, Math.max(2, columns / 60)).map(([v, words]) => [v / long, v ? words : "0 ms"]);
    const legend = [...lines.map(([words, , of]) => [words, of]), ...(panel.bend ? Object.values(SLIPS) : [])];
    plot.begin([0, 1], [least, most], { legend, bend: panel.bend, upright });
    for (let n = 1; n < periods; n++) plot.line([[n / periods, least], [n / periods, most]], "steel", { width: 1 });
    if (panel.bend) for (const [way, [, of]] of Object.entries(SLIPS)) for (const end of budget[way]) plot.line([[0, end], [1, end]], of, { dash: [9, 3, 2, 3], width: 1 });
    const now = this.share(history.last), gap = slow ? now * columns : -1;
    shapes.forEach((shape, n) => plot.envelope(shape, lines[n][2], { near: 3 + columns / Math.max(1, span) * 2, gap }));
    for (const { points, of, dash } of laid) plot.line(points, of, { dash });
    if (slow) plot.line([[now, least], [now, most]], "ink", { width: 1 });
    this.cursors.draw(plot);
  }

  /* The row that is drawn at a share of the window. */
  _row(share) {
    const { first, last, span } = this.window, back = this.share(last) - share;
    const row = last - Math.round((back - (back < 0 ? -1 : 0)) * span);
    return row < first ? null : row;
  }

  _measure() {
    const [from, to] = this.cursors.at, [a, b] = [from, to].map((share) => this._row(share));
    const time = (to - from) * this.window.span / RATE;
    const words = [`B−A ${(time * 1e3).toFixed(2)} ms (${time ? (1 / Math.abs(time)).toFixed(1) : "∞"} Hz)`];
    if (a !== null && b !== null) {
      for (const { name, unit, lines } of this.panels) {
        const digits = unit === "mm" || unit === "A" ? 3 : 1, own = lines.filter(([, which]) => which !== "camera");
        const ends = own.map(([label, which, , factor]) => `${label} ${[a, b].map((row) => this.value(which, factor)(row).toFixed(digits)).join(" → ")}`);
        words.push(`${name}: ${ends.map((end) => end.replaceAll(" ", "\u00a0")).join(", ")}`);
      }
    }
    this.tell(words);
  }
}
