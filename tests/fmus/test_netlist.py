"""A netlist as an FMU, through FMPy in a process of its own, against plain ngspice."""

import json
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from cosim.cli.main import main
from tests.helpers import spice

FILTER = """* filter
.param rs=1k
Vin in 0 0
Vp p 0 PULSE(0 1 {50u} 1u 1u {200u} 400u)
R1 in a {rs}
Rp p a 2k
L1 a b 10m
C1 b 0 100n ic=0
Dl b 0 DM
.model DM D(Is=1e-12 Rs=10)
Iload 0 b 0
.end
"""
OUTPUTS = ("v(b)", "i(Vin)", "v(b)*i(Vin)")
STEP, END = 5e-6, 4e-3

# Steps FMUs of either version; what to do comes as JSON, and what they give goes back.
CHILD = r"""
import json, os, sys, threading
import numpy as np
import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
job = json.load(sys.stdin)
said, found, alive = [], [], []
class Instance:
    def __init__(self, path):
        about = fmpy.read_model_description(path)
        self.three = about.fmiVersion == "3.0"
        self.places = {v.name: v.valueReference for v in about.modelVariables}
        kind = FMU3Slave if self.three else FMU2Slave
        self.fmu = kind(guid=about.guid, modelIdentifier=about.coSimulation.modelIdentifier,
                        unzipDirectory=fmpy.extract(path), instanceName="one")
        def log3(environment, status, category, message): said.append(message.decode())
        def log2(environment, name, status, category, message): said.append(message.decode())
        if self.three:
            from fmpy.fmi3 import fmi3LogMessageCallback
            self.fmu.instantiate(logMessage=fmi3LogMessageCallback(log3))
        else:
            from fmpy.fmi2 import fmi2CallbackFunctions, fmi2CallbackLoggerTYPE, defaultCallbacks
            calls = fmi2CallbackFunctions()
            calls.logger = fmi2CallbackLoggerTYPE(log2)
            calls.allocateMemory = defaultCallbacks.allocateMemory
            calls.freeMemory = defaultCallbacks.freeMemory
            self.fmu.instantiate(callbacks=calls)
    def set(self, values):
        name = "setFloat64" if self.three else "setReal"
        getattr(self.fmu, name)([self.places[k] for k in values], list(values.values()))
    def get(self, names):
        name = "getFloat64" if self.three else "getReal"
        return getattr(self.fmu, name)([self.places[k] for k in names])
    def begin(self, stop, values):
        self.set(values)
        if self.three:
            self.fmu.enterInitializationMode(startTime=0.0, stopTime=stop)
        else:
            self.fmu.setupExperiment(startTime=0.0, stopTime=stop)
            self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
def steps():
    for line in job["runs"]:
        one = Instance(line["path"])
        if line.get("second"):
            Instance(line["second"])
        one.begin(line.get("stop"), line.get("start", {}))
        h, rows = line["h"], [one.get(line["outputs"])]
        for k in range(line["n"]):
            t = k * h
            at = {n: np.interp([t, t + h], *p) for n, p in line.get("inputs", {}).items()}
            one.set({n: v[0] for n, v in at.items()})
            one.set({f"{n}_slope": (v[1] - v[0]) / h for n, v in at.items()})
            one.fmu.doStep(line.get("from", t), h)
            rows.append(one.get(line["outputs"]))
        one.fmu.terminate()
        one.fmu.freeInstance()
        found.append(rows)
        alive.append(len(os.listdir("/proc/self/task")) if os.path.isdir("/proc") else 0)
try:
    alive.append(len(os.listdir("/proc/self/task")) if os.path.isdir("/proc") else 0)
    steps()
except Exception as error:
    said.append("raised: " + str(error)[:200])
json.dump({"found": found, "said": said, "alive": alive}, sys.stdout)
"""


def stepped(*runs: dict[str, Any], child: str = CHILD, **environment: str) -> dict[str, Any]:
    import os

    done = subprocess.run(
        [sys.executable, "-c", child],
        input=json.dumps({"runs": runs}),
        env={**os.environ, **environment},
        text=True,
        capture_output=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout[done.stdout.index('{"found') :])


def packed(folder: Path, version: str = "2", text: str = FILTER, name: str = "filter") -> str:
    path = folder / f"{name}.cir"
    path.write_text(text)
    given = ["--input", "Vin", "--input", "Iload", "--max-step", str(STEP), "--fmi", version]
    asked = [part for words in OUTPUTS for part in ("--output", words)]
    assert main(["fmu", "netlist", str(path), *given, *asked, "--out", str(folder)]) == 0
    return str(folder / f"{name}.fmu")


