"""An .fmu of a library that writes its own model description (``fmu/thin``)."""

import ctypes
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from fmpy import platform, platform_tuple

from cosim.errors import BadInput, plain
from cosim.files.atomic import whole
from cosim.mechanics.package import zipped


def pack(
    library: Path, target: Path, version: int, resources: dict[str, str] | None = None
) -> None:
    """Write the .fmu of a library, with these files as its resources. Raises BadInput."""
    with tempfile.TemporaryDirectory(prefix="fmu-") as name:
        folder, why = Path(name), ctypes.create_string_buffer(512)
        for file, text in (resources or {}).items():
            path = folder / "resources" / file
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, encoding="utf-8")
        about = folder / "modelDescription.xml"
        try:
            describe: Any = ctypes.CDLL(str(library.absolute())).model_describe
        except (OSError, AttributeError) as error:
            cure = "compile the model together with fmu/thin/*.c"
            raise BadInput(
                f"{plain(library)}: this is no model's library; {cure} ({error})."
            ) from None
        paths = (str(folder / "resources").encode(), str(about).encode())
        if not describe(version, *paths, why):
            raise BadInput(f"{plain(library)}: {plain(why.value.decode())}.")
        root = ElementTree.parse(about).getroot()
        place = folder / "binaries" / (platform if version == 2 else platform_tuple)
        place.mkdir(parents=True)
        (place / f"{root.attrib['modelName']}{library.suffix}").write_bytes(library.read_bytes())
        with whole(target) as file:
            zipped(folder, file)
