"""Instructions that the FMU executes, counted by callgrind: a measure of cost without noise.

The mechanics of the scene `reference` get a current proportional to its command, in fixed steps
about as long as ngspice's; ``replay.c`` calls them.
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import fmpy
import numpy as np

import build_c
from cosim.drive.command import command
from cosim.mechanics.fmi import references
from cosim.mechanics.package import MODEL, token, unpacked
from cosim.mechanics.stickslip import parameters
from cosim.scene import load

PERIODS, STEPS_PER_PERIOD = 4, 1600


def per_period() -> int | None:
    """Instructions of the FMU per period of the scene `reference`; None without valgrind."""
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        return None
    library = unpacked(3) / "binaries" / fmpy.platform_tuple / (MODEL + fmpy.sharedLibraryExtension)
    with tempfile.TemporaryDirectory() as folder:
        points, program = Path(folder) / "points", Path(folder) / "replay"
        _write(points)
        build_c.link([Path(__file__).with_name("replay.c")], program, "-ldl")
        done = subprocess.run(
            [
                *(valgrind, "--tool=callgrind", "--callgrind-out-file=/dev/null"),
                *("--collect-atstart=no", "--toggle-collect=replay"),
                *(str(program), str(library), token(), str(points)),
            ],
            capture_output=True,
            text=True,
            check=False,
        )
    found = re.search(r"Collected : (\d+)", done.stderr)
    if done.returncode or not found or int(found[1]) == 0:
        return None
    return round(int(found[1]) / PERIODS)


def _write(path: Path) -> None:
    """Write the file of communication points whose layout ``replay.c`` describes."""
    scene = load("reference")
    drive, known = command(scene), references(3)
    reals, integers = parameters(scene)
    h = 1 / (scene.drive.frequency * STEPS_PER_PERIOD)
    starts = h * np.arange(PERIODS * STEPS_PER_PERIOD)
    current = drive.values(starts) / scene.circuit.sense_resistance
    slope = np.full(len(starts), (drive.value(2 * h) - drive.value(h)) / h)  # the sawtooth's ramp
    slope /= scene.circuit.sense_resistance
    names = (*reals, *integers, "current", "current_slope", "back_emf", "back_emf_slope")
    head = [len(reals), len(integers), len(starts), *(known[name] for name in names)]
    body = [*reals.values(), *integers.values()]
    steps = np.column_stack([np.full(len(starts), h), current, slope])
    path.write_bytes(
        np.array(head, np.int64).tobytes() + np.array(body, float).tobytes() + steps.tobytes()
    )
