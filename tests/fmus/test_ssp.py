"""The machine as an .ssp in other masters, as far as they are installed, against our Jacobi."""

import re
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import cosim
from benchmarks.peers import masters
from cosim.cli.main import main
from cosim.drive.command import command as command_of
from cosim.files.resources import circuits
from cosim.toolchain.processes import in_place

STEP, DURATION = 1e-4, 0.1
SHORT = {"run.duration": DURATION, "run.settle": 0.0}


@pytest.fixture(scope="module")
def heights() -> tuple[np.ndarray, np.ndarray]:
    fine = {"run.output_step": 2e-5, "circuit.max_step": 1e-5, "circuit.reltol": 1e-6}
    with in_place():
        columns = cosim.run("reference", SHORT | fine).columns
    return columns["time"], columns["z_surface"]


def error(times: np.ndarray, found: np.ndarray, true: tuple[np.ndarray, np.ndarray]) -> float:
    """Rms of the error over the rms."""
    wanted = np.interp(times, *true)
    return float(np.sqrt(np.mean((found - wanted) ** 2) / np.mean(wanted**2)))


@pytest.fixture(scope="module")
def jacobi(heights: tuple[np.ndarray, np.ndarray]) -> float:
    ours = {"coupling.method": "jacobi", "coupling.order": 0, "coupling.macro_step": STEP}
    with in_place():
        columns = cosim.run("reference", SHORT | ours | {"run.output_step": STEP}).columns
    return error(columns["time"], columns["z_surface"], heights)


@pytest.mark.parametrize("master", masters.PACKAGES)
def test_masters_are_as_exact_as_our_own_jacobi(
    tmp_path: Path, heights: tuple[np.ndarray, np.ndarray], jacobi: float, master: str
) -> None:
    file = tmp_path / "machine.ssp"
    assert main(["fmu", "ssp", "reference", "--out", str(file)]) == 0
    found = masters.run(master, file, STEP, DURATION)
    if found is None:
        pytest.skip(f"{masters.PACKAGES[master]} is not installed")
    times, there, _ = found
    assert times[-1] == pytest.approx(DURATION)
    assert 0.9 * jacobi < error(times, there, heights) < 1.1 * jacobi


def test_the_structure_joins_variables_that_are_there(tmp_path: Path) -> None:
    """Each connector is a variable of its FMU with that causality; parameters have the scene's."""
    file = tmp_path / "rig.ssp"
    given = ["--set", "mechanics.part_mass=0.012", "--set", "coil.count=2"]
    assert main(["fmu", "ssp", "square", *given, "--out", str(file)]) == 0
    with zipfile.ZipFile(file) as archive:
        root = ElementTree.fromstring(archive.read("SystemStructure.ssd"))
        known = {}
        for name in ("circuit", "mechanics"):
            inner = zipfile.ZipFile(archive.open(f"resources/{name}.fmu"))
            about = ElementTree.fromstring(inner.read("modelDescription.xml"))
            known[name] = {v.get("name"): v.get("causality") for v in about.iter("ScalarVariable")}
    ssd = "{http://ssp-standard.org/SSP1/SystemStructureDescription}"
    ssv = "{http://ssp-standard.org/SSP1/SystemStructureParameterValues}"
    kinds = {}
    for component in root.iter(f"{ssd}Component"):
        name = str(component.get("name"))
        for connector in component.iter(f"{ssd}Connector"):
            kinds[name, connector.get("name")] = connector.get("kind")
            assert known[name][connector.get("name")] == connector.get("kind")
        for parameter in component.iter(f"{ssv}Parameter"):
            assert parameter.get("name") in known[name]
    for joined in root.iter(f"{ssd}Connection"):
        assert kinds[joined.get("startElement"), joined.get("startConnector")] == "output"
        assert kinds[joined.get("endElement"), joined.get("endConnector")] == "input"
    values = {each.get("name"): each[0].get("value") for each in root.iter(f"{ssv}Parameter")}
    assert values["part_mass"] == "0.012"


@pytest.mark.parametrize("waveform", ["sawtooth", "sine", "square"])
def test_the_pins_make_the_command(tmp_path: Path, waveform: str) -> None:
    """By the schematic's own formula, V1 = (R4/R2) (V_offset - V_DAC), from rest on."""
    file = tmp_path / "rig.ssp"
    settings = {"circuit.model": "full", "drive.quantised": False, "drive.waveform": waveform}
    given = [word for key, x in settings.items() for word in ("--set", f"{key}={str(x).lower()}")]
    assert main(["fmu", "ssp", "reference", *given, "--out", str(file)]) == 0
    with zipfile.ZipFile(file) as archive:
        inner = zipfile.ZipFile(archive.open("resources/circuit.fmu"))
        deck = inner.read("resources/deck.cir").decode()
    times, volts = {}, {}
    for name in ("vdac", "voffset"):
        words = re.findall(rf"^{name} .*pwl\(([^)]*)\)", deck, re.MULTILINE | re.IGNORECASE)[0]
        times[name], volts[name] = np.array(words.split(), float).reshape(-1, 2).T
        assert np.all(np.diff(times[name]) > 0.0)  # up to the end of the run, where it jumps
    command = cosim.load("reference", {**settings, "run.duration": 1.0})
    at = np.sort(np.random.default_rng(0).uniform(0.0, 0.2, 997))  # on no jump
    pins = [np.interp(at, times[name], volts[name]) for name in ("voffset", "vdac")]
    wanted = command_of(command).values(at)
    np.testing.assert_allclose(15.0 / 4.7 * (pins[0] - pins[1]), wanted, atol=2e-3)
    assert volts["vdac"][0] == pytest.approx(volts["voffset"][0])  # no command yet


def test_a_netlists_pulses_keep_their_edges(tmp_path: Path) -> None:
    """Its FMU announces their corners, which ngspice may pass over; as that of a netlist alone."""
    own = (circuits() / "examples" / "h_bridge.cir").read_text()
    pulse = "Vpwm pwm 0 PULSE(0 1 0 1n 1n 25u 50u)\nRpwm pwm 0 1k\n"
    (tmp_path / "own.cir").write_text(own.replace(".end\n", f"{pulse}.end\n"))
    given = ["circuit.model=file", f"circuit.netlist={tmp_path / 'own.cir'}"]
    given = [word for each in given for word in ("--set", each)]
    file = tmp_path / "rig.ssp"
    assert main(["fmu", "ssp", "reference", *given, "--out", str(file)]) == 0
    with zipfile.ZipFile(file) as archive:
        inner = zipfile.ZipFile(archive.open("resources/circuit.fmu"))
        assert "\npulse\tvpwm\n" in inner.read("resources/ports.txt").decode()


@pytest.mark.parametrize(
    ("scene", "said"),
    [("paper-limited", "circuit in ngspice"), ("dc-motor", "built-in machine"),
     ("closed-loop-grasp", "constant normal_force"),
     ("reference --set coupling.method=companion", "Vcommand and Vemf")],
)  # fmt: skip
def test_what_cannot_be_one_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], scene: str, said: str
) -> None:
    assert main(["fmu", "ssp", *scene.split(), "--out", str(tmp_path / "a" / "x.ssp")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("model", ["ideal", "auto"])
def test_a_scene_without_a_netlist_of_its_own_is_refused(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """auto, too, which takes a rung only as it runs."""
    target = tmp_path / "machine.ssp"
    asked = ["fmu", "ssp", "reference", f"--set=circuit.model={model}", "--out", str(target)]
    assert main(asked) == 2 and not target.exists()
    assert "circuit.model must be one of full, amplifier, file, " in capsys.readouterr().err
