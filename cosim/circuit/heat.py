"""How warm a coil becomes: two nodes, winding and body, each with its capacity and its resistance.

    C_w Ṫ_w = P − (T_w − T_b)/R_w        C_b Ṫ_b = (T_w − T_b)/R_w − T_b/R_b

with P the heat of the winding, W, and T the rises over the air, K. The circuit drives a current, so
warm copper dissipates more, P (1 + α T_w). The equations are solved for P = 1 W and scaled by the
heat at the greatest rise: exact in continuous use, an upper bound in cycles.
**An estimate, no rating:** the data sheet of the Carlton (C-151L337V5R2) gives a range of drives,
3.6 to 10 V peak-to-peak, and 125 mA rms, but no power and no temperature.
Body: its 20.5 cm² lose 10 to 15 W/(m² K) to still air, and its 15 g hold 0.4 to 0.67 J/(g K).
Winding, assumed: the 0.9 to 3.6 g of copper that make 7.1 Ohm of wire of 0.14 to 0.2 mm, in a gap
of a few tenths of a millimetre.
"""

from functools import lru_cache
from math import expm1, inf, isfinite, sqrt
from typing import Any

from cosim.errors import BadInput
from cosim.scene import Scene
from cosim.scene.tables import Coil

DRIVE_RANGE_HEAT = 5.0**2 / 7.1
"""W: the largest heat of any drive within the Carlton's range, in its 7.1 Ohm: a square wave of
10 V peak-to-peak without offset. It is no rating; the authors saw the housing melt (README of their
repository)."""

RATED_CURRENT = 0.125
"""A rms, from the data sheet of the Carlton."""

COPPER = 3.93e-3
"""1/K: α of copper's resistance at 20 °C (IEC 60028)."""

MELTED = 1065.0
"""K: the rise at which copper melts."""
MELTED_COLD = MELTED / (1.0 + COPPER * MELTED)
"""K: the rise calculated with the resistance of cold copper, when the true one reaches MELTED."""

LIFT = 10.0
"""s: the duration of one lift, for which a summary states the rise."""

_CYCLES = ((LIFT, 0.0), (inf, 1.0))
"""On-time (s) and duty of a single lift, and of continuous use."""

SPREAD = {
    **{"winding_to_body": 2.0, "winding_capacity": 1.9},
    **{"body_to_air": 1.22, "body_capacity": 1.25},
}
"""Factor, either way, by which each parameter of the estimate may be off."""


def modes(
    winding_to_body: float, body_to_air: float, winding_capacity: float, body_capacity: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Resistance (K/W) and time constant (s) of both exponentials of the winding's rise, which is
    P Σ r (1 − exp(−t/τ)) under a constant heat from t = 0 on."""
    both = winding_to_body + body_to_air
    zero = winding_to_body * body_to_air * body_capacity  # coefficient of s in Z's numerator
    # slow + fast and slow · fast are the coefficients of Z's denominator.
    sum_of_both = winding_capacity * both + body_capacity * body_to_air
    slow = 0.5 * (sum_of_both + sqrt(sum_of_both**2 - 4.0 * winding_capacity * zero))
    fast = winding_capacity * zero / slow
    # Z(s) = (R_w + R_b + s R_w R_b C_b) / ((1 + s slow)(1 + s fast)), in partial fractions.
    share = (both * slow - zero) / (slow - fast)
    return (share, slow), (both - share, fast)


def rise(coil: Coil, on_time: float = inf, duty: float = 1.0, side: int = 0) -> float:
    """The winding's greatest rise over the air, K, per watt of heat while the current is on:
    ``on_time`` (s) in each of many cycles, a share ``duty`` of the cycle; duty 0 is a single
    on-time. ``side`` 1 and -1 take the upper and lower end of the estimate, 0 its middle.
    """
    return _rise(_estimate(coil), on_time, duty, side)


def _estimate(coil: Coil) -> tuple[float, ...]:
    return tuple(getattr(coil, name) for name in SPREAD)


@lru_cache  # all settings of a study have one coil
def _rise(estimate: tuple[float, ...], on_time: float, duty: float, side: int) -> float:
    given = dict(zip(SPREAD, estimate, strict=True))
    for name, factor in SPREAD.items():
        given[name] *= factor ** (-side if name.endswith("capacity") else side)
    cycle = on_time / duty if duty else inf
    return sum(r * expm1(-on_time / tau) / expm1(-cycle / tau) for r, tau in modes(**given))


def warmed(heat: float, cold: float) -> float:
    """The rise, K, under a current that dissipates ``heat`` (W) in cold copper, with ``cold`` the
    rise per watt (K/W, from :func:`rise`); infinite where the copper would melt."""
    rise_cold = heat * cold
    return rise_cold / (1.0 - COPPER * rise_cold) if rise_cold < MELTED_COLD else inf


def heat_limit(coil: Coil, rise_limit: float, duty: float = 1.0, on_time: float = LIFT) -> float:
    """The largest heat (W, in the cold winding, while the current is on) whose rise over the air
    stays within ``rise_limit`` (K), in cycles with the current on for ``on_time`` (s), a share
    ``duty`` of the cycle.

    Raises BadInput for values out of range.
    """
    if not (rise_limit > 0.0 and 0.0 <= duty <= 1.0 and on_time > 0.0):
        raise BadInput(
            f"a limit of heat needs a rise above 0 K, a duty from 0 to 1 and a time above 0 s, not "
            f"{rise_limit:g} K, {duty:g} and {on_time:g} s."
        )
    cold = rise(coil, on_time if duty < 1.0 else inf, duty)
    return rise_limit / (cold * (1.0 + COPPER * rise_limit))


def rises(coil: Coil, heat: float) -> list[list[float | None]]:
    """The rises, K, after one LIFT and in continuous use, of a current that dissipates ``heat`` (W)
    in the cold winding: lower and upper end of the estimate each, None where it is unlimited."""
    estimate = _estimate(coil)
    ends = [[warmed(heat, _rise(estimate, *on, side)) for side in (-1, 1)] for on in _CYCLES]
    return [[end if isfinite(end) else None for end in both] for both in ends]


def heats(scene: Scene, energy_copper: float) -> dict[str, Any]:
    """A summary's entries on heat: the mean power in one coil (W), and its :func:`rises` (K).

    ``energy_copper`` (J) is dissipated in all coils and sense resistors. It includes the losses by
    eddy currents, which are counted as heat of the winding; that is on the safe side.
    """
    coil = scene.coil
    # With a user's netlist ``energy_copper`` has no sense resistor in it.
    sense = 0.0 if scene.rung.own_netlist else scene.sense
    share = coil.resistance / (coil.resistance + sense)
    coils = coil.count * (1 if scene.drive.phase_deg is None else 2)
    heat = energy_copper / coils / scene.run.duration * share
    lift, continuous = rises(coil, heat)
    return {"coil_heat": heat, "coil_rise_lift": lift, "coil_rise_continuous": continuous}
