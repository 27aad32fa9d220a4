"""``cosim chart ladder``."""

from argparse import ArgumentParser, Namespace

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_scenes, progress_bar, writable


def _options(parser: ArgumentParser) -> None:
    add_scenes(parser, "paper")
    add_out(parser, "results")


def _run(arguments: Namespace) -> None:
    from cosim.scene import load

    scenes = [load(source, arguments.overrides) for source in arguments.scenes or ["paper"]]
    with writable(arguments.out, shared=True):
        from cosim.evaluate.store import Store
        from cosim.studies.circuit import ladder, ladder_report

        asked = [scene.as_dict() for scene in scenes]
        with (
            Store(arguments.out / "ladder.sqlite", asked) as store,
            progress_bar("ladder", ladder.runs_in_all() * len(scenes), "run") as bar,
        ):
            found = [(scene, ladder.ladder(scene, store, bar.update)) for scene in scenes]
            print(ladder_report.write(arguments.out, found))
            store.remove()


COMMAND = Command(
    "ladder", "what each rung of a circuit costs, and how far it is from the top", _run, _options
)
