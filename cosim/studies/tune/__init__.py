"""Finds the settings that transport best, as the operator does by ear.

>>> from cosim.scene import load
>>> from cosim.studies.tune import tune
>>> found = tune(load("ideal-current"), "v_average", budget=200)  # doctest: +SKIP
"""

from cosim.studies.tune.run import KNOBS, Tuning, tune

__all__ = ["KNOBS", "Tuning", "tune"]
