"""Where coupling methods fail: the largest stable macro step of voice coils on two bodies,
predicted and observed.

Predicted from the spectral radius of the coupled linear map; observed by running the method with
the FMU as the mechanics or, at the other cut, with the same linear participants. See
:mod:`cosim.coupling.rewind.stability`.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from math import pi
from typing import Literal

import numpy as np

from cosim.coupling.participants.linear import LinearParticipant, coil, regulated_coil
from cosim.coupling.participants.stickslip import FmuMechanics
from cosim.coupling.rewind.joint import Joint
from cosim.coupling.rewind.methods import variants
from cosim.coupling.rewind.stability import largest_stable_step, observed_limit
from cosim.evaluate.store import Store, reported
from cosim.files.picture import Picture
from cosim.scene import Scene, changed, load
from cosim.studies.plots import BLUE, GREEN, ORANGE, VERMILION, panels
from cosim.studies.report import Progress, Report, Row, silent, span
from cosim.typed import typed
from cosim.waveforms.quantities import percent

Output = Literal["saturated", "regulated"]
Cut = Literal["coil in circuit", "coil in mechanics"]
Table = Mapping[str, float]

_LINEAR: Table = {"mechanics.gravity": 0.0, "mechanics.suspension_k3": 0.0, "mechanics.travel": 1e3}
"""No gravity, no hardening, no wall in reach."""


@dataclass(frozen=True, eq=False)
class Machine:
    """A voice coil on two bodies with linear mechanics: the scene `reference` with ``settings``."""

    name: str
    settings: Table

    @cached_property
    def scene(self) -> Scene:
        return changed(load("reference"), {**_LINEAR, **self.settings}, "stability")

    @property
    def strength(self) -> float:
        """Strength of the coupling while the part sticks, Bl²/(m R), 1/s. m: reduced mass of the
        bodies between which the coil acts; R: resistance around the loop of the back-EMF."""
        m, coil = self.scene.mechanics, self.scene.coil
        mass = 1.0 / (1.0 / m.ram_mass + 1.0 / (m.surface_mass + m.part_mass))
        around = coil.resistance + self.scene.circuit.sense_resistance
        return coil.force_factor**2 / (mass * around)

    def but(self, name: str, settings: Table) -> "Machine":
        """This machine under another name, with further ``settings``."""
        return Machine(name, {**self.settings, **settings})


REFERENCE = Machine("reference", {})
STRONG = Machine("Bl 3 N/A", {"coil.force_factor": 3.0})
DIRECT = Machine(
    "direct drive",
    {
        "coil.force_factor": 4.38,
        "coil.resistance": 4.3,
        "coil.inductance": 0.83e-3,
        "circuit.sense_resistance": 1e-3,
        "mechanics.ram_mass": 4.33e-3,
        "mechanics.suspension_k1": 1.0 / 1.07e-3,
        "mechanics.suspension_damping": 0.474,
        "mechanics.surface_mass": 100.0,
        "mechanics.flexure_stiffness": 1e6,
        "mechanics.flexure_damping": 1e3,
    },
)
"""A loudspeaker driver like Dayton's ND91-4 on a voltage, its frame held: Bl 4.38 N/A, 4.3 Ω,
0.83 mH, 4.33 g, 1.07 mm/N, 0.474 kg/s."""
SLOW = DIRECT.but("direct drive, 10 L", {"coil.inductance": 8.3e-3})


@dataclass(frozen=True)
class Regime:
    """A machine in one working state (amplifier, part), cut into two participants."""

    machine: Machine
    output: Output
    slips: bool = False
    cut: Cut = "coil in circuit"

    @property
    def scene(self) -> Scene:
        """The scene with the part held by friction, or without friction if it ``slips``."""
        free = {"friction.mu_k": 0.0, "friction.mu_s": 0.0}
        held = {"friction.mu_s": 1000.0, "friction.normal_force": 1e9}
        return changed(self.machine.scene, free if self.slips else held, "stability")


def _bodies(regime: Regime) -> tuple[list[list[float]], list[float]]:
    """Matrix (4 × 4) and input vector, per A of current, of the state equation of both bodies. The
    states are the ram's travel q against the surface, dq/dt, the surface's height z_s, dz_s/dt."""
    m, bl = regime.machine.scene.mechanics, regime.machine.scene.coil.force_factor
    carried = m.surface_mass + (0.0 if regime.slips else m.part_mass)
    k, c = m.suspension_k1, m.suspension_damping
    kf, cf = m.flexure_stiffness, m.flexure_damping
    both = 1.0 / m.ram_mass + 1.0 / carried  # inverse of the reduced mass, 1/kg
    a = [
        [0.0, 1.0, 0.0, 0.0],
        [-k * both, -c * both, kf / carried, cf / carried],
        [0.0, 0.0, 0.0, 1.0],
        [k / carried, c / carried, -kf / carried, -cf / carried],
    ]
    return a, [0.0, bl * both, 0.0, -bl / carried]


def linear_sides(regime: Regime) -> tuple[LinearParticipant, LinearParticipant]:
    """Circuit and mechanics as linear participants without sources; a small initial current
    disturbs them from rest."""
    scene, (a, b) = regime.machine.scene, _bodies(regime)
    bl, inductance = scene.coil.force_factor, scene.coil.inductance
    if regime.cut == "coil in circuit":
        # Mechanics: current in, back-EMF Bl dq/dt out.
        mechanics = LinearParticipant(a, [[x] for x in b], [[0.0, bl, 0.0, 0.0]])
        return circuit_of(regime), mechanics
    # Circuit: current in, coil's voltage out; the sense resistor is on its side.
    sense, rate = scene.circuit.sense_resistance, 2.0 * pi * scene.circuit.gain_bandwidth
    gain = 10.0 ** (scene.circuit.open_loop_gain / 20.0)
    leak, driven = (0.0, 0.0) if regime.output == "saturated" else (-rate / gain, -rate * sense)
    circuit = LinearParticipant([[leak]], [[driven]], [[1.0]], [[-sense]], state=[0.0])
    # Mechanics: voltage in, current out, which is the fifth state.
    whole = [[*row, x] for row, x in zip(a, b, strict=True)]
    whole.append([0.0, -bl / inductance, 0.0, 0.0, -scene.coil.resistance / inductance])
    enters = [[0.0]] * 4 + [[1.0 / inductance]]
    out = [[0.0, 0.0, 0.0, 0.0, 1.0]]
    return circuit, LinearParticipant(whole, enters, out, state=[0.0, 0.0, 0.0, 0.0, 1e-3])


def circuit_of(regime: Regime) -> LinearParticipant:
    """The circuit with the coil in it, at an initial current of 1 mA."""
    scene = regime.machine.scene
    if regime.output == "regulated":
        return regulated_coil(scene, 1e-3)
    around = scene.coil.resistance + scene.circuit.sense_resistance
    return coil(around, scene.coil.inductance, 1e-3)


_COLORS = {1: ORANGE, 2: BLUE, 3: GREEN}
"""Colours of the curves by the order of the method."""
_MARKERS = "osD^v<>PX*hd"

LONGEST = 0.1
"""s; a method that is stable up to here counts as one without a limit."""
_SHORTEST = {"coil in circuit": 1e-5, "coil in mechanics": 1e-8}
"""Shortest macro step, s, from which on the limit is sought, by the cut."""
_SEEN, _MOST_STEPS = 0.15, 6000
"""Duration of an observed run, s, and the most macro steps that it may take."""

METHODS = {
    # With a smaller tolerance the iteration's error would be below the noise of the FMU's solver.
    name: variant
    for name, variant in variants(tolerance=1e-7).items()
    if name not in ("event-aware", "predictor-corrector", "iterated, Aitken", "iterated, Anderson")
}
"""Methods whose step is one linear map between jumps. Of the iterations only Newton's is taken: the
others have the same limits."""

REGIMES = (
    Regime(DIRECT, "saturated"),
    Regime(SLOW, "saturated"),
    Regime(REFERENCE, "saturated"),
    Regime(REFERENCE, "saturated", slips=True),
    Regime(STRONG, "saturated"),
    Regime(STRONG, "saturated", slips=True),
    Regime(REFERENCE, "regulated"),
    Regime(STRONG, "regulated"),
    Regime(DIRECT, "saturated", cut="coil in mechanics"),
    Regime(REFERENCE, "saturated", cut="coil in mechanics"),
    Regime(REFERENCE, "regulated", cut="coil in mechanics"),
)


def over_strength(points: int) -> list[Regime]:
    """The direct drive with other force factors, N/A."""
    factors = np.geomspace(0.5, 12.0, points).tolist()
    return [Regime(DIRECT.but(DIRECT.name, {"coil.force_factor": f}), "saturated") for f in factors]


@dataclass(frozen=True)
class Limit:
    """The largest stable macro step of a method in a regime, s; a row of ``stability.csv``."""

    machine: str
    strength: float
    """Bl²/(m R), 1/s."""
    output: str
    part: str
    cut: str
    method: str
    predicted: float
    observed: float


UNITS = {
    name: f"{name} [{unit}]"
    for name, unit in (("strength", "1/s"), ("predicted", "s"), ("observed", "s"))
}
"""Heads of its columns that have a unit."""


def predicted(method: str, regime: Regime) -> float:
    """Largest stable macro step, s; LONGEST where there is no limit below it."""
    make, shortest = METHODS[method].make, _SHORTEST[regime.cut]
    return largest_stable_step(lambda: make(*linear_sides(regime)), shortest, LONGEST, leap=1.1)


def observed(method: str, regime: Regime, expected: float) -> float:
    """Largest stable macro step, s, by running the method; sought within ±20 % of ``expected``.

    Near a resonance of the mechanics an unstable interval may be narrow: hence the small leaps.
    """
    make = METHODS[method].make
    # Near the limit a disturbance grows slowly: the run must be long enough to show it.
    # At the shortest step the run lasts _SEEN, but has 600 to _MOST_STEPS steps.
    low, high = 0.8 * expected, min(1.2 * expected, LONGEST)
    steps = int(min(max(600.0, _SEEN / low), _MOST_STEPS))
    with ExitStack() as alive:

        def fresh() -> Joint:
            if regime.cut == "coil in mechanics":
                return make(*linear_sides(regime))
            alive.close()
            mechanics = alive.enter_context(closing(FmuMechanics(regime.scene)))
            # A push: a current alone might die away without having moved anything.
            mechanics.advance(1e-3, np.array([[1e-3]]))
            return make(circuit_of(regime), mechanics)

        return observed_limit(fresh, low, high, steps=steps, leap=1.05)


def limits(regimes: Sequence[Regime], store: Store) -> Iterator[Limit]:
    for regime in regimes:
        m, part = regime.machine, "slips" if regime.slips else "sticks"
        given = (m.name, m.strength, regime.output, part, regime.cut)
        for method in METHODS:
            both = store.once(f"{method}, {given}", partial(_both, method, regime))
            yield Limit(*given, method, *both)


def _both(method: str, regime: Regime) -> list[float]:
    expected = predicted(method, regime)
    return [expected, observed(method, regime, expected)]


@typed
def stability(
    *,
    quick: bool = False,
    out: str | os.PathLike[str] | None = None,
    progress: Progress = silent,
) -> Report:
    """The largest stable macro step of every coupling method, predicted and observed; ``quick``: of
    few machines.

    Each of the report's ``rows`` is a method in a regime: ``machine``, ``strength [1/s]`` of the
    coupling, Bl²/(m R), ``output`` (regulated or saturated), ``part``, ``cut`` (on whose side the
    coil is), ``method``, ``predicted [s]`` and ``observed [s]``. ``tables`` have the predicted
    limits in ms, by cut.

    In the folder ``out`` it leaves what ``Report.save`` writes, and takes up what an interrupted
    study has left there. Raises BadInput.
    """
    regimes = [*(REGIMES[:1] if quick else REGIMES), *over_strength(3 if quick else 9)]

    def made(store: Store) -> Report:
        found: list[Limit] = []
        for limit in limits(regimes, store):
            found.append(limit)
            progress(len(found), len(METHODS) * len(regimes), limit.method)
        return report(found)

    return reported(made, out, "stability.sqlite", quick)


def report(found: Sequence[Limit]) -> Report:
    """The report on the limits of all methods and regimes."""
    # The direct drive on a voltage, its force factor varied; ``free`` methods are always stable.
    driven = [x for x in found if x.machine == DIRECT.name and x.cut == "coil in circuit"]
    free = [m for m in METHODS if all(x.predicted >= LONGEST for x in driven if x.method == m)]
    message = "The stronger the coil couples, the shorter the macro step must be"
    if free:
        have = "has" if len(free) == 1 else "have"
        message += f"; only {' and '.join(free)} {have} no limit below {LONGEST:g} s"
    worst = max(abs(x.observed / x.predicted - 1.0) for x in found)
    swept = [x for x in driven if x.strength != DIRECT.strength]  # with other force factors
    notes = [
        f"{message}.",
        "Limits: largest macro step at which a coupling is stable, predicted from the spectral "
        "radius of the coupled linear map, and observed by running it (with the FMU as the "
        "mechanics where the coil is in the circuit). The greatest difference between the two is "
        f"{percent(worst)}. Both are in stability.csv, over a strength of the coupling Bl²/(m R) "
        f"of {span([x.strength for x in swept])} 1/s.",
    ]
    tables: dict[str, Sequence[Row]] = {
        f"Predicted limits in ms, {cut}; - is none below {LONGEST * 1e3:g} ms": by_method(
            [x for x in found if x.cut == cut and x not in swept]
        )
        for cut in dict.fromkeys(x.cut for x in found)
    }
    return Report(
        "stability", "Stability of the coupling methods",
        [{UNITS.get(name, name): x for name, x in asdict(limit).items()} for limit in found],
        notes, tables, {"": partial(draw, driven, free, message)}, message,
    )  # fmt: skip


def by_method(limits: Sequence[Limit]) -> list[Row]:
    """Table of predicted limits, ms: a row for each method, a column for each working state."""
    rows: dict[str, Row] = {}
    for x in limits:
        said = f"{x.predicted * 1e3:.3g}" if x.predicted < LONGEST else "-"
        rows.setdefault(x.method, {"method": x.method})[f"{x.machine}, {x.output}, {x.part}"] = said
    return list(rows.values())


def draw(limits: Sequence[Limit], free: Sequence[str], title: str) -> Picture:
    """The limits of each method over the strength of the coupling."""
    note = "Direct drive with other force factors. Lines: predicted; marks: observed with the FMU."
    figure, (axis,) = panels(title, note, (11.0, 5.6))
    strengths = sorted({x.strength for x in limits})
    none = LONGEST * 1e3
    without = f"{' and '.join(free)} (none below {none:g} ms)"
    axis.axhline(none, color=VERMILION, lw=2.0, label=without)
    axis.plot(strengths, [1e3 / s for s in strengths], "--", color="0.4", lw=1.0, label="m R/Bl²")
    limited = [method for method in METHODS if method not in free]
    for marker, method in zip(_MARKERS, limited, strict=False):
        own = sorted((x for x in limits if x.method == method), key=lambda x: x.strength)
        known = [x for x in own if x.predicted < LONGEST]
        p = METHODS[method].order
        x, color = [limit.strength for limit in known], _COLORS[p]
        axis.plot(x, [limit.predicted * 1e3 for limit in known], color=color, lw=1.6)
        observed = [limit.observed * 1e3 for limit in known]
        axis.plot(x, observed, marker, color=color, ms=5, label=f"{method} (order {p})")
    axis.axvline(DIRECT.strength, color="0.4", lw=0.9, ls=":")
    axis.annotate(
        f"direct drive, {DIRECT.scene.coil.force_factor:g} N/A",
        (DIRECT.strength, 40.0),
        (5, 0),
        textcoords="offset points",
        color="0.3",
    )
    axis.set(
        xscale="log",
        yscale="log",
        xlabel="strength of the coupling Bl²/(m R) [1/s]",
        ylabel="largest stable macro step [ms]",
    )
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize=9)
    return figure
