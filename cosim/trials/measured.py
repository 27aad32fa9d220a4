"""Measured numbers beside those of a built-in scene: statistics of the ten published trials.

Source: the trials tracked by C. Yako, J. Nowak, S. Yuan and K. Salisbury, repository
clyako/vertical-vibratory-transport-of-grasped-parts-using-impacts. ``measured.csv`` holds, in SI,
the slope of the straight line through the part's heights (``v_average``), and the extremes of the
surface's columns; accelerations are Tracker's five-point ones at 960 frames/s.
"""

import csv
import re
from functools import cache
from importlib import resources

from cosim.scene import Scene, load

OF_PAPER = 9
"""The trial whose drive and normal force the scene ``paper`` has."""


def measured(scene: Scene) -> tuple[int, dict[str, float]] | None:
    """The trial's number and its statistics, by the names of a run's summary. None for a scene that
    repeats no trial, or whose drive, coil, mechanics or friction was changed."""
    found = re.fullmatch(r"trial-(\d\d)", scene.name)
    number = OF_PAPER if scene.name == "paper" else int(found[1]) if found else None
    if number not in _table() or _moved(scene) != _moved(load(scene.name)):
        return None
    numbers = dict(_table()[number])
    if scene.name == "paper":
        # The record shows the start from rest, in which the surface sinks: not comparable.
        del numbers["z_surface_pp"]
    return number, numbers


def _moved(scene: Scene) -> dict[str, object]:
    """The tables that determine the motion, but for circuit model, accuracy and coupling."""
    tables = scene.as_dict()
    return {name: tables[name] for name in ("drive", "coil", "mechanics", "friction")}


@cache
def _table() -> dict[int, dict[str, float]]:
    text = resources.files("cosim.trials").joinpath("measured.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(text.splitlines())
    return {int(row.pop("trial")): {k: float(v) for k, v in row.items()} for row in rows}
