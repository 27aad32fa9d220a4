"""ngspice's raw file, binary: a header of lines, then the numbers row by row, eight bytes each.

Voltages are named ``v(column)`` and currents ``i(column)``, as the viewers of ngspice's files
expect them; motion keeps its column's name and has no type, since the format knows none for it.
"""

from io import BytesIO

import numpy as np

from cosim.waveforms.formats.source import Format, Run

TYPES = {"s": ("time", "{}"), "V": ("voltage", "v({})"), "A": ("current", "i({})")}
"""By a column's unit: ngspice's type, and the form of the name."""

TITLE_BYTES = 400
"""Most bytes of the title. ngspice reads a line's bytes beyond 511 as a new line, or a command."""


def write(run: Run, file: BytesIO) -> str:
    """One plot, a transient analysis with the run's rows; its date is the run's."""
    names = list(run.waveforms)
    lines = [
        f"Title: {_line(run.attributes['title'])}",
        f"Date: {run.written:%a %b %d %H:%M:%S %Y}",
        "Plotname: Transient Analysis",
        "Flags: real",
        f"No. Variables: {len(names)}",
        f"No. Points: {len(run.waveforms['time'])}",
        "Variables:",
    ]
    for number, name in enumerate(names):
        kind, form = TYPES.get(run.units[name], ("notype", "{}"))
        named = name if name.startswith(("v(", "i(")) else form.format(name)
        lines.append(f"\t{number}\t{''.join(named.split())}\t{kind}")
    header = "\n".join([*lines, "Binary:\n"]).encode()
    rows = np.column_stack(list(run.waveforms.values())).astype("<f8")
    file.write(header + rows.tobytes())
    return "ngspice's binary raw file: v(…), i(…), motion"


def _line(text: str) -> str:
    """The text as one line of at most TITLE_BYTES, not empty."""
    return " ".join(text.split()).encode()[:TITLE_BYTES].decode(errors="ignore") or "cosim"


FORMAT = Format("raw", "waveforms.raw", "ngspice's binary", write)
