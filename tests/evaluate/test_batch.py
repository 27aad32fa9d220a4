"""Many runs led at once by threads: their numbers are those of single runs, to the last bit."""

import random
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from cosim.errors import CosimError
from cosim.evaluate.many import each, threads
from cosim.mechanics import pace
from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate, summary
from cosim.toolchain.threads import Progress

Summary = dict[str, Any]
SHORT: dict[str, Any] = {"run.duration": 0.15, "run.settle": 0.05, "run.output_step": 0.05}
KNOBS = {
    "drive.frequency": (15.0, 80.0),
    "drive.amplitude": (4.0, 7.0),
    "drive.offset": (-1.5, 0.0),
}
SHAPES: list[dict[str, Any]] = [
    {},
    {"mechanics.contact": "rigid"},
    {"run.shutter": 0.5},
    {"drive.quantised": True},
    {"drive.waveform": "sine"},
    {"drive.waveform": "square", "coil.eddy_inductance": 1e-3, "coil.eddy_resistance": 5.0},
    {"drive.reset_time": 1e-3, "friction.normal_force_file": "grip.csv"},
    {"drive.phase_deg": 70.0, "mechanics.n_surfaces": 2},
    {"mechanics.actuator": "direct"},
    # More straights than are prepared, and more frames than are planned at a time.
    {"drive.quantised": True, "run.duration": 0.5, "run.shutter": 0.9},
]


@pytest.mark.parametrize("model", ["limited", "ideal"])
def test_equal_to_single_runs(model: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("grip.csv").write_text("time [s],normal_force [N]\n0,0.5\n0.06,0.7\n0.06,0.4\n1,0.6\n")
    dice = random.Random(model)
    scenes = []
    for shape in SHAPES * 2:
        knobs = {key: dice.uniform(*ends) for key, ends in KNOBS.items()}
        scenes.append(load("reference", {"circuit.model": model, **SHORT, **knobs, **shape}))
    scenes.append(load("direct-drive", {**SHORT, "circuit.model": "none"}))
    scenes += [load("optimal", {**SHORT, "friction.mu_s": 0.8 + 0.02 * k}) for k in range(9)]
    check(scenes)


def check(scenes: list[Scene]) -> None:
    found = at_once([lambda scene=scene: scene for scene in scenes], 3)
    assert sorted(found) == list(range(len(scenes)))
    for number, scene in enumerate(scenes):
        assert repeatable(found[number]) == repeatable(simulate(scene).summary), scene


def at_once(making: list[Callable[[], Scene]], count: int) -> dict[int, Any]:
    with threads(making, count) as pool:
        return dict(each(pool, made, range(len(making))))


def made(making: list[Callable[[], Scene]], number: int, progress: Progress) -> Summary:
    return summary(making[number](), progress)


def repeatable(summary: Summary | Exception) -> Summary:
    assert isinstance(summary, dict), summary
    return {key: summary[key] for key in summary if key not in ("wall_time", "notes", "rests")}


def test_failures_are_those_of_single_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mechanics that give up, that are too fast, and scenes that cannot be; one good one."""
    monkeypatch.setattr(pace, "ENOUGH", 3e4)
    monkeypatch.setattr(pace, "ORDINARY", 1e4)
    monkeypatch.setattr(pace, "BUDGET", 1e6)
    scene = load("reference", {"circuit.model": "ideal", **SHORT})
    changes: list[dict[str, Any]] = [
        {"mechanics.suspension_k2": 1e15, "mechanics.travel": 1.0, "drive.amplitude": 100.0},
        {"mechanics.contact_damping": 1e6, "drive.offset": 6.0, "run.duration": 100.0},
        {"friction.mu_k": 0.9},
        {"friction.normal_force_file": "nowhere.csv"},
        {},
    ]
    making = [partial(load, scene, change) for change in changes]
    found = at_once([*making], 2)
    said = []
    for number, make in enumerate(making[:-1]):
        with pytest.raises(CosimError) as single:
            simulate(make())
        assert type(found[number]) is single.type and str(found[number]) == str(single.value)
        said.append(str(single.value))
    assert isinstance(found[4], dict)
    assert len(set(said)) == 4, said


def test_what_runs_is_stopped() -> None:
    """A run that would take hours ends with the `with` block, and so when Ctrl-C leaves it."""
    endless = {"circuit.model": "ideal", "run.duration": 1e5, "run.output_step": 1e3}
    making = [partial(load, "reference", changes) for changes in (endless, endless | SHORT)]
    with threads(making, 2) as pool:
        number, numbers = next(each(pool, made, range(2)))
        assert number == 1 and isinstance(numbers, dict)
