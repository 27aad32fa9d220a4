"""The paper's closed forms for one case, as a user asks for them."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cosim.drive.surface.formulas import Transport
from cosim.studies.paper.closed_forms import FIGURE_3, collect, table, write

if TYPE_CHECKING:
    from cosim.files.picture import Picture


@dataclass(frozen=True, repr=False)
class Theory:
    """What the closed forms say of a case: ``numbers``, SI, as ``theory.json`` holds them."""

    case: Transport
    numbers: dict[str, Any]

    def plot(self) -> "Picture":
        """The paper's figure 3: one period of the optimal waveform, surface and part."""
        from cosim.studies.paper import figures

        return figures.draw_cycle(self.case)

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``theory.json``, the paper's figures 3 and 4, and what the optimum costs when it is
        missed, ``knife_edge.csv`` and ``knife_edge.png``.
        """
        from cosim.studies.paper import knife_edge

        write(Path(folder), self.case)
        knife_edge.write(Path(folder), self.case)

    def __repr__(self) -> str:
        return table(self.numbers)


def theory(
    *,
    mu_s: float = FIGURE_3.mu_s,
    mu_k: float = FIGURE_3.mu_k,
    a_max: float = FIGURE_3.a_max,
    f_n: float = FIGURE_3.f_n,
    period: float = FIGURE_3.period,
) -> Theory:
    """The closed forms of vertical vibratory transport (Yako et al., ICRA 2024, corrected).

    Coefficients of friction, the surface's largest acceleration in m/s², the normal force over the
    part's weight, and the period in s; by default those of the paper's figure 3. Raises BadInput
    where there is no transport upwards.

    >>> round(theory(period=0.05).numbers["up"]["v_average"], 4)
    0.1524
    """
    case = Transport(mu_s, mu_k, a_max, f_n, period)
    return Theory(case, collect(case))
