"""How rugged a run's answer is: what a small turn of each knob makes of it."""

from cosim.studies.spread.run import spread

__all__ = ["spread"]
