"""A sweep that is killed again and again ends with the bytes of one that was left alone."""

import json
import os
import random
import re
import signal
import sqlite3
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import psutil
import pytest
import xarray as xr

from cosim.cli.main import main
from cosim.studies.sweep.run import sweep
from tests.helpers import needs

pytestmark = [pytest.mark.reliability, pytest.mark.usefixtures("undrawn")]

THREADS, PROCESSES = "ideal-current", "paper"
KNOBS = [f"drive.{knob}=0.05:0.9" for knob in ("pot_max", "pot_frequency", "pot_offset")]
SHORT = {THREADS: 0.3, PROCESSES: 0.01}
"""Scenes whose points run in threads and in processes, and for how long, s."""


def arguments(points: int, out: Path, scene: str = THREADS) -> list[str]:
    """A sweep of short runs."""
    over = (f"--over={axis}:{points}" for axis in KNOBS)
    short = (f"--set=run.duration={SHORT[scene]}", f"--set=run.settle={0.5 * SHORT[scene]}")
    return [
        sys.executable, "-m", "cosim", "sweep", scene, *over, *short,
        "--workers=2", f"--out={out}",
    ]  # fmt: skip


def kept(out: Path, *, failed: bool = False) -> int:
    """The points that stand in the file of a sweep, which may run."""
    words = "SELECT value FROM found WHERE key <> ''"
    try:
        with closing(sqlite3.connect(f"file:{out / 'sweep.sqlite'}?mode=ro", uri=True)) as store:
            found = [json.loads(value) for (value,) in store.execute(words)]
    except sqlite3.OperationalError:  # it is not there yet
        return 0
    return sum(bool(one["failure"]) == failed for one in found)


