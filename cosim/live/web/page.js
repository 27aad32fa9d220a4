/* The page: what is turned, who plays it, what is told of it. */

const first = opened();
const state = { setting: first, values: valuesOf(first), speed: 1, paused: false, generation: 0, marks: [], others: [], grip: 2 };
const history_ = new History();
const curves = new Curves($("curves"), (words) => {
  $("measure").replaceChildren();
  for (const word of words) made($("measure"), "span", word.replaceAll("-", "−"));
});
const WALL = COLUMNS.indexOf("wall_contact"), lit = { time: -1e9, side: 0 };

// --- who plays ------------------------------------------------------------------------------------
const binary = Uint8Array.from(atob(BINARY), (c) => c.charCodeAt(0)).buffer;
const workerSource = URL.createObjectURL(new Blob([CORE], { type: "text/javascript" }));
let host = null, audio = null;

function plain() {
  const worker = new Worker(workerSource);
  worker.onmessage = ({ data }) => heard(data);
  return { post: (told) => worker.postMessage(told), end: () => worker.terminate() };
}

/* The audio worklet; from a file it takes nothing but a data: address. */
async function sounding() {
  audio ??= new AudioContext({ latencyHint: "interactive" });
  await audio.resume();
  if (!audio.hasCore) await audio.audioWorklet.addModule(`data:text/javascript;charset=utf-8,${encodeURIComponent(CORE)}`);
  audio.hasCore = true;
  const node = new AudioWorkletNode(audio, "machine", { outputChannelCount: [1] });
  node.port.onmessage = ({ data }) => heard(data);
  node.connect(audio.destination);
  return {
    post: (told) => node.port.postMessage(told),
    end: () => { node.port.postMessage({ kind: "end" }); node.disconnect(); audio.suspend(); },
  };
}

function begin(fresh) {
  state.generation++;
  state.marks = [];
  history_.clear();
  const setup = setupOf(state.values, state.setting.scene);
  host.post({ kind: "start", binary: fresh ? binary : null, references: DATA.references, setup, generation: state.generation });
  pace();
}

const pace = () => host.post({ kind: "speed", speed: state.paused ? 0 : state.speed });

function heard(told) {
  if (told.generation !== state.generation) return;
  if (told.kind === "fault") return fault(told.text);
  history_.add(told);
  if (told.gaps !== undefined) $("gaps").textContent = told.gaps ? `${told.gaps} gaps` : "no gap";
  for (let row = told.last - told.count + 1; row <= told.last; row++) {
    const side = history_.value(row, WALL);
    if (side) Object.assign(lit, { time: performance.now(), side });
  }
  state.marks.push(...told.marks);
  // The newest second, and at least two periods.
  const newest = state.marks.at(-1)?.[0];
  while (state.marks.length > 3 && state.marks[1][0] < newest - 1) state.marks.shift();
}

function fault(text) { $("fault").textContent = text; }

// --- what is turned -------------------------------------------------------------------------------
function take(setting, again) {
  const before = state.setting, values = valuesOf(setting), setup = setupOf(values, setting.scene), wrong = impossible(values);
  if (wrong) return fault(wrong);
  const was = setupOf(state.values, before.scene);
  Object.assign(state, { setting, values, grip: again ? 2 : state.grip });
  state.others = state.others.filter((other) => other === record);
  $("compared").textContent = state.others.length ? `${record.name} (dotted)` : "";
  fault("");
  const same = (name) => JSON.stringify(was[name]) === JSON.stringify(setup[name]);
  if (again || !same("reals") || !same("integers")) begin(false);
  else {
    if (!same("drive")) host.post({ kind: "turn", drive: setup.drive });
    if (!same("force")) host.post({ kind: "hold", force: setup.force });
    state.marks = [];
  }
  show();
  clearTimeout(state.later);
  state.later = setTimeout(() => { history.replaceState(null, "", linkOf(state.setting)); }, 250);
}

const set = (values) => take(changed(state.setting, values));

/* On the device three potentiometers are all there is: who turns one has all of them. */
function turnKnob(index, code) {
  const codes = codesOf(state.values), most = DATA.knobs.amplitude.length - 1;
  codes[index] = Math.max(0, Math.min(most, Math.round(code)));
  const names = ["pot_max", "pot_frequency", "pot_offset"];
  set(Object.fromEntries(names.map((name, k) => [`drive.${name}`, codes[k] / (most + 1)])));
}

