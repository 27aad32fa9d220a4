"""How rugged a run's answer is: what a small turn of each knob makes of it.

``cosim run --spread`` tells it with the run.
"""

from cosim.studies.study import Study

STUDIES = (Study("spread.run.spread"),)
