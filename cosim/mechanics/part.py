"""Motion of a part that is pressed against a surface whose velocity is prescribed.

The part of mass m is pressed with a constant normal force F_n; the surface's velocity is linear
between knots (time, v), and a time given twice is a jump. Coulomb's law is set-valued: the part
sticks while this needs at most the friction µ_s F_n, |a_surface + g| ≤ µ_s F_n/m; else it slips and
the surface pulls it with µ_k F_n. A part that reaches the surface's velocity and needs between
µ_k F_n and µ_s F_n sticks, although slipping on would also satisfy the law. The spring-loaded plate
behind it may rub with µ_p F_n against the part's own velocity, set-valued at rest. Units: s, m,
m/s, m/s².

`exact` goes from event to event in closed form. `threshold` and `moreau` take fixed time steps, for
comparison; the former is by default the simulation of Yako, Nowak, Yuan and Salisbury.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Required, TypedDict, Unpack

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.mechanics.surface import Surface
from cosim.toolchain.libraries import library

Real = npt.ArrayLike

PUBLISHED_STEP = 1e-4  # s, the authors' time step
PUBLISHED_V_MIN = 1e-5  # m/s, their velocity threshold
MOST_STEPS = 100_000_000  # of a method with fixed steps
EPSILON, LARGEST = sys.float_info.epsilon, sys.float_info.max


@dataclass(frozen=True)
class PartMotion:
    """Height [m] and velocity [m/s] of the part at ``time`` [s].

    ``sticking`` is the share of each interval between two times in which the part stuck, one value
    fewer than times (0 where the interval is empty). ``stick_slip_events`` counts the changes
    between sticking and slipping.
    """

    time: Array
    z: Array
    v: Array
    sticking: Array
    stick_slip_events: int

    @property
    def stick_fraction(self) -> float:
        """The share of all the time in which the part stuck."""
        span = self.time[-1] - self.time[0]
        return float(self.sticking @ np.diff(self.time) / span) if span > 0 else 0.0


# Columns of the second output of ``part_exact``: see ``account``.
_TOLD = ("sticks", "z_surface", "v_surface", "a_surface", "friction", "work", "heat", "events")


class Case(TypedDict, total=False):
    """Friction, forces and initial state of the part.

    ``force_per_mass`` is F_n/m [m/s²]; ``gravity`` [m/s²] acts along the motion, downwards. The
    part starts at ``z0`` [m] with the velocity ``v0`` [m/s], by default the surface's. The knots
    are repeated ``periods`` times, each period following on the last.
    """

    mu_s: Required[float]
    mu_k: Required[float]
    force_per_mass: Required[float]
    gravity: float
    mu_plate: float
    z0: float
    v0: float | None
    periods: int


def exact(
    time: Real, v_surface: Real, *, output: Real | None = None, **given: Unpack[Case]
) -> PartMotion:
    """The exact motion at the knots, or at the times ``output``.

    A needed friction that exceeds µ_s F_n by no more than the rounding of the knots counts as
    equal to it. Knots whose times differ by no more than the rounding of the latest one are a jump.
    """
    case = _Case(time, v_surface, **given)
    at = None if output is None else case.times(output)
    times = case.all_knots() if at is None else at
    z, v, stuck = np.empty((3, len(times)))
    events = library("part").part_exact(
        *case.arguments(),
        *(0.0, 0.0, len(times), None if at is None else at.ctypes.data),
        *(z.ctypes.data, v.ctypes.data, stuck.ctypes.data, None),
    )
    return PartMotion(times, z, v, _shares(times, stuck), events)


def account(surface: Surface, output: Real, **given: Unpack[Case]) -> dict[str, Array]:
    """The exact motion on a surface at the times ``output`` (s), and what passed between the two;
    the part starts at the height 0 with the surface's velocity.

    ``z`` (m) and ``v`` (m/s) are the part's, ``stuck`` the time spent sticking so far (s) and
    ``sticks`` 1 while it sticks, else 0; ``z_surface`` (from 0), ``v_surface`` and ``a_surface``
    the surface's. Over the part's mass are ``friction``, of the surface on the part (m/s²), and the
    sums so far (J/kg) ``work``, of the surface on the part, and ``heat``, of surface and plate.
    ``events`` are the changes between sticking and slipping so far. Where the surface's velocity or
    acceleration jumps, the values are those before the jump.
    """
    given["periods"] = surface.periods
    case = _Case(surface.times, surface.velocities, **given)
    times = case.times(output)
    motion, told = np.empty((3, len(times))), np.empty((len(times), len(_TOLD)))
    library("part").part_exact(
        *(*case.arguments(), surface.half, surface.turn, len(times), times.ctypes.data),
        *(*(row.ctypes.data for row in motion), told.ctypes.data),
    )
    return dict(zip(("z", "v", "stuck", *_TOLD), (*motion, *told.T), strict=True))


def bounds(
    mu_s: float, force_per_mass: float, gravity: float = 9.81, mu_plate: float = 0.0
) -> Array:
    """Candidates for the accelerations of the surface, m/s², at which a sticking part begins to
    slip: the upper and the lower one (friction ±µ_s F_n), each for a part that moves up, rests or
    moves down, which decides the sign of the plate's friction."""
    static, _, plate, g = friction_law(mu_s, 0.0, force_per_mass, gravity, mu_plate)
    return np.array([side * static - way * plate - g for side in (1, -1) for way in (1, 0, -1)])


