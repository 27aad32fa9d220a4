"""What a shell completes the command line by, made of the parser."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import shtab

from cosim.scene import list_scenes

_SCENES = dict.fromkeys(("bash", "zsh"), "_cosim_scenes")


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """The shell's program; a scene's name and the names of files are completed, too."""
    for action in _actions(parser):
        if action.metavar == "SCENE":
            action.complete = _SCENES  # type: ignore[attr-defined]
        elif action.type is Path or action.dest == "out":
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    names = " ".join(name for name, *_ in list_scenes())
    functions: Any = {  # shtab's annotation has it as one text for all shells
        "bash": f'_cosim_scenes() {{ compgen -W "{names}" -- "$1"; compgen -f -- "$1"; }}',
        "zsh": f"_cosim_scenes() {{ compadd {names}; _files }}",
    }
    return shtab.complete(parser, shell, preamble=functions)


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield from _actions(one)
