"""``cosim identify``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_quick, progress_bar, writable


def _options(parser: ArgumentParser) -> None:
    parser.add_argument(
        "trials", type=Path, metavar="TRIALS_DIR", help="folder of the trials' CSVs"
    )
    parser.add_argument(
        "--bounds", type=Path, metavar="FILE", help="TOML with bounds and priors of one's own"
    )
    parser.add_argument(
        "--apart",
        action="append",
        default=[],
        metavar="TRIAL",
        help="a trial that is reported, not fitted; repeatable (always: those that do not repeat)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the search (default: 0)"
    )
    parser.add_argument(
        "--workers", type=int, metavar="N", help="threads (default: one for each processor)"
    )
    add_quick(parser, "a short search, to see whether the trials are understood")
    add_out(parser, "results/identify")


def _run(arguments: Namespace) -> None:
    import cosim

    with writable(arguments.out), progress_bar("identify", None, "look") as bar:

        def progress(what: str, best: float) -> None:
            bar.set_description_str(f"{what}: cost {best:.4f}", refresh=False)
            bar.update()

        found = cosim.identify(
            arguments.trials,
            bounds=arguments.bounds,
            apart=arguments.apart,
            quick=arguments.quick,
            seed=arguments.seed,
            out=arguments.out,
            workers=arguments.workers,
            progress=progress,
        )
    print(found)
    print(f"Written to {arguments.out}: identify.json, .csv, .md, figures and scenes")


COMMAND = Command(
    "identify",
    "identify one rig, and each trial's drive, from tracked trials; write report and scenes",
    _run,
    _options,
)