def slip_budget(
    mu_s: float, force_per_mass: float, gravity: float = 9.81, mu_plate: float = 0.0
) -> dict[str, tuple[float, float]]:
    """The least and greatest acceleration of the surface, m/s², between which a part that moves
    "up" or "down" with it sticks. The spring-loaded plate, which rubs against the part's motion,
    extends one bound and narrows the other: (µ_s ± µ_p) F_n/m -+ g."""
    ends = bounds(mu_s, force_per_mass, gravity, mu_plate).reshape(2, 3).tolist()
    return {way: (ends[1][k], ends[0][k]) for way, k in (("up", 0), ("down", 2))}


def threshold(
    time: Real,
    v_surface: Real,
    *,
    step: float = PUBLISHED_STEP,
    v_min: float = PUBLISHED_V_MIN,
    output: Real | None = None,
    **given: Unpack[Case],
) -> PartMotion:
    """Fixed steps of Bogacki and Shampine's third-order method, with a velocity threshold.

    The part counts as sticking while it differs from the surface by less than ``v_min`` [m/s], and
    the surface's acceleration is the difference quotient of its velocity since the last step.
    Without ``output`` the times are the steps', with it heights and velocities are interpolated
    linearly between them. By default it is the scheme of Yako and others, 0.1 ms and 10 µm/s: their
    Simulink model has the solver ode3, no zero crossings, and the tracked velocity interpolated and
    differentiated by a Derivative block.
    """
    case = _Case(time, v_surface, **given)
    if not v_min >= 0:
        raise BadInput(f"The velocity threshold must not be negative, and is {v_min:g} m/s.")
    return case.stepped(library("part").part_threshold, (step, v_min), output)


def moreau(
    time: Real,
    v_surface: Real,
    *,
    step: float,
    output: Real | None = None,
    **given: Unpack[Case],
) -> PartMotion:
    """Fixed steps that are implicit in the friction (Moreau); ``output`` as in `threshold`."""
    case = _Case(time, v_surface, **given)
    return case.stepped(library("part").part_moreau, (step,), output)


def friction_law(
    mu_s: float, mu_k: float, force_per_mass: float, gravity: float, mu_plate: float
) -> Array:
    """The numbers of the law as the compiled routines take them, all in m/s²."""
    force = force_per_mass
    if not 0 <= mu_k <= mu_s:
        raise BadInput(f"µ_k must lie between 0 and µ_s = {mu_s:g}, and is {mu_k:g}.")
    if not (force >= 0 and mu_plate >= 0):
        raise BadInput("The normal force and the friction of the plate must not be negative.")
    law = np.array([mu_s * force, mu_k * force, mu_plate * force, gravity])
    if not np.isfinite(law).all():
        raise BadInput("Friction, normal force and gravity must be finite.")
    return law


