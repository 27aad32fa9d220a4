"""What the page knows: the built-in rigs, the keys that can be turned, and the firmware's knobs."""

from typing import Any

from cosim.errors import BadInput
from cosim.files.link import LONGEST
from cosim.mechanics.fmi import references
from cosim.mechanics.stickslip import parameters
from cosim.scene import Key, Scene, firmware, keys, list_scenes, load
from cosim.scene.tables import COMMANDS, KNOBS

MODEL = "limited"
"""The circuit of the page: the one that is inside the FMU."""

_DRIVE = {"waveform", "table", "duty", "reset_time", *KNOBS, *KNOBS.values()}
_OTHERS = {"coil.polarity", "circuit.model", "circuit.supply"} | {
    *("circuit.swing_loss_high", "circuit.swing_loss_low"),
}
_CHOICES = {"drive.waveform": COMMANDS, "circuit.model": (MODEL,)}


def turned() -> dict[str, Key]:
    """The keys that the page turns, by their full names."""
    return {
        key.full: key
        for key in keys()
        if (key.variable and key.name != "tolerance")
        or (key.table == "drive" and key.name in _DRIVE)
        or key.full in _OTHERS
    }


def scenes() -> dict[str, Scene]:
    """The built-in scenes that the page can run, as they are."""
    found = ((name, load(name)) for name, _ in list_scenes())
    return {name: scene for name, scene in found if fits(scene)}


def fits(scene: Scene) -> bool:
    """Whether the page can run a scene: a free ram that is driven, one coil circuit, and a drive of
    which it has the shape."""
    drive, given = scene.drive, (scene.friction.normal_force_file, scene.circuit.netlist)
    plain = not (drive.quantised or drive.start_time or drive.start_phase or drive.pwm_ripple)
    driven = scene.rung.on_ladder and drive.waveform in COMMANDS and drive.phase_deg is None
    if not (plain and driven and scene.mechanics.actuator == "ram" and not any(given)):
        return False
    try:
        load(scene, {"circuit.model": MODEL})
    except BadInput:
        return False
    return True


def _values(scene: Scene) -> dict[str, Any]:
    """Those of the keys that are not the default."""
    tables = scene.as_dict()
    given = {full: tables[key.table].get(key.name) for full, key in turned().items()}
    own = {full: value for full, value in given.items() if value is not None}
    return {full: value for full, value in own.items() if value != turned()[full].default}


def _scene(scene: Scene) -> dict[str, Any]:
    values = _values(scene)
    values.pop("circuit.model", None)
    _, integers = parameters(load(scene, {"circuit.model": MODEL}))
    fixed = {key.variable for key in turned().values()}
    return {
        "text": scene.description,
        "model": scene.circuit.model,
        "values": values,
        "integers": {name: n for name, n in integers.items() if name not in fixed},
    }


def _key(key: Key) -> dict[str, Any]:
    choices = _CHOICES.get(key.full, key.choices)
    default = MODEL if key.full == "circuit.model" else key.default
    found: dict[str, Any] = {"default": default, "variable": key.variable}
    if choices and not (key.variable and key.kind is int):
        return found | {"choices": choices}
    if key.kind is list:
        return found | {"table": True}
    return found | {"low": key.low, "high": key.high, "whole": key.kind is int}


def knobs() -> dict[str, list[float]]:
    """What each of the 10-bit codes of the three knobs stands for: peak-to-peak voltage (V),
    frequency (Hz), and V1 at the end of the ramp (V), which is the offset pin's."""
    pots = [code / firmware.COUNTS for code in range(firmware.COUNTS)]
    return {
        "amplitude": [firmware.knob_amplitude(pot) for pot in pots],
        "frequency": [firmware.knob_frequency(pot) for pot in pots],
        "pin": [firmware.knob_offset(pot, 0.0) for pot in pots],
    }


def data() -> dict[str, Any]:
    """All of it, as JSON can hold it."""
    return {
        "scenes": {name: _scene(scene) for name, scene in scenes().items()},
        "keys": {full: _key(key) for full, key in turned().items()},
        "knobs": knobs(),
        "references": references(3),
        "longest": LONGEST,
    }
