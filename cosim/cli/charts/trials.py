"""``cosim chart trials``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_overrides, progress_bar, writable


def _options(parser: ArgumentParser) -> None:
    parser.add_argument(
        "trials", type=Path, metavar="TRIALS_DIR", help="folder of the published trials' CSVs"
    )
    add_overrides(parser)
    add_out(parser, "results")


def _run(arguments: Namespace) -> None:
    from cosim.studies.compare import each

    trials = each.pairs(arguments.trials, arguments.overrides)
    with writable(arguments.out, shared=True):
        with progress_bar("trials", len(trials), "run") as bar:
            found = each.each(trials, bar.update)
        print(each.write(arguments.out, found))


COMMAND = Command("trials", "the whole chain against every published trial", _run, _options)
