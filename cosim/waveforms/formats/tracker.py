"""A run as a tracked trial, with the header, units, sampling and digits of the published trials.

The camera is that of `cosim compare`, with the shutter of the run's scene, without noise. Motion
that the model does not have is written as 0: horizontal motion, and the spring-loaded plate.
"""

from functools import partial
from io import BytesIO
from math import isfinite

import numpy as np

from cosim.errors import BadInput, plain
from cosim.scene import Scene
from cosim.trials.camera import (
    FRAME_RATE,
    accelerations,
    frame_count,
    frame_times,
    heights,
    velocities,
)
from cosim.trials.table import FEWEST_ROWS
from cosim.waveforms.formats.source import Format, Run, machine

MOST_FRAMES = 200_000
"""With more frames the file would be too large for `cosim compare`."""

MISSING = "\ufffd"
"""The published trials' mark for a value that Tracker could not calculate."""


def write(run: Run, file: BytesIO) -> str:
    """Platform p, part o and spring-loaded plate s, mm, frame by frame."""
    scene = machine(run, "tracker", "z_surface", "v_surface", "z_part", "v_part")
    start, _ = laid_over(scene)
    n = frame_count(run.waveforms, start)
    if not FEWEST_ROWS <= n <= MOST_FRAMES:
        shortest, longest = ((rows - 1) / FRAME_RATE for rows in (FEWEST_ROWS, MOST_FRAMES))
        raise BadInput(
            f"{plain(run.folder)}: tracker needs {FEWEST_ROWS} to {MOST_FRAMES} frames, and "
            f"the camera sees {n} of this run; run.duration must be {shortest:.4g} s to "
            f"{longest:.4g} s more than {start:g} s."
        )
    exposure = scene.run.shutter / FRAME_RATE
    at, rest = frame_times(start, n), np.zeros(n)
    columns = {"t": (time := at - at[0])}
    for body, name in (("p", "surface"), ("o", "part"), ("s", "")):
        z = heights(run.waveforms, name, at, exposure) if name else rest
        across, along = rest, 1e3 * z
        for kind, made in (("", np.copy), ("v", partial(velocities, time)), ("a", accelerations)):
            columns[f"{kind}x{body}"] = made(across)
            columns[f"{kind}z{body}"] = made(along)
    rows = zip(*(map(number, values.tolist()) for values in columns.values()), strict=True)
    text = "\r\n".join([",".join(columns), *map(",".join, rows)])
    file.write(text.encode())
    return f"{n} frames at {FRAME_RATE:g} frames/s from {start:g} s on"


def laid_over(scene: Scene) -> tuple[float, float | None]:
    """The first time of a run that may correspond to a trial's first frame, s, and its period, s;
    None without a drive, or with a surface from a file: such a run cannot be shifted."""
    if scene.drive.file is not None:
        return 0.0, None
    length = scene.period
    return scene.run.settle, length if isfinite(length) else None


def number(value: float) -> str:
    """Seven digits, and eight places after the point, as the published trials have them."""
    if np.isnan(value):
        return MISSING
    return f"{float(f'{value:.7g}'):.8f}".replace("-0.00000000", "0.00000000")


FORMAT = Format("tracker", "tracker.csv", "a tracked trial", write)
