"""``cosim fmu build`` and ``cosim fmu check``."""

from argparse import ArgumentParser, Namespace

from cosim.cli.command import Command, add_commands
from cosim.cli.options import add_out, writable


def _build_options(parser: ArgumentParser) -> None:
    add_out(parser, "results/fmu")


def _build(arguments: Namespace) -> None:
    from cosim.mechanics import package

    with writable(arguments.out):
        paths = package.pack(arguments.out)
    for path in paths.values():
        print(path)


def _check(arguments: Namespace) -> int:
    from cosim.mechanics import package

    return 1 if package.check() else 0


_ACTIONS = (
    Command("build", "write stickslip-fmi2.fmu and stickslip-fmi3.fmu", _build, _build_options),
    Command("check", "validate the FMU files and run them", _check),
)


def _options(parser: ArgumentParser) -> None:
    add_commands(parser, "build|check", _ACTIONS)


COMMAND = Command("fmu", "write or check the FMU files of the mechanics", options=_options)
