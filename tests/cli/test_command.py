"""The command as a process: exit codes, one sentence for every failure, no files left behind."""

import ctypes
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

import cosim
from cosim.cli.main import main
from cosim.coupling.loop import recorder
from cosim.coupling.loop.lead import Lead
from cosim.coupling.loop.recorder import Recorder
from cosim.coupling.loop.structures import CALLBACK
from cosim.coupling.methods.mean_current import MeanCurrent
from cosim.drive.command import Lines
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.toolchain.processes import in_place
from tests.helpers import needs

pytestmark = pytest.mark.reliability

COMMAND = [sys.executable, "-m", "cosim"]
QUICK = ["--set", "run.duration=0.02", "--set", "run.output_step=1e-3"]
# The steps of the integration become so short that the FMU gives up within a second.
TOO_FAST = ["--set", "mechanics.suspension_k2=-1e15", "--set", "drive.offset=6"]


def command(
    *arguments: str | Path,
    cwd: Path,
    prepare: Callable[[], object] | None = None,
    **environment: str,
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], cwd=cwd, env=os.environ | environment,
        preexec_fn=prepare, capture_output=True, text=True, timeout=300,
    )  # fmt: skip


def complaint(done: subprocess.CompletedProcess[str], code: int = 2) -> str:
    """What stderr says, if it is one sentence in one line, and stdout is empty."""
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert done.stderr.startswith("cosim: ")
    assert done.stderr.count("\n") == 1 and done.stderr.endswith((".\n", "?\n"))
    return done.stderr


# --- bad input -------------------------------------------------------------------

BAD = [
    # arguments; what the sentence must hold
    ([], ["COMMAND"]),
    (["frobnicate"], ["'frobnicate'", "run"]),
    (["run"], ["SCENE"]),
    (["run", "held", "--frobnicate"], ["--frobnicate"]),
    (["run", "held", "--two\nlines"], ["--two lines"]),
    (["run", "held", "--set"], ["--set"]),
    (["run", "held", "--out"], ["--out"]),
    (["run", "held", "more"], ["more"]),
    (["fmu", "eat"], ["'eat'", "build", "check"]),
    (["run", "papre"], ["papre", "did you mean the built-in scene paper?"]),
    (["run", "no/such.toml"], ["no/such.toml", "no such file"]),
    (["run", "."], ["directory"]),
    (["run", "held", "--set", "runs.duration=3"], ["runs", "did you mean run?"]),
    (["run", "held", "--set", "run.durations=3"], ["did you mean run.duration?"]),
    (["run", "held", "--set", "run.duration=long"], ['run.duration = "long"', "a number from"]),
    (["run", "held", "--set", "run.duration=-1"], ["run.duration = -1", "1e-06 to 100000 s"]),
    (["run", "held", "--set", "run.duration=nan"], ["run.duration = nan", "a number from"]),
    (["run", "held", "--set", "drive.amplitude=inf"], ["drive.amplitude = inf", "0 to 100 V"]),
    (["run", "held", "--set", "friction.mu_k=0.8"], ["mu_k = 0.8", "friction.mu_s = 0.72"]),
    (["run", "held", "--set", "run.settle=3"], ["run.settle = 3 s", "run.duration = 2 s"]),
    (["run", "held", "--set", "mechanics.contact=soft"], ['"soft"', '"compliant", "rigid"']),
]


@pytest.mark.parametrize(
    ("arguments", "parts"), BAD, ids=[" ".join(arguments) or "nothing" for arguments, _ in BAD]
)
def test_bad_input(arguments: list[str], parts: list[str], tmp_path: Path) -> None:
    said = complaint(command(*arguments, cwd=tmp_path))
    for part in parts:
        assert part in said
    assert not list(tmp_path.iterdir())


