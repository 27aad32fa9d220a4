"""Netlists as they are found run as they are, or are refused with line and cure.

Behind the fence, by the command's own way, on a library without code models. They are compared with
closed forms, with the same written by hand for plain ngspice, and with the program ngspice, which
has code models.
"""

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.arrays import Array
from cosim.errors import BadInput, BeyondModel
from tests.helpers import needs, spice
from tests.helpers.found_netlists import CODED, REFUSED, RUNS

SCENE = """description = "a netlist that was found"
[circuit]
model = "file"
netlist = "own.cir"
max_step = 1e-6
save = [{}]
[drive]                # as the netlist's own V1 has it
waveform = "sine"
amplitude = 2.0
frequency = 1000
offset = 0
[[port]]
from = "drive"
source = "V1"
[run]
duration = 3e-3
output_step = 1e-6
settle = 0
"""


def found(folder: Path, name: str, text: str, *save: str) -> cosim.Result:
    (folder / "own.cir").write_bytes(text.encode(CODED.get(name, "utf-8")))
    words = ", ".join(f'"{word}"' for word in save)
    (folder / "own.toml").write_text(SCENE.format(words))
    return cosim.run(folder / "own.toml")


def off(result: cosim.Result, word: str, time: Array, values: Array) -> float:
    """Greatest difference, over the greatest value."""
    true = np.interp(result.columns["time"], time, values)
    return float(np.abs(result.columns[word] - true).max() / np.abs(true).max())


pytestmark = pytest.mark.filterwarnings(f"ignore::{BeyondModel.__module__}.{BeyondModel.__name__}")

OPAMPS = dict(zip(RUNS, (-10.0, 1.0), strict=False))


@pytest.mark.parametrize("name", OPAMPS)
def test_an_operational_amplifier_has_the_gain_of_its_feedback(name: str, tmp_path: Path) -> None:
    columns = found(tmp_path, name, RUNS[name], "v(in)", "v(out)").columns
    late = columns["time"] > 1e-3
    slope, _ = np.polyfit(columns["v(in)"][late], columns["v(out)"][late], 1)
    assert slope == pytest.approx(OPAMPS[name], rel=5e-3)


@needs.ngspice_program
@pytest.mark.parametrize("name", OPAMPS)
def test_polynomials_are_those_of_ngspices_code_models(name: str, tmp_path: Path) -> None:
    result = found(tmp_path, name, RUNS[name], "v(in)", "v(out)")
    text = re.sub(r"(?mi)^\.tran.*", ".tran 1u 3m 0 1u\n.options reltol=1e-5", RUNS[name])
    vectors = program(text, tmp_path)
    assert off(result, "v(out)", vectors["time"], vectors["v(out)"]) < 1e-4


