/* What `cosim show` writes: a cloud of points, curves, words and pictures. SHOWN is what
   cosim/live/show.py has made of the results; the rows of a run's column stand, block by block, in the
   elements behind this script, which come after the page is there. */

const numbersOf = (text) => new Float64Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);

/* What a column is for a reader: a factor, a unit, and both in words. Velocities are in mm/s as in
   what a run prints. */
function readable({ name, unit, most }) {
  if (unit === "m/s") return { factor: 1e3, unit: "mm/s", words: `${name}, mm/s` };
  const scaled = ["m", "A", "V", "s", "N", "W", "J"].includes(unit) && most > 0 && most < 0.5;
  const [factor, prefix] = !scaled ? [1, ""] : most < 5e-4 ? [1e6, "µ"] : [1e3, "m"];
  const shown = prefix + (["1", "?"].includes(unit) ? "" : unit).replace(/s2/g, "s²");
  return { factor, unit: shown, words: name + (shown && `, ${shown}`) };
}

const spelt = (v) => (typeof v === "number" ? String(Number(v.toPrecision(6))).replace("-", "−") : v);

/* One run's columns. */
class Rows {
  constructor(run, number) {
    Object.assign(this, run, { number, per: 1, blocks: new Map(), peaks: run.peaks?.map(numbersOf) });
  }

  /* NaN while the row is still to come. */
  value(column, k) {
    const id = `r${this.number}-${column}-${Math.floor(k / SHOWN.block)}`;
    if (!this.blocks.has(id)) {
      if (!$(id) || (document.readyState === "loading" && !$(id).nextElementSibling)) return NaN;
      if (this.blocks.size > 200) this.blocks.clear();
      this.blocks.set(id, numbersOf($(id).textContent));
    }
    return this.blocks.get(id)[k % SHOWN.block];
  }

  x(k) {
    return (this.step ? this.begin + k * this.step : this.value(0, k)) * this.per;
  }

  /* The number of the first row at or after `x`. */
  at(x) {
    let low = 0, high = this.count - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.x(middle) < x) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /* Lowest and highest in `columns` parts of a stretch of x. */
  shape(column, factor, [x0, x1], columns) {
    const found = new Envelope(columns), from = this.at(x0), to = this.at(x1), { bucket } = SHOWN;
    const place = (row) => Math.floor((this.x(row) - x0) / (x1 - x0) * columns), peaks = this.peaks?.[column];
    if (peaks && to - from > 4 * SHOWN.block) {
      for (let k = Math.floor(from / bucket); k * bucket <= to; k++) {
        for (const peak of [peaks[2 * k], peaks[2 * k + 1]]) found.put(place(Math.min(to, k * bucket + bucket / 2)), factor * peak);
      }
    } else for (let row = from; row <= to; row++) found.put(place(row), factor * this.value(column, row));
    return found;
  }

  /* Draws a column: its points where there are few, else lowest and highest of each column of pixels. */
  draw(plot, column, factor, colour, width) {
    const from = Math.max(0, this.at(plot.x[0]) - 1), to = Math.min(this.count - 1, this.at(plot.x[1]) + 1);
    if (to - from > 2 * plot.wide) plot.envelope(this.shape(column, factor, plot.x, Math.floor(plot.wide)), colour, { width });
    else plot.line(Array.from({ length: to - from + 1 }, (_, k) => [this.x(from + k), factor * this.value(column, from + k)]), colour, { width });
  }
}

/* Curves of one run, or of a family of which one is chosen. */
class Signals {
  constructor(place, { runs, columns, panels, opens }) {
    Object.assign(this, { runs: runs.map((run, k) => new Rows(run, k)), columns, chosen: 0 });
    const bar = made(place, "div", "", "row");
    const within = (from, to) => () => this.look([from, to].map((share) => this.view[0] + share * (this.view[1] - this.view[0])));
    for (const [words, act] of [["All", () => this.all()], ["Closer", within(0.25, 0.75)], ["Wider", within(-0.5, 1.5)],
      ["◀", within(-0.25, 0.75)], ["▶", within(0.25, 1.25)]]) made(bar, "button", words).onclick = act;
    if (runs[0].frequency) {
      choice(bar, "over", ["time", "periods"], (k) => {
        for (const run of this.runs) run.per = k ? run.frequency : 1;
        this.all(0.15);
      });
    }
    this.cursors = new Cursors([0, 0], () => this.soon(), (band) => this.look(band));
    this.plots = panels.map((own) => {
      const { factor, unit, words } = readable({ ...columns[own[0]], most: Math.max(...own.map((k) => columns[k].most)) });
      const plot = new Plot(place, own.length > 1 ? unit || "values" : words, "arrow keys move cursor A, with shift cursor B");
      this.cursors.add(plot);
      return { plot, factor, unit, lines: own.map((k, n) => [columns[k].name, ["a", "b", "d", "c", "ink"][n % 5], k]) };
    });
    this.table = made(place, "table");
    this.all(opens);
  }

