"""Simulated seconds per second of each rung, with its error; and how the cost grows."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from cosim.drive.surface.formulas import Transport, average_velocity
from cosim.scene import Scene, load
from cosim.simulation.rungs.given_surface import force_per_mass
from cosim.simulation.simulate import simulate
from cosim.studies.bench.measures import BRIEF_FULL, own_error, spread, take_turns

_FINER = ("circuit.reltol=1e-6", "circuit.max_step=5e-6")
"""There is no reference of the schematic: it is compared with itself at these steps."""

_LONG_PART = ("run.duration=100", "run.output_step=1e-2")
"""So long, and so few rows, that starting and writing rows cost next to nothing."""


def real_time(rounds: int) -> dict[str, Any]:
    """Spread of the simulated seconds per CPU second of whole runs; ``error`` of each.

    The errors of ``amplifier``, ``ideal`` and ``limited`` are those of the part's path against the
    reference (for ``limited`` that of the amplifier); ``full`` is compared with finer steps, and
    the part alone with the closed form of its mean velocity.
    """
    cases: dict[str, tuple[Scene, Callable[[], float]]] = {
        "full": (load("reference", BRIEF_FULL), _error_of_full),
        "amplifier": (load("reference"), partial(own_error, "amplifier", "amplifier")),
        "ideal": (load("reference", ["circuit.model=ideal"]), partial(own_error, "ideal", "ideal")),
        "part": (load("optimal", _LONG_PART), _error_of_part),
        "limited": (
            load("reference", ["circuit.model=limited"]),
            partial(own_error, "limited", "amplifier"),
        ),
    }
    calls = {name: partial(simulate, scene) for name, (scene, _) in cases.items()}
    taken = take_turns(calls, rounds)
    return {
        name: spread([scene.run.duration / seconds for seconds in taken[name]])
        | {"error": measured()}
        for name, (scene, measured) in cases.items()
    }


def cost_exponent(rounds: int, periods: Sequence[int]) -> dict[str, Any]:
    """Exponent with which the CPU time of `reference` grows with its duration, by least squares."""
    calls = {
        str(n): partial(simulate, load("reference", [f"run.duration={n / 20}"])) for n in periods
    }
    taken = take_turns(calls, rounds)
    costs = np.log([taken[str(n)] for n in periods])
    exponents = np.polyfit(np.log(periods), costs, 1)[0]
    return {**spread(exponents.tolist()), "periods": list(periods)}


def _error_of_full() -> float:
    path, finer = (
        simulate(load("reference", [*BRIEF_FULL, *more])).columns["z_part"] for more in ((), _FINER)
    )
    return float(np.abs(path - finer).max() / np.ptp(finer))


def _error_of_part() -> float:
    scene = load("optimal", _LONG_PART)
    friction, drive, gravity = scene.friction, scene.drive, scene.mechanics.gravity
    case = Transport(
        *(friction.mu_s, friction.mu_k, drive.acceleration_max),
        *(force_per_mass(scene) / gravity, 1 / drive.frequency),
        gravity=gravity,
    )
    found = simulate(scene).summary["v_average"]
    assert isinstance(found, float)
    return abs(found / average_velocity(case) - 1)
