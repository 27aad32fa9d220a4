"""Where coupling methods fail: the largest stable macro step, predicted and observed.

Predicted from the spectral radius of the coupled linear map; observed by running the method with
the FMU as the mechanics or, at the other cut, with the same linear participants. See
:mod:`cosim.coupling.rewind.stability`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosim.coupling.participants.amplifier import Amplifier
from cosim.coupling.participants.stickslip import FmuMechanics
from cosim.coupling.polynomials import Array
from cosim.coupling.rewind import methods
from cosim.coupling.rewind.iterated import Iterated
from cosim.coupling.rewind.joint import Joint
from cosim.coupling.rewind.stability import largest_stable_step, observed_limit
from cosim.drive.command import command
from cosim.scene import load
from cosim.studies.stability.machines import (
    DIRECT,
    PAPER,
    STRONG,
    Cut,
    Machine,
    Output,
    circuit_of,
    linear_sides,
    scene_of,
)
from cosim.studies.study import Row, write

LONGEST = 0.1
"""s; a method that is stable up to here counts as one without a limit."""
_SHORTEST: dict[Cut, float] = {"coil in circuit": 1e-5, "coil in mechanics": 1e-8}
_SEEN, _MOST_STEPS = 0.15, 6000
"""s, and macro steps, that a run is watched for."""
_WATCHED = 120  # macro steps behind the limit

METHODS = methods.METHODS | {
    # What dies away soon lies below the noise of the FMU's own solver, on which nothing agrees.
    "iterated, plain": lambda a, b: Iterated(a, b, "plain", tolerance=1e-7),
    "iterated, Newton": lambda a, b: Iterated(a, b, "newton", tolerance=1e-7),
}

DRAWN = (
    "Jacobi k = 0",
    "Jacobi k = 1",
    "Gauss-Seidel k = 0",
    "Gauss-Seidel k = 1",
    "EMF's slope, linear current",
    "companion",
)


@dataclass(frozen=True)
class Regime:
    """A machine at one working state, cut in two."""

    machine: Machine
    output: Output
    slips: bool = False
    cut: Cut = "coil in circuit"

    @property
    def title(self) -> str:
        parts = [self.machine.name, self.output, "slip" if self.slips else "stick", self.cut]
        return ", ".join(parts)


REGIMES = (
    Regime(DIRECT, "saturated"),
    Regime(PAPER, "saturated"),
    Regime(PAPER, "saturated", slips=True),
    Regime(STRONG, "saturated"),
    Regime(STRONG, "saturated", slips=True),
    Regime(PAPER, "regulated"),
    Regime(STRONG, "regulated"),
    Regime(DIRECT, "saturated", cut="coil in mechanics"),
    Regime(PAPER, "saturated", cut="coil in mechanics"),
    Regime(PAPER, "regulated", cut="coil in mechanics"),
)


@dataclass(frozen=True)
class Sweep:
    """Largest stable steps, s, over the strength of the coupling Bl²/(m R), 1/s."""

    strength: Array
    predicted: dict[str, Array]
    observed: dict[str, Array]


@dataclass(frozen=True)
class Map:
    """Of Gauss-Seidel k = 1: largest stable step (s) over m R/Bl² (columns) and L/R (rows), s."""

    mechanical: Array
    electrical: Array
    step: Array


def predicted(method: str, regime: Regime, leap: float = 1.15) -> float:
    """Largest stable macro step, s; LONGEST where there is no limit below it."""
    m, output, slips, cut = regime.machine, regime.output, regime.slips, regime.cut
    make = METHODS[method]
    return largest_stable_step(
        lambda: make(*linear_sides(m, output, slips, cut)), _SHORTEST[cut], LONGEST, leap=leap
    )


def observed(method: str, regime: Regime, expected: float) -> float:
    """The same by running it, sought within a fifth about the ``expected`` limit (s).

    Near a resonance of the mechanics an unstable interval may be narrow: hence the small leaps.
    """
    m, output, cut = regime.machine, regime.output, regime.cut
    make = METHODS[method]
    low, high = 0.8 * expected, min(1.2 * expected, LONGEST)
    steps = int(min(max(600.0, _SEEN / low), _MOST_STEPS))
    if cut == "coil in mechanics":
        sides = lambda: make(*linear_sides(m, output, regime.slips, cut))  # noqa: E731
        return observed_limit(sides, low, high, steps=steps, leap=1.05)
    scene = scene_of(m, regime.slips)
    alive: list[FmuMechanics] = []

    def end() -> None:
        while alive:
            alive.pop().close()

    def fresh() -> Joint:
        end()
        alive.append(FmuMechanics(scene))
        # A push: a current alone might die away without having moved anything.
        alive[0].advance(1e-3, np.array([[1e-3]]))
        return make(circuit_of(m, output), alive[0])

    try:
        return observed_limit(fresh, low, high, steps=steps, leap=1.05)
    finally:
        end()


def limits(regimes: Sequence[Regime] = REGIMES) -> Iterator[Row]:
    """The table: each method in each regime."""
    for regime in regimes:
        for method in METHODS:
            expected = predicted(method, regime, leap=1.1)
            found = observed(method, regime, expected)
            yield {
                "machine": regime.machine.name,
                "output": regime.output,
                "part": "slips" if regime.slips else "sticks",
                "cut": regime.cut,
                "method": method,
                "predicted [s]": expected,
                "observed [s]": found,
                "observed / predicted": found / expected,
                "no limit below 0.1 s": expected >= LONGEST,
            }


def with_limits(steps: Sequence[float]) -> Iterator[Row]:
    """Gauss-Seidel k = 1 on ``STRONG`` behind an amplifier that a steady command keeps at its
    swing limit: what becomes of the current after macro steps of these lengths, s."""
    free = scene_of(STRONG, False)
    overrides = [
        f"mechanics.{key}={getattr(free.mechanics, key)!r}"
        for key in ("gravity", "suspension_k3", "travel")
    ]
    overrides += [f"coil.force_factor={STRONG.force_factor!r}", "friction.mu_s=1000"]
    overrides += ["friction.normal_force=1e9", "drive.waveform=square", "drive.offset=8"]
    overrides += ["drive.amplitude=1e-6", "drive.frequency=0.2"]
    scene = load("paper", overrides)
    limit = predicted("Gauss-Seidel k = 1", Regime(STRONG, "saturated"))
    for h in steps:
        mechanics = FmuMechanics(scene)
        try:
            method = METHODS["Gauss-Seidel k = 1"](Amplifier(scene, command(scene)), mechanics)
            currents = np.empty(_WATCHED)
            for k in range(_WATCHED):
                method.step(h)
                currents[k] = method.past.current.value[0]
        finally:
            mechanics.close()
        late = currents[_WATCHED // 2 :]
        yield {
            "macro step [s]": h,
            "of the clamped state's limit": h / limit,
            "least current [A]": float(late.min()),
            "greatest current [A]": float(late.max()),
        }


def over_strength(points: int) -> Sweep:
    """The direct drive with other force factors."""
    factors = np.geomspace(0.4, 12.0, points)
    machines = [replace(DIRECT, force_factor=float(f)) for f in factors]
    strength = np.array(
        [f**2 / (m.mass(False) * m.loop) for f, m in zip(factors, machines, strict=True)]
    )
    expected = {
        name: np.array([predicted(name, Regime(m, "saturated")) for m in machines])
        for name in DRAWN
    }
    seen = {
        name: np.array(
            [
                observed(name, Regime(m, "saturated"), h) if k % 2 else np.nan
                for k, (m, h) in enumerate(zip(machines, expected[name], strict=True))
            ]
        )
        for name in DRAWN
    }
    return Sweep(strength, expected, seen)


def over_time_constants(points: int) -> Map:
    """The direct drive with other force factors and inductances."""
    mechanical, electrical = np.geomspace(1e-4, 0.3, points), np.geomspace(1e-5, 1e-2, points)
    step = np.empty((points, points))
    for row, tau in enumerate(electrical):
        for column, slow in enumerate(mechanical):
            factor = (DIRECT.mass(False) * DIRECT.loop / slow) ** 0.5
            m = replace(DIRECT, force_factor=float(factor), inductance=float(tau * DIRECT.loop))
            step[row, column] = predicted("Gauss-Seidel k = 1", Regime(m, "saturated"))
    return Map(mechanical, electrical, step)


def run(out: Path, quick: bool) -> None:
    """Write ``stability`` as png, csv, md and json into ``out``, and print what stands out."""
    from cosim.studies.stability.figure import draw

    rows = list(limits(REGIMES[:2] if quick else REGIMES))
    sweep = over_strength(5 if quick else 13)
    grid = over_time_constants(5 if quick else 11)
    worst = max(abs(row["observed / predicted"] - 1.0) for row in rows)
    first = len(METHODS)  # rows of the direct drive, the first regime
    here = {row["method"]: row["observed [s]"] for row in rows[:first]}
    beyond = list(with_limits((4e-3,) if quick else (4e-3, 5e-3, 6e-3)))
    notes = [
        "Largest macro step at which a coupling is stable: predicted from the spectral radius of "
        "the coupled linear map, and observed by running it (with the FMU as the mechanics where "
        "the coil is in the circuit). 0.1 s stands for no limit below it.",
        f"The greatest difference between the two is {worst:.1%}.",
        "An amplifier's limits add what no linear map knows: where its clamped output makes an "
        "unstable coupling, the growing oscillation ends as soon as the output leaves the limit, "
        "and what remains is bounded but false (second table; steady, it would be 1.26 A). In the "
        "paper's scene the output is clamped for less than a macro step after each fall of the "
        "command, so the limit of the clamped state is never met there.",
        f"On the direct drive (Bl 4.38 N/A) the companion is stable to at least "
        f"{here['companion'] / here['Gauss-Seidel k = 1']:.0f} times the step of Gauss-Seidel "
        f"k = 1, {here['Gauss-Seidel k = 1'] * 1e3:.2f} ms.",
    ]
    tables = {"Limits": rows, "Behind the limit of a clamped amplifier": beyond}
    write(out, "stability", "Stability of the coupling methods", tables, notes)
    draw(sweep, grid, out / "stability.png")
    print("\n".join(notes[1:]))
    print(f"Written to {out}: stability.csv, stability.md, stability.json, stability.png")
