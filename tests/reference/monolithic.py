"""Monolithic reference solution: drive, circuit rung, coil and mechanics as one system.

Everything is solved together by SUNDIALS CVODE (through scikit-sundae) with rootfinding. Each
piece between two events has smooth right-hand sides, because the modes (stick or slip, wall free,
touched or rested on, amplifier linear, slewing or clamped) are frozen in it; at each event the
state is put exactly on the event, the modes are chosen anew, and CVODE starts afresh.

It exists to judge other solvers, so it shares neither code nor formulas with them. All SI units,
the vertical axis points up. State vector, per coil and per surface:

    i    current of one coil [A] (not integrated on the rung "ideal")
    va   output of the amplifier's pole [V] (on the rung "amplifier" only)
    q    ram relative to the surface [m], dq its rate [m/s]
    zs   surface [m], vs its rate [m/s]
    w    surface minus part [m], u its rate, the slip velocity [m/s]

Relative velocities are states, so that sticking and resting are exact zeros, not small numbers.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.optimize import root_scalar
from sksundae.cvode import CVODE

# CVODE warns of root functions that are still zero after a first step; `simulate` handles them.
os.environ.setdefault("SUNLOGGER_WARNING_FILENAME", os.devnull)

REST_SPEED = 1e-6  # rigid rebounds slower than this [m/s] end in resting contact (against Zeno)
IMPACT_SPEED = 1e-3  # slower closings [m/s] are not counted in Result.impacts
MAX_STEP = 2e-4  # s; a root function must not fall and rise again unseen within a step
MIN_STEP = 1e-11  # s; steps are not shortened below this in search of a missed event
TIME_EPS = 1e-13  # two times closer than this [s] are one
STATES = ("i", "va", "q", "dq", "zs", "vs", "w", "u")
ENERGIES = ("in", "copper", "friction", "damping", "impact")
SAMPLED = ("z_surface", "v_surface", "z_ram", "v_ram", "z_part", "v_part", "current")
# Absolute tolerances are tol times these: the size of what matters in each state.
SCALES = (1.0, 10.0, 1e-3, 0.1, 1e-3, 0.1, 1e-3, 0.1) + (1e-3,) * len(ENERGIES)


@dataclass(frozen=True)
class Params:
    """Scene keys, flattened; the defaults are those of the scene `reference`."""

    waveform: str = "sawtooth"  # or "sine"
    actuator: str = "ram"  # or "direct": what is called the ram here stands on the ground
    frequency: float = 20.0  # Hz
    amplitude: float = 8.0  # V peak-to-peak at V1
    offset: float = -1.2  # V
    supply: float = 18.0  # V
    sense_resistance: float = 4.0  # ohm
    current_limit: float = 2.504  # A, in all coils; asserted, never modelled
    gain_bandwidth: float = 1e6  # Hz
    open_loop_gain: float = 98.0  # dB
    slew_rate: float = 10e6  # V/s
    swing_loss_high: float = 4.0  # V
    swing_loss_low: float = 4.0  # V
    resistance: float = 7.1  # ohm
    inductance: float = 1.2e-3  # H
    force_factor: float = 0.6  # N/A
    b1: float = 0.0  # 1/m
    b2: float = 0.0  # 1/m^2
    count: int = 1
    ram_mass: float = 0.004  # kg
    surface_mass: float = 0.0145  # kg
    part_mass: float = 0.009  # kg, shared by n_surfaces
    flexure_stiffness: float = 560.0  # N/m
    flexure_damping: float = 0.84  # N s/m
    suspension_k1: float = 40.0  # N/m
    suspension_k2: float = 0.0  # N/m^2
    suspension_k3: float = 1.5e7  # N/m^3
    suspension_knee: float = 0.0  # m
    suspension_hardening: float = 4e5  # N/m^2
    suspension_repulsion: float = 0.05  # N
    suspension_distance: float = 2.8e-3  # m
    suspension: str = "cubic"  # or "knee", "repulsion"
    suspension_damping: float = 0.02  # N s/m
    travel: float = 1.9e-3  # m
    restitution: float = 0.75  # rigid contact
    contact_stiffness: float = 1e8  # N/m^1.5, compliant contact
    contact_damping: float = 0.38  # s/m, compliant contact
    n_surfaces: int = 1
    gravity: float = 9.81  # m/s^2
    mu_s: float = 0.72
    mu_k: float = 0.59
    normal_force: float = 0.5  # N, at the start
    normal_force_slope: float = 0.0  # N/s
    mu_plate: float = 0.0


@dataclass
class Result:
    """What a run yields; counts, fractions and extremes are taken from `settle` on."""

    v_average: float = math.nan  # m/s, displacement of the part over time
    impacts: int = 0  # wall contacts begun faster than IMPACT_SPEED
    impacts_all: int = 0  # all of them; with rigid walls this depends on REST_SPEED
    slips: int = 0  # stick -> slip
    sticks: int = 0  # slip -> stick
    stick_fraction: float = 0.0
    saturated_fraction: float = 0.0  # time on either output limit
    z_surface_pp: float = math.nan  # m
    v_surface_max: float = -math.inf  # m/s
    v_surface_min: float = math.inf  # m/s
    current_max: float = -math.inf  # A
    current_min: float = math.inf  # A
    energies: dict[str, float] = field(default_factory=dict)  # J, whole run, of one coil
    samples: dict[str, np.ndarray] = field(default_factory=dict)
    steps: int = 0
    restarts: int = 0

    @property
    def stick_slip_events(self) -> int:
        """Changes between stick and slip, both ways."""
        return self.slips + self.sticks


STICK = 0  # friction mode: 0 sticks, +1/-1 slips with sgn(u); plate mode: 0 at rest, else sgn(v_p)
FREE, TOUCH, REST = "free", "touch", "rest"  # wall modes, with side +1 (upper) or -1 (lower)
# Amplifier modes, with a sign; on the rung "limited" LINEAR means that the current is the command.
LINEAR, SLEW, CLAMP = "linear", "slew", "clamp"
CURRENT_EPS = 1e-12  # A; two currents closer than this are one
# Root functions; every root is a fall through zero of a function that is positive in its mode.
R_UPPER, R_LOWER, R_KINK, R_STICK, R_PLATE, R_RATE, R_HIGH, R_LOW = range(8)
N_ROOTS = 8
Broken = tuple[bool, bool]


def _sign(x: float) -> int:
    return (x > 0) - (x < 0)


class _Model:
    """The equations, with the modes and the state `y` that they are frozen at."""

    def __init__(self, p: Params, contact: str, circuit: str, energies: bool) -> None:
        if p.waveform not in ("sawtooth", "sine"):
            raise ValueError(f"waveform {p.waveform!r}")
        circuits = ("amplifier", "limited", "ideal")
        if contact not in ("rigid", "compliant") or circuit not in circuits:
            raise ValueError(f"contact {contact!r}, circuit {circuit!r}")
        if p.actuator not in ("ram", "direct"):
            raise ValueError(f"actuator {p.actuator!r}")
        self.direct = p.actuator == "direct"
        self.p, self.rigid, self.ideal = p, contact == "rigid", circuit == "ideal"
        self.limited = circuit == "limited"
        self.with_energies = energies
        self.sine = p.waveform == "sine"
        self.period = math.inf if self.sine else 1.0 / p.frequency  # from jump to jump
        self.cycle = 0  # the running period of the sawtooth
        self.part_mass = p.part_mass / p.n_surfaces
        self.sense = p.sense_resistance * p.count  # as one coil's current sees it [ohm]
        self.pole = 2.0 * math.pi * p.gain_bandwidth
        self.gain = 10.0 ** (p.open_loop_gain / 20.0)
        self.high = p.supply - p.swing_loss_high
        self.low = -(p.supply - p.swing_loss_low)
        self.wall, self.side = FREE, 0
        self.friction, self.plate = STICK, STICK
        self.amp, self.amp_sign = LINEAR, 0
        self.impact_loss = 0.0  # J, in rigid impacts
        self.normal = p.normal_force  # N, at the time of the last call of `forces`
        self.y = self._equilibrium() + [0.0] * (len(ENERGIES) if energies else 0)
        self.choose_amp(jumped=True)
        self.choose_contacts()

    def drive(self, t: float) -> float:
        """V1(t) [V]: a rising ramp with a sharp fall at each period's end, or a sine."""
        if self.sine:
            wave = 0.5 * math.sin(2.0 * math.pi * self.p.frequency * t)
            return self.p.offset + self.p.amplitude * wave
        return self.p.offset + self.p.amplitude * (t / self.period - self.cycle - 0.5)

    def drive_slope(self, t: float) -> float:
        """dV1/dt between jumps [V/s]."""
        p = self.p
        if self.sine:
            turns = 2.0 * math.pi * p.frequency
            return 0.5 * p.amplitude * turns * math.cos(turns * t)
        return p.amplitude / self.period

    def current(self, t: float, i: float) -> float:
        """Current of one coil [A]."""
        given = self.ideal or (self.limited and self.amp == LINEAR)
        return self.drive(t) / self.sense if given else i

    def following(self, t: float, y: Sequence[float]) -> float:
        """Output voltage at which the coil's current would be the command [V]."""
        p = self.p
        ohmic = (1.0 + p.resistance / self.sense) * self.drive(t)
        return ohmic + p.inductance * self.drive_slope(t) / self.sense + self.bl(y[2]) * y[3]

    def bl(self, q: float) -> float:
        """Force factor at the ram's position [N/A]."""
        return self.p.force_factor * (1.0 + q * (self.p.b1 + q * self.p.b2))

    def suspension(self, q: float) -> float:
        """Force of the suspension on the ram [N], without its damper."""
        p = self.p
        if p.suspension == "cubic":
            return -q * (p.suspension_k1 + q * (p.suspension_k2 + q * p.suspension_k3))
        if p.suspension == "knee":
            lift = p.suspension_hardening * (p.suspension_knee - q) ** 2
            return -p.suspension_k1 * q + (lift if q < p.suspension_knee else 0.0)
        d, c = p.suspension_distance, p.suspension_repulsion
        if q >= -p.travel:
            return c * d**3 / (d + q) ** 3
        gap = d - p.travel  # the tangent at the lower wall
        return c * (d / gap) ** 3 - 3.0 * c * d**3 / gap**4 * (q + p.travel)

    def spring_energy(self, q: float) -> float:
        """Energy of the suspension [J]: the integral of its force, piece by piece."""
        ends = sorted({0.0, q, *(x for x in (-self.p.travel, self.p.suspension_knee)
                                 if min(0.0, q) < x < max(0.0, q))})  # fmt: skip
        found = sum(
            quad(self.suspension, a, b, epsabs=1e-17, epsrel=1e-13)[0] for a, b in pairwise(ends)
        )
        return math.copysign(1.0, -q) * found

    def wall_force(self, q: float, dq: float) -> float:
        """Compliant wall's force on the ram [N] (Hunt-Crossley), given that it is touched."""
        depth = self.side * q - self.p.travel
        if depth <= 0.0:
            return 0.0
        push = 1.0 + self.p.contact_damping * self.side * dq
        return -self.side * self.p.contact_stiffness * depth**1.5 * push if push > 0.0 else 0.0

    def forces(self, t: float, y: Sequence[float]) -> tuple[float, float, float]:
        """Force on the ram but for gravity and rigid walls; load and mass of what moves as the
        surface [N, N, kg], friction excluded: with the ram resting on it, both bodies."""
        p = self.p
        self.normal = p.normal_force + p.normal_force_slope * t
        i, q, dq, zs, vs = self.current(t, y[0]), y[2], y[3], y[4], y[5]
        ram = self.bl(q) * i - p.suspension_damping * dq
        ram += self.suspension(q)
        load = -p.flexure_stiffness * zs - p.flexure_damping * vs
        if self.wall == REST:
            mass = p.surface_mass + p.ram_mass
            return ram, load - mass * p.gravity, mass
        if self.wall == TOUCH:
            ram += self.wall_force(q, dq)
        return ram, load - ram - p.surface_mass * p.gravity, p.surface_mass

    def friction_balance(
        self, load: float, mass: float, friction: int, plate: int
    ) -> tuple[float, float, float, float]:
        """Accelerations of surface and part [m/s^2], friction of the surface and of the plate on
        the part [N], if these modes hold."""
        p, m = self.p, self.part_mass
        weight = m * p.gravity
        slip_force = friction * p.mu_k * self.normal
        if p.mu_plate > 0.0 and plate == STICK:
            f = load if friction == STICK else slip_force
            return (load - f) / mass, 0.0, f, weight - f
        f_plate = -plate * p.mu_plate * self.normal
        if friction == STICK:
            a = (load + f_plate - weight) / (mass + m)
            return a, a, m * a + weight - f_plate, f_plate
        a_p = (slip_force + f_plate) / m - p.gravity
        return (load - slip_force) / mass, a_p, slip_force, f_plate

    def amp_rate(self, t: float, i: float, va: float) -> float:
        """Rate of the amplifier's pole [V/s], before slew limit and saturation."""
        return self.pole * (self.drive(t) - self.sense * i - va / self.gain)

    def rates(self, t: float, y: Sequence[float]) -> list[float]:
        """Time derivatives of the state (and of the energies, when kept)."""
        p = self.p
        i, va, q, dq, _, vs, _, u = y[:8]
        ram, load, mass = self.forces(t, y)
        a_s, a_p, f, f_plate = self.friction_balance(load, mass, self.friction, self.plate)
        ddq = 0.0 if self.wall == REST else -a_s
        if not self.direct and self.wall != REST:
            ddq += ram / p.ram_mass - p.gravity
        emf, r_loop = self.bl(q) * dq, p.resistance + self.sense
        di = dva = 0.0
        if self.limited:
            if self.amp == LINEAR:
                va, di = self.following(t, y), self.drive_slope(t) / self.sense
                i = self.current(t, i)
            else:
                va = self.high if self.amp_sign > 0 else self.low
                di = (va - emf - r_loop * i) / p.inductance
        elif not self.ideal:
            di = (va - r_loop * i - emf) / p.inductance
            if self.amp != CLAMP:
                dva = self.amp_rate(t, i, va) if self.amp == LINEAR else self.amp_sign * p.slew_rate
        out = [di, dva, dq, ddq, vs, a_s, u, a_s - a_p]
        if self.with_energies:
            i = self.current(t, i)
            copper = r_loop * i * i
            loss = -dq * (self.wall_force(q, dq) - self.wall_force(q, 0.0))
            out += [
                emf * i + copper if self.ideal else va * i,
                copper,
                f * u - f_plate * (vs - u),
                p.flexure_damping * vs * vs + p.suspension_damping * dq * dq,
                loss if self.wall == TOUCH else 0.0,
            ]
        return out

    def roots(self, t: float, y: Sequence[float]) -> list[float]:
        """Root functions of the present modes."""
        p = self.p
        i, va, q, dq, _, vs, _, u = y[:8]
        out = [1.0] * N_ROOTS
        ram, load, mass = self.forces(t, y)
        a_s, _, f, f_plate = self.friction_balance(load, mass, self.friction, self.plate)
        if self.wall == FREE:
            out[R_UPPER] = p.travel - q
            out[R_LOWER] = p.travel + q
        elif self.wall == TOUCH:
            out[R_UPPER] = self.side * q - p.travel
            out[R_KINK] = abs(1.0 + p.contact_damping * self.side * dq)
        else:
            out[R_UPPER] = -self.side * (p.ram_mass * (a_s + p.gravity) - ram)
        sticks, rests = self.friction == STICK, self.plate == STICK
        out[R_STICK] = p.mu_s * self.normal - abs(f) if sticks else self.friction * u
        if p.mu_plate > 0.0:
            hold = p.mu_plate * self.normal
            out[R_PLATE] = hold - abs(f_plate) if rests else self.plate * (vs - u)
        if self.limited:
            if self.amp == CLAMP:
                out[R_RATE] = self.amp_sign * (self.drive(t) - self.sense * i)
            else:
                va = self.following(t, y)
                out[R_HIGH] = self.high - va
                out[R_LOW] = va - self.low
        elif not self.ideal:
            rate = self.amp_rate(t, i, va)
            if self.amp == CLAMP:
                out[R_RATE] = self.amp_sign * rate / p.slew_rate
            else:
                inside = 1.0 - abs(rate) / p.slew_rate
                out[R_RATE] = inside if self.amp == LINEAR else -inside
                out[R_HIGH] = self.high - va
                out[R_LOW] = va - self.low
        return out

    def choose_amp(self, jumped: bool = False, t: float = 0.0) -> None:
        """Amplifier mode after a jump of V1 or with the pole newly on its limit."""
        if self.ideal:
            return
        if self.limited:
            self.choose_output(t)
            return
        va, rate = self.y[1], self.amp_rate(t, self.y[0], self.y[1])
        if (va >= self.high and rate > 0.0) or (va <= self.low and rate < 0.0):
            self.amp, self.amp_sign = CLAMP, _sign(rate)
        elif jumped:
            slewing = abs(rate) > self.p.slew_rate
            self.amp, self.amp_sign = (SLEW, _sign(rate)) if slewing else (LINEAR, 0)

    def choose_output(self, t: float) -> None:
        """On the rung "limited": whether the current follows, or the output is at a limit."""
        wanted, va = self.drive(t) / self.sense, self.following(t, self.y)
        missing = wanted - self.y[0]
        if abs(missing) > CURRENT_EPS:
            self.amp, self.amp_sign = CLAMP, _sign(missing)
        elif self.low <= va <= self.high:
            self.amp, self.amp_sign = LINEAR, 0
            self.y[0] = wanted
        else:
            self.amp, self.amp_sign = CLAMP, 1 if va > self.high else -1

    def choose_friction(self, t: float, broken: Broken = (False, False)) -> None:
        """First consistent pair of modes, sticking ones first. `broken` tells for surface and
        plate that static friction has just been found overcome, which rounding might hide."""
        p, u = self.p, self.y[7]
        v_part = self.y[5] - u
        _, load, mass = self.forces(t, self.y)
        hold_s = p.mu_s * self.normal * (1.0 - 1e-9 * broken[0])
        hold_p = p.mu_plate * self.normal * (1.0 - 1e-9 * broken[1])
        plates = (_sign(v_part),) if v_part else (STICK, 1, -1)
        for friction in (_sign(u),) if u else (STICK, 1, -1):
            for plate in plates if p.mu_plate > 0.0 else (STICK,):
                a_s, a_p, f, f_p = self.friction_balance(load, mass, friction, plate)
                departs = u or friction * (a_s - a_p) > -1e-9
                leaves = v_part or plate * a_p > -1e-9
                ok = abs(f) <= hold_s if friction == STICK else departs
                if ok and (abs(f_p) <= hold_p if plate == STICK else leaves):
                    self.friction, self.plate = friction, plate
                    return
        raise RuntimeError(f"no consistent friction mode at t = {t}")

    def choose_contacts(self, t: float = 0.0, broken: Broken = (False, False)) -> None:
        """Friction and resting contact together: either may end the other."""
        self.choose_friction(t, broken)
        if self.wall == REST and self.roots(t, self.y)[R_UPPER] < 0.0:
            self.wall, self.side = FREE, 0
            self.choose_friction(t, broken)

    def impact(self, t: float, side: int) -> None:
        """Rigid impact of ram and surface; the part, held by bounded forces, keeps its velocity."""
        p, y = self.p, self.y
        closing, vs, v_part = y[3], y[5], y[5] - y[7]
        m_r, m_s, eps = p.ram_mass, p.surface_mass, p.restitution
        share = 1.0 if self.direct else m_r / (m_r + m_s)
        y[2], y[3] = side * p.travel, -eps * closing
        y[5] = vs + (1.0 + eps) * closing * share
        y[7] = y[5] - v_part
        self.impact_loss += 0.5 * m_s * share * (1.0 - eps * eps) * closing**2
        self.choose_friction(t)
        if abs(y[3]) < REST_SPEED and side * self.rates(t, y)[3] > 0.0:
            y[3] = 0.0
            self.wall, self.side = REST, side
            self.choose_contacts(t)

    def handle(self, t: float, fired: set[int]) -> float | None:
        """Carries out the events `fired`; returns the closing speed when a wall was met."""
        y, met = self.y, None
        at_rest = self.p.mu_plate > 0.0 and (self.plate == STICK or R_PLATE in fired)
        if self.friction == STICK or R_STICK in fired:
            y[7] = 0.0
            y[5] = 0.0 if at_rest else y[5]
        elif at_rest:
            y[7] = y[5]
        broken = (
            R_STICK in fired and self.friction == STICK,
            R_PLATE in fired and self.plate == STICK,
        )
        if self.wall == FREE and (R_UPPER in fired or R_LOWER in fired):
            side = 1 if R_UPPER in fired else -1
            met = abs(y[3])
            if self.rigid:
                self.choose_friction(t, broken)
                self.impact(t, side)
                broken = (False, False)
            else:
                self.wall, self.side = TOUCH, side
        elif R_UPPER in fired:
            if self.wall == TOUCH:
                y[2] = self.side * self.p.travel
            self.wall, self.side = FREE, 0
        if self.limited:
            if R_RATE in fired:
                y[0] = self.drive(t) / self.sense
            if R_HIGH in fired or R_LOW in fired:
                self.amp, self.amp_sign = CLAMP, 1 if R_HIGH in fired else -1
            elif R_RATE in fired or met is not None:
                self.choose_output(t)
        elif R_RATE in fired:
            if self.amp == LINEAR:
                self.amp, self.amp_sign = SLEW, _sign(self.amp_rate(t, y[0], y[1]))
            else:
                self.amp, self.amp_sign = LINEAR, 0
        elif R_HIGH in fired or R_LOW in fired:
            y[1] = self.high if R_HIGH in fired else self.low
            self.choose_amp(t=t)
        self.choose_contacts(t, broken)
        return met

    def _equilibrium(self) -> list[float]:
        """Static state without current, part sticking, plate unloaded; sets the wall's mode."""
        p = self.p
        if self.direct:  # q = 0 where the surface rests
            carried = p.surface_mass + self.part_mass
            return [0.0] * 4 + [-carried * p.gravity / p.flexure_stiffness] + [0.0] * 3
        self.wall, self.side = (FREE, 0) if self.rigid else (TOUCH, -1)

        def net(q: float) -> float:
            ram = self.forces(0.0, [0.0, 0.0, q, 0.0, 0.0, 0.0])[0]
            return ram - self.bl(q) * self.current(0.0, 0.0) - p.ram_mass * p.gravity

        bottom = -p.travel * (1.0 if self.rigid else 2.0)
        if self.rigid and net(bottom) <= 0.0:
            q, self.wall, self.side = bottom, REST, -1
        else:
            top = 0.0 if net(0.0) <= 0.0 else p.travel
            q: float = root_scalar(net, bracket=(bottom, top), xtol=1e-18, rtol=1e-15).root
            self.wall, self.side = (FREE, 0) if q > -p.travel else (TOUCH, -1)
        carried = p.ram_mass + p.surface_mass + self.part_mass
        return [0.0, 0.0, q, 0.0, -carried * p.gravity / p.flexure_stiffness, 0.0, 0.0, 0.0]

    def stored(self) -> float:
        """Energy stored in masses, springs, height and inductance [J]."""
        p = self.p
        i, _, q, dq, zs, vs, w, u = self.y[:8]
        depth = 0.0 if self.rigid else max(0.0, abs(q) - p.travel)
        return (
            0.5 * (p.ram_mass * (vs + dq) ** 2 + p.surface_mass * vs**2)
            + 0.5 * self.part_mass * (vs - u) ** 2
            + p.gravity * (p.ram_mass * (zs + q) + p.surface_mass * zs + self.part_mass * (zs - w))
            + 0.5 * p.flexure_stiffness * zs**2
            + self.spring_energy(q)
            + 0.4 * p.contact_stiffness * depth**2.5
            + (0.0 if self.ideal else 0.5 * p.inductance * i * i)
        )