const pot = (name, unit, index) =>
  ({ name, key: `drive.${name}`, digits: 2, unit, at: (v) => codesOf(v)[index] / 1023, turn: (x) => turnKnob(index, x * 1023) });
const KNOBS = [pot("amplitude", "V", 0), pot("frequency", "Hz", 1), pot("offset", "V", 2),
  { name: "grip", key: "friction.normal_force", digits: 3, unit: "N", at: (v) => v["friction.normal_force"] / state.grip,
    turn: (x) => set({ "friction.normal_force": Math.round(x * state.grip * 1e3) / 1e3 }) }];

function makeKnob(knob) {
  const place = Object.assign(made($("knobs"), "div"), { className: "knob", id: `knob-${knob.name}`, tabIndex: 0 });
  const own = { role: "slider", "aria-label": knob.name, "aria-valuemin": 0, "aria-valuemax": 1 };
  for (const [name, value] of Object.entries(own)) place.setAttribute(name, value);
  const [, , text] = ["i", "b", "span"].map((tag, k) => made(place, tag, k ? knob.name : ""));
  const step = 1 / 1023, turn = (x) => knob.turn(Math.max(0, Math.min(1, x)));
  const keys = { ArrowUp: 4, ArrowRight: 4, ArrowDown: -4, ArrowLeft: -4, PageUp: 40, PageDown: -40, Home: -1e9, End: 1e9 };
  place.addEventListener("keydown", (event) => {
    if (!(event.key in keys)) return;
    event.preventDefault();
    const many = event.shiftKey ? Math.sign(keys[event.key]) : keys[event.key];
    turn(knob.at(state.values) + many * step * (knob.name === "grip" ? 3 : 1));
  });
  let from = null;
  place.addEventListener("pointerdown", (event) => {
    place.setPointerCapture(event.pointerId);
    from = { x: event.clientX, y: event.clientY, at: knob.at(state.values) };
  });
  place.addEventListener("pointermove", (event) => {
    if (from) turn(from.at + (from.y - event.clientY + event.clientX - from.x) / (event.shiftKey ? 2000 : 250));
  });
  for (const end of ["pointerup", "pointercancel"]) place.addEventListener(end, () => { from = null; });
  place.addEventListener("wheel", (event) => {
    if (document.activeElement !== place) return; // the page scrolls
    event.preventDefault();
    turn(knob.at(state.values) - Math.sign(event.deltaY) * 4 * step);
  }, { passive: false });
  knob.show = () => {
    const at = knob.at(state.values), words = `${state.values[knob.key].toFixed(knob.digits).replace("-", "−")} ${knob.unit}`;
    place.style.setProperty("--at", at);
    text.textContent = words;
    place.setAttribute("aria-valuenow", at.toFixed(4));
    place.setAttribute("aria-valuetext", words);
  };
}

function show() {
  state.grip = Math.max(state.grip, state.values["friction.normal_force"]); // N, the end of its knob's scale
  for (const knob of KNOBS) knob.show();
  $("scene").value = state.setting.scene;
  $("scene").title = DATA.scenes[state.setting.scene].text;
  $("waveform").value = state.values["drive.waveform"];
  $("polarity").value = String(state.values["coil.polarity"]);
}

// --- what is told ---------------------------------------------------------------------------------
const tell = (id, ...words) => words.forEach((text, k) => { $(`told-${id}`).children[k].textContent = text; });
const signed = (value, digits) => `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)}`;

/* Means over the whole periods of the newest second. */
function means() {
  const from = state.marks[0], to = state.marks.at(-1);
  if (!to || to[0] - from[0] <= 0) return null;
  const time = to[0] - from[0], rate = (name) => (to[TOLD.indexOf(name)] - from[TOLD.indexOf(name)]) / time;
  const v = state.values, sense = v["coil.count"] * v["circuit.sense_resistance"];
  return {
    velocity: rate("z_part"), stick: rate("stick_time"), hits: rate("impacts") * time / (state.marks.length - 1),
    heat: rate("energy_copper") * v["coil.resistance"] / (v["coil.resistance"] + sense), time,
    clamped: rate("output_high_time") + rate("output_low_time") + rate("current_limit_time"),
  };
}

