"""``cosim chart stability``."""

from argparse import Namespace

from cosim.cli.command import Command
from cosim.cli.options import add_study, writable


def _run(arguments: Namespace) -> None:
    from cosim.studies.stability import stability

    with writable(arguments.out, shared=True):
        stability.run(arguments.out, arguments.quick)


COMMAND = Command(
    "stability", "largest stable macro step of every coupling method", _run, add_study
)
