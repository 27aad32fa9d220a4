"""Checks for enough memory before a command starts: libraries that lack it end the process."""

import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from cosim.errors import SimulationFailed

LEAST, USUAL = {"scenes": 0, "fmu": 120, "export": 180}, 240
"""MB of address space that commands were observed to need; they fill at least a third of it."""


def check(command: str, root: Path = Path("/")) -> None:
    """Raise SimulationFailed where a limit of this process is below the command's least need."""
    if sys.platform == "linux":
        import resource

        least = LEAST.get(command, USUAL)
        limits = [(resource.getrlimit(resource.RLIMIT_AS)[0], least, "ulimit -v")]
        for limit, needed, name in [*limits, *((n, least // 3, "cgroup") for n in _groups(root))]:
            if 0 <= limit < needed * 10**6:
                raise SimulationFailed(
                    f"This process may have {limit / 1e6:.3g} MB of memory ({name}); "
                    f"cosim {command} needs at least {needed} MB."
                )


def _groups(root: Path) -> Iterator[int]:
    """Memory limits, bytes, of the process's control groups and their parents, versions 1 and 2."""
    with suppress(OSError):
        for line in (root / "proc/self/cgroup").read_text().splitlines():
            _, kinds, path = line.split(":", 2)
            group = root / "sys/fs/cgroup" / kinds / path.lstrip("/")
            name = {"": "memory.max", "memory": "memory.limit_in_bytes"}.get(kinds, "")
            for folder in (group, *group.parents) if name else ():
                with suppress(OSError, ValueError):  # "max" is no number
                    yield int((folder / name).read_text())
