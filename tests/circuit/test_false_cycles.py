"""A false limit cycle is reported, and nothing else is.

The behavioural amplifier as it is does not fall into one. It does with the trapezoidal rule, which
is ngspice's default, a fast op-amp, ngspice's default tolerance and its own choice of steps after a
jump of the command: of 48 such circuits the ten
that swing most must be reported. At the bench's own tolerance none is, with either rule.
"""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from cosim.circuit.false_cycles import BURST, burst_ends, swings
from cosim.circuit.joined import Deck
from cosim.coupling.loop import lead
from cosim.errors import SimulationFailed
from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate

pytestmark = pytest.mark.reliability

DRIVES = [(50.8, 9.0, -1.2), (90.0, 10.5, 0.0), (70.0, 10.0, -0.5), (35.0, 10.5, 0.5)]
CASES = list(itertools.product([7e6, 1e7, 1.3e7, 1.7e7], DRIVES, [1.2e-3, 6e-4, 2.4e-3]))
# Gain-bandwidth (Hz), drive, inductance (H): the ten with the most swings at reltol = 1e-3.
WORST = [
    (1e7, DRIVES[1], 6e-4),
    (1e7, DRIVES[1], 1.2e-3),
    (1e7, DRIVES[1], 2.4e-3),
    (1.3e7, DRIVES[1], 6e-4),
    (7e6, DRIVES[1], 6e-4),
    (7e6, DRIVES[1], 1.2e-3),
    (1e7, DRIVES[2], 1.2e-3),
    (1e7, DRIVES[2], 6e-4),
    (1.3e7, DRIVES[1], 1.2e-3),
    (1.7e7, DRIVES[1], 1.2e-3),
]


def scene(case: tuple, reltol: float) -> Scene:
    bandwidth, (frequency, amplitude, offset), inductance = case
    return load(
        "reference",
        [
            f"circuit.gain_bandwidth={bandwidth}",
            "circuit.slew_rate=1e9",
            f"circuit.reltol={reltol}",
            "circuit.max_step=1e-5",
            f"drive.frequency={frequency}",
            f"drive.amplitude={amplitude}",
            f"drive.offset={offset}",
            f"coil.inductance={inductance}",
            "run.duration=0.03",
            "run.output_step=1e-4",
        ],
    )


@pytest.fixture
def trapezoidal(monkeypatch: pytest.MonkeyPatch) -> None:
    original = lead.prepare

    def prepare(scene: Scene) -> Deck:
        made = original(scene)
        assert "method=gear" in made.text
        return replace(made, text=made.text.replace("method=gear", "method=trap"))

    begin = lead.Lead.begin

    def begin_freely(self: lead.Lead) -> None:
        self.state.time_constant = 1e9
        begin(self)

    monkeypatch.setattr(lead, "prepare", prepare)
    monkeypatch.setattr(lead.Lead, "begin", begin_freely)


def reported(case: tuple, reltol: float) -> bool:
    try:
        simulate(scene(case, reltol))
    except SimulationFailed as failure:
        assert "false limit cycle" in str(failure) and "circuit.reltol" in str(failure)
        return True
    return False


@pytest.mark.usefixtures("trapezoidal", "in_place")
def test_worst_cases_are_reported() -> None:
    assert sum(reported(case, 1e-3) for case in WORST) >= 9


@pytest.mark.usefixtures("trapezoidal")
def test_fine_steps_are_not_reported() -> None:
    assert not any(reported(case, 1e-5) for case in CASES)


@pytest.mark.parametrize("reltol", [1e-4, 1e-5])
def test_circuit_as_it_is_is_not_reported(reltol: float) -> None:
    assert not any(reported(case, reltol) for case in CASES)


def test_bursts() -> None:
    even = np.arange(BURST) * 1e-4
    assert burst_ends(even) == pytest.approx(even[-1])
    assert burst_ends(even[1:]) is None
    assert burst_ends(even * 100) is None
    late = np.concatenate([np.arange(5) * 0.02, 0.2 + even])
    assert burst_ends(late) == pytest.approx(late[-1])


def test_swings_are_counted_from_end_to_end() -> None:
    time = np.linspace(0, 1, 10_001)
    log = {"time": time, "v(out)": 14 * np.sin(2 * np.pi * 10 * time)}
    assert len(swings(log)) == 19
    # Ripple at one end is no swing.
    log["v(out)"] = 14 * np.sign(np.sin(2 * np.pi * 10 * time)) + np.sin(2 * np.pi * 500 * time)
    assert len(swings(log)) in (19, 20)
