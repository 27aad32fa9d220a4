"""The cost of each circuit model: with its error on scenes, and as speed ratios on this machine."""

from cosim.studies.study import OVERRIDES, Option, Study, chart, quick

STUDIES = (
    chart(
        "speed.ladder.ladder",
        "what each rung of a circuit costs, and how far it is from the top",
        Option("scenes", "built-in scenes or TOML files", "SCENE", default="paper", many="any"),
        OVERRIDES,
    ),
    Study(
        "speed.bench.bench",
        "speed ratios, taken side by side in one run",
        (quick("fewer rounds: under a minute"),),
        command="bench",
        out="results/bench",
        saves=False,
        writes="bench.json",
    ),
)
