"""MATLAB's MAT-file of version 5, which Octave, Scilab and SciPy read too."""

import re
from io import BytesIO

from cosim.waveforms.formats.source import Format, Run

ABOUT = 116  # bytes of free text at the file's beginning


def write(run: Run, file: BytesIO) -> str:
    """A column vector for each column, under its own name and in SI; a struct ``units`` with the
    unit of each (signs that MATLAB's names do not have are _); ``title``, ``scene`` (the text of
    scene.toml) and ``run``.
    """
    from scipy.io import savemat

    names = {name: re.sub(r"\W", "_", name, flags=re.ASCII).lstrip("_") for name in run.waveforms}
    variables: dict[str, object] = {names[name]: of for name, of in run.waveforms.items()}
    units = {names[name]: unit for name, unit in run.units.items()}
    savemat(file, variables | {"units": units} | run.attributes, format="5", oned_as="column")
    about = b"MATLAB 5.0 MAT-file, written by cosim"  # SciPy's would name the moment of writing
    file.seek(0)
    file.write(about.ljust(ABOUT))
    return f"MATLAB 5, {len(run.waveforms)} column vectors and a struct units"


FORMAT = Format("mat", "waveforms.mat", "MATLAB 5", write)
