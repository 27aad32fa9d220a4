"""What each command does, apart from reading its options."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Literal

from cosim.errors import BadInput, SimulationFailed
from cosim.files.atomic import whole
from cosim.scene import Scene, list_scenes, load
from cosim.scene.messages import plain
from cosim.waveforms.report import table

if TYPE_CHECKING:
    from cosim.studies.sweep import Design


def scenes() -> None:
    """List the built-in scenes."""
    found = list_scenes()
    width = max(len(name) for name, _ in found)
    for name, description in found:
        print(f"{name:<{width}}  {description}")


def run(source: str, overrides: list[str], out: Path | None) -> None:
    """Run a scene and write its files."""
    scene = load(source, overrides)
    folder = out or Path("results") / scene.name
    with _writable(folder):
        _run(scene, folder)


def _run(scene: Scene, folder: Path) -> None:
    # From here on with the heavy libraries.
    from tqdm import tqdm

    from cosim.files.spill import on_disk_in
    from cosim.simulation.simulate import simulate

    def progress(time: float) -> None:
        bar.update(time - bar.n)

    with (
        tqdm(
            total=scene.run.duration,
            desc=scene.name,
            unit="s",
            delay=1.0,
            leave=False,
            file=sys.stderr,
            disable=None,
            bar_format="{desc} {percentage:3.0f}% |{bar}| {n:.2f} of {total:g} s, {remaining} left",
        ) as bar,
        on_disk_in(folder),
    ):
        result = simulate(scene, progress=progress)
    result.save(folder)
    print(f"{scene.name}: {scene.description}" if scene.description else scene.name)
    print(table(scene, result.summary))
    print(f"Written to {folder}: waveforms.csv, waveforms.nc, summary.json, scene.toml")
    print(f"Figure: {folder / 'figure.png'}")


@dataclass(frozen=True)
class Sampling:
    """Of a sweep: how many samples, None for the whole grid; independent ones; their seed."""

    count: int | None
    random: bool
    seed: int


def sweep(
    source: str,
    overrides: list[str],
    over: list[str],
    sampling: Sampling,
    workers: int | None,
    dask: str | None,
    out: Path | None,
) -> None:
    """Run a scene over many settings and write their summaries as one dataset."""
    from cosim.studies.sweep import design

    scene = load(source, overrides)
    if sampling.count is None and sampling.random:
        raise BadInput("--random needs --samples N.")
    axes = design.parse(over)
    chosen = (
        design.grid(axes)
        if sampling.count is None
        else design.sample(axes, sampling.count, sampling.seed, sampling.random)
    )
    folder = out or Path("results") / f"{scene.name}-sweep"
    with _writable(folder):
        _sweep(scene, chosen, workers, dask, folder)


def _sweep(
    scene: Scene, design: "Design", workers: int | None, dask: str | None, folder: Path
) -> None:
    from tqdm import tqdm

    from cosim.studies import sweep

    def progress(done: int, failed: int, total: int) -> None:
        if bar.n == 0:
            bar.initial = done  # those of an earlier run tell nothing of the rate
        bar.update(done - bar.n)
        if failed:
            bar.set_postfix_str(f"{failed} failed", refresh=False)

    with tqdm(
        total=len(design), desc=scene.name, unit="point", leave=False, file=sys.stderr, disable=None
    ) as bar:
        data = sweep.sweep(scene, design, folder, workers, dask, progress)
    from cosim.studies.sweep import figure
    from cosim.studies.sweep.report import table

    with whole(folder / "figure.png") as temporary:
        figure.draw(data, scene.name, temporary)
    print(table(scene, data))
    print(f"Written to {folder}: sweep.nc")
    print(f"Figure: {folder / 'figure.png'}")
    reasons = [str(reason) for reason in data["failure"].values.flat]
    if all(reasons):
        raise SimulationFailed(f"No point could be run; the first one: {reasons[0]}")


def tune(
    source: str,
    overrides: list[str],
    over: list[str],
    quantity: str,
    largest: bool,
    budget: int,
    seed: int,
    workers: int | None,
    out: Path | None,
) -> None:
    """Search a scene's settings for the best, and write the search."""
    from cosim.studies.tune.files import ranges_of

    scene = load(source, overrides)
    ranges = ranges_of(over)
    if seed < 0:
        raise BadInput(f"--seed {seed}: must be a whole number from 0.")
    folder = out or Path("results") / f"{scene.name}-tune"
    with _writable(folder):
        _tune(scene, quantity, largest, ranges, budget, seed, workers, folder)


def _tune(
    scene: Scene,
    quantity: str,
    largest: bool,
    ranges: dict[str, tuple[float, float]],
    budget: int,
    seed: int,
    workers: int | None,
    folder: Path,
) -> None:
    from tqdm import tqdm

    from cosim.studies.tune import tune
    from cosim.studies.tune.files import table, write, write_runs
    from cosim.studies.tune.run import Run

    runs: list[Run] = []

    def scouting(run: Run, best: Run | None) -> None:
        if best is not None:
            bar.set_postfix_str(f"without ngspice, {quantity} {best.value:.4g}", refresh=False)
        bar.refresh()

    def progress(run: Run, best: Run | None) -> None:
        runs.append(run)
        if best is not None:
            bar.set_postfix_str(f"{quantity} {best.value:.4g}", refresh=False)
        bar.update()

    with tqdm(
        total=budget, desc=scene.name, unit="run", leave=False, file=sys.stderr, disable=None
    ) as bar:
        try:
            found = tune(
                scene, quantity, largest, ranges, budget, seed, workers, progress, scouting
            )
        except KeyboardInterrupt:
            write_runs(folder / "tune.csv", runs, quantity)
            raise
    numbers = write(folder, found, seed)
    from cosim.studies.tune import figure

    with whole(folder / "figure.png") as temporary:
        figure.draw(found, temporary)
    print(table(numbers))
    print(f"Written to {folder}: tune.json, tune.csv, best.toml")
    print(f"Figure: {folder / 'figure.png'}")


