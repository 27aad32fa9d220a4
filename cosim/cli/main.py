"""The command ``cosim``.

Exit codes: 0 done; 2 bad input, told in one sentence; 3 the simulation failed; 130 interrupted.
"""

import argparse
import math
import os
import sys
import warnings
from io import TextIOWrapper
from pathlib import Path
from typing import NoReturn, TextIO

from cosim import __version__
from cosim.errors import BadInput, CosimError, NoEffect

INTERRUPTED = 130


class _Parser(argparse.ArgumentParser):
    """Tells a wrong command line in one sentence, like any other bad input."""

    def error(self, message: str) -> NoReturn:
        raise BadInput(f"{message} (see {self.prog} --help).")


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text} is not a finite number")
    return value


def _add_overrides(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--set",
        dest="overrides",
        metavar="TABLE.KEY=VALUE",
        action="append",
        default=[],
        help="replace a value of the scene; repeatable",
    )


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="cosim",
        description="Runs a vibrating gripper: its circuit in ngspice, its mechanics in an FMU.",
    )
    parser.add_argument("--version", action="version", version=f"cosim {__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    commands.add_parser("scenes", help="list the built-in scenes")

    run = commands.add_parser(
        "run", help="run a scene; write waveforms, summary and figure", allow_abbrev=False
    )
    run.add_argument("scene", metavar="SCENE", help="a built-in scene or a TOML file")
    _add_overrides(run)
    run.add_argument(
        "--out", type=Path, metavar="DIR", help="where to write (default: results/<scene>)"
    )

    sweep = commands.add_parser(
        "sweep", help="run a scene over a grid or a sample of settings", allow_abbrev=False
    )
    sweep.add_argument("scene", metavar="SCENE", help="a built-in scene or a TOML file")
    sweep.add_argument(
        "--over",
        metavar="TABLE.KEY=START:STOP:N|A,B,C",
        action="append",
        default=[],
        help="a numeric key and its values; repeatable, the last one runs fastest. Where the "
        "frequency is swept, each point lasts whole periods",
    )
    _add_overrides(sweep)
    sweep.add_argument(
        "--samples",
        type=int,
        metavar="N",
        help="N settings from the ranges of the keys, a Latin hypercube, instead of the grid",
    )
    sweep.add_argument("--random", action="store_true", help="independent samples instead of it")
    sweep.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the samples (default: 0)"
    )
    sweep.add_argument(
        "--workers", type=int, metavar="N", help="processes (default: one for each processor)"
    )
    sweep.add_argument("--dask", metavar="ADDRESS", help="run on the Dask cluster at this address")
    sweep.add_argument(
        "--out", type=Path, metavar="DIR", help="where to write (default: results/<scene>-sweep)"
    )

    tune = commands.add_parser(
        "tune", help="find the settings that transport best", allow_abbrev=False
    )
    tune.add_argument("scene", metavar="SCENE", help="a built-in scene or a TOML file")
    goal = tune.add_mutually_exclusive_group(required=True)
    goal.add_argument("--maximise", metavar="NAME", help="a number of the summary: v_average, …")
    goal.add_argument("--minimise", metavar="NAME", help="the same, downwards")
    tune.add_argument(
        "--over",
        metavar="TABLE.KEY=LOW:HIGH",
        action="append",
        default=[],
        help="a numeric key and its range; repeatable (default: the three knobs, end to end)",
    )
    _add_overrides(tune)
    tune.add_argument(
        "--budget", type=int, default=200, metavar="N", help="runs in all (default: 200)"
    )
    tune.add_argument("--seed", type=int, default=0, metavar="N", help="of the search (default: 0)")
    tune.add_argument(
        "--workers", type=int, metavar="N", help="processes (default: one for each processor)"
    )
    tune.add_argument(
        "--out", type=Path, metavar="DIR", help="where to write (default: results/<scene>-tune)"
    )

    theory = commands.add_parser(
        "theory", help="the paper's closed forms: theory.json, figure3.png, figure4.png"
    )
    for option, unit, text in (
        ("--mu-s", "MU", "static coefficient of friction"),
        ("--mu-k", "MU", "kinetic coefficient of friction"),
        ("--a-max", "M/S2", "greatest acceleration of the surface, m/s²"),
        ("--f-n", "RATIO", "normal force over the part's weight"),
        ("--period", "S", "period, s"),
    ):
        theory.add_argument(
            option, type=_number, metavar=unit, help=f"{text} (default: the paper's)"
        )
    theory.add_argument("--errata", action="store_true", help="the paper's misprints, each proven")
    theory.add_argument(
        "--out", type=Path, default=Path("results/theory"), metavar="DIR", help="where to write"
    )

    fit = commands.add_parser(
        "fit", help="fit friction and normal forces to tracked trials; write table and figures"
    )
    fit.add_argument("trials", type=Path, metavar="TRIALS_DIR", help="folder of the trials' CSVs")
    fit.add_argument(
        "--evaluate", choices=["published"], help="take the paper's parameters instead of a fit"
    )
    fit.add_argument(
        "--solver",
        choices=["exact", "published"],
        default="exact",
        help="exact events, or the authors' fixed-step scheme (default: exact)",
    )
    fit.add_argument(
        "--plate", action="store_true", help="fit the friction of the springed plate too"
    )
    fit.add_argument(
        "--out", type=Path, default=Path("results/fit"), metavar="DIR", help="where to write"
    )

    compare = commands.add_parser(
        "compare", help="simulated against measured: a run's folder or a scene, and a trial"
    )
    compare.add_argument(
        "run", metavar="RUN|SCENE", help="a folder that cosim run wrote, or a scene"
    )
    compare.add_argument("trial", type=Path, metavar="TRIAL.csv", help="a tracked trial")
    _add_overrides(compare)
    compare.add_argument(
        "--out", type=Path, default=Path("results/compare"), metavar="DIR", help="where to write"
    )

    export = commands.add_parser(
        "export", help="write a finished run in other programs' formats", allow_abbrev=False
    )
    export.add_argument("run", type=Path, metavar="DIR", help="a folder that cosim run wrote")
    export.add_argument(
        "--as",
        dest="forms",
        metavar="FORM,...",
        action="append",
        required=True,
        help="csv, nc, mat (MATLAB 5), hdf5, raw (ngspice's binary), wav (the surface's velocity "
        "as sound) or tracker (a tracked trial); repeatable",
    )
    export.add_argument("--out", type=Path, metavar="DIR", help="where to write (default: the run)")

    chart = commands.add_parser("chart", help="the studies, as tables and a figure")
    charts = chart.add_subparsers(
        dest="chart", required=True, metavar="accuracy|stability|ladder|limits"
    )
    for name, text, given in (
        ("ladder", "what each rung of a circuit costs, and how far it is from the top", "paper"),
        ("limits", "which limit of the circuit binds", "paper at three settings"),
    ):
        one = charts.add_parser(name, help=text, allow_abbrev=False)
        one.add_argument(
            "scenes",
            metavar="SCENE",
            nargs="*",
            help=f"built-in scenes or TOML files (default: {given})",
        )
        _add_overrides(one)
    for name, text in (
        ("accuracy", "error of every coupling method over its run time"),
        ("stability", "largest stable macro step of every coupling method"),
    ):
        one = charts.add_parser(name, help=text, allow_abbrev=False)
        one.add_argument(
            "--quick", action="store_true", help="a part of it, in a fraction of the time"
        )

    for one in charts.choices.values():
        one.add_argument(
            "--out",
            type=Path,
            default=Path("results"),
            metavar="DIR",
            help="where to write (default: results)",
        )

    bench = commands.add_parser("bench", help="speed ratios, taken side by side in one run")
    bench.add_argument("--trials", type=Path, metavar="DIR", help="folder of tracked trials")
    bench.add_argument("--quick", action="store_true", help="fewer rounds: under a minute")
    bench.add_argument(
        "--out", type=Path, default=Path("results/bench"), metavar="DIR", help="where to write"
    )

    fmu = commands.add_parser("fmu", help="build or check the FMU files of the mechanics")
    actions = fmu.add_subparsers(dest="action", required=True, metavar="build|check")
    build = actions.add_parser("build", help="write stickslip-fmi2.fmu and stickslip-fmi3.fmu")
    build.add_argument(
        "--out", type=Path, default=Path("results/fmu"), metavar="DIR", help="where to write"
    )
    actions.add_parser("check", help="validate the FMU files and run them")
    return parser