def test_broken_file(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("[run]\nduration 3\n")
    said = complaint(command("run", "mine.toml", cwd=tmp_path))
    assert "mine.toml: this is not TOML" in said and "(at line 2, column 10)" in said
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


@pytest.mark.parametrize("out", ["file", "file/below"])
def test_out_is_a_file(out: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    said = complaint(command("run", "held", *QUICK, "--out", out, cwd=tmp_path))
    assert said.startswith(f"cosim: {out}: ")
    assert (tmp_path / "file").read_text() == "mine"


def obey_modes() -> None:
    """Make root, too, heed the modes of files: without CAP_DAC_OVERRIDE in what is executed."""
    if os.geteuid() == 0 and ctypes.CDLL(None).prctl(24, 1, 0, 0, 0):
        raise OSError("the capability stays")


@needs.posix
@pytest.mark.skipif(
    not sys.platform.startswith("linux") and os.name == "posix" and os.geteuid() == 0,
    reason="root may write everywhere",
)
@pytest.mark.parametrize("out", ["shut", "shut/below"])
def test_folder_without_leave_to_write(out: str, tmp_path: Path) -> None:
    (tmp_path / "shut").mkdir(mode=0o555)
    done = command("run", "held", *QUICK, "--out", out, cwd=tmp_path, prepare=obey_modes)
    assert complaint(done) == f"cosim: {out}: cannot be written to (Permission denied).\n"
    assert not list((tmp_path / "shut").iterdir())


def test_missing_ngspice(tmp_path: Path) -> None:
    done = command("run", "paper", cwd=tmp_path, NGSPICE_LIBRARY_PATH="/nonexistent")
    assert "/nonexistent: this ngspice library cannot be loaded" in complaint(done)
    assert not list(tmp_path.iterdir())


def test_scenes_without_a_circuit_need_no_ngspice(tmp_path: Path) -> None:
    done = command("run", "held", *QUICK, cwd=tmp_path, NGSPICE_LIBRARY_PATH="/nonexistent")
    assert done.returncode == 0, done.stderr


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the checkout that a test may spoil; Python run in it imports the copy."""
    root = Path(cosim.__file__).parents[1]
    if not (root / "fmu" / "src").is_dir():
        pytest.skip("cosim does not run from a checkout")
    folder = tmp_path / "copy"
    for name in ("cosim", "fmu", "circuits"):
        # What Python has compiled goes along, but for what another process is just writing.
        leave_out = shutil.ignore_patterns("*.pyc.*")
        shutil.copytree(root / name, folder / name, ignore=leave_out)
    return folder


@pytest.mark.parametrize("gone", ["fmi3", "fmi3/binaries"])
def test_incomplete_installation(copy: Path, gone: str) -> None:
    shutil.rmtree(copy / "cosim" / "_compiled" / gone)
    done = command("run", "held", *QUICK, "--out", "out", cwd=copy)
    assert re.search("is missing from this installation|cannot be loaded", complaint(done))
    assert not (copy / "out").exists()


def test_broken_netlist(copy: Path) -> None:
    netlist = copy / "circuits" / "amplifier.cir"
    text, number = re.subn(r"(?m)^Rcoil .*", "X1 out c1 nosuch", netlist.read_text())
    assert number == 1
    netlist.write_text(text)
    done = command("run", "paper", *QUICK, "--out", "out", cwd=copy)
    assert re.search(r"amplifier\.cir:\d+: .*nosuch", complaint(done, 2))
    assert not (copy / "out").exists()


def test_failing_mechanics(tmp_path: Path) -> None:
    done = command("run", "ideal-current", *TOO_FAST, "--out", "out", cwd=tmp_path)
    said = complaint(done, 3)
    assert "The mechanics failed at t = " in said and "internal steps" in said
    assert not list(tmp_path.iterdir())


def test_failing_run_keeps_the_older_one(tmp_path: Path) -> None:
    (tmp_path / "waveforms.csv").write_text("old")
    assert main(["run", "ideal-current", *TOO_FAST, "--out", str(tmp_path)]) == 3
    assert [path.name for path in tmp_path.iterdir()] == ["waveforms.csv"]
    assert (tmp_path / "waveforms.csv").read_text() == "old"


# --- full disks, closed pipes, other alphabets -----------------------------------


@needs.posix
@pytest.mark.parametrize(("size", "file"), [(3000, "out"), (40_000, "out/figure.png")])
def test_full_disk(size: int, file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import resource

    run = ("run", "held", *QUICK, "--set", "run.output_step=2e-4", "--out", "out")
    monkeypatch.chdir(tmp_path)
    assert main([*run]) == 0
    before = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}

    def prepare() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    done = command(*run, cwd=tmp_path, prepare=prepare, PYTHONDONTWRITEBYTECODE="1")
    assert complaint(done) == f"cosim: {file}: cannot be written (File too large).\n"
    after = {path.name: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    del before["summary.json"], after["summary.json"]  # the time it took
    if file.endswith("figure.png"):
        del before["figure.png"]  # of another run than the numbers now beside it
    assert after == before


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_output_cannot_be_written(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*COMMAND, "scenes"], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2
    assert done.stderr == "cosim: The output cannot be written: No space left on device.\n"


@needs.posix
def test_reader_has_left(tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [*COMMAND, "scenes"], cwd=tmp_path, stdout=writer, stderr=subprocess.PIPE, text=True
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


def test_plain_ascii_output(tmp_path: Path) -> None:
    done = command("run", "held", *QUICK, cwd=tmp_path, PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert done.stdout.isascii() and "Written to" in done.stdout


def test_default_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", "held", *QUICK]) == 0
    assert capsys.readouterr().err == ""
    assert (tmp_path / "results" / "held" / "summary.json").exists()


# --- Ctrl-C ----------------------------------------------------------------------


def heed_interrupts() -> None:
    """A shell's background jobs ignore Ctrl-C, and so would their children."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def worked(process: psutil.Process) -> float:
    """CPU seconds of a process and its workers."""
    spent = 0.0
    for one in (process, *process.children()):
        with suppress(psutil.NoSuchProcess):  # one that was needed for a moment
            spent += sum(one.cpu_times()[:2])
    return spent


@needs.posix
@pytest.mark.parametrize(
    "scene",
    ["paper", *(pytest.param(x, marks=pytest.mark.slow) for x in ("paper-full", "ideal-current"))],
)
def test_interrupt(scene: str, tmp_path: Path) -> None:
    """At several moments of its own time: while it loads, while it simulates."""
    running = []
    for number in range(3):
        out = tmp_path / str(number)
        long = ["--set", "run.duration=1000", "--set", "run.output_step=1e-3"]
        arguments = ["run", scene, *long, "--out", str(out)]
        process = subprocess.Popen(
            [*COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            preexec_fn=heed_interrupts,
        )  # fmt: skip
        running.append((process, out))
    try:
        for number, (process, _) in enumerate(running):
            # Not before Python itself has started, however loaded the machine.
            while worked(psutil.Process(process.pid)) < 0.4 + 0.35 * number:
                time.sleep(0.01)
            process.send_signal(signal.SIGINT)
        for process, out in running:
            said = process.communicate(timeout=120)
            assert (process.returncode, *said) == (130, "", "cosim: interrupted.\n")
            assert not out.exists()
    finally:
        for process, _ in running:
            process.kill()
            process.communicate()


@needs.posix
def test_interrupt_where_compiled_code_calls_back(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Between the call and its first line nothing in the callback itself can catch it."""
    original = recorder.callback

    def struck(
        act: Callable[[], None], fail: Callable[[BaseException], None]
    ) -> Callable[[], None]:
        planned = original(act, fail)

        def called() -> None:
            signal.raise_signal(signal.SIGINT)
            planned()

        return CALLBACK(called)

    monkeypatch.setattr(recorder, "callback", struck)
    arguments = [
        "run",
        "ideal-current",
        "--set",
        "run.duration=100",
        "--out",
        str(tmp_path / "out"),
    ]
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job may ignore it
    try:
        assert main(arguments) == 130
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr().err == "cosim: interrupted.\n"


@needs.posix
def test_interrupt_within_an_executed_string_is_130_too(tmp_path: Path) -> None:
    """As where Ctrl-C strikes while a library is imported that makes code of text."""
    program = (
        "import sys\nfrom cosim.cli import main as cli\n"
        "cli._parser = lambda arguments: exec('raise KeyboardInterrupt')\n"
        "sys.exit(cli.main(['scenes']))\n"
    )
    (tmp_path / "struck.py").write_text(program)
    # As a module: only then does Python look at what it remembers.
    run = [sys.executable, "-m", "struck"]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "cosim: interrupted.\n")


def test_interrupt_within_the_commands_imports_is_130_too(tmp_path: Path) -> None:
    (tmp_path / "argparse.py").write_text("exec('raise KeyboardInterrupt')\n")
    run = [*COMMAND, "scenes"]
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(run, env=environment, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (130, "cosim: interrupted.\n")


def test_interrupt_while_writing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was complete stays; of the rest there is nothing."""

    def interrupted(figure: object, path: Path, **_: object) -> None:
        path.write_bytes(b"half")
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.files.picture.FigureCanvasAgg.print_png", interrupted)
    assert main(["run", "held", *QUICK, "--out", str(tmp_path / "out")]) == 130
    assert capsys.readouterr().err == "cosim: interrupted.\n"
    kept = {path.name for path in (tmp_path / "out").iterdir()}
    assert kept == {"waveforms.csv", "waveforms.nc", "scene.toml", "summary.json"}


# --- failures in the middle of a run, in one process -----------------------------

SHORT = ["run.duration=0.06"]


class Trouble(Exception):
    pass


def bits(scene: str = "paper") -> dict[str, bytes]:
    return {k: v.tobytes() for k, v in simulate(load(scene, SHORT)).columns.items()}


@pytest.fixture(scope="module")
def undisturbed() -> dict[str, bytes]:
    return bits()


def after_calls(number: int, original: Callable, failure: BaseException) -> Callable:
    """The function, which raises at one call in the middle of a run."""
    calls = iter(range(number))

    def function(*arguments: object) -> object:
        if next(calls, None) is None:
            raise failure
        return original(*arguments)

    return function


@pytest.mark.parametrize(
    ("owner", "name", "calls"),
    [
        (Lead, "_attend", 0),
        (Lines, "piece", 0),
        (Recorder, "_plan", 0),
        (MeanCurrent, "current", 0),
        (MeanCurrent, "current", 1),
        (MeanCurrent, "emf", 300),
    ],
)
def test_callback_fails(
    owner: type,
    name: str,
    calls: int,
    undisturbed: dict[str, bytes],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as patch, in_place():
        patch.setattr(owner, name, after_calls(calls, getattr(owner, name), Trouble("here")))
        with pytest.raises(Trouble, match="here"):
            simulate(load("paper", [*SHORT, "coupling.method=mean-current"]))
    assert bits() == undisturbed


INTERRUPTED = """
import os, signal, threading
from cosim.scene import load
from cosim.simulation.simulate import simulate


def bits():
    return simulate(load("paper", ["run.duration=0.02"])).columns["z_part"].tobytes()

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
    before = bits()
    for number in range(20):
        # a true signal: it reaches the main thread in the midst of ngspice's C
        strike = (os.getpid(), signal.SIGINT)
        timer = threading.Timer(0.1 + 0.00822 * number, os.kill, strike)
        try:
            timer.start()
            method = ("step-locked", "jacobi")[number % 2]
            simulate(load("paper", ["run.duration=10", f"coupling.method={method}"]))
        except KeyboardInterrupt:
            pass
        else:
            raise AssertionError(f"interrupt {number} was lost")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert bits() == before
"""


@needs.posix
def test_interrupted_anywhere(tmp_path: Path) -> None:
    """Ctrl-C is not lost, wherever in a callback of ngspice it strikes."""
    # In a process of its own: the test libraries' hooks into Python would swallow some.
    (tmp_path / "interrupted.py").write_text(INTERRUPTED)
    done = subprocess.run(
        [sys.executable, str(tmp_path / "interrupted.py")], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


# --- light commands --------------------------------------------------------------

LIGHT = """
import sys
from cosim.cli.main import main

try:
    main({arguments!r})
finally:
    heavy = {{"matplotlib", "scipy", "fmpy", "PySpice", "tqdm"}}
    print("loaded:", *sorted(heavy & sys.modules.keys()), file=sys.stderr)
"""


@pytest.mark.parametrize(
    "arguments",
    [["scenes"], ["--help"], ["run", "--help"], ["chart", "limits", "--help"], ["run", "papre"]],
    ids=" ".join,
)
def test_light_commands_load_nothing_heavy(arguments: list[str], tmp_path: Path) -> None:
    program = LIGHT.format(arguments=arguments)
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stderr.splitlines()[-1] == "loaded:"


def test_scenes(tmp_path: Path) -> None:
    done = command("scenes", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    names = [line.split()[0] for line in done.stdout.splitlines() if line.startswith("  ")]
    assert names[0] == "paper"
    assert sorted(names) == sorted([
        "paper", "paper-full", "paper-knee", "paper-limited", "closed-loop-grasp", "closed-grip",
        "dc-motor", "relay", "direct-drive", "direct-drive-stops", "down-grip", "down-waveform",
        "gripper", "gripper-169g", "gripper-17g", "held", "ideal-current", "optimal", "quaid",
        "reference",
        "square", "trial",
        "trial-01", "trial-02", "trial-03", "trial-04", "trial-05", "trial-06", "trial-07",
        "trial-08", "trial-09", "trial-10", "two-surfaces", "umbanhowar",
    ])  # fmt: skip


def folder_of(*parts: str) -> Path:
    return Path(cosim.__file__).parent.joinpath(*parts)


def test_export_tells_every_format(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["export", "--help"])
    told = capsys.readouterr().out.split("--as")[-1].partition("repeatable")[0]
    listed = re.findall(r"(\w+)\s+\(", told)
    modules = {path.stem for path in folder_of("waveforms", "formats").glob("*.py")}
    assert len(listed) == len(modules - {"__init__", "source"})


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_help_and_version(option: str, tmp_path: Path) -> None:
    done = command(option, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "cosim" in done.stdout


def test_a_key_without_effect_is_a_note(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    without = ["--set", "drive.amplitude=9"]
    assert main(["run", "held", *QUICK, *without, "--out", str(tmp_path / "out")]) == 0
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith("cosim: note: --set: drive.amplitude has no effect with circuit.model")
