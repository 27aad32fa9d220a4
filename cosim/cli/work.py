"""What commands share: the folder to write into, and the progress bar."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

from cosim.errors import BadInput, plain
from cosim.files.atomic import alone, tidy

if TYPE_CHECKING:
    from tqdm import tqdm


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
            raise BadInput(f"{plain(folder)}: this is a file, not a directory.") from error
        except OSError as error:
            reason = error.strerror
            raise BadInput(f"{plain(folder)}: cannot be written to ({reason}).") from error
        if shared:
            tidy(folder)
        with nullcontext() if shared else alone(folder):
            yield
    except BaseException:
        for path in made:
            with suppress(OSError):
                path.rmdir()
        raise


def print_page(results: Path, out: Path | None = None) -> None:
    """Write the page of ``cosim show``."""
    from cosim.live.show import show

    print(f"Page: {show(results, out)}")


def progress_bar(name: str, total: float | None, unit: str, **more: Any) -> "tqdm[Any]":
    """A progress bar on stderr, where that is a terminal; gone at its end."""
    from tqdm import tqdm

    return tqdm(
        total=total, desc=name, unit=unit, leave=False, file=sys.stderr, disable=None, **more
    )
