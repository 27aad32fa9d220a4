"""The netlists of circuits/ against data sheets, hand calculation and an ODE solver.

Every deck runs in plain ngspice, through the shared library in a process of its own
(ngspice keeps state, and an error in a netlist disables the library for good).
"""

import ctypes.util
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

CIRCUITS = Path(__file__).resolve().parents[2] / "circuits"
LIBRARY = os.environ.get("NGSPICE_LIBRARY_PATH") or ctypes.util.find_library("ngspice")

pytestmark = pytest.mark.skipif(
    LIBRARY is None, reason="the ngspice shared library is not installed"
)

# Loads each deck, runs it, stores its last plot and its step counts; EXTERNAL sources
# named in `external` follow (t, value) points, joined by straight lines.
CHILD = r"""
import json, logging, re, sys
import numpy as np
logging.disable(logging.CRITICAL)
from PySpice.Spice.NgSpice.Shared import NgSpiceShared
job = json.load(sys.stdin)
class Shared(NgSpiceShared):
    log = []
    def send_char(self, message, ngspice_id):
        self.log.append(message)
        return 0
    def get_vsrc_data(self, voltage, time, node, ngspice_id):
        voltage[0] = np.interp(time, *job["external"][node.lower()])
        return 0
    def do(self, command):
        try:
            return self.exec_command(command)
        except Exception:  # the wrapper takes any message on stderr for an error
            return self.stdout
ngspice = Shared()
for deck in job["decks"]:
    ngspice.log.clear()
    ngspice.do("source " + deck)
    ngspice.do("run")
    usage = ngspice.do("rusage all")
    count = {k: int(float(m.group(1))) for k, p in
             (("accepted", "Accepted timepoints"), ("rejected", "Rejected timepoints"),
              ("iterations", "Total iterations"))
             if (m := re.search(p + r" = (\S+)", usage))}
    plot = ngspice.plot(None, ngspice.last_plot)
    np.savez(deck + ".npz", **{k: np.array(v._data) for k, v in plot.items()})
    with open(deck + ".json", "w") as file:
        json.dump({"count": count, "log": ngspice.log}, file)
"""


class Result(dict):
    """Vectors by lower-case name (branch currents as vemf#branch), `count`, `log`."""

    count: dict
    log: list


def run_all(folder, *decks, external=None) -> list[Result]:
    """Runs the decks (text) in `folder`, beside copies of the libraries."""
    for library in CIRCUITS.glob("*.lib"):
        shutil.copy(library, folder)
    paths = []
    for number, deck in enumerate(decks):
        path = folder / f"deck{number}.cir"
        path.write_text(deck)
        paths.append(str(path))
    done = subprocess.run(
        [sys.executable, "-c", CHILD],
        input=json.dumps({"decks": paths, "external": external or {}}),
        env={**os.environ, "NGSPICE_LIBRARY_PATH": str(LIBRARY)},
        cwd=folder,
        text=True,
        capture_output=True,
        timeout=120,
    )
    results = []
    for path in paths:
        if not Path(path + ".json").exists():
            raise AssertionError(f"ngspice failed:\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}")
        with np.load(path + ".npz") as data:
            result = Result({k.lower(): data[k] for k in data.files})
        stored = json.loads(Path(path + ".json").read_text())
        result.count, result.log = stored["count"], stored["log"]
        results.append(result)
    return results


def run(folder, deck, external=None) -> Result:
    return run_all(folder, deck, external=external)[0]


def netlist(name, *edits, tran=None, options=None, **parameters):
    """A netlist with parameters overridden as the host does, lines replaced by expression."""
    text = (CIRCUITS / f"{name}.cir").read_text()
    edits = list(edits)
    edits += [(rf"^\.param {k}=.*$", f".param {k}={v!r}") for k, v in parameters.items()]
    if tran:
        edits.append((r"^\.tran.*$", tran))
    if options:
        edits.append((r"^\.options.*$", ".options " + options))
    for pattern, new in edits:
        text, number = re.subn(pattern, lambda m, new=new: new, text, flags=re.M)
        assert number == 1, f"{pattern} matches {number} lines of {name}.cir"
    return text


