"""``cosim chart limits``."""

from argparse import ArgumentParser, Namespace

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_scenes, progress_bar, writable

_FAST = ["drive.frequency=50.8", "drive.amplitude=9", "drive.offset=-1.2"]
_SLOW = ["drive.frequency=20", "drive.amplitude=4.7"]
_SETTINGS = [_FAST, [*_FAST, "mechanics.contact=rigid"], _SLOW]


def _options(parser: ArgumentParser) -> None:
    add_scenes(parser, "paper at three settings")
    add_out(parser, "results")


def _run(arguments: Namespace) -> None:
    from cosim.scene import load

    asked = [(source, []) for source in arguments.scenes] or [("paper", own) for own in _SETTINGS]
    scenes = [load(source, [*own, *arguments.overrides]) for source, own in asked]
    with writable(arguments.out, shared=True):
        from cosim.studies.circuit import limits, limits_report

        turns = [number == 0 for number in range(len(scenes))]
        total = sum(limits.runs_in_all(turn) for turn in turns)
        with progress_bar("limits", total, "run") as bar:
            found = [limits.study(*pair, bar.update) for pair in zip(scenes, turns, strict=True)]
        print(limits_report.write(arguments.out, found))


COMMAND = Command("limits", "which limit of the circuit binds", _run, _options)
