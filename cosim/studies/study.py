"""What a study is: declared once, it is a command, a function of the library, and their reference.

The ``__init__.py`` of a study's folder declares it in ``STUDIES``, and imports nothing that takes
time: ``cosim --help`` and ``import cosim`` read all of them. So functions are named, as
``module.function`` below this package, and loaded when they are needed.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from numbers import Integral
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, Literal

from cosim.errors import BadInput, plain

_PACKAGE = __name__.rpartition(".")[0]


def loaded(name: str) -> Callable[..., Any]:
    """The function of that name, ``module.function`` below this package."""
    module, _, function = name.rpartition(".")
    return getattr(import_module(f"{_PACKAGE}.{module}"), function)


@dataclass(frozen=True)
class Option:
    """An option of a command; what is given becomes an argument of the function behind it."""

    name: str
    """As it is typed, ``--seed``; of an argument that stands by its place, the parameter's."""
    help: str
    metavar: str | None = None
    """What stands for its value; a unit where it has one."""
    kind: Callable[[str], Any] = str
    """Makes the value of what is typed; ``bool`` of its name alone, False for ``--no-…``."""
    default: Any = None
    """The function's own where nothing is given, as the help says it; None: said in ``help``."""
    parameter: str = ""
    """The function's, where it has another name."""
    many: Literal["", "repeat", "optional", "any"] = ""
    """A list, by repeating the option, or of any number of words; or one word that may be left
    out."""
    choices: tuple[str, ...] = ()
    needed: bool = False
    read: str = ""
    """Names what makes the argument of the value, a list where ``many``; it raises BadInput."""
    prints: str = ""
    """Names what makes a text: the option prints that, and nothing else is done."""

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
    """Refuse what NumPy makes no generator of."""
    if not (isinstance(seed, Integral) and seed >= 0):
        raise BadInput(f"--seed {plain(seed)}: must be a whole number from 0.")


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
"""Makes of what a function tells as it goes on: steps done (None: one more), of how many (None: as
before), and words on the last one."""


@dataclass(frozen=True)
class Study:
    """A study as the user asks for it.

    Its function takes what the options give, ``out`` where it ``saves``, and what it ``tells``; it
    returns a result that has ``save``, or a report or several of them.
    """

    home: str
    """Names its function, whose own name is that in the library."""
    help: str = ""
    options: tuple[Option, ...] = ()
    command: str = ""
    """The words after ``cosim``; empty for a study of the library alone."""
    library: bool = True
    """Whether it is one of the library's functions."""
    out: str = ""
    """Where the command writes unless told otherwise; ``<scene>`` stands for the scene's name."""
    saves: bool = True
    """The function writes into ``out`` as it goes on; else what it returns is saved."""
    writes: str = ""
    """The files besides figures, in words; empty for reports, which tell their own."""
    figures: tuple[str, ...] = ()
    unit: str = "step"
    """Of the progress bar."""
    total: str = ""
    """The option that says how many steps there are, where the function does not tell it."""
    tells: Mapping[str, Told] = field(default_factory=dict)
    """What it calls as it goes on, by parameter, and what that means."""
    told: str = ""
    """Names what makes the text to print of a result; its ``repr`` unless told otherwise."""
    check: str = ""
    """Names what raises SimulationFailed where a result, told and saved, is none."""

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
    """A study that gives reports, and tells steps done, of how many, and which was the last."""
    tells: dict[str, Told] = {"progress": lambda done, total, what="": (done, total, what)}
    command = f"chart {home.rpartition('.')[2]}"
    return Study(home, help, options, command, library, "results", saves, tells=tells)


@cache
def studies() -> tuple[Study, ...]:
    """All studies that a folder beside this file declares, by name."""
    folders = (one.name for one in iter_modules([str(Path(__file__).parent)]) if one.ispkg)
    found = (one for name in folders for one in import_module(f"{_PACKAGE}.{name}").STUDIES)
    return tuple(sorted(found, key=lambda study: study.name))