def opamp(kind, body, analysis, **parameters):
    """A bench for one operational amplifier at +-18 V; nodes inp, inn, out."""
    pins = "inp inn out vcc vee" + (" swing climit slewing" if kind == "opa548" else "")
    values = " ".join(f"{k}={v}" for k, v in parameters.items())
    return f"""bench
.include {kind}.lib
Vplus vcc 0 18
Vminus vee 0 -18
X1 {pins} {kind} {values}
{body}
.options reltol=1e-5 method=gear
{analysis}
.end
"""


def crossing(frequency, gain):
    """Frequency at which |gain| falls through one, on logarithmic axes."""
    level = np.log(np.abs(gain))
    k = np.flatnonzero((level[:-1] >= 0) & (level[1:] < 0))[-1]
    part = level[k] / (level[k] - level[k + 1])
    return float(np.exp(np.interp(part, [0, 1], np.log(np.abs(frequency[k : k + 2])))))


# --- macromodels -----------------------------------------------------------------


@pytest.mark.parametrize("kind, decibels", [("opa548", 98.0), ("lm348", 104.08)])
def test_open_loop_gain_and_bandwidth(tmp_path, kind, decibels):
    r = run(
        tmp_path,
        opamp(kind, "Vin inp 0 AC 1\nVgnd inn 0 0\nRl out 0 1meg", ".ac dec 40 0.01 10meg"),
    )
    assert 20 * np.log10(abs(r["out"][0])) == pytest.approx(decibels, abs=0.02)
    assert crossing(r["frequency"], r["out"]) == pytest.approx(1e6, rel=0.005)


@pytest.mark.parametrize("kind, rate", [("opa548", 10e6), ("lm348", 0.5e6)])
@pytest.mark.parametrize("sign", [1, -1])
def test_slew_rate(tmp_path, kind, rate, sign):
    time = 20 / rate
    body = (
        f"Vin inp 0 PWL(0 {-5 * sign} 1u {-5 * sign} 1.01u {5 * sign})\nVfb out inn 0\nRl out 0 1k"
    )
    r = run(tmp_path, opamp(kind, body, f".tran {time / 1000} {time + 2e-6} 0 {time / 1000}"))
    inside = np.abs(r["out"]) < 3
    assert inside.sum() > 20
    assert np.polyfit(r["time"][inside], r["out"][inside], 1)[0] == pytest.approx(
        sign * rate, rel=0.005
    )
    assert r["out"][-1] == pytest.approx(5 * sign, abs=0.05)


def swing(tmp_path, kind, sign, current, **parameters):
    """Output, the input overdriven by 1 V, the load drawing `current` (positive = sourcing)."""
    body = f"Vin inp 0 PWL(0 0 1u {sign})\nVgnd inn 0 0\nIload out 0 PWL(0 0 1u {current})"
    r = run(tmp_path, opamp(kind, body, ".tran 1u 100u", **parameters))
    return r["out"][-1], r


@pytest.mark.parametrize(
    "current, loss",
    [(0.6, 2.1), (3.0, 3.7), (-0.6, 1.0), (-3.0, 3.3), (1.8, 2.9), (-1.8, 2.15)],
)
def test_opa548_swing_loss(tmp_path, current, loss):
    sign = np.sign(current)
    out, r = swing(tmp_path, "opa548", sign, current, rcl=0)
    assert 18 - sign * out == pytest.approx(loss, rel=0.02)
    assert abs(r["swing"][-1]) >= 0.5 and np.sign(r["swing"][-1]) == sign
    assert abs(r["climit"][-1]) < 0.5


def test_opa548_swing_loss_without_load_and_with_reversed_current(tmp_path):
    for current, sign, loss in ((0, 1, 1.7), (0, -1, 0.425), (-1.3, 1, 1.7), (1.3, -1, 0.425)):
        out, _ = swing(tmp_path, "opa548", sign, current)
        assert 18 - sign * out == pytest.approx(loss, rel=0.02)