  all(share = 1) { // of the time; below 0 at its end
    const [from, to] = this.whole = extent(this.runs.flatMap((run) => [run.begin, run.end].map((x) => x * run.per)));
    const long = Math.abs(share) * (to - from), start = share < 0 ? to - long : from;
    this.cursors.at = [0.25, 0.75].map((part) => start + part * long);
    this.look([start, start + long]);
  }

  look([from, to]) {
    const [least, most] = this.whole;
    this.view = to - from > 1e-9 * (most - least) ? [Math.max(least, from), Math.min(most, to)] : [least, most];
    this.soon();
  }

  soon() {
    cancelAnimationFrame(this.waiting);
    this.waiting = requestAnimationFrame(() => this.draw());
  }

  draw() {
    const own = this.runs[this.chosen], x = own.per === 1 ? readable(this.columns[0]).words : "periods";
    for (const { plot, lines, factor } of this.plots) {
      const [low, high] = extent(this.runs.flatMap((run) => lines.map(([, , k]) => run.shape(k, factor, this.view, 1)))
        .flatMap((one) => [one.low[0], one.high[0]]));
      const legend = lines.length > 1 ? lines.map(([name, of]) => [name, of]) : [];
      plot.begin(this.view, high > low ? [low, high] : high === low ? [low - 0.5, low + 0.5] : [-1, 1], { legend, below: `, over ${x}` });
      for (const [, of, k] of lines) {
        for (const run of this.runs) if (run !== own) run.draw(plot, k, factor, "steel", 0.6);
        own.draw(plot, k, factor, of);
      }
      this.cursors.draw(plot);
    }
    const [a, b] = this.cursors.at.map((at) => own.at(at));
    this.table.replaceChildren();
    const row = (tag, ...cells) => { const tr = made(this.table, "tr"); for (const cell of cells) made(tr, tag, Number.isNaN(cell) ? "…" : spelt(cell)); };
    const values = (words, of) => row("td", words, of(a), of(b), of(b) - of(a));
    row("th", "", "A", "B", "B−A");
    values(x, (k) => own.x(k));
    for (const { lines, factor, unit } of this.plots) for (const [name, , k] of lines) values(name + (unit && `, ${unit}`), (n) => factor * own.value(k, n));
  }
}

const shaded = (share) => `hsl(${250 - 200 * share} 65% ${42 + 18 * share}%)`;

