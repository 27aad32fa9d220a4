"""``cosim chart stability``."""

from argparse import ArgumentParser, Namespace

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_quick, writable


def _options(parser: ArgumentParser) -> None:
    add_quick(parser, "a part of it, in a fraction of the time")
    add_out(parser, "results")


def _run(arguments: Namespace) -> None:
    from cosim.studies.stability import report

    with writable(arguments.out):
        report.run(arguments.out, arguments.quick)


COMMAND = Command("stability", "largest stable macro step of every coupling method", _run, _options)
