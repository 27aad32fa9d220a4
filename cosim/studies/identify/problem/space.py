"""The bounds of the search: a file in the form of ``bounds.toml``, read and checked.

A rig has three forms: for the search a point of the unit cube, with a coordinate for each free key;
for the stepper the numbers of ``RIG``; for a scene the values of its keys.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.mechanics.stickslip import SUSPENSIONS
from cosim.scene import changed, load, toml
from cosim.scene.describe import KEYS
from cosim.scene.messages import shown
from cosim.stepper.stepper import OWN, RIG
from cosim.studies.identify.problem.gauges import GAUGES

SHIPPED = Path(__file__).parent / "bounds.toml"

_ALIASES = {
    "mechanics.travel": ("travel_up", "travel_down"),
    "mechanics.contact_stiffness": ("wall_up", "wall_down"),
    "mechanics.contact_damping": ("wall_damping",),
}
"""The stepper's numbers of those keys whose names differ from theirs."""
SUSPENSION = "mechanics.suspension"
LAW_KEYS = {
    "cubic": ("k1", "k2", "k3"),
    "knee": ("k1", "knee", "hardening"),
    "repulsion": ("repulsion", "distance"),
}
"""The keys ``mechanics.suspension_…`` that each law of the suspension uses."""
OF_LAWS = {f"{SUSPENSION}_{name}" for names in LAW_KEYS.values() for name in names}
"""Keys of the suspension laws; their identified values are valid for one law only."""
UNSCALED = ("friction.", "mechanics.contact_damping", f"{SUSPENSION}_knee", f"{SUSPENSION}_dist")
"""Beginnings of the keys that are neither forces nor masses, so ``Space.scaled`` leaves them."""
LEAST_DISTANCE = 1.1
"""Least ``suspension_distance``, in travels of the ram."""
_SUPPLY = ("circuit.supply", "circuit.swing_loss_high", "circuit.swing_loss_low")
"""Keys from which ``output_high`` and ``output_low`` follow; they are given, not searched."""

OWN_KEYS = {
    "drive.amplitude": "amplitude",
    "drive.offset": "offset",
    "drive.start_phase": "phase",
    "drive.start_time": "start",
    "mechanics.initial_lift": "lift",
    "friction.normal_force": "normal_force",
    "drive.frequency": "frequency",
}
"""Keys of a trial, and the names of its own parameters. Phase and start time count from the
record's first row, the lift is a share of the lift that the plate's friction can hold, and the
bounds of the frequency are shares of the frequency of the record's motion."""

_NUMBERS = ("value", "low", "high", "prior", "sigma")
_PARTS = {"rig": {*_NUMBERS, "scale", "source"}, "trial": {"value", "low", "high", "source"}}
"""Allowed parts of an entry, by table: a trial's own numbers have neither prior nor scale."""
_OTHERWISE = {
    "drive.start_time": (-1e3, 1e3, "s"),
    "mechanics.initial_lift": (-1.0, 1.0, "1"),
    "drive.frequency": (0.1, 10.0, "1"),
}
"""Ranges and units of those OWN_KEYS that mean something else here than in a scene."""
MOST, LEAST_SD = 1e18, 1e-12
"""Limits of all numbers and standard deviations, so that squares of residuals stay finite."""


@dataclass(frozen=True)
class Entry:
    """One key of the file; where a value is given, ``low`` and ``high`` both are this value."""

    key: str
    low: float
    high: float
    log: bool
    prior: float | None
    sigma: float | None

    @property
    def free(self) -> bool:
        return self.low < self.high


def _names(key: str) -> tuple[str, ...]:
    """The names of the stepper's numbers that a key of the rig sets."""
    return _ALIASES.get(key, (key.partition(".")[2],))


