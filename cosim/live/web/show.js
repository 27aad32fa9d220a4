"use strict";
/* What `cosim show` writes: a cloud of points, curves, words and pictures. SHOWN is what
   cosim/live/show.py has made of the results; the rows of a run's column stand, block by block, in the
   elements behind this script, which come after the page is there. */

const $ = (id) => document.getElementById(id);

function numbersOf(text) {
  const words = atob(text), bytes = new Uint8Array(words.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = words.charCodeAt(k);
  return new Float64Array(bytes.buffer);
}

/* Units for a reader: a factor and a name. */
function readable(unit, most) {
  const known = ["m", "m/s", "A", "V", "s", "N", "W", "J", "Hz", "kg"].includes(unit), mass = unit === "kg";
  const [factor, prefix] = !known || mass || most >= 0.5 || !most ? [1, ""] : most < 5e-4 ? [1e6, "µ"] : [1e3, "m"];
  return { factor, unit: prefix + (unit === "1" ? "" : unit).replace(/(m|s)(\d)/g, (_, name, power) => name + "⁰¹²³⁴"[power]) };
}

const spelt = (v) => (typeof v !== "number" ? String(v ?? "none") : String(Number(v.toPrecision(6))).replace("-", "−"));

/* One run's columns. */
class Rows {
  constructor(run, number) {
    Object.assign(this, run, { number, cache: new Map(), peaks: run.peaks?.map(numbersOf) });
  }

  /* A block of a column; null while it is still to come. */
  block(column, k) {
    const id = `r${this.number}-${column}-${k}`;
    if (!this.cache.has(id)) {
      const element = $(id);
      if (!element) return null;
      if (this.cache.size > 200) this.cache.clear();
      this.cache.set(id, numbersOf(element.textContent));
    }
    return this.cache.get(id);
  }

  value(column, k) {
    return this.block(column, Math.floor(k / SHOWN.block))?.[k % SHOWN.block] ?? NaN;
  }

  time(k) {
    return (this.step ? this.begin + k * this.step : this.value(0, k)) * this.per;
  }

  /* The number of the first row at or after `x`. */
  at(x) {
    let low = 0, high = this.count - 1;
    if (this.step) return Math.max(low, Math.min(high, Math.ceil((x / this.per - this.begin) / this.step - 1e-6)));
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < x) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /* Draws a column: its points where there are few, else lowest and highest of each column of pixels. */
  draw(plot, column, factor, colour, width) {
    const [x0, x1] = plot.x, from = Math.max(0, this.at(x0) - 1), to = Math.min(this.count - 1, this.at(x1) + 1);
    const columns = Math.max(1, Math.floor(plot.wide));
    if (to - from < 2 * columns) {
      const points = Array.from({ length: to - from + 1 }, (_, k) => [this.time(from + k), factor * this.value(column, from + k)]);
      plot.line(points, colour, { width });
      return;
    }
    plot.envelope(this.shape(column, factor, from, to, plot.x, columns), colour, { width });
  }

  shape(column, factor, from, to, [x0, x1], columns) {
    const low = new Float64Array(columns).fill(Infinity), high = new Float64Array(columns).fill(-Infinity);
    const put = (row, least, most) => {
      const x = Math.max(0, Math.min(columns - 1, Math.floor((this.time(row) - x0) / (x1 - x0) * columns)));
      if (factor * least < low[x]) low[x] = factor * least;
      if (factor * most > high[x]) high[x] = factor * most;
    };
    const peaks = this.peaks?.[column], { bucket } = SHOWN;
    if (peaks && to - from > 4 * SHOWN.block) {
      for (let k = Math.floor(from / bucket); k * bucket <= to; k++) put(Math.min(to, k * bucket + bucket / 2), peaks[2 * k], peaks[2 * k + 1]);
    } else {
      for (let row = from; row <= to; row++) put(row, this.value(column, row), this.value(column, row));
    }
    return { low, high };
  }
}

/* Curves of one run, or of a family of which one is chosen. */
class Signals {
  constructor(place, { runs, columns, panels, x }) {
    this.runs = runs.map((run, k) => new Rows({ ...run, per: 1 }, k));
    this.columns = columns;
    this.x = x;
    this.chosen = 0;
    const bar = made(place, "div");
    bar.className = "row";
    const scale = (by) => () => this.look(this.view.map((v, k) => (this.view[0] + this.view[1]) / 2 + (k ? 0.5 : -0.5) * by * (this.view[1] - this.view[0])));
    const move = (by) => () => this.look(this.view.map((v) => v + by * (this.view[1] - this.view[0])));
    for (const [words, act] of [["All", () => this.all()], ["Closer", scale(0.5)], ["Wider", scale(2)], ["◀", move(-0.25)], ["▶", move(0.25)]]) {
      made(bar, "button", words).onclick = act;
    }
    if (runs.length > 1 && runs.every((run) => run.frequency)) {
      const per = made(made(bar, "label", "over "), "select");
      for (const words of ["time", "periods"]) made(per, "option", words);
      per.onchange = () => {
        for (const run of this.runs) run.per = per.value === "periods" ? run.frequency : 1;
        this.all();
      };
    }
    this.cursors = new Cursors([0, 0], () => this.soon(), (band) => this.look(band));
    this.plots = panels.map((panel) => {
      const most = Math.max(...panel.columns.map((column) => columns[column].most));
      const { factor, unit } = readable(columns[panel.columns[0]].unit, most);
      const plot = new Plot(place, `${panel.name}${unit && ", "}${unit}`, "arrow keys move cursor A, with shift cursor B");
      this.cursors.add(plot);
      return { plot, panel, factor, unit, hidden: new Set() };
    });
    this.table = made(place, "table");
    this.all();
  }

  all() {
    const ends = this.runs.map((run) => [run.time(0), run.time(run.count - 1)]).filter((pair) => pair.every(Number.isFinite));
    this.whole = [Math.min(...ends.map(([a]) => a)), Math.max(...ends.map(([, b]) => b))];
    const [from, to] = this.whole;
    this.cursors.at = [from + 0.25 * (to - from), from + 0.75 * (to - from)];
    this.look(this.whole);
  }

  look([from, to]) {
    const least = 1e-9 * (this.whole[1] - this.whole[0]);
    this.view = [Math.max(this.whole[0], from), Math.min(this.whole[1], to)];
    if (!(this.view[1] - this.view[0] > least)) this.view = [...this.whole];
    this.soon();
  }

  soon() {
    cancelAnimationFrame(this.waiting);
    this.waiting = requestAnimationFrame(() => this.draw());
  }

  draw() {
    const own = this.runs[this.chosen];
    for (const { plot, panel, factor } of this.plots) {
      const wide = Math.max(1, plot.canvas.clientWidth - LEFT - RIGHT);
      let least = Infinity, most = -Infinity;
      for (const run of this.runs) for (const column of panel.columns) {
        const { low, high } = run.shape(column, factor, run.at(this.view[0]), run.at(this.view[1]), this.view, 1);
        if (low[0] < least) least = low[0];
        if (high[0] > most) most = high[0];
      }
      if (!(most > least)) [least, most] = least === most ? [least - 0.5, most + 0.5] : [-1, 1];
      const named = panel.columns.map((column, k) => [this.columns[column].name, "abdcs"[k % 5].replace("s", "steel")]);
      plot.begin(this.view, [least, most], { legend: named, below: plot === this.plots.at(-1).plot ? `   (x: ${this.runs[0].per === 1 ? this.x : "periods"})` : "" });
      panel.columns.forEach((column, k) => {
        for (const run of this.runs) if (run !== own) run.draw(plot, column, factor, "steel", wide < 500 ? 0.4 : 0.7);
        own.draw(plot, column, factor, named[k][1]);
      });
      this.cursors.draw(plot);
    }
    this.measure(own);
  }

  measure(own) {
    const [a, b] = this.cursors.at.map((x) => own.at(x)), span = own.time(b) - own.time(a);
    this.table.replaceChildren();
    const row = (cells, tag) => { const tr = made(this.table, "tr"); for (const cell of cells) made(tr, tag, cell); };
    row(["", "A", "B", "B−A"], "th");
    row([this.x, own.time(a), own.time(b), span].map((v) => (typeof v === "number" ? spelt(v) : v)), "td");
    for (const { panel, factor, unit } of this.plots) for (const column of panel.columns) {
      const [from, to] = [a, b].map((k) => own.value(column, k) * factor);
      row([`${this.columns[column].name}${unit && ", "}${unit}`, ...[from, to, to - from].map((v) => (Number.isNaN(v) ? "…" : spelt(v)))], "td");
    }
  }
}

/* Points of a table over two of its columns, coloured by a third; one is chosen. */
class Cloud {
  constructor(place, { columns, count, keys, ways, family }, chose) {
    Object.assign(this, { columns, count, family, chose, chosen: 0, only: new Map() });
    const bar = made(place, "div"), numeric = columns.filter((column) => column.most !== null);
    bar.className = "row";
    this.ways = ["x", "y", "colour"].map((name, k) => {
      const select = made(made(bar, "label", `${name} `), "select");
      for (const column of numeric) made(select, "option", column.name);
      select.selectedIndex = Math.max(0, numeric.findIndex((column) => column.name === ways[k]));
      select.onchange = () => this.draw();
      return () => numeric[select.selectedIndex];
    });
    for (const name of keys) { // a grid of many keys: one plane of it
      const { values } = columns.find((column) => column.name === name), select = made(made(bar, "label", `${name} `), "select");
      const all = [...new Set(values)];
      for (const words of ["all", ...all.map(spelt)]) made(select, "option", words);
      select.onchange = () => { this.only.set(values, all[select.selectedIndex - 1]); this.draw(); };
    }
    this.plot = new Plot(place, "", "arrow keys choose another point");
    this.told = made(place, "dl");
    const { canvas } = this.plot;
    canvas.addEventListener("click", (event) => {
      const off = (k) => { const [x, y] = this.places(k); return Math.hypot(x - event.offsetX, y - event.offsetY); };
      this.choose(this.shown.reduce((best, k) => (off(k) < off(best) ? k : best), this.shown[0]));
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], at = this.shown.indexOf(this.chosen);
      if (step) this.choose(this.shown[(at + step + this.shown.length) % this.shown.length]);
    });
    this.choose(this.ways[2]().values.reduce((best, v, k, all) => (v > (all[best] ?? -Infinity) ? k : best), 0));
  }

  choose(k) {
    if (k === undefined) return;
    this.chosen = k;
    this.draw();
    this.told.replaceChildren();
    for (const { name, unit, values, text } of this.columns) {
      if (values[k] === null || values[k] === "") continue;
      const { factor, unit: shown } = readable(unit, Math.abs(values[k]));
      const term = made(this.told, "dt", name);
      term.title = text;
      made(this.told, "dd", typeof values[k] === "number" ? `${spelt(factor * values[k])} ${shown}` : values[k]);
    }
    this.chose(this.family ? this.family.indexOf(k) : -1);
  }

  places(k) {
    const [x, y] = this.ways.map((way) => way()), { plot } = this;
    return [plot.at(readable(x.unit, x.most).factor * x.values[k]), plot.up(readable(y.unit, y.most).factor * y.values[k])];
  }

  draw() {
    const [x, y, of] = this.ways.map((way) => way()), units = [x, y, of].map((column) => readable(column.unit, column.most));
    const range = (column, { factor }) => {
      const all = column.values.filter((v) => v !== null).map((v) => v * factor), low = Math.min(...all), high = Math.max(...all);
      return low < high ? [low, high] : [low - 0.5, low + 0.5];
    };
    const [wide, high, deep] = [x, y, of].map((column, k) => range(column, units[k])), margin = 0.04 * (wide[1] - wide[0]);
    const words = (column, unit) => `${column.name}${unit.unit && ", "}${unit.unit}`;
    this.plot.name = `${words(y, units[1])} over ${words(x, units[0])}; colour: ${words(of, units[2])}, ${deep.map(spelt).join(" … ")}`;
    this.plot.begin([wide[0] - margin, wide[1] + margin], high, {});
    this.shown = Array.from({ length: this.count }, (_, k) => k).filter((k) => x.values[k] !== null && y.values[k] !== null
      && [...this.only].every(([values, one]) => one === undefined || values[k] === one));
    const distinct = (column) => new Set(column.values).size, [nx, ny] = [distinct(x), distinct(y)];
    const grid = nx * ny <= 1.5 * this.shown.length, { ink } = this.plot;
    const [w, h] = grid ? [this.plot.wide / (nx + 1), (this.plot.bottom - TOP) / (ny + 1)].map((v) => Math.max(4, Math.min(60, 0.94 * v))) : [8, 8];
    for (const k of this.shown) {
      const [left, top] = this.places(k), v = of.values[k];
      const share = v === null ? NaN : (v * units[2].factor - deep[0]) / (deep[1] - deep[0]);
      ink.fillStyle = Number.isNaN(share) ? "#888" : `hsl(${250 - 200 * share} 65% ${32 + 28 * share}%)`;
      ink.fillRect(left - w / 2, top - h / 2, w, h);
      if (k !== this.chosen) continue;
      Object.assign(ink, { strokeStyle: this.plot.colour("warn"), lineWidth: 2.5 });
      ink.strokeRect(left - w / 2 - 2, top - h / 2 - 2, w + 4, h + 4);
    }
  }
}

$("title").textContent = document.title = SHOWN.title;
$("about").textContent = SHOWN.about;
$("words").textContent = SHOWN.words;
let signals = null, cloud = null;
$("signals").hidden = !SHOWN.signals;
$("cloud").hidden = !SHOWN.cloud;
if (SHOWN.signals) signals = new Signals($("signals"), SHOWN.signals);
if (SHOWN.cloud) {
  cloud = new Cloud($("cloud"), SHOWN.cloud, (run) => {
    if (!signals || run < 0) return;
    signals.chosen = run;
    signals.soon();
  });
}
for (const [name, content] of Object.entries(SHOWN.pictures)) {
  const picture = made($("pictures"), "img");
  Object.assign(picture, { alt: name, src: `data:image/png;base64,${content}` });
}
const again = () => { signals?.soon(); cloud?.draw(); };
for (const event of ["resize", "DOMContentLoaded"]) addEventListener(event, again);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