def _hermite_peak(h: float, y0: float, d0: float, y1: float, d1: float) -> float:
    """Extreme of the cubic through two points with slopes of opposite signs."""
    a, b = 3.0 * (d0 + d1 - 2.0 * (y1 - y0) / h), 2.0 * (3.0 * (y1 - y0) / h - 2.0 * d0 - d1)
    s = -2.0 * d0 / (b + math.copysign(math.sqrt(max(0.0, b * b - 4.0 * a * d0)), -d0) or 1.0)
    s = min(1.0, max(0.0, s))
    return y0 + h * s * (d0 + s * (b / 2.0 + s * a / 3.0))


class _Roots:
    """The root functions as scikit-sundae wants them: it reads and keeps attributes here."""

    def __init__(self, model: _Model) -> None:
        self.model = model
        self.direction = [-1] * N_ROOTS
        self._i: list[np.ndarray] = []
        self._t: list[float] = []
        self._y: list[np.ndarray] = []

    def __call__(self, t: float, y: np.ndarray, out: np.ndarray) -> None:
        out[:] = self.model.roots(t, y.tolist())

    def forget(self) -> None:
        """Drops the past events, of which every step would return a copy."""
        for log in (self._i, self._t, self._y):
            log.clear()


class _Statistics:
    """Extremes and fractions from `settle` on, of one piece after the other."""

    def __init__(self, model: _Model, result: Result) -> None:
        self.model, self.result = model, result
        self.z_max, self.z_min = -math.inf, math.inf
        self.stuck = self.clamped = 0.0
        self.last: tuple[float, Sequence[float], float] | None = None

    def add(self, t: float, y: Sequence[float]) -> None:
        """A next point of the present piece; `last` is None at its start."""
        r, zs, vs = self.result, y[4], y[5]
        a_s = self.model.rates(t, y)[5]
        i = self.model.current(t, y[0])
        zs_all, vs_all = [zs, zs], [vs, vs]
        if self.last is not None:
            t0, y0, a0 = self.last
            h = t - t0
            self.stuck += h * (self.model.friction == STICK)
            self.clamped += h * (self.model.amp == CLAMP)
            if a0 * a_s < 0.0:
                vs_all.append(_hermite_peak(h, y0[5], a0, vs, a_s))
            if y0[5] * vs < 0.0:
                zs_all.append(_hermite_peak(h, y0[4], y0[5], zs, vs))
        r.v_surface_max = max(r.v_surface_max, *vs_all)
        r.v_surface_min = min(r.v_surface_min, *vs_all)
        self.z_max, self.z_min = max(self.z_max, *zs_all), min(self.z_min, *zs_all)
        r.current_max, r.current_min = max(r.current_max, i), min(r.current_min, i)
        self.last = (t, y, a_s)


