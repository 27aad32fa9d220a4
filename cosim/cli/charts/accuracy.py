"""``cosim chart accuracy``."""

from argparse import Namespace

from cosim.cli.command import Command
from cosim.cli.options import add_study, writable


def _run(arguments: Namespace) -> None:
    from cosim.studies.accuracy import accuracy

    with writable(arguments.out, shared=True):
        accuracy.run(arguments.out, arguments.quick)


COMMAND = Command("accuracy", "error of every coupling method over its run time", _run, add_study)
