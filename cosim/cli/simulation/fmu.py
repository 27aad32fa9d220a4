"""``cosim fmu build`` and ``cosim fmu check``."""

from argparse import ArgumentParser, Namespace

from cosim.cli.command import Command, add_commands


def _build_options(parser: ArgumentParser) -> None:
    parser.add_argument("--force", action="store_true", help="build even if they are up to date")


def _build(arguments: Namespace) -> None:
    from cosim.mechanics import package

    for path in package.build(force=arguments.force).values():
        print(path)


def _check(arguments: Namespace) -> int:
    from cosim.mechanics import package

    return 1 if package.check() else 0


_ACTIONS = (
    Command("build", "build stickslip-fmi2.fmu and stickslip-fmi3.fmu", _build, _build_options),
    Command("check", "validate the FMU files and run them", _check),
)


def _options(parser: ArgumentParser) -> None:
    add_commands(parser, "build|check", _ACTIONS)


COMMAND = Command("fmu", "build or check the FMU files of the mechanics", options=_options)