function tellAll() {
  const found = means(), budget = slipBudget(state.values);
  state.found = found;
  if (found) {
    tell("v", `${signed(1e3 * found.velocity, 2)} mm/s`, `over ${found.time.toFixed(2)} s; up is positive`);
    tell("stick", `${(100 * found.stick).toFixed(0)} %`, "of the time");
    tell("hits", found.hits.toFixed(1), `amplifier at a limit ${(100 * found.clamped).toFixed(0)} % of the time`);
    const cold = found.heat * DATA.scenes[state.setting.scene].rise, rise = cold / Math.max(1e-3, 1 - DATA.copper * cold);
    tell("heat", `${found.heat.toFixed(2)} W`, found.heat > DATA.heat ? `above the ${DATA.heat.toFixed(1)} W of its data sheet's drives`
      : `in the long run some ${rise.toFixed(0)} K warmer`);
    $("told-heat").style.color = found.heat > DATA.heat ? "var(--warn)" : "";
  } else for (const id of ["v", "stick", "hits", "heat"]) tell(id, "…", "from whole periods");
  const camera = curves.value("camera", 1), reached = new Envelope(1);
  for (let row = Math.max(history_.first, history_.last - RATE, history_.turned + 1); row <= history_.last; row += 8) reached.put(0, camera(row));
  const [[least], [most]] = [reached.low, reached.high];
  tell("slip", `${signed(budget.up[0], 0)} / ${signed(budget.down[0], 0)} m/s²`, `going up / down; where the surface rises ${signed(budget.up[1], 0)} / ${signed(budget.down[1], 0)}`);
  const ways = Object.keys(budget).filter((way) => least < budget[way][0] || most > budget[way][1]).join(" or ");
  if (most >= least) tell("peak", `${signed(least, 0)} … ${signed(most, 0)} m/s²`, ways ? `a part going ${ways} slips` : "by this no part slips");
}

// --- laid over: a run of the server, a trial's record --------------------------------------------------
const NAMED = { coil_current: "current" }, DASHED = [5, 4], DOTTED = [2, 3];
const record = DATA.record && new Overlay({ ...DATA.record, begin: 0 }, DOTTED,
  { ...NAMED, camera: "a_surface", a_surface: "" });

/* How far the page's newest period is from what is laid over it, in words. */
function apart(name, other, theirs) {
  const own = state.found, there = 1e3 * theirs, here = own ? 1e3 * own.velocity : NaN, words = [];
  if (theirs !== null) words.push(`${signed(there, 2)} mm/s, here ${signed(here, 2)}, difference ${signed(here - there, 3)}`);
  for (const [which, factor, digits, unit] of [["coil_current", 1, 3, "A"], ["v_surface", 1e3, 1, "mm/s"]]) {
    const off = other.off(which, history_)?.map((v) => (factor * v).toFixed(digits));
    if (off) words.push(`${which === "coil_current" ? "current" : "surface"} off by ${off[0]} of ${off[1]} ${unit} rms`);
  }
  return `${name}: ${words.join("; ")}`;
}

function lay(other, name, velocity) {
  state.others = [...state.others.filter(({ dash }) => dash !== other.dash), other];
  $("compared").textContent = apart(name, other, velocity);
}

async function compare() {
  const setting = state.setting, model = $("model").value;
  const asked = { method: "POST", headers: { "Content-Type": "text/plain" }, body: linkOf(setting) };
  $("compare").disabled = true;
  $("compared").textContent = "ngspice runs …";
  try {
    const answer = await fetch(`run/${model}`, asked).catch(() => refuse("Nobody answers: start cosim live again."));
    const told = await answer.json();
    if (!answer.ok) throw new Error(told.error);
    if (setting !== state.setting) throw new Error("The setting has been turned meanwhile.");
    lay(new Overlay(told, DASHED, NAMED), `${model} (dashed)`, told.v_average);
  } catch (error) { $("compared").textContent = error.message; }
  $("compare").disabled = false;
}

