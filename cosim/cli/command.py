"""What a command is, and how its options become those of a parser."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from cosim.errors import BadInput, plain
from cosim.studies.study import Option


@dataclass(frozen=True)
class Command:
    """A command, or a group of further ``commands``."""

    name: str
    help: str
    run: Callable[..., int | None] | None = None
    """Does it, with what was given for its options; returns the exit code, None for 0. Raises
    CosimError."""
    options: Sequence[Option] | Callable[[], Sequence[Option]] = ()
    out: str = ""
    """Where it writes unless ``out`` is given; empty for a command that writes nothing."""
    commands: Sequence["Command"] = ()

    def call(self, arguments: Namespace) -> int | None:
        """Do what was parsed; what was not given is left to ``run``."""
        given = {name: value for name, value in vars(arguments).items() if name != "call"}
        assert self.run is not None
        return self.run(**{name: x for name, x in given.items() if x is not None and x != []})


def add_commands(
    parser: ArgumentParser, commands: Iterable[Command], asked: Collection[str] | None, metavar: str
) -> None:
    """Let ``parser`` take one of the commands; what was parsed then has its ``call``.

    Only those among ``asked`` get their options, as to find them takes time; None: all.
    """
    own = parser.add_subparsers(required=True, metavar=metavar)
    for command in commands:
        one = own.add_parser(command.name, help=command.help, allow_abbrev=False)
        one.description = command.help
        one.set_defaults(call=command.call)
        if asked is None or command.name in asked:
            add_options(one, command)
            if command.commands:
                names = "|".join(each.name for each in command.commands)
                add_commands(one, command.commands, asked, names)


def _written(suffix: str, text: str) -> Path:
    """The path of a folder to write, or of a file, whose name tells what it is."""
    if not text and not suffix:
        raise BadInput('--out "": must name a folder (. is the one you are in).')
    if suffix and Path(text).suffix.lower() != suffix:
        raise BadInput(f'--out "{plain(text)}": must end in {suffix}.')
    return Path(text)


def add_options(parser: ArgumentParser, command: Command) -> None:
    """Let ``parser`` take the options of a command."""
    options = [*(command.options() if callable(command.options) else command.options)]
    if command.out:
        options.append(Option("--out", "where to write", "DIR", Path, command.out))
    groups: dict[str, Any] = {}
    for option in options:
        place: Any = parser
        if option.one_of:
            if option.one_of not in groups:
                groups[option.one_of] = parser.add_mutually_exclusive_group(required=True)
            place = groups[option.one_of]
        default = "" if option.default is None else f" (default: {option.default})"
        how: dict[str, Any] = {"help": (option.help + default).replace("%", "%%")}
        if option.name.startswith("-"):
            how |= {"dest": option.argument, "required": option.needed}
        if option.kind is bool:
            how["const"] = not option.name.startswith("--no-")
            place.add_argument(option.name, action="store_const", **how)
            continue
        kind = option.kind
        if option.name == "--out":
            kind = partial(_written, Path(option.metavar or "").suffix)
        how |= {"type": kind, "metavar": option.metavar, "choices": option.choices or None}
        if option.many == "repeat":
            how["action"] = "append"
        elif option.many:
            how["nargs"] = {"optional": "?", "any": "*", "some": "+"}[option.many]
        place.add_argument(option.name, **how)
