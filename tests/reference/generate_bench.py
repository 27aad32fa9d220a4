"""Writes benchmarks/reference.json: the part's path in the scene `reference`, which errors are
measured against beside speeds.

    python -m tests.reference.generate_bench
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.reference.monolithic import simulate

COMMAND = "python -m tests.reference.generate_bench"
DURATION = 0.2  # s
SETTLE = 0.1
TOL, OTHER_TOL, OTHER_METHOD = 1e-10, 1e-9, "BDF"
TIMES = [k * 1e-3 for k in range(1, 200)]  # s


def main() -> None:
    found: dict[str, object] = {"command": COMMAND, "time": TIMES}
    for circuit in ("amplifier", "ideal"):
        runs = [
            simulate({}, DURATION, SETTLE, circuit=circuit, tol=tol, method=method, times=TIMES)
            for tol, method in ((TOL, "Adams"), (OTHER_TOL, OTHER_METHOD))
        ]
        path, other = (run.samples["z_part"] for run in runs)
        found[circuit] = {
            "z_part": path.tolist(),
            "spread": float(np.abs(path - other).max() / np.ptp(path)),
        }
    target = Path(__file__).parents[2] / "benchmarks" / "reference.json"
    target.write_text(json.dumps(found) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
