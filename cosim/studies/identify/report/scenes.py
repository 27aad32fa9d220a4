"""An identified rig and its trials as scenes, which `cosim run` takes on every rung."""

import warnings
from typing import Any

import numpy as np

from cosim.arrays import Array, slope
from cosim.errors import BadInput, Note, SimulationFailed
from cosim.scene import KEYS, Scene, load
from cosim.scene.model import toml_value
from cosim.simulation.simulate import simulate
from cosim.studies.identify.problem.targets import Measured, own_parameters
from cosim.trials.camera import heights

Settings = dict[str, float | str]

RIG_DIGITS, TRIAL_DIGITS = 6, 9
"""Significant digits of the numbers in a scene file."""


def trial_settings(rig: Settings, trial: Measured, own: Array) -> tuple[Settings, float]:
    """A trial on a rig, both by the keys of a scene, and when in its run (s) the record begins.

    The run begins at rest, with the record or with the drive, whichever is earlier.
    """
    values = own_parameters(own)
    # The largest force of the plate's friction; it may hold the surface off its rest by the lift.
    held = float(rig["friction.mu_plate"]) * values["normal_force"]
    first = max(0.0, -values["start"])
    found: Settings = {
        "friction.normal_force": values["normal_force"],
        "mechanics.initial_lift": values["lift"] * held / float(rig["mechanics.flexure_stiffness"]),
    }
    if trial.target.current is None:
        found |= {f"drive.{name}": values[name] for name in ("amplitude", "offset", "frequency")}
        # ``phase`` is that at the record's first row, a scene's that at the drive's start.
        begun = values["phase"] + values["frequency"] * values["start"]
        found |= {"drive.start_phase": begun % 1.0, "drive.start_time": max(0.0, values["start"])}
    lasts = float(trial.recording.time[-1])
    found |= {"run.duration": first + lasts, "run.settle": first, "run.average": "slope"}
    return rounded(found, TRIAL_DIGITS), first


def scene(settings: Settings, circuit: str) -> Scene:
    """The checked scene of all keys of a rig and a trial, with a circuit."""
    return load("reference", settings | {"circuit.model": circuit})


def rounded(settings: Settings, digits: int = RIG_DIGITS) -> Settings:
    """Settings with their numbers rounded to so many significant digits."""
    return {
        key: value if isinstance(value, str) else float(f"{value:.{digits}g}")
        for key, value in settings.items()
    }


def scene_file(description: str, settings: Settings) -> str:
    """A scene file that holds these keys, each with its unit."""
    lines, table = [f"description = {toml_value(description)}"], ""
    for key in KEYS.values():
        if key.full not in settings:
            continue
        if key.table != table:
            table = key.table
            lines += ["", f"[{table}]"]
        value, unit = settings[key.full], "" if key.unit in ("1", "") else f" # {key.unit}"
        lines.append(f"{key.name} = {toml_value(value)}{unit}")
    return "\n".join(lines) + "\n"


CIRCUITS = ("limited", "amplifier")
"""The circuits for the check: the first is solved from event to event, the second by ngspice."""


def exact(settings: Settings, first: float, time: np.ndarray) -> dict[str, Any]:
    """Mean velocity of the part (mm/s) on each of ``CIRCUITS`` over a record's ``time`` (s), whose
    first row is at ``first`` (s) of the run; None, and the failure, where a run fails."""
    found: dict[str, Any] = {}
    for circuit in CIRCUITS:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", Note)
                made = scene(settings | {"run.duration": first + float(time[-1]) + 1e-3}, circuit)
                waves = simulate(made).columns
        except (BadInput, SimulationFailed) as error:
            found |= {circuit: None, f"{circuit}_failure": str(error)}
            continue
        found[circuit] = slope(time, heights(waves, "part", time + first, 0.0)) * 1e3
    return found
