"""A finished run in the formats of other programs, one form a module.

Every form is made from ``waveforms.nc``, which holds the run's numbers in full; ``waveforms.csv``
has ten digits of them. All forms are made before the first file is written, so that a form that
cannot be made leaves no others behind.
"""

from collections import Counter
from importlib import import_module
from pathlib import Path

from cosim.errors import BadInput
from cosim.files.atomic import whole
from cosim.scene.messages import plain
from cosim.waveforms.formats.source import Exported, Run, read

__all__ = ["FORMS", "export", "parse", "read"]

FORMS = {
    "csv": ("table", "waveforms.csv"),
    "nc": ("netcdf", "waveforms.nc"),
    "mat": ("matlab", "waveforms.mat"),
    "hdf5": ("hdf5", "waveforms.h5"),
    "raw": ("rawfile", "waveforms.raw"),
    "wav": ("sound", "surface.wav"),
    "tracker": ("tracker", "tracker.csv"),
}
"""The forms: the module of this package that makes each, and the file it becomes."""


def parse(lists: list[str]) -> list[str]:
    """The forms of comma-separated lists of them; raises BadInput for an unknown one."""
    forms = [form.strip() for text in lists for form in text.split(",")]
    for form, count in Counter(forms).items():
        if form not in FORMS:
            known = ", ".join(FORMS)
            raise BadInput(f'--as: there is no form "{plain(form)}" (forms: {known}).')
        if count > 1:
            raise BadInput(f"--as: the form {form} stands there {count} times.")
    return forms


def export(run: Run, forms: list[str], out: Path) -> dict[str, str]:
    """Write the run in each of the ``forms`` into the folder ``out``.

    Returns the name of each file with a line on what it holds. Raises BadInput for a run that does
    not have what a form needs; then nothing is written.
    """
    made: dict[str, Exported] = {}
    for form in forms:
        module, name = FORMS[form]
        made[name] = import_module(f"{__name__}.{module}").content(run)
    for name, file in made.items():
        with whole(out / name) as temporary:
            temporary.write_bytes(file.content)
    return {name: file.note for name, file in made.items()}
