"""Rows that are read within a step of the integration, while the inputs go on as they are.

The truth: the same mechanics in steps that end at every row, at the least tolerance.
"""

from typing import Any

import numpy as np
import pytest

from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.helpers.fmu_bench import Bench
from tests.mechanics.test_fmi import rig

pytestmark = pytest.mark.physics

ROW, ROWS = 5e-5, 1200
NAMES = ("z_surface", "v_surface", "z_ram", "v_ram", "z_part", "v_part", "energy_in", "stick_time")
EXTREMES = ("a_surface_max", "v_surface_max", "z_surface_max", "z_surface_min")
DRIVE: dict[str, Any] = {"current": -0.9, "current_slope": 28.0}


def rows(hold: float | None, tolerance: float, turn: int = ROWS, **changes: float) -> Any:
    """Values of NAMES at each row, extremes since the row before, and internal steps; the current
    turns at one of the rows. Where ``hold`` (s) is None, a step ends at every row."""
    with Bench(tolerance=tolerance, **DRIVE, **changes) as bench:
        found, extremes = [], []
        for row in range(ROWS):
            bench.set(inputs_hold_for=hold or 0.0)
            if hold is None:
                bench.set(command=row)  # a change, though without effect
            if row == turn:
                bench.set(current_slope=-DRIVE["current_slope"])
            bench.step(ROW)
            found.append(bench.get(*NAMES))
            extremes.append(bench.get(*EXTREMES))
        return np.array(found), np.array(extremes), bench["internal_steps"]


@pytest.mark.parametrize("hold", [0.0, 1.0])
@pytest.mark.parametrize("contact", [1, 2])
@pytest.mark.parametrize("turn", [ROWS, 337])
def test_rows_within_a_step_are_the_solution(contact: int, turn: int, hold: float) -> None:
    """To 1e-10 of the range, whether inputs are said to hold or are seen to; they need not."""
    truth, _, many = rows(None, 1e-14, turn, contact=contact)
    found, _, few = rows(hold, 1e-12, turn, contact=contact)
    assert few < many
    if turn == ROWS:  # else the ram meets its walls, which takes small steps
        assert few < 0.5 * ROWS
    off = np.abs(found - truth).max(axis=0) / np.ptp(truth, axis=0)
    assert off.max() < 1e-10, dict(zip(NAMES, off, strict=True))


@pytest.mark.parametrize("turn", [ROWS, 337])
def test_extremes_within_a_step_are_found(turn: int) -> None:
    """Row by row, against a hundred samples within each, with parabolas through the greatest."""
    fine, few = 20, 600
    _, extremes, _ = rows(1.0, 1e-12, turn)
    names = ("a_surface", "v_surface", "z_surface", "z_surface")
    with Bench(tolerance=1e-14, **DRIVE) as bench:
        samples = [bench.get(*names)]
        for step in range(fine * few):
            if step == fine * turn:
                bench.set(current_slope=-DRIVE["current_slope"])
            bench.step(ROW / fine)
            samples.append(bench.get(*names))
    for k, (name, sign) in enumerate(zip(EXTREMES, (1, 1, 1, -1), strict=True)):
        signal = sign * np.array(samples)[:, k]
        peaks = [_peak(signal[fine * row : fine * (row + 1) + 1]) for row in range(few)]
        off = np.abs(peaks - sign * extremes[:few, k]) / np.ptp(signal)
        # Where the part breaks away within a row, the acceleration has a corner.
        allowed = 1e-3 if name.startswith("a_") else 1e-6
        assert np.sort(off)[-4] < allowed, name


def test_the_acceleration_turns_within_a_short_step() -> None:
    """As a sine's straights are short. A surface let go, the part sticking to it, swings by its
    lift; the ends of these steps show up to 0.3 % less of its acceleration."""
    step, lift, stiffness, body = 1.2e-5, 1e-4, 1e6, 0.0145 + 0.009
    most, swing = lift * stiffness / body, np.pi / np.sqrt(stiffness / body)
    parameters = {"suspension_k1": 0.0, "suspension_k3": 0.0, "suspension_damping": 0.0}
    parameters |= {"flexure_damping": 0.0, "flexure_stiffness": stiffness, "ram_fixed": 1}
    with Bench(initial_lift=lift, normal_force=1e4, travel=0.1, **parameters) as bench:
        for turn in range(1, 41):
            while bench.time < turn * swing:
                bench.step(step, command=bench.time)  # a change, though without effect
            found = bench["a_surface_max" if turn % 2 else "a_surface_min"]
            assert abs(found) == pytest.approx(most, rel=1e-5)


