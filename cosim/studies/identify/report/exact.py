"""An identified trial on the bench's own rungs, beside the steps that the search took."""

import warnings
from typing import Any

import numpy as np

from cosim.errors import BadInput, Note, SimulationFailed
from cosim.simulation.simulate import simulate
from cosim.studies.identify.report.measures import slope
from cosim.studies.identify.report.scenes import Settings, scene
from cosim.trials.camera import hermite

CIRCUITS = ("limited", "amplifier")
"""Solved from event to event with the mechanics; and with ngspice."""


def exact(settings: Settings, first: float, time: np.ndarray) -> dict[str, Any]:
    """Mean velocity of the part (mm/s) on each of ``CIRCUITS`` over a record's ``time`` (s), whose
    first row is at ``first`` in the run; None, and why, where a run fails."""
    found: dict[str, Any] = {}
    for circuit in CIRCUITS:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", Note)
                made = scene(settings | {"run.duration": first + float(time[-1]) + 1e-3}, circuit)
                waves = simulate(made).waveforms
        except (BadInput, SimulationFailed) as error:
            found |= {circuit: None, f"{circuit}_failure": str(error)}
            continue
        z = hermite(time + first, *(waves[name].values for name in ("time", "z_part", "v_part")))
        found[circuit] = slope(time, z) * 1e3
    return found
