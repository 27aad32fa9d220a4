"""The largest macro step at which each coupling method is stable, predicted and observed."""

from cosim.studies.study import chart, quick

STUDIES = (
    chart(
        "stability.stability.stability",
        "largest stable macro step of every coupling method",
        quick("a part of it, in a fraction of the time"),
    ),
)
