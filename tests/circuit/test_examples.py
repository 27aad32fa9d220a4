"""The example netlists of circuits/examples against hand calculation."""

import re
import subprocess

import numpy as np
import pytest

from cosim.circuit.joined import unit
from cosim.circuit.netlist import parameters
from cosim.scene import load
from tests.helpers import needs
from tests.helpers.spice import CIRCUITS, netlist, run, run_all

pytestmark = [pytest.mark.physics, needs.ngspice_library]

EXAMPLES = sorted(path.stem for path in (CIRCUITS / "examples").glob("*.cir"))
NAMES = re.findall(r"^\| `(\w+)` \|", (CIRCUITS / "README.md").read_text(encoding="utf-8"), re.M)


def coil_impedance(s):
    return 7.1 + s * 1.2e-3


def swept(tmp_path, name, **parameters):
    """Gains from V1 over frequency."""
    source = (r"^Vcommand .*$", "Vcommand v1 0 0 AC 1")
    r = run(tmp_path, netlist(name, source, tran=".ac dec 10 0.1 10k", **parameters))
    return r, 2j * np.pi * np.abs(r["frequency"])


def test_there_are_examples():
    assert EXAMPLES == ["audio_amplifier", "h_bridge"]


def test_the_agreed_names_are_those_that_the_host_fills():
    assert set(NAMES) == set(parameters(load("reference")))


@pytest.mark.parametrize("name", EXAMPLES)
def test_contract(name):
    text = (CIRCUITS / "examples" / f"{name}.cir").read_text()
    assert text.isascii()
    title, body = text.split("\n", 1)
    assert title[0] not in ".*" and not re.search(r"^\s*(\.control|\.inc|A\w+ )", body, re.M | re.I)
    assert re.findall(r"^Vcommand v1 0 ", text, re.M) and re.findall(
        r"^Vemf c3 sense 0$", text, re.M
    )
    assert re.findall(r"^Rcoil out ", text, re.M)
    agreed, own = text.split("* the circuit's own\n")
    assert set(re.findall(r"^\.param (\w+)=", agreed, re.M)) <= {*NAMES}
    assert not set(re.findall(r"^\.param (\w+)=", own, re.M)) & {*NAMES}


