/* The machine to scale: the widths are made up, the heights and ways are one scale, which the legend
   tells. Masses stand for themselves by their labels. */

function box(ink, x, y, wide, high, fill, line) {
  Object.assign(ink, { fillStyle: fill, strokeStyle: line, lineWidth: 1 });
  ink.fillRect(x, y, wide, high);
  if (line) ink.strokeRect(x, y, wide, high);
}

/* From one point to another in `turns` turns; the way to the side is across. */
function spring(ink, [x0, y0], [x1, y1], turns, colour) {
  const long = Math.hypot(x1 - x0, y1 - y0), [across, up] = [(y1 - y0) / long, (x1 - x0) / long];
  const points = Array.from({ length: 2 * turns }, (_, k) => {
    const share = (k + 0.5) / (2 * turns), side = k % 2 ? 7 : -7;
    return [x0 + share * (x1 - x0) + side * across, y0 + share * (y1 - y0) + side * up];
  });
  stroke(ink, [[x0, y0], ...points, [x1, y1]], colour);
}

/* A force as an arrow from (x, y), up for positive ones; `scale` in pixels a newton. */
function arrow(ink, x, y, force, scale, colour) {
  const length = Math.max(-70, Math.min(70, force * scale)), end = y - length, tip = end + Math.sign(length) * 6;
  if (Math.abs(length) < 3) return;
  stroke(ink, [[x, y], [x, end], [NaN, NaN], [x - 4.5, tip], [x, end], [x + 4.5, tip]], colour, 2.5);
}

/* `now`: values by the names of COLUMNS, and `lit`, since when (ms) a wall was met. */
function drawMachine(canvas, now, values, lit) {
  const { ink, width, height } = inked(canvas), colour = colours();
  const ramHalf = 2e-3, wall = 1e-3, housing = values["mechanics.travel"] + ramHalf + wall;
  const scale = (height - 96) / (2 * housing + 6e-3); // pixels a metre
  const middle = height / 2 + 6, y = (z) => middle - z * scale, rest = restOf(values);
  const zs = now.z_surface - rest, zr = now.z_ram - rest;
  const wide = Math.min(width, 400), left = (width - wide) / 2, ground = left + 6;
  const house = { x: left + wide * 0.2, w: wide * 0.28 }, plate = { x: left + wide * 0.5, w: 12 };
  const [body, line, steel, soft] = ["body", "ink", "steel", "soft"].map(colour);
  Object.assign(ink, { font: "12px system-ui, sans-serif", textBaseline: "middle" });

  // Ground with the flexures.
  box(ink, ground, 24, 10, height - 60, colour("fill"), steel);
  for (const z of [0.55 * housing, -0.55 * housing]) {
    const bent = (share) => y(z + zs * share * share * (3 - 2 * share)), long = house.x - ground - 10;
    stroke(ink, Array.from({ length: 13 }, (_, k) => [ground + 10 + long * k / 12, bent(k / 12)]), steel, 2);
  }

  // The surface: the actuator's body, hollow, with its end walls, and the platform.
  const top = y(zs + housing), bottom = y(zs - housing), thick = wall * scale;
  const hit = performance.now() - lit.time < 90 ? lit.side : 0, wallOf = (side) => (hit === side ? colour("warn") : body);
  box(ink, house.x, top, house.w, bottom - top, body, line);
  box(ink, house.x, top, house.w, thick, wallOf(1), line);
  box(ink, house.x, bottom - thick, house.w, thick, wallOf(-1), line);
  box(ink, house.x + 8, top + thick, house.w - 16, bottom - top - 2 * thick, colour("card"), line);
  box(ink, house.x + house.w, y(zs) - 7, plate.x - house.x - house.w, 14, body);
  box(ink, plate.x, y(zs) - 62, plate.w, 124, body, line);

  // The ram on its suspension.
  const ram = { x: house.x + 16, w: house.w - 32, top: y(zr + ramHalf), bottom: y(zr - ramHalf) }, centre = ram.x + ram.w / 2;
  spring(ink, [centre, top + thick], [centre, ram.top], 3, steel);
  spring(ink, [centre, ram.bottom], [centre, bottom - thick], 3, steel);
  box(ink, ram.x, ram.top, ram.w, ram.bottom - ram.top, steel, line);
  write(ink, "ram", ram.x + ram.w * 0.6, (ram.top + ram.bottom) / 2, colour("card"), "center");

  // The part, endless to the eye: marks that go by, and its contact with the surface.
  const part = { x: plate.x + plate.w, w: wide * 0.13 }, pitch = 2e-3 * scale, shift = (now.z_part - rest) * scale;
  const sticks = now.sticking > 0.5, of = sticks ? "c" : "b";
  box(ink, part.x, 24, part.w, height - 60, colour("fill"), line);
  within(ink, [part.x, 24, part.w, height - 60], () => {
    for (let k = Math.ceil((shift - height) / pitch); k * pitch < shift + height; k++) {
      const at = middle - shift + k * pitch;
      stroke(ink, [[part.x, at], [part.x + (k % 5 ? part.w / 3 : part.w), at]], soft);
    }
  });
  box(ink, part.x - 2, y(zs) - 62, 4, 124, colour(of));

  // The spring-loaded plate that presses the part.
  const press = part.x + part.w, end = left + wide - 30;
  box(ink, press, middle - 46, 8, 92, body, line);
  spring(ink, [press + 8, middle], [end, middle], 4, steel);
  box(ink, end, middle - 20, 8, 40, "transparent", steel);

  // Forces.
  const coil = now.coil_current * values["coil.force_factor"] * values["coil.polarity"];
  const grip = Math.max(1e-3, values["friction.normal_force"]), half = (ram.top + ram.bottom) / 2;
  arrow(ink, part.x + part.w / 2, y(0), now.friction_force, 40 / grip, colour(of));
  arrow(ink, ram.x + 12, half, coil, 20, colour("a"));
  if (now.wall_contact) arrow(ink, ram.x + ram.w - 6, half, now.wall_force, 2, colour("warn"));

  // Words.
  const names = [["surface", house.x + house.w / 2 + 6], ["part", part.x + part.w / 2], ["plate", press + 14]];
  for (const [name, x] of names) write(ink, name, x, 12, soft, "center");
  write(ink, sticks ? "sticks" : "slips", part.x + part.w / 2, height - 27, colour(of), "center");
  stroke(ink, [[left + 28, height - 13], [left + 28 + pitch, height - 13]], soft, 2);
  write(ink, "2 mm", left + 34 + pitch, height - 13, soft);
  let x = left + wide - 4;
  for (const [name, what] of [["wall", "warn"], ["friction", of], ["coil", "a"], ["forces:", "soft"]]) {
    write(ink, name, x, height - 13, colour(what), "right");
    x -= ink.measureText(name).width + 9;
  }
}

/* The surface's height at rest, m. */
function restOf(values) {
  const m = (key) => values[`mechanics.${key}`];
  const mass = m("ram_mass") + m("surface_mass") + m("part_mass") / m("n_surfaces");
  return -mass * m("gravity") / m("flexure_stiffness");
}
