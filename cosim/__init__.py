"""Co-simulation bench: SPICE circuits, voice-coil actuators and stick-slip mechanics.

>>> import cosim
>>> cosim.run("optimal", {"drive.frequency": 30}).summary["v_average"] > 0
True
"""

from importlib import import_module
from typing import Any

from cosim.errors import BadInput as BadInput
from cosim.errors import SimulationFailed as SimulationFailed
from cosim.toolchain.interrupts import deferred
from cosim.version import __version__ as __version__


def homes() -> dict[str, str]:
    """The module of each name that is loaded on first use, as `import cosim` and light commands
    need none of them: what stands here, and the studies by their declarations.

    ``__init__.pyi``, made by docs/programs/reference.py, says the same to type checkers.
    """
    from cosim.studies.study import studies

    return {
        "run": "cosim.simulation.simulate",
        "load": "cosim.scene",
        "Result": "cosim.waveforms.result",
        **{study.name: study.module for study in studies() if study.library},
    }


def __getattr__(name: str) -> Any:
    with deferred():
        if name == "__all__":
            return ["BadInput", "SimulationFailed", "__version__", *homes()]
        if name not in (found := homes()):
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(found[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *homes()})
