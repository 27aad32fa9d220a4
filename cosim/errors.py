"""The errors that a user can cause or meet; each is told in one sentence, never as a traceback."""

import json


class CosimError(Exception):
    """An error told to the user in one sentence; ``exit_code`` ends the command."""

    exit_code = 1


class BadInput(CosimError):
    """The scene, an option or a file cannot be used."""

    exit_code = 2


class Note(UserWarning):
    """What the user should know of something that was done all the same."""


class NoEffect(Note):
    """Something was asked for that does nothing here; the rest is done."""


class BeyondModel(Note):
    """A run has left what the model or a part's data sheet holds for."""


class SimulationFailed(CosimError):
    """The simulation could not be finished."""

    exit_code = 3


class StepTooSmall(SimulationFailed):
    """ngspice found no step that was small enough for its tolerances."""


def printable(text: str) -> str:
    """A text, of any number of lines, without what a terminal would obey."""
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def plain(name: object, limit: int = 200) -> str:
    """A name or path as a sentence holds it: on one line, printable, not too long."""
    text = printable(json.dumps(str(name), ensure_ascii=False)[1:-1])
    return text if len(text) <= limit else text[:limit] + "…"
