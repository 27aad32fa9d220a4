"""``cosim theory``."""

import argparse
import math
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, writable

_GIVEN = (
    ("mu_s", "MU", "static coefficient of friction"),
    ("mu_k", "MU", "kinetic coefficient of friction"),
    ("a_max", "M/S2", "greatest acceleration of the surface, m/s²"),
    ("f_n", "RATIO", "normal force over the part's weight"),
    ("period", "S", "period, s"),
)


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


def _options(parser: argparse.ArgumentParser) -> None:
    for name, unit, text in _GIVEN:
        option = f"--{name.replace('_', '-')}"
        parser.add_argument(
            option, type=_number, metavar=unit, help=f"{text} (default: the paper's)"
        )
    parser.add_argument("--errata", action="store_true", help="the paper's misprints, each proven")
    add_out(parser, "results/theory")


def _run(arguments: argparse.Namespace) -> None:
    import cosim

    if arguments.errata:
        from cosim.studies.paper import errata_text

        print(errata_text())
        return
    out: Path = arguments.out
    given = {name: getattr(arguments, name) for name, _, _ in _GIVEN}
    with writable(out):
        found = cosim.theory(**{name: value for name, value in given.items() if value is not None})
        found.save(out)
    print(found)
    print(f"Written to {out}: theory.json, knife_edge.csv")
    figures = (str(out / f"{name}.png") for name in ("figure3", "figure4", "knife_edge"))
    print(f"Figures: {', '.join(figures)}")


COMMAND = Command(
    "theory", "the paper's closed forms: theory.json, figure3.png, figure4.png", _run, _options
)
