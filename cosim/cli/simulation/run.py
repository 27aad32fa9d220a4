"""``cosim run``."""

import json
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_scene, progress_bar, scene_of, writable

if TYPE_CHECKING:
    from cosim.scene import Scene
    from cosim.studies.spread.run import Spread

_BAR = "{desc} {percentage:3.0f}% |{bar}| {n:.2f} of {total:g} s, {remaining} left"


def _options(parser: ArgumentParser) -> None:
    add_scene(parser)
    parser.add_argument(
        "--spread",
        action="store_true",
        help="also tell how rugged the answer is: v_average with each of the three knobs turned "
        "by 2 %% either way",
    )
    add_out(parser, "results/<scene>", known=False)


def _run(arguments: Namespace) -> None:
    scene = scene_of(arguments)
    folder = arguments.out or Path("results") / scene.name
    if arguments.spread:
        from cosim.studies.spread.run import turns

        turns(scene)  # refuses a scene without knobs before it is run
    with writable(folder):
        import cosim
        from cosim.files.atomic import write_json
        from cosim.simulation.elsewhere import on_disk_in
        from cosim.waveforms.report import table

        def progress(time: float) -> None:
            bar.update(time - bar.n)

        with (
            progress_bar(scene.name, scene.run.duration, "s", delay=1.0, bar_format=_BAR) as bar,
            on_disk_in(folder),
        ):
            result = cosim.run(scene, progress=progress)
        result.save(folder)
        found = _spread(result.scene) if arguments.spread else None
        if found is not None:
            path = folder / "summary.json"
            saved = json.loads(path.read_text(encoding="utf-8"))
            write_json(path, saved | {"spread": found.summary()})
    print(f"{scene.name}: {scene.description}" if scene.description else scene.name)
    print(table(result.scene, result.summary))
    if found is not None:
        print(found)
    print(f"Written to {folder}: waveforms.csv, waveforms.nc, summary.json, scene.toml")
    print(f"Figure: {folder / 'figure.png'}")


def _spread(scene: "Scene") -> "Spread":
    import cosim

    def progress(runs: int) -> None:
        bar.update(runs - bar.n)

    with progress_bar("spread", None, "run") as bar:
        return cosim.spread(scene, progress=progress)


COMMAND = Command("run", "run a scene; write waveforms, summary and figure", _run, _options)
