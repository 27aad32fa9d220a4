/* Who owns the machine: a worker with a timer, or the audio worklet, which also plays the surface. */

const BUFFER = 50; // ms

class Player {
  constructor(post) {
    Object.assign(this, { post, speed: 1, running: false });
  }

  message({ kind, ...told }) {
    try {
      if (kind === "start") this.start(told);
      else if (kind === "speed") this.speed = told.speed;
      else if (!this.machine) return;
      else if (kind === "turn") this.machine.turn(told.drive);
      else if (kind === "hold") this.machine.hold(told.force);
    } catch (error) {
      this.fail(error);
    }
  }

  start({ binary, references, setup, generation }) {
    this.running = false;
    this.generation = generation;
    if (binary) this.exports = started(new WebAssembly.Module(binary));
    this.machine = null;
    this.machine = new Machine(this.exports, references, setup, 400);
    this.position = this.before = this.now = 0; // of what is heard: the row; its value and the one before
    this.count = 0;
    this.running = true;
  }

  fail(error) {
    this.running = false;
    this.post({ kind: "fault", text: String(error.message), generation: this.generation });
  }

  /* One row on; its velocity of the surface is what is heard. */
  next() {
    if (this.count === 1024) this.send();
    if (!this.count) this.rows = new Float32Array(1024 * OUTPUT_COUNT);
    const at = this.count * OUTPUT_COUNT;
    this.machine.next(this.rows, at);
    this.count++;
    this.before = this.now;
    this.now = this.rows[at + 6];
  }

  send() {
    if (!this.count) return;
    const { rows, count, machine, generation, gaps } = this, { row: last, origin, frequency } = machine;
    this.post({ kind: "rows", rows, count, last, origin, frequency, marks: machine.marks(), generation, gaps }, [rows.buffer]);
    this.count = 0;
  }

  /* `n` samples of sound, `rate` a second. */
  play(n, rate, out) {
    if (!this.running || !this.speed) return;
    const step = this.speed * RATE / rate;
    try {
      for (let k = 0; k < n; k++) {
        this.position += step;
        while (this.machine.row < this.position) this.next();
        if (out) out[k] = this.before + (this.now - this.before) * (this.position - this.machine.row + 1);
      }
    } catch (error) {
      this.fail(error);
    }
  }
}

if (typeof registerProcessor === "function") {
  registerProcessor("machine", class extends AudioWorkletProcessor {
    constructor() {
      super();
      this.player = new Player((told, moved) => this.port.postMessage(told, moved));
      this.port.onmessage = ({ data }) => {
        if (data.kind === "end") this.ended = true;
        else if (data.kind === "gain") this.gain = data.gain;
        else this.player.message(data);
      };
      this.blocks = this.mean = this.gain = this.player.gaps = 0;
      this.least = Infinity;
    }

    /* What is played lags behind the clock by more than a buffer: there was a gap. */
    watch() {
      const late = Date.now() - 1000 * currentTime;
      this.least = Math.min(this.least + 1e-3, late); // the two clocks drift apart
      if (late - this.least < BUFFER) return;
      this.player.gaps++;
      this.least = late;
    }

    process(_, [[out]]) {
      if (this.ended) return false;
      this.watch();
      this.player.play(out.length, sampleRate, out);
      for (let k = 0; k < out.length; k++) {
        this.mean += 5e-4 * (out[k] - this.mean); // a loudspeaker has no constant part
        out[k] = Math.tanh(this.gain * (out[k] - this.mean));
      }
      if (++this.blocks % 8 === 0 && this.player.running) this.player.send();
      return true;
    }
  });
} else if (typeof WorkerGlobalScope === "function") {
  const player = new Player((told, moved) => postMessage(told, moved));
  let last = performance.now();
  onmessage = ({ data }) => player.message(data);
  setInterval(() => {
    const now = performance.now(), n = Math.round(Math.min(now - last, 60) * RATE / 1000); // what is late is left out
    last = now;
    player.play(n, RATE, null);
    if (player.running) player.send();
  }, 12);
}
