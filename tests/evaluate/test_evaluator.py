"""Settings are run once each, wherever they run and whatever dies meanwhile."""

import signal
import threading
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

import cosim
from cosim.evaluate import point
from cosim.evaluate.evaluator import TOGETHER, Evaluator
from cosim.evaluate.point import Outcome
from cosim.scene import load
from cosim.studies.limits import report
from cosim.studies.sweep.run import sweep
from tests.helpers import needs

SHORT = {"run.duration": 0.02, "run.settle": 0.0}


def test_each_settings_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within a call, in later ones and in later sessions, but for the machine's failures."""
    ran: list[float] = []
    lost = {0.9}

    def counted(scene: Any, settings: Any, *more: Any) -> Outcome:
        ran.append(settings["friction.mu_s"])
        machine = settings["friction.mu_s"] in lost
        return Outcome({"v_average": ran[-1]}, "lost" if machine else "", machine)

    monkeypatch.setattr(point, "evaluate", counted)
    values = [0.7, 0.8, 0.7, 0.9, 0.8, 0.7]
    points = [*enumerate({"friction.mu_s": value} for value in values)]
    path = tmp_path / "store.sqlite"
    for session in range(2):
        with Evaluator(load("held", SHORT), path, workers=2) as bench:
            assert bench.resumed == 3 * session
            for _ in range(2):
                found = dict(bench.run(points))
                assert [found[n].numbers["v_average"] for n in range(6)] == values
                assert found[3].machine and not found[0].machine
    assert Counter(ran) == {0.7: 1, 0.8: 1, 0.9: 4}


def test_each_settings_once_however_many_lie_between(monkeypatch: pytest.MonkeyPatch) -> None:
    """More points than are looked up at a time, of which many are alike."""
    ran: list[float] = []

    def counted(scene: Any, settings: Any, *more: Any) -> Outcome:
        ran.append(settings["friction.mu_s"])
        return Outcome({"v_average": ran[-1]})

    monkeypatch.setattr(point, "evaluate", counted)
    values = [0.6 + 1e-3 * (n * n % 97) for n in range(3 * TOGETHER + 5)]
    with Evaluator(load("held", SHORT), workers=1) as bench:
        found = dict(bench.run(enumerate({"friction.mu_s": value} for value in values)))
    assert [found[n].numbers["v_average"] for n in range(len(values))] == values
    assert Counter(ran) == dict.fromkeys(values, 1)


def test_only_what_is_kept(tmp_path: Path) -> None:
    with Evaluator(load("held", SHORT), kept={"impacts"}) as bench:
        assert [outcome.numbers for _, outcome in bench.run([(0, {})])] == [{"impacts": 0.0}]


@needs.posix
@pytest.mark.slow
@pytest.mark.reliability
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("study", ["sweep", "limits"])
def test_dask_workers_that_are_killed(
    study: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cluster starts others, and the result is that of this machine alone."""
    monkeypatch.setattr(report, "CHANGES", report.CHANGES[:2])
    cluster = pytest.importorskip("distributed").LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address="", host="127.0.0.1"
    )

    def made(out: Path, **where: Any) -> bytes:
        if study == "sweep":
            over = {"drive.offset": [-0.02 * k for k in range(120)]}
            changes = {"run.duration": 10.0, "run.settle": 0.1}
            sweep("ideal-current", over, changes, out=out, **where)
            return (out / "sweep.nc").read_bytes()
        cosim.limits("paper", quick=True, effort=0.2, out=out, **where)
        return (out / "limits.csv").read_bytes()

    over, killed = threading.Event(), []

    def kill() -> None:
        """One of the workers at work, now and then."""
        while not over.wait(2.0) and len(killed) < 2:
            workers = [
                one
                for one in psutil.Process().children(recursive=True)
                if "spawn_main" in " ".join(one.cmdline()) and one.cpu_times().user > 1.0
            ]
            with suppress(IndexError, psutil.Error):
                workers[0].send_signal(signal.SIGKILL)
                killed.append(workers[0].pid)

    with cluster as running:
        killer = threading.Thread(target=kill)
        killer.start()
        began = time.monotonic()
        there = made(tmp_path / "there", dask=running.scheduler_address)
        lasted = time.monotonic() - began
        over.set()
        killer.join()
    assert killed, f"no worker was killed in {lasted:.0f} s"
    assert there == made(tmp_path / "here")
