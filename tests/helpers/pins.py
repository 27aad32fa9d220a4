"""Left limits of a command, and the voltages of the firmware's two pins behind it."""

from math import inf, nextafter

from cosim.drive.pieces import LEVEL, Command, Piece
from cosim.scene.firmware import GAIN


def piece_before(drive: Command, t: float) -> Piece:
    """The piece that holds just before ``t``."""
    return drive.piece(nextafter(t, -inf))


def value_before(drive: Command, t: float) -> float:
    """Left limit of V1 at ``t``, V; differs from ``value`` at jumps only."""
    return piece_before(drive, t).before(t)


def v_dac(drive: Command, t: float) -> float:
    """Voltage of the DAC at ``t``, V."""
    return _dac(drive, drive.piece(t), drive.value(t))


def v_dac_before(drive: Command, t: float) -> float:
    """Its left limit."""
    return _dac(drive, piece_before(drive, t), value_before(drive, t))


def _dac(drive: Command, piece: Piece, command: float) -> float:
    return piece.dac if piece.kind == LEVEL else drive.v_offset - command / GAIN


def pin(drive: Command, t: float) -> float:
    """Voltage of the offset pin at ``t``, V."""
    return drive.piece(t).pin


def pin_before(drive: Command, t: float) -> float:
    """Its left limit."""
    return piece_before(drive, t).pin
