"use strict";
/* A plot on a canvas: axes, lines, and two cursors that measure. The live page and the files of
   `cosim show` share it. */

const $ = (id) => document.getElementById(id);
const LEFT = 54, RIGHT = 8, TOP = 18;

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

function made(place, tag, text = "") {
  const element = place.appendChild(document.createElement(tag));
  element.textContent = text;
  return element;
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

  /* Axes over `x` and `y`, lowest and highest, with margins at `y`; `legend`: [words, colour]s. `bend`
     stretches y about 0 as asinh(y/bend); `upright`: where lines stand instead of a scale of x. */
  begin(x, [low, high], { legend = [], bend, upright, below = "" }) {
    const { ink, width, height } = inked(this.canvas), colour = colours();
    const right = width - RIGHT, bottom = height - (upright ? 4 : 18), margin = 0.06 * (high - low);
    const bent = (v) => (bend ? Math.asinh(v / bend) : v), least = bent(low - margin), most = bent(high + margin);
    Object.assign(this, { ink, colour, x, right, bottom, wide: right - LEFT });
    this.at = (v) => LEFT + (v - x[0]) / (x[1] - x[0]) * this.wide;
    this.up = (v) => bottom - (bent(v) - least) / (most - least) * (bottom - TOP);
    ink.font = "11.5px system-ui, sans-serif";
    ink.textBaseline = "middle";
    ink.lineWidth = 1;
    ink.strokeStyle = colour("line");
    ink.fillStyle = colour("soft");
    ink.textAlign = "right";
    const rows = bend ? [-1000, -100, 0, 100, 1000].filter((v) => v > low && v < high).map((v) => [v, String(v)])
      : ticks(low - margin, high + margin, Math.max(2, (bottom - TOP) / 24));
    ink.beginPath();
    for (const [v, words] of rows) {
      ink.moveTo(LEFT, this.up(v));
      ink.lineTo(right, this.up(v));
      ink.fillText(words.replace("-", "−"), LEFT - 5, Math.max(TOP, Math.min(bottom - 5, this.up(v))));
    }
    ink.textAlign = "center";
    for (const [v, words] of upright ?? ticks(...x, Math.max(2, this.wide / 90))) {
      ink.moveTo(this.at(v), TOP);
      ink.lineTo(this.at(v), bottom);
      const half = ink.measureText(words).width / 2;
      ink.fillText(words.replace("-", "−"), Math.min(right - half, Math.max(LEFT + half, this.at(v))), bottom + 9);
    }
    ink.stroke();
    ink.textAlign = "left";
    ink.fillStyle = colour("ink");
    ink.fillText(this.name + below, LEFT, 8);
    let place = LEFT + ink.measureText(this.name + below).width + 14;
    for (const [words, of] of legend) {
      ink.fillStyle = colour(of);
      ink.fillRect(place, 7, 12, 2.5);
      ink.fillText(words, place + 16, 8);
      place += ink.measureText(words).width + 28;
    }
  }

  /* What `draw` draws stays within the axes. */
  within(draw) {
    this.ink.save();
    this.ink.beginPath();
    this.ink.rect(LEFT, TOP - 2, this.wide, this.bottom - TOP + 4);
    this.ink.clip();
    draw(this.ink);
    this.ink.restore();
  }

  /* Through points [x, y]; a point without a number parts it. */
  line(points, colour, { dash = [], width = 1.4 } = {}) {
    this.within((ink) => {
      Object.assign(ink, { strokeStyle: this.colour(colour), lineWidth: width });
      ink.setLineDash(dash);
      ink.beginPath();
      let joined = false;
      for (const [x, y] of points) {
        const there = Number.isFinite(y);
        if (there && joined) ink.lineTo(this.at(x), this.up(y));
        else if (there) ink.moveTo(this.at(x), this.up(y));
        joined = there;
      }
      ink.stroke();
    });
  }

  /* An Envelope; columns further apart than `near`, or on the two sides
     of `gap`, are not joined. */
  envelope({ low, high }, colour, { near = 3, gap = -1, width = 1.4 } = {}) {
    this.within((ink) => {
      Object.assign(ink, { strokeStyle: this.colour(colour), lineWidth: width });
      ink.beginPath();
      for (let x = 0, last = -1e9, at = null; x < low.length; x++) {
        if (!(low[x] <= high[x])) continue;
        const [bottom, top] = [this.up(low[x]), this.up(high[x])];
        const up = at === null || Math.abs(bottom - at) < Math.abs(top - at);
        const ends = bottom - top < 1 ? [top] : up ? [bottom, top] : [top, bottom];
        if (x - last >= near || (last < gap && x > gap)) ink.moveTo(LEFT + x, ends[0]);
        for (const y of ends) ink.lineTo(LEFT + x, y);
        at = ends.at(-1);
        last = x;
      }
      ink.stroke();
    });
  }
}

/* Two cursors, A and B, over plots of one x. With `zoom` a drag away from them chooses a stretch. */
class Cursors {
  constructor(at, moved, zoom) {
    Object.assign(this, { at, moved, zoom, band: null });
  }

  add(plot) {
    const { canvas } = plot;
    let which = -1, from = null;
    const place = (event) => plot.x[0] + Math.max(0, Math.min(1, (event.offsetX - LEFT) / plot.wide)) * (plot.x[1] - plot.x[0]);
    const move = (event) => {
      if (which >= 0) this.at[which] = place(event);
      else this.band = [from, place(event)].sort((a, b) => a - b);
      this.moved();
    };
    canvas.addEventListener("pointerdown", (event) => {
      const [a, b] = this.at.map((at) => Math.abs(plot.at(at) - event.offsetX));
      which = this.zoom && Math.min(a, b) > 12 ? -1 : a <= b ? 0 : 1;
      from = place(event);
      canvas.setPointerCapture(event.pointerId);
      move(event);
    });
    canvas.addEventListener("pointermove", (event) => { if (from !== null) move(event); });
    canvas.addEventListener("pointerup", () => {
      const band = this.band;
      this.band = null;
      if (band && plot.at(band[1]) - plot.at(band[0]) > 8) this.zoom(band);
      else if (band) this.at[Math.abs(this.at[0] - from) <= Math.abs(this.at[1] - from) ? 0 : 1] = from;
      this.moved();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => { from = this.band = null; });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -0.002, ArrowRight: 0.002 }[event.key];
      if (!step) return;
      event.preventDefault();
      const k = event.shiftKey ? 1 : 0, [low, high] = plot.x;
      this.at[k] = Math.max(low, Math.min(high, this.at[k] + step * (high - low)));
      this.moved();
    });
  }

  draw(plot) {
    const { ink, right, bottom, colour } = plot;
    ink.strokeStyle = ink.fillStyle = colour("warn");
    if (this.band) {
      ink.globalAlpha = 0.15;
      ink.fillRect(plot.at(this.band[0]), TOP, plot.at(this.band[1]) - plot.at(this.band[0]), bottom - TOP);
      ink.globalAlpha = 1;
    }
    ink.setLineDash([3, 3]);
    ink.textAlign = "center";
    this.at.forEach((place, n) => {
      const x = plot.at(place);
      if (x < LEFT - 0.5 || x > right + 0.5) return;
      ink.beginPath();
      ink.moveTo(x, TOP);
      ink.lineTo(x, bottom);
      ink.stroke();
      ink.fillText("AB"[n], x > right - 14 ? x - 7 : x + 7, TOP + 5);
    });
    ink.setLineDash([]);
  }
}
