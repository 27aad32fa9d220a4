"""The voice coil in the FMU loses and makes no energy, whatever Bl(q).

What the circuit sees, back-EMF times current, is at every instant the power of the force on the
ram. That force is taken from the ram's equation of motion alone (section 1 of the design): from
its acceleration and the other forces on it, not from Bl.
"""

from collections.abc import Iterator
from math import cos, pi

import numpy as np
import pytest

from tests.helpers.fmu_bench import COMPLIANT, RIGID, Bench

pytestmark = pytest.mark.physics

# A ram that reaches both walls at 40 Hz, its Bl asymmetric and halved 2 mm from the centre
COIL = {"force_factor": 0.6, "b1": 120.0, "b2": -1.2e5}
RAM = {
    "ram_mass": 0.004,
    "suspension_k1": 40.0,
    "suspension_k2": 3e4,
    "suspension_k3": 1.5e7,
    "suspension_damping": 0.02,
    "gravity": 9.81,
}
OUTPUTS = ("a_ram", "q", "q_rate", "wall_force", "back_emf", "back_emf_slope", "energy_in", "time")


def run(
    amplitude: float, contact: int, h: float, duration: float, version: int = 3
) -> Iterator[tuple[float, float, dict[str, float]]]:
    """Current (A), its slope (A/s) over the step to come, and the outputs before it."""

    def current(t: float) -> float:
        return amplitude * (1 - cos(2 * pi * 40 * t))

    names = OUTPUTS[:-1]
    with Bench(version, contact=contact, **COIL, **RAM) as bench:
        for k in range(round(duration / h)):
            start, end = current(k * h), current((k + 1) * h)
            bench.set(current=start, current_slope=(end - start) / h)
            yield start, (end - start) / h, dict(zip(names, bench.get(*names), strict=True))
            bench.step(h)


def coil_force(out: dict[str, float]) -> tuple[float, float]:
    """What the ram's equation of motion leaves for the coil, N, and the largest term in it."""
    q, speed = out["q"], out["q_rate"]
    k1, k2, k3 = (RAM[f"suspension_k{n}"] for n in (1, 2, 3))
    spring = -k1 * q - k2 * q**2 - k3 * q**3
    damper = -RAM["suspension_damping"] * speed
    mass = RAM["ram_mass"]
    terms = mass * out["a_ram"], mass * RAM["gravity"], -spring, -damper, -out["wall_force"]
    return sum(terms), max(abs(term) for term in terms)


@pytest.mark.parametrize("contact", [COMPLIANT, RIGID])
@pytest.mark.parametrize("version", [2, 3])
def test_electrical_power_is_mechanical_power(contact: int, version: int) -> None:
    walls, power, span = 0, 0.0, [0.0, 0.0]
    for current, _, out in run(0.6, contact, 5e-5, 0.25, version):
        force, largest = coil_force(out)
        speed = out["q_rate"]
        # a wall at rest is a state of its own: there the ram follows the surface
        rounding = 1e-14 * largest * abs(speed) + 1e-16
        assert out["back_emf"] * current == pytest.approx(force * speed, rel=1e-12, abs=rounding)
        walls += out["wall_force"] != 0.0
        power = max(power, abs(force * speed))
        span = [min(span[0], out["q"]), max(span[1], out["q"])]
    assert power > 0.05  # W
    assert span[1] - span[0] > 2e-3  # Bl(q) matters
    assert walls > 20 or contact == RIGID


def test_bl_is_what_was_asked_for() -> None:
    """The same force over the current gives Bl(q) = Bl (1 + b1 q + b2 q²)."""
    found = [
        (out["q"], coil_force(out)[0] / current)
        for current, _, out in run(0.6, COMPLIANT, 2e-4, 0.2)
        if current > 0.05 and out["wall_force"] == 0.0
    ]
    q, bl = np.array(found).T
    assert len(q) > 300 and np.ptp(q) > 2e-3
    np.testing.assert_allclose(bl, 0.6 * (1 + 120 * q - 1.2e5 * q**2), rtol=1e-11)


@pytest.mark.parametrize(
    ("amplitude", "h", "error"), [(0.05, 2e-5, 1e-9), (0.6, 2e-6, 1e-8)], ids=["free", "hits walls"]
)
def test_energy_in_is_the_integral_of_the_electrical_power(
    amplitude: float, h: float, error: float
) -> None:
    """Integrated from its values and slopes at the ends of each step (fourth order)."""
    total, throughput, before, at_start, counted, hits = 0.0, 0.0, None, 0.0, 0.0, 0
    for current, slope, out in run(amplitude, COMPLIANT, h, 0.1):
        power = out["back_emf"] * current
        rate = out["back_emf_slope"] * current + out["back_emf"] * slope
        if before is None:
            at_start = out["energy_in"]
        else:
            was, was_rate, was_slope = before
            end_rate = out["back_emf_slope"] * current + out["back_emf"] * was_slope
            part = h / 2 * (was + power) + h**2 / 12 * (was_rate - end_rate)
            total += part
            throughput += abs(part)
        before = power, rate, slope
        counted = out["energy_in"] - at_start
        hits += out["wall_force"] != 0.0
    assert throughput > 1e-5  # J
    assert (hits > 0) == (amplitude > 0.1)
    assert counted == pytest.approx(total, abs=error * throughput)
