"""Writes golden.json: reference results of a fixed list of parameter sets.

    python -m tests.reference.generate

Each set is solved several times: at a tight tolerance, which gives the results, then with a looser
tolerance, with another integration method, and with a normal force or force factor changed by a
little. How far v_average moves tells what a comparison may ask for. `chaotic` sets, where the
tolerance, the method or a change by 1e-9 moves it by more than 0.2 %, have no number that another
solver could meet; `delicate` ones, where only the larger changes do so, ask for a smaller error
than those changes.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import sksundae

from tests.reference.monolithic import IMPACT_SPEED, REST_SPEED, SAMPLED, Params, Result, simulate

COMMAND = "python -m tests.reference.generate"
TOL, LOOSE_TOL, OTHER_TOL, OTHER_METHOD = 1e-10, 1e-8, 1e-9, "BDF"
CHAOTIC = 2e-3  # relative change of v_average
FLOOR = 1e-4  # m/s; changes are relative to no less than this
# Early instants [s] for comparing trajectories, off the sawtooth's falls in every set.
TIMES = (0.0037, 0.0083, 0.0141, 0.0209, 0.0277, 0.0343, 0.0419, 0.0493, 0.0581)
COUNTS = ("impacts", "impacts_all", "slips", "sticks", "stick_slip_events")
NUMBERS = (
    "v_average",
    "stick_fraction",
    "saturated_fraction",
    "z_surface_pp",
    "v_surface_max",
    "v_surface_min",
    "current_max",
    "current_min",
)


@dataclass(frozen=True)
class Case:
    """A parameter set: rungs, and what differs from the scene `reference`."""

    name: str
    contact: str
    circuit: str
    params: Mapping[str, float | str] = field(default_factory=dict)
    duration: float = 0.6  # s
    settle: float = 0.3  # s


def case(name: str, contact: str, circuit: str, **params: float | str) -> Case:
    return Case(name, contact, circuit, params)


SINE = {"waveform": "sine", "mu_plate": 0.2, "amplitude": 5.0, "offset": 1.0}
FAST = {"frequency": 50.8, "amplitude": 9.0}  # Hz, V: where the output limits tell
GRIPPER = {"n_surfaces": 2, "count": 2, "part_mass": 0.017}
# As the scene direct-drive-stops: the back-EMF of a strong coil jumps at the stops.
DIRECT = {
    "actuator": "direct",
    **{"resistance": 4.3, "inductance": 0.83e-3, "force_factor": -4.38},
    **{"surface_mass": 0.00783, "flexure_stiffness": 936.0, "flexure_damping": 0.475},
    **{"suspension_k1": 0.0, "suspension_k3": 0.0, "suspension_damping": 0.0, "travel": 4.6e-3},
}
KNEE = {"suspension": "knee", "suspension_k1": 90.0, "suspension_knee": -2e-4}
REPULSION = {"suspension": "repulsion", "suspension_repulsion": 0.06, "suspension_distance": 2.3e-3}
CASES = (
    Case("reference", "compliant", "amplifier", {}, 2.0, 1.0),
    Case("reference-ideal", "compliant", "ideal", {}, 2.0, 1.0),
    case("reference-rigid", "rigid", "amplifier"),
    case("reference-rigid-ideal", "rigid", "ideal"),
    case("fast", "compliant", "amplifier", **FAST),
    case("fast-ideal", "compliant", "ideal", **FAST),
    case("fast-rigid", "rigid", "amplifier", **FAST),
    case("fast-rigid-ideal", "rigid", "ideal", **FAST),
    case("slow", "compliant", "amplifier", frequency=9.7, amplitude=10.6, offset=-0.4),
    case("slow-rigid", "rigid", "amplifier", frequency=9.7, amplitude=6.0, offset=-1.0),
    case("weak", "compliant", "amplifier", frequency=20.8, amplitude=4.7, offset=-0.6),
    case("weak-rigid-ideal", "rigid", "ideal", frequency=30.2, amplitude=4.7, offset=-1.5),
    case("down", "compliant", "amplifier", frequency=30.2, amplitude=7.0, offset=2.6),
    case("down-rigid", "rigid", "amplifier", frequency=20.2, amplitude=8.0, offset=2.6),
    case("top-drive", "compliant", "amplifier", frequency=55.0, amplitude=10.6, offset=-2.5),
    case("pressed", "compliant", "amplifier", frequency=20.8, amplitude=9.0, normal_force=2.0),
    case("pressed-rigid", "rigid", "amplifier", frequency=40.0, normal_force=1.2),
    case("loose", "compliant", "ideal", frequency=25.0, amplitude=6.0, normal_force=0.47),
    case("plate", "compliant", "amplifier", mu_plate=0.1),
    case("plate-rigid", "rigid", "ideal", frequency=20.8, amplitude=7.0, mu_plate=0.1),
    case("gripper", "compliant", "amplifier", **GRIPPER, amplitude=10.6, normal_force=0.6),
    case("gripper-rigid", "rigid", "amplifier", **GRIPPER, frequency=30.0, amplitude=9.0),
    case("asymmetric", "compliant", "amplifier", suspension_k2=2e4, frequency=22.0),
    case("bent-bl", "compliant", "amplifier", b1=60.0, b2=-5e4, amplitude=9.0),
    case("soft-wall", "compliant", "amplifier", contact_stiffness=1e7, contact_damping=0.9),
    case("hard-wall", "compliant", "amplifier", contact_stiffness=5e8, frequency=18.0),
    case("dull-rigid", "rigid", "amplifier", restitution=0.5, frequency=15.0),
    case("lively-rigid", "rigid", "ideal", restitution=0.77, frequency=12.0, amplitude=7.0),
    case("strong", "compliant", "amplifier", force_factor=1.2, frequency=30.0, amplitude=9.0),
    case("strong-rigid", "rigid", "amplifier", force_factor=1.2, frequency=20.0, amplitude=10.0),
    case("wide", "compliant", "amplifier", travel=4e-3, frequency=35.0, amplitude=6.0),
    case("low-swing", "compliant", "amplifier", swing_loss_high=8.0, swing_loss_low=6.0),
    case("no-walls", "compliant", "amplifier", travel=1e-2, frequency=35.0, amplitude=6.0),
    Case("reference-limited", "compliant", "limited", {}, 2.0, 1.0),
    case("reference-rigid-limited", "rigid", "limited"),
    case("fast-limited", "compliant", "limited", **FAST),
    case("quick-rigid-limited", "rigid", "limited", frequency=40.0, amplitude=10.0),
    case("low-supply-limited", "compliant", "limited", supply=10.0),
    case("low-swing-rigid-limited", "rigid", "limited", swing_loss_high=8.0, swing_loss_low=6.0),
    case("gripper-limited", "compliant", "limited", **GRIPPER, amplitude=10.6, normal_force=0.6),
    case("plate-limited", "compliant", "limited", mu_plate=0.1, inductance=3e-3),
    case("bent-bl-limited", "rigid", "limited", b1=60.0, b2=-5e4, amplitude=9.0),
    case("direct", "compliant", "amplifier", **DIRECT),
    case("direct-rigid", "rigid", "amplifier", **DIRECT),
    case("direct-rigid-limited", "rigid", "limited", **DIRECT),
    case("no-walls-limited", "compliant", "limited", travel=1e-2, force_factor=2.0, frequency=35.0),
    Case("sine-limited", "compliant", "limited", SINE, 2.0, 1.0),
    case("sine-rigid-ideal", "rigid", "ideal", waveform="sine", mu_plate=0.1),
    case(
        *("sine-rigid-limited", "rigid", "limited"),
        **{"waveform": "sine", "mu_plate": 0.2, "inductance": 4e-3, "frequency": 40.0},
    ),
    case("knee", "compliant", "limited", **KNEE, frequency=22.0),
    case("knee-rigid", "rigid", "limited", **KNEE, amplitude=9.0),
    case("repulsion", "compliant", "limited", **REPULSION, contact_stiffness=3e6),
    case("repulsion-rigid", "rigid", "limited", **REPULSION, frequency=30.0),
)


def run(c: Case, tol: float, method: str = "Adams", **changes: float) -> Result:
    """Solves a set with some parameters changed by parts of themselves."""
    params: dict[str, Any] = asdict(Params()) | dict(c.params)
    for name, change in changes.items():
        params[name] *= 1.0 + change
    return simulate(
        params,
        c.duration,
        c.settle,
        contact=c.contact,
        circuit=c.circuit,
        tol=tol,
        method=method,
        times=TIMES,
    )


def rounded(x: float | np.ndarray) -> Any:
    """Twelve digits, more than are good."""
    if isinstance(x, np.ndarray):
        return [rounded(float(v)) for v in x]
    return float(f"{x:.12g}")


def golden(c: Case) -> dict[str, Any]:
    """The entry of a set."""
    best = run(c, TOL)
    same = {
        "tolerance": run(c, LOOSE_TOL),
        "method": run(c, OTHER_TOL, OTHER_METHOD),
        "normal_force+1e-9": run(c, TOL, normal_force=1e-9),
        "force_factor+1e-9": run(c, TOL, force_factor=1e-9),
    }
    changed = {
        "normal_force+1e-5": run(c, OTHER_TOL, normal_force=1e-5),
        "force_factor+1e-4": run(c, OTHER_TOL, force_factor=1e-4),
        "force_factor-1e-4": run(c, OTHER_TOL, force_factor=-1e-4),
    }
    scale = max(abs(best.v_average), FLOOR)
    moved = {k: abs(r.v_average - best.v_average) / scale for k, r in (same | changed).items()}
    spread = list(same.values())
    chaotic = any(moved[k] > CHAOTIC for k in same)
    return {
        "name": c.name,
        "contact": c.contact,
        "circuit": c.circuit,
        "params": dict(c.params),
        "duration": c.duration,
        "settle": c.settle,
        "chaotic": chaotic,
        "delicate": not chaotic and any(moved[k] > CHAOTIC for k in changed),
        "result": {k: rounded(getattr(best, k)) for k in NUMBERS}
        | {k: getattr(best, k) for k in COUNTS},
        # Relative change of v_average in each run; then the largest absolute changes of counts and
        # trajectories among those runs that should agree.
        "sensitivity": {k: float(f"{v:.2g}") for k, v in moved.items()},
        "count_spread": {
            k: max(abs(getattr(r, k) - getattr(best, k)) for r in spread) for k in COUNTS
        },
        "trajectory": {k: rounded(best.samples[k]) for k in SAMPLED},
        "trajectory_spread": {
            k: float(f"{max(np.max(np.abs(r.samples[k] - best.samples[k])) for r in spread):.2g}")
            for k in SAMPLED
        },
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("golden.json"))
    parser.add_argument("--only", nargs="*", help="names of sets, for a look at some of them")
    args = parser.parse_args()
    entries = []
    begin = time.monotonic()
    for c in CASES:
        if args.only and c.name not in args.only:
            continue
        entries.append(entry := golden(c))
        mark = "chaotic" if entry["chaotic"] else "delicate" if entry["delicate"] else ""
        result = entry["result"]
        print(
            f"{time.monotonic() - begin:6.1f} s  {c.name:18} {1e3 * result['v_average']:10.5f} mm/s"
            f"  {result['impacts']:4d} impacts  {list(entry['sensitivity'].values())} {mark}",
            flush=True,
        )
    document = {
        "command": COMMAND,
        "versions": {
            "python": platform.python_version(),
            "numpy": version("numpy"),
            "scipy": version("scipy"),
            "scikit-sundae": version("scikit-sundae"),
            "sundials": sksundae.SUNDIALS_VERSION,
        },
        "units": "SI; times in s; counts and fractions are taken from `settle` on",
        "tolerances": {"result": TOL, "tolerance": LOOSE_TOL, "method": [OTHER_METHOD, OTHER_TOL]},
        "thresholds": {"rest_speed": REST_SPEED, "impact_speed": IMPACT_SPEED, "chaotic": CHAOTIC},
        "defaults": asdict(Params()),
        "sample_times": list(TIMES),
        "cases": entries,
    }
    args.out.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