@needs.posix
@pytest.mark.parametrize(
    ("scene", "points", "kills"),
    [
        (THREADS, 5, 1),
        pytest.param(PROCESSES, 4, 1, marks=pytest.mark.slow),
        *(pytest.param(scene, 10, 6, marks=pytest.mark.slow) for scene in SHORT),
    ],
)
def test_killed(scene: str, points: int, kills: int, tmp_path: Path) -> None:
    calm, wild = tmp_path / "calm", tmp_path / "wild"
    assert main(arguments(points, calm, scene)[3:]) == 0
    dice = random.Random(points)
    total = points**3
    resumed_at = []
    for _ in range(kills):
        process = subprocess.Popen(
            arguments(points, wild, scene), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        goal = kept(wild) + int(dice.uniform(0.2, 0.8) * total / (kills + 1))
        while kept(wild) < goal and process.poll() is None:
            time.sleep(0.002)
        if process.poll() == 0 and resumed_at:
            break  # a loaded machine may look too late
        workers = psutil.Process(process.pid).children()
        assert bool(workers) == (scene == PROCESSES)
        if workers:
            # The sweep goes on without it, unless it has not begun: the busiest one has.
            max(workers, key=lambda worker: worker.cpu_times().user).kill()
        time.sleep(dice.uniform(0.0, 0.05))
        process.kill()
        _, said = process.communicate(timeout=300)
        assert process.returncode == -signal.SIGKILL, said
        resumed_at.append(kept(wild))
        _, alive = psutil.wait_procs(workers, timeout=120)
        assert not alive, "workers outlive their parent"
    # The last kill may strike when all points are kept and only the dataset lacks.
    assert resumed_at == sorted(resumed_at) and 0 < resumed_at[0] < total >= resumed_at[-1]
    assert main(arguments(points, wild, scene)[3:]) == 0
    assert (wild / "sweep.nc").read_bytes() == (calm / "sweep.nc").read_bytes()
    assert kept(wild) == total, "a point was repeated or lost"


@needs.posix
@pytest.mark.parametrize("scene", SHORT)
def test_interrupted(scene: str, tmp_path: Path) -> None:
    """Ctrl-C reaches parent and workers; what was complete is kept."""
    process = subprocess.Popen(
        arguments(10, tmp_path, scene), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    while kept(tmp_path) < 20 and process.poll() is None:
        time.sleep(0.01)
    workers = psutil.Process(process.pid).children()
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=300)
    *before, last = said.splitlines()
    assert process.returncode == 130 and last == "cosim: interrupted."
    told = re.search(r"cosim: (\d+) of 1000 points are kept in .*the same command", before[-1])
    assert told is not None and 20 <= int(told[1]) <= kept(tmp_path)
    with xr.open_dataset(tmp_path / "sweep.nc", engine="scipy") as data:
        assert int(told[1]) <= int(data.v_average.notnull().sum()) <= kept(tmp_path)
    _, alive = psutil.wait_procs(workers, timeout=120)
    assert not alive


def test_interrupted_once_all_points_are_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """While their kinds of motion are looked at, which takes longer than a small sweep."""

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cosim.studies.sweep.run.motion", interrupt)
    over, short = {"drive.offset": [-0.78, -0.7]}, {"run.duration": 0.1}
    with pytest.raises(KeyboardInterrupt):
        sweep(THREADS, over, short, out=tmp_path, workers=1)
    with xr.open_dataset(tmp_path / "sweep.nc", engine="scipy") as data:
        assert data.v_average.notnull().all()


@needs.posix
def test_one_sweep_at_a_time(tmp_path: Path) -> None:
    first = subprocess.Popen(arguments(10, tmp_path), stdout=subprocess.DEVNULL)
    try:
        while kept(tmp_path) < 5 and first.poll() is None:
            time.sleep(0.01)
        first.send_signal(signal.SIGSTOP)  # or it might be done before the second has started
        second = subprocess.run(
            arguments(10, tmp_path), capture_output=True, text=True, timeout=300
        )
    finally:
        first.kill()
        first.wait()
    assert second.returncode == 2 and "another process is writing into" in second.stderr


@needs.posix
@pytest.mark.slow
def test_a_disk_full_in_mid_sweep(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was whole stays; with room again only the rest is run."""
    import resource

    command = arguments(4, tmp_path)
    full = subprocess.run(
        command, capture_output=True, text=True, timeout=300,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (60_001, 60_001)),
    )  # fmt: skip
    written = kept(tmp_path)
    # The dataset may find no room either, but each point was run, and it was told.
    assert "cannot be written" in full.stderr and "Traceback" not in full.stderr
    assert 5 < written < 64
    assert main(command[3:]) == 0
    assert kept(tmp_path) == 64
    assert not capsys.readouterr().err


PATIENT = """
import sys
from cosim.cli.main import main
from cosim.toolchain import worker
worker.PATIENCE = 2.0
sys.exit(main(sys.argv[1:]))
"""


@needs.posix
@pytest.mark.slow
@pytest.mark.parametrize("whole", [True, False], ids=["all", "worker"])
def test_a_pause_spoils_no_point(whole: bool, tmp_path: Path) -> None:
    """Stopped for longer than a point may work without progress, with and without the parent."""
    command = [
        "sweep", "paper", "--over=friction.mu_k=0.4,0.5", "--set=run.duration=10",
        "--workers=2", f"--out={tmp_path}",
    ]  # fmt: skip
    process = subprocess.Popen(
        [sys.executable, "-c", PATIENT, *command],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    workers: list[psutil.Process] = []
    while not any(worker.cpu_times().user > 0.8 for worker in workers) and process.poll() is None:
        time.sleep(0.02)
        workers = psutil.Process(process.pid).children()
    assert process.poll() is None, "the points were done before the pause"
    stopped = [psutil.Process(process.pid), *workers] if whole else workers
    for one in stopped:
        one.suspend()
    time.sleep(4.0)
    for one in reversed(stopped):
        one.resume()
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert kept(tmp_path) == 2


def test_failures_of_the_machine_are_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    over = {"friction.mu_k": [0.5, 0.8]}
    short = {"run.duration": 0.01, "run.settle": 0.0}
    whole = sweep("paper", over, short, out=tmp_path / "calm", workers=1)
    with monkeypatch.context() as patch:
        patch.setattr("cosim.toolchain.worker.STALLED", -1.0)
        lost = sweep("paper", over, short, out=tmp_path / "wild", workers=1)
    assert (lost.failure != "").all() and "hangs" in str(lost.failure.values[0])
    again = sweep("paper", over, short, out=tmp_path / "wild", workers=1)
    assert again.identical(whole)
    assert "mu_k" in str(again.failure.values[1])  # the point's own
    assert (kept(tmp_path / "wild"), kept(tmp_path / "wild", failed=True)) == (1, 1)
