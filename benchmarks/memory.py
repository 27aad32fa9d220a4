"""Peak memory of whole runs, of short and of long ones, with all their files."""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from cosim.studies.speed.bench import spread

_RUN = """
import sys
from pathlib import Path
from cosim.cli.main import main
from cosim.toolchain.processes import in_place
with in_place():
    code = main()
lines = Path("/proc/self/status").read_text().splitlines()
print(next(line.split()[1] for line in lines if line.startswith("VmHWM")), file=sys.stderr)
sys.exit(code)
"""


def growth(rounds: int, periods: tuple[int, int]) -> dict[str, Any] | None:
    """Peak memory of ``cosim run reference`` of the second number of periods over that of the
    first; None where the system does not tell. ``mebibytes`` are those of the last round.
    """
    if not Path("/proc/self/status").exists():
        return None
    sizes = [[peak(f"run.duration={n / 20}") for n in periods] for _ in range(rounds)]
    growths = spread([long / short for short, long in sizes])
    return {**growths, "periods": list(periods), "mebibytes": sizes[-1]}


def peak(*overrides: str) -> float:
    """Most memory (MiB) that a process had in RAM that ran `reference`, mapped files included."""
    settings = [word for override in overrides for word in ("--set", override)]
    with TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", _RUN, "run", "reference", *settings, "--out", folder],
            capture_output=True,
            text=True,
            check=True,
        )
    return float(done.stderr.split()[-1]) / 1024
