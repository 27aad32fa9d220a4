"""The source of the rung "limited" with the mechanics locked, against closed forms.

With the ram locked there is no back-EMF: behind an output at its limit the current is that of
resistances and inductances on a constant voltage, exponentials that anyone can write down. Where no
limit acts, the rung is "ideal".
"""

from collections.abc import Callable
from math import exp
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.waveforms.result import Result

pytestmark = pytest.mark.physics

Array = npt.NDArray[np.float64]

LOCKED = [
    "mechanics.ram_mass=1000", "mechanics.surface_mass=1000", "mechanics.gravity=0",
    "coil.force_factor=1e-6", "mechanics.tolerance=1e-13",
]  # fmt: skip
FINE = ["run.duration=0.004", "run.settle=0.001", "run.output_step=2e-6"]
R, R_SENSE, L, HIGH, LOW = 7.1, 4.0, 1.2e-3, 14.0, -14.0  # Ohm, Ohm, H, V, V
EXACT = {"rtol": 0, "atol": 1e-11}  # A


def root(function: Callable[[float], float], most: float) -> float:
    found: Any = brentq(function, 0.0, most, xtol=1e-16)
    return found


def locked(*changes: str) -> Result:
    return simulate(load("reference", ["circuit.model=limited", *LOCKED, *FINE, *changes]))


def test_step_into_a_clamped_output() -> None:
    """A square wave that asks for more than the output can give: two exponentials for ever."""
    result = locked("drive.waveform=square", "drive.frequency=500", "drive.amplitude=12",
                    "drive.offset=0.2")  # fmt: skip
    time, current = result.columns["time"], result.columns["current"]
    tau, expected, start = L / (R + R_SENSE), np.zeros(len(time)), 0.0
    for half in range(5):
        end = (HIGH if half % 2 == 0 else LOW) / (R + R_SENSE)
        since = time - half * 1e-3
        inside = since >= 0.0
        expected[inside] = end + (start - end) * np.exp(-since[inside] / tau)
        start = end + (start - end) * exp(-1e-3 / tau)
    np.testing.assert_allclose(current, expected, **EXACT)
    assert result.summary["saturated_fraction"] == pytest.approx(1.0, abs=1e-9)
    assert result.summary["current_max"] == pytest.approx(expected.max(), abs=1e-9)
    # Across the coil lies what the sense resistor leaves of the output.
    inside = time % 1e-3 > 1e-6
    output = np.where(time % 2e-3 < 1e-3, HIGH, LOW)[inside]
    np.testing.assert_allclose(
        result.columns["coil_voltage"][inside], output - R_SENSE * current[inside], atol=1e-9
    )


@pytest.mark.parametrize("count", [1, 3])
def test_the_current_meets_the_command_after_its_fall(count: int) -> None:
    """A sawtooth: after each fall one exponential until the ramp, then the ramp itself."""
    frequency, amplitude = 250.0, 4.0 * count
    result = locked(
        f"coil.count={count}", f"drive.frequency={frequency}", f"drive.amplitude={amplitude}",
        "drive.offset=0.5", "run.duration=0.016", "circuit.current_limit=10",
    )  # fmt: skip
    time, current = result.columns["time"], result.columns["current"]
    loop, period = R + count * R_SENSE, 1.0 / frequency
    tau, end = L / loop, LOW / loop

    def ramp(t: float) -> float:
        return (0.5 + amplitude * (t / period - 0.5)) / (R_SENSE * count)

    def clamped(t: float) -> float:
        return end + (start - end) * exp(-t / tau)

    expected, spent = np.zeros(len(time)), 0.0
    for n in range(4):
        start = ramp(period) if n else 0.0
        met = root(lambda t: clamped(t) - ramp(t), period)
        spent += met
        for row in np.flatnonzero((time >= n * period - 1e-12) & (time < (n + 1) * period - 1e-12)):
            t = time[row] - n * period
            expected[row] = clamped(t) if t < met else ramp(t)
    expected[-1] = ramp(period)
    np.testing.assert_allclose(current, expected, **EXACT)
    limited = result.summary["swing_low_fraction"]
    # run.settle = 1 ms lies behind the first meeting.
    first = root(lambda t: end * (1 - exp(-t / tau)) - ramp(t), period)
    assert limited == pytest.approx((spent - first) / 0.015, rel=1e-8)
    assert result.summary["swing_high_fraction"] == 0.0


def test_eddy_branch_behind_a_clamped_output() -> None:
    """Coil current and eddy current against the matrix exponential."""
    eddy_l, eddy_r = 1.46e-3, 3.83
    result = locked(
        f"coil.eddy_inductance={eddy_l}", f"coil.eddy_resistance={eddy_r}", "drive.offset=13",
        "drive.waveform=square", "drive.frequency=10", "drive.amplitude=0",
        "circuit.current_limit=9",
    )  # fmt: skip
    rates = np.zeros((3, 3))  # of coil current, eddy current, and 1
    rates[0] = [-(R + R_SENSE + eddy_r) / L, eddy_r / L, HIGH / L]
    rates[1] = [eddy_r / eddy_l, -eddy_r / eddy_l, 0.0]
    time, current = result.columns["time"], result.columns["current"]
    some = slice(None, None, 50)
    expected = np.array([expm(rates * t)[:, 2] for t in time[some]])
    np.testing.assert_allclose(current[some], expected[:, 0], **EXACT)
    energy = 0.5 * (L * expected[-1, 0] ** 2 + eddy_l * expected[-1, 1] ** 2)
    summary: Any = result.summary
    assert summary["energy_residual"] < 1e-9
    stored = summary["energy_in"] - summary["energy_copper"]
    assert stored == pytest.approx(energy, rel=1e-7)


