"""An identified rig and its trials as scenes, which `cosim run` takes on every rung."""

import warnings
from typing import Any

import numpy as np

from cosim.arrays import Array, slope
from cosim.errors import BadInput, Note, SimulationFailed
from cosim.scene import Scene, keys, load
from cosim.simulation.simulate import simulate
from cosim.stepper.stepper import OWN
from cosim.studies.identify.problem.space import Space
from cosim.studies.identify.problem.targets import DRIVE, Measured
from cosim.trials.camera import hermite

Settings = dict[str, float | str]

DIGITS = 6
"""Of the numbers in a scene."""


def rig_settings(space: Space, place: Array) -> Settings:
    """The rig by the keys of a scene, rounded as its scene has it."""
    return {key: _rounded(value) for key, value in space.settings(place).items()}


def trial_settings(
    space: Space, place: Array, trial: Measured, own: Array
) -> tuple[Settings, float]:
    """A trial by the keys of a scene, and when in its run (s) the record's first row is.

    The run begins at rest, with the record or with the drive, whichever is earlier.
    """
    rig, numbers = space.settings(place), dict(zip(OWN, own.tolist(), strict=True))
    held = rig["friction.mu_plate"] * numbers["normal_force"]
    first = max(0.0, -numbers["start"])
    found: Settings = {
        "friction.normal_force": numbers["normal_force"],
        "mechanics.initial_lift": numbers["lift"] * held / rig["mechanics.flexure_stiffness"],
    }
    if trial.target.current is None:
        begun = numbers["phase"] + numbers["frequency"] * numbers["start"]
        found |= {
            f"drive.{name}": numbers[name] for name in DRIVE if name in ("amplitude", "offset")
        }
        found |= {"drive.frequency": numbers["frequency"], "drive.start_phase": float(begun % 1.0)}
        found |= {"drive.start_time": max(0.0, numbers["start"])}
    lasts = float(trial.recording.time[-1])
    found |= {"run.duration": first + lasts, "run.settle": first}
    found["run.average"] = "slope"
    return {key: _rounded(value, 9) for key, value in found.items()}, first


def scene(settings: Settings, circuit: str) -> Scene:
    """The checked scene of all keys of a rig and a trial, with a circuit."""
    return load("reference", settings | {"circuit.model": circuit})


def toml(description: str, settings: Settings) -> str:
    """A scene file that holds these keys, each with its unit and meaning."""
    lines = [f'description = "{description}"']
    table = ""
    for key in keys():
        if key.full not in settings:
            continue
        if key.table != table:
            table = key.table
            lines += ["", f"[{table}]"]
        value = settings[key.full]
        unit = "" if key.unit in ("1", "") else f" # {key.unit}"
        lines.append(f"{key.name} = {_spelt(value)}{unit}")
    return "\n".join(lines) + "\n"


def _rounded(value: float | str, digits: int = DIGITS) -> float | str:
    if isinstance(value, str) or value == 0.0:
        return value
    return float(np.format_float_positional(value, digits, unique=False, fractional=False))


def _spelt(value: float | str) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return repr(float(value))


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
