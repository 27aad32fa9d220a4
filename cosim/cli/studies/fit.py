"""``cosim fit``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, writable


def _options(parser: ArgumentParser) -> None:
    parser.add_argument(
        "trials", type=Path, metavar="TRIALS_DIR", help="folder of the trials' CSVs"
    )
    parser.add_argument(
        "--evaluate", choices=["published"], help="take the paper's parameters instead of a fit"
    )
    parser.add_argument(
        "--solver",
        choices=["exact", "published"],
        default="exact",
        help="exact events, or the authors' fixed-step scheme (default: exact)",
    )
    parser.add_argument(
        "--plate", action="store_true", help="fit the friction of the springed plate too"
    )
    add_out(parser, "results/fit")


def _run(arguments: Namespace) -> None:
    import cosim

    with writable(arguments.out):
        found = cosim.fit(
            arguments.trials,
            evaluate=arguments.evaluate,
            solver=arguments.solver,
            plate=arguments.plate,
        )
        found.save(arguments.out)
    print(found)
    print(f"Written to {arguments.out}: fit.json, fit.csv and figures")


COMMAND = Command(
    "fit",
    "fit friction and normal forces to tracked trials; write table and figures",
    _run,
    _options,
)