def sine(t: np.ndarray) -> np.ndarray:
    return 3.0 * np.sin(2 * np.pi * 500.0 * t)


@pytest.mark.parametrize("version", ["2", "3"])
def test_it_computes_what_plain_ngspice_does(tmp_path: Path, version: str) -> None:
    """Inputs that go on along lines between points 20 us apart; a PULSE of the netlist's own, none
    of whose edges is lost; a parameter that the importer sets."""
    path, h = packed(tmp_path, version), 2e-5
    assert not validate_fmu(path)
    t = np.arange(0.0, END + h / 2, h)
    given = {
        "sine": {"Vin": [[*t], [*sine(t)]]},
        "constant": {"Vin": [[0.0, 1e-9], [2.0, 2.0]], "Iload": [[0.0], [1e-4]]},
    }
    for name, inputs in given.items():
        start = {"rs": 500.0} | {key: line[1][0] for key, line in inputs.items()}
        run = {"path": path, "h": h, "n": len(t) - 1, "outputs": OUTPUTS[:3], "inputs": inputs}
        result = stepped(run | {"start": start, "stop": END})
        assert not result["said"]
        voltage, current, power = np.array(result["found"][0]).T
        points = " ".join(f"{a:.17g} {b:.17g}" for a, b in zip(t, sine(t), strict=True))
        source = {"sine": f"PWL({points})"}
        deck = FILTER.replace("Vin in 0 0", f"Vin in 0 {source.get(name, '2')}")
        deck = deck.replace("rs=1k", "rs=500").replace("b 0\n.end", "b 1e-4\n.end")
        deck = deck if name == "constant" else deck.replace("b 1e-4", "b 0")
        fine = f".options reltol=1e-6\n.tran 1u {END} 0 1u\n.end"
        true = spice.run(tmp_path, deck.replace(".end", fine))
        for mine, vector in ((voltage, "b"), (current, "vin#branch")):
            wanted = np.interp(t, true["time"], true[vector])
            assert np.abs(mine - wanted).max() < 2e-3 * np.abs(wanted).max(), (name, vector)
        wanted = voltage * current  # which ngspice solves for within its tolerance
        assert np.abs(power - wanted).max() < 1e-3 * np.abs(wanted).max()


def test_a_circuit_without_operating_point_begins_as_in_ngspice(tmp_path: Path) -> None:
    """A relaxation oscillator between 0.3 and 0.7 V: R C ln(7/3) to fill, r C ln(7/3) to empty."""
    path = tmp_path / "oscillator.cir"
    path.write_text(
        "t\nVs s 0 1\nR1 s c 1k\nC1 c 0 1u\nS1 c 0 c 0 dump\n"
        ".model dump SW(vt=0.5 vh=0.2 ron=1 roff=1meg)\n.end\n"
    )
    given = ["--output", "v(c)", "--max-step", "1e-6", "--out", str(tmp_path)]
    assert main(["fmu", "netlist", str(path), *given]) == 0
    fmu, h = str(tmp_path / "oscillator.fmu"), 1e-5
    run = {"path": fmu, "h": h, "n": 1000, "outputs": ["v(c)"], "inputs": {}, "start": {}}
    result = stepped(run | {"stop": 0.01})
    v = np.array(result["found"][0])[:, 0] - 0.5
    (up,) = np.nonzero((v[:-1] < 0) & (v[1:] >= 0))
    crossed = h * (up - v[up] / (v[up + 1] - v[up]))
    assert np.diff(crossed).mean() == pytest.approx(1001e-6 * np.log(7.0 / 3.0), rel=5e-3)


def test_one_instance_after_the_other_but_not_two_at_once(tmp_path: Path) -> None:
    """The end of an instance leaves no thread, and the next one starts afresh; the second of two,
    even of another netlist, is refused in a message."""
    first = packed(tmp_path)
    other = packed(tmp_path, "3", FILTER.replace("rs=1k", "rs=2k"), "other")
    run = {"h": 1e-4, "n": 3, "outputs": ["v(b)"], "inputs": {"Vin": [[0.0], [1.0]]}}
    alone = [run | {"path": path} for path in (first, first, other, first)]
    result = stepped(*alone)
    one, again, different, last = (np.array(rows) for rows in result["found"])
    assert (one == again).all() and (one == last).all() and (one != different)[1:].any()
    assert len(set(result["alive"][1:])) == 1
    refused = stepped(alone[0] | {"second": other})
    assert "in this process already" in refused["said"][0]


