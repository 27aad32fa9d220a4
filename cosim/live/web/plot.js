/* A plot on a canvas: axes, lines, and two cursors that measure. The live page and the files of
   `cosim show` share it. */

const $ = (id) => document.getElementById(id);
const LEFT = 54, RIGHT = 8;

const colours = () => {
  const style = getComputedStyle(document.documentElement);
  return (name) => style.getPropertyValue(`--${name}`).trim();
};

/* A canvas's context in CSS pixels, sharp on any screen. */
function inked(canvas) {
  const ratio = devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const ink = canvas.getContext("2d");
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.clearRect(0, 0, width, height);
  return { ink, width, height };
}

/* A line through points [x, y]; a point without a number parts it. */
function stroke(ink, points, colour, width = 1, dash = []) {
  Object.assign(ink, { strokeStyle: colour, lineWidth: width });
  ink.setLineDash(dash);
  ink.beginPath();
  let joined = false;
  for (const [x, y] of points) {
    const there = Number.isFinite(y);
    if (there) ink[joined ? "lineTo" : "moveTo"](x, y);
    joined = there;
  }
  ink.stroke();
}

function write(ink, words, x, y, colour, align = "left") {
  Object.assign(ink, { fillStyle: colour, textAlign: align });
  ink.fillText(words.replace("-", "−"), x, y);
}

/* What `draw` draws stays within a rectangle. */
function within(ink, rectangle, draw) {
  ink.save();
  ink.beginPath();
  ink.rect(...rectangle);
  ink.clip();
  draw();
  ink.restore();
}

function made(place, tag, text = "", kind = "") {
  const element = place.appendChild(document.createElement(tag));
  return Object.assign(element, { textContent: text, className: kind });
}

/* A choice of words; `act` is told the number of the one taken. */
function choice(place, name, words, act, first) {
  const select = made(made(place, "label", name), "select");
  for (const one of words) made(select, "option", one);
  select.selectedIndex = Math.max(0, words.indexOf(first));
  select.onchange = () => act(select.selectedIndex);
}

/* Round numbers from `low` to `high`, about `count`, with their words. */
function ticks(low, high, count) {
  const rough = (high - low) / count, ten = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((n) => n * ten >= rough * 0.999) * ten, found = [];
  const digits = Math.min(12, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high * (1 + 1e-12); n++) {
    const large = Math.abs(n * step) >= 1e6 || (n && Math.abs(n * step) < 1e-4);
    found.push([n * step, large ? (n * step).toExponential(2) : (n * step).toFixed(digits)]);
  }
  return found;
}

/* Lowest and highest of what are finite numbers. */
function extent(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const v of values) if (Number.isFinite(v)) [low, high] = [v < low ? v : low, v > high ? v : high];
  return [low, high];
}

/* Lowest and highest value in each of `count` columns of pixels. */
class Envelope {
  constructor(count) {
    this.low = new Float64Array(count).fill(Infinity);
    this.high = new Float64Array(count).fill(-Infinity);
  }

  put(place, value) {
    const x = Math.max(0, Math.min(this.low.length - 1, place));
    if (value < this.low[x]) this.low[x] = value;
    if (value > this.high[x]) this.high[x] = value;
  }
}

