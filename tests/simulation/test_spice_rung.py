"""The rung "amplifier" with the mechanics locked, against its defining equations solved apart.

    dv_a/dt = clip(2π GBW (V1 - R_s i) - 2π GBW v_a / A_ol, ±slew),  v_a held within the swing
    L di/dt + (R_c + R_s) i = v_a

for n coils in parallel with L / n and R_c / n. The solver below is restarted at every jump of the
command and whenever v_a meets or leaves a limit.
"""

from dataclasses import dataclass
from math import ceil, pi

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import solve_ivp

from cosim.scene import Scene, load
from cosim.simulation.simulate import simulate

pytestmark = pytest.mark.physics

Array = npt.NDArray[np.float64]

LOCKED = [
    "mechanics.ram_mass=1000", "mechanics.surface_mass=1000", "mechanics.gravity=0",
    "coil.force_factor=1e-6",
]  # fmt: skip
FINE = ["circuit.max_step=2e-7", "circuit.reltol=1e-7", "run.output_step=2e-6"]
FLYBACKS = ["drive.frequency=250", "run.duration=0.01", "run.settle=0.004"]


@dataclass
class Solution:
    """Total current (A), output (V) and whether it is at a limit, at the times asked for."""

    current: Array
    output: Array
    limited: Array


def solve(scene: Scene, times: Array) -> Solution:
    """The equations above with a sawtooth command, from rest."""
    circuit, coil, drive = scene.circuit, scene.coil, scene.drive
    rate = 2 * pi * circuit.gain_bandwidth
    leak = rate / 10 ** (circuit.open_loop_gain / 20)
    inductance = coil.inductance / coil.count
    resistance = coil.resistance / coil.count + circuit.sense_resistance
    high = circuit.supply - circuit.swing_loss_high
    low = circuit.swing_loss_low - circuit.supply
    period = 1 / drive.frequency
    found = Solution(*(np.zeros(len(times)) for _ in range(3)))
    v, i = 0.0, 0.0
    for n in range(ceil(scene.run.duration * drive.frequency)):
        begin, end = n * period, (n + 1) * period

        def asked(t: float, v: float, i: float, begin: float = begin) -> float:
            ramp = drive.offset + drive.amplitude * ((t - begin) / period - 0.5)
            wanted = rate * (ramp - circuit.sense_resistance * i) - leak * v
            return min(max(wanted, -circuit.slew_rate), circuit.slew_rate)

        t = begin
        limit = high if asked(t, v, i) > 0 else low
        held = abs(v - limit) < 1e-7
        while t < end - 1e-12:

            def slopes(t: float, y: Array, held: bool = held) -> list[float]:
                v, i = y
                return [0.0 if held else asked(t, v, i), (v - resistance * i) / inductance]

            def turns(t: float, y: Array) -> float:
                return asked(t, *y)

            def meets_high(t: float, y: Array) -> float:
                return y[0] - high

            def meets_low(t: float, y: Array) -> float:
                return y[0] - low

            events = [turns] if held else [meets_high, meets_low]
            for event, direction in zip(events, [0] if held else [1, -1], strict=True):
                event.terminal = True  # type: ignore[attr-defined]
                event.direction = direction  # type: ignore[attr-defined]
            part = solve_ivp(
                slopes, (t, end), [v, i], "DOP853", rtol=1e-9, atol=1e-10, max_step=2e-6,
                events=events, dense_output=True,
            )  # fmt: skip
            inside = (times > t) & (times <= part.t[-1])
            if inside.any():
                found.output[inside], found.current[inside] = part.sol(times[inside])
                found.limited[inside] = held
            t, (v, i) = float(part.t[-1]), map(float, part.y[:, -1])
            if part.status == 0:  # no event
                break
            held = not held
            # Just inside, or it would meet the limit once more at once.
            limit = high if v > 0 else low
            v = limit if held else limit * (1 - 1e-9)
    return found


