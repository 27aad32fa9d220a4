"""The changes of the device that are studied, one at a time, and the knobs that are searched."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import inf
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.circuit.heat import DRIVE_RANGE_HEAT
from cosim.drive.command import shape
from cosim.scene import Scene, changed, firmware
from cosim.scene.model import averaged, periods_for
from cosim.scene.tables import KNOBS

Settings = dict[str, Any]
"""Values of keys, ``table.key``, SI."""

RANGE = firmware.GAIN * firmware.volts(firmware.COUNTS - 1)
"""V: the highest voltage of V1 that either of the two volt knobs sets."""

STEPS = firmware.COUNTS - 1
"""Steps in which the firmware reads a knob's whole turn; nothing between them can be set."""

FREE: Settings = {f"drive.{knob}": None for knob in KNOBS}
"""Removes the knobs from a scene, so that amplitude, frequency and offset can be set directly."""

SMOOTH: Settings = {"drive.pwm_ripple": False, "drive.quantised": False, "run.solver": "fmu"}
"""What holds on every machine unless it says otherwise: the smooth command, judged by the FMU."""


@dataclass(frozen=True)
class Machine:
    """The device with something changed: its settings, and the ranges in which its knobs, and the
    levels of a command of its own, are searched."""

    settings: Settings = field(default_factory=dict[str, Any])
    reach: float = 1.0
    """Factor on the knobs' range in volts."""
    pace: float = 1.0
    """Factor on the knob's range in hertz."""
    heat: float = DRIVE_RANGE_HEAT
    """W: the most that the coil may dissipate on average."""
    levels: int = 0
    """Number of levels, evenly spread in phase, of a command of its own, to be searched, too."""
    rung: str = "limited"
    """The cheapest circuit in which the change has an effect."""

    @property
    def keys(self) -> int:
        """Dimensions of the unit cube whose points are settings: three knobs, then the levels."""
        return len(KNOBS) + self.levels

    def at(self, point: Array, settle: float, span: float) -> Settings:
        """The settings at a point of the cube, as the firmware maps its potentiometers: amplitude,
        frequency, and the voltage at which the sawtooth's ramp ends, so the mean moves with the
        amplitude. Whole periods are run: at least ``settle``, then about ``span`` (s)."""
        amplitude, top = self.reach * RANGE * point[0], self.reach * RANGE * point[2]
        hertz = _typed(self.pace * firmware.knob_frequency(point[1] * STEPS / firmware.COUNTS))
        found: Settings = {
            "circuit.model": self.rung,
            "drive.amplitude": _typed(amplitude),
            "drive.frequency": hertz,
            "drive.offset": _typed(top - amplitude / 2.0),
            **self.settings,
        }
        if self.levels:
            levels = (_typed(level - 0.5) for level in point[len(KNOBS) :])
            found["drive.table"] = [[k / self.levels, level] for k, level in enumerate(levels)]
        period = firmware.period(hertz, None) if found.get("drive.quantised") else 1.0 / hertz
        before, after = periods_for(period, settle, span)
        settle, span = before * period, averaged(after) * period
        return found | {"run.settle": settle, "run.duration": settle + span}

    def sampled(self, scene: Scene, levels: int) -> Array:
        """The command's shape at ``levels`` even phases, as further coordinates of a point of the
        cube, so that a search over levels can start from it. The shape is read half-way between
        two phases, since it may jump at a phase."""
        unit: Settings = {"drive.frequency": 1.0, "drive.amplitude": 1.0, "drive.offset": 0.0}
        command = shape(changed(scene, unit | self.settings, "a shape"))
        return command.values((np.arange(levels) + 0.5) / levels) + 0.5


def _typed(value: float) -> float:
    return round(float(value), 6)


@dataclass(frozen=True)
class Change:
    """One thing that can be changed."""

    name: str
    group: str
    """What it changes: ``waveform``, ``heat``, ``grip``, ``circuit``, ``coil`` (and magnet)."""
    machine: Callable[[Scene], Machine]
    searched: bool = True
    """Whether the knobs are searched for this change. If not, the change is only tried at the
    robust settings of the unchanged device, since its runs need ngspice or hardly move these."""

    def acts(self, scene: Scene) -> bool:
        """Whether it changes anything of a scene's device."""
        machine = self.machine(scene)
        other = {key: x for key, x in machine.settings.items() if x != scene.value(key)}
        return replace(machine, settings=other) != Machine()


def _set(*keys: str, value: float | str | bool, **more: Any) -> Callable[[Scene], Machine]:
    return lambda scene: Machine(dict.fromkeys(keys, value), **more)


