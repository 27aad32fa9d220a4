"""``cosim chart accuracy``."""

from argparse import ArgumentParser, Namespace

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_quick, writable


def _options(parser: ArgumentParser) -> None:
    add_quick(parser, "a part of it, in a fraction of the time")
    add_out(parser, "results")


def _run(arguments: Namespace) -> None:
    from cosim.studies.accuracy import accuracy

    with writable(arguments.out):
        accuracy.run(arguments.out, arguments.quick)


COMMAND = Command("accuracy", "error of every coupling method over its run time", _run, _options)
