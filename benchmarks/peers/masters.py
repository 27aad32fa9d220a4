"""Peers: other masters run the .ssp that ``cosim fmu ssp`` writes of the machine.

Each needs a process of its own, since ngspice has one circuit in a process. A master that is not
installed is left out: FMPy comes with cosim; libcosim with ``pip install libcosimpy``; Ecos with
``pip install ecospy tbb``, and ``LD_LIBRARY_PATH`` naming the environment's ``lib`` with its TBB.

    python -m benchmarks.peers.masters MASTER FILE.ssp STEP DURATION

prints times (s), heights of the surface (m) and the CPU seconds as JSON.
"""

import json
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.fmus.ssp import ssp
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.speed.bench import cpu, ratios, spread

MACRO_STEP, DURATION = 1e-4, 0.1
"""s; of what is compared."""

PACKAGES = {"fmpy": "fmpy", "ecos": "ecospy", "libcosim": "libcosimpy"}


def run(master: str, file: Path, step: float, duration: float) -> tuple[Array, Array, float] | None:
    """Times (s), heights of the surface (m), CPU seconds; None where the master is missing."""
    if find_spec(PACKAGES[master]) is None:
        return None
    words = [sys.executable, "-m", __name__, master, str(file), repr(step), repr(duration)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=600)
    found = json.loads(done.stdout[done.stdout.rindex('{"times"') :])
    return np.array(found["times"]), np.array(found["heights"]), found["cpu"]


def compare(rounds: int) -> dict[str, Any]:
    """Of each master that is installed its CPU time and its error over those of our Jacobi, which
    exchanges the same at the same times; errors are rms of the surface's height over its rms."""
    short = {"run.duration": DURATION, "run.settle": 0.0, "run.output_step": MACRO_STEP}
    ours = load("reference", short | {"coupling.method": "jacobi", "coupling.order": 0,
                                      "coupling.macro_step": MACRO_STEP})  # fmt: skip
    fine = load("reference", short | {"circuit.max_step": 1e-5, "circuit.reltol": 1e-6})
    true, own = simulate(fine).columns["z_surface"], simulate(ours).columns["z_surface"]

    def error(found: Array, true: Array) -> float:
        return float(np.sqrt(np.mean((found - true) ** 2) / np.mean(true**2)))

    cost: dict[str, Any] = {}
    off: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "machine.ssp"
        ssp(ours, file)
        for master in PACKAGES:
            runs = [run(master, file, MACRO_STEP, DURATION) for _ in range(rounds)]
            done = [each for each in runs if each is not None]
            if not done:
                continue
            cost[master] = ratios(
                [each[2] for each in done], [cpu(lambda: simulate(ours)) for _ in done]
            )
            reached, wanted = error(done[0][1], true[1:]), error(own, true)
            off[master] = spread([reached / wanted]) | {"error": wanted, "error_of_peer": reached}
    return {"masters_over_jacobi": cost, "masters_error_over_jacobi": off}


def _fmpy(file: Path, step: float, duration: float) -> list[tuple[float, float]]:
    """Its rows bear the time at which the step began whose outputs they have."""
    from fmpy.ssp.simulation import simulate_ssp

    rows: Any = simulate_ssp(str(file), stop_time=duration - 0.5 * step, step_size=step)
    name = next(name for name in rows.dtype.names if name.endswith("z_surface"))
    return [*zip((rows["time"] + step).tolist(), rows[name].tolist(), strict=True)]


def _ecos(file: Path, step: float, duration: float) -> list[tuple[float, float]]:
    from ecospy import EcosSimulation  # pyright: ignore[reportMissingImports]

    rows = []
    with EcosSimulation(ssp_path=str(file), step_size=step) as master:
        master.init(parameter_set="scene")
        for k in range(round(duration / step)):
            master.step(1)
            rows.append(((k + 1) * step, master.get_real("mechanics::z_surface")))
        master.terminate()
    return rows


def _libcosim(file: Path, step: float, duration: float) -> list[tuple[float, float]]:
    from libcosimpy.CosimExecution import CosimExecution  # pyright: ignore[reportMissingImports]
    from libcosimpy.CosimObserver import CosimObserver  # pyright: ignore[reportMissingImports]

    from cosim.mechanics.fmi import references

    place = references(2)["z_surface"]
    master = CosimExecution.from_ssp_file(ssp_path=str(file), step_size=round(step * 1e9))
    observer = CosimObserver.create_last_value()
    master.add_observer(observer=observer)
    rows, mechanics = [], master.slave_index_from_instance_name("mechanics")
    for k in range(round(duration / step)):
        master.step(1)
        values = observer.last_real_values(slave_index=mechanics, variable_references=[place])
        rows.append(((k + 1) * step, float(values[0])))
    return rows


def _main() -> None:
    master, file, step, duration = sys.argv[1:]
    ways = {"fmpy": _fmpy, "ecos": _ecos, "libcosim": _libcosim}
    began = process_time()
    rows = ways[master](Path(file), float(step), float(duration))
    cpu = process_time() - began
    times, heights = zip(*rows, strict=True)
    print("\n" + json.dumps({"times": times, "heights": heights, "cpu": cpu}))


if __name__ == "__main__":
    _main()
