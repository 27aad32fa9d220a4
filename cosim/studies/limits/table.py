"""The limits of a circuit: what each is turned to, and how a scene is changed for it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

from cosim.circuit.heat import DRIVE_RANGE_HEAT
from cosim.scene import Scene
from cosim.simulation.summary import budget
from cosim.studies.limits.aims import RANGE

Settings = dict[str, float | int | str]
"""Values of keys, ``table.key``, SI."""


@dataclass(frozen=True)
class Machine:
    """A circuit and coil to search the knobs of, as changes of a scene."""

    settings: Settings = field(default_factory=dict[str, float | int | str])
    reach: float = 1.0
    """Times the knobs' own range in volts."""
    heat: float = DRIVE_RANGE_HEAT
    """W: what the coil bears."""
    coil_scale: float = 1.0
    """Times its true heat and true current, of a coil that was scaled, that of the run."""


@dataclass(frozen=True)
class Limit:
    """A limit with its values, SI, the scene's own aside; ``gone`` is the value that lifts it.

    ``rung`` is the cheapest circuit in which it acts.
    """

    name: str
    unit: str
    scale: float
    """From SI to ``unit``, that of tables and figures."""
    own: Callable[[Scene], float]
    values: tuple[float, ...]
    gone: float
    machine: Callable[[Scene, float], Machine]
    rung: str = "limited"
    searched: bool = True
    """Whether a run is cheap enough for a search at each value; else only what is best elsewhere
    is climbed on from: on the cheapest circuit, or, where a value costs, on the amplifier."""
    more_is_better: bool = True
    """Whether lifting it means more of it."""
    real: bool = True
    """Whether its values can be had by changing a component of the device."""

    def at_work(self, scene: Scene) -> float:
        """The scene's own value; where that lifts the limit, the device's, which comes first."""
        own = self.own(scene)
        return self.values[0] if own == self.gone and self.values else own


def _value(scene: Scene, key: str) -> float | None:
    table, name = key.split(".")
    value: float | None = scene.table(table).get(name)
    return value


def _key(*keys: str) -> Callable[[Scene, float], Machine]:
    return lambda scene, value: Machine(dict.fromkeys(keys, value))


def _times(scene: Scene, factor: float, *keys: str) -> Settings:
    known = ((key, _value(scene, key)) for key in keys)
    return {key: value * factor for key, value in known if value is not None}


def _own(key: str) -> Callable[[Scene], float]:
    return lambda scene: float(_value(scene, key) or 0.0)


def _range(scene: Scene) -> float:
    return RANGE / scene.circuit.sense_resistance


def _sense(scene: Scene, value: float) -> Machine:
    """The same range of currents over another resistor."""
    factor = value / scene.circuit.sense_resistance
    return Machine({"circuit.sense_resistance": value}, reach=factor)


def _inductance(scene: Scene, value: float) -> Machine:
    factor = value / scene.coil.inductance
    return Machine(_times(scene, factor, "coil.inductance", "coil.eddy_inductance"))


def _back_emf(scene: Scene, value: float) -> Machine:
    """Another back-EMF, and nothing else.

    A coil of s times less force factor that takes s times the current exerts the same force. With
    resistances and inductances s times smaller it takes the same voltage for the same motion, but
    for the back-EMF, which is s times smaller. Its heat, i² R, and its current are s times those of
    the coil that it stands for.
    """
    smaller = _times(
        scene, value,
        "coil.force_factor", "circuit.sense_resistance", "coil.resistance", "coil.inductance",
        "coil.eddy_resistance", "coil.eddy_inductance", "circuit.output_resistance",
    )  # fmt: skip
    smaller |= _times(scene, 1.0 / value, "circuit.current_limit")
    return Machine(smaller, coil_scale=value)


LIMITS = (
    Limit(
        "supply voltage", "V", 1.0, _own("circuit.supply"), (10.0, 14.0, 24.0, 30.0), 180.0,
        _key("circuit.supply"),
    ),
    Limit(
        "output's swing loss", "V", 1.0, _own("circuit.swing_loss_high"), (8.0, 2.0), 0.0,
        _key("circuit.swing_loss_high", "circuit.swing_loss_low"), more_is_better=False,
    ),
    Limit(
        "knobs' range", "A", 1.0, _range, (0.66, 1.3, 5.3), 10.5,
        lambda scene, value: Machine(reach=value / _range(scene)),
    ),
    Limit(
        "coil inductance", "mH", 1e3, _own("coil.inductance"), (4.8e-3, 2.4e-3, 0.6e-3), 2.4e-5,
        _inductance, more_is_better=False,
    ),
    Limit(
        "coil resistance", "Ohm", 1.0, _own("coil.resistance"), (14.2, 3.55), 0.071,
        _key("coil.resistance"), more_is_better=False,
    ),
    Limit(
        "sense resistor", "Ohm", 1.0, _own("circuit.sense_resistance"), (8.0, 2.0), 0.1,
        _sense, more_is_better=False,
    ),
    Limit(
        "current limit", "A", 1.0, _own("circuit.current_limit"), (0.4, 0.8), 250.0,
        _key("circuit.current_limit"),
    ),
    Limit(
        "back-EMF", "times", 1.0, lambda _: 1.0, (2.0, 0.5), 0.02,
        _back_emf, more_is_better=False, real=False,
    ),
    Limit(
        "coil heat", "W", 1.0, lambda _: DRIVE_RANGE_HEAT, (0.9, 1.8, 7.0), inf,
        lambda _, value: Machine(heat=value), real=False,
    ),
    Limit(
        "gain-bandwidth", "kHz", 1e-3, _own("circuit.gain_bandwidth"), (1e5, 3e5), 1e7,
        _key("circuit.gain_bandwidth"), rung="amplifier", searched=False,
    ),
    Limit(
        "slew rate", "V/µs", 1e-6, _own("circuit.slew_rate"), (1e5, 1e6), 1e9,
        _key("circuit.slew_rate"), rung="amplifier", searched=False,
    ),
    Limit(
        "DAC steps", "µs", 1e6, lambda _: 0.0, (5e-5,), 0.0,
        lambda _, value: Machine({"drive.quantised": value > 0.0}),
        searched=False, more_is_better=False,
    ),
)  # fmt: skip


def slip_falls(scene: Scene) -> dict[str, float]:
    """The surface's downward accelerations, m/s² at an instant, from which on a part that goes up
    or down slips."""
    return {f"going {way}": -fall for way, (fall, _) in budget(scene).items()}
