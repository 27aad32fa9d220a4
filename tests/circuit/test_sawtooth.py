"""The generator's netlist, which ngspice plays alone, against the source that the scenes have."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cosim.drive.command import WithPwm, command
from cosim.drive.pieces import Command
from cosim.drive.staircase import Staircase
from cosim.scene import load
from tests.helpers import needs
from tests.helpers.pins import pin, pin_before, v_dac, v_dac_before
from tests.helpers.spice import Result, netlist, run_all

pytestmark = [pytest.mark.physics, needs.ngspice_library]

STEP = 50e-6
NAMES: tuple[str, ...] = ("pot_max", "pot_frequency", "pot_offset")
KNOBS = [(1.0, 0.5, 0.5), (0.3, 0.05, 0.9), (0.05, 0.6, 0.0), (0.9, 0.3, 1.0)]
Voltage = Callable[[Command, float], float]


def scene_source(knobs: dict[str, float]) -> tuple[Staircase, WithPwm]:
    """What a scene with these knobs drives its circuit with, without and with the PWM's ripple."""
    pots = {f"drive.{name}": knob for name, knob in knobs.items()}
    rung = {"circuit.model": "full", "drive.quantised": True}
    plain = command(load("reference", rung | pots))
    rippled = command(load("reference", rung | pots | {"drive.pwm_ripple": True}))
    assert isinstance(plain, Staircase) and isinstance(rippled, WithPwm)
    return plain, rippled


def points(drive: Command, start: float, at: Voltage, before: Voltage, end: float) -> str:
    """A pin's voltage, which ``start`` is before time 0, as a source of ngspice."""
    pairs, t = [(0.0, start), (1e-9, at(drive, 0.0))], 0.0
    while (t := drive.next_jump(t)) < end:
        pairs += [(t - 1e-9, before(drive, t)), (t, at(drive, t))]
    return f"PWL({' '.join(f'{time!r} {value!r}' for time, value in pairs)})"


@pytest.mark.parametrize(
    "pots", [*KNOBS[:2], *(pytest.param(pots, marks=pytest.mark.slow) for pots in KNOBS[2:])]
)
def test_it_gives_the_voltage_of_the_scenes_source(pots: tuple[float, ...], tmp_path: Path) -> None:
    knobs: dict[str, float] = dict(zip(NAMES, pots, strict=True))
    plain, drive = scene_source(knobs)
    end = 1.05 * plain.period  # the fall, too
    tran = f".tran 10u {end!r} 0 20u"
    v_start = v_dac(drive, 0.0)
    ideal, real, hosted = run_all(
        tmp_path,
        netlist("sawtooth", tran=tran, dac_resistance=0.0, **knobs),
        netlist("sawtooth", tran=tran, **knobs),
        netlist(
            "full",
            (r"^Vdac .*$", f"Vdac dac 0 {points(drive, v_start, v_dac, v_dac_before, end)}"),
            (
                r"^Voffset .*$",
                f"Voffset pwm 0 {points(drive, drive.v_offset, pin, pin_before, end)}",
            ),
            tran=tran,
            options="reltol=1e-6 method=gear",
        ),
    )
    middles = np.arange(0.5 * STEP, end - STEP, STEP)

    def between_edges(result: Result, name: str) -> np.ndarray:
        return np.interp(middles, result["time"], result[name])

    # the counter: code for code
    codes = [plain.codes[k % len(plain.codes)] for k in range(len(middles))]
    assert len(set(codes)) > 20
    np.testing.assert_allclose(between_edges(ideal, "code"), codes, atol=1e-6)

    # the power amplifier's input: half-way between edges, and as a mean over all time with them
    v1 = between_edges(hosted, "v1")
    np.testing.assert_allclose(between_edges(ideal, "v1"), v1, atol=0.5e-3)
    times = np.union1d(ideal["time"], hosted["time"])
    apart = np.interp(times, ideal["time"], ideal["v1"])
    apart -= np.interp(times, hosted["time"], hosted["v1"])
    assert np.trapezoid(np.abs(apart), times) / times[-1] < 0.1e-3
    assert np.ptp(v1) > 0.4  # of which 0.5 mV is little

    # the DAC's 250 ohm, by hand: they are a part of R2
    gain = 15e3 / (4.7e3 + 250)
    offset, dac = between_edges(real, "offset"), between_edges(real, "ideal")
    by_hand = 15 / 19.7 * (1 + gain) * offset - gain * dac
    np.testing.assert_allclose(between_edges(real, "v1"), by_hand, atol=1e-3)
