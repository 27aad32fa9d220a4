"use strict";
/* The machine to scale: the widths are made up, the heights and ways are one scale, which the legend
   tells. Masses stand for themselves by their labels. */

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

function spring(ink, x, top, bottom, coils, half) {
  ink.beginPath();
  ink.moveTo(x, top);
  const step = (bottom - top) / (2 * coils);
  for (let k = 0; k < 2 * coils; k++) ink.lineTo(x + (k % 2 ? half : -half), top + (k + 0.5) * step);
  ink.lineTo(x, bottom);
  ink.stroke();
}

/* A force as an arrow from (x, y), up for positive ones; `scale` in pixels a newton. */
function arrow(ink, x, y, force, scale, colour) {
  const length = Math.max(-70, Math.min(70, force * scale));
  if (Math.abs(length) < 3) return;
  const end = y - length, tip = Math.sign(length) * 6;
  ink.strokeStyle = ink.fillStyle = colour;
  ink.lineWidth = 2.5;
  ink.beginPath();
  ink.moveTo(x, y);
  ink.lineTo(x, end + tip);
  ink.stroke();
  ink.beginPath();
  ink.moveTo(x, end);
  ink.lineTo(x - 4.5, end + tip);
  ink.lineTo(x + 4.5, end + tip);
  ink.fill();
  ink.lineWidth = 1;
}