def simulate(
    params: Mapping[str, Any] | Params | None,
    duration: float,
    settle: float,
    *,
    contact: str = "compliant",
    circuit: str = "amplifier",
    tol: float = 1e-9,
    times: Sequence[float] = (),
    energies: bool = False,
    method: str = "Adams",
    state: Mapping[str, float] | None = None,
) -> Result:
    """Simulates `duration` [s]; v_average and the statistics are taken from `settle` [s] on.

    `tol` is CVODE's relative tolerance, and its absolute one in units of SCALES. `times` [s],
    increasing, are sampled into Result.samples. `state` overrides entries of the initial state
    by the names in STATES; with a `q` in it the ram starts off the walls. With `energies`, losses
    and work are integrated too; on the rung "ideal" without the coil's magnetic energy.
    """
    p = params if isinstance(params, Params) else replace(Params(), **dict(params or {}))
    model = _Model(p, contact, circuit, energies)
    if state:
        for name, value in state.items():
            model.y[STATES.index(name)] = float(value)
        if "q" in state:
            model.wall, model.side = FREE, 0
        model.choose_amp(jumped=True)
        model.choose_contacts()
    result = Result()
    statistics = _Statistics(model, result)

    def rhs(t: float, y: np.ndarray, yp: np.ndarray) -> None:
        yp[:] = model.rates(t, y.tolist())

    roots = _Roots(model)
    atol = [tol * s for s in SCALES[: len(model.y)]]
    options = {"method": method, "rtol": tol, "atol": atol, "max_step": MAX_STEP}
    solver = CVODE(rhs, eventsfn=roots, num_events=N_ROOTS, **options)
    stored_at_start = model.stored()
    t: float = 0.0
    todo, samples, z_settled = list(times), [], math.nan
    restart, suspect, limit = True, True, math.inf
    while True:
        y = model.y
        while todo and todo[0] <= t + TIME_EPS:
            vs, i = y[5], model.current(t, y[0])
            samples.append((y[4], vs, y[4] + y[2], vs + y[3], y[4] - y[6], vs - y[7], i))
            todo.pop(0)
        if t >= settle - TIME_EPS and math.isnan(z_settled):
            z_settled = y[4] - y[6]
        if t >= duration - TIME_EPS:
            break
        if (jump := (model.cycle + 1) * model.period) <= t + TIME_EPS:
            model.cycle += 1
            model.choose_amp(jumped=True, t=t)
            was = model.friction
            model.choose_contacts(t)
            result.slips += t >= settle and was == STICK != model.friction
            restart = True
            continue
        settled = not math.isnan(z_settled)
        if restart:
            statistics.last = None
            solver.init_step(t, np.array(y))
            result.restarts += 1
            restart, suspect = False, True
        if settled and statistics.last is None:
            statistics.add(t, y)
        stop: float = min(jump, duration, limit, *todo[:1], math.inf if settled else settle)
        t_last = t
        step = solver.step(stop, "onestep", stop)
        if not step.success:
            raise RuntimeError(f"CVODE at t = {t}: {step.message}")
        result.steps += 1
        t, model.y = float(step.t), step.y.tolist()
        # A step may end within rounding of a target, which must then count as reached.
        if abs(t - stop) <= TIME_EPS:
            t = stop
        fired: set[int] = (
            set(np.flatnonzero(step.i_events[-1]).tolist()) if step.status == 2 else set()
        )
        if suspect:
            # A root function that starts at zero, as after an impact, may have risen and fallen
            # within the step, which CVODE does not see: try shorter ones.
            values = model.roots(t, model.y)
            if missed := {k for k, g in enumerate(values) if g < 0.0} - fired:
                if t - t_last > MIN_STEP:
                    limit, restart = t_last + (t - t_last) / 8.0, True
                    t, model.y = t_last, y
                    roots.forget()
                    continue
                fired |= missed
            suspect, limit = 0.0 in values, math.inf
        if abs(model.current(t, model.y[0])) * p.count > p.current_limit:
            raise RuntimeError(f"the current limit, which is not modelled, is reached at t = {t}")
        if settled:
            statistics.add(t, model.y)
        if fired:
            roots.forget()
            was = model.friction
            met = model.handle(t, fired)
            if settled:
                result.slips += was == STICK != model.friction
                result.sticks += was != STICK == model.friction
                result.impacts_all += met is not None
                result.impacts += met is not None and met > IMPACT_SPEED
            restart = True
    span = duration - settle
    result.v_average = (model.y[4] - model.y[6] - z_settled) / span
    result.stick_fraction = statistics.stuck / span
    result.saturated_fraction = statistics.clamped / span
    result.z_surface_pp = statistics.z_max - statistics.z_min
    result.samples = {name: np.array([s[k] for s in samples]) for k, name in enumerate(SAMPLED)}
    if energies:
        e: dict[str, float] = dict(zip(ENERGIES, model.y[8:], strict=True))
        e["impact"] += model.impact_loss
        e["stored"] = model.stored() - stored_at_start
        e["residual"] = e["in"] - sum(v for k, v in e.items() if k != "in")
        result.energies = e
    return result
