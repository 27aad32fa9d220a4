"""What a point of a map costs beside the compiled loop, counted: the same on every machine."""

import cProfile
import pstats

from cosim.evaluate.point import point
from cosim.scene import load
from cosim.simulation.simulate import summary


def test_python_calls_few_functions_for_a_point() -> None:
    """Some 0.2 ms; what a simulated second of `paper-limited` takes is ten times that."""
    base = point(load("paper-limited", ["run.duration=0.05", "run.settle=0.02"]), {}, False)
    knobs = [{"drive.amplitude": 5.0 + 0.02 * k, "drive.offset": -0.01 * k} for k in range(100)]

    def run() -> None:
        # In this thread: before Python 3.12 a profile holds no other.
        for at in knobs:
            assert isinstance(summary(point(base, at, False)), dict)

    run()  # what is kept from run to run is made
    profile = cProfile.Profile()
    profile.runcall(run)
    calls = pstats.Stats(profile).total_calls / len(knobs)  # pyright: ignore[reportAttributeAccessIssue]
    assert calls < 1050, f"{calls:.0f} calls a point"
