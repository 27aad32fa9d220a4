"""The identity of a run, by which files of different runs in one folder are found.

A run that is killed while its files replace older ones leaves files of both. A run's name is a hash
of its table, ``waveforms.csv``; equal runs have equal names.
"""

import hashlib
import json
import re
import warnings
from collections.abc import Mapping
from pathlib import Path

from cosim.errors import Note, plain
from cosim.files import reader

FILES = ("waveforms.csv", "waveforms.nc", "scene.toml", "summary.json", "figure.png")

_MOST = 1 << 28  # bytes of the largest table that is hashed
_SMALL = 1 << 24  # bytes of the largest other file that is read
_DIGITS = 16  # hexadecimal, of the hash
_IN_FIGURE = re.compile(rb"cosim run ([0-9a-f]{%d})" % _DIGITS)


def of_table(path: Path) -> str:
    """The name of the run with this table."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:_DIGITS]


def in_figure(run: str) -> dict[str, str]:
    """The text chunk of the PNG of this run."""
    return {"Source": f"cosim run {run}"}


def tell_strangers(folder: Path, attributes: Mapping[str, str]) -> None:
    """Warn by a Note of files in a folder that belong to another run than its ``waveforms.nc`` with
    these ``attributes``. Missing files, and files that do not name their run, are passed over."""
    run = attributes.get("run")
    if not run:
        return
    strangers = []
    for name in FILES:
        try:
            found = _named(folder / name, attributes.get("scene", ""), run)
        except (reader.Refused, ValueError, AttributeError, RecursionError):
            continue
        if found not in (None, run):
            strangers.append(name)
    if strangers:
        verb = "is" if len(strangers) == 1 else "are"
        warnings.warn(
            f"{plain(folder)}: {', '.join(strangers)} {verb} not of the run in waveforms.nc, as "
            "after a kill; run it again to have them all of one.",
            Note,
            stacklevel=2,
        )


def _named(path: Path, scene: str, run: str) -> str | None:
    """The name of the run that a file belongs to; None where the file does not name it."""
    if path.name == "waveforms.csv":
        return hashlib.sha256(reader.read(path, _MOST)).hexdigest()[:_DIGITS]
    if path.name == "summary.json":
        return json.loads(reader.read(path, _SMALL)).get("run")
    if path.name == "scene.toml":
        return run if reader.read(path, _SMALL).decode() == scene else "another"
    if path.name == "figure.png":
        found = _IN_FIGURE.search(reader.read(path, _SMALL)[:4096])
        return found[1].decode() if found else None
    return None
