"""The drive as a voltage source of SPICE, to be included: piecewise linear, over the whole run."""

from io import BytesIO

from cosim.drive.command import command
from cosim.drive.straights import straights
from cosim.waveforms.formats.source import Format, Run, driven

CHORDS = 256
"""Straight lines a period of a sine; the shape within one is off by 5e-5 of the amplitude."""

EDGE = 1e-9
"""s: what a jump takes, after its time."""


def write(run: Run, file: BytesIO) -> str:
    """``Vcommand v1 0 PWL(…)`` for ``.include``, in ngspice and LTspice: V1, where the netlists'
    own source has it. A jump lasts 1 ns, and a sine is 256 straight lines a period."""
    scene = driven(run, "pwl")
    points = [(0.0, 0.0)]
    for edges, start, end in straights([command(scene)], scene.run.duration, CHORDS):
        for k, (first, last) in enumerate(zip(start[:, 0], end[:, 0], strict=True)):
            if abs(first - points[-1][1]) > 1e-9:
                points.append((edges[k] + EDGE, first))
            points.append((edges[k + 1], last))
    lines = [f"+ {time:.15g} {volts:.9g}" for time, volts in points]
    head = f"* {scene.name}: {scene.drive.waveform}, V1 in V over s"
    file.write("\n".join([head, "Vcommand v1 0 PWL(", *lines, "+ )\n"]).encode())
    return f"{len(points)} points over {scene.run.duration:g} s"


FORMAT = Format("pwl", "command.cir", "the drive as a source of SPICE", write)
