"""Sweeps: one scene at many settings of its keys.

>>> from cosim.scene import load
>>> from cosim.studies.sweep import grid, sweep
>>> design = grid({"drive.frequency": [10.0, 20.0, 30.0], "drive.offset": [-1.2, 1.2]})
>>> data = sweep(load("ideal-current"), design, "results/my-sweep")  # doctest: +SKIP
>>> data.v_average.sel({"drive.offset": 1.2})  # doctest: +SKIP
"""

from cosim.studies.sweep.design import Axis, Design, grid, sample
from cosim.studies.sweep.run import sweep

__all__ = ["Axis", "Design", "grid", "sample", "sweep"]
