"""No failure of a netlist, of ngspice or of PySpice passes as a result.

Each case: what is injected, what the reader is told (one sentence, with the netlist's line where it
is known), with which exit code. After each, a good run in the same process gives what it gave
before.
"""

import itertools
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosim.circuit import ngspice
from cosim.circuit.joined import Deck, Edges
from cosim.coupling.loop import lead
from cosim.coupling.methods.jacobi import Jacobi
from cosim.errors import BadInput, CosimError, SimulationFailed
from cosim.files.resources import circuits
from cosim.scene import Scene, load
from cosim.simulation import elsewhere
from cosim.simulation.rungs.spice import _refuse_foreign_coil
from cosim.simulation.simulate import simulate
from cosim.toolchain import processes, worker
from tests.helpers import needs

pytestmark = pytest.mark.reliability

SHORT = ["run.duration=0.01", "run.settle=0.005"]
AMPLIFIER = (circuits() / "amplifier.cir").read_text(encoding="utf-8")


def good_run() -> np.ndarray:
    return simulate(load("reference", SHORT)).columns["z_part"]


@pytest.fixture(scope="module")
def before() -> np.ndarray:
    return good_run()


def edited(old: str, new: str) -> str:
    assert old in AMPLIFIER, old
    return AMPLIFIER.replace(old, new)


SENSE = "Rsense sense 0 {sense_resistance}"
NETLISTS = {
    "undefined parameter": (edited(SENSE, "Rsense sense 0 {lost}"), r"own\.cir:\d+: .*lost"),
    "unknown model": (edited(SENSE, f"{SENSE}\nD1 out 0 nomodel"), r"own\.cir:\d+: .*nomodel"),
    "unknown subcircuit": (edited(SENSE, f"{SENSE}\nX1 out 0 nosub"), r"own\.cir:\d+: .*nosub"),
    "missing include": (edited(SENSE, f"{SENSE}\n.include gone.lib"), r"own\.cir:\d+: .*gone\.lib"),
    "resistor without value": (edited(SENSE, "Rsense sense 0"), r"own\.cir:\d+: .*rsense"),
    "floating node": (edited(SENSE, f"{SENSE}\nC9 out adrift 1u\nC8 adrift 0 1u"), r"adrift"),
    "no source of the back-EMF": (edited("Vemf c3 sense 0", "R9 c3 sense 1m"), r"Vemf"),
    "no source of the command": (edited("Vcommand v1 0", "Vother v1 0"), r"Vcommand"),
    "truncated in a bracket": (AMPLIFIER[: AMPLIFIER.index("{1e-3*slew}") + 5], r"own\.cir"),
    "truncated in a subcircuit": (
        edited("\n.end\n", "\n.subckt cut a b\nR1 a b 1\n.end\n"),
        r"\.ends",
    ),
    "back-EMF the wrong way round": (edited("Vemf c3 sense", "Vemf sense c3"), r"in series with"),
    "back-EMF beside the coil": (
        edited("Vemf c3 sense 0", "R9 c3 sense 1m\nR8 x8 0 1k\nVemf x8 0 0"),
        r"in series with",
    ),
    "another resistance": (edited("{coil_resistance/count}", "7.4"), r"has 7\.4 Ohm .* 7\.1 Ohm"),
    "another inductance": (edited("{coil_inductance/count}", "1.3m"), r"1\.3 mH, .* 1\.2 mH"),
    "command in the netlist": (
        edited(SENSE, f"{SENSE}\n.control\nshell touch marker\n.endc"),
        r"own\.cir:\d+: .*control",
    ),
}  # fmt: skip