class _Case:
    """Checked arguments for the compiled routines."""

    def __init__(
        self,
        time: Real,
        v_surface: Real,
        mu_s: float,
        mu_k: float,
        force_per_mass: float,
        gravity: float = 9.81,
        mu_plate: float = 0.0,
        z0: float = 0.0,
        v0: float | None = None,
        periods: int = 1,
    ) -> None:
        self.time = np.ascontiguousarray(time, dtype=np.float64)
        self.v = np.ascontiguousarray(v_surface, dtype=np.float64)
        if self.time.ndim != 1 or self.time.shape != self.v.shape or len(self.time) < 2:
            raise BadInput("The surface needs two knots or more, each a time and a velocity.")
        if not (np.isfinite(self.time).all() and np.isfinite(self.v).all()):
            raise BadInput("The surface's times and velocities must be finite.")
        if (self.time[1:] < self.time[:-1]).any() or not self.time[-1] > self.time[0]:
            raise BadInput("The times of the surface's knots must not decrease.")
        # Knots closer than this rounding are a jump; over longer pieces Δv/Δt must be finite.
        least = EPSILON * float(np.abs(self.time[[0, -1]]).max())
        if float(self.v.max()) - float(self.v.min()) > LARGEST * least:
            raise BadInput("The surface's accelerations must be finite.")
        if periods < 1:
            raise BadInput(f"The knots are to be run through {periods} times, not once or more.")
        self.law = friction_law(mu_s, mu_k, force_per_mass, gravity, mu_plate)
        self.z0, self.v0 = z0, float(self.v[0] if v0 is None else v0)
        self.periods = periods
        self.period = float(self.time[-1] - self.time[0])
        self.end = float(self.time[0]) + periods * self.period

    def arguments(self) -> tuple[int | float, ...]:
        if not (np.isfinite(self.z0) and np.isfinite(self.v0)):
            raise BadInput("The part's first height and velocity must be finite.")
        surface = (len(self.time), self.time.ctypes.data, self.v.ctypes.data, self.periods)
        return (*surface, self.law.ctypes.data, self.z0, self.v0)

    def all_knots(self) -> Array:
        if self.periods == 1:
            return self.time
        return (np.arange(self.periods)[:, None] * self.period + self.time).ravel()

    def times(self, output: Real) -> Array:
        at = np.ascontiguousarray(output, dtype=np.float64)
        edge = 1e-9 * (self.end - self.time[0])
        if at.ndim != 1 or len(at) == 0 or (at[1:] < at[:-1]).any() or np.isnan(at).any():
            raise BadInput("The times of the output must be a list that does not decrease.")
        if at[0] < self.time[0] - edge or at[-1] > self.end + edge:
            raise BadInput(
                f"The times of the output must lie between {self.time[0]:g} and {self.end:g} s."
            )
        return at

    def stepped(
        self, solve: Callable[..., int], own: tuple[float, ...], output: Real | None
    ) -> PartMotion:
        """The motion by a compiled routine and its ``own`` arguments, first the fixed step (s)."""
        step, span = own[0], self.end - self.time[0]
        if not step > 0 or span / step > MOST_STEPS:
            raise BadInput(f"The step must be positive, and no less than {span / MOST_STEPS:g} s.")
        # The last whole step may stop short of the end.
        steps = int(np.floor(span / step + 1e-6))
        z, v, stuck = rows = np.empty((3, steps + 1))
        pointers = (row.ctypes.data for row in rows)
        events = solve(*self.arguments(), *own, steps, *pointers)
        times = self.time[0] + np.arange(len(z)) * step
        if output is not None:
            at = self.times(output)
            z, v, stuck = (np.interp(at, times, values) for values in rows)
            times = at
        return PartMotion(times, z, v, _shares(times, stuck), events)


def _shares(times: Array, stuck: Array) -> Array:
    """Shares of intervals spent sticking, from the time ``stuck`` (s) until each of ``times``."""
    lengths = np.diff(times)
    shares = np.divide(np.diff(stuck), lengths, out=np.zeros_like(lengths), where=lengths > 0)
    return np.clip(shares, 0.0, 1.0)
