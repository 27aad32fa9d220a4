"""Declaration of commands, their parsers, and what commands share: the folder to write into, and
the progress bar."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from cosim.errors import BadInput, plain
from cosim.files.atomic import alone, tidy
from cosim.studies.study import Option

if TYPE_CHECKING:
    from tqdm import tqdm


@dataclass(frozen=True)
class Command:
    """A command, or a group of further ``commands``."""

    name: str
    help: str
    run: Callable[..., int | None] | None = None
    """Runs the command with the values of the options that were given; returns the exit code, None
    for 0. Raises CosimError."""
    options: Sequence[Option] | Callable[[], Sequence[Option]] = ()
    out: str = ""
    """Default of --out; empty for a command without this option."""
    commands: Sequence["Command"] = ()

    def call(self, arguments: Namespace) -> int | None:
        """Run the command; options that were not given take the defaults of ``run``."""
        given = {name: value for name, value in vars(arguments).items() if name != "call"}
        assert self.run is not None
        return self.run(**{name: v for name, v in given.items() if v is not None and v != []})


def add_commands(
    parser: ArgumentParser, commands: Iterable[Command], asked: Collection[str] | None, metavar: str
) -> None:
    """Add the commands to ``parser``; the parsed namespace has the chosen one's ``call``.

    Options are added only to commands among ``asked`` (None: all), since finding them takes time.
    """
    own = parser.add_subparsers(required=True, metavar=metavar)
    for command in commands:
        subparser = own.add_parser(command.name, help=command.help, allow_abbrev=False)
        subparser.description = command.help
        subparser.set_defaults(call=command.call)
        if asked is None or command.name in asked:
            add_options(subparser, command)
            if command.commands:
                names = "|".join(each.name for each in command.commands)
                add_commands(subparser, command.commands, asked, names)


def _written(suffix: str, text: str) -> Path:
    """The argument of --out as a path: of a folder, or of a file with the ``suffix``."""
    if not text and not suffix:
        raise BadInput('--out "": must name a folder (. is the one you are in).')
    if suffix and Path(text).suffix.lower() != suffix:
        raise BadInput(f'--out "{plain(text)}": must end in {suffix}.')
    return Path(text)


def add_options(parser: ArgumentParser, command: Command) -> None:
    """Add the options of a command to ``parser``."""
    options = [*(command.options() if callable(command.options) else command.options)]
    if command.out:
        options.append(Option("--out", "where to write", "DIR", Path, command.out))
    for option in options:
        default = "" if option.default is None else f" (default: {option.default})"
        how: dict[str, Any] = {"help": (option.help + default).replace("%", "%%")}
        if option.name.startswith("-"):
            how |= {"dest": option.argument, "required": option.needed}
        if option.kind is bool:
            how["const"] = not option.name.startswith("--no-")
            parser.add_argument(option.name, action="store_const", **how)
            continue
        kind = option.kind
        if option.name == "--out":
            kind = partial(_written, Path(option.metavar or "").suffix)
        how |= {"type": kind, "metavar": option.metavar, "choices": option.choices or None}
        if option.many == "repeat":
            how["action"] = "append"
        elif option.many:
            how["nargs"] = {"optional": "?", "any": "*"}[option.many]
        parser.add_argument(option.name, **how)


@contextmanager
def writable(folder: Path, shared: bool = False) -> Iterator[None]:
    """Refuse, before a long run, a folder that cannot be written to, or into which another command
    is writing; the latter is allowed if ``shared``, where each command writes other files.

    Folders that were made for a run that then fails are removed if they are empty.
    """
    made: list[Path] = []
    try:
        try:
            made = [path for path in (folder, *folder.parents) if not path.exists()]
            folder.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=folder):
                pass
        except FileExistsError as error:
            raise BadInput(f"{plain(folder)}: this is a file, not a directory.") from error
        except OSError as error:
            reason = error.strerror
            raise BadInput(f"{plain(folder)}: cannot be written to ({reason}).") from error
        if shared:
            tidy(folder)
        with nullcontext() if shared else alone(folder):
            yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


def print_page(results: Path, out: Path | None = None) -> None:
    """Write the page of ``cosim show``."""
    from cosim.live.show import show

    print(f"Page: {show(results, out)}")


def progress_bar(name: str, total: float | None, unit: str, **more: Any) -> "tqdm[Any]":
    """A progress bar on stderr, where that is a terminal; gone at its end."""
    from tqdm import tqdm

    return tqdm(
        total=total, desc=name, unit=unit, leave=False, file=sys.stderr, disable=None, **more
    )
