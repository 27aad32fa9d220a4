"""Coupling methods between linear participants, against closed forms and published figures."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from cosim.coupling.methods.companion import Companion
from cosim.coupling.methods.gauss_seidel import GaussSeidel
from cosim.coupling.methods.jacobi import Jacobi
from cosim.coupling.participants.linear import LinearParticipant, coil
from cosim.coupling.rewind.joint import Joint
from cosim.coupling.rewind.methods import Acceleration, Iterated
from cosim.coupling.rewind.stability import largest_stable_step, observed_limit

pytestmark = pytest.mark.physics

HALVINGS = (100, 200, 400, 800, 1600)


def oscillator() -> tuple[LinearParticipant, LinearParticipant]:
    """Two unit masses on springs 4π² to the walls and 16π² between them, one displaced: the
    partitioned oscillator of preCICE's tutorials (Schüller, Rodenberg, Uekermann, Bungartz, "A
    simple test case for convergence order in time and energy conservation of black-box coupling
    schemes", WCCM-APCOM 2022). Each takes the other's displacement."""
    wall, between = 4.0 * np.pi**2, 16.0 * np.pi**2

    def mass(displacement: float) -> LinearParticipant:
        return LinearParticipant(
            [[0.0, 1.0], [-(wall + between), 0.0]],
            [[0.0], [between]],
            [[1.0, 0.0]],
            state=[displacement, 0.0],
        )

    return mass(1.0), mass(0.0)


def oscillator_exactly(t: float) -> np.ndarray:
    """Displacements in closed form: the symmetric mode at 2π rad/s, the other at 6π rad/s."""
    symmetric, other = np.cos(2.0 * np.pi * t), np.cos(6.0 * np.pi * t)
    return 0.5 * np.array([symmetric + other, symmetric - other])


def slopes(errors: list[float]) -> list[float]:
    return [float(np.log2(a / b)) for a, b in pairwise(errors)]


@pytest.mark.parametrize("method", [Jacobi, GaussSeidel])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_order_on_the_oscillator(method: Any, order: int) -> None:
    """The greatest error over time: T = 1 is a turning point, where it vanishes in first order."""
    errors = []
    for n in HALVINGS:
        m = Joint(*oscillator(), method(order, slopes=False))
        worst = 0.0
        for _ in range(n):
            m.step(1.0 / n)
            found = np.concatenate([m.past.current.value, m.past.emf.value])
            worst = max(worst, float(np.abs(found - oscillator_exactly(m.time)).max()))
        errors.append(worst)
    assert slopes(errors) == pytest.approx([order + 1.0] * 4, abs=0.1)


def two_masses() -> tuple[LinearParticipant, LinearParticipant]:
    """m = c1 = c2 = d1 = 1, d2 = 2, coupled by a spring and a damper of 100 that the second mass
    owns: it takes the first one's motion and gives the force, which has direct feedthrough."""
    c1, c2, d1, d2, stiffness, damping = 1.0, 1.0, 1.0, 2.0, 100.0, 100.0
    first = LinearParticipant([[0.0, 1.0], [-c1, -d1]], [[0.0], [1.0]], np.eye(2), state=[1.0, 0.0])
    second = LinearParticipant(
        [[0.0, 1.0], [-(c2 + stiffness), -(d2 + damping)]],
        [[0.0, 0.0], [stiffness, damping]],
        [[stiffness, damping]],
        [[-stiffness, -damping]],
        state=[0.0, 0.0],
    )
    return first, second


class Stale(Joint):
    """Outputs are left as the last step ended."""

    def meet(self) -> None:
        self.past.met(self.time, *self.first.outputs(), *self.second.outputs())


@pytest.mark.parametrize(("refreshed", "limit"), [(True, 0.0128), (False, 0.871)])
def test_the_order_of_calls_decides_over_stability(refreshed: bool, limit: float) -> None:
    """Outputs calculated after the inputs were set, or left as the last step ended: a factor 68."""

    def make() -> Joint:
        return (Joint if refreshed else Stale)(*two_masses(), Jacobi(0))

    predicted = largest_stable_step(make, limit / 4, 2.0 * limit)
    assert predicted == pytest.approx(limit, rel=2e-3)
    assert observed_limit(make, limit / 4, 2.0 * limit) == pytest.approx(predicted, rel=0.05)


def direct_drive() -> tuple[LinearParticipant, LinearParticipant]:
    """A loudspeaker's driver (Bl 4.38 N/A) on a voltage that stands still, with a current in it."""
    mass, compliance, damping, bl = 4.33e-3, 1.07e-3, 0.474, 4.38
    ram = LinearParticipant(
        [[0.0, 1.0], [-1.0 / compliance / mass, -damping / mass]], [[0.0], [bl / mass]], [[0.0, bl]]
    )
    return coil(4.3, 0.83e-3, 1.0), ram


def largest(make: Callable[[], Joint], high: float = 0.1) -> float:
    return largest_stable_step(make, 1e-4, high, leap=1.3)


def test_the_companion_takes_ten_times_the_step_of_gauss_seidel() -> None:
    explicit = largest(lambda: Joint(*direct_drive(), GaussSeidel(1, slopes=False)))
    assert 2e-4 < explicit < 5e-3
    assert largest(lambda: Joint(*direct_drive(), Companion())) >= 10.0 * explicit
    observed = observed_limit(lambda: Joint(*direct_drive(), Companion()), 1e-3, 12.0 * explicit)
    assert observed >= 10.0 * explicit


def test_an_accelerated_iteration_has_no_limit_and_a_plain_one_has() -> None:
    plain = largest(lambda: Iterated(*direct_drive(), "plain"))
    gauss_seidel = largest(lambda: Joint(*direct_drive(), GaussSeidel(0)))
    assert plain < 2.0 * gauss_seidel
    accelerations: tuple[Acceleration, ...] = ("Aitken", "Anderson", "Newton")
    for acceleration in accelerations:

        def accelerated(by: Acceleration = acceleration) -> Joint:
            return Iterated(*direct_drive(), by)

        assert largest(accelerated, 0.02) == 0.02


def test_a_heavy_ram_leaves_jacobi_and_gauss_seidel_their_rule_of_thumb() -> None:
    """Without springs and inductance de/dt = (Bl²/m) i and i = -e/R. With τ = m R/Bl² holding is
    e_n+1 = e_n - H/τ e_n for Gauss-Seidel, stable to 2 τ, and e_n+1 = e_n - H/τ e_n-1 for Jacobi,
    stable to τ."""
    mass, bl, resistance = 0.01, 3.0, 5.0
    tau = mass * resistance / bl**2

    def pair() -> tuple[LinearParticipant, LinearParticipant]:
        ram = LinearParticipant([[0.0]], [[bl / mass]], [[bl]])
        return coil(resistance, 1e-9, 1.0), ram

    jacobi = largest_stable_step(lambda: Stale(*pair(), Jacobi(0)), tau / 5, 4 * tau)
    assert jacobi == pytest.approx(tau, rel=2e-3)
    gauss_seidel = largest_stable_step(lambda: Joint(*pair(), GaussSeidel(0)), tau / 5, 4 * tau)
    assert gauss_seidel == pytest.approx(2.0 * tau, rel=2e-3)
