"""The paper's closed forms as numbers and figures, its misprints, and its optimum's knife edge.

The formulas themselves, with source and symbols, are in :mod:`cosim.drive.surface.formulas`.
"""

from cosim.studies.paper.closed_forms import FIGURE_3, collect, table, write
from cosim.studies.paper.errata import errata_text

__all__ = ["FIGURE_3", "collect", "errata_text", "table", "write"]
