"""Measurements of this project itself: the cost of coupling, and other programs for comparison.

    python -m benchmarks [NAME ...] [--quick] [--trials DIR] [--out DIR]

measures all, or the named ones, and always what ``cosim bench`` measures, and writes
``bench.json``. Run it from the top of a checkout. ``python -m benchmarks.charts`` draws the charts
that have other programs in them.
"""

import argparse
from collections.abc import Callable
from math import inf
from pathlib import Path
from typing import Any

from benchmarks import compare, errors, instructions, part, parts
from benchmarks.peers import masters
from cosim.files.atomic import write_json
from cosim.studies.speed import bench
from cosim.toolchain.processes import in_place

TITLES = bench.TITLES | {
    "cost_exponent": "Exponent of the cost over the duration",
    "coupled_over_parts": "Coupled run over the sum of its parts, each alone",
    "all_in_ngspice_over_ours": "The whole machine in one netlist, over ours",
    "naive_over_ours": "PySpice's and fmpy's plain calls, over ours",
    "naive_motor_over_ours": "These calls on an H-bridge and a gearbox FMU, over ours",
    "solve_ivp_over_ours": "SciPy's solve_ivp (LSODA, events), over ours",
    "masters_over_jacobi": "Other masters with the .ssp, CPU time over our Jacobi",
    "masters_error_over_jacobi": "The same, their error over that of our Jacobi",
    "part": "The part on a given surface",
}
TARGETS: bench.Targets = bench.TARGETS | {
    "cost_exponent": (0.97, 1.03),
    "coupled_over_parts.amplifier": (-inf, 1.25),
    "coupled_over_parts.full": (-inf, 1.25),
    "all_in_ngspice_over_ours": (5.0, inf),
    "naive_over_ours": (4.0, inf),
    "naive_motor_over_ours": (5.0, inf),
    "solve_ivp_over_ours": (3.0, inf),
    **{f"masters_error_over_jacobi.{name}": (-inf, 1.1) for name in masters.PACKAGES},
}

Measure = Callable[[bool, Path | None], Any]
"""Returns its part of the numbers; the arguments are ``quick`` and the trials' folder."""

MEASURES: dict[str, Measure] = {
    "parts": lambda quick, _: {"coupled_over_parts": parts.measure(3 if quick else 11)},
    "peers": lambda quick, _: compare.compare(3 if quick else 11),
    "masters": lambda quick, _: masters.compare(1 if quick else 5),
    "growth": lambda quick, _: {
        "cost_exponent": errors.cost_exponent(
            2 if quick else 5, (20, 60, 200) if quick else (10, 100, 1000)
        )
    },
    "instructions": lambda *_: {"instructions_per_period": instructions.per_period()},
    "part": lambda quick, trials: {"part": part.solvers(trials, 11 if quick else 51)},
}


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks", description="Measures this project itself.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(MEASURES)}")
    parser.add_argument("--quick", action="store_true", help="fewer rounds, shorter runs")
    parser.add_argument("--trials", type=Path, metavar="DIR", help="folder of tracked trials")
    parser.add_argument("--out", type=Path, default=Path("results/bench"), metavar="DIR")
    asked = parser.parse_args()
    if not set(asked.names) <= set(MEASURES):
        parser.error(f"a NAME must be one of {', '.join(MEASURES)}")
    numbers: dict[str, Any] = {}
    with in_place():  # no child processes: their CPU time would be missing
        for name in asked.names or MEASURES:
            numbers |= MEASURES[name](asked.quick, asked.trials)
        numbers |= bench.measure(asked.quick)
        for rung, error in errors.of_rungs().items():
            numbers["real_time"][rung]["error"] = error
    asked.out.mkdir(parents=True, exist_ok=True)
    write_json(asked.out / "bench.json", bench.judged(numbers, TARGETS))
    print(bench.table(numbers, TITLES))
    if "instructions_per_period" in numbers:
        counted = numbers["instructions_per_period"]
        words = f"{counted:,}" if counted else "not counted: valgrind is needed"
        print(f"Instructions of the FMU per period: {words}")


if __name__ == "__main__":
    main()
