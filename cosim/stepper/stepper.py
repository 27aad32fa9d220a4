"""The names of the compiled stepper's numbers, from its one table."""

import re
from collections.abc import Mapping
from pathlib import Path

LANES = 8
"""Machines that are stepped side by side; ``stepper.h`` has the same."""

_ROWS = re.findall(
    r"^(RIG|OWN)\((\w+), (\w*)\)",
    Path(__file__).with_name("parameters.def").read_text(encoding="utf-8"),
    re.MULTILINE,
)

RIG = tuple(name.lower() for kind, name, _ in _ROWS if kind == "RIG")
"""Numbers that all trials of a rig share, SI, in the stepper's order."""

OWN = tuple(name.lower() for kind, name, _ in _ROWS if kind == "OWN")
"""Numbers of one trial, which follow them; ``parameters.def`` has what they are."""

VARIABLES = {name.lower(): variable for _, name, variable in _ROWS if variable}
"""The FMU's variable that a number is, where it is one."""


def numbers(known: Mapping[str, float]) -> dict[str, float]:
    """The stepper's numbers of known variables of the FMU."""
    return {name: known[variable] for name, variable in VARIABLES.items() if variable in known}
