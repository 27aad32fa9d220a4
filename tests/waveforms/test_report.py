"""The printed table says what a reader must know of the numbers."""

import pytest

from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.waveforms.report import table

SHORT = ["run.duration=0.1", "run.settle=0.05"]


@pytest.mark.parametrize(
    "overrides, told",
    [
        (SHORT, None),
        (["run.duration=0.1", "run.settle=0.033"], "over 1.34 periods"),
        ([*SHORT, "drive.frequency=50.8"], "over 2.54 periods"),
    ],
)
def test_broken_periods_are_told(overrides: list[str], told: str | None) -> None:
    scene = load("ideal-current", overrides)
    text = table(scene, simulate(scene).summary)
    assert ("periods" in text) == (told is not None)
    assert told is None or told in text


def test_a_large_energy_residual_is_told() -> None:
    scene = load("ideal-current", SHORT)
    summary = dict(simulate(scene).summary)
    assert "too much" not in table(scene, summary)
    assert "too much" in table(scene, summary | {"energy_residual": 0.02})


def test_rigid_walls_have_no_peak_and_rest_no_sign() -> None:
    rigid = load("ideal-current", [*SHORT, "mechanics.contact=rigid"])
    assert "without bound" in table(rigid, simulate(rigid).summary)
    held = load("held", SHORT)
    lines = table(held, simulate(held).summary).splitlines()
    assert any(line.split() == ["surface", "velocity", "0", "…", "0", "mm/s"] for line in lines)