SIMULATIONS = {
    "no step succeeds": (
        edited(SENSE, f"{SENSE}\nB9 x 0 V=time>1m ? (V(x)>0.5 ? 0 : 1) : 0\nR9 x 0 1"),
        r"stopped at t = 0\.00[01]\d*.*s of 0\.01 s|range of numbers|hangs",
    ),
    "a node between current sources": (
        edited(SENSE, f"{SENSE}\nG9 0 adrift v1 0 1m\nE9 far 0 adrift 0 1\nR9 far 0 1k"),
        r"nothing determines the voltage at node adrift \(its matrix is singular\); .* ground",
    ),
    # More is fed back than the coil's 7.1 ohm take: the current grows by e in 93 us.
    "positive feedback": (
        edited(SENSE, "Bsense sense 0 V=-20*I(Vemf)"),
        r"diverges: the coil's current",
    ),
}


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of the netlists of one's own: one worker may read what lies there."""
    return tmp_path_factory.mktemp("home")


def own(home: Path, text: str) -> list[str]:
    path = home / "own.cir"
    path.write_text(text, encoding="utf-8")
    return ["circuit.model=file", f"circuit.netlist={path}", *SHORT]


@pytest.mark.parametrize("name", NETLISTS)
def test_bad_netlist(name: str, home: Path, before: np.ndarray) -> None:
    text, told = NETLISTS[name]
    with pytest.raises(BadInput, match=rf"(?i){told}") as caught:
        simulate(load("reference", own(home, text)))
    assert caught.value.exit_code == 2
    assert "\n" not in str(caught.value)
    assert np.array_equal(good_run(), before)


JUMPING = """* a voltage amplifier behind 10 ns of line
.param coil_resistance=7.1
.param coil_inductance=1.2e-3
.param count=1
Vcommand v1 0 0
Bline start 0 V=2*V(v1)
Rsource start near 50
T1 near 0 far 0 Z0=50 TD=10n
Rload far 0 50
Bout behind 0 V=2*V(far)
Rout behind out 0.5
Rcoil out c1 {coil_resistance/count}
Lcoil c1 c2 {coil_inductance/count}
Vemf c2 sense 0
Rsense sense 0 0.1
.tran 10u 0.2 0 20u
.end
"""


def test_steps_shorter_than_the_times_digits_tell_nothing_of_the_coil(home: Path) -> None:
    """ngspice takes some of 2e-16 s where the edge of the command arrives, 10 ns later."""
    path = home / "jumping.cir"
    path.write_text(JUMPING, encoding="utf-8")
    changes = ["circuit.model=file", f"circuit.netlist={path}", "run.duration=0.1"]
    assert simulate(load("paper-limited", [*changes, "run.settle=0.05"])).summary["v_average"]
    path.write_text(JUMPING.replace("{coil_inductance/count}", "1.3m"), encoding="utf-8")
    with pytest.raises(BadInput, match=r"1\.3 mH, .* 1\.2 mH"):
        simulate(load("paper-limited", changes))


def test_steps_that_miss_a_staircases_jumps_tell_nothing_of_the_coil(home: Path) -> None:
    """The package's own schematic as a user's, at the tolerance that switched circuits may need."""
    for library in circuits().glob("*.lib"):
        (home / library.name).write_text(library.read_text(encoding="utf-8"), encoding="utf-8")
    text, path = (circuits() / "full.cir").read_text(encoding="utf-8"), home / "mine.cir"
    path.write_text(text, encoding="utf-8")
    changes = ["circuit.model=file", f"circuit.netlist={path}", "drive.quantised=true"]
    changes += ["circuit.reltol=1e-4", "run.duration=0.1", "run.settle=0.05"]
    assert simulate(load("reference", changes)).summary["v_average"]
    path.write_text(text.replace("{coil_inductance/count}", "1.3m"), encoding="utf-8")
    with pytest.raises(BadInput, match=r"that of \[coil\] 7\.1 Ohm and 1\.2 mH"):
        simulate(load("reference", changes))