def test_what_goes_wrong_is_told_in_a_message(tmp_path: Path) -> None:
    path = packed(tmp_path)
    run = {"path": path, "h": 1e-4, "n": 3, "outputs": ["v(b)"]}
    none = stepped(run, NGSPICE_LIBRARY_PATH=str(tmp_path / "none.so"))
    assert "install it" in none["said"][0] and "NGSPICE_LIBRARY_PATH" in none["said"][0]
    child = CHILD.replace("import json", "import ctypes, ctypes.util, json", 1)
    child = child.replace("try:", 'ctypes.CDLL(ctypes.util.find_library("ngspice"))\ntry:', 1)
    assert "something else in this process" in stepped(run, child=child)["said"][0]
    assert "past the stop time" in stepped(run | {"stop": 2e-4})["said"][0]
    assert "must begin at" in stepped(run | {"from": 0.0})["said"][0]
    # A capacitor's current without bound: no time step is short enough.
    text = FILTER.replace("Iload 0 b 0", "Iload 0 b 0\nBx 0 b I=exp(1000*v(b)*(time>1e-4))-1")
    broken = stepped(run | {"path": packed(tmp_path, "2", text, "broken")})
    assert "ngspice stopped before" in broken["said"][0]
    assert "too small" in broken["said"][0]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"v(b)"', "v(nowhere)", "no node nowhere"),
        ('"v(b)"', "", '--output = "" must be a vector or an expression'),
        ("Iload", "R1", '--input = "R1" must be a V or I source'),
    ],
)
def test_what_the_netlist_lacks_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, said: str
) -> None:
    (tmp_path / "filter.cir").write_text(FILTER)
    given = ["--input", "Iload", "--output", '"v(b)"']
    given = [word.replace(old, new).strip('"') for word in given]
    out = tmp_path / "out"
    assert main(["fmu", "netlist", str(tmp_path / "filter.cir"), *given, "--out", str(out)]) == 2
    assert said in capsys.readouterr().err
    assert not out.exists()


def test_its_variables_are_each_ones_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Parameters that the netlist gives twice, or that are called as a source, are none."""
    (tmp_path / "own.cir").write_text(
        "t\n.param vin=12\n.param r=1k\n.param r=2k\n.param c=1u\n"
        "Vin 2 0 1\nR1 2 3v3 {r}\nR2 3v3 0 {r}\nC1 3v3 0 {c}\n.end\n"
    )
    given = [str(tmp_path / "own.cir"), "--output", "v(3v3)", "--out", str(tmp_path)]
    assert main(["fmu", "netlist", *given, "--input", "vin"]) == 0
    described = fmpy.read_model_description(str(tmp_path / "own.fmu"))  # refuses what is double
    assert {each.name for each in described.modelVariables if each.causality == "parameter"} == {
        "c"
    }
    twice = ["--output", "v(3v3)", "--output", "v(2)"]  # the first is in ``given``, too
    assert main(["fmu", "netlist", *given, *twice]) == 0
    with zipfile.ZipFile(tmp_path / "own.fmu") as archive:
        rows = archive.read("resources/ports.txt").decode().splitlines()
    vectors = {row.split("\t")[1]: row.split("\t")[-1] for row in rows if row[:6] == "output"}
    assert vectors == {"v(3v3)": "V(3v3)", "v(2)": "V(2)"}
    for wrong, said in (
        (["--input", "vin", "--input", "VIN"], "names a source twice"),
        (["--max-step", "inf"], "--max-step must be above 0 s and finite"),
    ):
        assert main(["fmu", "netlist", *given, *wrong]) == 2
        assert said in capsys.readouterr().err


def test_it_holds_nothing_that_a_stranger_could_run(tmp_path: Path) -> None:
    """The deck is the parsed one; a script in it is refused as in a scene."""
    bad = tmp_path / "bad.cir"
    bad.write_text(FILTER.replace(".end", ".control\nshell touch here\n.endc\n.end"))
    assert main(["fmu", "netlist", str(bad), "--output", "v(b)", "--out", str(tmp_path)]) == 2
    assert not (tmp_path / "bad.fmu").exists()
