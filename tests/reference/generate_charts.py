"""Writes cosim/studies/accuracy/reference.json: the solutions that `cosim chart accuracy` measures
against.

    python -m tests.reference.generate_charts

Each scene is solved at a tight tolerance, which gives the numbers; by another integration method at
another tolerance, which tells how far they can be trusted; and from a normal force changed by 1e-9,
which tells how much the scene itself makes of a small difference. A scene is solved anew only where
its hash has changed: of its parameters and of the solver's source.
"""

import hashlib
import json
from dataclasses import asdict, replace
from importlib.metadata import version
from math import log10, pi
from pathlib import Path
from typing import Any

import numpy as np

from cosim.scene import load
from cosim.studies.accuracy.cases import CASES, Case
from tests.reference import monolithic
from tests.reference.parameters import reference_parameters

TOL, OTHER_TOL, OTHER_METHOD = 1e-13, 1e-12, "BDF"
NUDGE = 1e-9
REST_SPEED = 1e-8
"""Rigid rebounds slower than this, m/s, end in resting contact. The solver's own 1e-6 is a floor of
5e-7 under every error on the scene ``impact``."""
PATH = Path(__file__).parents[2] / "cosim" / "studies" / "accuracy" / "reference.json"


def solve(case: Case, known: dict[str, Any]) -> dict[str, Any]:
    """The entry of a case: as it is known, if nothing about it has changed."""
    scene = load("reference", case.overrides)
    p = replace(monolithic.Params(), **reference_parameters(scene))
    if case.netlist:
        # The netlist's pole, 1 uF, leaks through 1 Gohm too, as if the gain were less.
        leak = 10.0 ** (-p.open_loop_gain / 20.0) + 1e-3 / (2.0 * pi * p.gain_bandwidth)
        p = replace(p, open_loop_gain=-20.0 * log10(leak))
    times, contact = case.times(), scene.mechanics.contact
    source = Path(monolithic.__file__).read_bytes()
    settings = [TOL, OTHER_TOL, OTHER_METHOD, NUDGE, asdict(p), contact, times, case.judged]
    if contact == "rigid":
        settings.append(REST_SPEED)
    key = hashlib.sha256(source + json.dumps(settings).encode()).hexdigest()
    if known.get("key") == key:
        return known

    def path(p: monolithic.Params, **options: Any) -> np.ndarray:
        found = monolithic.simulate(p, case.duration, 0.0, contact=contact, times=times, **options)
        return np.array([found.samples[name] for name in case.judged])

    best = path(p, tol=TOL)
    other = path(p, tol=OTHER_TOL, method=OTHER_METHOD)
    nudged = path(replace(p, normal_force=p.normal_force * (1.0 + NUDGE)), tol=TOL)

    def off(path: np.ndarray) -> float:
        return float((np.abs(path - best).max(axis=1) / np.ptp(best, axis=1)).max())

    return {
        "key": key,
        "signals": dict(zip(case.judged, best.tolist(), strict=True)),
        "other_method": off(other),
        "growth": off(nudged) / NUDGE,
    }


def main() -> None:
    monolithic.REST_SPEED = REST_SPEED
    old = json.loads(PATH.read_text(encoding="utf-8"))["cases"] if PATH.exists() else {}
    found = {name: solve(case, old.get(name, {})) for name, case in CASES.items()}
    source = f"SUNDIALS CVODE through scikit-sundae {version('scikit-sundae')}, restarted at events"
    content = {
        "source": f"{source}; Adams at {TOL:g}, other_method: {OTHER_METHOD} at {OTHER_TOL:g}",
        "command": "python -m tests.reference.generate_charts",
        "cases": found,
    }
    PATH.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    for name, entry in found.items():
        print(f"{name:<16} other {entry['other_method']:.1e}  growth {entry['growth']:.3g}")


if __name__ == "__main__":
    main()