def test_noise_of_short_steps_tells_nothing_of_the_coil() -> None:
    """Behind each edge of a PWM ngspice takes steps of 1e-11 s, in which a current has an error of
    1e-6: its sum over steps is right, that of its squares is not."""
    length = np.tile([*[1e-11] * 300, 1e-6, 1e-6], 500)
    time = np.append(0.0, np.cumsum(length))
    current, slope = 0.01 * np.sin(6e3 * time), 60.0 * np.cos(6e3 * time)
    log = {"time": time, "v(out)": 7.1 * current + 1.2e-3 * slope}
    current[1:] += (length < 1e-10) * np.random.default_rng(0).normal(0, 1e-6, len(length))
    log |= {"i(vemf)": current, "v(sense)": 0.0 * time, "emf": 0.0 * time}
    _refuse_foreign_coil(load("reference", []), log)
    with pytest.raises(BadInput, match=r"1\.2 mH, .* 1\.3 mH"):
        _refuse_foreign_coil(load("reference", ["coil.inductance=1.3e-3"]), log)


@pytest.mark.parametrize("name", SIMULATIONS)
def test_failing_circuit(name: str, home: Path, before: np.ndarray) -> None:
    text, told = SIMULATIONS[name]
    with pytest.raises(SimulationFailed, match=told) as caught:
        simulate(load("reference", own(home, text)))
    assert caught.value.exit_code == 3
    assert np.array_equal(good_run(), before)


@pytest.mark.parametrize("harm", ["os._exit(7)", "os.kill(os.getpid(), 11)"])
def test_dying_process(harm: str) -> None:
    with pytest.raises(SimulationFailed, match=r"died.*(exit code 7|SIGSEGV)"):
        processes.isolated(_harmful, harm, lambda _: None)


@pytest.mark.parametrize(
    ("limit", "harm"), [("PATIENCE", "while True: pass"), ("STALLED", "time.sleep(60)")]
)
def test_hanging_process(limit: str, harm: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, limit, 2.0)
    with pytest.raises(SimulationFailed, match=r"hangs.* 2 s.* an FMU can"):
        processes.isolated(_harmful, harm, lambda _: None)


