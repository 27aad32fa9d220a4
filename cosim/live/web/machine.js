"use strict";
/* The machine: the FMU's C as WebAssembly, its command, and rows of what it does. Runs in the audio
   worklet, in a worker and in node. SI. It steps as cosim/coupling/loop/recorder.c does. */

const SAME_TIME = 1e-12; // s; times closer than this are one
const RATE = 48000; // rows a second of simulated time
const COLUMNS = ["command", "coil_current", "coil_voltage", "z_surface", "z_ram", "z_part",
  "v_surface", "v_ram", "v_part", "a_surface", "friction_force", "wall_force", "plate_force",
  "sticking", "wall_contact", "output_clamped"];
const REALS = COLUMNS.slice(1, 13), WHOLES = COLUMNS.slice(13);
const TOTALS = ["z_part", "energy_copper", "stick_time", "output_high_time", "output_low_time",
  "current_limit_time"];
const TOLD = ["time", ...TOTALS, "impacts"]; // of a mark, at the begin of each period
const OUTPUT_COUNT = COLUMNS.length;

function held(corners) {
  return corners.flatMap(([phase, level], k) =>
    [[phase, level], [k + 1 < corners.length ? corners[k + 1][0] : 1 + corners[0][0], level]]);
}

/* Corners of a shape of straight lines, phase and level, as cosim/drive/command.py has them. */
function cornersOf(drive) {
  if (drive.waveform === "steps") return held(drive.table);
  if (drive.waveform === "pieces") return drive.table;
  if (drive.waveform === "square") return held([[0, 0.5], [drive.duty, -0.5]]);
  const end = drive.waveform === "falling-sawtooth" ? -0.5 : 0.5;
  return [[0, -end], [1 - drive.reset_time * drive.frequency, end]];
}

/* V1 as straight lines: line(n) is the n-th since `origin`, of `count` a period. */
class Command {
  constructor(drive, origin = 0, chords = 4000) {
    this.frequency = drive.frequency;
    this.origin = origin;
    if (drive.waveform === "sine") {
      this.count = chords;
      this.sine = drive;
      // Straights end a little outside of the sine, so that each has the sine's mean.
      this.outside = Math.tan(Math.PI / chords) / (Math.PI / chords);
      return;
    }
    const corners = cornersOf(drive), [first, low] = corners[0];
    const ends = [...corners, [1 + first, low]], phases = [], lines = [];
    for (let k = 0; k < corners.length; k++) {
      const [p, a] = ends[k], [q, b] = ends[k + 1];
      if (q <= p) continue;
      const middle = drive.offset + drive.amplitude * (0.5 * (a + b)), rise = drive.amplitude * (b - a);
      phases.push(p);
      lines.push([middle - 0.5 * rise, middle + 0.5 * rise]);
    }
    this.phases = phases;
    this.lines = lines;
    this.count = phases.length;
  }

  corner(n) {
    const period = Math.floor(n / this.count), place = n - period * this.count;
    if (this.sine) return this.origin + (period / this.frequency + place / (this.count * this.frequency));
    return this.origin + (period + this.phases[place]) / this.frequency;
  }

  _onSine(n) {
    const place = n - Math.floor(n / this.count) * this.count, d = this.sine;
    return d.offset + this.outside * d.amplitude / 2 * Math.sin(2 * Math.PI * place / this.count);
  }

  line(n) {
    const [start, end] = this.sine ? [this._onSine(n), this._onSine(n + 1)]
      : this.lines[((n % this.count) + this.count) % this.count];
    return { begin: this.corner(n), edge: this.corner(n + 1), start, end };
  }

  /* The number of the line that holds at `time`. */
  at(time) {
    const phase = (time - this.origin) * this.frequency;
    let n = Math.floor(phase) * this.count;
    if (this.sine) n += Math.floor((phase - Math.floor(phase)) * this.count) - 1;
    else n -= 1;
    while (this.corner(n + 1) <= time) n++;
    return n;
  }
}

/* The WebAssembly's functions. */
function started(module) {
  const none = {};
  for (const { module: of, name } of WebAssembly.Module.imports(module)) {
    (none[of] ??= {})[name] = () => 0; // what writes messages; nothing is to be read here
  }
  const exports = new WebAssembly.Instance(module, none).exports;
  exports._initialize?.();
  return exports;
}

