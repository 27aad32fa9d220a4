"""Friction laws compared on a part that a vibrating surface holds: creep and cost.

A part of the scene ``reference`` begins to slip down at 20 mm/s, comes to rest on the surface,
which moves up and down at 40 Hz with 15 m/s², and is then held with six tenths of the largest
static friction. Each law is solved as its users do, by SciPy's LSODA. Creep is the mean slip
velocity of the held part; with set-valued Coulomb friction it is 0.

``tanh``    F = µ(u) F_n tanh(u/v0), with µ falling from µ_s to µ_k over 30 v0
``Karnopp`` within a band of velocity friction balances the load (Karnopp, "Computer simulation of
            stick-slip friction", J. Dyn. Syst. Meas. Control 107 (1985) 100); a solver that chooses
            its own steps cannot reset the velocity there, so the remaining velocity stays
``LuGre``   a bristle of stiffness σ0 and damping σ1 (Canudas de Wit et al., "A new model for
            control of systems with friction", IEEE Trans. Autom. Control 40 (1995) 419)
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from math import cos, exp, isfinite, nan, pi, sqrt, tanh
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from benchmarks.peers.lsoda import Machine, U
from benchmarks.peers.lsoda import run as run_machine
from cosim.drive.command import Command
from cosim.files.picture import Picture
from cosim.scene import Scene, load
from cosim.studies.accuracy.cases import CASES, reference
from cosim.studies.plots import BLUE, GREEN, VERMILION, panels
from cosim.studies.report import Report, Row, span

CREEP, ERROR = "creep of a held part [µm/s]", "error in the machine / range"
"""Names of columns, and labels of the figure's axes."""

FREQUENCY, ACCELERATION, SLIP = 40.0, 15.0, 0.02
"""The surface's vibration, Hz and m/s²; initial slip velocity of the part, m/s."""
SETTLED, DURATION = 0.5, 1.0  # s; creep is measured between them
_RTOL = 1e-8

Law = Callable[[float, float, float], tuple[float, float]]
"""Friction (N) and rate of the bristle's deflection (m/s), from slip velocity u (m/s), deflection z
(m), and the load (N), which is the friction that would keep the part on the surface."""

LAWS = {"tanh": (1e-3, 1e-4, 1e-5), "Karnopp": (1e-3, 1e-4, 1e-5), "LuGre": (1e4, 1e5, 1e6)}
"""Laws and their widths in slip velocity, m/s; for LuGre stiffnesses of the bristle, N/m."""
COULOMB = "set-valued Coulomb"
_RTOL_IN_THE_MACHINE = 1e-6


def report() -> Report:
    """The report on the effect of smoothed friction laws on a held part and in the machine."""
    moved = {(row["law"], row["width"]): row for row in in_the_machine()}
    nothing = {ERROR: nan, "CPU time [s]": nan}
    rows = [row | moved.get((row["law"], row["width"]), nothing) for row in creep()]
    exact, *smoothed = rows
    errors = [row[ERROR] / exact[ERROR] for row in smoothed if isfinite(row[ERROR])]
    message = (
        "Every smoothed friction law lets a held part creep; set-valued friction does not, and is "
        f"{span(errors)} times as accurate in the machine"
    )
    notes = [
        f"{message}.",
        "A held part: a part of the scene reference slips down at 20 mm/s at first, comes to rest "
        "on a surface that vibrates at 40 Hz with 15 m/s², and is then held at six tenths of what "
        "static friction can carry. Creep is what it still slips. Smoothed laws are solved by "
        f"LSODA with a tolerance of {_RTOL:g}, set-valued friction in closed form.",
        "In the machine: the whole scene stick-slip as one ODE, solved by LSODA with a tolerance "
        f"of {_RTOL_IN_THE_MACHINE:g} and each law in the place of set-valued Coulomb friction, "
        "against the reference solution with that. So the error is the law's and not the solver's, "
        "but for Coulomb, which is solved with events. Karnopp's band is left out: LSODA comes to "
        "a stop at its edges.",
    ]
    return Report(
        "friction", "Laws of friction", rows, notes, {"Each law": rows},
        {"": partial(draw, rows, message)}, message,
    )  # fmt: skip


def law_of(name: str, width: float, scene: Scene) -> Law:
    """A smoothed law with a scene's coefficients; ``width`` as in :data:`LAWS`."""
    f, mu_s, mu_k = scene.friction.normal_force, scene.friction.mu_s, scene.friction.mu_k
    damping = 2.0 * sqrt(width * scene.mechanics.part_mass)  # critical: of part and bristle

    def falling(u: float, over: float) -> float:
        """Coefficient of friction: static at 0, kinetic beyond the slip velocity ``over``, m/s."""
        share = (u / over) ** 2
        return mu_k + (mu_s - mu_k) * (exp(-share) if share < 700.0 else 0.0)

    def smooth(u: float, z: float, load: float) -> tuple[float, float]:
        return f * tanh(u / width) * falling(u, 30.0 * width), 0.0

    def karnopp(u: float, z: float, load: float) -> tuple[float, float]:
        if abs(u) < width:
            return min(max(load, -mu_s * f), mu_s * f), 0.0
        return (mu_k * f if u > 0.0 else -mu_k * f), 0.0

    def lugre(u: float, z: float, load: float) -> tuple[float, float]:
        rate = u - width * abs(u) / (f * falling(u, 1e-3)) * z
        return width * z + damping * rate, rate

    return {"tanh": smooth, "Karnopp": karnopp, "LuGre": lugre}[name]


