"""The numbers of a run: where each entry of ``summary.json`` is named and described."""

from typing import NamedTuple


class Quantity(NamedTuple):
    """What an entry of the summary is: its SI unit, ``""`` for words and lists, and its meaning."""

    unit: str
    text: str


SUMMARY: dict[str, Quantity] = {
    "run": Quantity("", "which run it is: the files of one run bear the same mark"),
    "v_average": Quantity("m/s", "mean velocity of the part after run.settle, up positive"),
    "v_average_error": Quantity(
        "m/s",
        "difference of v_average to a run with steps three times as long: twice it and a millionth "
        "of v_average hold the true error of regular motion; null where that is not known; with "
        "the fast solver that to half the step",
    ),
    "motion": Quantity(
        "",
        "regular, no transport, several answers (the start decides), chaotic, or unsettled (not "
        "periodic after 240 periods and 8 s), as on circuit limited; absent where nothing repeats "
        "or too few periods are run",
    ),
    "motion_periods": Quantity("1", "periods of the drive after which regular motion repeats"),
    "motion_settled": Quantity("s", "when the part's way in a period begins to repeat to 0.1 %"),
    "v_average_answers": Quantity("m/s", "each v_average that other starts come to, or this one"),
    "v_average_range": Quantity(
        "m/s", "least and greatest v_average of chaotic motion in stretches as long as the average"
    ),
    "v_average_other_starts": Quantity(
        "m/s", "with --error: v_average with the drive begun 1/4, 1/2 and 3/4 of a period later"
    ),
    "transport_per_cycle": Quantity("m", "v_average times the period of the drive"),
    "stick_fraction": Quantity("1", "share of the time in which the part sticks to the surface"),
    "stick_fraction_2": Quantity("1", "the same for the second of two surfaces"),
    "a_surface_max": Quantity(
        "m/s2", "largest acceleration of the surface; null with rigid walls or velocity jumps"
    ),
    "a_surface_min": Quantity("m/s2", "smallest acceleration of the surface; null likewise"),
    "a_camera_max": Quantity(
        "m/s2", "largest acceleration that a camera with 960 frames/s reads, as Tracker computes it"
    ),
    "a_camera_min": Quantity("m/s2", "smallest acceleration that such a camera reads"),
    "v_surface_max": Quantity("m/s", "largest velocity of the surface"),
    "v_surface_min": Quantity("m/s", "smallest velocity of the surface"),
    "z_surface_pp": Quantity("m", "height of the surface, peak-to-peak"),
    "current_max": Quantity("A", "largest current of one coil"),
    "current_min": Quantity("A", "smallest current of one coil"),
    "swing_high_fraction": Quantity("1", "share of the time at the output's upper voltage limit"),
    "swing_low_fraction": Quantity("1", "share of the time at the output's lower voltage limit"),
    "current_limit_fraction": Quantity("1", "share of the time at the amplifier's current limit"),
    "slew_fraction": Quantity("1", "share of the time at the amplifier's slew rate alone"),
    "saturated_fraction": Quantity("1", "share of the time at a voltage or current limit"),
    "impacts": Quantity("1", "number of impacts of the ram on a wall"),
    "stick_slip_events": Quantity("1", "number of changes between sticking and slipping"),
    "at_wall": Quantity("1", "1 where the ram touches a wall in the last row, else 0"),
    "rests": Quantity(
        "m", "places (ram in the actuator, q) at which the ram rests without current"
    ),
    "energy_in": Quantity("J", "energy that the amplifier's output delivers, over the whole run"),
    "energy_copper": Quantity("J", "heat in coils (copper, eddy currents) and sense resistor"),
    "energy_friction": Quantity("J", "heat of friction on the part"),
    "energy_impact": Quantity("J", "energy lost in the walls"),
    "energy_damping": Quantity("J", "energy lost in the damping of flexures and suspension"),
    "energy_stored": Quantity("J", "energy in motion, springs, height and coils; end less start"),
    "energy_residual": Quantity(
        "1", "what the account of energies misses, relative: a check of the run, no bound"
    ),
    "coil_heat": Quantity("W", "mean heat of one coil's winding, over the whole run"),
    "coil_rise_lift": Quantity(
        "K",
        "by that heat for 10 s, the winding's rise over the air: ends of an estimate, no rating",
    ),
    "coil_rise_continuous": Quantity("K", "the same of that heat for ever"),
    "slip_up": Quantity(
        "m/s2", "least and greatest acceleration of the surface with which a part going up sticks"
    ),
    "slip_down": Quantity("m/s2", "the same of a part going down"),
    "slip_by_surface": Quantity("", "which of these the surface's acceleration passed at instants"),
    "slip_by_camera": Quantity("", "which of these the camera's reading passed, a mean over 4 ms"),
    "circuit_steps": Quantity("1", "steps that ngspice accepted; 0 without it"),
    "steps_repeated": Quantity(
        "1", "steps of ngspice that were repeated until circuit and FMUs agreed; own FMUs alone"
    ),
    "circuit_rejected": Quantity("1", "steps that ngspice tried and rejected"),
    "fmu_steps": Quantity("1", "steps that the FMU was asked for"),
    "wall_time": Quantity("s", "time that the run took"),
    "method": Quantity("", "coupling method; on the rungs without ngspice how they are solved"),
    "versions": Quantity("", "versions of the programs that took part"),
    "circuit_model": Quantity("", 'rung that circuit.model = "auto" took'),
    "circuit_model_why": Quantity("", "why it took that rung"),
    "circuit_model_expected": Quantity("", "what was measured of that rung"),
    "circuit_model_errors": Quantity("", "estimated relative error of v_average on rungs tried"),
    "coupling_taken": Quantity("", 'method and steps that coupling.method = "auto" took'),
    "error_estimate": Quantity(
        "1", "with these, the error of the part's height, relative to its range"
    ),
    "spread": Quantity("", "what --spread found with each knob turned by 2 %"),
    "notes": Quantity("", "sentences on where the run leaves the model or a data sheet"),
}
"""Every entry by its name. Absent participants have none of theirs."""


def unit(name: str) -> str:
    """The SI unit of an entry of the summary; ``"1"`` for shares, counts and ratios."""
    return SUMMARY[name].unit


def meaning(name: str) -> dict[str, str]:
    """The attributes ``units`` and ``long_name`` of an entry in a dataset."""
    if name not in SUMMARY:  # of a scene with its own FMUs
        signal, _, what = name.rpartition(".")
        return {"units": "?", "long_name": f"{what} of {signal}"}
    found = SUMMARY[name]
    return {"units": found.unit, "long_name": found.text}


def with_unit(value: float, unit: str, digits: int = 6) -> str:
    """``number unit``; a plain number has no unit."""
    return f"{value:.{digits}g}" + ("" if unit == "1" else f" {unit}")


def label(name: str, unit: str) -> str:
    """``name [unit]`` for an axis."""
    return name if unit == "1" else f"{name} [{unit}]"


def bench_unit(quantity: str) -> tuple[str, float]:
    """The unit in which a number of the summary is shown, and how many of it are one in SI."""
    si = SUMMARY[quantity].unit
    return ("mm/s", 1e3) if si == "m/s" else (si, 1.0)
