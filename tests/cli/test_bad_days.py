"""Bad days: each fault of machine or user, in each phase of work.

A row is a fault, a column a command. A cell is run here (QUICK, or SLOW: not by `make test`), or it
is a sentence: the test elsewhere that has it, or why the fault cannot meet the command. After each
fault whatever is left is whole, what was there before is there still or replaced, and the same
command then does its work.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from cosim.cli.main import main
from cosim.evaluate.store import Store
from cosim.files.atomic import alone
from cosim.files.resources import REPOSITORY
from cosim.scene import load
from cosim.studies.identify.problem.space import read_space
from tests.helpers import needs

resource = pytest.importorskip("resource")
pytestmark = [pytest.mark.reliability, needs.posix]

SHORT = ["--set=run.duration=0.04", "--set=run.settle=0.01"]
KNOBS = [f"--over=drive.{knob}=0.05:0.9" for knob in ("pot_max", "pot_frequency", "pot_offset")]
LONG = ["--set=run.duration=0.4", "--set=run.settle=0.1", "--workers=2"]

COMMANDS: dict[str, list[str]] = {
    "run": ["run", "ideal-current", *SHORT],
    "sweep": ["sweep", "ideal-current", *SHORT, "--over=drive.offset=-2:0:4", "--workers=1"],
    "tune": [
        *("tune", "ideal-current", "--maximise=v_average", "--over=drive.offset=-2:0", *SHORT),
        *("--budget=30", "--workers=1"),
    ],
    "identify": ["identify", "{trials}", "--quick", "--bounds={bounds}", "--workers=1"],
    "chart": ["chart", "ladder", "paper", *SHORT],
    "export": ["export", "{run}", "--as=mat,tracker"],
    "compare": ["compare", "{run}", "{trial}"],
    "fit": ["fit", "{trials}"],
    "build": ["fmu", "build"],
}
"""A brief piece of work of each command; --out is added."""

SOUGHT = {"coil.force_factor", "mechanics.surface_mass"}
"""By `identify`."""

AT_WORK: dict[str, list[str]] = {
    "run": ["run", "ideal-current", "--set=run.duration=60"],
    "sweep": ["sweep", "ideal-current", *LONG, *(f"{over}:7" for over in KNOBS)],
    "tune": ["tune", "ideal-current", *LONG, "--maximise=v_average", "--budget=800"],
    "identify": ["identify", "{trials}", "--workers=2"],
    "chart": ["chart", "stability", "--quick"],
    "fit": ["fit", "{many}"],
}
"""One that goes on for some seconds."""

LEAVES = {
    "run": {"waveforms.csv", "waveforms.nc", "scene.toml", "summary.json", "figure.png"},
    "sweep": {"sweep.nc", "sweep.sqlite", "figure.png"},
    "tune": {"tune.json", "tune.csv", "best.toml", "figure.png"},
    "identify": {"identify.json", "identify.csv", "identify.md", "rig.toml", "trial-01.toml"},
    "chart": {"ladder.csv", "ladder.md", "ladder.png"},
    "export": {"waveforms.mat", "tracker.csv"},
    "compare": {"compare.json", "compare.csv", "frames.csv", "compare.png"},
    "fit": {"fit.json", "fit.csv"},
    "build": {"stickslip-fmi2.fmu", "stickslip-fmi3.fmu"},
}

STORES = {
    "sweep": "sweep.sqlite", "tune": "tune.sqlite", "chart": "ladder.sqlite",
    "identify": "identify.sqlite",
}  # fmt: skip
"""From which a killed one goes on."""

QUICK, SLOW = "quick", "slow"
BRIEF = "it is done within a second, and writes whole files at its end as `run` does"
COMPILER = "the C is compiled by pip, whose workings these are; see tests/toolchain/test_build_c.py"
NO_NGSPICE = "it does not load ngspice"
FITTED = "what it takes does not grow: trials are of limited size, see tests/files"
POINTS = "what its runs take is a sweep's: such a point fails, and is tried again"
LITTLE = "it takes as much as what it reads; that is limited, see tests/files"
WAITS = "it waits for the same; `run` shows it"

TABLE: dict[str, dict[str, str]] = {
    "SIGKILL": {
        "run": SLOW, "sweep": "tests/studies/test_sweep_kills.py", "tune": SLOW, "chart": SLOW,
        "identify": SLOW, "export": BRIEF, "compare": BRIEF, "fit": SLOW,
        "build": "tests/toolchain/test_build_c.py: what a killed build left goes",
    },
    "SIGTERM": {
        "run": QUICK, "sweep": SLOW, "tune": SLOW, "chart": SLOW, "identify": SLOW,
        "export": BRIEF, "compare": BRIEF, "fit": SLOW, "build": COMPILER,
    },
    "SIGHUP": {
        "run": SLOW, "sweep": SLOW, "tune": SLOW, "chart": SLOW, "identify": SLOW,
        "export": BRIEF, "compare": BRIEF, "fit": SLOW, "build": COMPILER,
    },
    "Ctrl-C": {
        "run": "tests/cli/test_command.py", "sweep": "tests/studies/test_sweep_kills.py",
        "tune": QUICK, "chart": SLOW, "identify": SLOW, "export": BRIEF, "compare": BRIEF,
        "fit": SLOW, "build": COMPILER,
    },
    "STOP and CONT": {
        "run": SLOW, "sweep": "tests/studies/test_sweep_kills.py", "tune": SLOW, "chart": SLOW,
        "identify": SLOW, "export": WAITS, "compare": WAITS, "fit": SLOW, "build": COMPILER,
    },
    "disk full": {
        "run": QUICK, "sweep": "tests/studies/test_sweep_kills.py", "tune": QUICK, "chart": SLOW,
        "identify": SLOW, "export": QUICK, "compare": SLOW, "fit": SLOW, "build": QUICK,
    },
    "read-only": {
        "run": QUICK, "sweep": QUICK, "tune": QUICK, "chart": QUICK, "identify": QUICK,
        "export": QUICK, "compare": QUICK, "fit": QUICK, "build": QUICK,
    },
    "closed stdout": {
        "run": QUICK, "sweep": SLOW, "tune": SLOW, "chart": SLOW, "identify": SLOW,
        "export": QUICK, "compare": SLOW, "fit": SLOW, "build": QUICK,
    },
    "same folder twice": {
        "run": QUICK, "sweep": QUICK, "tune": SLOW, "chart": QUICK, "identify": SLOW,
        "export": QUICK, "compare": QUICK, "fit": SLOW, "build": QUICK,
    },
    "damaged files of its own": {
        "run": QUICK, "sweep": QUICK, "tune": QUICK, "chart": SLOW, "identify": SLOW,
        "export": QUICK, "compare": QUICK, "fit": SLOW,
        "build": "tests/toolchain/test_libraries.py: what is damaged is not loaded, nor packed",
    },
    "devices and pipes": {
        "run": QUICK, "sweep": QUICK, "tune": QUICK, "chart": QUICK, "identify": QUICK,
        "export": QUICK, "compare": QUICK, "fit": QUICK, "build": "it reads no file that is named",
    },
    "comma locale": {
        "run": SLOW, "sweep": SLOW, "tune": SLOW, "chart": SLOW, "identify": SLOW,
        "export": SLOW, "compare": SLOW, "fit": SLOW, "build": SLOW,
    },
    "no memory": {
        "run": QUICK, "sweep": "tests/studies/test_sweep_kills.py: the machine", "tune": POINTS,
        "identify": FITTED, "chart": POINTS, "export": LITTLE, "compare": LITTLE, "fit": LITTLE,
        "build": COMPILER,
    },
    "no threads": {
        "run": SLOW, "sweep": SLOW, "tune": SLOW, "chart": SLOW, "identify": SLOW,
        "export": SLOW, "compare": SLOW, "fit": SLOW, "build": "it starts none",
    },
    "few open files": {
        "run": SLOW, "sweep": SLOW, "tune": SLOW, "chart": SLOW, "identify": SLOW,
        "export": SLOW, "compare": SLOW, "fit": SLOW, "build": SLOW,
    },
    "wrong library": {
        "run": QUICK, "sweep": SLOW, "tune": SLOW, "chart": SLOW, "identify": NO_NGSPICE,
        "export": NO_NGSPICE, "compare": NO_NGSPICE, "fit": NO_NGSPICE, "build": NO_NGSPICE,
    },
}  # fmt: skip
PHASES = ("run", "sweep", "tune", "identify", "chart", "export", "compare", "fit", "build")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A run, and a trial made of it, for the commands that need one."""
    folder = tmp_path_factory.mktemp("made")
    longer = ["--set=run.duration=0.2", "--set=run.settle=0.05"]
    assert main(["run", "ideal-current", *longer, f"--out={folder / 'run'}"]) == 0
    assert main(["export", str(folder / "run"), "--as=tracker", f"--out={folder}"]) == 0
    for name, count in (("trials", 1), ("many", 30)):
        (folder / name).mkdir()
        for number in range(count):
            shutil.copy(folder / "tracker.csv", folder / name / f"trial {number + 1}.csv")
    # Of the rig all but two keys are known, so that `identify` is brief.
    tables = load("ideal-current").as_dict()
    known = [key for key in read_space().names if key not in SOUGHT]
    values = [(key, *key.split(".")) for key in known]
    lines = [f'[rig."{key}"]\nvalue = {tables[table][name]}\n' for key, table, name in values]
    (folder / "bounds.toml").write_text("".join(lines))
    found = {name: str(folder / name) for name in ("run", "trials", "many", "bounds.toml")}
    found["bounds"] = found.pop("bounds.toml")
    return found | {"trial": str(folder / "tracker.csv")}