def test_extremes_are_those_since_the_inputs_were_set_last() -> None:
    """However many steps that takes, within an internal step too, and whether they are looked at or
    not. The truth: the extremes of each row."""
    most = ("a_surface_max", "v_surface_max", "z_surface_max")
    least = ("a_surface_min", "v_surface_min", "z_surface_min")
    turns, over = range(0, 600, 47), 0.0
    highest, lowest = np.full(3, -np.inf), np.full(3, np.inf)
    for looked_at in (True, False):
        with Bench(**DRIVE) as fine, Bench(**DRIVE) as bench:
            for row in range(600):
                for it in (fine, bench) if row in turns else (fine,):
                    it.set(inputs_hold_for=1.0)
                if row in turns:
                    highest, lowest = np.full(3, -np.inf), np.full(3, np.inf)
                fine.step(ROW)
                bench.step(ROW)
                highest = np.maximum(highest, fine.get(*most))
                lowest = np.minimum(lowest, fine.get(*least))
                if looked_at or row + 1 in turns:
                    found = np.array([bench.get(*most), bench.get(*least)])
                    off = np.abs(found - (highest, lowest)) / np.maximum(highest - lowest, 1e-6)
                    over = max(over, off.max())
    assert over < 1e-9


def test_extremes_do_not_mind_who_looks() -> None:
    """Or what is refused; and no row lies beyond them. Random currents, of 100 rows each; in the
    last but one the acceleration turns where the stages of a step do not show it."""
    rng, names = np.random.default_rng(1008), ("z_surface", "v_surface", "a_surface")
    rig = {"contact": 2, "flexure_damping": 0.05}
    with Bench(**rig) as alone, Bench(**rig) as watched, Bench(**rig) as refused:
        for _ in range(60):
            inputs = {"current": rng.normal(0.0, 0.2), "current_slope": rng.normal(0.0, 10.0)}
            seen = []
            for row in range(100):
                hold = {"inputs_hold_for": 100 * ROW, **inputs} if row == 0 else {}
                for it in (alone, watched, refused):
                    it.step(ROW, **hold)
                watched.get("z_surface_min")
                with pytest.raises(Exception, match="status 3"):
                    refused.set(current=1e9)
                seen.append(alone.get(*names))
            for name, column in zip(names, np.array(seen).T, strict=True):
                ends = (f"{name}_min", f"{name}_max")
                found = alone.get(*ends)
                assert found == watched.get(*ends) == refused.get(*ends)
                assert found[0] <= column.min() and column.max() <= found[1]


def _peak(signal: Any) -> float:
    at = int(np.argmax(signal))
    if at in (0, len(signal) - 1):
        return float(signal[at])
    a, b, c = signal[at - 1 : at + 2]
    return float(b + (a - c) ** 2 / (8 * (2 * b - a - c))) if 2 * b > a + c else float(b)


@pytest.mark.parametrize("version", [2, 3])
def test_a_state_within_a_step_brings_back_every_bit(version: int) -> None:
    """In the other version of the interface too."""
    with rig(version) as it, rig(5 - version) as other:
        it.begin({"inputs_hold_for": 1.0, **DRIVE})
        other.begin()
        for _ in range(301):
            it.step(ROW)
        kept, before = it.save(), it.get("internal_steps")
        it.step(ROW)
        assert it.get("internal_steps") == before  # the row lay within a step under way
        first = [it.outputs() for _ in range(300) if it.step(ROW) is None]
        other.load(kept)
        other.step(ROW)
        assert [other.outputs() for _ in range(300) if other.step(ROW) is None] == first


def test_tolerance_is_a_knob() -> None:
    """Of fewer steps and a larger error."""
    overrides = ["circuit.model=limited", "run.duration=0.3", "run.settle=0.1"]
    found = {
        power: simulate(load("reference", [*overrides, f"mechanics.tolerance=1e{power}"]))
        for power in (-13, -9, -5)
    }
    v = {power: float(result.summary["v_average"]) for power, result in found.items()}
    off = {power: abs(v[power] / v[-13] - 1.0) for power in (-9, -5)}
    assert off[-9] < 1e-7 < off[-5] < 1e-2
