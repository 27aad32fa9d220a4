"""Voltages of the firmware's two pins behind a command, from its pieces."""

from cosim.drive.pieces import LEVEL, Command, Piece
from cosim.scene.firmware import GAIN


def v_dac(drive: Command, t: float) -> float:
    """Voltage of the DAC at ``t``, V."""
    return _dac(drive, drive.piece(t), drive.value(t))


def v_dac_before(drive: Command, t: float) -> float:
    """Its left limit."""
    return _dac(drive, drive.piece_before(t), drive.value_before(t))


def _dac(drive: Command, piece: Piece, command: float) -> float:
    return piece.dac if piece.kind == LEVEL else drive.v_offset - command / GAIN


def pin(drive: Command, t: float) -> float:
    """Voltage of the offset pin at ``t``, V."""
    return drive.piece(t).pin


def pin_before(drive: Command, t: float) -> float:
    """Its left limit."""
    return drive.piece_before(t).pin