class _Smoothed(Machine):
    """The whole machine with a smoothed law instead of modes; the last state is the bristle's."""

    scales = np.append(Machine.scales, 1e-6)

    def __init__(self, scene: Scene, drive: Command, law: Law) -> None:
        super().__init__(scene, drive)
        self._law = law
        self.slip = 1  # the mode of slipping, for good

    def friction(self, y: Any, held: float) -> list[float]:
        return list(self._law(y[U], y[-1], held))

    def choose_friction(self, y: Any) -> None:
        """The mode does not change."""

    def friction_event(self, y: Any) -> float:
        return 1.0


def in_the_machine() -> Iterator[Row]:
    """A row a law: error of the part's path in ``stick-slip``, over its range; CPU time, s."""
    case = CASES["stick-slip"]
    scene = load("reference", [*case.overrides, f"run.duration={case.duration!r}"])

    def measured(make: Callable[[Scene, Command], Machine]) -> Row:
        seconds, path = run_machine(scene, case.times(), _RTOL_IN_THE_MACHINE, make)
        return {ERROR: reference(case.name).error(path[np.newaxis]), "CPU time [s]": seconds}

    yield {"law": COULOMB, "width": ""} | measured(Machine)
    for name in ("tanh", "LuGre"):
        for width in LAWS[name]:
            law = law_of(name, width, scene)
            found = measured(lambda s, d, law=law: _Smoothed(s, d, law))
            yield {"law": name, "width": _width(name, width)} | found


def _width(name: str, width: float) -> str:
    return f"{width / 1e3:g} kN/m" if name == "LuGre" else f"{width * 1e6:g} µm/s"


def creep() -> Iterator[Row]:
    """A row for each law: creep (µm/s), error of the position of rest (µm), evaluations."""
    rig = load("reference")
    truth = _stops(rig)

    def row(name: str, width: str, creep: float, error: float, evaluations: int) -> Row:
        found = {CREEP: creep, "error of the stop [um]": error, "evaluations": evaluations}
        return {"law": name, "width": width} | found

    yield row(COULOMB, "", 0.0, 0.0, 0)
    for name, widths in LAWS.items():
        for width in widths:
            settled, end, evaluations = _solved(law_of(name, width, rig), rig)
            creep = 1e6 * (end - settled) / (DURATION - SETTLED)
            yield row(name, _width(name, width), creep, 1e6 * (settled - truth), evaluations)


def _stops(scene: Scene) -> float:
    """Slip (m) until a part with set-valued friction is at rest, in closed form but for the time.

    With Ω the surface's angular frequency, the slip velocity is
    u = u0 + (A/Ω) sin Ωt - (force/m - g) t.
    """
    friction, mechanics, omega = scene.friction, scene.mechanics, 2.0 * pi * FREQUENCY
    rate = friction.mu_k * friction.normal_force / mechanics.part_mass - mechanics.gravity

    def u(t: float) -> float:
        return SLIP + ACCELERATION / omega * np.sin(omega * t) - rate * t

    # The slip ends at the first zero of u, since friction then exceeds the load.
    t: Any = next(t for t in np.arange(1e-4, 0.1, 1e-5) if u(t) < 0.0)
    stop: Any = brentq(u, t - 1e-5, t, xtol=1e-15)  # pyright: ignore[reportArgumentType]
    return float(
        SLIP * stop + ACCELERATION / omega**2 * (1.0 - cos(omega * stop)) - 0.5 * rate * stop**2
    )


def _solved(law: Law, scene: Scene) -> tuple[float, float, int]:
    """Slip (m) at SETTLED and at DURATION, and the number of evaluations."""
    m, g = scene.mechanics.part_mass, scene.mechanics.gravity

    def rates(t: float, y: Any) -> list[float]:
        _, u, z = y  # slip (m), slip velocity (m/s), bristle (m)
        surface = ACCELERATION * cos(2.0 * pi * FREQUENCY * t)
        force, rate = law(u, z, m * (surface + g))
        return [u, surface - force / m + g, rate]

    found = solve_ivp(
        rates,
        (0.0, DURATION),
        [0.0, SLIP, 0.0],
        "LSODA",
        t_eval=(SETTLED, DURATION),
        rtol=_RTOL,
        atol=(1e-12, 1e-12, 1e-14),
        max_step=1e-3,
    )
    return float(found.y[0][0]), float(found.y[0][1]), int(found.nfev)


def draw(rows: Sequence[Row], title: str) -> Picture:
    """Draw the creep of a held part with each law, and the error in the whole machine."""
    note = "µm/s: width of the smoothed law; kN/m: stiffness of its bristle."
    figure, axes = panels(title, note, (11.0, 4.2), 2, sharey=True)
    places = range(len(rows))
    laws = dict.fromkeys(row["law"] for row in rows)
    colors = dict(zip(laws, ("black", VERMILION, BLUE, GREEN), strict=True))
    for axis, column in zip(axes, (CREEP, ERROR), strict=True):
        values = [row[column] for row in rows]
        axis.set(xscale="log", ylim=(len(rows) - 0.5, -0.5), xlabel=column)
        known = [value for value in values if value > 0.0]
        axis.set_xlim(min(known) / 3.0, max(known) * 3.0)
        for place, row, value in zip(places, rows, values, strict=True):
            if value > 0.0:
                axis.plot(value, place, "o", color=colors[row["law"]], ms=8)
            else:
                said = "none" if value == 0.0 else "not solvable by LSODA"
                axis.annotate(said, (0.02, place), xycoords=axis.get_yaxis_transform(), va="center")
    axes[0].set_yticks(places, [f"{row['law']}  {row['width']}" for row in rows])
    return figure
