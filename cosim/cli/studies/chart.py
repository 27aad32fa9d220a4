"""``cosim chart``: the charts are the files of ``cosim/cli/charts``."""

from argparse import ArgumentParser

from cosim.cli.command import Command, add_commands
from cosim.files.declared import declared


def _options(parser: ArgumentParser) -> None:
    charts = declared("cosim.cli.charts", "COMMAND")
    add_commands(parser, "|".join(charts), charts.values())


COMMAND = Command("chart", "the studies, as tables and a figure", options=_options)
