"""The paper's closed forms as numbers and figures, its misprints, and its optimum's knife edge.

The formulas themselves, with source and symbols, are in :mod:`cosim.drive.surface.formulas`.
"""

from cosim.studies.paper.errata import errata_text
from cosim.studies.paper.theory import theory

__all__ = ["errata_text", "theory"]
