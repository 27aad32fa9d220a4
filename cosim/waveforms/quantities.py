"""The numbers of a run: ``summary.csv`` names and describes each entry of ``summary.json``."""

import re
from collections.abc import Mapping
from csv import DictReader
from pathlib import Path
from typing import NamedTuple


class Quantity(NamedTuple):
    """A column of the waveforms or an entry of the summary: its SI unit (``""`` for words and
    lists) and its meaning."""

    unit: str
    text: str


_ROWS = Path(__file__).with_name("summary.csv").read_text(encoding="utf-8").splitlines()

SUMMARY = {row.pop("name"): Quantity(**row) for row in DictReader(_ROWS)}
"""Every entry by its name. A run lacks the entries of absent bodies and circuits."""


UNITLESS = ("", "1", "?")
"""Units of words and lists, of plain numbers, and of signals whose unit is not known."""

OF_SOURCES = {"power": "W", "energy": "J"}
"""Entries that a scene with ports has of each source, and their units."""


def percent(share: float) -> str:
    """A share in percent with two digits: 0.0006 is ``0.06 %``."""
    number = 100.0 * share
    return f"{number:.2g} %" if abs(number) < 99.5 else f"{number:.0f} %"


def meaning(name: str, units: Mapping[str, str] | None = None) -> dict[str, str]:
    """The attributes ``units`` and ``long_name`` of an entry in a dataset; ``units`` are those of
    the signals of a scene with ports."""
    if name not in SUMMARY:  # of a scene with ports
        signal, _, what = name.rpartition(".")
        known, array = units or {}, signal.rpartition("[")[0]
        unit = OF_SOURCES.get(what) or known.get(signal) or known.get(array, "?")
        return {"units": unit, "long_name": f"{what} of {signal}"}
    found = SUMMARY[name]
    return {"units": found.unit, "long_name": found.text}


_PRINTED = {"N/m1.5": "N/m^1.5", "N.s/m": "N·s/m", "Ohm": "Ω"}


def printed(unit: str) -> str:
    """A unit of a file in its usual spelling: ``m/s2`` as m/s²."""
    return _PRINTED.get(unit) or re.sub(r"(?<=[a-z])2\b", "²", re.sub(r"(?<=[a-z])3\b", "³", unit))


def with_unit(value: float, unit: str, digits: int = 6) -> str:
    """``number unit``; a plain number has no unit."""
    return f"{value:.{digits}g}" + ("" if unit in ("1", "?") else f" {printed(unit)}")


def signed(value: float, form: str) -> str:
    """A number in this format; without its sign where it is rounded to 0."""
    text = f"{value:{form}}"
    return text if float(text) else text.lstrip("+-")


def label(name: str, unit: str) -> str:
    """``name [unit]``, for an axis or a table."""
    return name if unit in UNITLESS else f"{name} [{printed(unit)}]"


def bench_unit(si: str) -> tuple[str, float]:
    """The unit in which numbers in this SI unit are shown, and the factor to it."""
    return ("mm/s", 1e3) if si == "m/s" else (si, 1.0)
