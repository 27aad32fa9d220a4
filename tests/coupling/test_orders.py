"""Orders of the coupling methods on the bench's own participants, against the reference.

The smooth scene: a sine drives an amplifier so slow that the back-EMF tells, the ram swings on its
hardening suspension without meeting a wall, and the part sticks throughout.
"""

import math
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sksundae")

from benchmarks.error_control import ErrorControlled
from cosim.coupling.methods.jacobi import Jacobi
from cosim.coupling.participants.stickslip import FmuMechanics
from cosim.coupling.rewind.joint import EventAware, Joint
from cosim.coupling.rewind.methods import variants
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.accuracy.cases import CASES, participants
from tests.reference import monolithic
from tests.reference.parameters import reference_parameters

pytestmark = pytest.mark.physics

SMOOTH = CASES["smooth"]
JUDGED = ("z_surface", "z_ram", "v_ram", "current")
SAMPLES = 20


def reference(duration: float, **changes: Any) -> dict[str, np.ndarray]:
    """The judged signals at equally spaced times, the last at ``duration`` (s)."""
    times = [duration * k / SAMPLES for k in range(1, SAMPLES + 1)]
    parameters = reference_parameters(load("reference", SMOOTH.overrides)) | changes
    found = monolithic.simulate(parameters, duration, 0.0, tol=1e-14, times=times)
    return {name: found.samples[name] for name in JUDGED}


def error(found: dict[str, np.ndarray], expected: dict[str, np.ndarray]) -> float:
    """Greatest over time and signals, each in units of its own range."""
    return max(
        float(np.abs(found[name] - expected[name]).max() / np.ptp(expected[name]))
        for name in JUDGED
    )


def slopes(errors: list[float]) -> list[float]:
    return [math.log2(a / b) for a, b in pairwise(errors)]


Make = Callable[[Any, FmuMechanics], Joint]
DURATION = 0.01
EXPECTED = reference(DURATION)


def joined_error(make: Make, steps: int) -> float:
    circuit, mechanics = participants(load("reference", SMOOTH.overrides))
    found: dict[str, list[float]] = {name: [] for name in JUDGED}
    try:
        joint = make(circuit, mechanics)
        for k in range(steps):
            joint.step(DURATION / steps)
            if (k + 1) % (steps // SAMPLES) == 0:
                row: dict[str, float] = mechanics.sample()
                row["current"] = float(joint.past.current.value[0])
                for name in JUDGED:
                    found[name].append(row[name])
    finally:
        mechanics.close()
    return error({name: np.array(values) for name, values in found.items()}, EXPECTED)


QUICK = ("Jacobi k = 1", "EMF's slope, linear current")
"""One of each way to step once: both sides at the same time, and in turn."""
EXTRA: dict[str, tuple[Make, int]] = {
    "Jacobi k = 1, slopes": (lambda a, b: Joint(a, b, Jacobi(1)), 2),
}
METHODS = {name: (one.make, one.order) for name, one in variants().items()} | EXTRA
"""Methods and their orders."""
del METHODS["iterated, plain"], METHODS["event-aware"]  # solutions of others where nothing jumps


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in METHODS],
)
def test_order_on_the_smooth_scene(name: str) -> None:
    make, order = METHODS[name]
    # A parabola through older points needs shorter steps until its order shows.
    first = 800 if name == "Gauss-Seidel k = 2" else 400
    errors = [joined_error(make, first * 2**k) for k in range(5)]
    assert slopes(errors) == pytest.approx([order] * 4, abs=0.1), errors


def test_the_default_method_is_of_second_order() -> None:
    """ngspice leads with steps held at their maximum, all shorter than what holds them near the
    output's limit; over the smooth scene's whole length.

    The flux that is paid back takes more of the error of long steps than of short ones, so that
    the slope is a little flatter than the line of order 2 that all errors stay below.
    """
    duration = 0.05
    # The netlist's pole, 1 uF, leaks through 1 Gohm too, as if the open-loop gain were less.
    scene = load("reference", SMOOTH.overrides)
    rate = 2.0 * math.pi * scene.circuit.gain_bandwidth
    leak = 10.0 ** (-scene.circuit.open_loop_gain / 20.0) + 1e-3 / rate
    expected = reference(duration, open_loop_gain=-20.0 * math.log10(leak))
    errors, steps = [], (8e-5, 4e-5, 2e-5, 1e-5)
    for max_step in steps:
        overrides = [
            *SMOOTH.overrides,
            f"run.duration={duration!r}",
            f"run.output_step={duration / SAMPLES!r}",
            f"circuit.max_step={max_step!r}",
            "circuit.reltol=1e-2",
        ]
        waves = simulate(load("reference", overrides)).columns
        errors.append(error({name: waves[name][1:] for name in JUDGED}, expected))
    assert all(e < 9e-6 * (h / 1e-5) ** 2 for e, h in zip(errors, steps, strict=True)), errors
    assert min(slopes(errors)) > 1.5, errors


def test_error_control_keeps_to_its_tolerance_and_the_audit_rejects() -> None:
    """A hundredth of the tolerance costs 100^(1/3) as many steps with k = 1; with the audit that
    is set at a share that its tolerance alone does not keep, steps are put back by it."""

    def taken(tolerance: float, share: float | None = None) -> ErrorControlled:
        circuit, mechanics = participants(load("reference", SMOOTH.overrides))
        try:
            joint = Joint(circuit, mechanics, Jacobi(1, slopes=False))
            control = ErrorControlled(joint, 1e-5, tolerance, tolerance, energy_share=share)
            control.run(DURATION)
        finally:
            mechanics.close()
        return control

    coarse, fine = taken(1e-4), taken(1e-6)
    assert fine.accepted / coarse.accepted == pytest.approx(100.0 ** (1.0 / 3.0), rel=0.2)
    assert coarse.rejected_by_audit == 0
    audited = taken(1e-4, 1e-4)
    assert audited.rejected_by_audit > 0
    assert audited.accepted > coarse.accepted


def test_events_are_met_by_cutting_steps() -> None:
    """At the first event of the scene reference, a slip at the command's fall, the step is cut."""
    circuit, mechanics = participants(load("reference"))
    try:
        method = EventAware(circuit, mechanics, Jacobi(1, slopes=False))
        before = method.time
        while not method.cuts:
            before = method.time
            method.step(1e-4)
        assert before < method.time
        assert mechanics.events() == method.cuts
    finally:
        mechanics.close()
