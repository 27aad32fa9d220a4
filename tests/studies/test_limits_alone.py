"""Rows of results/limits.csv, drawn blind, by SUNDIALS for all equations at once."""

import csv
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.coupling.loop.agenda import exposures
from cosim.mechanics.stickslip import numbers_of, rests_of
from cosim.scene import Scene, load
from cosim.simulation.checks import motion
from cosim.simulation.simulate import summary
from cosim.trials.camera import FRAME_RATE
from tests.reference.monolithic import simulate as monolithic
from tests.reference.parameters import reference_parameters

pytestmark = [pytest.mark.physics, pytest.mark.slow, pytest.mark.timeout(3600)]

TABLE = Path(__file__).parents[2] / "results" / "limits.csv"
ROWS, SEED = 20, 20261125


def scene_of(row: dict[str, str]) -> Scene:
    words = shlex.split(row["command"])
    assert words[:2] == ["cosim", "run"]
    return load(words[2], [word for word in words[3:] if word != "--set"])


def drawn() -> Iterator[tuple[dict[str, str], Scene]]:
    """Rows in random order whose motion is regular and that the other solver knows: rising
    sawtooth and sine without steps, no schematic, a current that stays below its limit, and a ram
    that does not hang in a wall."""
    with TABLE.open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["command"]]
    for number in np.random.default_rng(SEED).permutation(len(rows)):
        scene = scene_of(rows[number])
        drive = scene.drive
        if drive.waveform not in ("sawtooth", "sine") or drive.reset_time or drive.quantised:
            continue
        if min(map(abs, rests_of(numbers_of(scene)))) > scene.mechanics.travel:
            continue
        if scene.circuit.model == "full" or motion(scene, lambda _: None)["motion"] != "regular":
            continue
        if scene.circuit.model == "limited" and summary(scene)["current_limit_fraction"]:
            continue
        yield rows[number], scene


def test_rows_drawn_blind_are_what_another_solver_finds() -> None:
    """The camera's reading, too: parabolas through five frames. With ngspice the mean velocity is
    as near as the run itself tells."""
    from scipy.signal import savgol_filter  # takes a second, and only this test needs it

    rows = drawn()
    for _ in range(ROWS):
        row, scene = next(rows)
        run = scene.run
        assert run.shutter == 0.0
        found = monolithic(
            *(reference_parameters(scene), run.duration, run.settle),
            contact=scene.mechanics.contact,
            circuit=scene.circuit.model,
            tol=1e-8,
            times=exposures(run.duration, run.settle, run.shutter).tolist(),
        )
        heights = found.samples["z_surface"]
        seen = np.array(savgol_filter(heights, 5, 2, deriv=2, delta=1.0 / FRAME_RATE))
        told = cosim.run(scene).summary["v_average_error"] if scene.rung.ngspice else 0.0
        near = pytest.approx(found.v_average, rel=1e-3, abs=2.0 * told)
        assert 1e-3 * float(row["v_average [mm/s]"]) == near
        assert -float(row["a_camera [m/s²]"]) == pytest.approx(seen[2:-2].min(), rel=1e-3)