@pytest.mark.parametrize("rcl, limit", [(14.7e3, 2.504), (4.02e3, 4.01), (57.6e3, 0.99861)])
@pytest.mark.parametrize("sign", [1, -1])
def test_opa548_current_limit(tmp_path, rcl, limit, sign):
    assert limit == pytest.approx(15000 * 4.75 / (13750 + rcl), rel=5e-4)
    body = f"Vin inp 0 PWL(0 0 1u {sign})\nVgnd inn 0 0\nRl out 0 1"
    r = run(tmp_path, opamp("opa548", body, ".tran 1u 100u", rcl=rcl))
    assert r["out"][-1] / 1.0 == pytest.approx(sign * limit, rel=1e-3)
    assert abs(r["climit"][-1]) >= 0.5 and abs(r["climit"][0]) < 0.5


def test_opa548_recovers_from_its_limits_without_wind_up(tmp_path):
    # ten times overdriven for 1 ms; the output must leave the rail within its slewing time
    body = "Vin inp 0 PWL(0 0 1u 10 1m 10 1.001m -10)\nVgnd inn 0 0\nRl out 0 1k"
    r = run(tmp_path, opamp("opa548", body, ".tran 1u 1.02m 0 0.1u"))
    high, low = np.interp(1e-3, r["time"], r["out"]), r["out"][-1]
    half = np.interp(1e-3 + 1e-6 + abs(high - low) / 2 / 10e6, r["time"], r["out"])
    assert half == pytest.approx((high + low) / 2, abs=6)


@pytest.mark.parametrize("sign", [1, -1])
def test_lm348_swing(tmp_path, sign):
    out, _ = swing(tmp_path, "lm348", sign, 0)
    assert out == pytest.approx(15 * sign, rel=0.005)


# --- closed loop -------------------------------------------------------------------


def test_difference_gain_and_transconductance(tmp_path):
    offset, dac = np.array([1.65, 1.65, 1.65]), np.array([1.65, 1.65 + 0.9, 1.65 - 0.9])
    decks = [
        netlist(
            "full",
            (r"^Vdac.*$", f"Vdac dac 0 {d}"),
            (r"^Voffset.*$", f"Voffset pwm 0 {o}"),
            tran=".op",
        )
        for o, d in zip(offset, dac, strict=True)
    ]
    at_rest, down, up = run_all(tmp_path, *decks)
    difference = (up["v1"] - down["v1"]) / 1.8
    assert difference[0] == pytest.approx(15 / 4.7, rel=1e-4)
    assert difference[0] == pytest.approx(3.191, rel=1e-3)
    assert abs(at_rest["v1"][0]) < 1e-3
    siemens = (up["vemf#branch"] - down["vemf#branch"]) / (up["v1"] - down["v1"])
    assert siemens[0] == pytest.approx(0.25, rel=1e-3)
    assert up["vemf#branch"][0] > 0 > down["vemf#branch"][0]


def test_offset_filter(tmp_path):
    r = run(
        tmp_path,
        netlist("full", (r"^Voffset.*$", "Voffset pwm 0 0.8774 AC 1"), tran=".ac dec 200 1 1k"),
    )
    frequency, gain = np.abs(r["frequency"]), np.abs(r["offset"])
    corner = np.exp(np.interp(0, np.log(1 / (np.sqrt(2) * gain)), np.log(frequency)))
    assert corner == pytest.approx(15.9, rel=0.005)
    # and what is left of a 488.28 Hz PWM's fundamental
    assert np.interp(488.28, frequency, gain) == pytest.approx(
        1 / np.hypot(1, 488.28 / 15.915), rel=0.01
    )