@dataclass(eq=False)
class Space:
    """All rigs with one law of the suspension: their free keys, and the given ones."""

    entries: dict[str, Entry]
    """Of the rig, with the keys of all laws."""
    trial: dict[str, Entry]
    laws: list[str]
    """All laws of the suspension that are searched, in this order."""
    law: str
    measured: dict[str, tuple[float, float]]
    """Value and standard deviation, SI, by the names of GAUGES."""

    def __post_init__(self) -> None:
        own = {f"{SUSPENSION}_{name}" for name in LAW_KEYS[self.law]}
        self.rig = {k: entry for k, entry in self.entries.items() if k in own or k not in OF_LAWS}
        """The keys of this law, and those of all."""
        self.free = [entry for entry in self.rig.values() if entry.free]
        self.names = [entry.key for entry in self.free]
        """The free keys."""
        self.log = np.array([entry.log for entry in self.free], dtype=bool)
        ends = np.array([[entry.low, entry.high] for entry in self.free])
        self._ends = _coordinates(ends.T, self.log)
        supply, *losses = (self.rig[key].low for key in _SUPPLY)
        given = {name: entry.low for key, entry in self.rig.items() for name in _names(key)}
        given["output_high"], given["output_low"] = supply - losses[0], losses[1] - supply
        given["suspension"] = SUSPENSIONS[self.law]
        self._given = np.array([given.get(name, 0.0) for name in RIG])
        # Indices into RIG of the numbers that each free key sets.
        self._columns = [[RIG.index(name) for name in _names(key)] for key in self.names]

    def of_law(self, law: str) -> "Space":
        """This space with another law of the suspension."""
        return replace(self, law=law)

    def values(self, points: Array) -> Array:
        """Values of the free keys, SI, at points (… × free)."""
        low, high = self._ends
        found = low + np.clip(points, 0.0, 1.0) * (high - low)
        # np.where evaluates both branches: the inner one keeps exp from overflowing.
        return np.where(self.log, np.exp(np.where(self.log, found, 0.0)), found)

    def point(self, values: Array) -> Array:
        """The points (… × free) with these values of the free keys, clipped to the bounds."""
        low, high = self._ends
        return np.clip((_coordinates(np.asarray(values), self.log) - low) / (high - low), 0.0, 1.0)

    def rigs(self, points: Array) -> Array:
        """The stepper's numbers (n × RIG) of rigs at points (n × free); µ_k is at most µ_s, and the
        magnets are below the travel."""
        values = self.values(points)
        found = np.repeat(self._given[None], len(values), axis=0)
        for column, columns in zip(values.T, self._columns, strict=True):
            found[:, columns] = column[:, None]
        kinetic, static, distance, travel = (
            RIG.index(name) for name in ("mu_k", "mu_s", "suspension_distance", "travel_down")
        )
        found[:, kinetic] = np.minimum(found[:, kinetic], found[:, static])
        found[:, distance] = np.maximum(found[:, distance], LEAST_DISTANCE * found[:, travel])
        return found

    def scaled(self, points: Array, forces: Array, walls: Array) -> Array:
        """Points (n × free) with all forces and masses multiplied by ``forces`` (n), the travel by
        their root, and the walls' stiffness by ``walls`` (n), too. The measured motion hardly
        determines this scale: otherwise equal searches end at different ones."""
        # The ram's mass is given, so it stays. A ram that the coil alone accelerates then moves the
        # surface alike if its travel grows with the forces; one without inertia, if it stays. The
        # root is between the two.
        values = self.values(points)
        for k, name in enumerate(self.names):
            if name == "mechanics.travel":
                values[:, k] *= np.sqrt(forces)
            elif not name.startswith(UNSCALED):
                values[:, k] *= forces * (walls if name == "mechanics.contact_stiffness" else 1.0)
        return self.point(values)

    def residuals(self, points: Array) -> Array:
        """Residuals of rigs at points (n × free), in standard deviations: from each measurement
        beside the trials, then from the middle of each prior (n × measurements and priors)."""
        rigs = [dict(zip(RIG, row, strict=True)) for row in self.rigs(points).tolist()]
        beside = [
            [(GAUGES[name].of(rig) - value) / sd for name, (value, sd) in self.measured.items()]
            for rig in rigs
        ]
        values = _coordinates(self.values(points), self.log)
        priors = [
            (column - (np.log(entry.prior) if entry.log else entry.prior)) / entry.sigma
            for column, entry in zip(values.T, self.free, strict=True)
            if entry.prior is not None and entry.sigma
        ]
        return np.column_stack([np.array(beside).reshape(len(points), -1), *priors])

    def settings(self, point: Array) -> dict[str, Any]:
        """All keys of the rig at a point, as overrides of a scene."""
        found: dict[str, Any] = {SUSPENSION: self.law}
        found |= {key: entry.low for key, entry in self.rig.items()}
        found |= dict(zip(self.names, self.values(point).tolist(), strict=True))
        found["friction.mu_k"] = min(found["friction.mu_k"], found["friction.mu_s"])
        if self.law == "repulsion":
            key, least = f"{SUSPENSION}_distance", LEAST_DISTANCE * found["mechanics.travel"]
            found[key] = max(found[key], least * (1.0 + 1e-5))  # survives the rounding of a file
        return found


