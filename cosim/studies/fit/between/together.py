"""The velocity that part and surface have together, which friction between them cannot change.

While part and surface slide on each other, friction gives the one the momentum that it takes from
the other: the velocity of both together, u = (v_surface + r v_part)/(1 + r) with r the part's mass
over the surface's, knows nothing of it. It breaks at impacts and where the driving force steps, and
nowhere else; so it is u that is reconstructed between the frames. Units: s, m.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.studies.fit.between.breaks import TURN, Breaks, Model, estimate
from cosim.studies.fit.between.motion import Motion
from cosim.trials.tracked import Trial

REST = 1  # frames on either side within which a resting part has not slid
STILL = 3.0  # times the noise of a slide; within this it has not
APART = 10  # frames at least between rests that are told
TYPICAL = 0.5  # ratio of the masses, for a first look
EVEN = 1e-3  # of the time between frames; times that are so close to even ones are even


@dataclass(frozen=True)
class Frames:
    """Tracked heights [m] at ``time`` [s], and the plate's height and velocity [m/s]."""

    name: str
    time: Array
    z_surface: Array
    z_part: Array
    v_part: Array
    z_plate: Array
    v_plate: Array


def plate_velocity(trial: Trial) -> Array:
    """Of the springed plate [m/s] at the frames, as tracked, or 0 where it was not."""
    if trial.plate is None or not np.isfinite(trial.plate.v).any():
        return np.zeros(len(trial.time))
    known = np.isfinite(trial.plate.v)
    return np.interp(trial.time, trial.time[known], trial.plate.v[known])


def frames(trial: Trial, plate_moves: bool) -> Frames:
    """What a trial gives; a plate that does not move rests."""
    time = trial.time - trial.time[0]
    even = np.linspace(0.0, time[-1], len(time))
    if np.abs(time - even).max() < EVEN * even[1]:
        time = even
    v_plate = plate_velocity(trial) if plate_moves else np.zeros(len(time))
    # The height that belongs to a velocity that is linear between frames.
    rises = np.diff(time) * (v_plate[1:] + v_plate[:-1]) / 2
    z_plate = np.append(0.0, np.cumsum(rises))
    return Frames(
        *(trial.name, time, trial.platform.z, trial.part.z, trial.part.v, z_plate, v_plate)
    )


class Together:
    """Part and surface together, for a ratio of their masses, and where the part rests on it."""

    def __init__(self, seen: Frames, ratio: float, plate: bool, before: "Together | None") -> None:
        self.frames, self.ratio = seen, ratio
        if before:
            self.noise, model, kinds = before.noise, before.model, before.searched
        else:
            # The noise of a track, from that of both together as if both were tracked alike.
            plain = estimate(seen.time, together(seen.z_surface, seen.z_part, TYPICAL))
            self.noise = plain.noise * (1 + TYPICAL) / (1 + TYPICAL**2) ** 0.5
            model, kinds = None, None
        self.still = _still(seen.z_part - seen.z_surface, STILL * 2**0.5 * self.noise)
        tracks = _averaged(seen.z_surface, seen.z_part, self.still)
        z = together(*tracks, ratio)
        self.model: Model = model or estimate(seen.time, together(*tracks, TYPICAL))
        self.searched, self.likelihood = Breaks(seen.time, z).search(self.model, kinds)
        self._z, self._plate = z, plate

    @property
    def unlikelihood(self) -> float:
        """Minus the logarithm of the likelihood of both tracks, but for what the ratio of masses
        does not change: where the part slides they tell (1 + r) u, and else u."""
        sliding = np.count_nonzero(~self.still)
        return sliding * float(np.log1p(self.ratio)) - self.likelihood

    def motion(self) -> Motion:
        """Of both together, u."""
        seen, kinds = self.frames, self.searched.copy()
        if self._plate:
            passed = np.gradient(seen.z_part, seen.time) - seen.v_plate
            kinds[(kinds == 0) & (passed[:-1] * passed[1:] < 0)] = TURN
        return Motion(seen.time, self._z, kinds, self.model, seen.v_plate)

    def rests(self) -> list[int]:
        """Frames at which the part sticks and nothing breaks, some way apart."""
        still = self.still.copy()
        still[1:] &= self.searched == 0
        still[:-1] &= self.searched == 0
        found: list[int] = []
        for i in np.flatnonzero(still[:-REST]):
            if not found or i - found[-1] >= APART:
                found.append(int(i))
        return found


def together(z_surface: Array, z_part: Array, ratio: float) -> Array:
    """The height of part and surface together."""
    return (z_surface + ratio * z_part) / (1 + ratio)


def _still(slide: Array, most: float) -> npt.NDArray[np.bool_]:
    """Frames about which the part has not slid farther."""
    near = np.lib.stride_tricks.sliding_window_view(slide, 2 * REST + 1)
    return np.pad(np.ptp(near, axis=1) < most, REST)


def _averaged(z_surface: Array, z_part: Array, still: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Both tracks, each with half the noise's variance where the part sticks and both say one."""
    z_surface, z_part = z_surface.copy(), z_part.copy()
    for run in np.split(np.arange(len(still)), np.flatnonzero(np.diff(still)) + 1):
        if still[run[0]]:
            slide = float((z_part[run] - z_surface[run]).mean())
            z_surface[run] = (z_surface[run] + z_part[run] - slide) / 2
            z_part[run] = z_surface[run] + slide
    return z_surface, z_part