COILS = {
    "carlton": ({"coil_resistance": 7.1, "coil_inductance": 1.2e-3}, 3.7, 23e3),
    "small": ({"coil_resistance": 8.0, "coil_inductance": 0.2e-3}, 9.7, 56e3),
    "eddy": (
        {
            "coil_resistance": 4.3,
            "coil_inductance": 0.87e-3,
            "eddy_inductance": 1.46e-3,
            "eddy_resistance": 3.83,
        },
        None,
        None,
    ),
}


def phase_margin(tmp_path, name, parameters):
    """The current loop, opened between sense resistor and inverting input."""
    broken = {
        "amplifier": (
            (
                r"^Gask 0 slewing v1 sense .*$",
                "Gask 0 slewing v1 broken {ask}\nVtest broken 0 AC 1",
            ),
        ),
        "full": (
            (
                r"^Xpower v1 sense .*$",
                (CIRCUITS / "full.cir").read_text().split("\nXpower")[1].split("\n")[0],
            ),
            (r"^Vdac.*$", "Vdac dac 0 0\nVtest broken 0 AC 1"),
            (r"^Voffset.*$", "Voffset pwm 0 0"),
        ),
    }[name]
    if name == "full":
        line = "Xpower" + broken[0][1].replace("v1 sense", "v1 broken")
        broken = ((broken[0][0], line), *broken[1:])
    r = run(tmp_path, netlist(name, *broken, tran=".ac dec 200 1k 1meg", **parameters))
    loop = -r["sense"]
    frequency = crossing(r["frequency"], loop)
    phase = np.interp(frequency, np.abs(r["frequency"]), np.unwrap(np.angle(loop)))
    return np.degrees(phase) + 180, frequency


@pytest.mark.parametrize("name", ["amplifier", "full"])
@pytest.mark.parametrize("coil", ["carlton", "small"])
def test_phase_margin(tmp_path, name, coil):
    parameters, margin, frequency = COILS[coil]
    found, at = phase_margin(tmp_path, name, parameters)
    assert found == pytest.approx(margin, abs=0.1)
    assert at == pytest.approx(frequency, rel=0.02)


@pytest.mark.parametrize("name", ["amplifier", "full"])
def test_eddy_losses_raise_the_phase_margin(tmp_path, name):
    parameters = COILS["eddy"][0]
    found, at = phase_margin(tmp_path, name, parameters)
    omega = 2 * np.pi * at
    impedance = 8.3 + 1j * omega * 0.87e-3 + 1 / (1 / 3.83 + 1 / (1j * omega * 1.46e-3))
    loop = 1e6 / (1j * at) * 4 / impedance
    assert abs(loop) == pytest.approx(1, rel=1e-2)
    assert found == pytest.approx(180 + np.degrees(np.angle(loop)), abs=0.1)
    plain, _ = phase_margin(tmp_path, name, {**parameters, "eddy_inductance": 0.0})
    assert found > plain + 1


def test_coils_in_parallel_share_the_current(tmp_path):
    edit = (r"^Vcommand.*$", "Vcommand v1 0 0\nVac out 0 AC 1")
    cut = (r"^Eout.*$", "")
    values = {"eddy_inductance": 1.46e-3, "eddy_resistance": 3.83}
    decks = [
        netlist("amplifier", edit, cut, tran=".ac dec 5 10 100k", count=n, **values) for n in (1, 2)
    ]
    one, two = run_all(tmp_path, *decks)
    single = (one["out"] - one["sense"]) / one["vemf#branch"]
    double = (two["out"] - two["sense"]) / two["vemf#branch"]
    s = 2j * np.pi * np.abs(one["frequency"])
    np.testing.assert_allclose(
        single, 7.1 + s * 1.2e-3 + 1 / (1 / 3.83 + 1 / (s * 1.46e-3)), rtol=1e-9
    )
    np.testing.assert_allclose(double, single / 2, rtol=1e-9)


# --- amplifier.cir against its own defining equation --------------------------------


