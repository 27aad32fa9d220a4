"""Notes where a scene or its run leaves the range in which the model's physics is valid.

Only limits that are published or follow from the model's own laws are checked.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from cosim.arrays import Array
from cosim.circuit.heat import DRIVE_RANGE_HEAT
from cosim.files.spill import blocks
from cosim.mechanics.normal_force import NormalForce
from cosim.mechanics.stickslip import numbers_of, rests_of
from cosim.scene import Scene

LM348_SUPPLY = 18.0
"""V, both signs: absolute maximum of the LM348 (data sheet SNOSBT8)."""

OPA548_SUPPLY = (4.0, 30.0)
"""V, both signs: the range of supplies of the OPA548 (data sheet SBOS070D)."""

CARLTON_LENGTH = 34.3e-3
"""m: the Carlton lies lengthwise in the paper's finger (data sheet); the finger's own length is not
published."""

SHALLOW = 0.1
"""Share of the travel that a wall may give: Hertz's law, in Hunt and Crossley's, is for a contact
much smaller than the bodies."""


def remarks(
    scene: Scene,
    columns: Mapping[str, Array],
    summary: Mapping[str, Any],
    force: NormalForce | None = None,
) -> dict[str, Any]:
    """``notes``: a sentence for each limit that scene or run exceed: quantity, value, limit.
    ``rests``: the positions (q, m) at which a free ram rests without a current.

    ``columns`` are the run's waveforms, ``summary`` its numbers, SI, and ``force`` the normal force
    where it changes in time. Motion is judged by the rows of the waveforms.
    """
    found = [*_grip(scene, force), *_supply(scene)]
    if scene.rung.driven:
        found += _coil(scene, summary)
    if not scene.surface_is_given:
        for surface in ("", "_2"):
            if f"z_surface{surface}" in columns:
                found += _ram(scene, columns, surface)
        found += _part(scene, columns)
    told: dict[str, Any] = {"notes": found}
    if not scene.surface_is_given and scene.mechanics.free_ram:
        rests, travel = rests_of(numbers_of(scene)), scene.mechanics.travel
        if scene.mechanics.contact == "rigid":
            rests = [max(-travel, min(travel, q)) for q in rests]
        told["rests"] = rests
        found += _told_of(rests, travel)
    return told


def _told_of(found: list[float], travel: float) -> Iterator[str]:
    if len(found) < 2:
        return
    start = min(found, key=abs)
    places = [
        f"q = {round(q * 1e3, 9) + 0.0:.3g} mm"  # no rounding where the centre is meant
        + (", at the upper wall" if q >= travel else ", at the lower wall" if q <= -travel else "")
        + (", where the run starts" if q == start else "")
        for q in found
    ]
    yield (
        f"without a current the ram rests at {len(found)} places: {'; '.join(places)}. q is its "
        "way up from the middle between the walls. A pulse may leave it at another than it came "
        "from."
    )


def _grip(scene: Scene, force: NormalForce | None) -> Iterator[str]:
    friction, mechanics = scene.friction, scene.mechanics
    least, when = friction.normal_force, ""
    if force is not None:
        least, at = force.least(scene.run.duration)
        when = f" at {at:.4g} s"
    held = mechanics.n_surfaces * (friction.mu_s + friction.mu_plate) * least
    weight = mechanics.part_mass * mechanics.gravity
    if held < weight:
        mu = "(mu_s + mu_plate)" if friction.mu_plate else "mu_s"
        yield (
            f"the grip is too weak to hold the part at rest (condition (1) of the paper): friction "
            f"of at most n_surfaces {mu} normal_force = {held:.4g} N{when} is below the "
            f"part's weight of {weight:.4g} N."
        )


def _supply(scene: Scene) -> Iterator[str]:
    if not (scene.rung.has_limits and scene.rung.on_ladder):
        return
    supply, (low, high) = scene.circuit.supply, OPA548_SUPPLY
    if scene.rung.firmware and supply > LM348_SUPPLY:
        yield (
            f"circuit.supply = {supply:g} V is above the {LM348_SUPPLY:g} V that the LM348 bears "
            "at most (its data sheet)."
        )
    if not low <= supply <= high:
        yield (
            f"circuit.supply = {supply:g} V is outside the {low:g} to {high:g} V that the OPA548 "
            "is made for (its data sheet)."
        )


def _coil(scene: Scene, summary: Mapping[str, Any]) -> Iterator[str]:
    if not scene.mechanics.free_ram or scene.run.duration < scene.period:
        return
    if summary["coil_heat"] > DRIVE_RANGE_HEAT:
        yield (
            f"the heat of {summary['coil_heat']:.3g} W in a coil, on average over the run, is "
            f"above the {DRIVE_RANGE_HEAT:.3g} W that the Carlton actuator's 10 V peak-to-peak "
            "make at most (its data sheet)."
        )


def _ram(scene: Scene, columns: Mapping[str, Array], surface: str) -> Iterator[str]:
    mechanics, coil = scene.mechanics, scene.coil
    body = columns[f"z_surface{surface}"]
    # In direct drive the reaction body is fixed at the surface's position of rest.
    ram = columns.get(f"z_ram{surface}")
    low, high = _range(body, ram, body[0] - mechanics.initial_lift)
    moving = "surface" if ram is None else "second ram" if surface else "ram"
    deep = max(high, -low) - mechanics.travel
    if deep > SHALLOW * mechanics.travel:
        yield (
            f"the {moving} presses {deep * 1e3:.3g} mm into its wall, more than a tenth of "
            f"mechanics.travel = {mechanics.travel * 1e3:.4g} mm; the law of the contact is for "
            "small deformations."
        )
    if not scene.rung.driven:
        return
    places = [low, high]
    if coil.b2:  # the extremum of the parabola Bl(q), if it is reached
        places += [q for q in [-coil.b1 / (2.0 * coil.b2)] if low < q < high]
    shape, q = min((1.0 + coil.b1 * q + coil.b2 * q**2, q) for q in places)
    if shape <= 0.0:
        yield (
            f"the {moving} reaches q = {q * 1e3:.4g} mm, where Bl (1 + b1 q + b2 q^2) = "
            f"{coil.force_factor * shape:.3g} N/A has turned its sign: coil.b1 and coil.b2 do not "
            "hold so far out."
        )


def _part(scene: Scene, columns: Mapping[str, Array]) -> Iterator[str]:
    part, surface = columns["z_part"], columns["z_surface"]
    low, high = _range(surface, part, surface[0])
    far = max(high, low, key=abs)
    if abs(far) > CARLTON_LENGTH:
        yield (
            f"the part moves {far * 1e3:+.4g} mm along the surface, further than the actuator in "
            f"the paper's finger is long ({CARLTON_LENGTH * 1e3:.4g} mm): a real part may have "
            "left it, the model's surface has no end."
        )


def _range(below: Array, above: Array | None, still: float) -> tuple[float, float]:
    """Least and greatest of ``above - below``; ``still`` stands for ``above`` if that is None."""
    low, high = float("inf"), -float("inf")
    for part in blocks(len(below)):
        apart = (still if above is None else above[part]) - below[part]
        low, high = min(low, float(apart.min())), max(high, float(apart.max()))
    return low, high
