"""Measured trials as targets of the search.

A record is used unchanged, from its first row on: a start from rest, seen by a camera with an
arbitrary zero of height. Velocities are central differences of the heights, or were measured
directly. The cost of a trial is the weighted sum of its signals' squared NRMSE (rms error over
standard deviation). Missing values have no residual.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, Note, plain
from cosim.stepper.stepper import OWN
from cosim.studies.identify.chain.chain import Target
from cosim.studies.identify.problem.space import Space, own_bounds
from cosim.trials.camera import velocities
from cosim.trials.periods import period_of
from cosim.trials.recording import Recording, read_recording
from cosim.trials.tracked import number_of, trial_files

WEIGHTS = {"v_surface": 0.5, "z_surface": 0.3, "v_part": 0.15, "z_part": 0.25}
"""Weights of the squared NRMSE; those of the signals that a trial has are scaled to a sum of 1.
Velocities show the fast part of a motion, heights the slow one; the part's heights show transport:
a weight of 0.25 instead of 0.1 halves the error of v_average and hardly changes those of the
velocities."""

SURFACE = {name: WEIGHTS[name] for name in ("v_surface", "z_surface")}
"""Weights that fit a trial's own parameters to the surface alone, on a rig from other trials."""

SEARCH_STEP, FINE_STEP = 1.0 / 960 / 14, 1.0 / 960 / 40
"""Longest time steps (s) of the search, and of its finish and all that is reported: fractions of
the interval between frames of a camera with 960 frames/s."""

DRIVE = ("amplitude", "offset", "phase", "start", "frequency")
"""Own parameters of a trial that are not needed where its current was measured."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A trial: its recording, and the targets that simulations of it are compared with."""

    label: str
    """The last whole number in the file's name, or the name."""
    recording: Recording
    frequency: float
    """Of the periodic motion, Hz."""
    target: Target
    """For the search."""
    fine: Target
    """For the finish, with a shorter time step."""
    surface: Target
    """For the finish, with the surface's signals alone."""

    @property
    def has_part(self) -> bool:
        return "z_part" in self.target.signals


def read_trials(folder: Path, space: Space) -> list[Measured]:
    """The trials of a folder, in the order of their numbers. Raises BadInput."""
    found = [measured(read_recording(path), path, space) for path in trial_files(folder)]
    labels, name = [one.label for one in found], plain(folder)
    for label in labels:
        if labels.count(label) > 1:
            raise BadInput(f"{name}: two trials are called {label}; number their files.")
    return found


def measured(recording: Recording, path: Path, space: Space) -> Measured:
    """One trial. Raises BadInput where it has no moving surface or does not repeat."""
    file = plain(path)
    for sentence in (*recording.notes, *recording.understood.get("gaps", ())):
        warnings.warn(f"{file}: {sentence}", Note, stacklevel=2)
    signals = {name: recording.signals[name] for name in WEIGHTS if name in recording.signals}
    if not {"z_surface", "v_surface"} & set(signals):
        raise BadInput(f"{file}: there is no height or velocity of the surface.")
    differenced = set()
    for body in ("surface", "part"):
        if f"z_{body}" in signals:
            heights = signals[f"z_{body}"]
            heights = heights - heights[np.isfinite(heights)][0]
            signals |= {f"z_{body}": heights, f"v_{body}": velocities(recording.time, heights)}
            differenced.add(f"v_{body}")
    for name, values in signals.items():
        if not np.nanvar(values) > 0.0:
            raise BadInput(f"{file}: {name} does not change: there is nothing to identify.")
    current = recording.signals.get("current")
    if current is not None and not np.isfinite(current).all():
        raise BadInput(f"{file}: the current has gaps; it is what drives the simulation.")
    frequency = 1.0 / (period_of(recording.time, signals["v_surface"]) or np.nan)
    if current is None and not np.isfinite(frequency):
        raise BadInput(f"{file}: the surface's motion does not repeat, so its drive is not known.")
    low, high, scale = own_bounds(space, frequency)
    if current is not None:
        # Not fitted and without effect: all 0, but the frequency, a divisor, 1 Hz.
        needless = [OWN.index(name) for name in DRIVE]
        low[needless] = high[needless] = [float(name == "frequency") for name in DRIVE]
        scale[needless] = 0.0

    def target(step: float, weights: Mapping[str, float]) -> Target:
        chosen = {name: signals[name] for name in weights if name in signals}
        whole = sum(weights[name] for name in chosen)
        # Squared NRMSE = Σ residual² / (known values × variance).
        each = {
            name: weights[name] / whole / np.isfinite(values).sum() / np.nanvar(values)
            for name, values in chosen.items()
        }
        ends = low, high, scale
        return Target(recording.time, chosen, each, frozenset(differenced), *ends, step, current)

    number = number_of(path)
    return Measured(
        path.stem if number is None else str(number),
        recording,
        frequency,
        target=target(SEARCH_STEP, WEIGHTS),
        fine=target(FINE_STEP, WEIGHTS),
        surface=target(FINE_STEP, SURFACE),
    )


def draws(target: Target, count: int, rng: np.random.Generator) -> Array:
    """Random own parameters (count × OWN) within the bounds; the lift near the middle, where most
    trials rest, and the frequency as it was measured."""
    low, high = target.low.copy(), target.high.copy()
    cycle, lift, rate = (OWN.index(name) for name in ("phase", "lift", "frequency"))
    if not np.isfinite(low[cycle]):
        low[cycle], high[cycle] = 0.0, 1.0
    low[rate] = high[rate] = 0.5 * (low[rate] + high[rate])
    found = low + rng.random((count, len(OWN))) * (high - low)
    middle = 0.5 * (low[lift] + high[lift])
    found[:, lift] = middle + 0.5 * (found[:, lift] - middle)  # the middle half of its bounds
    return found


def own_parameters(own: Array) -> dict[str, float]:
    """A trial's own parameters by name, SI."""
    return dict(zip(OWN, own.tolist(), strict=True))