@needs.posix
def test_a_pause_is_no_hang(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process is stopped for longer than the patience with one that works."""
    monkeypatch.setattr(worker, "PATIENCE", 1.0)
    stop = (
        "import subprocess\npid = os.getpid()\n"
        "subprocess.Popen(['sh', '-c', f'kill -STOP {pid}; sleep 3; kill -CONT {pid}'])\n"
        "time.sleep(0.3)"
    )
    assert processes.isolated(_harmful, stop, lambda _: None) is None


def _harmful(harm: str, progress: object) -> None:
    import time  # noqa: F401 (harm may use it)

    exec(harm)


def test_spoilt_library_is_left_behind(before: np.ndarray) -> None:
    bounds = elsewhere.bounds(load("reference", SHORT))
    calls = [processes.isolated(_spoil_or_run, spoil, lambda _: None, bounds) for spoil in (1, 0)]
    assert calls[0] != calls[1][0]
    assert np.array_equal(calls[1][1], before)


def _spoil_or_run(spoil: int, progress: object) -> object:
    if not spoil:
        return os.getpid(), good_run().tolist()
    deck = "spoilt\nV1 a 0 1\nR1 a 0 {nothing}\n.tran 1u 1m\n.end"
    lead.engine().transient(Deck(deck, {"v(a)": "v(a)"}, Edges((), 0.0)), _Nobody())
    assert ngspice.Engine.poisoned
    return os.getpid()


class _Nobody(ngspice.Leader):
    def __init__(self) -> None:
        self.places = [0, 0]

    def begin(self) -> None: ...

    def finish(self) -> None: ...

    def stop(self) -> None: ...


@pytest.mark.parametrize("failure", [ValueError("a fault"), KeyboardInterrupt()])
@pytest.mark.parametrize("name", ["emf", "current"])
def test_exception_in_a_method(
    name: str, failure: BaseException, monkeypatch: pytest.MonkeyPatch, before: np.ndarray
) -> None:
    original = getattr(Jacobi, name)
    calls = itertools.count()

    def fail(*arguments: object) -> object:
        if next(calls) > 20:
            raise failure
        return original(*arguments)

    monkeypatch.setattr(Jacobi, name, fail)
    with processes.in_place(), pytest.raises(type(failure)):
        simulate(load("reference", [*SHORT, "coupling.method=jacobi"]))
    monkeypatch.undo()
    assert np.array_equal(good_run(), before)


def test_not_a_number_is_no_result(monkeypatch: pytest.MonkeyPatch, before: np.ndarray) -> None:
    calls = itertools.count()
    monkeypatch.setattr(Jacobi, "emf", lambda self, past: (np.nan if next(calls) > 20 else 0.0,))
    told = r"range of numbers|stopped at t = 0\.00"
    with processes.in_place(), pytest.raises(SimulationFailed, match=told):
        simulate(load("reference", [*SHORT, "coupling.method=jacobi"]))
    monkeypatch.undo()
    assert np.array_equal(good_run(), before)


def test_early_end_is_no_result(monkeypatch: pytest.MonkeyPatch, before: np.ndarray) -> None:
    original = lead.prepare

    def shortened(scene: Scene) -> Deck:
        made = original(scene)
        return replace(made, text=made.text.replace(" 0.01 0 ", " 0.004 0 "))

    monkeypatch.setattr(lead, "prepare", shortened)
    told = r"stopped at t = 0\.004 s of 0\.01 s"
    with processes.in_place(), pytest.raises(SimulationFailed, match=told):
        simulate(load("reference", SHORT))
    monkeypatch.undo()
    assert np.array_equal(good_run(), before)


@pytest.mark.parametrize(
    "text",
    [
        edited(" c1 ", " error_amp "),
        edited(SENSE, f"{SENSE}\nV8 aborted 0 1\nR8 aborted 0 1k"),
    ],
    ids=["a node called error_amp", "a node called aborted"],
)
def test_false_alarms_do_not_fail_a_run(text: str, home: Path, before: np.ndarray) -> None:
    # Which a netlist of one's own has finer.
    as_built_in = ["circuit.max_step=1.4e-4", "circuit.reltol=3e-5"]
    result = simulate(load("reference", [*own(home, text), *as_built_in]))
    assert np.allclose(result.columns["z_part"], before, rtol=0, atol=1e-9)


def test_startup_file_in_the_working_folder_is_not_run(tmp_path: Path) -> None:
    # Read when the library starts: hence in a fresh process.
    marker = tmp_path / "marker"
    (tmp_path / ".spiceinit").write_text(f"shell touch {marker}\n", encoding="utf-8")
    here = Path.cwd()
    os.chdir(tmp_path)
    try:
        processes.isolated(_run_scene, ["reference", SHORT], lambda _: None)
    finally:
        os.chdir(here)
    assert not marker.exists()


def _run_scene(arguments: list, progress: object) -> None:
    simulate(load(arguments[0], arguments[1]))


@pytest.mark.parametrize("variable", ["SPICE_SCRIPTS", "SPICE_LIB_DIR"])
def test_startup_file_that_a_variable_names_is_not_run(variable: str, tmp_path: Path) -> None:
    marker = tmp_path / "was-run"
    for folder in (tmp_path, tmp_path / "scripts"):
        folder.mkdir(exist_ok=True)
        (folder / "spinit").write_text(f"shell touch {marker}\n", encoding="utf-8")
    program = (
        "from cosim.scene import load\nfrom cosim.simulation.simulate import simulate\n"
        f"import os\nbefore = dict(os.environ)\nsimulate(load('paper', {SHORT}))\n"
        "assert dict(os.environ) == before"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {variable: str(tmp_path)}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert not marker.exists()


def test_every_failure_is_one_of_ours() -> None:
    assert issubclass(BadInput, CosimError) and issubclass(SimulationFailed, CosimError)
