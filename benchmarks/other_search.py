"""Whether another search finds more than ``results/limits.csv`` has on a rig, by its number there.

    python -m benchmarks.other_search best|robust [--seed N] [--rig N]

It is SciPy's differential evolution (R. Storn, K. Price, J. Global Optimization 11, 1997, 341-359),
which shares nothing with the study's search but the machine, its runs, and the judge of what is
found. A line for each change and goal; at the end, how often it found more than ``MORE``.
"""

import argparse
import csv
from pathlib import Path

import numpy as np
from scipy.optimize import differential_evolution

from cosim.arrays import Array
from cosim.evaluate.evaluator import Evaluator
from cosim.scene import load
from cosim.search.known import apart
from cosim.studies.limits.changes import CHANGES, STEPS, Change
from cosim.studies.limits.judge import Key, judged
from cosim.studies.limits.runs import GOALS, NEEDED, Bench
from cosim.studies.limits.study import ensemble

FOUND, RIGS = Path("results/limits.csv"), Path("results/identify.json")
COLUMN = {"best": "value", "robust": "median over turns"}
MORE = {"best": 1.05, "robust": 1.08}
POPULATION = {"best": 60, "robust": 24}
GENERATIONS = {"best": 60, "robust": 30}
APART, JUDGED, NOTHING = 0.03, 4, -1e3
"""Least distance of the judged points, in the unit cube; their number; the score of infeasible
points."""


def searched(bench: Bench, change: Change, number: int, kind: str, seed: int) -> float:
    """The best value of a change for a goal, in the goal's unit; 0 where nothing was found."""
    machine, goal = change.machine(bench.scene), GOALS[number]
    scores_of = bench.once(machine) if kind == "best" else bench.over_turns(machine)
    seen: list[tuple[float, list[float]]] = []

    def cost(columns: Array) -> Array:
        # SciPy passes keys × points; scores are points × goals.
        points = np.round(columns.T * STEPS) / STEPS
        scores, feasible = scores_of(points)
        found = scores[:, number]
        found = np.where(feasible & np.isfinite(found), found, NOTHING)
        seen.extend(zip(found.tolist(), points.tolist(), strict=True))
        return -found

    differential_evolution(
        cost, [(0.0, 1.0)] * machine.keys, popsize=max(4, POPULATION[kind] // machine.keys),
        maxiter=GENERATIONS[kind], rng=seed, vectorized=True, updating="deferred", polish=False,
        tol=1e-6, init="sobol",
    )  # fmt: skip
    points = np.array([point for score, point in sorted(seen, reverse=True) if score > 0.0][:400])
    if not len(points):
        return 0.0
    best = points[apart(points, APART, JUDGED)].tolist()
    candidates = {kind: [best if k == number else [] for k in range(len(GOALS))]}
    found = judged(bench, {change.name: machine}, {change.name: candidates}, (kind,))
    point = found.get(Key(change.name, goal.name, kind))
    return point.rank(kind) * goal.scale if point else 0.0


def main() -> None:
    """Search and print."""
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m benchmarks.other_search")
    parser.add_argument("kind", choices=[*COLUMN])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rig", type=int, default=0, help="0 for the scene's own")
    asked = parser.parse_args()
    with FOUND.open(newline="") as file:
        rows = [
            row
            for row in csv.DictReader(file)
            if (row["rig"], row["kind"]) == (str(asked.rig), asked.kind)
        ]
    known = {(row["change"], row["goal"]): float(row[COLUMN[asked.kind]]) for row in rows}
    scene = load("paper")
    rig = [{}, *ensemble(RIGS, scene)][asked.rig]
    base, ratios = Bench.base(scene, rig, f"rig {asked.rig}"), []
    with Evaluator(base, kept=NEEDED) as evaluator:
        bench = Bench(base, evaluator)
        for change in CHANGES:
            for number, goal in enumerate(GOALS):
                if change.searched and (before := known.get((change.name, goal.name))):
                    found = searched(bench, change, number, asked.kind, asked.seed)
                    ratios.append(found / before)
                    words = f"{before:9.3f} {found:9.3f} {goal.unit:5} {ratios[-1]:6.3f}"
                    print(f"{change.name:40} {goal.name:9} {words}", flush=True)
    more = np.array(ratios) > MORE[asked.kind]
    print(f"more than {MORE[asked.kind]} times as much: {more.sum()} of {len(more)}")


if __name__ == "__main__":
    main()
