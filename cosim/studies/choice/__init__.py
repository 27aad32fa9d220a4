"""Which circuit model and tolerance to take: error over cost, over many settings of the knobs."""

from cosim.studies.study import WORKERS, chart, quick

STUDIES = (
    chart(
        "choice.choice.choice",
        "which circuit model and tolerance hold 10, 1 and 0.1 %, and what they cost",
        quick("fewer settings, in a fraction of the time"),
        WORKERS,
    ),
)
