"""The rung "limited" against the behavioural amplifier in ngspice, over the three knobs.

What a scene can be asked for is found out first, with the rung "limited" alone: how far does
v_average move where the normal force, the force factor or the inductance change by a little? The
two rungs differ by more than such a change, for example by the microsecond that the amplifier's
output slews at each fall.

These are settings with the scene's own swing loss. Where the amplifier's ringing after a limit
reaches into a slip, the rungs part (see test_choose_rung.py).

    regular     it moves by less than 0.3 %: the rungs must agree within 0.3 %
    marginal    by less than 3 %: within 3 %
    unsteady    it is chaotic (a millionth moves it by 0.1 %) or has several motions to choose from
                (a ten-thousandth moves it by 3 %): statistics only, within an ensemble's spread
"""

from functools import cache
from typing import Literal

import numpy as np
import pytest
from scipy.special import stdtrit

from cosim.scene import load
from cosim.simulation.simulate import simulate

pytestmark = pytest.mark.physics

Class = Literal["regular", "marginal", "unsteady"]
Knobs = tuple[float, float, float]

REGULAR, MARGINAL, CHAOTIC = 3e-3, 3e-2, 1e-3
FLOOR = 1e-4  # m/s; changes are relative to no less than this
NORMAL_FORCE, FORCE_FACTOR, INDUCTANCE = (
    "friction.normal_force",
    "coil.force_factor",
    "coil.inductance",
)
MILLIONTHS = [(NORMAL_FORCE, 1e-6), (FORCE_FACTOR, 1e-6)]
SMALL = [(NORMAL_FORCE, 1e-4), (FORCE_FACTOR, 1e-4), (INDUCTANCE, 1e-2)]
MEMBERS = 16

# Maximum voltage, frequency and offset: where most settings move the part.
LOW, HIGH = (0.3, 0.3, 0.1), (1.0, 0.95, 0.9)


@cache
def sample() -> list[Knobs]:
    from scipy.stats import qmc  # takes a second

    points = qmc.LatinHypercube(3, rng=np.random.default_rng(20)).random(20)
    return [tuple(point) for point in qmc.scale(points, LOW, HIGH).round(4).tolist()]


def settings(knobs: Knobs) -> list[str]:
    """The knobs, and about a second of whole periods."""
    names = ("pot_max", "pot_frequency", "pot_offset")
    turned = [f"drive.{name}={value}" for name, value in zip(names, knobs, strict=True)]
    frequency = load("reference", turned).drive.frequency
    settle, counted = max(1, round(0.4 * frequency)), max(2, round(0.6 * frequency))
    return [
        *turned,
        f"run.settle={settle / frequency!r}",
        f"run.duration={(settle + counted) / frequency!r}",
        "run.output_step=1e-3",
    ]


def run(model: str, common: list[str], key: str = NORMAL_FORCE, change: float = 0.0) -> dict:
    """The summary with one key changed by a part of itself."""
    table, name = key.split(".")
    value = getattr(getattr(load("reference"), table), name) * (1.0 + change)
    return simulate(
        load("reference", [*common, f"circuit.model={model}", f"{key}={value!r}"])
    ).summary


def relative(value: float, to: float) -> float:
    return abs(value - to) / max(abs(to), FLOOR)


def classify(common: list[str], v_average: float) -> tuple[Class, float]:
    """The class of a setting, and the largest relative change that made it so."""

    def moved(changes: list[tuple[str, float]]) -> float:
        return max(
            relative(run("limited", common, key, sign * change)["v_average"], v_average)
            for key, change in changes
            for sign in (1, -1)
        )

    if (chaos := moved(MILLIONTHS)) > CHAOTIC:
        return "unsteady", chaos
    most = moved(SMALL)
    return ("regular" if most < REGULAR else "marginal" if most < MARGINAL else "unsteady"), most


def compare(knobs: Knobs) -> Class:
    common = settings(knobs)
    amplifier, limited = run("amplifier", common), run("limited", common)
    found, expected = limited["v_average"], amplifier["v_average"]
    kind, moved = classify(common, found)
    print(
        f"{load('reference', common).drive.frequency:5.1f} Hz {knobs} {kind:8} {moved:7.1e}  "
        f"v {1e3 * expected:9.4f} {1e3 * found:9.4f} mm/s  {relative(found, expected):7.2%}  "
        f"limited {limited['saturated_fraction']:.3f} of the time"
    )
    assert limited["saturated_fraction"] == pytest.approx(
        amplifier["saturated_fraction"], abs=0.02 if kind == "unsteady" else 2e-3
    )
    if kind != "unsteady":
        allowed = REGULAR if kind == "regular" else MARGINAL
        assert relative(found, expected) < allowed
        return kind
    # The rungs differ in the current, and so in the coil's force.
    changes = [1e-4 * sign * k for k in range(1, MEMBERS // 2 + 1) for sign in (1, -1)]
    members = [run("limited", common, FORCE_FACTOR, change) for change in changes]
    for name in ("v_average", "stick_fraction", "z_surface_pp"):
        values = [member[name] for member in members]
        # Where one more member of the ensemble would lie, but for one time in a thousand.
        reach = stdtrit(MEMBERS - 1, 0.9995) * np.std(values, ddof=1) * np.sqrt(1 + 1 / MEMBERS)
        assert amplifier[name] == pytest.approx(np.mean(values), abs=reach + 1e-6), name
    return kind


@pytest.mark.parametrize("number", [3, 4, 15])
def test_a_few_settings(number: int) -> None:
    assert compare(sample()[number]) != "unsteady"


@pytest.mark.slow
@pytest.mark.parametrize("number", range(20))
def test_settings_over_the_three_knobs(number: int) -> None:
    compare(sample()[number])


@pytest.mark.slow
def test_a_good_part_of_the_settings_has_a_number_to_meet() -> None:
    steady = 0
    for knobs in sample():
        common = settings(knobs)
        steady += classify(common, run("limited", common)["v_average"])[0] != "unsteady"
    assert steady >= 10
