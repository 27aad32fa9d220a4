"""A scene's run, as a user of the library asks for it."""

import os
import warnings
from collections.abc import Callable

from cosim.errors import BeyondModel
from cosim.scene import Scene, load
from cosim.scene.loading import Overrides
from cosim.simulation.simulate import simulate
from cosim.waveforms.result import Result


def run(
    scene: Scene | str | os.PathLike[str],
    overrides: Overrides | None = None,
    progress: Callable[[float], None] = lambda time: None,
) -> Result:
    """Run a scene: a built-in name, a TOML file, or what :func:`cosim.load` gave.

    ``overrides`` are values for its keys, SI: ``{"drive.frequency": 30}``. ``progress`` is told the
    simulated time, s, now and then. Circuits run in worker processes, as many at once as there are
    processors; any thread may call this.

    Where the run leaves what the model or a data sheet holds for, ``summary["notes"]`` says so, a
    sentence each, and a warning :class:`cosim.errors.BeyondModel` is given.

    Raises BadInput for what cannot be simulated, SimulationFailed with where, when, and what to
    try.

    >>> result = run("held", {"run.duration": 0.1})
    >>> result.waveforms.z_part.units
    'm'
    """
    result = simulate(load(scene, overrides), progress)
    for sentence in result.summary["notes"]:
        warnings.warn(sentence, BeyondModel, stacklevel=2)
    return result