class Machine {
  /* `setup`: reals and integers, the FMU's parameters; force, N; command, a drive. */
  constructor(exports, references, setup, chords) {
    this.c = exports;
    this.references = references;
    this.chords = chords;
    this.place = exports.malloc(4096);
    this.words = { reals: this._refs(REALS), wholes: this._refs(WHOLES), totals: this._refs(TOTALS),
      impacts: this._refs(["impacts"]), force: this._refs(["normal_force"]),
      inputs: this._refs(["command", "command_slope", "inputs_hold_for"]) };
    const text = (word) => {
      const at = this.c.malloc(16), bytes = new Uint8Array(this.c.memory.buffer, at, 16);
      for (let k = 0; k < 16; k++) bytes[k] = k < word.length ? word.charCodeAt(k) : 0;
      return at;
    };
    this.instance = this.c.fmi3InstantiateCoSimulation(text("page"), text("live"), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0);
    if (!this.instance) throw new Error("The machine could not be made.");
    for (const [name, value] of Object.entries(setup.reals)) this._set(this._refs([name]), [value], name);
    for (const [name, value] of Object.entries(setup.integers)) this._setWhole(name, value);
    this._set(this.words.force, [setup.force], "normal_force");
    this._ok(this.c.fmi3EnterInitializationMode(this.instance, 0, 0, 0, 0, 0), "the parameters");
    this._ok(this.c.fmi3ExitInitializationMode(this.instance), "the parameters");
    this.time = 0;
    this.row = 0;
    this.marks = [];
    this.command = new Command(setup.drive, -setup.drive.start_phase / setup.drive.frequency, chords);
    this._take(this.command.at(0));
  }

  free() {
    this.c.fmi3FreeInstance(this.instance);
  }

  /* Another drive, from now on, at the phase that has been reached. */
  turn(drive) {
    const phase = (this.time - this.command.origin) * this.command.frequency;
    const share = phase - Math.floor(phase);
    this.command = new Command(drive, this.time - share / drive.frequency, this.chords);
    this._take(this.command.at(this.time));
  }

  hold(force) {
    this._set(this.words.force, [force], "the force");
  }

  /* On to `to`, s; `v1` is then what the command was there, at a jump before it. */
  go(to) {
    if (this.ended) this._take(this.number + 1);
    while (this.line.edge < to - SAME_TIME) {
      this._step(this.line.edge);
      this._take(this.number + 1);
    }
    if (this.line.edge <= to + SAME_TIME) {
      this._step(this.line.edge);
      this.v1 = this.line.end;
      this.ended = true; // the next line begins after what is read here
    } else {
      this._step(to);
      const { begin, edge, start, end } = this.line;
      this.v1 = start + (end - start) * (to - begin) / (edge - begin);
    }
  }

  /* The inputs are set again in the next step, as at the end of settling in a run. */
  settle() {
    this.holds = this.time;
  }

  /* The next row, into `into` from `at` on. */
  next(into, at) {
    this.row++;
    this.go(this.row / RATE);
    into[at] = this.v1;
    this.read(this.words.reals, REALS.length, into, at + 1);
    this._wholes(this.words.wholes, WHOLES.length, into, at + 1 + REALS.length);
  }

  totals() {
    const found = new Array(TOTALS.length + 2);
    found[0] = this.time;
    this.read(this.words.totals, TOTALS.length, found, 1);
    this._wholes(this.words.impacts, 1, found, TOTALS.length + 1);
    return found;
  }

  read(references, n, into, at) {
    this._ok(this.c.fmi3GetFloat64(this.instance, references, n, this.place, n), "reading");
    const values = new Float64Array(this.c.memory.buffer, this.place, n);
    for (let k = 0; k < n; k++) into[at + k] = values[k];
  }

  _wholes(references, n, into, at) {
    this._ok(this.c.fmi3GetInt32(this.instance, references, n, this.place, n), "reading");
    const values = new Int32Array(this.c.memory.buffer, this.place, n);
    for (let k = 0; k < n; k++) into[at + k] = values[k];
  }

  _take(number) {
    this.number = number;
    this.ended = false;
    this.line = this.command.line(number);
    this.holds = this.time;
    if (number % this.command.count === 0) this.marks.push(this.totals());
  }

  _step(to) {
    const h = to - this.time;
    if (h <= 0) return;
    if (this.time >= this.holds - SAME_TIME) {
      const { begin, edge, start, end } = this.line, slope = (end - start) / (edge - begin);
      this._set(this.words.inputs, [start + slope * (this.time - begin), slope, edge - this.time], "the command");
      this.holds = edge;
    }
    const told = this.place + 1024;
    this._ok(this.c.fmi3DoStep(this.instance, this.time, h, 1, told, told + 8, told + 16, told + 24), "a step");
    this.time = to;
  }

  _refs(names) {
    const at = this.c.malloc(4 * names.length), words = new Uint32Array(this.c.memory.buffer, at, names.length);
    names.forEach((name, k) => { words[k] = this.references[name]; });
    return at;
  }

  _set(references, values, what) {
    new Float64Array(this.c.memory.buffer, this.place, values.length).set(values);
    this._ok(this.c.fmi3SetFloat64(this.instance, references, values.length, this.place, values.length), what);
  }

  _setWhole(name, value) {
    new Int32Array(this.c.memory.buffer, this.place, 1)[0] = value;
    this._ok(this.c.fmi3SetInt32(this.instance, this._refs([name]), 1, this.place, 1), name);
  }

  _ok(status, what) {
    if (status !== 0) throw new Error(`The machine refused ${what} at ${(this.time ?? 0).toPrecision(6)} s.`);
  }
}
