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
    "what is known of normal forces: a CSV with the columns trial, force, lower, upper, mass; or "
    "“published”"
)
MU_K = (
    "kinetic friction, by which normal forces follow from µ_k F_n, or “free” to find it from the "
    "bounds of the forces (default: 0.59, as measured)"
)
NO_PLATE = "leave out the friction of the spring-loaded plate, which by default moves as tracked"
EVALUATE = "evaluate the paper's parameters by its procedure instead of a fit"
SOLVER = "of the paper's parameters: exact, or the authors' fixed-step scheme"

STUDIES = (
    Study(
        "fit.fit.fit",
        "fit friction and normal forces to tracked trials; write table and figures",
        (
            folder_of_trials("folder of the trials' CSVs"),
            Option("--forces", FORCES, "FILE"),
            Option("--mu-k", MU_K, "MU_K", _number_or_free),
            Option("--no-plate", NO_PLATE, kind=bool, parameter="plate"),
            Option("--evaluate", EVALUATE, choices=("published",)),
            Option("--solver", SOLVER, choices=("exact", "published"), default="exact"),
        ),
        command="fit",
        out="results/fit",
        saves=False,
        writes="fit.json, fit.csv and figures",
    ),
)
