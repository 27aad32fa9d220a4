"""``cosim tune``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_scene, add_workers, progress_bar, scene_of, writable

if TYPE_CHECKING:
    from cosim.studies.tune.found import Run


def _options(parser: ArgumentParser) -> None:
    add_scene(parser)
    goal = parser.add_mutually_exclusive_group(required=True)
    goal.add_argument("--maximise", metavar="NAME", help="a number of the summary: v_average, …")
    goal.add_argument("--minimise", metavar="NAME", help="the same, downwards")
    parser.add_argument(
        "--over",
        metavar="TABLE.KEY=LOW:HIGH",
        action="append",
        default=[],
        help="a numeric key and its range; repeatable (default: the three knobs, end to end)",
    )
    parser.add_argument(
        "--budget", type=int, default=200, metavar="N", help="runs in all (default: 200)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the search (default: 0)"
    )
    add_workers(parser)
    add_out(parser, "results/<scene>-tune", known=False)


def _run(arguments: Namespace) -> None:
    import cosim
    from cosim.studies.tune.found import ranges_of, write_runs

    scene, ranges = scene_of(arguments), ranges_of(arguments.over)
    quantity = arguments.maximise or arguments.minimise
    folder = arguments.out or Path("results") / f"{scene.name}-tune"
    runs: list[Run] = []

    def scouting(run: "Run", best: "Run | None") -> None:
        if best is not None:
            bar.set_postfix_str(f"without ngspice, {quantity} {best.value:.4g}", refresh=False)
        bar.refresh()

    def progress(run: "Run", best: "Run | None") -> None:
        runs.append(run)
        if best is not None:
            bar.set_postfix_str(f"{quantity} {best.value:.4g}", refresh=False)
        bar.update()

    with writable(folder), progress_bar(scene.name, arguments.budget, "run") as bar:
        try:
            found = cosim.tune(
                scene,
                maximise=arguments.maximise,
                minimise=arguments.minimise,
                over=ranges,
                budget=arguments.budget,
                seed=arguments.seed,
                out=folder,
                workers=arguments.workers,
                dask=arguments.dask,
                progress=progress,
                scouting=scouting,
            )
        except KeyboardInterrupt:
            write_runs(folder / "tune.csv", runs, quantity)
            raise
    print(found)
    print(f"Written to {folder}: tune.json, tune.csv, best.toml")
    print(f"Figure: {folder / 'figure.png'}")


COMMAND = Command("tune", "find the settings that transport best", _run, _options)