def _coordinates(values: Array, log: Array) -> Array:
    """The logarithms of values where ``log``, else the values; linear ones may be negative."""
    return np.where(log, np.log(np.where(log, values, 1.0)), values)


def read_space(own: Path | None = None) -> Space:
    """The shipped bounds, and those of a file of one's own in their place. Raises BadInput."""
    tables, path = _tables(SHIPPED), plain(own or SHIPPED)
    given = {} if own is None else _tables(own)
    measured = {name: _measured(path, name, x) for name, x in given.pop("measured", {}).items()}
    for name, table in given.items():
        for key, entry in table.items():
            if key not in tables[name]:
                known = ", ".join(tables[name])
                raise BadInput(f'{path}: [{name}."{plain(key)}"]: this key is none of {known}.')
            tables[name][key] = entry
    laws = _laws(path, tables["rig"].pop(SUSPENSION))
    rig, trial = (
        {key: _entry(path, name, key, entry) for key, entry in tables[name].items()}
        for name in ("rig", "trial")
    )
    for key in _SUPPLY:
        if rig[key].free:
            raise BadInput(f'{path}: [rig."{key}"]: this key needs a value; it is not searched.')
    if not any(entry.free for entry in rig.values()):
        raise BadInput(
            f"{path}: no key of the rig has a low and a high: there is nothing to search."
        )
    if rig["friction.mu_k"].low > rig["friction.mu_s"].high:
        raise BadInput(
            f'{path}: [rig."friction.mu_k"]: low = {rig["friction.mu_k"].low:g} must be at most '
            f"friction.mu_s = {rig['friction.mu_s'].high:g}."
        )
    space = Space(rig, trial, laws, laws[0], measured)
    scene = load("reference")
    for law in laws:  # values that a scene refuses are reported now, not after the search
        one = space.of_law(law)
        changed(scene, one.settings(np.full(len(one.free), 0.5)), path)
    return space


def _tables(path: Path) -> dict[str, dict[str, Any]]:
    content, file = toml.read(path), plain(path)
    for name, table in content.items():
        if name not in ("rig", "trial", "measured") or not isinstance(table, dict):
            raise BadInput(
                f"{file}: {plain(name)}: there are the tables rig, trial and measured only."
            )
    return content


def _measured(path: str, name: str, entry: Any) -> tuple[float, float]:
    """Value and standard deviation of a measurement beside the trials."""
    where = f'{path}: [measured."{plain(name)}"]'
    if name not in GAUGES:
        raise BadInput(f"{where}: this measurement is none of {', '.join(GAUGES)}.")
    if not isinstance(entry, dict) or set(entry) - {"source"} != {"value", "sd"}:
        raise BadInput(f"{where}: it needs a value and a standard deviation sd, and nothing else.")
    value, sd = (_number(where, part, entry[part]) for part in ("value", "sd"))
    if sd < LEAST_SD:
        raise BadInput(f"{where}: sd = {sd:g} must be at least {LEAST_SD:g}.")
    return value, sd


