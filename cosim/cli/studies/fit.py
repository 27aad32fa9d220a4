"""``cosim fit``."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import add_out, writable


def _options(parser: ArgumentParser) -> None:
    parser.add_argument(
        "trials", type=Path, metavar="TRIALS_DIR", help="folder of the trials' CSVs"
    )
    parser.add_argument(
        "--forces",
        metavar="FILE",
        help="what is known of normal forces: a CSV with the columns trial, force, lower, upper, "
        "mass, or a TOML with a table for each trial; or “published”",
    )
    parser.add_argument(
        "--mu-k",
        type=_number_or_free,
        default=None,
        metavar="MU_K",
        help="kinetic friction, by which normal forces follow from µ_k F_n, or “free” to find it "
        "from the bounds of the forces (default: 0.59, as measured)",
    )
    parser.add_argument(
        "--no-plate",
        action="store_true",
        help="no friction at the springed plate, which else moves as tracked and rubs",
    )
    parser.add_argument(
        "--evaluate",
        choices=["published"],
        help="take the paper's parameters, by its procedure, instead of a fit",
    )
    parser.add_argument(
        "--solver",
        choices=["exact", "published"],
        default="exact",
        help="of the paper's parameters: exact, or the authors' fixed-step scheme (default: exact)",
    )
    add_out(parser, "results/fit")


def _number_or_free(text: str) -> float | str:
    if text == "free":
        return text
    try:
        return float(text)
    except ValueError:
        raise ArgumentTypeError(f"“{text}” is neither a number nor “free”") from None


def _run(arguments: Namespace) -> None:
    import cosim

    given = {} if arguments.mu_k is None else {"mu_k": arguments.mu_k}
    with writable(arguments.out):
        found = cosim.fit(
            arguments.trials,
            forces=arguments.forces,
            plate=not arguments.no_plate,
            evaluate=arguments.evaluate,
            solver=arguments.solver,
            **given,
        )
        found.save(arguments.out)
    print(found)
    print(f"Written to {arguments.out}: fit.json, fit.csv and figures")


COMMAND = Command(
    "fit",
    "fit friction and normal forces to tracked trials; write table and figures",
    _run,
    _options,
)
