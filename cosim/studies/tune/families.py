"""Waveforms as families: what makes a scene one of them, and the numbers of its shape."""

from collections.abc import Mapping
from typing import Any

from cosim.circuit.heat import DRIVE_RANGE_HEAT, LIFT, heat_limit
from cosim.errors import BadInput, plain
from cosim.scene import Scene
from cosim.scene.tables import COMMANDS, MOST_CORNERS

Ranges = Mapping[str, tuple[float, float]]

TABLES = ("steps", "pieces")


def family(name: str) -> tuple[dict[str, Any], Ranges]:
    """Values of keys that give a scene the waveform ``name``, and the ranges of its shape's
    numbers: of "steps:N" and "pieces:N" N levels at even phases, of "square" its duty. BadInput."""
    shape, _, count = name.partition(":")
    sharp = {"drive.waveform": shape, "drive.reset_time": 0.0, "drive.duty": 0.5}
    few = count.isdecimal() and len(count) < 4
    if shape in TABLES and few and 2 <= int(count) <= MOST_CORNERS:
        phases = [k / int(count) for k in range(int(count))]
        levels = {f"drive.table.{k + 1}": (-0.5, 0.5) for k in range(len(phases))}
        return sharp | {"drive.table": [[phase, 0.5 - phase] for phase in phases]}, levels
    if name not in COMMANDS or name in TABLES:
        alone = ", ".join(one for one in COMMANDS if one not in TABLES)
        raise BadInput(
            f"--waveform {plain(name)}: must be one of {alone}, steps:N and pieces:N with N from "
            f"2 to {MOST_CORNERS}."
        )
    return sharp | {"drive.table": None}, {"drive.duty": (0.02, 0.98)} if name == "square" else {}


def most_heat(scene: Scene, limit: float | str | None) -> float:
    """W of a coil, of a limit in W or as "RISE:DUTY" or "RISE:DUTY:SECONDS" (K, 1, s); of None that
    of the Carlton's range of drives, in a scene with such an actuator. Raises BadInput."""
    if limit is None:
        return DRIVE_RANGE_HEAT if scene.mechanics.free_ram else float("inf")
    try:
        watts, *cycle = (float(part) for part in str(limit).split(":"))
        found = heat_limit(scene.coil, watts, *cycle) if cycle else watts
    except BadInput as error:
        raise BadInput(f"--heat {plain(limit)}: {error}") from None
    except (ValueError, TypeError):
        found = float("nan")
    if not found > 0.0:
        raise BadInput(
            f"--heat {plain(limit)}: must be a number above 0 W, or RISE:DUTY or "
            f"RISE:DUTY:SECONDS with a rise in K (without a time: {LIFT:g} s)."
        )
    return found