class Plot {
  constructor(place, name, hint) {
    this.canvas = made(place, "canvas");
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${name}; ${hint}`);
    this.name = name;
  }

  /* Axes over x and y, each from lowest to highest and a share of that more, `margin`; `legend`: [words,
     colour, dash]s. `bend` stretches y about 0 as asinh(y/bend); `upright`: a scale of x other than its own. */
  begin(across, along, { legend = [], bend, upright, below = "", margin = [0, 0.06] }) {
    const { ink, width, height } = inked(this.canvas), colour = colours(), right = width - RIGHT, bottom = height - 18;
    const [x, [low, high]] = [across, along].map(([a, b], k) => [a - margin[k] * (b - a), b + margin[k] * (b - a)]);
    const bent = (v) => (bend ? Math.asinh(v / bend) : v), least = bent(low), most = bent(high);
    Object.assign(ink, { font: "11.5px system-ui, sans-serif", textBaseline: "middle" });
    write(ink, this.name + below, LEFT, 8, colour("ink"));
    let place = LEFT + ink.measureText(this.name + below).width + 14, top = 18;
    for (const [words, of, dash] of legend) {
      const wide = ink.measureText(words).width + 16;
      if (place + wide > right) [place, top] = [LEFT, top + 15];
      stroke(ink, [[place, top - 10], [place + 12, top - 10]], colour(of), dash ? 1.5 : 2.5, dash);
      write(ink, words, place + 16, top - 10, colour(of));
      place += wide + 12;
    }
    Object.assign(this, { ink, colour, x, right, top, bottom, wide: Math.max(1, right - LEFT) });
    this.at = (v) => LEFT + (v - x[0]) / (x[1] - x[0]) * this.wide;
    this.up = (v) => bottom - (bent(v) - least) / (most - least) * (bottom - top);
    const [line, soft] = ["line", "soft"].map(colour);
    const rows = bend ? [-1000, -100, 0, 100, 1000].filter((v) => v > low && v < high).map((v) => [v, String(v)])
      : ticks(low, high, Math.max(2, (bottom - top) / 20));
    for (const [v, words] of rows) {
      stroke(ink, [[LEFT, this.up(v)], [right, this.up(v)]], line);
      write(ink, words, LEFT - 5, Math.max(top, Math.min(bottom - 5, this.up(v))), soft, "right");
    }
    for (const [v, words] of upright ?? ticks(...x, Math.max(2, this.wide / 90))) {
      const half = ink.measureText(words).width / 2;
      stroke(ink, [[this.at(v), top], [this.at(v), bottom]], line);
      write(ink, words, Math.min(right - half, Math.max(LEFT + half, this.at(v))), bottom + 9, soft, "center");
    }
  }

  _line(points, colour, width, dash) {
    const { ink, wide, top, bottom } = this;
    within(ink, [LEFT, top - 2, wide, bottom - top + 4], () => stroke(ink, points, this.colour(colour), width, dash));
  }

  /* Through points of the axes; one without a number parts it. */
  line(points, colour, { dash, width = 1.4 } = {}) {
    this._line(points.map(([x, y]) => [this.at(x), this.up(y)]), colour, width, dash);
  }

  /* An Envelope; columns further apart than `near`, or on the two sides of `gap`, are not joined. */
  envelope({ low, high }, colour, { near = 3, gap = -1, width = 1.4 } = {}) {
    const points = [];
    for (let x = 0, last = -1e9; x < low.length; x++) {
      if (!(low[x] <= high[x])) continue;
      const [bottom, top] = [this.up(low[x]), this.up(high[x])], at = points.at(-1)?.[1];
      const ends = bottom - top < 1 ? [top] : Math.abs(bottom - at) < Math.abs(top - at) ? [bottom, top] : [top, bottom];
      if (x - last >= near || (last < gap && x > gap)) points.push([NaN, NaN]);
      for (const y of ends) points.push([LEFT + x, y]);
      last = x;
    }
    this._line(points, colour, width);
  }
}

/* Two cursors, A and B, over plots of one x. With `zoom` a drag away from them chooses a stretch. */
class Cursors {
  constructor(at, moved, zoom) {
    Object.assign(this, { at, moved, zoom, band: null });
  }

  add(plot) {
    const { canvas } = plot, limits = (x) => Math.max(plot.x[0], Math.min(plot.x[1], x));
    let which = -1, from = null;
    const place = (event) => limits(plot.x[0] + (event.offsetX - LEFT) / plot.wide * (plot.x[1] - plot.x[0]));
    const move = (event) => {
      if (from === null) return;
      if (which >= 0) this.at[which] = place(event);
      else this.band = [from, place(event)].sort((a, b) => a - b);
      this.moved();
    };
    const nearest = (x) => (Math.abs(this.at[0] - x) <= Math.abs(this.at[1] - x) ? 0 : 1);
    canvas.addEventListener("pointerdown", (event) => {
      from = place(event);
      which = nearest(from);
      if (this.zoom && Math.abs(plot.at(this.at[which]) - event.offsetX) > 12) which = -1;
      canvas.setPointerCapture(event.pointerId);
      move(event);
    });
    canvas.addEventListener("pointermove", move);
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => {
      const { band } = this;
      this.band = null;
      if (band && plot.at(band[1]) - plot.at(band[0]) > 8) this.zoom(band);
      else if (band) this.at[nearest(from)] = from;
      from = null;
      this.moved();
    });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.002, ArrowRight: 0.002 }[event.key], k = event.shiftKey ? 1 : 0;
      if (!step) return;
      event.preventDefault();
      this.at[k] = limits(this.at[k] + step * (plot.x[1] - plot.x[0]));
      this.moved();
    });
  }

  draw(plot) {
    const { ink, right, top, bottom, colour } = plot, warn = colour("warn");
    if (this.band) {
      const [from, to] = this.band.map(plot.at);
      Object.assign(ink, { fillStyle: warn, globalAlpha: 0.15 });
      ink.fillRect(from, top, to - from, bottom - top);
      ink.globalAlpha = 1;
    }
    this.at.map(plot.at).forEach((x, n) => {
      if (x < LEFT - 0.5 || x > right + 0.5) return;
      stroke(ink, [[x, top], [x, bottom]], warn, 1, [3, 3]);
      write(ink, "AB"[n], x > right - 14 ? x - 7 : x + 7, top + 5, warn, "center");
    });
    ink.setLineDash([]);
  }
}