@pytest.mark.parametrize("name", EXAMPLES)
@needs.ngspice_program
def test_runs_in_plain_ngspice(tmp_path, name):
    raw = tmp_path / "out.raw"
    done = subprocess.run(
        ["ngspice", "-b", "-r", str(raw), f"{name}.cir"],
        cwd=CIRCUITS / "examples",
        text=True,
        capture_output=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert not re.search("error|singular|too small|gmin", done.stdout + done.stderr, re.I)
    assert raw.stat().st_size > 1e5


@pytest.mark.parametrize("name", EXAMPLES)
def test_runs_to_its_end_with_an_external_command_and_emf(tmp_path, name):
    v1 = [0, 1e-6, 10e-3], [0.0, -1.0, 1.0]
    emf = [0, 5e-3, 5.001e-3, 10e-3], [0.0, 0.0, 0.5, 0.5]
    edits = (r"^Vcommand .*$", "Vcommand v1 0 external"), (r"^Vemf .*$", "Vemf c3 sense external")
    r = run(
        tmp_path,
        netlist(f"examples/{name}", *edits, tran=".tran 10u 10m 0 20u"),
        external={"vcommand": v1, "vemf": emf},
    )
    assert r["time"][-1] == pytest.approx(10e-3)
    # the EMF opposes the current: the coil's voltage is that over R and L plus the EMF
    current = np.interp([4.9e-3, 9e-3], r["time"], r["vemf#branch"])
    slope = (np.interp([4.95e-3, 9.05e-3], r["time"], r["vemf#branch"]) - current) / 50e-6
    voltage = np.interp([4.9e-3, 9e-3], r["time"], r["out"] - r["sense"])
    assert voltage - 7.1 * current - 1.2e-3 * slope == pytest.approx([0.0, 0.5], abs=2e-3)


def test_h_bridge_gain(tmp_path):
    r, s = swept(tmp_path, "examples/h_bridge")
    gain = 18 / 5 / (coil_impedance(s) + 0.1 + 2 * 0.15)
    np.testing.assert_allclose(r["vemf#branch"], gain, rtol=1e-6)
    # by hand: 3.6 V per volt over 7.5 ohm
    assert abs(r["vemf#branch"][0]) == pytest.approx(0.48, rel=1e-3)


def test_h_bridge_takes_the_scene_s_numbers(tmp_path):
    values = {"supply": 12, "sense_resistance": 0.5, "count": 2}
    r, _ = swept(tmp_path, "examples/h_bridge", **values)
    assert abs(r["vemf#branch"][0]) == pytest.approx(12 / 5 / (7.1 / 2 + 0.5 + 0.3), rel=1e-3)


@pytest.mark.parametrize("v1, duty", [(2.5, 0.5), (-4, -0.8), (6, 1), (-9, -1)])
def test_h_bridge_ends_at_full_duty(tmp_path, v1, duty):
    source = (r"^Vcommand .*$", f"Vcommand v1 0 {v1}")
    r = run(tmp_path, netlist("examples/h_bridge", source, tran=".op"))
    current = 18 * duty / 7.5
    assert r["vemf#branch"][0] == pytest.approx(current, rel=1e-4)
    assert (r["out"] - r["sense"])[0] == pytest.approx(7.1 * current, rel=1e-4)
    assert (abs(r["swing"][0]) >= 0.5) == (abs(v1) > 5)
    assert np.sign(r["swing"][0]) in (0, np.sign(v1))


def test_audio_amplifier_gain(tmp_path):
    r, s = swept(tmp_path, "examples/audio_amplifier")
    np.testing.assert_allclose(np.abs(r["amp"]), 4, rtol=2e-3)  # falls by f/250 kHz
    coil = coil_impedance(s)
    divider = coil / (coil + 0.1 + 1 / (s * 2200e-6))
    np.testing.assert_allclose(np.abs(r["out"]), 4 * np.abs(divider), rtol=2e-3)
    np.testing.assert_allclose(np.abs(r["vemf#branch"]), 4 * np.abs(divider / coil), rtol=2e-3)
    # by hand: the capacitor and 7.2 ohm make a corner of 10.05 Hz
    low = np.interp(10.05, np.abs(r["frequency"]), np.abs(r["vemf#branch"]))
    assert low == pytest.approx(4 / 7.2 / np.sqrt(2), rel=0.01)


def test_audio_amplifier_stage(tmp_path):
    """Followers in class AB: both conduct at rest; driven hard, the clamp holds the output."""
    sine = (r"^Vcommand .*$", "Vcommand v1 0 SIN(0 {} 200)")
    mild, hard = run_all(
        tmp_path,
        *(
            netlist(
                "examples/audio_amplifier",
                (sine[0], sine[1].format(peak)),
                tran=".tran 10u 20m 0 5u",
            )
            for peak in (1.0, 6.0)
        ),
    )
    quiescent = (mild["e1"][0] - mild["amp"][0]) / 0.22
    assert 1e-3 < quiescent < 0.1
    grid = np.linspace(10e-3, 20e-3, 5001)
    amp = np.interp(grid, mild["time"], mild["amp"])
    wave = np.exp(2j * np.pi * 200 * grid[:-1])
    first, third = (2 * np.mean(amp[:-1] * wave**-n) for n in (1, 3))
    assert abs(first) == pytest.approx(4, rel=2e-3)
    assert abs(third) < 2e-3 * abs(first)  # no crossover distortion to speak of
    assert not (np.abs(mild["swing"]) >= 0.5).any()
    late = hard["time"] > 10e-3
    for sign in (1, -1):
        top = np.max(sign * hard["amp"][late])
        assert 14 < top < 17.5
        flagged = sign * hard["swing"][late] >= 0.5
        assert flagged.any()
        assert np.min(sign * hard["amp"][late][flagged]) > 0.9 * top


@pytest.mark.parametrize(
    ("words", "wanted"),
    [("v(in) - v(out)", "V"), ("v(a)*i(b)+v(c)*i(d)", "W"), ("v(a)+i(b)", "?"), ("v(in-)", "V")],
)
def test_units_of_sums(words: str, wanted: str) -> None:
    assert unit(words) == wanted
