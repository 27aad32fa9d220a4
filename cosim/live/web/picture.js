"use strict";
/* The machine to scale: the widths are made up, the heights and ways are one scale, which the legend
   tells. Masses stand for themselves by their labels. */

function spring(ink, x, top, bottom, coils, half) {
  ink.beginPath();
  ink.moveTo(x, top);
  const step = (bottom - top) / (2 * coils);
  for (let k = 0; k < 2 * coils; k++) ink.lineTo(x + (k % 2 ? half : -half), top + (k + 0.5) * step);
  ink.lineTo(x, bottom);
  ink.stroke();
}

function box(ink, x, y, wide, high, fill, line) {
  ink.fillStyle = fill;
  ink.fillRect(x, y, wide, high);
  if (!line) return;
  ink.strokeStyle = line;
  ink.strokeRect(x, y, wide, high);
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
  const house = { x: left + wide * 0.2, w: wide * 0.28 }, plate = { x: left + wide * 0.5, w: 12 };
  ink.font = "12px system-ui, sans-serif";
  ink.textBaseline = "middle";

  // Ground with the flexures.
  const ground = left + 6;
  box(ink, ground, 24, 10, height - 60, colour("fill"), colour("steel"));
  for (const z of [0.55 * housing, -0.55 * housing]) {
    ink.lineWidth = 2;
    ink.beginPath();
    ink.moveTo(ground + 10, y(z));
    ink.bezierCurveTo(ground + 30, y(z), house.x - 22, y(z + zs), house.x, y(z + zs));
    ink.stroke();
  }
  ink.lineWidth = 1;

  // The surface: the actuator's body, hollow, with its end walls, and the platform.
  const top = y(zs + housing), bottom = y(zs - housing), thick = wall * scale;
  const hit = performance.now() - lit.time < 90 ? lit.side : 0;
  const body = colour("body"), line = colour("ink"), wallOf = (side) => (hit === side ? colour("warn") : body);
  box(ink, house.x, top, house.w, bottom - top, body, line);
  box(ink, house.x, top, house.w, thick, wallOf(1));
  box(ink, house.x, bottom - thick, house.w, thick, wallOf(-1));
  ink.strokeRect(house.x, top, house.w, bottom - top);
  box(ink, house.x + 8, top + thick, house.w - 16, bottom - top - 2 * thick, colour("card"), line);
  box(ink, house.x + house.w, y(zs) - 7, plate.x - house.x - house.w, 14, body);
  box(ink, plate.x, y(zs) - 62, plate.w, 124, body, line);

  // The ram on its suspension.
  const ram = { x: house.x + 16, w: house.w - 32, top: y(zr + ramHalf), bottom: y(zr - ramHalf) };
  ink.strokeStyle = colour("steel");
  spring(ink, ram.x + ram.w / 2, top + thick, ram.top, 3, 7);
  spring(ink, ram.x + ram.w / 2, ram.bottom, bottom - thick, 3, 7);
  box(ink, ram.x, ram.top, ram.w, ram.bottom - ram.top, colour("steel"), line);
  ink.fillStyle = colour("card");
  ink.textAlign = "center";
  ink.fillText("ram", ram.x + ram.w * 0.6, (ram.top + ram.bottom) / 2);

  // The part, endless to the eye: marks that go by, and its contact with the surface.
  const part = { x: plate.x + plate.w, w: wide * 0.13 }, pitch = 2e-3 * scale;
  const sticks = now.sticking > 0.5, mark = sticks ? colour("c") : colour("b");
  box(ink, part.x, 24, part.w, height - 62, colour("fill"));
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
  ink.strokeStyle = line;
  ink.strokeRect(part.x, 24, part.w, height - 60);
  box(ink, part.x - 2, y(zs) - 62, 4, 124, mark);

  // The springed plate that presses the part.
  const press = part.x + part.w;
  box(ink, press, middle - 46, 8, 92, body, line);
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
  ink.fillText("surface", house.x + house.w / 2 + 6, 12);
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
