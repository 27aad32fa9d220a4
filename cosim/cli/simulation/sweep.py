"""``cosim sweep``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_scene, add_workers, progress_bar, scene_of, writable
from cosim.errors import SimulationFailed


def _options(parser: ArgumentParser) -> None:
    add_scene(parser)
    parser.add_argument(
        "--over",
        metavar="TABLE.KEY=START:STOP:N|A,B,C",
        action="append",
        default=[],
        help="a numeric key and its values; repeatable, the last one runs fastest. Where the "
        "frequency is swept, each point lasts whole periods",
    )
    parser.add_argument(
        "--samples",
        type=int,
        metavar="N",
        help="N settings from the ranges of the keys, a Latin hypercube, instead of the grid",
    )
    parser.add_argument("--random", action="store_true", help="independent samples instead of it")
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the samples (default: 0)"
    )
    add_workers(parser)
    add_out(parser, "results/<scene>-sweep", known=False)


def _run(arguments: Namespace) -> None:
    import cosim
    from cosim.studies.sweep import design, report

    scene, axes = scene_of(arguments), design.parse(arguments.over)
    folder = arguments.out or Path("results") / f"{scene.name}-sweep"

    def progress(done: int, failed: int, total: int) -> None:
        if bar.total is None:
            bar.reset(total)
            bar.initial = done  # those of an earlier run tell nothing of the rate
        bar.update(done - bar.n)
        if failed:
            bar.set_postfix_str(f"{failed} failed", refresh=False)

    with writable(folder), progress_bar(scene.name, None, "point") as bar:
        data = cosim.sweep(
            scene,
            axes,
            samples=arguments.samples,
            random=arguments.random,
            seed=arguments.seed,
            out=folder,
            workers=arguments.workers,
            dask=arguments.dask,
            progress=progress,
        )
    print(report.table(scene.name, data))
    print(f"Written to {folder}: sweep.nc")
    print(f"Figure: {folder / 'figure.png'}")
    reasons = [str(reason) for reason in data["failure"].values.flat]
    if all(reasons):
        raise SimulationFailed(f"No point could be run; the first one: {reasons[0]}")


COMMAND = Command("sweep", "run a scene over a grid or a sample of settings", _run, _options)
