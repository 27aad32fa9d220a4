"""Where coupling methods fail: the largest stable macro step, predicted and observed.

Predicted from the spectral radius of the coupled linear map; observed by running the method with
the FMU as the mechanics or, at the other cut, with the same linear participants. See
:mod:`cosim.coupling.rewind.stability`.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass

import numpy as np

from cosim.coupling.participants.amplifier import Amplifier
from cosim.coupling.participants.stickslip import FmuMechanics
from cosim.coupling.rewind.joint import Joint
from cosim.coupling.rewind.methods import variants
from cosim.coupling.rewind.stability import largest_stable_step, observed_limit
from cosim.drive.command import command
from cosim.evaluate.store import Store
from cosim.scene import changed
from cosim.studies.stability.machines import (
    DIRECT,
    REFERENCE,
    SLOW,
    STRONG,
    Regime,
    circuit_of,
    linear_sides,
)
from cosim.studies.tables import Row

LONGEST = 0.1
"""s; a method that is stable up to here counts as one without a limit."""
_SHORTEST = {"coil in circuit": 1e-5, "coil in mechanics": 1e-8}
_SEEN, _MOST_STEPS = 0.15, 6000
"""s, and macro steps, that a run is watched for."""
_WATCHED = 120  # macro steps behind the limit

METHODS = {
    # An error that dies away sooner lies below the noise of the FMU's own solver.
    name: variant
    for name, variant in variants(tolerance=1e-7).items()
    if name not in ("event-aware", "predictor-corrector", "iterated, Aitken", "iterated, Anderson")
}
"""Methods whose step is one linear map wherever nothing jumps; of the iterations, the limits of the
others are those of Newton's."""

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


def predicted(method: str, regime: Regime) -> float:
    """Largest stable macro step, s; LONGEST where there is no limit below it."""
    sides = lambda: METHODS[method].make(*linear_sides(regime))  # noqa: E731
    return largest_stable_step(sides, _SHORTEST[regime.cut], LONGEST, leap=1.1)


def observed(method: str, regime: Regime, expected: float) -> float:
    """The same by running it, sought within a fifth about the ``expected`` limit (s).

    Near a resonance of the mechanics an unstable interval may be narrow: hence the small leaps.
    """
    make = METHODS[method].make
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
    """Each method in each regime."""
    for regime in regimes:
        m, part = regime.machine, "slips" if regime.slips else "sticks"
        given = (m.name, m.strength, regime.output, part, regime.cut)
        for method in METHODS:

            def found(method: str = method, regime: Regime = regime) -> list[float]:
                expected = predicted(method, regime)
                return [expected, observed(method, regime, expected)]

            yield Limit(*given, method, *store.once(f"{method}, {given}", found))


def with_limits(steps: Sequence[float]) -> Iterator[Row]:
    """Gauss-Seidel k = 1 on ``STRONG`` behind an amplifier that a steady command keeps at its
    swing limit: what becomes of the current after macro steps of these lengths, s."""
    strong, method = Regime(STRONG, "saturated"), "Gauss-Seidel k = 1"
    drive = {"waveform": "square", "offset": 8.0, "amplitude": 1e-6, "frequency": 0.2}
    scene = changed(
        strong.scene, {f"drive.{key}": value for key, value in drive.items()}, "stability"
    )
    limit = predicted(method, strong)
    for h in steps:
        with closing(FmuMechanics(scene)) as mechanics:
            joint = METHODS[method].make(Amplifier(scene, command(scene)), mechanics)
            currents = np.empty(_WATCHED)
            for k in range(_WATCHED):
                joint.step(h)
                currents[k] = joint.past.current.value[0]
        late = currents[_WATCHED // 2 :]
        yield {
            "macro step [s]": h,
            "of the clamped state's limit": h / limit,
            "least current [A]": float(late.min()),
            "greatest current [A]": float(late.max()),
        }