def _number(where: str, name: str, value: Any) -> float:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and -MOST <= value <= MOST):
        raise BadInput(f"{where}: {name} = {shown(value)} must be a number within ±{MOST:g}.")
    return float(value)


def _laws(path: str, entry: Any) -> list[str]:
    """The laws of the suspension that are searched, each once, in the file's order."""
    known = isinstance(entry, dict) and not set(entry) - {"laws", "source"}
    laws = entry.get("laws") if known else None
    if not isinstance(laws, list) or not laws or not all(law in [*LAW_KEYS] for law in laws):
        known = ", ".join(f'"{law}"' for law in LAW_KEYS)
        where = f'{path}: [rig."{SUSPENSION}"]'
        raise BadInput(f"{where}: laws must be a list of some of {known}, and stand alone.")
    return [*dict.fromkeys(laws)]


def _entry(path: str, table: str, key: str, entry: Any) -> Entry:
    where = f'{path}: [{table}."{key}"]'
    parts = _PARTS[table]
    if not isinstance(entry, dict) or set(entry) - parts:
        others = sorted(set(entry) - parts) if isinstance(entry, dict) else ["this"]
        wrong = ", ".join(map(plain, others))
        raise BadInput(f"{where}: {wrong} is none of {', '.join(sorted(parts))}.")
    numbers = {name: _number(where, name, entry[name]) for name in _NUMBERS if name in entry}
    given, ends = {"value"} == set(numbers), {"low", "high"} <= set(numbers)
    if not given and ("value" in entry or not ends):
        raise BadInput(f"{where}: it needs either a value, or low and high.")
    low, high = (numbers["value" if given else end] for end in ("low", "high"))
    if not given and not low < high:
        raise BadInput(f"{where}: low = {low:g} must be below high = {high:g}.")
    prior, sigma = numbers.get("prior"), numbers.get("sigma")
    log = entry.get("scale", "linear") == "log"
    if entry.get("scale", "linear") not in ("log", "linear") or (log and low <= 0.0):
        raise BadInput(f'{where}: scale must be "linear", or "log" with low above 0.')
    if (prior is None) != (sigma is None) or (sigma is not None and sigma < LEAST_SD):
        raise BadInput(f"{where}: a prior needs a sigma of at least {LEAST_SD:g} beside it.")
    if log and prior is not None and prior <= 0.0:
        raise BadInput(f'{where}: prior = {prior:g} must be above 0 with scale "log".')
    known = KEYS[key]
    if table == "trial" and key in _OTHERWISE:
        least, most, unit = _OTHERWISE[key]
        known = replace(known, low=least, high=most, unit=unit)
    for name in ("value",) if given else ("low", "high"):
        if not known.holds(numbers[name]):
            raise BadInput(f"{where}: {name} = {numbers[name]:g} must be {known.allowed}.")
    return Entry(key, low, high, log, prior, sigma)


def own_bounds(space: Space, frequency: float) -> tuple[Array, Array, Array]:
    """Low and high end of a trial's own parameters, in ``OWN``'s order, and their scales for a fit.

    The phase is cyclic, so a fitted one has no bounds; its scale is the range in the file.
    """
    entries = {OWN_KEYS[key]: entry for key, entry in space.trial.items()}
    low, high = (np.array([getattr(entries[name], end) for name in OWN]) for end in ("low", "high"))
    cycle, rate = OWN.index("phase"), OWN.index("frequency")
    low[rate], high[rate] = low[rate] * frequency, high[rate] * frequency
    scale = high - low
    if scale[cycle] > 0.0:
        low[cycle], high[cycle] = -np.inf, np.inf
    return low, high, scale
