"""What each rung of a circuit costs, and how far it is from the top."""

from cosim.studies.study import OVERRIDES, Option, chart

STUDIES = (
    chart(
        "circuit.ladder_report.ladder",
        "what each rung of a circuit costs, and how far it is from the top",
        Option("scenes", "built-in scenes or TOML files", "SCENE", default="paper", many="any"),
        OVERRIDES,
    ),
)
