"""The error of the coupling methods over their run time."""

from cosim.studies.study import chart, quick

STUDIES = (
    chart(
        "accuracy.accuracy.accuracy",
        "error of every coupling method over its run time",
        quick("a part of it, in a fraction of the time"),
    ),
)
