"""A finished sweep in file formats of other programs: a row for each point, SI."""

from io import BytesIO
from pathlib import Path

from cosim.errors import BadInput
from cosim.files.atomic import write_all
from cosim.waveforms.formats import parse
from cosim.waveforms.formats.matlab import legal
from cosim.waveforms.quantities import UNITLESS
from cosim.waveforms.storage import read_sweep

FORMS = ("csv", "parquet", "mat")


def export(folder: Path, lists: list[str], out: Path) -> dict[str, str]:
    """Write the points of a sweep as ``sweep.csv``, ``.parquet`` or ``.mat``. Returns a line on the
    content of each file, by its name. Raises BadInput."""
    names = parse(lists, FORMS, "sweep")
    data = read_sweep(folder)
    units = {str(name): str(data[name].attrs.get("units", "")) for name in data.variables}
    frame = data.to_dataframe().reset_index()
    if data.failure.ndim == 0:  # a single point: its row number is no coordinate
        frame = frame.drop(columns="index")
    files, note = {name: BytesIO() for name in names}, f"{len(frame)} points, SI"
    for name, file in files.items():
        if name == "csv":
            heads = {
                each: f"{each} [{units[each]}]" if units.get(each, "") not in UNITLESS else each
                for each in frame
            }
            frame.rename(columns=heads).to_csv(file, index=False)
        elif name == "mat":
            from scipy.io import savemat

            words = legal(map(str, frame))
            content = {
                "sweep": {words[each]: frame[each].to_numpy() for each in frame},
                "units": {words[each]: units.get(each, "") for each in frame},
            }
            savemat(file, content, long_field_names=True, oned_as="column")
        else:
            try:
                frame.to_parquet(file, index=False)
            except ImportError:
                raise BadInput("--as parquet needs the package pyarrow: install it.") from None
    write_all({out / f"sweep.{name}": file.getvalue() for name, file in files.items()})
    return {f"sweep.{name}": note for name in names}