function layRecord() {
  const on = !state.others.includes(record), f = state.values["drive.frequency"], part = record.values("v_part") ?? [];
  const whole = Math.floor(part.length * record.step * f) / f, v = part.slice(0, Math.round(whole / record.step)).filter((x) => x !== null);
  $("record").setAttribute("aria-pressed", String(on));
  state.others = state.others.filter((one) => one !== record);
  if (!on) return;
  record.frequency = f;
  record.fit(history_);
  lay(record, `${record.name} (dotted)`, v.length ? v.reduce((a, b) => a + b) / v.length : null);
}

// --- begin ------------------------------------------------------------------------------------------
const options = (select, names) => { for (const name of names) made(select, "option", name); };

/* The setting of the address, or of the page itself. */
function opened() {
  try {
    if (location.hash.length > 1) return settingOf(location.hash);
  } catch (error) { fault(error.message); }
  return settingOf(DATA.start);
}

async function change(sound) {
  const next = sound ? await sounding() : plain();
  host?.end();
  host = next;
  begin(true);
  if (sound) loudness();
  $("sound").setAttribute("aria-pressed", String(sound));
  $("loud").hidden = !sound;
}

const loudness = () => host.post({ kind: "gain", gain: 4 * Number($("gain").value) ** 2 });

options($("scene"), Object.keys(DATA.scenes));
options($("waveform"), DATA.keys["drive.waveform"].choices);
KNOBS.forEach(makeKnob);
$("scene").onchange = () => take({ scene: $("scene").value, changes: {} }, true);
$("waveform").onchange = () => {
  const waveform = $("waveform").value, own = ["steps", "pieces"].includes(waveform), values = { "drive.waveform": waveform };
  if (!waveform.includes("sawtooth") && state.values["drive.reset_time"]) values["drive.reset_time"] = 0;
  if (waveform !== "square" && state.values["drive.duty"] !== 0.5) values["drive.duty"] = 0.5;
  if (own) values["drive.table"] = state.values["drive.table"] ?? [[0, 0.5], [0.25, 0], [0.5, -0.5], [0.75, 0]];
  const next = changed(state.setting, values);
  if (!own) delete next.changes["drive.table"];
  take(next);
};
$("polarity").onchange = () => set({ "coil.polarity": Number($("polarity").value) });
$("speed").onchange = () => { state.speed = Number($("speed").value); pace(); };
$("pause").onclick = () => { state.paused = !state.paused; $("pause").setAttribute("aria-pressed", String(state.paused)); pace(); };
$("sound").onclick = () => {
  const told = (textContent, disabled) => Object.assign($("sound"), { textContent, disabled });
  told("Starting …", true); // a second click would start a second machine
  change($("sound").getAttribute("aria-pressed") !== "true").catch((error) => fault(`No sound: ${error.message}`)).finally(() => told("Sound", false));
};
$("gain").oninput = () => loudness();
$("again").onclick = () => take({ scene: state.setting.scene, changes: {} }, true);
$("copy").onclick = () => {
  const link = linkOf(state.setting), told = `cosim run '${link}'`;
  history.replaceState(null, "", link);
  $("compared").textContent = told;
  navigator.clipboard?.writeText(location.href).then(() => { $("compared").textContent = `Copied. In a shell: ${told}`; }, () => {});
};
$("asking").hidden = !DATA.models.length;
options($("model"), DATA.models);
$("compare").onclick = compare;
$("record").hidden = !record;
$("record").onclick = layRecord;
addEventListener("hashchange", () => { fault(""); const next = opened(), wrong = $("fault").textContent; take(next, true); if (wrong) fault(wrong); });

change(false);
show();
const due = { curves: 0, told: 0 };
function frame(time) {
  requestAnimationFrame(frame);
  if (!history_.last) return;
  drawMachine($("picture"), history_.now(), state.values, lit);
  if (time < due.curves) return;
  due.curves = time + 45;
  const how = { slow: state.speed < 1, onSurface: $("heights").value === "slip", others: state.others, budget: slipBudget(state.values) };
  curves.draw(history_, Number($("window").value), how);
  if (time < due.told) return;
  due.told = time + 200;
  tellAll();
}
requestAnimationFrame(frame);