def _times(factor: float, *keys: str, **more: Any) -> Callable[[Scene], Machine]:
    """The values of keys, where the scene has them, times a factor."""

    def machine(scene: Scene) -> Machine:
        known = {key: scene.value(key) for key in keys}
        scaled = {key: factor * value for key, value in known.items() if value is not None}
        return Machine(scaled, **more)

    return machine


def _rewound(factor: float, scene: Scene) -> Machine:
    """A coil of ``factor`` times the turns in the same volume: the same heat gives the same force,
    as Bl grows with the turns, resistance and inductance with their square."""
    found: Settings = {"coil.force_factor": factor * scene.coil.force_factor}
    for name in ("resistance", "inductance", "eddy_resistance", "eddy_inductance"):
        if (value := getattr(scene.coil, name)) is not None:
            found[f"coil.{name}"] = factor**2 * value
    return Machine(found)


def _sense(value: float, scene: Scene) -> Machine:
    """Another sense resistor, with the knobs' range scaled to the same range of currents."""
    key = "circuit.sense_resistance"
    return Machine({key: value}, reach=value / scene.circuit.sense_resistance)


AS_IT_IS = Change("as it is", "", lambda scene: Machine())

_SWING = ("circuit.swing_loss_high", "circuit.swing_loss_low")
_LIMITS = ("circuit.gain_bandwidth", "circuit.slew_rate")

CHANGES: Sequence[Change] = (
    AS_IT_IS,
    Change("falling sawtooth", "waveform", _set("drive.waveform", value="falling-sawtooth")),
    Change(
        "coil's wires exchanged", "waveform",
        lambda scene: Machine({"coil.polarity": -scene.coil.polarity}),
    ),
    Change("sine", "waveform", _set("drive.waveform", value="sine")),
    Change("square wave", "waveform", _set("drive.waveform", value="square")),
    *(
        Change(f"six levels, {how}", "waveform", _set("drive.waveform", value=name, levels=6))
        for how, name in (("joined by lines", "pieces"), ("held", "steps"))
    ),
    Change("heat 0.9 W", "heat", lambda _: Machine(heat=0.9)),
    Change("heat 1.8 W", "heat", lambda _: Machine(heat=1.8)),
    Change("heat 7 W", "heat", lambda _: Machine(heat=7.0)),
    Change("half the grip force", "grip", _times(0.5, "friction.normal_force")),
    Change("twice the grip force", "grip", _times(2.0, "friction.normal_force")),
    *(
        Change(f"supply ±{volts} V", "circuit", _set("circuit.supply", value=float(volts)))
        for volts in (10, 14, 24, 30)
    ),
    Change("output swings to its rails", "circuit", _set(*_SWING, value=0.0)),
    *(
        Change(f"coil of {words} the {name}", "coil", _times(factor, f"coil.{name}"))
        for name in ("resistance", "inductance")
        for words, factor in (("half", 0.5), ("twice", 2.0))
    ),
    Change("magnet of 0.7 times the field", "coil", _times(0.7, "coil.force_factor")),
    Change("magnet of 1.4 times the field", "coil", _times(1.4, "coil.force_factor")),
    Change("coil of 1.4 times the turns", "coil", partial(_rewound, 1.4)),
    Change("sense resistor 2 Ω", "circuit", partial(_sense, 2.0)),
    Change("sense resistor 8 Ω", "circuit", partial(_sense, 8.0)),
    Change("current limit 0.8 A", "circuit", _set("circuit.current_limit", value=0.8)),
    Change("current limit 5 A", "circuit", _set("circuit.current_limit", value=5.0)),
    Change("knobs up to half their volts", "circuit", lambda _: Machine(reach=0.5)),
    Change("knobs up to twice their volts", "circuit", lambda _: Machine(reach=2.0)),
    Change("knob up to twice its hertz", "circuit", lambda _: Machine(pace=2.0)),
    Change(
        "op-amp of a tenth the gain-bandwidth", "circuit",
        _times(0.1, _LIMITS[0], rung="amplifier"), searched=False,
    ),
    Change(
        "op-amp of a hundredth the slew rate", "circuit",
        _times(0.01, _LIMITS[1], rung="amplifier"), searched=False,
    ),
    Change("DAC steps", "circuit", _set("drive.quantised", value=True), searched=False),
    Change("ideal current", "circuit", lambda _: Machine(rung="ideal")),
    Change("ideal current, any heat", "heat", lambda _: Machine(rung="ideal", heat=inf)),
)  # fmt: skip
"""The device as it is comes first."""