def _dispatch(arguments: argparse.Namespace) -> int:
    from cosim.cli import commands

    if arguments.command == "scenes":
        commands.scenes()
    elif arguments.command == "run":
        commands.run(arguments.scene, arguments.overrides, arguments.out)
    elif arguments.command == "sweep":
        commands.sweep(
            arguments.scene,
            arguments.overrides,
            arguments.over,
            commands.Sampling(arguments.samples, arguments.random, arguments.seed),
            arguments.workers,
            arguments.dask,
            arguments.out,
        )
    elif arguments.command == "tune":
        commands.tune(
            arguments.scene,
            arguments.overrides,
            arguments.over,
            arguments.maximise or arguments.minimise,
            arguments.maximise is not None,
            arguments.budget,
            arguments.seed,
            arguments.workers,
            arguments.out,
        )
    elif arguments.command == "theory":
        names = ("mu_s", "mu_k", "a_max", "f_n", "period")
        given = {name: getattr(arguments, name) for name in names}
        commands.theory(
            arguments.out, arguments.errata, {k: v for k, v in given.items() if v is not None}
        )
    elif arguments.command == "fit":
        commands.fit(
            arguments.trials, arguments.out, arguments.evaluate, arguments.solver, arguments.plate
        )
    elif arguments.command == "compare":
        commands.compare(arguments.run, arguments.overrides, arguments.trial, arguments.out)
    elif arguments.command == "export":
        commands.export(arguments.run, arguments.forms, arguments.out)
    elif arguments.command == "chart" and arguments.chart in ("accuracy", "stability"):
        studies = {"accuracy": commands.chart_accuracy, "stability": commands.chart_stability}
        studies[arguments.chart](arguments.out, arguments.quick)
    elif arguments.command == "chart":
        chosen = {"ladder": commands.chart_ladder, "limits": commands.chart_limits}
        chosen[arguments.chart](arguments.scenes, arguments.overrides, arguments.out)
    elif arguments.command == "bench":
        commands.bench(arguments.out, arguments.trials, arguments.quick)
    elif arguments.action == "build":
        commands.fmu_build(arguments.out)
    else:
        return commands.fmu_check()
    return 0


