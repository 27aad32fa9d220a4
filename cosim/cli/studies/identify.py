"""``cosim identify``."""

import sys
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, add_quick, writable

EVERY = 10.0  # s; between lines where stderr is no terminal


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


class _Line:
    """The progress on one line of a terminal, else a line now and then."""

    def __init__(self) -> None:
        self._began = self._told = time.monotonic()
        self._terminal = sys.stderr.isatty()

    def __call__(self, what: str, best: float) -> None:
        now = time.monotonic()
        if now - self._told < (0.2 if self._terminal else EVERY):
            return
        self._told = now
        line = f"{now - self._began:6.0f} s  {what}: cost {best:.4f}"
        if self._terminal:
            print(f"\r{line:<78.78}", end="", file=sys.stderr, flush=True)
        else:
            print(line, file=sys.stderr, flush=True)

    def end(self) -> None:
        """Leave the terminal's line."""
        if self._terminal:
            print(file=sys.stderr)


def _run(arguments: Namespace) -> None:
    import cosim

    line = _Line()
    with writable(arguments.out):
        try:
            found = cosim.identify(
                arguments.trials,
                bounds=arguments.bounds,
                apart=arguments.apart,
                quick=arguments.quick,
                seed=arguments.seed,
                out=arguments.out,
                workers=arguments.workers,
                progress=line,
            )
        finally:
            line.end()
    print(found)
    print(f"Written to {arguments.out}: identify.json, .csv, .md, figures and scenes")


COMMAND = Command(
    "identify",
    "identify one rig, and each trial's drive, from tracked trials; write report and scenes",
    _run,
    _options,
)