def chart_ladder(sources: list[str], overrides: list[str], folder: Path) -> None:
    """Cost and error of each rung on each scene."""
    scenes = [load(source, overrides) for source in sources or ["paper"]]
    with _writable(folder):
        from cosim.studies.circuit import ladder, ladder_report

        with _bar("ladder", ladder.runs_in_all() * len(scenes)) as step:
            found = [(scene, ladder.ladder(scene, step)) for scene in scenes]
        print(ladder_report.write(folder, found))


def chart_limits(sources: list[str], overrides: list[str], folder: Path) -> None:
    """Which limit binds, on each scene."""
    asked = [(source, overrides) for source in sources]
    fast = ["drive.frequency=50.8", "drive.amplitude=9", "drive.offset=-1.2"]
    slow = ["drive.frequency=20", "drive.amplitude=4.7"]
    settings = [fast, [*fast, "mechanics.contact=rigid"], slow]
    asked = asked or [("paper", [*own, *overrides]) for own in settings]
    scenes = [load(source, changes) for source, changes in asked]
    with _writable(folder):
        from cosim.studies.circuit import limits, limits_report

        turns = [number == 0 for number in range(len(scenes))]
        with _bar("limits", sum(limits.runs_in_all(turn) for turn in turns)) as step:
            found = [limits.study(*pair, step) for pair in zip(scenes, turns, strict=True)]
        print(limits_report.write(folder, found))


@contextmanager
def _bar(name: str, total: int) -> Iterator[Callable[[], None]]:
    """A progress bar; gives what advances it by one."""
    from tqdm import tqdm

    with tqdm(
        total=total, desc=name, unit="run", leave=False, file=sys.stderr, disable=None
    ) as bar:

        def step() -> None:
            bar.update()

        yield step


@contextmanager
def _writable(folder: Path) -> Iterator[None]:
    """Refuse a folder that cannot be written to before a long run, not after it.

    Folders that were made for a run that then fails go again, unless something is in them.
    """
    made: list[Path] = []
    try:
        try:
            made = [path for path in (folder, *folder.parents) if not path.exists()]
            folder.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=folder):
                pass
        except FileExistsError as error:
            raise BadInput(f"{plain(str(folder))}: this is a file, not a directory.") from error
        except OSError as error:
            reason = error.strerror
            raise BadInput(f"{plain(str(folder))}: cannot be written to ({reason}).") from error
        yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


def fmu_build(out: Path) -> None:
    """Write the FMU files."""
    from cosim.mechanics import package as fmu

    for path in fmu.pack(out).values():
        print(path)


def fmu_check() -> int:
    """Validate and run the FMU files; 1 if they have problems."""
    from cosim.mechanics import package as fmu

    return 1 if fmu.check() else 0


def theory(out: Path, errata: bool, given: dict[str, float]) -> None:
    """Write the paper's closed forms, or print its misprints."""
    from cosim.studies import paper as closed_forms

    if errata:
        print(closed_forms.errata_text())
        return
    with _writable(out):
        numbers = closed_forms.write(out, **(closed_forms.DEFAULTS | given))
        from cosim.studies.paper import knife_edge

        knife_edge.write(out, **(closed_forms.DEFAULTS | given))
    print(closed_forms.table(numbers))
    print(f"Written to {out}: theory.json, knife_edge.csv")
    print(
        "Figures: " + ", ".join(str(out / f"{n}.png") for n in ("figure3", "figure4", "knife_edge"))
    )


def fit(
    trials: Path,
    out: Path,
    evaluate: Literal["published"] | None,
    solver: Literal["exact", "published"],
    plate: bool,
) -> None:
    """Fit friction and normal forces to tracked trials, or evaluate the published ones."""
    from cosim.studies.fit import fit as fitting

    with _writable(out):
        numbers = fitting.run(trials, out, evaluate=evaluate, solver=solver, plate=plate)
    print(fitting.table(numbers))
    print(f"Written to {out}: fit.json, fit.csv and figures")


def compare(source: str, overrides: list[str], trial: Path, out: Path) -> None:
    """Lay a run, or a scene that is run for it, over a tracked trial."""
    from cosim.studies.compare import compare as comparison

    with _writable(out):
        comparison.run(source, overrides, trial, out)


def export(run: Path, forms: list[str], out: Path | None) -> None:
    """Write a finished run in other programs' formats."""
    from cosim.waveforms import formats as exporting

    chosen = exporting.parse(forms)
    made = exporting.read(run)
    folder = out or run
    with _writable(folder):
        files = exporting.export(made, chosen, folder)
    width = max(map(len, files))
    print(f"Written to {folder}:")
    for name, note in files.items():
        print(f"  {name:<{width}}  {note}")


def chart_accuracy(out: Path, quick: bool) -> None:
    """Error of every coupling method over its run time."""
    with _writable(out):
        from cosim.studies.accuracy import accuracy

        accuracy.run(out, quick)


def chart_stability(out: Path, quick: bool) -> None:
    """Largest stable macro step of every coupling method."""
    with _writable(out):
        from cosim.studies.stability import stability

        stability.run(out, quick)


def bench(out: Path, trials: Path | None, quick: bool) -> None:
    """Measure speed ratios."""
    from cosim.studies import bench as ratios

    with _writable(out):
        ratios.run(out, trials, quick)
