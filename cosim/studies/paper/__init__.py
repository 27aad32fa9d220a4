"""The paper's closed forms as numbers and figures.

The formulas themselves, with source and symbols, are in :mod:`cosim.drive.surface.formulas`.
"""

from cosim.studies.study import Option, Study, chart, folder_of_trials

_GIVEN = (
    ("--mu-s", "static coefficient of friction", "MU", 0.7),
    ("--mu-k", "kinetic coefficient of friction", "MU", 0.6),
    ("--a-max", "greatest acceleration of the surface, m/s²", "M/S2", 98.1),
    ("--f-n", "normal force over the part's weight", "RATIO", 5.0),
    ("--period", "period, s", "S", 0.05),
)

STUDIES = (
    Study(
        "paper.theory.theory",
        "the paper's closed forms: theory.json, the figures 3 and 4",
        tuple(Option(name, help, unit, float, default) for name, help, unit, default in _GIVEN),
        command="theory",
        out="results/theory",
        saves=False,
        writes="theory.json",
        figures=("figure3.png", "figure4.png"),
    ),
    chart(
        "paper.figure7.paper",
        "the paper's figure 7: its trials, measured and simulated",
        folder_of_trials("folder of the published trials' CSVs"),
        library=False,
        saves=False,
    ),
)
