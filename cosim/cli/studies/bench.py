"""``cosim bench``."""

from argparse import ArgumentParser, Namespace

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_quick, writable


def _options(parser: ArgumentParser) -> None:
    add_quick(parser, "fewer rounds: under a minute")
    add_out(parser, "results/bench")


def _run(arguments: Namespace) -> None:
    from cosim.studies.speed import bench

    with writable(arguments.out):
        bench.run(arguments.out, arguments.quick)


COMMAND = Command("bench", "speed ratios, taken side by side in one run", _run, _options)
