"""``cosim run``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_scene, progress_bar, scene_of, writable

_BAR = "{desc} {percentage:3.0f}% |{bar}| {n:.2f} of {total:g} s, {remaining} left"


def _options(parser: ArgumentParser) -> None:
    add_scene(parser)
    add_out(parser, "results/<scene>", known=False)


def _run(arguments: Namespace) -> None:
    scene = scene_of(arguments)
    folder = arguments.out or Path("results") / scene.name
    with writable(folder):
        import cosim
        from cosim.files.spill import on_disk_in
        from cosim.waveforms.report import table

        def progress(time: float) -> None:
            bar.update(time - bar.n)

        with (
            progress_bar(scene.name, scene.run.duration, "s", delay=1.0, bar_format=_BAR) as bar,
            on_disk_in(folder),
        ):
            result = cosim.run(scene, progress=progress)
        result.save(folder)
    print(f"{scene.name}: {scene.description}" if scene.description else scene.name)
    print(table(result.scene, result.summary))
    print(f"Written to {folder}: waveforms.csv, waveforms.nc, summary.json, scene.toml")
    print(f"Figure: {folder / 'figure.png'}")


COMMAND = Command("run", "run a scene; write waveforms, summary and figure", _run, _options)
