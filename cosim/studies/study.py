"""The declaration of a study, from which its command, library function and reference are made.

The ``__init__.py`` of a study's folder declares it in ``STUDIES``, and imports nothing that takes
time: ``cosim --help`` and ``import cosim`` read all declarations. So these only name functions, as
``module.function`` below this package, which are imported when they are needed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Literal

_PACKAGE = __name__.rpartition(".")[0]


def loaded(name: str) -> Callable[..., Any]:
    """The function ``name``, given as ``module.function`` below this package."""
    module, _, function = name.rpartition(".")
    return getattr(import_module(f"{_PACKAGE}.{module}"), function)


@dataclass(frozen=True)
class Option:
    """An option of a command; its value becomes an argument of the study's function."""

    name: str
    """The option as it is typed, ``--seed``; for a positional argument the parameter's name."""
    help: str
    metavar: str | None = None
    """Placeholder of the value in the help; a unit where it has one."""
    kind: Callable[[str], Any] = str
    """Converts the typed text. ``bool``: a flag without a value, False for ``--no-…``."""
    default: Any = None
    """The function's default value, which the help shows; None if ``help`` describes it."""
    parameter: str = ""
    """Name of the function's parameter, where it is not the option's."""
    many: Literal["", "repeat", "optional", "any"] = ""
    """"repeat": a list, by repeating the option; "any": a list of any number of words;
    "optional": one word that may be left out."""
    choices: tuple[str, ...] = ()
    needed: bool = False
    read: str = ""
    """Function that makes the argument of the value (a list where ``many``); raises BadInput."""

    @property
    def argument(self) -> str:
        """The function's parameter."""
        return self.parameter or self.name.lstrip("-").replace("-", "_")


SCENE = Option("scene", "a built-in scene, a TOML file or a link", "SCENE")
OVERRIDES = Option(
    *("--set", "replace a value of the scene; repeatable", "TABLE.KEY=VALUE"),
    parameter="overrides",
    many="repeat",
)
SEED = Option("--seed", "of the search", "N", int, 0)


def check_seed(seed: int) -> None:
    """Raise BadInput for a seed of which NumPy makes no generator."""
    from cosim.scene.messages import check_whole  # not at start-up

    check_whole("--seed", seed, 0)


WORKERS = Option("--workers", "runs at once (default: one for each processor)", "N", int)
COLUMNS = Option(
    "--columns",
    "which column of TRIAL.csv is what: time, surface, part, v_surface, v_part, current, voltage "
    "or command",
    "surface=NAME[:unit],…",
)
SHOW = Option("--show", "also write show.html, a page to look into the results", kind=bool)
DASK = Option("--dask", "run on the Dask cluster at this address", "ADDRESS")


def folder_of_trials(help: str) -> Option:
    return Option("trials", help, "TRIALS_DIR", Path)


def quick(help: str) -> Option:
    return Option("--quick", help, kind=bool)


Told = Callable[..., tuple[int | None, int | None, str]]
"""Converts the arguments of a progress callback to the progress bar's: steps done (None: one more),
their total (None: unchanged), and words on the last one."""


@dataclass(frozen=True)
class Study:
    """A study as a command and a library function.

    Its function takes the arguments of the options, ``out`` where it ``saves``, and the callbacks
    of ``tells``; it returns a result that has ``save``, or one or several reports.
    """

    home: str
    """Its function, as for :func:`loaded`; the last part is its name in the library."""
    help: str = ""
    options: tuple[Option, ...] = ()
    command: str = ""
    """The words after ``cosim``; empty for a study of the library alone."""
    library: bool = True
    """Whether it is one of the library's functions."""
    out: str = ""
    """The command's default folder; ``<scene>`` stands for the scene's name."""
    saves: bool = True
    """Whether the function itself writes into ``out``; else the command saves its result."""
    writes: str = ""
    """The files besides figures, in words; empty for reports, which name their own."""
    figures: tuple[str, ...] = ()
    unit: str = "step"
    """Unit of the progress bar."""
    total: str = ""
    """The option with the number of steps, where the callbacks do not have it."""
    tells: Mapping[str, Told] = field(default_factory=dict)
    """The function's progress callbacks, by parameter."""
    told: str = ""
    """Function that makes the printed text of a result; by default its ``repr``."""
    check: str = ""
    """Function that raises SimulationFailed for a useless result, printed and saved before."""

    @property
    def module(self) -> str:
        return f"{_PACKAGE}.{self.home.rpartition('.')[0]}"

    @property
    def name(self) -> str:
        return self.home.rpartition(".")[2]

    @property
    def function(self) -> Callable[..., Any]:
        """The function itself; its libraries are loaded now."""
        return loaded(self.home)


def chart(
    home: str, help: str, *options: Option, library: bool = True, saves: bool = True
) -> Study:
    """A study that returns reports, with a callback ``progress`` that is a report's Progress."""
    tells: dict[str, Told] = {"progress": lambda done, total, what="": (done, total, what)}
    command = f"chart {home.rpartition('.')[2]}"
    return Study(home, help, options, command, library, "results", saves, tells=tells)


@cache
def studies() -> tuple[Study, ...]:
    """All studies that a folder beside this file declares, by name."""
    folders = (x.name for x in iter_modules([str(Path(__file__).parent)]) if x.ispkg)
    found = (study for name in folders for study in import_module(f"{_PACKAGE}.{name}").STUDIES)
    return tuple(sorted(found, key=lambda study: study.name))
