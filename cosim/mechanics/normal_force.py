"""The normal force of a grip that changes in time, as a file gives it."""

from bisect import bisect_left, bisect_right
from dataclasses import dataclass
from pathlib import Path

from cosim.errors import BadInput, plain
from cosim.files.cells import read_timetable
from cosim.scene import Scene

_SAME_TIME = 1e-12  # s; times closer than this count as one, as in the recorder


@dataclass(frozen=True)
class NormalForce:
    """Normal force of one surface: ``forces`` (N) at the ``corners`` (s), linear in between; a
    corner given twice is a jump. Before the first corner and after the last it is constant.
    """

    corners: list[float]
    forces: list[float]

    def value(self, time: float) -> float:
        """The force at ``time`` (s), N; at a jump the one after it."""
        corners, forces = self.corners, self.forces
        after = bisect_right(corners, time + _SAME_TIME)
        if after == 0 or after == len(corners):
            return forces[max(0, after - 1)]
        start, end = corners[after - 1], corners[after]
        share = min(max((time - start) / (end - start), 0.0), 1.0)
        return (1.0 - share) * forces[after - 1] + share * forces[after]

    def before(self, time: float) -> float:
        """The force at ``time`` (s), N; at a jump the one before it."""
        at = bisect_left(self.corners, time - _SAME_TIME)
        on_corner = at < len(self.corners) and self.corners[at] <= time + _SAME_TIME
        return self.forces[at] if on_corner else self.value(time)

    def least(self, duration: float) -> tuple[float, float]:
        """The least force (N) from 0 to ``duration`` (s), and its time (s)."""
        ends = [(self.value(time), time) for time in (0.0, duration)]
        pairs = zip(self.forces, self.corners, strict=True)
        return min([*ends, *(pair for pair in pairs if 0.0 <= pair[1] <= duration)])


def normal_force(scene: Scene) -> NormalForce | None:
    """The force in ``friction.normal_force_file``, or None where it is constant.

    The file is a CSV with a header that has ``time [s]`` and ``normal_force [N]``, or the same
    without units. Raises BadInput.
    """
    file = scene.friction.normal_force_file
    if file is None:
        return None
    table = read_timetable(Path(file), ("time [s]", "time"), ("normal_force [N]", "normal_force"))
    name = plain(file)
    if table is None:
        raise BadInput(f"{name}: the header must have the columns time [s] and normal_force [N].")
    times, forces = table.T.tolist()
    low, high = 0.0, 1e9
    for row, force in enumerate(forces, start=2):
        if not low <= force <= high:
            raise BadInput(
                f"{name}, row {row}: the normal force of {force:g} N must be a number from "
                f"{low:g} to {high:g} N."
            )
    return NormalForce(times, forces)
