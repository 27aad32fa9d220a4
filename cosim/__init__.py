"""Co-simulation bench: SPICE circuits, voice-coil actuators and stick-slip mechanics.

>>> import cosim
>>> cosim.run("optimal", {"drive.frequency": 30}).summary["v_average"] > 0
True
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from cosim.errors import BadInput, SimulationFailed
from cosim.toolchain.interrupts import deferred
from cosim.version import __version__

if TYPE_CHECKING:
    from cosim.scene import load
    from cosim.simulation.simulate import run
    from cosim.studies.accuracy.accuracy import accuracy
    from cosim.studies.compare.run import compare
    from cosim.studies.fit.fit import fit
    from cosim.studies.identify.run import identify
    from cosim.studies.limits.report import limits
    from cosim.studies.paper.theory import theory
    from cosim.studies.speed.ladder import ladder
    from cosim.studies.spread import spread
    from cosim.studies.stability.stability import stability
    from cosim.studies.sweep import sweep
    from cosim.studies.tune import tune
    from cosim.waveforms.result import Result

__all__ = [
    "BadInput",
    "Result",
    "SimulationFailed",
    "__version__",
    "accuracy",
    "compare",
    "fit",
    "identify",
    "ladder",
    "limits",
    "load",
    "run",
    "spread",
    "stability",
    "sweep",
    "theory",
    "tune",
]

_HOMES = {
    "Result": "cosim.waveforms.result",
    "load": "cosim.scene",
    "run": "cosim.simulation.simulate",
    "spread": "cosim.studies.spread",
    "sweep": "cosim.studies.sweep",
    "tune": "cosim.studies.tune",
    "compare": "cosim.studies.compare.run",
    "fit": "cosim.studies.fit.fit",
    "identify": "cosim.studies.identify.run",
    "theory": "cosim.studies.paper.theory",
    "accuracy": "cosim.studies.accuracy.accuracy",
    "ladder": "cosim.studies.speed.ladder",
    "limits": "cosim.studies.limits.report",
    "stability": "cosim.studies.stability.stability",
}
"""Loaded on first use: `import cosim` and light commands need none of them."""


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    with deferred():
        return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOMES})
