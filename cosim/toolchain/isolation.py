"""A simulation in a process of its own, which may hang, crash or be spoilt without harm.

A netlist of unknown quality can make ngspice loop for ever, end the process, or refuse all further
work in it; none of these can be caught from within.
"""

import multiprocessing
import signal
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from cosim.errors import SimulationFailed

PATIENCE = 30.0
"""s of wall time without any progress after which a simulation counts as hanging."""

_REPORT_EVERY = 0.1  # s of wall time


def isolated(
    simulate: Callable[..., Any], scene: Any, progress: Callable[[float], None], **options: Any
) -> Any:
    """What ``simulate(scene, progress, **options)`` gives, from a fresh process.

    Raises what it raises there, or SimulationFailed where the process hangs or dies.
    """
    context = multiprocessing.get_context("spawn")
    here, there = context.Pipe()
    process = context.Process(
        target=_work, args=(there, simulate, scene, options), name="cosim-simulation"
    )
    process.start()
    there.close()
    reached = 0.0
    try:
        while True:
            if not here.poll(PATIENCE):
                raise SimulationFailed(
                    f"The simulation hangs at t = {reached:.6g} s: no step was finished in "
                    f"{PATIENCE:g} s. A netlist without a solution can do this to ngspice."
                )
            kind, value = here.recv()
            if kind == "progress":
                reached = value
                progress(reached)
            elif kind == "failure":
                raise value
            else:
                return value
    except EOFError:
        process.join(PATIENCE)
        raise SimulationFailed(
            f"The simulation's process died at t = {reached:.6g} s "
            f"({how_it_ended(process.exitcode)})."
        ) from None
    finally:
        process.kill()
        process.join()
        here.close()


def how_it_ended(code: int | None) -> str:
    """The signal or exit code that ended a process."""
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit code {code}"


def _work(
    pipe: Connection, simulate: Callable[..., Any], scene: Any, options: dict[str, Any]
) -> None:
    # Ctrl-C reaches the whole group; the parent decides what becomes of this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    told = time.monotonic()

    def progress(reached: float) -> None:
        nonlocal told
        now = time.monotonic()
        if now - told >= _REPORT_EVERY:
            told = now
            pipe.send(("progress", reached))

    try:
        answer = ("result", simulate(scene, progress, **options))
    except Exception as failure:
        answer = ("failure", failure)
    pipe.send(answer)
    pipe.close()
