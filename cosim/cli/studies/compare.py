"""``cosim compare``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_overrides, writable


def _options(parser: ArgumentParser) -> None:
    parser.add_argument("run", metavar="RUN|SCENE", help="a folder that cosim run wrote or a scene")
    parser.add_argument(
        "trial", type=Path, metavar="TRIAL.csv", help="a tracked trial, or other measurements"
    )
    add_overrides(parser)
    add_out(parser, "results/compare")


def _run(arguments: Namespace) -> None:
    import cosim

    out: Path = arguments.out
    with writable(out):
        found = cosim.compare(arguments.run, arguments.trial, arguments.overrides)
        found.save(out)
    print(found)
    print(f"Written to {out}: compare.json, compare.csv, frames.csv")
    print(f"Figure: {out / 'compare.png'}")


COMMAND = Command(
    "compare", "simulated against measured: a run's folder or a scene, and a trial", _run, _options
)