def amplifier_ode(
    points,
    stop,
    high=14.0,
    low=-14.0,
    rs=4.0,
    gbw=1e6,
    decibels=98.0,
    slew=10e6,
    r=7.1,
    henry=1.2e-3,
):
    """Integrates the defining equation from corner to corner: (t0, t1, solution, mode) each."""
    w, leak = 2 * np.pi * gbw, 2 * np.pi * gbw / 10 ** (decibels / 20)
    times, values = np.array(points).T

    def ask(t, y):
        return w * (np.interp(t, times, values) - rs * y[1]) - leak * y[0]

    def event(function, direction):
        function.terminal, function.direction = True, direction
        return function

    def slope(t, y, rail, slewing):
        va = {0: y[0], 1: high, -1: low}[rail]
        asked = 0.0 if rail else slewing * slew if slewing else ask(t, y)
        return [asked, (va - (r + rs) * y[1]) / henry]

    def corners(rail, slewing):
        """Where this mode ends: next mode, function, direction of its zero."""
        if rail:
            return [((0, 0), lambda t, y, *_: ask(t, y), -rail)]
        ends = [
            ((1, 0), lambda t, y, *_: y[0] - high, 1),
            ((-1, 0), lambda t, y, *_: y[0] - low, -1),
        ]
        for sign in (slewing,) if slewing else (1, -1):
            mode, direction = ((0, 0), -sign) if slewing else ((0, sign), sign)
            ends.append((mode, lambda t, y, *_, sign=sign: ask(t, y) - sign * slew, direction))
        return ends

    y, rail = [0.0, 0.0], 0
    for start, end in zip(times, [*times[1:], stop], strict=True):
        t = start
        rail = 0 if rail * ask(t, y) < 0 else rail
        slewing = 0 if rail else int(np.sign(ask(t, y))) * (abs(ask(t, y)) > slew)
        while t < end:
            ends = corners(rail, slewing)
            s = solve_ivp(
                slope,
                (t, end),
                y,
                "DOP853",
                args=(rail, slewing),
                events=[event(function, direction) for _, function, direction in ends],
                rtol=1e-10,
                atol=1e-12,
                max_step=2e-5,
                dense_output=True,
            )
            yield t, s.t[-1], s.sol, (rail, slewing)
            t, y = s.t[-1], list(s.y[:, -1])
            if s.status == 1:
                found = [len(at) > 0 for at in s.t_events]
                rail, slewing = ends[found.index(True)][0]
                y[0] = {0: y[0], 1: high, -1: low}[rail]


# rest, +2.8 V, flyback to -5.2 V (slews, then rails for 1 ms), and back up through a ramp
POINTS = [(0, 0), (1e-6, 2.8), (4e-3, 2.8), (4.001e-3, -5.2), (8e-3, -3.0)]


@pytest.fixture(scope="module")
def exact():
    grid = np.linspace(0, 8e-3, 80001)
    out, rail = np.empty((2, grid.size)), np.zeros(grid.size)
    pieces = list(amplifier_ode(POINTS, 8e-3))
    for t0, t1, solution, mode in pieces:
        inside = (grid >= t0) & (grid <= t1)
        out[:, inside], rail[inside] = solution(grid[inside]), mode[0]
    return grid, out[0], out[1], rail, {mode for *_, mode in pieces}


def amplifier_deck(points, stop, step, options):
    flat = " ".join(f"{t!r} {v!r}" for t, v in points)
    return netlist(
        "amplifier",
        (r"^Vcommand.*$", f"Vcommand v1 0 PWL({flat})"),
        tran=f".tran 10u {stop} 0 {step}",
        options=options,
    )


