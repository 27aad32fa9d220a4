"""What a command is."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Command:
    """A command, or a group whose ``options`` are further commands."""

    name: str
    help: str
    run: Callable[[Namespace], int | None] | None = None
    """Does it; returns the exit code, None for 0. Raises CosimError. None for a group."""
    options: Callable[[ArgumentParser], None] | None = None


def add_commands(
    parser: ArgumentParser,
    metavar: str,
    commands: Iterable[Command],
    asked: Collection[str] | None = None,
) -> None:
    """Let ``parser`` take one of the commands; what was parsed then has its ``run`` as ``call``.

    Only those among ``asked`` get their options, where it is given: to find them takes time.
    """
    own = parser.add_subparsers(required=True, metavar=metavar)
    for command in commands:
        one = own.add_parser(command.name, help=command.help, allow_abbrev=False)
        one.set_defaults(call=command.run)
        if command.options and (asked is None or command.name in asked):
            command.options(one)
