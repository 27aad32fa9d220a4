"""The surface's velocity as sound: WAV, mono, 16 bit, 48 kHz."""

import wave
from fractions import Fraction
from io import BytesIO
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.waveforms.formats.source import Format, Run, machine

RATE = 48000  # Hz
LARGEST = 32767  # of a 16-bit sample
SILENCE = 1e-9
"""m/s; a surface that is never faster is at rest: its rounding errors are not amplified."""

LOW_PASS: Any = ("kaiser", 12.0)
"""Window of SciPy's filter; its side lobes, at -118 dB, are below the resolution of 16 bits."""

LARGEST_TERM = 10_000
"""Largest term of the fraction for the ratio of rates; it changes the pitch by less than 1e-4."""

LONGEST = 600.0  # s, of a run
RAREST = 1e-2  # s between rows


def write(run: Run, file: BytesIO) -> str:
    """The whole run from its beginning, rounded to whole samples. The loudest one is ±32767; the
    printed line has the factor to m/s."""
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
    with wave.open(file, "wb") as out:
        out.setnchannels(1)
        out.setsampwidth(2)
        out.setframerate(RATE)
        out.writeframes(np.rint(sound / factor).astype("<i2").tobytes())
    return f"{len(sound) / RATE:.3g} s at {RATE} Hz; surface velocity in m/s = sample * {factor!r}"


def resampled(values: Array, step: float) -> Array:
    """``values``, ``step`` seconds apart, resampled at RATE, from the first to the last."""
    from scipy.signal import resample_poly

    exact = Fraction(RATE * step)
    larger = max(exact, 1 / exact)
    ratio = larger.limit_denominator(max(1, int(LARGEST_TERM / larger)))
    up, down = (ratio if exact > 1 else 1 / ratio).as_integer_ratio()
    sound = resample_poly(values, up, down, window=LOW_PASS, padtype="edge")
    return sound[: (len(values) - 1) * up // down + 1]


FORMAT = Format("wav", "surface.wav", "the surface's velocity as sound", write)
