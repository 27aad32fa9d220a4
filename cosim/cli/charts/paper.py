"""``cosim chart paper``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, progress_bar, writable


def _options(parser: ArgumentParser) -> None:
    parser.add_argument(
        "trials", type=Path, metavar="TRIALS_DIR", help="folder of the published trials' CSVs"
    )
    add_out(parser, "results")


def _run(arguments: Namespace) -> None:
    from cosim.studies.paper import figure7
    from cosim.trials.published import TRIALS

    with writable(arguments.out, shared=True):
        with progress_bar("trials", len(TRIALS), "trial") as bar:
            found = figure7.trials(arguments.trials, bar.update)
        figure7.write(arguments.out, found)
    print(f"Written to {arguments.out}: figure7.csv")
    print(f"Figure: {arguments.out / 'figure7.png'}")


COMMAND = Command(
    "paper", "the paper's figure 7: its trials, measured and simulated", _run, _options
)
