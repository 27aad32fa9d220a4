/* A setting is a built-in scene and its changed keys; its link is the address's fragment. DATA is
   what cosim/live/rigs.py has made of the scenes, their keys and the firmware. */

const TWINS = { "drive.pot_max": "drive.amplitude", "drive.pot_frequency": "drive.frequency",
  "drive.pot_offset": "drive.offset" };
for (const [knob, key] of Object.entries(TWINS)) TWINS[key] = knob;
const has = (object, name) => Object.prototype.hasOwnProperty.call(object, name);
const refuse = (sentence) => { throw new Error(sentence); };

/* The value that a link's text stands for; throws a sentence. */
function valueOf(key, text) {
  if (/^(run|coupling)\.[a-z_]+$/.test(key)) return text; // for cosim run; nothing here
  const known = has(DATA.keys, key) ? DATA.keys[key] : refuse(`This page cannot turn “${key.slice(0, 60)}”; cosim run may know it.`);
  if (known.choices) return known.choices.find((one) => String(one) === text) ?? refuse(`${key} must be ${known.choices.join(", ")}.`);
  if (known.table) return tableOf(key, text);
  const value = /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(text) ? Number(text) : NaN;
  if (value >= known.low && value <= known.high && (!known.whole || Number.isInteger(value))) return value;
  return refuse(`${key} must be a ${known.whole ? "whole " : ""}number from ${known.low} to ${known.high}.`);
}

function tableOf(key, text) {
  let pairs = null;
  try { pairs = JSON.parse(text); } catch { /* told below */ }
  const fits = Array.isArray(pairs) && pairs.length >= 1 && pairs.length <= 64 && pairs.every((pair, k) =>
    Array.isArray(pair) && pair.length === 2 && pair.every(Number.isFinite) && Math.abs(pair[1]) <= 0.5 &&
    pair[0] >= (k ? pairs[k - 1][0] : 0) && pair[0] <= 1);
  return fits ? pairs : refuse(`${key} must be 1 to 64 pairs of phase, 0 to 1, and level, -0.5 to 0.5.`);
}

/* What is wrong with a drive whose keys are right each by itself. */
const impossible = (v) => (v["drive.reset_time"] * v["drive.frequency"] >= 1 ? "drive.reset_time must be below the period."
  : ["steps", "pieces"].includes(v["drive.waveform"]) && !v["drive.table"] ? `drive.waveform ${v["drive.waveform"]} needs drive.table.` : "");

/* The setting of a link; throws a sentence. */
function settingOf(link) {
  const at = link.indexOf("#"), text = at < 0 ? link : link.slice(at + 1);
  if (text.length > DATA.longest) refuse("The link is too long.");
  const [[first, scene], ...pairs] = text.split("&").map((part) => {
    const equals = part.indexOf("=");
    if (equals < 1) refuse("A link is #scene=NAME&table.key=value&…");
    try {
      return [part.slice(0, equals), part.slice(equals + 1)].map(decodeURIComponent);
    } catch {
      refuse("The link has a % without two digits.");
    }
  });
  if (first !== "scene") refuse("A link begins with #scene=NAME.");
  if (!has(DATA.scenes, scene)) refuse(`This page has no scene “${scene.slice(0, 60)}”.`);
  const changes = {};
  for (const [key, value] of pairs) {
    if (has(changes, key)) refuse(`The link has ${key.slice(0, 60)} twice.`);
    changes[key] = valueOf(key, value);
    if (has(TWINS, key) && has(changes, TWINS[key])) refuse(`${key} and ${TWINS[key]} say the same thing twice.`);
  }
  const wrong = impossible(valuesOf({ scene, changes }));
  return wrong ? refuse(wrong) : { scene, changes };
}

/* The link of a setting: what a run needs to repeat it. */
function linkOf({ scene, changes }) {
  const all = { ...changes };
  if (DATA.scenes[scene].model !== "limited") all["circuit.model"] = "limited";
  const pairs = Object.keys(all).sort().map((key) => {
    const value = typeof all[key] === "object" ? JSON.stringify(all[key]) : String(all[key]);
    return `&${key}=${encodeURIComponent(value).replace(/%(2C|5B|5D)/g, decodeURIComponent)}`;
  });
  return `#scene=${encodeURIComponent(scene)}${pairs.join("")}`;
}

/* A setting with some keys changed; a knob replaces its value and the other way round. */
function changed({ scene, changes }, values) {
  const kept = Object.entries(changes).filter(([key]) => !has(values, TWINS[key]));
  return { scene, changes: { ...Object.fromEntries(kept), ...values } };
}

const reading = (pot) => Math.min(DATA.knobs.amplitude.length - 1, Math.floor(pot * DATA.knobs.amplitude.length));

/* All values of a setting, with what its knobs stand for. */
function valuesOf({ scene, changes }) {
  const values = Object.fromEntries(Object.entries(DATA.keys).map(([key, known]) => [key, known.default]));
  for (const layer of [DATA.scenes[scene].values, changes]) {
    for (const [key, value] of Object.entries(layer)) {
      if (!has(DATA.keys, key)) continue;
      if (has(TWINS, key)) values[TWINS[key]] = null;
      values[key] = value;
    }
  }
  const { amplitude, frequency, pin } = DATA.knobs, d = "drive.";
  if (values[d + "pot_max"] !== null) values[d + "amplitude"] = amplitude[reading(values[d + "pot_max"])];
  if (values[d + "pot_frequency"] !== null) values[d + "frequency"] = frequency[reading(values[d + "pot_frequency"])];
  if (values[d + "pot_offset"] !== null) values[d + "offset"] = pin[reading(values[d + "pot_offset"])] - values[d + "amplitude"] / 2;
  return values;
}

/* The codes at which the three knobs stand, the nearest where the setting has volts and hertz. */
function codesOf(values) {
  const nearest = (table, value) => table.reduce((best, one, k) =>
    (Math.abs(one - value) < Math.abs(table[best] - value) ? k : best), 0);
  const { amplitude, frequency, pin } = DATA.knobs;
  return [["pot_max", amplitude, "amplitude", 0], ["pot_frequency", frequency, "frequency", 0],
    ["pot_offset", pin, "offset", 0.5]].map(([knob, table, key, half]) => {
    const pot = values[`drive.${knob}`];
    return pot !== null ? reading(pot) : nearest(table, values[`drive.${key}`] + half * values["drive.amplitude"]);
  });
}

/* What the machine takes. */
function setupOf(values, scene) {
  const drive = {}, reals = {}, integers = { ...DATA.scenes[scene].integers };
  for (const [key, value] of Object.entries(values)) {
    const [table, name] = key.split("."), { variable, whole } = DATA.keys[key];
    if (table === "drive") drive[name] = value;
    else if (variable && value !== null && key !== "friction.normal_force") (whole ? integers : reals)[variable] = value;
  }
  reals.force_factor *= values["coil.polarity"];
  reals.output_high = values["circuit.supply"] - values["circuit.swing_loss_high"];
  reals.output_low = values["circuit.swing_loss_low"] - values["circuit.supply"];
  return { drive, reals, integers, force: values["friction.normal_force"] };
}

/* Beyond which accelerations of the surface (m/s²) a part that sticks slips, going up and down:
   lowest and highest. */
function slipBudget(values) {
  const force = values["friction.normal_force"] * values["mechanics.n_surfaces"] / values["mechanics.part_mass"];
  const grip = values["friction.mu_s"] * force, plate = values["friction.mu_plate"] * force;
  const g = values["mechanics.gravity"];
  return { up: [-grip - plate - g, grip - plate - g], down: [-grip + plate - g, grip + plate - g] };
}
