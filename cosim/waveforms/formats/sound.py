"""The surface's velocity as sound: WAV, mono, 16 bit, 48 kHz.

A linear-phase low-pass filter (Kaiser window, about 118 dB) resamples the rows; its edge is at half
the lower of the two rates, its slope within 6 % of that. The loudest sample is 32767, and the
factor to m/s is the comment in the file's LIST/INFO chunk.
"""

import struct
from fractions import Fraction
from io import BytesIO
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.waveforms.formats.source import Format, Run, machine

RATE = 48000  # Hz
LARGEST = 32767
SILENCE = 1e-9
"""m/s; a slower surface is at rest, and its rounding errors stay inaudible."""

KAISER_BETA = 12.0
HALF_LENGTH = 64
"""Samples, of the lower rate, that the filter reaches to either side."""

LARGEST_TERM = 10_000
"""Of the fraction for the ratio of the rates: rounding changes the pitch by less than 1e-4."""

LONGEST = 600.0  # s
RAREST = 1e-2  # s, of the rows


def write(run: Run, file: BytesIO) -> str:
    """The whole run from its beginning; half a unit of the last place is the error."""
    machine(run, "wav", "v_surface")
    for key, value, most in (
        ("output_step", run.step, RAREST),
        ("duration", run.waveforms["time"][-1], LONGEST),
    ):
        if value > most:
            raise BadInput(
                f"{plain(run.folder)}: wav needs a run.{key} of at most {most:g} s, and the "
                f"run has {value:g} s."
            )
    sound = resampled(run.waveforms["v_surface"], run.step)
    loudest = float(np.abs(sound).max())
    factor = (loudest if loudest > SILENCE else LARGEST * SILENCE) / LARGEST
    samples = np.rint(sound / factor).astype("<i2")
    said = f"surface velocity in m/s = sample * {factor!r}"
    about = {"INAM": run.attributes["title"], "ICMT": said, "ISFT": "cosim"}
    file.write(_wave(samples, about))
    return f"{len(samples) / RATE:.3g} s at {RATE} Hz; {said}"


def resampled(values: Array, step: float) -> Array:
    """``values``, ``step`` seconds apart, at the rate of the sound, from the first to the last."""
    from scipy.signal import firwin, resample_poly

    exact = Fraction(RATE * step)
    ratio = max(exact, 1 / exact)
    ratio = ratio.limit_denominator(max(1, int(LARGEST_TERM / ratio)))
    if ratio == 1:
        return values
    reach, other = ratio.numerator, ratio.denominator
    up, down = (reach, other) if exact > 1 else (other, reach)
    window: Any = ("kaiser", KAISER_BETA)  # SciPy's annotation knows names only
    taps = firwin(2 * HALF_LENGTH * reach + 1, 1.0 / reach, window=window)
    sound = resample_poly(values, up, down, window=taps, padtype="edge")
    return sound[: (len(values) - 1) * up // down + 1]


def _wave(samples: npt.NDArray[np.int16], about: dict[str, str]) -> bytes:
    info = b"".join(_chunk(key, text.encode() + b"\0") for key, text in about.items() if text)
    form = struct.pack("<HHIIHH", 1, 1, RATE, 2 * RATE, 2, 16)  # PCM, one channel
    chunks = (("fmt ", form), ("LIST", b"INFO" + info), ("data", samples.tobytes()))
    return _chunk("RIFF", b"WAVE" + b"".join(_chunk(*chunk) for chunk in chunks))


def _chunk(name: str, data: bytes) -> bytes:
    """Name, length and data, filled to an even length."""
    return name.encode() + struct.pack("<I", len(data)) + data + b"\0" * (len(data) % 2)


FORMAT = Format("wav", "surface.wav", "the surface's velocity as sound", write)
