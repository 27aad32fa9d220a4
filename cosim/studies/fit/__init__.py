"""Friction and normal forces fitted to tracked trials."""

from argparse import ArgumentTypeError

from cosim.studies.study import Option, Study, folder_of_trials


def _number_or_free(text: str) -> float | str:
    if text == "free":
        return text
    try:
        return float(text)
    except ValueError:
        raise ArgumentTypeError(f"“{text}” is neither a number nor “free”") from None


FORCES = (
    "what is known of normal forces: a CSV with the columns trial, force, lower, upper, mass, or a "
    "TOML with a table for each trial; or “published”"
)
MU_S = (
    "static friction, or “free” to fit it within the bounds of the forces (default: 0.72, as "
    "published)"
)
PLATE = "fit the friction of the springed plate too, which moves as tracked"
RATIO = "mass of the part over that of the surface with what moves with it (default: fitted)"
EVALUATE = "take the paper's parameters, by its procedure, instead of a fit"
SOLVER = "of the paper's parameters: exact, or the authors' fixed-step scheme"

STUDIES = (
    Study(
        "fit.fit.fit",
        "fit friction and normal forces to tracked trials; write table and figures",
        (
            folder_of_trials("folder of the trials' CSVs"),
            Option("--forces", FORCES, "FILE"),
            Option("--mu-s", MU_S, "MU_S", _number_or_free),
            Option("--plate", PLATE, kind=bool),
            Option("--mass-ratio", RATIO, "R", float),
            Option("--evaluate", EVALUATE, choices=("published",)),
            Option("--solver", SOLVER, choices=("exact", "published"), default="exact"),
        ),
        command="fit",
        out="results/fit",
        saves=False,
        writes="fit.json, fit.csv and figures",
    ),
)