def words(command: list[str], made: dict[str, str], out: Path) -> list[str]:
    return [*(word.format(**made) for word in command), f"--out={out}"]


def spawned(
    arguments: list[str],
    limits: Callable[[], object] | None = None,
    before: str = "pass",
    first: Sequence[str] = (),
    **environment: str,
) -> "subprocess.Popen[str]":
    """The command as a process in a group of its own."""

    def prepare() -> None:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # under nohup it is ignored, and stays so
        if limits is not None:
            limits()

    program = f"import sys; {before}; from cosim.cli.main import main; sys.exit(main(sys.argv[1:]))"
    return subprocess.Popen(
        [*first, sys.executable, "-c", program, *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=prepare, cwd=REPOSITORY,
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)} | environment,
    )  # fmt: skip


def told(said: str, word: str) -> None:
    """The end of stderr is one sentence of ours with ``word`` in it, and no traceback."""
    assert "Traceback" not in said, said
    last = said.splitlines()[-1] if said else ""
    assert last.startswith("cosim: ") and word in last, said


def whole(folder: Path, killed: bool = False) -> None:
    """What is in a folder is whole; only a kill may leave temporary files."""
    for path in folder.glob("*") if folder.exists() else ():
        content = path.read_bytes()
        if path.name.startswith(".cosim-"):
            assert killed, path
        elif path.suffix == ".json":
            json.loads(content)
        elif path.suffix == ".nc":
            assert content.startswith(b"CDF"), path
        elif path.suffix == ".png":
            assert content.endswith(b"IEND\xaeB`\x82"), path
        elif path.suffix in (".csv", ".toml", ".md") and path.name != "tracker.csv":
            assert content.endswith(b"\n"), path


