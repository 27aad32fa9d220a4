"""The errors that a user can cause or meet; each is told in one sentence, never as a traceback."""

import json


class CosimError(Exception):
    """An error told to the user in one sentence; ``exit_code`` ends the command."""

    exit_code = 1


class BadInput(CosimError):
    """The scene, an option or a file cannot be used."""

    exit_code = 2


class NoEffect(UserWarning):
    """Something was asked for that does nothing here; the rest is done."""


class SimulationFailed(CosimError):
    """The simulation could not be finished."""

    exit_code = 3


def plain(text: str, limit: int = 200) -> str:
    """A name or path as a sentence holds it: on one line, printable, not too long."""
    text = json.dumps(text, ensure_ascii=False)[1:-1]
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
    return text if len(text) <= limit else text[:limit] + "…"
