"""The command ``cosim``.

Exit codes: 0 done; 2 bad input, told in one sentence; 3 the simulation failed; 130 interrupted.
"""

import argparse
import errno
import gc
import os
import re
import sys
import warnings
from collections.abc import Iterator
from io import TextIOWrapper
from pathlib import Path
from typing import Any, NoReturn

from cosim.cli import simulation, studies
from cosim.cli.command import Command, add_commands
from cosim.errors import BadInput, CosimError, Note, SimulationFailed, printable
from cosim.studies.study import Option
from cosim.toolchain import memory
from cosim.toolchain.interrupts import ended_alike
from cosim.version import __version__

INTERRUPTED = 130

_NO_MEMORY = "The memory ran out: try fewer --workers, or a longer run.output_step"
_NO_THREADS = "The system allows no more threads: try --workers 1"
_NO_THREAD = "start new thread"  # in Python's message
_NO_ROOM = re.compile(
    "failed to map|cannot allocate|bad_alloc|without setting an exception", re.IGNORECASE
)


_NO_CHOICE = re.compile(r"invalid choice: '(.*)' \(choose from (.*)\)$")


class _Parser(argparse.ArgumentParser):
    """Tells a wrong command line in one sentence, like any other bad input."""

    def error(self, message: str) -> NoReturn:
        for kind, words in (("int", "a whole number"), ("float", "a number")):
            message = message.replace(f"invalid {kind} value:", f"must be {words}, not")
        if match := _NO_CHOICE.search(message):
            from cosim.scene.messages import suggestion

            message += suggestion(match[1], re.findall(r"[\w-]+", match[2]))
        raise BadInput(f"{message} (see {self.prog} --help).")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:  # pyright: ignore
        """As argparse does, but unknown options are refused by the subcommand's own parser."""
        found, others = super().parse_known_args(args, namespace)
        if others:
            # All options begin with "--", so they count as near only above 0.8, not 0.6.
            from difflib import get_close_matches

            near = get_close_matches(others[0], self._option_string_actions, 1, 0.8)
            hint = f"; did you mean {near[0]}?" if near else ""
            self.error(f"unrecognized arguments: {' '.join(others)}{hint}")
        return found, others


def _parser(arguments: list[str] | None) -> argparse.ArgumentParser:
    """The parser, with the options of the commands that ``arguments`` name; None: of all."""
    parser = _Parser(
        prog="cosim",
        description="Runs a vibrating gripper: its circuit in ngspice, its mechanics in an FMU.",
    )
    parser.add_argument("--version", action="version", version=f"cosim {__version__}")
    commands = [*simulation.COMMANDS, *studies.commands(), _COMPLETION]
    add_commands(parser, sorted(commands, key=lambda one: one.name), arguments, "COMMAND")
    return parser


def _completion(shell: str) -> None:
    """Print the shell's program, which also completes names of scenes and of files."""
    import shtab

    from cosim.scene import list_scenes

    parser = _parser(None)
    for action in _actions(parser):
        if action.metavar == "SCENE":
            shells = dict.fromkeys(("bash", "zsh"), "_cosim_scenes")
            action.complete = shells  # type: ignore[attr-defined]
        elif action.type is Path or action.dest == "out":
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    names = " ".join(name for name, *_ in list_scenes())
    functions: Any = {  # shtab's annotation has it as one text for all shells
        "bash": f'_cosim_scenes() {{ compgen -W "{names}" -- "$1"; compgen -f -- "$1"; }}',
        "zsh": f"_cosim_scenes() {{ compadd {names}; _files }}",
    }
    print(shtab.complete(parser, shell, preamble=functions))


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for subparser in action.choices.values():
                yield from _actions(subparser)


_COMPLETION = Command(
    "completion",
    "print the script by which a shell completes commands, options, scenes and files",
    _completion,
    [Option("shell", "the shell for which to print it", choices=("bash", "zsh"))],
)


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    _open_standard_streams()
    gc.set_threshold(50_000)  # with the default it takes a twentieth of a large sweep's time
    # Threads of BLAS bring nothing here, and where none can be started it raises SIGINT.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # prints ? for what the encoding lacks
    try:
        with ended_alike(), warnings.catch_warnings():
            warnings.simplefilter("always", Note)
            warnings.showwarning = _note
            argv = sys.argv[1:] if argv is None else argv
            if argv and not any(word.startswith(("-h", "--h", "--version")) for word in argv):
                memory.check(argv[0])
            arguments = _parser(argv).parse_args(argv)
            code = arguments.call(arguments) or 0
        sys.stdout.flush()
        return code
    except CosimError as error:
        return _told(str(error), error.exit_code)
    except (MemoryError, ImportError, SystemError) as error:
        # Without memory a library is not loaded, and Python's error may name another reason.
        if not isinstance(error, MemoryError) and not _NO_ROOM.search(str(error)):
            raise
        return _told(_NO_MEMORY, SimulationFailed.exit_code)
    except RuntimeError as error:
        if _NO_THREAD not in str(error):
            raise
        return _told(_NO_THREADS, SimulationFailed.exit_code)
    except BrokenPipeError:  # the reader closed the pipe
        _discard_output()
        return 0
    except OSError as error:
        if error.errno == errno.ENOMEM:
            return _told(_NO_MEMORY, SimulationFailed.exit_code)
        if error.filename is None:
            _discard_output()
        where = f"{error.filename}: " if error.filename else "The output cannot be written: "
        return _told(f"{where}{error.strerror or error}.", BadInput.exit_code)
    except KeyboardInterrupt:
        # After an interrupt within exec(), as dataclasses use it, Python ends the process by the
        # signal although it is handled here; another exec() clears that flag.
        exec("")
        return _told("interrupted.", INTERRUPTED)


def _open_standard_streams() -> None:
    """Open /dev/null for each standard stream that the caller has closed: else the next opened file
    would get its number, and printed text would be written into it."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r+"))  # noqa: SIM115


_LONGEST = 2000  # characters of a message


def _note(message: Warning | str, *_: object, **__: object) -> None:
    """Print a warning on one line, without its place in the program, above a progress bar."""
    from tqdm import tqdm

    tqdm.write(f"cosim: note: {printable(' '.join(str(message).split()))}", file=sys.stderr)


def _told(sentence: str, code: int) -> int:
    """Print the sentence on one line; returns the exit code."""
    words = printable(" ".join(sentence.split()))
    if len(words) > _LONGEST:  # cut the middle, which quotes the input
        words = f"{words[: _LONGEST // 2]} … {words[-_LONGEST // 2 :]}"
    print(f"cosim: {words}" + ("" if words.endswith((".", "?")) else "."), file=sys.stderr)
    return code


def _discard_output() -> None:
    """Keep Python from flushing stdout again, and failing again, at exit."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())
    os.close(null)


if __name__ == "__main__":
    sys.exit(main())
