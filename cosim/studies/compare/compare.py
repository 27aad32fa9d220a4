"""Simulated against measured: a run and a tracked trial, through the same camera.

The simulated heights are read at the trial's frame rate and differenced as the tracker does; only
then are they laid over the measured ones. A trial that `cosim export` made of the same run is
recognised by its heights; then the camera's own error is told too.
"""

from dataclasses import dataclass

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.trials.camera import FRAME_RATE, Frames, film, frame_count, frame_times
from cosim.trials.tracked import Trial

SHIFTS = 400
"""Phases that are tried within a period."""

STICKS = 0.01
"""m/s; part and surface that differ by less between frames count as sticking, on both sides."""


@dataclass(frozen=True)
class Metrics:
    """How far apart a run and a trial are; SI but for ``_mm`` and ``_percent``."""

    mean_error_mm: float
    """Mean distance of the part's heights, both from their first: the paper's error."""
    mean_error_percent: float
    """The same, of the part's greatest measured distance from its first height."""
    velocity_r2: float
    """Share of the variance of the surface's measured velocity that the run explains."""
    drift_measured: float
    """Mean velocity of the part, m/s."""
    drift_simulated: float
    """The same of the run."""
    drift_error: float
    slip_fraction_measured: float
    """Share of the frames in which part and surface differ by more than 10 mm/s."""
    slip_fraction_simulated: float
    kick_measured: float
    """Largest change of the surface's velocity from frame to frame, m/s: all that 960 frames/s
    show of an impact."""
    kick_simulated: float
    horizontal_share: float | None
    """Share of the surface's measured motion (mean square velocity) that is horizontal, None where
    that was not tracked; the simulation has none."""
    start: float
    """Time of the run, s, that is laid over the trial's first frame."""


@dataclass(frozen=True)
class CameraError:
    """What the camera alone makes of a run: mean distances of the run's rows from the straight
    lines between the frames, as scripts that interpolate a trial draw them.
    """

    camera_surface_mm: float
    """Of the surface's height."""
    camera_part_mm: float
    """Of the part's height."""
    camera_velocity: float
    """Of the surface's velocity, m/s."""


def measure(
    waveforms: dict[str, Array],
    trial: Trial,
    earliest: float,
    period: float,
    shutter: float = 0.0,
) -> tuple[Metrics, Frames, Frames]:
    """Metrics, and both sides at the trial's frames, the run shifted for the best agreement.

    ``earliest`` is the first time of the run that may be laid over the trial's first frame, s;
    ``shutter`` the exposure as a share of the time between frames.
    """
    exposure = shutter / FRAME_RATE
    measured = _of_trial(trial)
    for body, z in (("platform", measured.z_surface), ("part", measured.z_part)):
        if np.ptp(z) == 0.0:
            raise BadInput(f"{trial.name}: the {body} does not move: there is nothing to compare.")
    own = made_of(waveforms, trial, earliest, shutter)
    end = float(waveforms["time"][-1])
    if period == 0.0 and not own:  # the run begins with the first frame whose velocity is known
        first = int(np.argmax(np.isfinite(trial.platform.v)))
        last = first + int(end * FRAME_RATE + 1e-6) + 1
        measured = Frames(*(values[first:last] for values in vars(measured).values()))
    n = len(measured.time)
    room = end - (n - 1) / FRAME_RATE
    if room < earliest - 1e-9:
        raise BadInput(
            f"The run ends at {end:.4g} s, too early to cover the {n} frames of {trial.name}: "
            f"run.duration must be at least {earliest + n / FRAME_RATE:.4g} s."
        )
    latest = earliest if own else max(earliest, min(room, earliest + period))
    starts = np.linspace(earliest, latest, SHIFTS)
    candidates = (film(waveforms, frame_times(float(start), n), exposure) for start in starts)
    fits = [explained(frames.v_surface, measured.v_surface) for frames in candidates]
    start = float(starts[int(np.argmax(fits))])
    simulated = film(waveforms, frame_times(start, n), exposure)
    moved = simulated.z_part - simulated.z_part[0], measured.z_part - measured.z_part[0]
    error = float(np.nanmean(np.abs(moved[0] - moved[1])))
    span = float(measured.time[-1] - measured.time[0])
    drifts = [float(z[-1] - z[0]) / span for z in moved]
    metrics = Metrics(
        mean_error_mm=error * 1e3,
        mean_error_percent=100.0 * error / float(np.nanmax(np.abs(moved[1]))),
        velocity_r2=max(fits),
        drift_measured=drifts[1],
        drift_simulated=drifts[0],
        drift_error=drifts[0] - drifts[1],
        slip_fraction_measured=_slipping(measured),
        slip_fraction_simulated=_slipping(simulated),
        kick_measured=float(np.nanmax(np.abs(np.diff(measured.v_surface)))),
        kick_simulated=float(np.nanmax(np.abs(np.diff(simulated.v_surface)))),
        horizontal_share=_horizontal(trial),
        start=start,
    )
    return metrics, simulated, measured


def camera_error(waveforms: dict[str, Array], trial: Trial, start: float) -> CameraError:
    """The camera's error in a trial made of this run, whose first frame is at ``start`` (s)."""
    measured = _of_trial(trial)
    known = np.isfinite(measured.v_surface)
    frames = (start + np.arange(len(known)) / FRAME_RATE)[known]
    time = waveforms["time"]
    shown = (time >= frames[0] - 1e-9) & (time <= frames[-1] + 1e-9)

    def distance(column: str) -> float:
        drawn = np.interp(time[shown], frames, getattr(measured, column)[known])
        return float(np.mean(np.abs(waveforms[column][shown] - drawn)))

    surface, part = 1e3 * distance("z_surface"), 1e3 * distance("z_part")
    return CameraError(surface, part, distance("v_surface"))


def made_of(waveforms: dict[str, Array], trial: Trial, start: float, shutter: float = 0.0) -> bool:
    """Whether the trial's heights are this run's from ``start`` (s) on, to a trial's digits."""
    n = len(trial.time)
    if n > frame_count(waveforms, start):
        return False
    seen = film(waveforms, frame_times(start, n), shutter / FRAME_RATE)
    tracked = _of_trial(trial)
    # A trial has seven digits, and eight places of a second or millimetre.
    return all(
        np.allclose(getattr(seen, name), getattr(tracked, name), rtol=6e-7, atol=places)
        for name, places in (("time", 6e-9), ("z_surface", 6e-12), ("z_part", 6e-12))
    )


def _of_trial(trial: Trial) -> Frames:
    platform, part = trial.platform, trial.part
    return Frames(trial.time - trial.time[0], platform.z, platform.v, part.z, part.v)


def explained(found: Array, wanted: Array) -> float:
    """R²: the share of the variance of ``wanted`` that ``found`` explains."""
    known = np.isfinite(found) & np.isfinite(wanted)
    wanted, found = wanted[known], found[known]
    return 1.0 - float(np.sum((wanted - found) ** 2) / np.sum((wanted - wanted.mean()) ** 2))


def _slipping(frames: Frames) -> float:
    apart = np.abs(frames.v_part - frames.v_surface)
    known = np.isfinite(apart)
    return float(np.mean(apart[known] > STICKS))


def _horizontal(trial: Trial) -> float | None:
    across, along = trial.platform.v_across, trial.platform.v
    known = np.isfinite(across) & np.isfinite(along)
    if not known.any():
        return None
    squares = float(np.mean(across[known] ** 2)), float(np.mean(along[known] ** 2))
    return squares[0] / sum(squares)