def main(argv: list[str] | None = None) -> int:
    """Run the command; returns the exit code."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # rather a question mark than no result
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", NoEffect)
            warnings.showwarning = _note
            code = _dispatch(_parser().parse_args(argv))
        sys.stdout.flush()
        return code
    except CosimError as error:
        return _told(str(error), error.exit_code)
    except BrokenPipeError:  # whoever read the output has seen enough
        _discard_output()
        return 0
    except OSError as error:
        if error.filename is None:
            _discard_output()
        where = f"{error.filename}: " if error.filename else "The output cannot be written: "
        return _told(f"{where}{error.strerror or error}.", BadInput.exit_code)
    except KeyboardInterrupt:
        # One that struck while a library executed a string, as dataclasses do, is remembered by
        # Python as not handled, and would end the process by the signal; another string clears it.
        exec("")
        return _told("interrupted.", INTERRUPTED)


def _note(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Tell a warning in one line, without where in the program it was raised."""
    print("cosim: note:", " ".join(str(message).split()), file=sys.stderr)


def _told(sentence: str, code: int) -> int:
    """Print the sentence on one line; returns the exit code."""
    words = " ".join(sentence.split())
    print(f"cosim: {words}" + ("" if words.endswith((".", "?")) else "."), file=sys.stderr)
    return code


def _discard_output() -> None:
    """Keep Python from trying at its end to write what could not be written."""
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, sys.stdout.fileno())
    os.close(null)


if __name__ == "__main__":
    sys.exit(main())
