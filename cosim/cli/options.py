"""What several commands share: options, the folder to write into, and the progress bar."""

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from cosim.errors import BadInput, plain
from cosim.files.atomic import alone

if TYPE_CHECKING:
    from tqdm import tqdm

    from cosim.scene import Scene


def add_scene(parser: ArgumentParser) -> None:
    """SCENE and ``--set``."""
    parser.add_argument("scene", metavar="SCENE", help="a built-in scene or a TOML file")
    add_overrides(parser)


def scene_of(arguments: Namespace) -> "Scene":
    """The scene that the options of :func:`add_scene` name."""
    from cosim.scene import load

    return load(arguments.scene, arguments.overrides)


def add_scenes(parser: ArgumentParser) -> None:
    """Any number of SCENEs, and ``--set``."""
    parser.add_argument(
        "scenes",
        metavar="SCENE",
        nargs="*",
        default=["paper"],
        help="built-in scenes or TOML files (default: paper)",
    )
    add_overrides(parser)


def add_overrides(parser: ArgumentParser) -> None:
    """``--set``."""
    parser.add_argument(
        "--set",
        dest="overrides",
        metavar="TABLE.KEY=VALUE",
        action="append",
        default=[],
        help="replace a value of the scene; repeatable",
    )


def add_workers(parser: ArgumentParser) -> None:
    """``--workers`` and ``--dask``."""
    parser.add_argument(
        "--workers", type=int, metavar="N", help="runs at once (default: one for each processor)"
    )
    parser.add_argument("--dask", metavar="ADDRESS", help="run on the Dask cluster at this address")


def add_quick(parser: ArgumentParser, text: str) -> None:
    """``--quick``."""
    parser.add_argument("--quick", action="store_true", help=text)


def add_out(parser: ArgumentParser, default: str, known: bool = True) -> None:
    """``--out``; None by default where the default is not ``known`` before the scene is."""
    parser.add_argument(
        "--out",
        type=Path,
        default=Path(default) if known else None,
        metavar="DIR",
        help=f"where to write (default: {default})",
    )


@contextmanager
def writable(folder: Path, shared: bool = False) -> Iterator[None]:
    """Refuse a folder that cannot be written to before a long run, not after it, and one into which
    another command writes, unless what is written there has names of its own (``shared``).

    Folders that were made for a run that then fails go again, unless something is in them.
    """
    made: list[Path] = []
    try:
        try:
            made = [path for path in (folder, *folder.parents) if not path.exists()]
            folder.mkdir(parents=True, exist_ok=True)
            with TemporaryFile(dir=folder):
                pass
        except FileExistsError as error:
            raise BadInput(f"{plain(str(folder))}: this is a file, not a directory.") from error
        except OSError as error:
            reason = error.strerror
            raise BadInput(f"{plain(str(folder))}: cannot be written to ({reason}).") from error
        with nullcontext() if shared else alone(folder):
            yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


def progress_bar(name: str, total: float | None, unit: str, **more: Any) -> "tqdm[Any]":
    """A progress bar on stderr, where that is a terminal; gone at its end."""
    from tqdm import tqdm

    return tqdm(
        total=total, desc=name, unit=unit, leave=False, file=sys.stderr, disable=None, **more
    )
