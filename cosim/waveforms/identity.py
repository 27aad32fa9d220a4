"""Which run a file of a run's folder is of.

A run that is killed while its files take the places of older ones leaves files of both. The run is
named by a hash of its table, ``waveforms.csv``; equal runs have equal names.
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

_MOST = 1 << 28  # bytes of a table that is looked at
_SMALL = 1 << 24
_DIGITS = 16
_IN_FIGURE = re.compile(rb"cosim run ([0-9a-f]{%d})" % _DIGITS)


def of_table(path: Path) -> str:
    """The name of the run whose table this is."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:_DIGITS]


def in_figure(run: str) -> dict[str, str]:
    """The text that a PNG of this run has."""
    return {"Source": f"cosim run {run}"}


def tell_strangers(folder: Path, attributes: Mapping[str, str]) -> None:
    """Note which files of a folder are of another run than its ``waveforms.nc``, by the attributes
    of that. A file that is not there, or says nothing, is none of them."""
    run = attributes.get("run")
    if not run:
        return
    other = []
    for name in FILES:
        try:
            found = _named(folder / name, attributes.get("scene", ""), run)
        except (reader.Refused, ValueError, AttributeError, RecursionError):
            continue
        if found not in (None, run):
            other.append(name)
    if other:
        verb = "is" if len(other) == 1 else "are"
        warnings.warn(
            f"{plain(folder)}: {', '.join(other)} {verb} not of the run in waveforms.nc, as "
            "after a kill; run it again to have them all of one.",
            Note,
            stacklevel=2,
        )


def _named(path: Path, scene: str, run: str) -> str | None:
    """The run that a file is of; None where it does not say."""
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
