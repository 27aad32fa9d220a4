"""MATLAB's MAT-file of version 5, which Octave, Scilab and SciPy read too."""

import re
from collections.abc import Iterable
from io import BytesIO

from cosim.waveforms.formats.source import Format, Run

LONGEST = 63
"""Most letters of a name in MATLAB."""

ABOUT = 116  # bytes of free text at the file's beginning


def write(run: Run, file: BytesIO) -> str:
    """A column vector for each column, under its own name and in SI (_ replaces characters that
    MATLAB's names cannot have); a struct ``units`` with the unit of each; ``title``, ``scene`` (the
    text of scene.toml) and ``run``."""
    from scipy.io import savemat

    names = legal(run.waveforms, {"units", *run.attributes})
    variables: dict[str, object] = {names[name]: values for name, values in run.waveforms.items()}
    units = {names[name]: unit for name, unit in run.units.items()}
    found = variables | {"units": units} | run.attributes
    savemat(file, found, format="5", oned_as="column", long_field_names=True)
    about = b"MATLAB 5.0 MAT-file, written by cosim"  # SciPy's would name the moment of writing
    file.seek(0)
    file.write(about.ljust(ABOUT))
    return f"MATLAB 5, {len(run.waveforms)} column vectors and a struct units"


def legal(names: Iterable[str], taken: Iterable[str] = ()) -> dict[str, str]:
    """For each name a different one that MATLAB allows and that is not ``taken``."""
    found: dict[str, str] = {}
    for name in names:
        word = re.sub(r"\W", "_", name, flags=re.ASCII).lstrip("_")
        word = word if word[:1].isalpha() else f"x{word}"
        valid, used, k = word[:LONGEST], {*found.values(), *taken}, 2
        while valid in used:
            valid, k = f"{word[: LONGEST - 4]}_{k}", k + 1
        found[name] = valid
    return found


FORMAT = Format("mat", "waveforms.mat", "MATLAB 5", write)