@pytest.mark.parametrize(
    "changes",
    [
        [],
        ["coil.count=2", "drive.amplitude=10", "drive.offset=-2.5"],
        ["circuit.gain_bandwidth=3e4", "circuit.slew_rate=5e4"],
        pytest.param(
            ["circuit.swing_loss_high=9", "circuit.swing_loss_low=2", "coil.inductance=3e-3"],
            marks=pytest.mark.slow,
        ),
        pytest.param(["circuit.open_loop_gain=40"], marks=pytest.mark.slow),
    ],
    ids=["reference", "two-coils", "slewing", "lopsided", "little-gain"],
)
def test_current_and_output(changes: list[str]) -> None:
    scene = load("reference", LOCKED + FINE + FLYBACKS + changes)
    result = simulate(scene)
    waves = result.columns
    expected = solve(scene, waves["time"])
    coil, circuit = scene.coil, scene.circuit
    reach = scene.drive.amplitude / circuit.sense_resistance
    current = waves["current"] * coil.count
    np.testing.assert_allclose(current / reach, expected.current / reach, rtol=0, atol=2e-3)
    output = waves["coil_voltage"] + circuit.sense_resistance * current
    # Beside a limit the output changes by volts within a microsecond.
    off = np.abs(output - expected.output)
    assert np.sqrt(np.mean(off**2)) < 0.05
    assert np.quantile(off, 0.98) < 0.1
    after = waves["time"] > scene.run.settle
    share = expected.limited[after].mean()
    assert result.summary["saturated_fraction"] == pytest.approx(share, abs=2e-3)


def test_the_paper_rig_saturates_and_rings() -> None:
    """What the comparison above is about: a clamped flyback, then the loop's own oscillation."""
    scene = load("reference", LOCKED + FINE + FLYBACKS)
    waves = simulate(scene).columns
    time, current = waves["time"], waves["current"]
    output = waves["coil_voltage"] + scene.circuit.sense_resistance * current
    fall = (time > 0.00401) & (time < 0.00408)
    np.testing.assert_allclose(output[fall], -14.0, atol=1e-3)
    # With the output clamped the current decays towards -14 V / 11.1 Ω with L / R.
    ends = np.flatnonzero(fall)[[0, -1]]
    target, tau = -14.0 / 11.1, 1.2e-3 / 11.1
    decay = np.exp(-(time[ends[1]] - time[ends[0]]) / tau)
    assert current[ends[1]] - target == pytest.approx((current[ends[0]] - target) * decay, rel=1e-3)
    # Back in its range: about sqrt(2π GBW R_s / L) / 2π = 23 kHz, damped by R / 2L.
    late = (time > 0.0045) & (time < 0.005)
    ringing = current[late] - np.polyval(np.polyfit(time[late], current[late], 2), time[late])
    crossings = np.count_nonzero(np.diff(np.sign(ringing)))
    assert crossings / (2 * 5e-4) == pytest.approx(23.0e3, rel=0.1)


@pytest.mark.parametrize("model", ["amplifier", "ideal"])
@pytest.mark.parametrize("bl", ["coil.b1=0", "coil.b1=100"])
def test_coil_voltage_is_that_of_the_coil(model: str, bl: str) -> None:
    """∫ v dt = R ∫ i dt + L Δi + ∫ e dt, with the mechanics moving, between the command's jumps."""
    changes = ["run.duration=0.045", "run.output_step=1e-6"]
    if model == "amplifier":
        changes.append("circuit.max_step=1e-6")
    scene = load("reference", [f"circuit.model={model}", bl, *changes])
    waves = simulate(scene).columns
    rows = waves["time"] >= 1e-3
    time, voltage, current, emf = (
        waves[name][rows] for name in ("time", "coil_voltage", "current", "back_emf")
    )

    def flux(values: Array) -> Array:
        steps = np.diff(time) * (values[1:] + values[:-1]) / 2
        return np.concatenate([[0.0], np.cumsum(steps)])

    coil = scene.coil
    expected = flux(coil.resistance * current + emf) + coil.inductance * (current - current[0])
    assert np.ptp(flux(emf)) > 1e-4  # V s; the back-EMF counts
    np.testing.assert_allclose(flux(voltage), expected, rtol=0, atol=2e-6)
