"""The command V1(t) of a scene, at the power amplifier's input.

The netlist of the full circuit has a difference amplifier, V1 = GAIN (v_offset - v_dac), so each
command also gives the voltages of the DAC and of the offset pin. The offset pin is set so that the
highest command needs V_DAC = 0; it is in fact a PWM, with mean ``v_offset``.
"""

from math import inf, nextafter

from cosim.drive.periodic import Corners, Lines, Sine, held
from cosim.drive.pieces import Command, Piece, level
from cosim.drive.staircase import Staircase, WithPwm
from cosim.scene import Scene
from cosim.scene.firmware import GAIN, nearest_code, offset_pin, passes, sampled, staircase, volts
from cosim.scene.tables import Drive


class Lagging(Command):
    """Another command, later by ``lag`` (s); 0 V before ``start`` (s)."""

    def __init__(self, command: Command, lag: float, start: float = -inf) -> None:
        self._command = command
        self._lag, self._start = lag, start
        self.v_offset, self.period = command.v_offset, command.period

    def piece(self, t: float) -> Piece:
        if t < self._start:
            return level(self._start, 0.0, self.v_offset)
        piece = self._command.piece(self._own(t))
        # Rounding of the sum must not put the ends at or before t.
        piece.until = max(piece.until + self._lag, nextafter(t, inf))
        piece.jump = max(piece.jump + self._lag, nextafter(t, inf))
        piece.origin += self._lag
        return piece

    def _own(self, t: float) -> float:
        """The other command's time, t - lag, corrected for rounding: at, before or after its corner
        exactly as ``t`` is to the corner delayed by the lag."""
        own = t - self._lag
        corner = self._command.piece(own - 1e-12 - 1e-15 * abs(t)).until
        edge = corner + self._lag
        if t == edge:
            return corner
        return min(own, nextafter(corner, -inf)) if t < edge else max(own, nextafter(corner, inf))


def commands(scene: Scene) -> list[Command]:
    """The commands of a scene's surfaces: one, or two where they move by themselves."""
    if scene.drive.phase_deg is None:
        return [command(scene)]
    return [command(scene), command(scene, scene.drive.phase_deg / 360.0)]


def command(scene: Scene, lag: float = 0.0) -> Command:
    """The command of a scene with a coil, later by ``lag`` (periods) but switched on as without."""
    made, drive = shape(scene), scene.drive
    if drive.start_time or drive.start_phase or lag:
        late = drive.start_time + (lag - drive.start_phase) * made.period
        made = Lagging(made, late, drive.start_time)
    return WithPwm(made) if drive.pwm_ripple else made


def shape(scene: Scene) -> Command:
    """The command of a scene's drive as if it had begun long ago."""
    drive = scene.drive
    if not drive.quantised:
        return _smooth(drive, drive.amplitude, drive.offset)
    top = nearest_code(drive.amplitude / GAIN)
    if drive.waveform == "sawtooth" and not drive.reset_time:
        codes = staircase(top, drive.frequency)
    else:
        levels = _smooth(drive, 1.0, 0.0)
        codes = sampled(lambda t: 0.5 - levels.value(t), top, drive.frequency)
    pin = volts(nearest_code(offset_pin(drive.offset, drive.amplitude)))
    if drive.loop_time:
        return Staircase(passes(codes, drive.loop_time), pin, 1 / drive.loop_time)
    return Staircase(codes, pin)


def _smooth(drive: Drive, amplitude: float, offset: float) -> Command:
    if drive.waveform == "sine":
        return Sine(drive.frequency, amplitude, offset)
    return Lines(drive.frequency, amplitude, offset, corners(drive))


def corners(drive: Drive) -> Corners:
    """The corners of a shape of straight lines. A sawtooth is V1 = offset + amplitude (t/T - 1/2)
    on [0, T), then a jump; with a reset time it rises for T less that, then falls linearly."""
    if drive.table is not None:
        return held(drive.table) if drive.waveform == "steps" else drive.table
    if drive.waveform == "square":
        return held([(0.0, 0.5), (drive.duty, -0.5)])
    end = -0.5 if drive.waveform == "falling-sawtooth" else 0.5
    return [(0.0, -end), (1.0 - drive.reset_time * drive.frequency, end)]
