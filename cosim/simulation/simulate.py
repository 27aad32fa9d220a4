"""Runs a scene: chooses circuit and coupling where they are "auto", and adds the checks."""

import os
import time
import warnings
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Literal

from cosim.errors import BadInput, BeyondModel
from cosim.scene import Overrides, Scene, changed, load
from cosim.simulation.elsewhere import one_run
from cosim.toolchain.threads import Progress
from cosim.typed import typed
from cosim.waveforms.result import Result


@typed
def run(
    scene: Scene | str | os.PathLike[str],
    overrides: Overrides | None = None,
    progress: Progress = lambda time: None,
    strict: bool = False,
) -> Result:
    """Run a scene: a built-in name, a TOML file, or what :func:`cosim.load` gave.

    ``overrides`` are values for its keys, SI: ``{"drive.frequency": 30}``. ``progress`` is told the
    simulated time, s, now and then. Circuits run in worker processes, as many at once as there are
    processors; any thread may call this.

    What comes back has the curves as ``waveforms``, and the numbers of ``summary.json``, SI, as the
    dictionary ``summary``: the page "Summary" of the reference has them all.
    ``summary["v_average_error"]`` and ``summary["motion"]`` tell how far its numbers hold; what
    they are from is in :mod:`cosim.simulation.checks`. With ``strict`` they come from more and
    finer runs, which takes about ten times as long.

    Where the run leaves what the model or a data sheet holds for, ``summary["notes"]`` says so, a
    sentence each, and a warning :class:`cosim.errors.BeyondModel` is given.

    Raises BadInput for what cannot be simulated, SimulationFailed with where, when, and what to
    try.

    >>> result = run("held", {"run.duration": 0.1})
    >>> result.waveforms.z_part.units
    'm'
    """
    result = simulate(load(scene, overrides), progress, checks="strict" if strict else "usual")
    for sentence in result.summary["notes"]:
        warnings.warn(sentence, BeyondModel, stacklevel=3)
    return result


def simulate(
    scene: Scene,
    progress: Progress = lambda _: None,
    checks: Literal["none", "usual", "strict"] = "none",
) -> Result:
    """Run a scene. ``progress`` is told the simulated time (s) now and then. With ``checks`` the
    summary also tells what :mod:`cosim.simulation.checks` finds out.

    Every circuit in ngspice runs in a worker process, behind a fence. Raises BadInput for a netlist
    that cannot be used, SimulationFailed with where, when, and what to try.
    """
    if scene.has_ports:
        if checks == "strict":
            raise BadInput("--error tells of the built-in machine, not of a scene's own [[port]].")
        if checks == "usual":
            from cosim.simulation.checks import checked_ports

            return checked_ports(scene, lambda: one_run(scene, progress), progress)
        return one_run(scene, progress)
    if scene.run.solver == "fast":
        from cosim.simulation.checks import motion
        from cosim.simulation.fast import simulate_fast

        result = simulate_fast(scene, progress)
        kind = {} if checks == "none" else motion(scene, progress)
        return replace(result, summary=result.summary | kind)
    again = partial(simulate, progress=progress)
    if scene.rung.automatic:
        return _cheapest(scene, partial(again, checks=checks))
    if checks != "none":
        from cosim.simulation.checks import checked

        return checked(scene, partial(again, scene), progress, checks == "strict")
    if scene.coupling.method == "auto" and scene.rung.ngspice:
        from cosim.simulation.choose_steps import simulate_within_tolerance

        return simulate_within_tolerance(scene, again)
    return one_run(scene, progress)


def summary(scene: Scene, progress: Progress = lambda _: None) -> dict[str, Any]:
    """The summary of a run alone, without notes. Raises as a run does."""
    if scene.run.solver == "fast":
        from cosim.simulation.fast import summary_fast

        return summary_fast(scene, progress)
    if scene.rung.automatic or (
        scene.rung.ngspice and scene.coupling.method == "auto" and not scene.has_ports
    ):
        return simulate(scene, progress).summary
    return one_run(scene, progress, alone=True).summary


def _cheapest(scene: Scene, run: Callable[[Scene], Result]) -> Result:
    """The run with the cheapest rung that suffices; ``wall_time`` includes the choice."""
    from cosim.simulation.choose_rung import advice, choose

    began = time.perf_counter()
    choice = choose(scene, simulate)
    result = run(changed(scene, {"circuit.model": choice.model}, "auto"))
    found = {
        "circuit_model": choice.model,
        "circuit_model_why": choice.why,
        "circuit_model_expected": advice(choice.model),
        "circuit_model_errors": choice.errors,
        "wall_time": time.perf_counter() - began,
    }
    return replace(result, summary=result.summary | found)
