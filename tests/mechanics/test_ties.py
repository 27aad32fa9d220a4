"""Where sticking and slipping are both consistent with the law of friction, the part sticks.

Both continuations are closed forms here, and the other one is ruled out by its figures.
"""

import pytest

from cosim.mechanics import part
from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.helpers.fmu_bench import FREE_BODIES, Bench

pytestmark = pytest.mark.physics

SURFACE, PART, MU_S, MU_K, NORMAL = 0.0145, 0.009, 0.72, 0.59, 0.5
STATIC, KINETIC = MU_S * NORMAL / PART, MU_K * NORMAL / PART  # m/s²
PUSH, PUSHED = 2.0 * STATIC, 0.01  # m/s², s: how the surface outruns the part at first


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("needed", "sticks"),
    [
        (0.999 * KINETIC, True),  # a part that slipped on would be pulled back: sticking alone
        (1.001 * KINETIC, True),  # from here on both
        (0.5 * (STATIC + KINETIC), True),
        (0.999 * STATIC, True),
        (1.001 * STATIC, False),  # slipping on alone
    ],
)
def test_a_part_that_may_stick_or_slip_on_sticks(way: int, needed: float, sticks: bool):
    # The surface outruns the part, brakes with `needed` and meets it. Sticking takes the friction
    # m needed then; against the kinetic friction alone the part would run ahead of the surface.
    meeting = PUSHED + PUSHED * (PUSH - KINETIC) / (KINETIC + needed)
    speed, after = way * KINETIC * meeting, 0.002
    expected = speed - way * (needed if sticks else KINETIC) * after
    end = meeting + after
    top = way * PUSH * PUSHED
    braked = top - way * needed * (end - PUSHED)

    knots = [0.0, PUSHED, end], [0.0, top, braked]
    motion = part.exact(*knots, mu_s=MU_S, mu_k=MU_K, force_per_mass=NORMAL / PART, gravity=0.0)
    assert motion.v[-1] == pytest.approx(expected, rel=1e-12)

    with Bench(prescribed=1, gravity=0.0, mu_s=MU_S, mu_k=MU_K, part_mass=PART) as bench:
        bench.run_to(PUSHED, surface_velocity=0.0, surface_acceleration=way * PUSH)
        bench.run_to(end, surface_velocity=top, surface_acceleration=-way * needed)
        assert bench["v_part"] == pytest.approx(expected, rel=1e-9)
        assert bench["sticking"] == sticks


@pytest.mark.parametrize("late", [0.0, 1e-9])
def test_two_surfaces_that_meet_the_part_at_once_are_a_point_apart(late: float):
    # Two surfaces outrun the part in the same way and brake. If they meet it at one instant, both
    # hold it with m a / 2 each, below µ_s F_n. If one is later by however little, the other would
    # have to hold it alone, and then the later one: neither can, and all slip on.
    push, brake = 3.0, 1.45  # N on each surface
    both, outrun = 2.0 * SURFACE + PART, 2.0 * KINETIC
    held = 2.0 * brake / both
    assert MU_K * NORMAL < 0.5 * PART * held < MU_S * NORMAL  # sticking; slipping on: the next line
    assert outrun < (brake - MU_K * NORMAL) / SURFACE
    alone = PART * (brake + MU_K * NORMAL) / (SURFACE + PART) - MU_K * NORMAL
    assert alone > MU_S * NORMAL

    pushed = 0.01
    ahead = ((push - MU_K * NORMAL) / SURFACE - outrun) * pushed
    meeting = pushed + ahead / (outrun + (brake + MU_K * NORMAL) / SURFACE)
    after = 0.002
    expected = outrun * meeting - (outrun if late else held) * after
    with Bench(
        **FREE_BODIES, independent=1, n_surfaces=2, travel=1.0, mu_s=MU_S, mu_k=MU_K,
        surface_mass=SURFACE, part_mass=PART, tolerance=1e-13,
    ) as bench:  # fmt: skip
        bench.run_to(pushed, current=-push, current_2=-push)
        if late:
            bench.run_to(pushed + late, current=brake)
        bench.run_to(meeting + after, current=brake, current_2=brake)
        assert bench["v_part"] == pytest.approx(expected, rel=1e-6)
        assert bench.get("sticking", "sticking_2") == [not late] * 2


def test_a_rig_of_two_surfaces_has_a_point_apart():
    def v_average(keys: dict[str, float]) -> float:
        few = {
            "circuit.model": "limited",
            "run.duration": 0.5,
            "run.settle": 0.25,
            "run.output_step": 0.25,
        }
        return simulate(load("reference", keys | few)).summary["v_average"]

    def late(degrees: float) -> float:
        twice = {"mechanics.n_surfaces": 2, "mechanics.part_mass": 0.018}
        return v_average({"drive.phase_deg": degrees, **twice})

    tie, near = late(0.0), late(1e-7)
    assert tie == pytest.approx(v_average({}), rel=1e-6)
    assert near == pytest.approx(late(1e-5), rel=1e-6)
    assert abs(near / tie - 1.0) > 1e-3


@pytest.mark.parametrize("way", [1, -1])
def test_forces_that_all_grow_from_zero_break_the_plates_hold_alone(way: int):
    # At first no friction bears anything, and both limits are passed at once: F = c t against
    # mu_s F_n = mu_s s t. With the plate slipping surface and part go on together, a part that
    # would slip too being too slow (mu_k = mu_s): m (c − mu_p s)/(m + m_s) + mu_p s < mu_s s.
    force, normal, mu_plate, end = 1.5, 1.0, 0.2, 0.01  # N/s, N/s, 1, s
    assert PART * (force - mu_plate * normal) / (PART + SURFACE) < (MU_S - mu_plate) * normal
    rig = {**FREE_BODIES, "travel": 1.0, "mu_s": MU_S, "mu_k": MU_S, "mu_plate": mu_plate}
    with Bench(**rig, normal_force=0.0, tolerance=1e-13) as bench:
        bench.run_to(end, normal_force_slope=normal, current_slope=-way * force)
        expected = way * (force - mu_plate * normal) * end**2 / 2 / (PART + SURFACE)
        assert bench.get("v_part", "v_surface") == pytest.approx([expected] * 2, rel=1e-6)
        assert bench["sticking"] == 1


def test_a_normal_force_that_grows_from_zero_finds_all_at_rest():
    # Magnets press both rams on their upper walls; rounding of that does not move the part.
    rig = {"gravity": 0.0, "suspension": 3, "independent": 1, "n_surfaces": 2}
    with Bench(**rig, normal_force=0.0) as bench:
        bench.run_to(0.05, normal_force_slope=10.0)
        assert bench.get("sticking", "sticking_2", "stick_slip_events") == [1, 1, 0]
