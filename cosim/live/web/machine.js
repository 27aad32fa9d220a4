"use strict";
/* The machine: the FMU's C as WebAssembly, led by cosim/live/machine.c, and rows of what it does. Runs in
   the audio worklet, in a worker and in node. SI. */

const RATE = 48000; // rows a second of simulated time
const COLUMNS = ["command", "coil_current", "coil_voltage", "z_surface", "z_ram", "z_part",
  "v_surface", "v_ram", "v_part", "a_surface", "friction_force", "wall_force", "plate_force",
  "sticking", "wall_contact", "output_clamped"];
const OUTPUT_COUNT = COLUMNS.length;
const TOTALS = ["z_part", "energy_copper", "stick_time", "output_high_time", "output_low_time",
  "current_limit_time", "impacts"];
const TOLD = ["time", ...TOTALS]; // of a mark, at the begin of each period

function held(corners) {
  return corners.flatMap(([phase, level], k) =>
    [[phase, level], [k + 1 < corners.length ? corners[k + 1][0] : 1 + corners[0][0], level]]);
}

/* Corners of a shape of straight lines, phase and level, as cosim/drive/command.py has them; a sine as
   `chords`, which end a little outside of it, so that each has the sine's mean. */
function cornersOf(drive, chords) {
  if (drive.waveform === "sine") {
    const outside = Math.tan(Math.PI / chords) / (Math.PI / chords) / 2;
    return Array.from({ length: chords }, (_, k) => [k / chords, outside * Math.sin(2 * Math.PI * k / chords)]);
  }
  if (drive.waveform === "steps") return held(drive.table);
  if (drive.waveform === "pieces") return drive.table;
  if (drive.waveform === "square") return held([[0, 0.5], [drive.duty, -0.5]]);
  const end = drive.waveform === "falling-sawtooth" ? -0.5 : 0.5;
  return [[0, -end], [1 - drive.reset_time * drive.frequency, end]];
}

/* V1 over a period as straight lines: phase at the begin, V1 there, V1 at the end. */
function linesOf(drive, chords) {
  const corners = cornersOf(drive, chords), [first, low] = corners[0], ends = [...corners, [1 + first, low]];
  return corners.flatMap(([p, a], k) => {
    const [q, b] = ends[k + 1], middle = drive.offset + drive.amplitude * (0.5 * (a + b)), rise = drive.amplitude * (b - a);
    return q > p ? [[p, middle - 0.5 * rise, middle + 0.5 * rise]] : [];
  });
}

/* The WebAssembly's functions; it needs none of ours. */
function started(module) {
  const { exports } = new WebAssembly.Instance(module);
  exports._initialize();
  return exports;
}

class Machine {
  /* `setup`: reals and integers, the FMU's parameters; force, N; drive. Another of the same exports ends
     this one. */
  constructor(exports, references, setup, chords) {
    Object.assign(this, { c: exports, references, chords, row: 0 });
    this._ok(exports.machine_new()); // may move the memory
    this.place = new Float64Array(exports.memory.buffer, exports.machine_place(), 3 * 4096);
    const put = (names) => names.forEach((name, k) => { this.place[k] = references[name]; });
    put(["command", "command_slope", "inputs_hold_for"]);
    exports.machine_inputs();
    put(TOTALS);
    exports.machine_reads(1, TOTALS.length - 1, 1);
    put(COLUMNS.slice(1));
    exports.machine_reads(0, OUTPUT_COUNT - 4, 3);
    for (const [name, value] of Object.entries(setup.reals)) this._ok(exports.machine_set(references[name], value), name);
    for (const [name, value] of Object.entries(setup.integers)) this._ok(exports.machine_set_whole(references[name], value), name);
    this.hold(setup.force);
    this._ok(exports.machine_begin());
    this.turn(setup.drive, setup.drive.start_phase);
  }

  /* Another drive, from now on, at the phase that has been reached. */
  turn(drive, phase = -1) {
    const lines = linesOf(drive, this.chords);
    this.place.set(lines.flat());
    this._ok(this.c.machine_turn(drive.frequency, lines.length, phase));
    Object.assign(this, { frequency: drive.frequency, origin: this.c.machine_origin() });
  }

  hold(force) {
    this._ok(this.c.machine_set(this.references.normal_force, force), "the force");
  }

  /* The next row, into `into` from `at` on. */
  next(into, at) {
    this.row++;
    this._ok(this.c.machine_row(this.row / RATE));
    for (let k = 0; k < OUTPUT_COUNT; k++) into[at + k] = this.place[k];
  }

  totals() {
    this._ok(this.c.machine_totals());
    return [this.c.machine_time(), ...this.place.subarray(0, TOTALS.length)];
  }

  /* The totals at the begin of each period since they were taken last. */
  marks() {
    const count = this.c.machine_marked(), wide = TOLD.length;
    const all = new Float64Array(this.c.memory.buffer, this.c.machine_marks(), count * wide);
    return Array.from({ length: count }, (_, k) => [...all.subarray(k * wide, (k + 1) * wide)]);
  }

  _ok(refused, what = ["", "the parameters", "the command", "a step", "reading"][refused]) {
    if (refused) throw new Error(`The machine refused ${what} at ${this.c.machine_time().toPrecision(6)} s.`);
  }
}
