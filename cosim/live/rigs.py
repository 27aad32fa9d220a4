"""The page's data: the built-in rigs, the keys that can be changed, and the firmware's knobs."""

import json
from pathlib import Path
from typing import Any

from cosim.circuit.heat import rise
from cosim.files.link import LONGEST
from cosim.mechanics.stickslip import parameters
from cosim.scene import KEYS, Key, Scene, firmware, list_scenes, load
from cosim.scene.tables import COMMANDS, KNOBS

_MACHINE = Path(__file__).with_name("web") / "machine.json"
MODEL = "limited"
"""The circuit of the page: the one that is inside the FMU."""

_OTHERS = {
    "drive": {"waveform", "table", "duty", "reset_time", "start_phase", *KNOBS, *KNOBS.values()},
    "circuit": {"model", "supply", "swing_loss_high", "swing_loss_low"},
    "coil": {"polarity"},
}
"""Keys that the page changes besides those that are variables of the FMU."""

TURNED = {
    full: key
    for full, key in KEYS.items()
    if (key.variable and key.name != "tolerance") or key.name in _OTHERS.get(key.table, ())
}
"""The keys that the page changes, by their full names."""

_CHOICES = {"drive.waveform": COMMANDS, "circuit.model": (MODEL,)}


def scenes() -> dict[str, Scene]:
    """The built-in scenes that the page can run, as they are."""
    found = ((name, load(name)) for name, _ in list_scenes())
    return {name: scene for name, scene in found if fits(scene)}


def fits(scene: Scene) -> bool:
    """Whether the page can run a scene: a free ram, driven, and a drive whose shape it has."""
    drive = scene.drive
    odd = drive.quantised or drive.start_time or drive.pwm_ripple or drive.phase_deg is not None
    driven = scene.rung.on_ladder and drive.waveform in COMMANDS and not scene.files
    return driven and not odd and scene.mechanics.free_ram


def _scene(scene: Scene) -> dict[str, Any]:
    """A scene for the page: the keys that differ from their defaults, and what follows from it."""
    own = {full: getattr(getattr(scene, key.table), key.name) for full, key in TURNED.items()}
    for knob, key in KNOBS.items():
        if own[f"drive.{knob}"] is not None:
            own[f"drive.{key}"] = None
    values = {full: v for full, v in own.items() if v not in (None, TURNED[full].default)}
    values.pop("circuit.model", None)
    _, integers = parameters(load(scene, {"circuit.model": MODEL}))
    variables = {key.variable for key in TURNED.values()}
    return {
        "text": scene.description,
        "model": scene.circuit.model,
        "values": values,
        "integers": {name: value for name, value in integers.items() if name not in variables},
        "rise": rise(scene.coil),
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
    """The value of each 10-bit code of the three knobs: peak-to-peak voltage (V), frequency (Hz),
    and V1 at the end of the ramp (V), which the offset pin sets."""
    pots = [code / firmware.COUNTS for code in range(firmware.COUNTS)]
    return {
        "amplitude": [firmware.knob_amplitude(pot) for pot in pots],
        "frequency": [firmware.knob_frequency(pot) for pot in pots],
        "pin": [firmware.knob_offset(pot, 0.0) for pot in pots],
    }


def data() -> dict[str, Any]:
    """All the page's data, as JSON can hold it."""
    return {
        "scenes": {name: _scene(scene) for name, scene in scenes().items()},
        "keys": {full: _key(key) for full, key in TURNED.items()},
        "knobs": knobs(),
        "references": json.loads(_MACHINE.read_text(encoding="utf-8"))["references"],
        "longest": LONGEST,
    }
