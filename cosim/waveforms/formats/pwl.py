"""The drive as a voltage source of SPICE, to be included: piecewise linear, over the whole run."""

from io import BytesIO

from cosim.drive.command import command
from cosim.drive.straights import straights
from cosim.waveforms.formats.source import Format, Run, driven, lagging

CHORDS = 256
"""Straight lines in a period of a sine; their error is 5e-5 of the amplitude."""

EDGE = 1e-9
"""Duration of a jump, s; it begins at the jump's time."""


def write(run: Run, file: BytesIO) -> str:
    """``Vcommand v1 0 PWL(…)`` for ``.include`` in ngspice and LTspice: V1, at the nodes of the
    netlists' own source. A jump lasts 1 ns, and a period of a sine is 256 straight lines. The
    offset pin has its mean: the ripple of ``drive.pwm_ripple`` is left out."""
    scene = driven(run, "pwl")
    points = [(0.0, 0.0)]
    for edges, start, end in straights([command(scene)], scene.run.duration, CHORDS):
        for k, (first, last) in enumerate(zip(start[:, 0], end[:, 0], strict=True)):
            # The last line of a run may end within the jump before it, by rounding at once.
            if edges[k + 1] - edges[k] <= EDGE:
                continue
            if abs(first - points[-1][1]) > 1e-9:
                points.append((edges[k] + EDGE, first))
            points.append((edges[k + 1], last))
    lines = [f"+ {time:.15g} {volts:.9g}" for time, volts in points]
    head = f"* {scene.name}: {scene.drive.waveform}, V1 in V over s"
    file.write("\n".join([head, "Vcommand v1 0 PWL(", *lines, "+ )\n"]).encode())
    ripple = ", without the ripple of drive.pwm_ripple" if scene.drive.pwm_ripple else ""
    return f"{len(points)} points over {scene.run.duration:g} s{ripple}{lagging(scene)}"


FORMAT = Format("pwl", "command.cir", "the drive as a source of SPICE", write)