def program(text: str, folder: Path) -> dict[str, Array]:
    """What the program ngspice computes, by the names of its vectors."""
    (folder / "alone.cir").write_text(text)
    command = [str(shutil.which("ngspice")), "-b", "-r", "alone.raw", "alone.cir"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    raw = folder / "alone.raw"
    if not raw.exists():
        pytest.skip(f"this ngspice has no code models: {done.stderr[-200:]}")
    head, _, data = raw.read_bytes().partition(b"Binary:\n")
    names = re.findall(r"^\t\d+\t(\S+)\t", head.decode(), re.MULTILINE)
    return dict(zip(names, np.frombuffer(data).reshape(-1, len(names)).T, strict=True))


def soft(x: Array, end: float, width: float) -> Array:
    """x below, end above, and between them the parabola that meets both smoothly."""
    middle = (end - width < x) & (x < end + width)
    arc = x - (x - end + width) ** 2 / (4.0 * width)
    return np.where(middle, arc, np.minimum(x, end))


def low_of(x: Array) -> Array:
    return -soft(-x, 0.8, 0.1)


def table(x: Array) -> Array:
    return np.interp(x - 0.1, [-5e-3, 5e-3], [0, 5])


STATIC: dict[str, dict[str, Callable[[Array, Array], Array]]] = {
    "LTspice: functions of behavioural sources": {
        "v(a)": lambda x, t: np.clip(x, -0.7, 0.7),
        "v(b)": lambda x, t: soft(low_of(x), 0.8, 0.1),
        "v(c)": lambda x, t: np.where(x > 0, x**2, -0.5 * x),
        "v(d)": lambda x, t: np.interp(x, [-0.5, 0, 0.5], [-1, 0, 2]),
        "v(e)": lambda x, t: np.hypot(x, np.sin(2e3 * np.pi * t)),
        "1k*i(V8)": lambda x, t: np.interp(-2 * x, [-1, 0, 1], [-2, 0, 1]),
        "1k*i(V9)": lambda x, t: np.where(x > 0, x, x / 3),
        "v(g)": lambda x, t: np.arctan2(x, np.cos(2e3 * np.pi * t)),
        "v(f)": lambda x, t: np.where(x > 0.5, 2.0, np.where(x < 0.125, 1.0, 0.0)),
    },
    "PSpice: tables and expressions": {
        "v(a)": lambda x, t: np.clip(2 * x, -1, 1),
        "v(b)": lambda x, t: table(x),
        "v(c)": lambda x, t: np.interp(x, [-1, -0.5, 0.5, 1], [-1, 0, 0, 1]),
        "v(d)": lambda x, t: 0.1 * table(x) + 0.01 * table(x) ** 2,
    },
}


@pytest.mark.parametrize("name", STATIC)
def test_functions_and_tables_are_what_they_say(name: str, tmp_path: Path) -> None:
    columns = found(tmp_path, name, RUNS[name], "v(in)", *STATIC[name]).columns
    for word, law in STATIC[name].items():
        error = np.abs(columns[word] - law(columns["v(in)"], columns["time"]))
        # Between two points of ngspice all is straight; a corner lies between two of them.
        assert np.quantile(error, 0.98) < 1e-3 and error.mean() < 1e-2, word


BY_HAND = {
    "LTspice, UTF-16: a filter of real parts": (
        "v(N002)",
        "Rs in n1 0.1\nL1 n1 s1 330u\nRl s1 n002 0.35\nRp n1 n002 2k\nCp n1 n002 12p\n"
        "C1 n002 c1 10u\nRc c1 c2 0.06\nLc c2 0 2n\nRload n002 0 47\nD1 0 n002 D\n.model D D\n",
    ),
    "LTspice IV, Latin-1: a transistor stage": (
        "v(N002)",
        "Q1 n002 n003 n004 0 QM\nR1 n001 n002 4.7k\nR2 n001 n003 47k\nR3 n003 0 10k\n"
        "R4 n004 0 1k\nC1 n003 in 1200u\nV2 n001 0 12\n.model QM NPN\n",
    ),
    "LTspice: a MOSFET, a switch and a transformer": (
        "v(q)",
        "V2 vdd 0 24\nE1 g 0 in 0 10\nM1 d g 0 0 FETX\nR1 vdd d 100\nS1 d x in 0 SWX\nR2 x 0 1e6\n"
        "Rl in l 1\nL1 l 0 10m\nL2 p 0 10m\nL3 q 0 40m\nK1 L1 L2 0.99\nK2 L1 L3 0.99\n"
        "K3 L2 L3 0.99\nR3 p 0 1k\nR4 q 0 1k\n.model SWX SW(Ron=1 Roff=1e6 Vt=0.5 Vh=0)\n"
        ".model FETX VDMOS(Rg=3 Vto=4 Rd=5m Rs=5m Rb=10m Kp=30 Cgdmax=.5n Cgdmin=.05n Cgs=1n\n"
        "+ Cjo=.3n Is=1p)\n",
    ),
}


@needs.ngspice_library
@pytest.mark.parametrize("name", BY_HAND)
def test_dialects_and_codings_are_what_one_writes_by_hand(name: str, tmp_path: Path) -> None:
    word, body = BY_HAND[name]
    result = found(tmp_path, name, RUNS[name], word)
    head = f"* by hand\nV1 in 0 SIN(0 1 1k)\n{body}"
    plain = spice.run(tmp_path, f"{head}.options reltol=1e-5\n.tran 1u 3m 0 1u\n.end\n")
    assert off(result, word, plain["time"], plain[word[2:-1].lower()]) < 1e-3
    if name.startswith("LTspice IV"):
        reach = plain["time"] > 1e-3
        expected = np.ptp(plain["n002"][reach])
        assert result.summary["meas.ic_pp"] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_read_is_refused_with_its_cure(name: str, tmp_path: Path) -> None:
    text, told = REFUSED[name]
    with pytest.raises(BadInput, match=told):
        found(tmp_path, name, text)


def test_they_are_ten() -> None:
    assert len(RUNS) == 7 and len(REFUSED) == 3


def test_edges_without_times_currents_and_truth_are_as_the_netlist_has_them(
    tmp_path: Path,
) -> None:
    """An edge of PULSE without a length takes the netlist's .tran step, as in ngspice alone, not
    the scene's, but no more than 1 % of the pulse, and one without an on-time falls at once; a
    resistor's current is read in save and .meas; 0.2 is false to LTspice."""
    text = """own step
V1 in 0 SIN(0 1 1k)
R1 in 0 1k
V2 p 0 PULSE(0 5 0 0 0 250u 0.5m)
RLoad p 0 1k
V4 saw 0 PULSE(0 1 0 {edge} 0.25m 0 0.5m)
.param edge=0.25m
R4 saw 0 1k
V3 low 0 0.2
R3 low N/C_01 1k
B1 high 0 V={if(V(low),5,unit)}
B2 both 0 V=5*(V(high)&V(low)) + (V(low) | V(high)) + 10*~V(low)
.step param unit list 1 2
.PARAM Far=3
.step param far list 7 8
B3 there 0 V={far}
.meas tran most MAX V(p)*I(RLoad)
.tran 5u 3m
.end
"""
    words = ("v(p)", "i(RLoad)", "v(high)", "v(both)", "v(there)", "v(saw)")
    result = found(tmp_path, "", text, *words)
    time, pulse = result.columns["time"], result.columns["v(p)"]
    phase = time % 0.5e-3
    rising = (phase > 0.1e-6) & (phase < 2.4e-6)
    assert pulse[rising] == pytest.approx(phase[rising] * 2e6, abs=1e-6)  # 5 V in 2.5 us
    assert result.columns["i(RLoad)"] == pytest.approx(pulse / 1e3, abs=1e-9)
    triangle = 1.0 - np.abs(phase - 0.25e-3) / 0.25e-3
    assert result.columns["v(saw)"] == pytest.approx(triangle, abs=1e-5)
    assert np.all(result.columns["v(high)"] == 1.0)
    assert np.all(result.columns["v(both)"] == 11.0)
    # Not what .step begins with; ngspice rounds parameters.
    assert result.columns["v(there)"] == pytest.approx(3.0, rel=1e-12)
    assert result.summary["meas.most"] == pytest.approx(25e-3, rel=1e-6)


@pytest.mark.parametrize("step", ["1e-7", "5e-6", "2e-5"])
def test_a_flip_flop_divides_its_clock_by_two_with_any_step(step: str, tmp_path: Path) -> None:
    (tmp_path / "own.cir").write_text(
        "divider\nV1 in 0 0\nR1 in 0 1k\nV2 clk 0 PULSE(0 1 50u 1u 1u 50u 100u)\n"
        "A1 qn 0 clk 0 0 qn q 0 DFLOP\n.tran 1u 3m\n.end\n"
    )
    scene = SCENE.format('"v(q)"').replace("max_step = 1e-6", f"max_step = {step}")
    (tmp_path / "own.toml").write_text(scene)
    columns = cosim.run(tmp_path / "own.toml").columns
    edges = columns["time"][1:][np.diff(columns["v(q)"] > 0.5)]
    assert np.arange(len(edges)) * 1e-4 + 50e-6 == pytest.approx(edges, abs=2.5e-6)
    assert len(edges) == 30
