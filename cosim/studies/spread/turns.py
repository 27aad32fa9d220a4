"""What a small turn of each knob is."""

from cosim.errors import BadInput
from cosim.scene import Scene, keys
from cosim.scene.tables import KNOBS

TURN = 0.01
"""Of a knob's whole turn, or of the value that a scene gives instead of it."""

Settings = dict[str, float]
"""Values of keys, ``table.key``, SI."""


def turns(scene: Scene) -> list[Settings]:
    """The settings with one knob turned a little either way, not beyond the end of its range.

    A knob that the scene gives as ``pot_…`` is turned by a hundredth of its whole turn; amplitude,
    frequency and offset by a hundredth of themselves, an offset of 0 by one of the amplitude.
    Raises BadInput for a scene whose knobs move nothing.
    """
    if not scene.rung.driven:
        raise BadInput(
            f'scene {scene.name}: circuit.model = "{scene.circuit.model}" has no knobs that '
            "--spread could turn."
        )
    ranges = {key.full: (key.low, key.high) for key in keys()}
    found = []
    for knob, name in KNOBS.items():
        given = getattr(scene.drive, knob) is not None
        full = f"drive.{knob if given else name}"
        value = getattr(scene.drive, knob if given else name)
        size = TURN if given else TURN * abs(value)
        if name == "offset" and not size:
            size = TURN * scene.drive.amplitude
        low, high = ranges[full]
        assert low is not None and high is not None
        for place in (value - size, value + size):
            if size and low <= place <= high:
                found.append({full: float(f"{place:.12g}")})  # a number that can be typed
    return found
