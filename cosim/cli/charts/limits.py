"""``cosim chart limits``."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from cosim.cli.command import Command
from cosim.cli.options import (
    add_out,
    add_overrides,
    add_quick,
    add_workers,
    progress_bar,
    writable,
)

_AT = [f"trial-{number:02d}" for number in range(1, 11)]


def _options(parser: ArgumentParser) -> None:
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
        default=_AT,
        help="scenes at whose own settings each limit is lifted (default: trial-01 … trial-10)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="of the search (default: 0)"
    )
    add_workers(parser)
    add_quick(parser, "a coarse search, in a fraction of the time")
    add_out(parser, "results")


def _run(arguments: Namespace) -> None:
    from cosim.errors import BadInput
    from cosim.scene import load
    from cosim.studies.limits.report import run
    from cosim.studies.limits.study import FULL, QUICK, checked, ensemble

    if arguments.seed < 0:
        raise BadInput(f"--seed {arguments.seed}: must be a whole number from 0.")
    scene = load(arguments.scene, arguments.overrides)
    efforts = QUICK if arguments.quick else FULL
    rigs = ensemble(arguments.rigs, efforts.rigs) if arguments.rigs else []
    checked(scene, rigs, arguments.rigs)
    there = [load(name) for name in arguments.at]
    asked = " ".join([arguments.scene, *(f"--set {text}" for text in arguments.overrides)])
    with writable(arguments.out, shared=True), progress_bar("limits", None, "step") as bar:

        def told(steps: int, name: str) -> None:
            bar.total = steps
            bar.update()
            bar.set_postfix_str(name)

        words = run(
            arguments.out,
            scene,
            asked,
            rigs,
            there,
            seed=arguments.seed,
            efforts=efforts,
            workers=arguments.workers,
            dask=arguments.dask,
            told=told,
            progress=bar.refresh,
        )
    print(words)


COMMAND = Command("limits", "what is achievable, and which limit binds", _run, _options)
