"""Unit, start value, range and meaning of the FMU's parameters and inputs, from ``variables.def``.

The FMU's ``modelDescription.xml`` is made of it too.
"""

import re
from dataclasses import dataclass
from functools import cache

from cosim.files.resources import fmu_sources

_ROW = re.compile(
    r'^(INT_)?(?:PARAMETER|TUNABLE|INPUT)\((\w+), (?:"(.*?)", )?(.*?), (.*?), (.*?), "(.*)"\)$',
    re.MULTILINE,
)


@dataclass(frozen=True)
class Variable:
    """A parameter or input of the FMU; ``start`` is an int where the FMU's variable is one."""

    name: str
    unit: str
    start: float | int
    low: float
    high: float
    text: str


@cache
def variables() -> dict[str, Variable]:
    """The FMU's parameters and inputs by name. Raises BadInput where its sources are missing."""
    source = next((fmu_sources() / "src").rglob("variables.def")).read_text(encoding="utf-8")
    return {
        name: Variable(
            name, unit or "1", int(start) if whole else float(start), float(low), float(high), text
        )
        for whole, name, unit, start, low, high, text in _ROW.findall(source)
    }