/* `now`: values by the names of COLUMNS, and `lit`, since when (ms) a wall was met. */
function drawMachine(canvas, now, values, lit) {
  const { ink, width, height } = inked(canvas), colour = colours();
  const travel = values["mechanics.travel"], halves = height / 2;
  const ramHalf = 2e-3, wall = 1e-3, housing = travel + ramHalf + wall;
  const scale = (height - 96) / (2 * housing + 6e-3); // pixels a metre
  const middle = halves + 6, y = (z) => middle - z * scale;
  const rest = restOf(values);
  const zs = now.z_surface - rest, zr = now.z_ram - rest;
  const wide = Math.min(width, 400), left = (width - wide) / 2;
  const box = { x: left + wide * 0.2, w: wide * 0.28 }, plate = { x: left + wide * 0.5, w: 12 };
  ink.font = "12px system-ui, sans-serif";
  ink.textBaseline = "middle";

  // Ground with the flexures.
  ink.strokeStyle = colour("steel");
  ink.fillStyle = colour("fill");
  const ground = left + 6;
  ink.fillRect(ground, 24, 10, height - 60);
  ink.strokeRect(ground, 24, 10, height - 60);
  for (const z of [0.55 * housing, -0.55 * housing]) {
    ink.lineWidth = 2;
    ink.beginPath();
    ink.moveTo(ground + 10, y(z));
    ink.bezierCurveTo(ground + 30, y(z), box.x - 22, y(z + zs), box.x, y(z + zs));
    ink.stroke();
  }
  ink.lineWidth = 1;

  // The surface: the actuator's body, hollow, with its end walls, and the platform.
  const top = y(zs + housing), bottom = y(zs - housing), thick = wall * scale;
  const hit = performance.now() - lit.time < 90 ? lit.side : 0;
  ink.fillStyle = colour("body");
  ink.strokeStyle = colour("ink");
  ink.fillRect(box.x, top, 8, bottom - top);
  ink.fillRect(box.x + box.w - 8, top, 8, bottom - top);
  ink.fillStyle = hit > 0 ? colour("warn") : colour("body");
  ink.fillRect(box.x, top, box.w, thick);
  ink.fillStyle = hit < 0 ? colour("warn") : colour("body");
  ink.fillRect(box.x, bottom - thick, box.w, thick);
  ink.strokeRect(box.x, top, box.w, bottom - top);
  ink.strokeRect(box.x + 8, top + thick, box.w - 16, bottom - top - 2 * thick);
  ink.fillStyle = colour("body");
  ink.fillRect(box.x + box.w, y(zs) - 7, plate.x - box.x - box.w, 14);
  ink.fillRect(plate.x, y(zs) - 62, plate.w, 124);
  ink.strokeRect(plate.x, y(zs) - 62, plate.w, 124);

  // The ram on its suspension.
  const ram = { x: box.x + 16, w: box.w - 32, top: y(zr + ramHalf), bottom: y(zr - ramHalf) };
  ink.strokeStyle = colour("steel");
  spring(ink, ram.x + ram.w / 2, top + thick, ram.top, 3, 7);
  spring(ink, ram.x + ram.w / 2, ram.bottom, bottom - thick, 3, 7);
  ink.fillStyle = colour("steel");
  ink.strokeStyle = colour("ink");
  ink.fillRect(ram.x, ram.top, ram.w, ram.bottom - ram.top);
  ink.strokeRect(ram.x, ram.top, ram.w, ram.bottom - ram.top);
  ink.fillStyle = colour("card");
  ink.textAlign = "center";
  ink.fillText("ram", ram.x + ram.w * 0.6, (ram.top + ram.bottom) / 2);

  // The part, endless to the eye: marks that go by, and its contact with the surface.
  const part = { x: plate.x + plate.w, w: wide * 0.13 }, pitch = 2e-3 * scale;
  const sticks = now.sticking > 0.5, mark = sticks ? colour("c") : colour("b");
  ink.fillStyle = colour("fill");
  ink.fillRect(part.x, 24, part.w, height - 62);
  ink.strokeStyle = colour("line");
  ink.save();
  ink.beginPath();
  ink.rect(part.x, 24, part.w, height - 60);
  ink.clip();
  ink.beginPath();
  const shift = (now.z_part - rest) * scale;
  for (let k = Math.ceil((shift - height) / pitch); k * pitch < shift + height; k++) {
    const at = middle - shift + k * pitch;
    ink.moveTo(part.x, at);
    ink.lineTo(part.x + (k % 5 ? part.w / 3 : part.w), at);
  }
  ink.strokeStyle = colour("soft");
  ink.stroke();
  ink.restore();
  ink.strokeStyle = colour("ink");
  ink.strokeRect(part.x, 24, part.w, height - 60);
  ink.fillStyle = mark;
  ink.fillRect(part.x - 2, y(zs) - 62, 4, 124);

  // The springed plate that presses the part.
  const press = part.x + part.w;
  ink.fillStyle = colour("body");
  ink.fillRect(press, middle - 46, 8, 92);
  ink.strokeStyle = colour("ink");
  ink.strokeRect(press, middle - 46, 8, 92);
  ink.strokeStyle = colour("steel");
  ink.beginPath();
  const end = left + wide - 30;
  for (let k = 0; k <= 8; k++) ink.lineTo(press + 8 + (end - press - 8) * k / 8, middle + (k % 8 ? (k % 2 ? 7 : -7) : 0));
  ink.stroke();
  ink.strokeRect(end, middle - 20, 8, 40);

  // Forces.
  const coil = now.coil_current * values["coil.force_factor"] * values["coil.polarity"];
  ink.textAlign = "left";
  const grip = Math.max(1e-3, values["friction.normal_force"]);
  arrow(ink, part.x + part.w / 2, y(0), now.friction_force, 40 / grip, mark);
  arrow(ink, ram.x + 12, (ram.top + ram.bottom) / 2, coil, 20, colour("a"));
  if (now.wall_contact) arrow(ink, ram.x + ram.w - 6, (ram.top + ram.bottom) / 2, now.wall_force, 2, colour("warn"));

  // Words.
  ink.textAlign = "center";
  ink.fillStyle = colour("soft");
  ink.fillText("surface", box.x + box.w / 2 + 6, 12);
  ink.fillText("part", part.x + part.w / 2, 12);
  ink.fillText("plate", press + 14, 12);
  ink.fillStyle = mark;
  ink.font = "600 13px system-ui, sans-serif";
  ink.fillText(sticks ? "sticks" : "slips", part.x + part.w / 2, height - 27);
  ink.font = "12px system-ui, sans-serif";
  ink.fillStyle = colour("soft");
  const bar = 2e-3 * scale;
  ink.fillRect(left + 28, height - 14, bar, 2);
  ink.textAlign = "left";
  ink.fillText("2 mm", left + 34 + bar, height - 13);
  ink.textAlign = "right";
  let x = left + wide - 4;
  for (const [name, what] of [["wall", "warn"], ["friction", sticks ? "c" : "b"], ["coil", "a"], ["forces:", "soft"]]) {
    ink.fillStyle = colour(what);
    ink.fillText(name, x, height - 13);
    x -= ink.measureText(name).width + 9;
  }
}

/* The surface's height at rest, m. */
function restOf(values) {
  const m = (key) => values[`mechanics.${key}`];
  const mass = m("ram_mass") + m("surface_mass") + m("part_mass") / m("n_surfaces");
  return -mass * m("gravity") / m("flexure_stiffness");
}
