"""A sweep that is killed again and again ends with the bytes of one that was left alone."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from tests.helpers import needs

pytestmark = pytest.mark.reliability

KNOBS = ("drive.pot_max", "drive.pot_frequency", "drive.pot_offset")
KILLS = 5


def arguments(points: int, out: Path) -> list[str]:
    """A sweep over the three knobs, short runs with the commanded current."""
    over = (f"--over={knob}=0.05:0.9:{points}" for knob in KNOBS)
    short = ("--set=run.duration=0.02", "--set=run.settle=0.01")
    return [
        sys.executable, "-m", "cosim", "sweep", "ideal-current", *over, *short,
        "--workers=2", f"--out={out}",
    ]  # fmt: skip


def lines(out: Path) -> int:
    try:
        return (out / "sweep.journal").read_bytes().count(b"\n")
    except FileNotFoundError:
        return 0


@needs.posix
@pytest.mark.parametrize("points", [4, pytest.param(10, marks=pytest.mark.slow)])
def test_killed(points: int, tmp_path: Path) -> None:
    calm, wild = tmp_path / "calm", tmp_path / "wild"
    subprocess.run(arguments(points, calm), check=True, capture_output=True, timeout=300)
    dice = random.Random(points)
    total = points**3
    resumed_at = []
    for kill in range(KILLS):
        process = subprocess.Popen(
            arguments(points, wild), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        try:
            # Somewhere in this run's share of the points.
            goal = int(total * (kill + dice.uniform(0.2, 0.8)) / KILLS)
            while lines(wild) < goal and process.poll() is None:
                time.sleep(0.002)
            workers = psutil.Process(process.pid).children()
            for worker in dice.sample(workers, min(len(workers), 1)):
                worker.kill()  # the sweep itself goes on
            time.sleep(dice.uniform(0.0, 0.05))
            assert process.poll() is None, process.stderr and process.stderr.read()
            process.send_signal(signal.SIGKILL)
        finally:
            process.wait(timeout=60)
        resumed_at.append(lines(wild))
        _, alive = psutil.wait_procs(workers, timeout=20)
        assert not alive, "workers outlive their parent"
    assert resumed_at == sorted(resumed_at) and 0 < resumed_at[0] <= resumed_at[-1] < total + 1
    subprocess.run(arguments(points, wild), check=True, capture_output=True, timeout=300)
    assert (wild / "sweep.nc").read_bytes() == (calm / "sweep.nc").read_bytes()
    assert lines(wild) == total + 1, "a point was repeated or lost"


@needs.posix
def test_interrupted(tmp_path: Path) -> None:
    """Ctrl-C reaches parent and workers; what was complete is kept."""
    process = subprocess.Popen(
        arguments(10, tmp_path), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    while lines(tmp_path) < 20 and process.poll() is None:
        time.sleep(0.01)
    workers = psutil.Process(process.pid).children()
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130 and said.splitlines()[-1] == "cosim: interrupted."
    assert lines(tmp_path) >= 20
    _, alive = psutil.wait_procs(workers, timeout=20)
    assert not alive


def test_one_sweep_at_a_time(tmp_path: Path) -> None:
    pytest.importorskip("fcntl")
    first = subprocess.Popen(arguments(10, tmp_path), stdout=subprocess.DEVNULL)
    try:
        while lines(tmp_path) < 5 and first.poll() is None:
            time.sleep(0.01)
        second = subprocess.run(arguments(10, tmp_path), capture_output=True, text=True, timeout=60)
    finally:
        first.kill()
        first.wait()
    assert second.returncode == 2 and "another process is writing this sweep" in second.stderr