def does_its_work(phase: str, made: dict[str, str], out: Path) -> None:
    assert main(words(COMMANDS[phase], made, out)) == 0
    assert LEAVES[phase] <= {path.name for path in out.iterdir()}
    assert not list(out.glob(".cosim-*"))
    whole(out)


# --- the faults ------------------------------------------------------------------


def signalled(number: int, phase: str, made: dict[str, str], out: Path) -> None:
    """Struck in the midst of its work; then taken up, or done anew."""
    arguments = words(AT_WORK[phase], made, out)
    process = spawned(arguments)
    _wait_for_work(process)
    workers = psutil.Process(process.pid).children()
    if number == signal.SIGINT:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    _, said = process.communicate(timeout=300)
    if number == signal.SIGKILL:
        assert process.returncode == -number
    else:
        assert process.returncode == 130, said
        told(said, "interrupted")
    _, alive = psutil.wait_procs(workers, timeout=60)
    assert not alive, "workers outlive their parent"
    whole(out, killed=number == signal.SIGKILL)
    for store in [*out.glob("*.sqlite*")]:  # what they hold belongs to the work at hand
        store.unlink()
    if phase != "chart":
        does_its_work(phase, made, out)


def _wait_for_work(process: "subprocess.Popen[str]") -> None:
    """Until it has imported what it needs and begun."""
    about = psutil.Process(process.pid)
    began = time.monotonic()
    while process.poll() is None and time.monotonic() - began < 60:
        with suppress(psutil.Error):
            if about.cpu_times().user > 1.3:
                return
        time.sleep(0.01)
    assert process.poll() is None, process.communicate()[1]


