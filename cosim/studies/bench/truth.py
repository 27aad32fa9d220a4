"""Errors of the part's path in the scene `paper`, against the monolithic reference solution."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.scene import Scene, load

BRIEF = ("run.duration=0.2", "run.settle=0.1")
"""Settings that make `paper` as short as the reference."""

BRIEF_FULL = ("run.duration=0.1", "run.settle=0.05")
"""Settings that shorten `paper-full`, which is thirty times as slow."""

_ROW = 1e-3
"""s; the reference's times are whole rows."""


@cache
def _reference() -> dict[str, Any]:
    return json.loads(Path(__file__).with_name("reference.json").read_text(encoding="utf-8"))


def times() -> list[float]:
    """Times of the reference, s."""
    return _reference()["time"]


def brief(*overrides: str) -> Scene:
    """The scene `paper` over the reference's time, with a row at each of its times."""
    return load("paper", [*BRIEF, f"run.output_step={_ROW}", *overrides])


def heights(waveforms: dict[str, npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """Heights (m) of a run of :func:`brief` at the reference's times."""
    return waveforms["z_part"][1 : 1 + len(times())]


def error(path: npt.NDArray[np.float64], circuit: str = "amplifier") -> float:
    """Largest error of heights (m) at the reference's times, over the path's own range."""
    true = np.array(_reference()[circuit]["z_part"])
    return float(np.abs(path - true).max() / np.ptp(true))
