"""Runs the whole study and writes its report; a killed one goes on where it was."""

from collections.abc import Callable, Sequence
from pathlib import Path

from cosim.scene import Scene
from cosim.studies.limits.find.at import at
from cosim.studies.limits.find.confirm import confirmed, judged
from cosim.studies.limits.find.runs import Bench
from cosim.studies.limits.find.study import FULL, Efforts, machines, study
from cosim.studies.limits.find.table import LIMITS, Limit, Settings
from cosim.studies.limits.report import page
from cosim.studies.sweep.pool import workers_asked

JOURNAL = "limits.journal"


def run(
    folder: Path,
    scene: Scene,
    asked: str,
    rigs: Sequence[Settings] = (),
    there: Sequence[Scene] = (),
    *,
    seed: int = 0,
    efforts: Efforts = FULL,
    limits: Sequence[Limit] = LIMITS,
    workers: int | None = None,
    told: Callable[[int, str], object] = lambda steps, name: None,
    progress: Callable[[], object] = lambda: None,
) -> str:
    """Search, confirm, lift at the scenes ``there``, and write ``limits.*`` into ``folder``; gives
    what is printed. The journal beside them, from which a killed study goes on, is gone at the end.

    ``asked`` are the words after ``cosim run`` that stand for the scene; ``told`` hears of each
    step, and how many there are, ``progress`` of each run. Raises BadInput.
    """
    steps = machines(limits, True) + len(rigs) * machines(limits, False) + 3 + len(there)
    journal = folder / JOURNAL

    def done(name: str) -> None:
        told(steps, name)

    with Bench(scene, asked, journal, workers_asked(workers), progress) as bench:
        found = study(bench, rigs, limits, seed, efforts, done)
        points = confirmed(bench, found, done)
        points |= judged(bench, found, points, done)
        words = page.write(folder, bench, found, points, at(bench, there, limits, done))
    journal.unlink()
    return words