def paused(phase: str, made: dict[str, str], out: Path) -> None:
    """A sleeping laptop: all processes stop for longer than any of them reports."""
    process = spawned(words(AT_WORK[phase], made, out))
    _wait_for_work(process)
    os.killpg(process.pid, signal.SIGSTOP)
    time.sleep(35.0)
    os.killpg(process.pid, signal.SIGCONT)
    _, said = process.communicate(timeout=500)
    assert process.returncode == 0 and "hang" not in said, said
    whole(out)


def disk_full(phase: str, made: dict[str, str], out: Path, capsys) -> None:
    """No file grows beyond 2 kB; what was there before stays."""
    does_its_work(phase, made, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    capsys.readouterr()
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        code = main(words(COMMANDS[phase], made, out))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert code == 2
    told(capsys.readouterr().err, "cannot be written")
    whole(out)
    left = {path.name for path in out.iterdir()} - before.keys()
    assert left <= {"tune.sqlite", "ladder.sqlite", "identify.sqlite"}, left
    for name, content in before.items():
        assert len((out / name).read_bytes()) <= 2000 or (out / name).read_bytes() == content
    does_its_work(phase, made, out)


def read_only(phase: str, made: dict[str, str], out: Path, capsys) -> None:
    """/proc takes no files, not even root's."""
    code = main(words(COMMANDS[phase], made, Path("/proc/self/nothing/here")))
    assert code == 2
    told(capsys.readouterr().err, "cannot be written to")
    assert not out.exists()


def closed_stdout(phase: str, made: dict[str, str], out: Path) -> None:
    """Nothing that is printed ends up in a file that takes the stream's number."""
    process = spawned(words(COMMANDS[phase], made, out), lambda: os.close(1))
    process.communicate(timeout=300)
    assert process.returncode == 0
    assert LEAVES[phase] <= {path.name for path in out.iterdir()}
    whole(out)


def same_folder(phase: str, made: dict[str, str], out: Path, capsys) -> None:
    out.mkdir()
    if phase == "chart":  # different ones may share a folder
        with Store(out / STORES[phase]):
            assert main(words(COMMANDS[phase], made, out)) == 2
        told(capsys.readouterr().err, "another process is writing it")
        assert not list(out.iterdir())
        return
    with alone(out):
        assert main(words(COMMANDS[phase], made, out)) == 2
    told(capsys.readouterr().err, "another process is writing into this folder")
    assert not list(out.iterdir())
    does_its_work(phase, made, out)


def damaged(phase: str, made: dict[str, str], out: Path, capsys) -> None:
    """Every file of its own is cut in the middle, and filled with zeros: told, or made anew."""
    does_its_work(phase, made, out)
    for path in out.iterdir():
        content = path.read_bytes()
        path.write_bytes(content[: len(content) // 2] + bytes(100))
    if phase == "export" or phase == "compare":
        spoilt = out.with_name("spoilt")
        shutil.copytree(made["run"], spoilt)
        (spoilt / "waveforms.nc").write_bytes((spoilt / "waveforms.nc").read_bytes()[:3000])
        assert main(words(COMMANDS[phase], made | {"run": str(spoilt)}, out)) == 2
        told(capsys.readouterr().err, "not a whole waveforms.nc")
    elif phase == "sweep":  # what it keeps is no cache: it is not thrown away in silence
        assert main(words(COMMANDS[phase], made, out)) == 2
        told(capsys.readouterr().err, STORES[phase])
        (out / STORES[phase]).unlink()
    elif phase in ("fit", "identify"):
        trials = out.with_name("spoilt")
        shutil.copytree(made["trials"], trials)
        trial = next(trials.iterdir())
        trial.write_bytes(trial.read_bytes()[:-7] + b'"')
        assert main(words(COMMANDS[phase], made | {"trials": str(trials)}, out)) == 2
        told(capsys.readouterr().err, "trial 1.csv")
    does_its_work(phase, made, out)


def devices(phase: str, made: dict[str, str], out: Path, capsys) -> None:
    """Files that are named are pipes, which would wait for ever, or devices without end."""
    pipe = out.parent / "pipe"
    os.mkfifo(pipe)
    folder = out.parent / "odd"
    folder.mkdir()
    for path in (pipe, Path("/dev/zero")):
        (folder / "waveforms.nc").unlink(missing_ok=True)
        (folder / "waveforms.nc").symlink_to(path)
        given = made | {
            "run": str(folder),
            "trial": str(path),
            "trials": str(path),
            "many": str(path),
        }
        command = COMMANDS[phase]
        if phase in ("run", "sweep", "tune", "chart"):
            command = [
                str(path) if word in ("ideal-current", "paper") else word for word in command
            ]
        assert main(words(command, given, out)) == 2
        told(capsys.readouterr().err, str(path) if phase != "export" else "waveforms.nc")
    if phase in STORES:
        out.mkdir(exist_ok=True)
        os.mkfifo(out / STORES[phase])
        assert main(words(COMMANDS[phase], made, out)) == 2
        told(capsys.readouterr().err, STORES[phase])


def comma_locale(phase: str, made: dict[str, str], out: Path) -> None:
    """A host program has set a locale in which 0,5 is a number: the files are the same."""
    calm = out.with_name("calm")
    does_its_work(phase, made, calm)
    subprocess.run(
        ["localedef", "-i", "de_DE", "-f", "UTF-8", str(out.parent / "de_DE.UTF-8")],
        check=False, capture_output=True,
    )  # fmt: skip
    set_it = "import locale; locale.setlocale(locale.LC_ALL, ''); assert locale.str(0.5) == '0,5'"
    process = spawned(
        words(COMMANDS[phase], made, out), before=set_it,
        LC_ALL="de_DE.UTF-8", LOCPATH=str(out.parent),
    )  # fmt: skip
    _, said = process.communicate(timeout=300)
    if "unsupported locale" in said:
        pytest.skip("no locale with a decimal comma can be made here")
    assert process.returncode == 0, said
    for name in LEAVES[phase]:
        if name.endswith((".csv", ".nc", ".toml", ".fmu", ".mat")) and phase != "chart":
            assert (out / name).read_bytes() == (calm / name).read_bytes(), name


def no_memory(phase: str, made: dict[str, str], out: Path) -> None:
    """Its waveforms outgrow what the process may have; what was there before stays."""
    if sys.platform != "linux":
        pytest.skip("only Linux keeps to a limit of memory")
    does_its_work(phase, made, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    room = (
        "import os, resource, scipy.io, matplotlib.figure, cosim; cosim.run; "
        "size = int(open('/proc/self/statm').read().split()[0]) * os.sysconf('SC_PAGE_SIZE'); "
        "resource.setrlimit(resource.RLIMIT_AS, (size + (1 << 26), size + (1 << 26)))"
    )
    large = [*COMMANDS[phase], "--set=run.duration=1", "--set=run.output_step=1e-6"]
    process = spawned(words(large, made, out), before=room)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 3, said
    told(said, "The memory ran out")
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def limited(kind: str, limit: int, phase: str, made: dict[str, str], out: Path) -> None:
    """It does its work all the same, or says in a sentence what ran out."""

    def limits() -> None:
        resource.setrlimit(getattr(resource, kind), (limit, limit))

    first: list[str] = []
    if kind == "RLIMIT_NPROC" and os.getuid() == 0:  # root may start as many as it likes
        setpriv = shutil.which("setpriv")
        if setpriv is None:
            pytest.skip("needs setpriv, or a user who is not root")
        first = [setpriv, "--reuid=65534", "--clear-groups"]
    for folder in (out.parent, *out.parent.parents[:2], *Path(made["run"]).parents[:2]):
        folder.chmod(0o777)
    process = spawned(
        words(COMMANDS[phase], made, out), limits, first=first, MPLCONFIGDIR=str(out.parent)
    )
    _, said = process.communicate(timeout=300)
    assert process.returncode in (0, 2, 3), said
    assert "interrupted" not in said
    if process.returncode:
        told(said, "")
    whole(out)


def wrong_library(phase: str, made: dict[str, str], out: Path) -> None:
    """NGSPICE_LIBRARY_PATH names a library, but not ngspice's."""
    command = ["paper" if word == "ideal-current" else word for word in COMMANDS[phase]]
    part = next((REPOSITORY / "cosim/_compiled").glob("part.*"))
    process = spawned(words(command, made, out), NGSPICE_LIBRARY_PATH=str(part))
    _, said = process.communicate(timeout=300)
    assert process.returncode == (3 if phase in ("sweep", "tune") else 2), said
    told(said, "this ngspice library cannot be loaded")
    whole(out)


def inject(fault: str, phase: str, made: dict[str, str], out: Path, capsys) -> None:
    signals = {name: getattr(signal, name) for name in ("SIGKILL", "SIGTERM", "SIGHUP")}
    signals["Ctrl-C"] = signal.SIGINT
    if fault in signals:
        return signalled(signals[fault], phase, made, out)
    if fault == "STOP and CONT":
        return paused(phase, made, out)
    limits = {
        "no threads": ("RLIMIT_NPROC", 1),
        "few open files": ("RLIMIT_NOFILE", 12),
    }
    if fault in limits:
        return limited(*limits[fault], phase, made, out)
    silent = {
        "closed stdout": closed_stdout,
        "comma locale": comma_locale,
        "no memory": no_memory,
        "wrong library": wrong_library,
    }
    if fault in silent:
        return silent[fault](phase, made, out)
    listened = {
        "disk full": disk_full, "read-only": read_only, "same folder twice": same_folder,
        "damaged files of its own": damaged, "devices and pipes": devices,
    }  # fmt: skip
    return listened[fault](phase, made, out, capsys)


CELLS = [
    pytest.param(fault, phase, id=f"{fault}-{phase}", marks=[pytest.mark.slow] * (cell == SLOW))
    for fault, row in TABLE.items()
    for phase, cell in row.items()
    if cell in (QUICK, SLOW)
]


@pytest.mark.parametrize(("fault", "phase"), CELLS)
def test_cell(
    fault: str, phase: str, made: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    inject(fault, phase, made, tmp_path / "out", capsys)


def test_the_table_is_whole() -> None:
    """Each cell is a test or a sentence; the tests that sentences name are there."""
    assert all(tuple(sorted(row)) == tuple(sorted(PHASES)) for row in TABLE.values())
    for row in TABLE.values():
        for cell in row.values():
            assert cell in (QUICK, SLOW) or len(cell) > 10
            if cell.startswith("tests/"):
                assert (REPOSITORY / cell.partition(":")[0]).exists()
