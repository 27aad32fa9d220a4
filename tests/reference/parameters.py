"""The parameters of the reference solution that stand for a scene."""

from typing import Any

from cosim.scene import Scene

_OF_THE_REFERENCE = {
    "drive": ("waveform", "frequency", "amplitude", "offset"),
    "circuit": (
        "supply",
        "sense_resistance",
        "gain_bandwidth",
        "open_loop_gain",
        "slew_rate",
        "swing_loss_high",
        "swing_loss_low",
    ),
    "coil": ("resistance", "inductance", "force_factor", "b1", "b2", "count"),
    "friction": ("mu_s", "mu_k", "normal_force", "mu_plate"),
}


def reference_parameters(scene: Scene) -> dict[str, Any]:
    """A scene's numbers by the names of the reference solution's parameters, SI."""
    flat = scene.mechanics.model_dump(exclude={"contact", "initial_lift", "tolerance"})
    for table, names in _OF_THE_REFERENCE.items():
        flat |= getattr(scene, table).model_dump(include=set(names))
    flat["force_factor"] *= scene.coil.polarity
    return flat
