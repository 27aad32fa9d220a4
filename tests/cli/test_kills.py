"""Commands that are killed at random moments: no file is damaged, and the finished work has the
bytes of one that was left alone."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from tests.helpers import needs

pytestmark = [pytest.mark.reliability, needs.posix]

COSIM = [sys.executable, "-m", "cosim"]
SHORT = ["--set=run.duration=0.3", "--set=run.settle=0.1"]
KNOBS = [f"--over=drive.pot_{knob}=0.1:0.9" for knob in ("max", "offset")]
COMMANDS = {
    "run": ["run", "paper", *SHORT, "--out", "{}"],
    "export": ["export", "{}", "--as", "csv,mat,wav,raw,tracker"],
    "sweep": ["sweep", "paper", *SHORT, *(f"{knob}:4" for knob in KNOBS), "--out", "{}"],
    "tune": [
        *("tune", "ideal-current", *SHORT, *KNOBS, "--maximise=v_average", "--budget=60"),
        *("--out", "{}"),
    ],
    "identify": ["identify", "{trials}", "--quick", "--out", "{}"],
    "chart": ["chart", "ladder", "trial-05", *SHORT, "--out", "{}"],
}
KILLS = {"run": 35, "export": 30, "sweep": 30, "tune": 25, "identify": 20, "chart": 15}

TIMED = ("summary.json", "scene.toml", "ladder.csv", "ladder.md", "waveforms.nc", "identify.json")
"""Files that hold the time that a run took, the moment, or what names such a file."""


def contents(folder: Path) -> dict[str, bytes]:
    found = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    return {
        name: data
        for name, data in found.items()
        if name not in TIMED and not name.endswith((".png", ".sqlite", "-wal", "-shm"))
    }


def killed(command: list[str], dice: random.Random, longest: float) -> bool:
    """Whether a kill struck the command, or one of its workers, before its end."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(dice.uniform(0.02, longest))
    if process.poll() is not None:
        return False
    children = psutil.Process(process.pid).children()
    if children and dice.random() < 0.3:
        dice.choice(children).kill()  # a worker alone: the command may go on, or tell
        time.sleep(dice.uniform(0.0, 0.2))
    process.kill()
    process.wait()
    psutil.wait_procs(children, timeout=60)
    assert process.returncode in (-signal.SIGKILL, 0, 3)
    return True


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize(("name", "kills"), KILLS.items())
def test_killed(name: str, kills: int, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    trials = request.getfixturevalue("trials") if name == "identify" else ""
    calm, wild = tmp_path / "calm", tmp_path / "wild"

    def command(folder: Path) -> list[str]:
        return [*COSIM, *(word.format(folder, trials=trials) for word in COMMANDS[name])]

    if name == "export":
        run = [*COSIM, *(word.format(calm) for word in COMMANDS["run"])]
        subprocess.run(run, check=True, capture_output=True)
        shutil.copytree(calm, wild)
    began = time.monotonic()
    subprocess.run(command(calm), check=True, capture_output=True)
    longest = time.monotonic() - began
    dice = random.Random(name)
    struck = 0
    while struck < kills:
        struck += killed(command(wild), dice, longest)
        for path in wild.iterdir() if wild.exists() else ():
            # Whole, of this or of an earlier run.
            if path.name in contents(calm) and path.is_file():
                assert path.read_bytes() == (calm / path.name).read_bytes(), path.name
    for left in wild.glob(".cosim-*"):  # what is young may be another command's that begins
        os.utime(left, (0, 0))
    done = subprocess.run(command(wild), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert contents(wild) == contents(calm)
    assert not [path for path in os.listdir(wild) if path.startswith(".cosim-")]
