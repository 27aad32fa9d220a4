"""A finished run in file formats of other programs, one module for each format.

A module declares its format as ``FORMAT`` and imports nothing heavy at its top. Every format is
made from ``waveforms.nc``, whose numbers have all their digits.
"""

from collections.abc import Collection
from functools import cache
from io import BytesIO
from pathlib import Path

from cosim.errors import BadInput, plain
from cosim.files.atomic import write_all
from cosim.files.declared import modules
from cosim.waveforms.formats.source import Format, Run, read

__all__ = ["export", "formats", "parse", "read"]


@cache
def formats() -> dict[str, Format]:
    """Every format by its name."""
    found = [module.FORMAT for module in modules(__name__) if hasattr(module, "FORMAT")]
    return {each.name: each for each in sorted(found, key=lambda each: each.name)}


def parse(lists: list[str], known: Collection[str], what: str) -> list[str]:
    """The names in comma-separated lists: of formats ``known`` for ``what`` is exported, each once.
    Raises BadInput."""
    names = [name.strip() for text in lists for name in text.split(",")]
    for name in names:
        if name not in known:
            words = f"must be one of {', '.join(known)}"
            raise BadInput(f'--as: of a {what} "{plain(name)}" {words}.')
        if names.count(name) > 1:
            raise BadInput(f"--as: {name} must be named once.")
    return names


def export(run: Run, names: list[str], out: Path) -> dict[str, str]:
    """Write the run in each of the formats into the folder ``out``.

    Returns the name of each file with a line on what it holds. Raises BadInput, and then writes
    nothing, for a run that lacks what a format needs.
    """
    made = {formats()[name].file: BytesIO() for name in names}
    notes = [formats()[name].write(run, made[formats()[name].file]) for name in names]
    write_all({out / name: file.getvalue() for name, file in made.items()})
    return dict(zip(made, notes, strict=True))
