"""Reference solution of two surfaces that hold a part between them and move by themselves.

All bodies in absolute coordinates; the friction forces of sticking surfaces are unknowns of one
linear system with the accelerations. Integrated piece by piece between events with SciPy's DOP853.
Compliant walls, given currents. Shares neither code nor formulas with the FMU. SI units.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]
Current = Callable[[float, float], float]
"""A at a time (s), of the smooth piece in which another time (s) lies."""

Z_PART, V_PART = 8, 9
"""The state: height and velocity of surface, then of ram, for each surface; then of the part."""

STILL = 1e-9  # m/s; slips slower than this, at an event, are none


class TwoSurfaces:
    """The equations with the friction's modes (0 sticking, else the sign of surface less part)."""

    def __init__(self, parameters: dict[str, float], currents: Sequence[Current]) -> None:
        self.p = parameters
        self.currents = currents
        self.within = 0.0
        """A time inside the running smooth piece, s."""
        self.modes = [0, 0]
        self.touching = [False, False]

    def _actuator(self, t: float, y: Array, k: int) -> tuple[float, float]:
        """Forces on ram and surface but for friction and weight, N."""
        p = self.p
        z, v, z_ram, v_ram = y[4 * k : 4 * k + 4]
        q, rate = z_ram - z, v_ram - v
        ram = p["force_factor"] * self.currents[k](t, self.within) - p["suspension_damping"] * rate
        ram -= p["suspension_k1"] * q + p["suspension_k3"] * q**3
        depth = abs(q) - p["travel"]
        if self.touching[k] and depth > 0.0:
            push = max(0.0, 1.0 + p["contact_damping"] * np.sign(q) * rate)
            ram -= np.sign(q) * p["contact_stiffness"] * depth**1.5 * push
        return ram, -ram - p["flexure_stiffness"] * z - p["flexure_damping"] * v

    def solve(self, t: float, y: Array, modes: Sequence[int]) -> npt.NDArray[Any]:
        """Accelerations of surface, ram, surface, ram and part, then both frictions on the part."""
        p = self.p
        a, b = np.zeros((7, 7)), np.zeros(7)
        for k in range(2):
            on_ram, on_surface = self._actuator(t, y, k)
            surface, ram, force = 2 * k, 2 * k + 1, 5 + k
            a[surface, surface], a[surface, force] = p["surface_mass"], 1.0
            b[surface] = on_surface - p["surface_mass"] * p["gravity"]
            a[ram, ram], b[ram] = p["ram_mass"], on_ram - p["ram_mass"] * p["gravity"]
            if modes[k] == 0:
                a[force, surface], a[force, 4] = 1.0, -1.0
            else:
                a[force, force], b[force] = 1.0, modes[k] * p["mu_k"] * p["normal_force"]
        a[4, 4], a[4, 5], a[4, 6] = p["part_mass"], -1.0, -1.0
        b[4] = -p["part_mass"] * p["gravity"]
        return np.linalg.solve(a, b)

    def rates(self, t: float, y: Array) -> Array:
        """dy/dt in the present modes."""
        found = self.solve(t, y, self.modes)
        out = np.empty(10)
        out[0::2] = y[1::2]
        out[1::2] = found[:5]
        return out

    def slip(self, y: Array, k: int) -> float:
        """Velocity of surface k less the part's, m/s."""
        return y[4 * k + 1] - y[V_PART]

    def choose(self, t: float, y: Array, broken: int | None) -> None:
        """The consistent modes with the most sticking; surface ``broken`` has just broken away."""
        limit = self.p["mu_s"] * self.p["normal_force"]
        options: list[Sequence[int]] = []
        for k in range(2):
            slip = self.slip(y, k)
            options.append((0, 1, -1) if abs(slip) < STILL else (int(np.sign(slip)),))
        for modes in sorted(product(*options), key=lambda modes: sum(map(abs, modes))):
            found = self.solve(t, y, modes)
            fits = True
            for k in range(2):
                if modes[k] == 0:
                    fits &= abs(found[5 + k]) <= limit * (1.0 - 1e-9 * (k == broken))
                elif len(options[k]) > 1:
                    fits &= modes[k] * (found[2 * k] - found[4]) > 0.0
            if fits:
                self.modes = list(modes)
                break
        else:
            raise RuntimeError(f"no consistent modes at t = {t}")
        for k in range(2):
            if self.modes[k] == 0:
                y[4 * k + 1] = y[V_PART]


def rest(p: dict[str, float]) -> Array:
    """Static equilibrium without current."""
    weight = p["ram_mass"] * p["gravity"]
    q: Any = brentq(
        lambda q: -p["suspension_k1"] * q - p["suspension_k3"] * q**3 - weight,
        -p["travel"],
        0.0,
        xtol=1e-18,
    )
    mass = p["ram_mass"] + p["surface_mass"] + p["part_mass"] / 2.0
    z = -mass * p["gravity"] / p["flexure_stiffness"]
    return np.array([z, 0.0, z + q, 0.0, z, 0.0, z + q, 0.0, z, 0.0])


def simulate(
    parameters: dict[str, float],
    currents: Sequence[Current],
    jumps: Sequence[float],
    times: Sequence[float],
) -> tuple[Array, int]:
    """The state at ``times`` (s, increasing), a row each, and the number of frictional events.

    ``currents`` are smooth between the ``jumps`` (s).
    """
    model, y, t = TwoSurfaces(parameters, currents), rest(parameters), 0.0
    limit = parameters["mu_s"] * parameters["normal_force"]

    def friction(k: int) -> Callable[[float, Array], float]:
        def value(t: float, y: Array) -> float:
            if model.modes[k] == 0:
                return limit - abs(model.solve(t, y, model.modes)[5 + k])
            return model.modes[k] * model.slip(y, k)

        return value

    def wall(k: int) -> Callable[[float, Array], float]:
        def value(_: float, y: Array) -> float:
            depth = abs(y[4 * k + 2] - y[4 * k]) - parameters["travel"]
            return depth if model.touching[k] else -depth

        return value

    events = [friction(0), friction(1), wall(0), wall(1)]
    for event in events:
        event.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
        event.direction = -1.0  # pyright: ignore[reportFunctionMemberAccess]
    rows, changes = [], 0
    for stop in sorted({*jumps, *times}):
        model.within = 0.5 * (t + stop)
        model.choose(t, y, None)
        while t < stop:
            done = solve_ivp(
                model.rates, (t, stop), y, "DOP853", events=events, rtol=1e-11, atol=1e-13,
                max_step=1e-4, first_step=min(1e-7, stop - t),
            )  # fmt: skip
            if not done.success:
                raise RuntimeError(f"at t = {done.t[-1]}: {done.message}")
            t, y = float(done.t[-1]), done.y[:, -1].copy()
            for k in range(2):
                if done.t_events[k].size:
                    broken = k if model.modes[k] == 0 else None
                    model.choose(t, y, broken)
                    changes += 1
                if done.t_events[2 + k].size:
                    model.touching[k] = not model.touching[k]
        if stop in times:
            rows.append(y.copy())
    return np.array(rows), changes
