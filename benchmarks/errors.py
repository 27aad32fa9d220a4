"""Errors of our runs at the settings at which they are timed, and the growth of the cost.

For ``amplifier``, ``ideal`` and ``limited`` it is that of the part's path in the scene `reference`,
against the monolithic reference solution (``reference.json``; for ``limited`` that of the
amplifier). ``full`` is compared with finer steps, since there is no reference of the schematic, and
the part alone with the closed form of its mean velocity.
"""

import json
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.drive.surface.formulas import Transport, average_velocity
from cosim.scene import Scene, load
from cosim.simulation.rungs.given_surface import force_per_mass
from cosim.simulation.simulate import simulate
from cosim.studies.speed.bench import BRIEF_FULL, LONG_PART, spread, take_turns

BRIEF = ("run.duration=0.2", "run.settle=0.1")
"""Settings that shorten the scene `reference` to the length of its reference solution."""

_FINER = ("circuit.reltol=1e-6", "circuit.max_step=5e-6")


def of_rungs() -> dict[str, float]:
    """The relative error of each rung."""
    return {
        "full": _error_of_full(),
        "amplifier": own_error("amplifier", "amplifier"),
        "ideal": own_error("ideal", "ideal"),
        "part": _error_of_part(),
        "limited": own_error("limited", "amplifier"),
    }


def cost_exponent(rounds: int, periods: Sequence[int]) -> dict[str, Any]:
    """Exponent of the CPU time of `reference` over its duration, by least squares in logarithms."""
    calls = {
        str(n): partial(simulate, load("reference", [f"run.duration={n / 20}"])) for n in periods
    }
    costs = np.log([*take_turns(calls, rounds).values()])  # durations × rounds
    exponents = np.polyfit(np.log(periods), costs, 1)[0]
    return {**spread(exponents.tolist()), "periods": list(periods)}


@cache
def _reference() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("reference.json").read_text(encoding="utf-8"))


def times() -> list[float]:
    """Times of the reference solution, s."""
    return _reference()["time"]


def brief(*overrides: str) -> Scene:
    """The scene `reference` as long as its reference solution, with a row at each of its times."""
    return load("reference", [*BRIEF, "run.output_step=1e-3", *overrides])


def error(path: Array, circuit: str = "amplifier") -> float:
    """Largest error of heights (m) at the reference's times, over the path's own range."""
    true = np.array(_reference()[circuit]["z_part"])
    return float(np.abs(path - true).max() / np.ptp(true))


def own_error(model: str, reference: str) -> float:
    """The error of our run on a rung."""
    found = simulate(brief(f"circuit.model={model}")).columns["z_part"]
    return error(found[1 : 1 + len(times())], reference)


def _error_of_full() -> float:
    path, finer = (
        simulate(load("reference", [*BRIEF_FULL, *more])).columns["z_part"] for more in ((), _FINER)
    )
    return float(np.abs(path - finer).max() / np.ptp(finer))


def _error_of_part() -> float:
    scene = load("optimal", LONG_PART)
    friction, drive, gravity = scene.friction, scene.drive, scene.mechanics.gravity
    case = Transport(
        *(friction.mu_s, friction.mu_k, drive.acceleration_max),
        *(force_per_mass(scene) / gravity, 1 / drive.frequency),
        gravity=gravity,
    )
    found = simulate(scene).summary["v_average"]
    assert isinstance(found, float)
    return abs(found / average_velocity(case) - 1)
