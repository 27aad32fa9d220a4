"""A peer: the whole machine as one ODE for SciPy's LSODA, with events, as a user would write it.

Between two events the modes (stick or slip, output free or at its limit) are frozen; at each event
they are chosen anew and the integration starts again. The walls are smooth enough without events.
"""

from collections.abc import Callable, Sequence
from contextlib import closing
from math import pi
from time import process_time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from cosim.arrays import Array
from cosim.drive.command import Command, command
from cosim.mechanics.stickslip import Mechanics
from cosim.scene import Scene

_SCALES = np.array([1.0, 10.0, *[1e-3, 0.1] * 3])

_BEYOND = 1e-9
"""m/s and V; events lie this far beyond their boundary, since each piece begins on a boundary."""

_CLEAR = 1.0
"""V/s; an output at its limit stays there while its free slope outwards exceeds this."""

CURRENT, VA, Q, DQ, Z, V, W, U = range(8)
"""Current, amplifier's pole, ram against surface, surface, surface against part; each its rate."""


class Machine:
    """Right-hand sides and events in one set of modes."""

    scales = _SCALES
    """Scale of each state, SI: its absolute tolerance over the relative one."""

    def __init__(self, scene: Scene, drive: Command) -> None:
        self._scene = scene
        self._drive = drive
        self.slip = 0  # sign of u, or 0 for sticking
        self.rail = 0  # +1 at the upper limit of the output, -1 at the lower
        circuit = scene.circuit
        self._most_held = scene.friction.mu_s * scene.friction.normal_force
        self._bandwidth = 2 * pi * circuit.gain_bandwidth
        self._leak = self._bandwidth / 10 ** (circuit.open_loop_gain / 20)
        self.high = circuit.supply - circuit.swing_loss_high
        self.low = circuit.swing_loss_low - circuit.supply

    def wish(self, t: float, y: Any) -> float:
        """Slope of the output without its limits, V/s."""
        circuit = self._scene.circuit
        wish = (
            self._bandwidth * (self._drive.value(t) - circuit.sense_resistance * y[CURRENT])
            - self._leak * y[VA]
        )
        return min(max(wish, -circuit.slew_rate), circuit.slew_rate)

    def forces(self, y: Any) -> tuple[float, float, float]:
        """Forces, N: on the ram, on the surface without friction, on the part while it sticks."""
        m, coil = self._scene.mechanics, self._scene.coil
        q, dq = y[Q], y[DQ]
        wall, over = 0.0, abs(q) - m.travel
        if over > 0.0:
            rate = dq if q > 0 else -dq
            wall = m.contact_stiffness * over**1.5 * max(0.0, 1.0 + m.contact_damping * rate)
            wall = -wall if q > 0 else wall
        drive = coil.force_factor * y[CURRENT] + wall - m.suspension_damping * dq
        drive -= q * (m.suspension_k1 + q * (m.suspension_k2 + q * m.suspension_k3))
        ram = drive - m.ram_mass * m.gravity
        surface = -drive - m.flexure_stiffness * y[Z] - m.flexure_damping * y[V]
        surface -= m.surface_mass * m.gravity
        together = (surface - m.part_mass * m.gravity) / (m.surface_mass + m.part_mass)
        return ram, surface, m.part_mass * (together + m.gravity)

    def rates(self, t: float, y: Any) -> list[float]:
        m, coil = self._scene.mechanics, self._scene.coil
        ram, surface, held = self.forces(y)
        friction, *more = self.friction(y, held)
        a_surface = (surface - friction) / m.surface_mass
        a_part = friction / m.part_mass - m.gravity
        resistance = coil.resistance + self._scene.circuit.sense_resistance
        di = (y[VA] - resistance * y[CURRENT] - coil.force_factor * y[DQ]) / coil.inductance
        return [
            di,
            0.0 if self.rail else self.wish(t, y),
            y[DQ],
            ram / m.ram_mass - a_surface,
            y[V],
            a_surface,
            y[U],
            a_surface - a_part if self.slip else 0.0,
            *more,
        ]

    def friction(self, y: Any, held: float) -> list[float]:
        """Friction (N), which is ``held`` while the part sticks, and rates of its own states."""
        given = self._scene.friction
        return [self.slip * given.mu_k * given.normal_force if self.slip else held]

    def events(self) -> list[Callable[[float, Any], float]]:
        """One of friction, one of the output; each falls through zero."""

        def friction(t: float, y: Any) -> float:
            return self.friction_event(y)

        def output(t: float, y: Any) -> float:
            if self.rail:
                return self.rail * self.wish(t, y)
            return min(self.high - y[VA], y[VA] - self.low) + _BEYOND

        for event in (friction, output):
            event.terminal, event.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
        return [friction, output]

    def friction_event(self, y: Any) -> float:
        """Falls through zero where sticking or slipping ends."""
        if self.slip:
            return self.slip * y[U] + _BEYOND
        return self._most_held - abs(self.forces(y)[2])

    def choose(self, t: float, y: Any) -> None:
        """The modes that hold from here on."""
        self.choose_friction(y)
        wish = self.wish(t, y)
        if y[VA] >= self.high - 2 * _BEYOND and wish > _CLEAR:
            self.rail, y[VA] = 1, self.high
        elif y[VA] <= self.low + 2 * _BEYOND and wish < -_CLEAR:
            self.rail, y[VA] = -1, self.low
        else:
            self.rail = 0

    def choose_friction(self, y: Any) -> None:
        """Stick or slip."""
        friction = self.forces(y)[2]
        if abs(y[U]) > 1e-9:
            self.slip = 1 if y[U] > 0 else -1
        else:
            y[U] = 0.0
            self.slip = (
                0 if abs(friction) < self._most_held * (1 - 1e-9) else (1 if friction > 0 else -1)
            )


def run(
    scene: Scene,
    times: Sequence[float],
    rtol: float,
    make: Callable[[Scene, Command], Machine] = Machine,
) -> tuple[float, Array]:
    """CPU seconds, and the part's height (m) at ``times`` (s)."""
    with closing(Mechanics(scene)) as mechanics:
        rest = mechanics.sample()
    began = process_time()
    drive = command(scene)
    machine = make(scene, drive)
    z = rest["z_surface"]
    y = np.zeros(len(machine.scales))
    y[Q], y[Z] = rest["z_ram"] - z, z
    t, found = 0.0, [np.empty((2, 0))]
    wanted = np.asarray(times)
    while t < scene.run.duration:
        end = min(drive.next_jump(t), scene.run.duration)
        machine.choose(t, y)
        held = np.nextafter(end, t)
        at = wanted[(wanted >= t) & (wanted < end)]
        done = solve_ivp(
            machine.rates,
            (t, held),
            y,
            "LSODA",
            t_eval=np.append(at, held),
            events=machine.events(),
            rtol=rtol,
            atol=rtol * machine.scales,
        )
        if at.size and len(done.t):
            path = np.vstack([done.t, done.y[Z] - done.y[W]])
            found.append(path[:, done.t < held])
        if done.status == 1:
            event = next(k for k in range(2) if len(done.t_events[k]))
            t, y = float(done.t_events[event][0]), done.y_events[event][0].copy()
            if event == 0:
                y[U] = 0.0
        else:
            t, y = end, done.y[:, -1].copy()
    path = np.concatenate(found, axis=1)
    return process_time() - began, np.interp(wanted, path[0], path[1])
