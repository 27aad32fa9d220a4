"""At which accelerations of the surface a part slips: closed form, and as it is seen to happen."""

import numpy as np
import pytest

from cosim.mechanics.part import account, slip_budget
from cosim.mechanics.surface import Surface
from cosim.scene import load
from cosim.simulation.simulate import summary

MU_S, MU_K, MU_PLATE, FORCE, MASS, G = 0.72, 0.65, 0.229, 0.808, 0.009, 9.81


def test_budget_of_the_paper_s_rig() -> None:
    """(µ_s ± µ_plate) F_n/m_p -+ g; without a plate both ways are alike."""
    found = slip_budget(MU_S, FORCE / MASS, G, MU_PLATE)
    assert found["up"] == pytest.approx((-95.0, 34.27), abs=0.02)
    assert found["down"] == pytest.approx((-53.89, 75.4), abs=0.02)
    paper = slip_budget(MU_S, FORCE / MASS, G)
    assert paper["up"] == paper["down"] == pytest.approx((-74.45, 54.83), abs=0.01)


@pytest.mark.physics
@pytest.mark.parametrize(("way", "side"), [("up", 0), ("up", 1), ("down", 0), ("down", 1)])
def test_sticking_breaks_at_the_budget(way: str, side: int) -> None:
    """A surface that moves with 1 m/s and is then accelerated, ever more from run to run."""
    limit = slip_budget(MU_S, FORCE / MASS, G, MU_PLATE)[way][side]
    start = 1.0 if way == "up" else -1.0
    for share, sticks in ((0.999, True), (1.001, False)):
        # No further than to half of the velocity, so that the way stays.
        length = 0.5 / abs(limit)
        knots = np.array([0.0, 0.01, 0.01 + length])
        surface = Surface(knots, np.array([start, start, start + share * limit * length]))
        seen = account(
            surface, knots[1:] + np.array([1e-9, 0.0]), mu_s=MU_S, mu_k=MU_K,
            force_per_mass=FORCE / MASS, gravity=G, mu_plate=MU_PLATE,
        )  # fmt: skip
        apart = abs(float(seen["z"][-1]) - np.trapezoid(surface.velocities, knots))
        assert (apart < 1e-12) == sticks, (way, share)


def test_a_run_tells_what_it_reached() -> None:
    """A sinusoidal surface: its peak, which the camera sees a little less of, is known."""
    rig = {"friction.normal_force": 0.5, "friction.mu_plate": 0.2, "friction.mu_s": 0.7}
    budget = slip_budget(0.7, 0.5 / 0.009, G, 0.2)
    assert budget["up"][0] < budget["down"][0] < 0.0 < budget["up"][1] < budget["down"][1]
    for peak, falls in ((0.98, []), (1.02, ["fall"])):
        acceleration = peak * abs(budget["down"][0])
        velocity = acceleration / (2 * np.pi * 20.0)
        sine = {"drive.waveform": "sine", "drive.velocity_amplitude": velocity}
        told = summary(load("held", {**rig, **sine, "run.duration": 0.5}))
        assert [what for what in told["slip_by_surface"]["down"] if what == "fall"] == falls
        assert "fall" not in told["slip_by_surface"]["up"]
        assert told["slip_up"] == pytest.approx(budget["up"])
    grip = summary(load("held", {**rig, "mechanics.n_surfaces": 2, "run.duration": 0.5}))
    assert grip["slip_down"] == pytest.approx(slip_budget(0.7, 1.0 / 0.009, G, 0.2)["down"])


def test_what_only_touches_the_ends_does_not_count() -> None:
    """0 to 1 m/s in 0.1 s, constant until 0.3 s, then down at 100 m/s²; and of a period that jumps
    at its end, the one jump."""
    surface = Surface(np.array([0.0, 0.1, 0.3, 0.31]), np.array([0.0, 1.0, 1.0, 0.0]))
    found = surface.extremes(0.1, 0.3)
    assert (found["a_surface_max"], found["a_surface_min"]) == (0.0, 0.0)
    saw = Surface(np.array([0.0, 0.1, 0.1]), np.array([-1.0, 1.0, -1.0]), 5)
    for start in (0.1, 0.15, 0.2):
        found = saw.extremes(start, start + 0.2)
        assert found["a_surface_max"] == pytest.approx(20.0) and found["a_surface_min"] == -np.inf