/* Points of a table over two of its columns, coloured by a third; one is chosen. */
class Cloud {
  constructor(place, { columns, count, keys, ways, family, grid }, chose) {
    Object.assign(this, { columns, count, family, grid, chose, only: new Map() });
    const bar = made(place, "div", "", "row"), numeric = columns.filter((column) => column.most !== null);
    this.ways = ways.map((name) => numeric.find((column) => column.name === name));
    ["x", "y", "colour"].forEach((words, k) => {
      choice(bar, words, numeric.map(({ name }) => name), (n) => { this.ways[k] = numeric[n]; this.draw(); }, ways[k]);
    });
    const { values: worth } = this.ways[2], best = worth.indexOf(extent(worth.filter((v) => v !== null))[1]);
    for (const name of keys) { // a grid of many keys: one plane of it, at first the best point's
      const { values } = columns.find((column) => column.name === name), all = [...new Set(values)];
      this.only.set(values, values[best]);
      choice(bar, name, ["all", ...all.map(spelt)], (n) => { this.only.set(values, all[n - 1]); this.draw(); }, spelt(values[best] ?? NaN));
    }
    const [told, scale] = ["", "scale"].map((kind) => made(place, "small", "", kind));
    this.scale = [told, ...["span", "i", "span"].map((tag) => made(scale, tag))];
    this.scale[2].style.background = `linear-gradient(90deg, ${[0, 0.2, 0.4, 0.6, 0.8, 1].map(shaded)})`;
    this.plot = new Plot(place, "", "arrow keys choose another point");
    this.told = made(place, "dl");
    const { canvas } = this.plot;
    canvas.addEventListener("click", (event) => {
      const off = (k) => Math.hypot(this.places(k)[0] - event.offsetX, this.places(k)[1] - event.offsetY);
      this.choose(this.shown.reduce((best, k) => (off(k) < off(best) ? k : best), this.shown[0]));
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], n = this.shown.length;
      if (step && n) this.choose(this.shown[(this.shown.indexOf(this.chosen) + step + n) % n]);
    });
    this.choose(best);
  }

  choose(k = 0) {
    this.chosen = k;
    this.draw();
    this.told.replaceChildren();
    for (const column of this.columns) {
      const value = column.values[k], { factor, unit } = readable({ ...column, most: Math.abs(value) });
      if (value === null || value === "") continue;
      made(this.told, "dt", column.name).title = column.text;
      made(this.told, "dd", typeof value === "number" ? `${spelt(factor * value)} ${unit}` : value);
    }
    this.chose(this.family?.indexOf(k) ?? -1);
  }

  places(k) {
    return [this.plot.at(this.axes[0].factor * this.ways[0].values[k]), this.plot.up(this.axes[1].factor * this.ways[1].values[k])];
  }

  draw() {
    const [x, y, of] = this.ways, { plot } = this;
    this.axes = this.ways.map((column) => readable(column));
    const [wide, high, deep] = this.ways.map(({ values }, k) => {
      const [low, most] = extent(values.filter((v) => v !== null)).map((v) => v * this.axes[k].factor);
      return low < most ? [low, most] : [low - 0.5, low + 0.5];
    });
    const [across, up, shade] = this.axes.map(({ words }) => words);
    [`${up} over ${across}`, `${shade}: ${spelt(deep[0])}`, "", spelt(deep[1])].forEach((words, k) => { this.scale[k].textContent = words; });
    const cells = [x, y].map(({ name, values }) => (this.grid.includes(name) ? Math.max(2, new Set(values).size) : Infinity));
    plot.begin(wide, high, { margin: cells.map((n) => Math.max(0.05, 0.5 / (n - 1))) });
    this.shown = Array.from({ length: this.count }, (_, k) => k).filter((k) => x.values[k] !== null && y.values[k] !== null
      && [...this.only].every(([values, one]) => one === undefined || values === x.values || values === y.values || values[k] === one));
    const [w, h] = [plot.wide, plot.bottom - plot.top].map((long, k) => Math.max(9, Math.min(60, 0.9 * long / cells[k])));
    for (const k of [...this.shown, ...this.shown.filter((k) => k === this.chosen)]) {
      const [left, top] = this.places(k), share = (of.values[k] * this.axes[2].factor - deep[0]) / (deep[1] - deep[0]);
      plot.ink.fillStyle = of.values[k] === null ? "#888" : shaded(share);
      plot.ink.fillRect(left - w / 2, top - h / 2, w, h);
      if (k !== this.chosen) continue;
      Object.assign(plot.ink, { strokeStyle: plot.colour("warn"), lineWidth: 2.5 });
      plot.ink.strokeRect(left - w / 2 - 2, top - h / 2 - 2, w + 4, h + 4);
    }
  }
}

document.title = SHOWN.title;
for (const id of ["title", "about", "words"]) $(id).textContent = SHOWN[id];
for (const id of ["signals", "cloud"]) $(id).hidden = $(`${id}-how`).hidden = !SHOWN[id];
const signals = SHOWN.signals && new Signals($("signals"), SHOWN.signals);
const cloud = SHOWN.cloud && new Cloud($("cloud"), SHOWN.cloud, (run) => {
  if (!signals || run < 0) return;
  signals.chosen = run;
  signals.soon();
});
for (const [alt, content] of Object.entries(SHOWN.pictures)) {
  Object.assign(made($("pictures"), "img"), { alt, src: `data:image/png;base64,${content}` });
}
const again = () => { signals?.soon(); cloud?.draw(); };
for (const event of ["resize", "DOMContentLoaded"]) addEventListener(event, again);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
