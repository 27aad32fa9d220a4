"""Laws of friction side by side, on a part that a vibrating surface holds: creep and cost.

A part of the scene ``paper`` begins to slip down at 20 mm/s, comes to rest on the surface, which
moves up and down at 40 Hz with 15 m/s², and is then held at six tenths of what static friction can
carry. Each law is solved as its users do, by SciPy's LSODA. Creep is what a held part still slips:
by set-valued Coulomb friction, nothing.

``tanh``    F = µ(u) F_n tanh(u/v0), with µ falling from µ_s to µ_k over 30 v0
``Karnopp`` within a band of velocity friction balances the load (Karnopp, "Computer simulation of
            stick-slip friction", J. Dyn. Syst. Meas. Control 107 (1985) 100); a solver that chooses
            its own steps cannot reset the velocity there, so what is left of it stays
``LuGre``   a bristle of stiffness σ0 and damping σ1 (Canudas de Wit et al., "A new model for
            control of systems with friction", IEEE Trans. Autom. Control 40 (1995) 419)
"""

from collections.abc import Callable, Iterator
from math import cos, exp, pi, sqrt, tanh
from pathlib import Path
from typing import Any

import numpy as np

from cosim.chart.study import Row, write
from cosim.scene import load

FREQUENCY, ACCELERATION, SLIP = 40.0, 15.0, 0.02
"""Of the surface, Hz and m/s²; of the surface against the part at first, m/s."""
SETTLED, DURATION = 0.5, 1.0
_RTOL = 1e-8

Law = Callable[[float, float, float], tuple[float, float]]
"""Friction (N) and the bristle's rate (m/s), from slip velocity u, bristle z, and the load (N) that
would keep the part on the surface."""


def run(out: Path) -> None:
    """Write ``friction`` as csv, md and json into ``out``."""
    note = (
        "A part of the scene paper slips down at 20 mm/s at first, comes to rest on a surface that "
        "vibrates at 40 Hz with 15 m/s², and is then held at six tenths of what static friction "
        "can carry. Creep is what it still slips. Smoothed laws are solved by LSODA."
    )
    tables = {"A held part": list(creep())}
    write(out, "friction", "Laws of friction: creep and cost", tables, [note])


def creep() -> Iterator[Row]:
    """Of each law: creep (µm/s), error in where the part comes to rest (µm), evaluations."""
    paper = load("paper")
    m, g = paper.mechanics.part_mass, paper.mechanics.gravity
    f, mu_s, mu_k = paper.friction.normal_force, paper.friction.mu_s, paper.friction.mu_k

    def acceleration(t: float) -> float:
        return ACCELERATION * cos(2.0 * pi * FREQUENCY * t)

    def smooth(v0: float) -> Law:
        return lambda u, z, load: (
            f * tanh(u / v0) * (mu_k + (mu_s - mu_k) * exp(-((u / (30.0 * v0)) ** 2))),
            0.0,
        )

    def karnopp(band: float) -> Law:
        def law(u: float, z: float, load: float) -> tuple[float, float]:
            if abs(u) < band:
                return min(max(load, -mu_s * f), mu_s * f), 0.0
            return (mu_k * f if u > 0.0 else -mu_k * f), 0.0

        return law

    def lugre(stiffness: float) -> Law:
        damping, stribeck = 2.0 * sqrt(stiffness * m), 1e-3

        def law(u: float, z: float, load: float) -> tuple[float, float]:
            bound = f * (mu_k + (mu_s - mu_k) * exp(-((u / stribeck) ** 2)))
            rate = u - stiffness * abs(u) / bound * z
            return stiffness * z + damping * rate, rate

        return law

    truth = _stops(acceleration, m, g, mu_k * f)
    yield {
        "law": "Coulomb, exact",
        "width": "-",
        "creep [um/s]": 0.0,
        "error of the stop [um]": 0.0,
        "evaluations": "-",
    }
    for name, make, widths in (
        ("tanh", smooth, (1e-3, 1e-4, 1e-5, 1e-6)),
        ("Karnopp", karnopp, (1e-3, 1e-4, 1e-5)),
        ("LuGre", lugre, (1e4, 1e5, 1e6)),
    ):
        unit = "N/m" if name == "LuGre" else "m/s"
        for width in widths:
            settled, end, evaluations = _solved(make(width), acceleration, m, g)
            yield {
                "law": name,
                "width": f"{width:g} {unit}",
                "creep [um/s]": 1e6 * (end - settled) / (DURATION - SETTLED),
                "error of the stop [um]": 1e6 * (settled - truth),
                "evaluations": evaluations,
            }


def _stops(acceleration: Callable[[float], float], m: float, g: float, force: float) -> float:
    """Slip (m) until a part with set-valued friction is at rest, in closed form but for its time.

    With Ω the surface's angular frequency u = u0 + (A/Ω) sin Ωt - (force/m - g) t.
    """
    from scipy.optimize import brentq

    omega, rate = 2.0 * pi * FREQUENCY, force / m - g

    def u(t: float) -> float:
        return SLIP + ACCELERATION / omega * np.sin(omega * t) - rate * t

    # Friction is stronger than the load throughout the slip, so the first zero is its end.
    t: Any = next(t for t in np.arange(1e-4, 0.1, 1e-5) if u(t) < 0.0)
    stop: Any = brentq(u, t - 1e-5, t, xtol=1e-15)  # pyright: ignore[reportArgumentType]
    return float(
        SLIP * stop + ACCELERATION / omega**2 * (1.0 - cos(omega * stop)) - 0.5 * rate * stop**2
    )


def _solved(
    law: Law, acceleration: Callable[[float], float], m: float, g: float
) -> tuple[float, float, int]:
    """Slip (m) once settled and at the end, and the number of evaluations."""
    from scipy.integrate import solve_ivp

    def rates(t: float, y: Any) -> list[float]:
        _, u, z = y
        load = m * (acceleration(t) + g)
        force, rate = law(u, z, load)
        return [u, acceleration(t) - force / m + g, rate]

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
