"""``cosim chart``: the studies that leave a table, a page and figures."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from cosim.cli.command import Command, add_commands
from cosim.cli.options import (
    add_out,
    add_overrides,
    add_quick,
    add_scenes,
    add_workers,
    progress_bar,
    writable,
)


def _chart(name: str, study: str, text: str, *options: Callable[[ArgumentParser], None]) -> Command:
    """The command of ``study``, ``module.function`` below ``cosim.studies``: the options have the
    names of its parameters; besides it takes ``progress`` (done, total, what) and gives reports."""

    def add(parser: ArgumentParser) -> None:
        for option in options:
            option(parser)
        add_out(parser, "results")

    def run(arguments: Namespace) -> None:
        asked = {key: value for key, value in vars(arguments).items() if key != "call"}
        with writable(arguments.out, shared=True), progress_bar(name, None, "step") as bar:

            def progress(done: int, total: int, what: str = "") -> None:
                bar.total = total
                bar.set_postfix_str(what, refresh=False)
                bar.update(done - bar.n)

            module, _, function = study.rpartition(".")
            found = getattr(import_module(f"cosim.studies.{module}"), function)
            reports = found(**asked, progress=progress)
        for report in reports if isinstance(reports, tuple) else (reports,):
            print(f"{report}\n\n{report.written(arguments.out)}")

    return Command(name, text, run, add)


def _trials(parser: ArgumentParser) -> None:
    parser.add_argument(
        "trials", type=Path, metavar="TRIALS_DIR", help="folder of the published trials' CSVs"
    )


def _part(parser: ArgumentParser) -> None:
    add_quick(parser, "a part of it, in a fraction of the time")


def _limits(parser: ArgumentParser) -> None:
    parser.add_argument(
        "scene",
        metavar="SCENE",
        nargs="?",
        default="paper",
        help="the rig: a built-in scene or a TOML file (default: paper)",
    )
    add_overrides(parser)
    parser.add_argument(
        "--rigs",
        type=Path,
        metavar="FILE",
        help="other rigs that may be meant: a JSON or TOML file whose list ensemble has tables of "
        "keys and values, such as identify.json",
    )
    parser.add_argument(
        "--at",
        metavar="SCENE",
        nargs="+",
        help="scenes at whose own settings each limit is lifted (default: trial-01 … trial-10)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the search (default: 0)"
    )
    parser.add_argument(
        "--effort",
        type=float,
        default=1.0,
        metavar="X",
        help="times the runs that each search may make (default: 1)",
    )
    add_workers(parser)
    add_quick(parser, "a coarse search, in a fraction of the time")


CHARTS = [
    _chart(
        *("accuracy", "accuracy.accuracy.accuracy"),
        *("error of every coupling method over its run time", _part),
    ),
    _chart(
        *("ladder", "circuit.ladder_report.ladder"),
        *("what each rung of a circuit costs, and how far it is from the top", add_scenes),
    ),
    _chart(
        *("limits", "limits.report.limits"),
        *("what is achievable, and which limit binds", _limits),
    ),
    _chart(
        *("paper", "paper.figure7.paper"),
        *("the paper's figure 7: its trials, measured and simulated", _trials),
    ),
    _chart(
        *("stability", "stability.stability.stability"),
        *("largest stable macro step of every coupling method", _part),
    ),
    _chart(
        *("trials", "compare.each.trials"),
        *("the whole chain against every published trial", _trials, add_overrides),
    ),
]


def _options(parser: ArgumentParser) -> None:
    add_commands(parser, "|".join(chart.name for chart in CHARTS), CHARTS)


COMMAND = Command("chart", "the studies, as tables and a figure", options=_options)
