"""The closed forms of vertical vibratory transport, corrected where the paper is misprinted.

The paper is Yako, Nowak, Yuan, Salisbury, *Vertical Vibratory Transport of Grasped Parts Using
Impacts* (ICRA 2024, arXiv 2502.05693). A surface moves periodically along the vertical; a part of
mass m_P is pressed against it by the normal force F_n; static friction µ_s, kinetic µ_k. Up is
positive. ``f_n`` stands for F_n/(m_P g), a ratio without unit; ``a_max`` is the largest
acceleration of the surface in m/s², A = a_max/g; ``period`` is T in s. All other numbers are SI.
"""

from cosim.drive.surface.formulas import (
    GRAVITY,
    average_velocity,
    conditions,
    cubic_force_ratio,
    horizontal_equivalent,
    horizontal_velocity,
    largest_force_ratio_sliding,
    largest_force_ratio_sticking,
    least_force_ratio,
    least_peak_acceleration,
    least_peak_acceleration_at_any_force,
    optimal_force_ratio,
    optimal_times,
    slipping_acceleration,
    sticking_range,
)
from cosim.drive.surface.waveforms import (
    Cycle,
    optimal_cycle,
    optimal_waveform,
    quaid_cycle,
    quaid_velocity,
    quaid_waveform,
)
from cosim.studies.paper.errata import Erratum, errata, errata_text
from cosim.studies.paper.files import DEFAULTS, collect, table, write

__all__ = [
    "DEFAULTS",
    "GRAVITY",
    "Cycle",
    "Erratum",
    "average_velocity",
    "collect",
    "conditions",
    "cubic_force_ratio",
    "errata",
    "errata_text",
    "horizontal_equivalent",
    "horizontal_velocity",
    "largest_force_ratio_sliding",
    "largest_force_ratio_sticking",
    "least_force_ratio",
    "least_peak_acceleration",
    "least_peak_acceleration_at_any_force",
    "optimal_cycle",
    "optimal_force_ratio",
    "optimal_times",
    "optimal_waveform",
    "quaid_cycle",
    "quaid_velocity",
    "quaid_waveform",
    "slipping_acceleration",
    "sticking_range",
    "table",
    "write",
]