@pytest.mark.parametrize("count", [1, 2])
def test_current_limit_cuts_the_command(count: int) -> None:
    """A triangle without jumps, with voltage to spare: the command, cut."""
    limit = 1.5
    result = locked(
        "circuit.supply=60", f"circuit.current_limit={limit}", f"coil.count={count}",
        "drive.frequency=250", "drive.reset_time=0.002", "drive.amplitude=20", "drive.offset=0",
        "run.duration=0.012", "run.settle=0.004",
    )  # fmt: skip
    time, current = result.columns["time"], result.columns["current"]
    asked = result.columns["command"] / R_SENSE
    settled = time > 0.001
    expected = np.clip(asked, -limit, limit)[settled] / count
    np.testing.assert_allclose(current[settled], expected, **EXACT)
    assert result.summary["current_limit_fraction"] == pytest.approx(1 - limit / 2.5, abs=1e-9)
    assert result.summary["saturated_fraction"] == result.summary["current_limit_fraction"]
    assert result.summary["current_max"] == pytest.approx(limit / count, rel=1e-12)
    assert result.summary["energy_residual"] < 1e-9  # type: ignore


def test_time_at_the_limit_of_an_overdriven_ramp() -> None:
    """A slow ramp that asks for more than 14 V: at the limit from there to the meeting behind its
    fall, but for the corner that the inductance rounds."""
    result = locked(
        "drive.frequency=2", "drive.amplitude=8", "drive.offset=3", "run.duration=1.0",
        "run.settle=0.5", "run.output_step=1e-3", "circuit.current_limit=10",
    )  # fmt: skip
    period, tau = 0.5, L / (R + R_SENSE)
    slope = 8.0 / period / R_SENSE
    reached = (HIGH - L * slope) / (R + R_SENSE)  # where the ramp's voltage is 14 V
    above = period * (1 - (R_SENSE * reached + 1.0) / 8.0)
    most = reached + slope * tau * (1 - exp(-above / tau))  # = 14 V / 11.1 Ω
    end = LOW / (R + R_SENSE)  # the current falls towards it until it meets the next ramp
    met = root(lambda t: end + (most - end) * exp(-t / tau) - (-1.0 + 16.0 * t) / R_SENSE, 0.01)
    assert most == pytest.approx(HIGH / (R + R_SENSE), rel=1e-9)
    assert result.summary["swing_high_fraction"] == pytest.approx(above / period, rel=1e-9)
    assert result.summary["swing_low_fraction"] == pytest.approx(met / period, rel=1e-7)
    assert result.summary["current_max"] == pytest.approx(most, rel=1e-12)


# --- the limit of no limits --------------------------------------------------------------

SHORT = ["run.duration=0.3", "run.settle=0.1"]
# A triangle from 0 V, so that the current of the ideal rung does not jump either.
SMOOTH = [*SHORT, "drive.reset_time=0.02", "drive.amplitude=10", "drive.offset=5"]
ABLE = "circuit.current_limit=100"


@pytest.mark.parametrize("contact", ["compliant", "rigid"])
def test_without_limits_it_is_the_ideal_source(contact: str) -> None:
    common = [*SMOOTH, f"mechanics.contact={contact}", "coil.b1=50"]
    ideal = simulate(load("reference", ["circuit.model=ideal", *common]))
    limited = simulate(
        load("reference", ["circuit.model=limited", "circuit.supply=900", ABLE, *common])
    )
    phase = ideal.columns["time"] * 20.0 % 1.0
    off_corners = np.minimum(phase % 0.6, 1.0 - phase) > 1e-9
    assert limited.summary["saturated_fraction"] == 0.0
    assert ideal.summary["impacts"] > 2  # type: ignore
    for name, column in ideal.columns.items():
        # At its corners the ideal voltage jumps, and a row may hold either side.
        at = off_corners if name == "coil_voltage" else slice(None)
        scale = max(float(np.abs(column).max()), 1e-12)
        allowed = 1e-9 if name not in ("a_surface", "friction_force") else 1e-7
        np.testing.assert_allclose(
            limited.columns[name][at] / scale, column[at] / scale, 0, allowed, err_msg=name
        )
    for name in ("v_average", "energy_in", "energy_copper", "energy_stored", "current_max"):
        assert limited.summary[name] == pytest.approx(ideal.summary[name], rel=1e-8), name


def test_it_nears_the_ideal_source_as_the_supply_grows() -> None:
    """With jumps the current needs L Δi / V: the difference falls as one over the supply."""
    ideal = simulate(load("reference", ["circuit.model=ideal", *SHORT])).summary["v_average"]
    off = []
    for supply in (104.0, 204.0, 404.0, 804.0):
        changes = [f"circuit.supply={supply}", ABLE, *SHORT]
        found = simulate(load("reference", ["circuit.model=limited", *changes])).summary[
            "v_average"
        ]
        off.append(abs(found - ideal))  # type: ignore
    assert off[-1] < 2e-3 * abs(ideal)  # type: ignore
    np.testing.assert_allclose(np.divide(off[:-1], off[1:]), 2.0, rtol=0.1)
