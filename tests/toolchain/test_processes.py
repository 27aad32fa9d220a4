"""Runs from several threads, after a fork, and after interrupts, in fresh sessions."""

import os
import random
import subprocess
import sys
import threading
from functools import partial
from pathlib import Path

import psutil
import pytest

import cosim
from cosim.toolchain import processes
from cosim.toolchain.worker import Bounds
from tests.helpers import needs

pytestmark = pytest.mark.reliability

SHORT = {"run.duration": 0.05, "run.settle": 0.02}


def bits(**more: float) -> bytes:
    result = cosim.run("paper", {**SHORT, **{k.replace("_", ".", 1): v for k, v in more.items()}})
    return b"".join(values.tobytes() for values in result.columns.values())


@pytest.mark.parametrize(("threads", "runs"), [(4, 3), pytest.param(8, 20, marks=pytest.mark.slow)])
def test_threads_have_the_bits_of_one(threads: int, runs: int) -> None:
    alone = {offset: bits(drive_offset=offset) for offset in (-1.5, -1.0)}
    found: list[bool] = []

    def work(offset: float) -> None:
        found.extend(bits(drive_offset=offset) == alone[offset] for _ in range(runs))

    every = [threading.Thread(target=work, args=((-1.5, -1.0)[k % 2],)) for k in range(threads)]
    for thread in every:
        thread.start()
    for thread in every:
        thread.join()
    assert found == [True] * (threads * runs)


def test_a_run_asked_for_while_another_tells_of_its_progress() -> None:
    """However few processes may be at work."""
    inner: list[bytes] = []

    def progress(time: float) -> None:
        if not inner:
            inner.append(bits())

    cosim.run("paper", SHORT, progress)
    assert inner == [bits()]


@needs.posix
def test_after_a_fork() -> None:
    program = (
        "import cosim, os\n"
        "def v(): return cosim.run('paper', {'run.duration': 0.05}).summary['v_average']\n"
        "before = v()\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    os._exit(0 if v() == before else 1)\n"
        "assert v() == before\n"
        "assert os.waitpid(child, 0)[1] == 0\n"
        "assert v() == before\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=100)


SESSION = """
import cosim, os, signal, sys, threading, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it

def strike():
    time.sleep(float(sys.argv[1]))
    os.kill(os.getpid(), signal.SIGINT)

def v():
    return cosim.run("paper", {"run.duration": 0.05}).summary["v_average"]

try:
    threading.Thread(target=strike, daemon=True).start()
    while True:
        v()
except KeyboardInterrupt:
    pass
print(repr(v()))
"""


@needs.posix
@pytest.mark.parametrize("count", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_interrupted_at_any_moment_of_a_fresh_session(count: int) -> None:
    expected = cosim.run("paper", {"run.duration": 0.05}).summary["v_average"]
    dice = random.Random(count)
    for _ in range(count):
        moment = f"{dice.uniform(0.0, 1.5):.4f}"
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", SESSION, moment],
            capture_output=True,
            text=True,
            timeout=100,
        )
        assert (done.returncode, done.stderr) == (0, ""), moment
        assert float(done.stdout) == expected, moment


@needs.posix
def test_nothing_is_left_behind(tmp_path: Path) -> None:
    """Neither a process nor a folder, when the session ends."""
    program = (
        "import cosim, psutil\ncosim.run('paper', {'run.duration': 0.05})\n"
        "print(*[one.pid for one in psutil.Process().children()])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"TMPDIR": str(tmp_path)},
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.split() and not list(tmp_path.iterdir())
    assert not [pid for pid in done.stdout.split() if psutil.pid_exists(int(pid))]


def test_a_process_that_was_killed_while_it_waited_is_replaced() -> None:
    before = bits()
    for child in psutil.Process().children():
        child.kill()
    assert bits() == before


def test_one_that_dies_as_it_starts_is_tried_again(tmp_path: Path) -> None:
    """Whatever kills it: memory that others have, a hand."""
    marker = tmp_path / "tried"
    marker.write_text("")
    bounds = Bounds((str(tmp_path),), first=partial(_die_once, str(marker)))
    assert processes.isolated(_is_alive, None, lambda _: None, bounds) == "alive"
    marker.write_text("always")
    bounds = Bounds(first=partial(_die_once, str(marker)))
    with pytest.raises(cosim.SimulationFailed, match=r"cannot start \(exit code 9"):
        processes.isolated(_is_alive, None, lambda _: None, bounds)


def _die_once(marker: str) -> None:
    path = Path(marker)
    if path.read_text() != "once":
        if path.read_text() == "":
            path.write_text("once")
        os._exit(9)


def _is_alive(nothing: None, progress: object) -> str:
    return "alive"
