"""Finds the settings that transport best, as the operator does by ear."""

from cosim.studies.tune.run import Tuning, tune

__all__ = ["Tuning", "tune"]