def test_amplifier_follows_its_equation_through_a_flyback(tmp_path, exact):
    grid, va, current, rail, modes = exact
    assert {(-1, 0), (0, -1), (0, 0)} <= modes  # the reference rails and slews
    coarse, fine = run_all(
        tmp_path,
        amplifier_deck(POINTS, 8e-3, "20u", "reltol=1e-5 method=gear"),
        amplifier_deck(POINTS, 8e-3, "2u", "reltol=1e-7 method=gear"),
    )
    # (largest, mean) errors in A and V; the largest sit in the ringing and in the 1 us corners
    for r, bounds in ((coarse, (6e-3, 5e-4, 1.0, 0.06)), (fine, (5e-4, 5e-5, 0.1, 8e-3))):
        i = np.abs(np.interp(grid, r["time"], r["vemf#branch"]) - current)
        v = np.abs(np.interp(grid, r["time"], r["va"]) - va)
        found = i.max(), i.mean(), v.max(), v.mean()
        assert all(f < b for f, b in zip(found, bounds, strict=True)), found
        assert r["va"].min() > -14 - 1e-3 and r["va"].max() < 14 + 1e-3
        flag = np.interp(grid, r["time"], np.abs(r["swing"])) >= 0.5
        assert np.mean(flag != (rail != 0)) < 0.005


def test_amplifier_slewing_flag(tmp_path):
    r = run(tmp_path, amplifier_deck(POINTS, 4.1e-3, "20u", "reltol=1e-5 method=gear"))
    rate = np.abs(np.diff(r["va"]) / np.diff(r["time"]))
    flag = (np.abs(r["slewing"]) >= 0.5) & (np.abs(r["swing"]) < 0.5)
    both = flag[1:] & flag[:-1]
    assert both.sum() > 5
    np.testing.assert_allclose(
        rate[both], 10e6, rtol=0.025
    )  # the first steps after a corner are of first order
    assert np.median(rate[both]) == pytest.approx(10e6, rel=1e-3)
    assert rate[~flag[1:] & ~flag[:-1]].max() < 10.01e6


# --- the contract with the host, cost, convergence ---------------------------------

SHARED = {
    "supply": 18,
    "sense_resistance": 4,
    "current_limit": 2.504,
    "gain_bandwidth": 1e6,
    "open_loop_gain": 98,
    "slew_rate": 10e6,
    "coil_resistance": 7.1,
    "coil_inductance": 1.2e-3,
    "eddy_inductance": 0,
    "count": 1,
}


@pytest.mark.parametrize("name", ["amplifier", "full"])
def test_contract_of_the_netlists(name):
    text = (CIRCUITS / f"{name}.cir").read_text()
    lines = text.splitlines()
    assert lines[0] and lines[0][0] not in ".*"
    assert not re.search(r"^\s*\.control|^\s*A\w+ ", text, re.M | re.I)
    wanted = dict(
        SHARED, **({"swing_loss_high": 4, "swing_loss_low": 4} if name == "amplifier" else {})
    )
    for key, value in wanted.items():
        (found,) = re.findall(rf"^\.param {key}=(\S+)$", text, re.M)
        assert float(found) == pytest.approx(value)
    assert len(re.findall(r"^\.param eddy_resistance=\S+$", text, re.M)) == 1
    for source in ["Vemf c3 sense"] + (
        ["Vcommand v1 0"] if name == "amplifier" else ["Vdac dac 0", "Voffset pwm 0"]
    ):
        assert len(re.findall(rf"^{source} \S", text, re.M)) == 1
    for included in re.findall(r"^\.include (\S+)", text, re.M):
        assert (CIRCUITS / included).is_file() and "/" not in included


