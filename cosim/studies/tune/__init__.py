"""Finds the settings that transport best, as the operator does by ear."""

from cosim.studies.tune.found import Tuning
from cosim.studies.tune.run import tune

__all__ = ["Tuning", "tune"]