@pytest.mark.parametrize("name", ["amplifier", "full"])
@pytest.mark.skipif(not shutil.which("ngspice"), reason="the ngspice program is not installed")
def test_netlist_runs_as_it_is_in_plain_ngspice(tmp_path, name):
    raw = tmp_path / "out.raw"
    done = subprocess.run(
        ["ngspice", "-b", "-r", str(raw), f"{name}.cir"],
        cwd=CIRCUITS,
        text=True,
        capture_output=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    assert not re.search("error|singular|too small|gmin", done.stdout + done.stderr, re.I)
    assert raw.stat().st_size > 1e5


@pytest.mark.parametrize("name", ["amplifier", "full"])
def test_external_sources_replace_the_stand_alone_ones(tmp_path, name):
    v1 = [0, 1e-6, 10e-3], [0.0, -1.0, 1.0]
    emf = [0, 5e-3, 5.001e-3, 10e-3], [0.0, 0.0, 0.5, 0.5]
    edits = [(r"^Vemf .*$", "Vemf c3 sense external")]
    if name == "amplifier":
        edits.append((r"^Vcommand .*$", "Vcommand v1 0 external"))
        external = {"vcommand": v1, "vemf": emf}
    else:
        edits += [
            (r"^Vdac .*$", "Vdac dac 0 external"),
            (r"^Voffset .*$", "Voffset pwm 0 external"),
        ]
        external = {
            "vdac": (v1[0], [1 - v * 4.7 / 15 for v in v1[1]]),
            "voffset": ([0], [1.0]),
            "vemf": emf,
        }
    r = run(tmp_path, netlist(name, *edits, tran=".tran 10u 10m 0 20u"), external=external)
    assert r["time"][-1] == pytest.approx(10e-3)
    assert abs(r["vemf#branch"][0]) < 1e-5
    t = np.array([2e-3, 4.9e-3, 9e-3])
    np.testing.assert_allclose(
        np.interp(t, r["time"], r["vemf#branch"]), np.interp(t, *v1) / 4, atol=2e-4
    )
    # the EMF opposes the current: the output rises by it
    steady = (
        np.interp(9e-3, r["time"], r["out"]) - np.interp(9e-3, r["time"], r["vemf#branch"]) * 11.1
    )
    assert steady == pytest.approx(0.5 + 1.2e-3 * 50, abs=5e-3)


@pytest.mark.parametrize("name, accepted", [("amplifier", 16e3), ("full", 24e3)])
def test_steps_are_few_and_newton_converges(tmp_path, name, accepted):
    r = run(tmp_path, netlist(name, tran=".tran 10u 0.1 0 100u"))
    count = r.count
    assert r["time"][-1] == pytest.approx(0.1)
    assert not any(re.search("gmin|singular|too small", line) for line in r.log)
    assert count["accepted"] / 0.1 < accepted
    assert count["rejected"] < 0.3 * count["accepted"]
    assert count["iterations"] < 2.25 * (count["accepted"] + count["rejected"])
    # no false limit cycle: in the second half of the ramp the current follows the command
    late = ((r["time"] % 0.05) > 0.025) & ((r["time"] % 0.05) < 0.0499)
    assert np.abs(r["vemf#branch"] - r["v1"] / 4)[late].max() < 1e-3


def test_full_circuit_converges(tmp_path):
    coarse, fine = run_all(
        tmp_path,
        netlist("full", tran=".tran 10u 0.06 0 20u", options="reltol=1e-5 method=gear"),
        netlist("full", tran=".tran 10u 0.06 0 2u", options="reltol=1e-7 method=gear"),
    )
    grid = np.linspace(0, 0.06, 60001)
    for vector, largest, mean in (("vemf#branch", 1e-2, 1e-4), ("out", 1.5, 0.01)):
        error = np.abs(
            np.interp(grid, coarse["time"], coarse[vector])
            - np.interp(grid, fine["time"], fine[vector])
        )
        assert error.max() < largest and error.mean() < mean, (vector, error.max(), error.mean())
    # the flyback rails at the data sheet's swing, sourcing current first, then sinking
    railed = np.abs(fine["swing"]) >= 0.5
    i, loss = fine["vemf#branch"][railed], 18 + fine["out"][railed]
    np.testing.assert_allclose(loss, 0.425 + 2.3 / 2.4 * np.maximum(0, -i), atol=2e-3)
    assert railed.any() and i.max() > 0.6 and i.min() < -1.25


def test_full_circuit_current_limit_acts(tmp_path):
    r = run(tmp_path, netlist("full", tran=".tran 10u 10m 0 20u", current_limit=1.0))
    assert np.abs(r["vemf#branch"]).max() == pytest.approx(1.0, rel=2e-3)
    assert (np.abs(r["climit"]) >= 0.5).any()
