"""What is searched within which bounds: a file in the form of ``bounds.toml``, read and checked.

The search knows a rig by its place, a number from 0 to 1 for each free key; the chain knows it by
the numbers of ``chain.RIG``, a scene by its keys.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.mechanics.stickslip import SUSPENSIONS
from cosim.scene import keys
from cosim.stepper.stepper import OWN, RIG
from cosim.studies.identify.problem.gauges import GAUGES

SHIPPED = Path(__file__).parent / "bounds.toml"

WEAK = 1e-3
"""Of a prior: what a deviation by its sigma adds to the cost."""

_ALIASES = {
    "mechanics.travel": ("travel_up", "travel_down"),
    "mechanics.contact_stiffness": ("wall_up", "wall_down"),
    "mechanics.contact_damping": ("wall_damping",),
}
SUSPENSION = "mechanics.suspension"
LAW_KEYS = {
    "cubic": ("k1", "k2", "k3"),
    "knee": ("k1", "knee", "hardening"),
    "repulsion": ("repulsion", "distance"),
}
"""What each law of the suspension takes of the keys ``mechanics.suspension_…``."""
OF_LAWS = {f"{SUSPENSION}_{name}" for names in LAW_KEYS.values() for name in names}
"""Keys of a law: what they come out as holds for that law alone."""
UNSCALED = ("friction.", "mechanics.contact_damping", f"{SUSPENSION}_knee", f"{SUSPENSION}_dist")
"""Keys that are no forces or masses begin so."""
LEAST_DISTANCE = 1.1
"""Of ``suspension_distance``, in travels."""
_SUPPLY = ("circuit.supply", "circuit.swing_loss_high", "circuit.swing_loss_low")
"""Keys that together make ``output_high`` and ``output_low``; given, not searched."""

OWN_KEYS = {
    "drive.amplitude": "amplitude",
    "drive.offset": "offset",
    "drive.start_phase": "phase",
    "drive.start_time": "start",
    "mechanics.initial_lift": "lift",
    "friction.normal_force": "normal_force",
    "drive.frequency": "frequency",
}
"""Keys of a trial. Here phase and time are those at the record's first row, the lift is a share of
what the plate's friction can hold, and the frequency one of that at which the record repeats."""

_PART_OF_ENTRY = {"value", "low", "high", "scale", "prior", "sigma", "source"}


@dataclass(frozen=True)
class Entry:
    """One key of the file; ``low`` and ``high`` are the same for a given value."""

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
    """The chain's numbers that a key of the rig is."""
    return _ALIASES.get(key, (key.partition(".")[2],))


class Space:
    """The free keys of a rig with one law of the suspension, and what is given of it."""

    def __init__(
        self,
        rig: Mapping[str, Entry],
        trial: Mapping[str, Entry],
        path: Path,
        laws: Sequence[str],
        law: str = "",
        measured: Mapping[str, tuple[float, float]] = MappingProxyType({}),
    ) -> None:
        self.measured = dict(measured)
        """Value and standard deviation, SI, by the names of GAUGES."""
        self.path, self.all_entries, self.laws, self.law = (
            path,
            dict(rig),
            tuple(laws),
            law or laws[0],
        )
        own = {f"{SUSPENSION}_{name}" for name in LAW_KEYS[self.law]}
        rig = {key: entry for key, entry in rig.items() if key in own or key not in OF_LAWS}
        self.rig_entries, self.trial_entries = rig, dict(trial)
        self.free = [entry for entry in rig.values() if entry.free]
        self.log = np.array([entry.log for entry in self.free], dtype=bool)
        ends = [[entry.low, entry.high] for entry in self.free]
        self._ends = _coordinates(np.array(ends).T, self.log)
        supply = {key: rig[key].low for key in _SUPPLY}
        given = {name: entry.low for key, entry in rig.items() for name in _names(key)}
        given["output_high"] = supply["circuit.supply"] - supply["circuit.swing_loss_high"]
        given["output_low"] = supply["circuit.swing_loss_low"] - supply["circuit.supply"]
        given["suspension"] = SUSPENSIONS[self.law]
        self._given = np.array([given.get(name, 0.0) for name in RIG])
        self._places = [[RIG.index(name) for name in _names(entry.key)] for entry in self.free]
        self._mu = RIG.index("mu_k"), RIG.index("mu_s")
        self._near = RIG.index("suspension_distance"), RIG.index("travel_down")

    def of_law(self, law: str) -> "Space":
        """The same with another law of the suspension."""
        both = self.all_entries, self.trial_entries
        return Space(*both, self.path, self.laws, law, self.measured)

    @property
    def names(self) -> list[str]:
        """The free keys."""
        return [entry.key for entry in self.free]

    def values(self, places: Array) -> Array:
        """Values of the free keys, SI, at places (… × free)."""
        low, high = self._ends
        found = low + np.clip(places, 0.0, 1.0) * (high - low)
        return np.where(self.log, np.exp(np.where(self.log, found, 0.0)), found)

    def place(self, values: Array) -> Array:
        """The place of values of the free keys."""
        low, high = self._ends
        return np.clip((_coordinates(np.asarray(values), self.log) - low) / (high - low), 0.0, 1.0)

    def rigs(self, places: Array) -> Array:
        """The chain's numbers (n × RIG) of rigs at places (n × free); µ_k is at most µ_s, and the
        magnets are below the travel."""
        values = self.values(places)
        found = np.repeat(self._given[None], len(values), axis=0)
        for column, spots in zip(values.T, self._places, strict=True):
            found[:, spots] = column[:, None]
        kinetic, static = self._mu
        found[:, kinetic] = np.minimum(found[:, kinetic], found[:, static])
        distance, travel = self._near
        found[:, distance] = np.maximum(found[:, distance], LEAST_DISTANCE * found[:, travel])
        return found

    def scaled(self, places: Array, forces: Array, walls: Array) -> Array:
        """Places (n × free) with all forces and masses times ``forces`` (n), the travel times their
        root, and the walls' stiffness times ``walls`` besides. A motion hardly tells the scale, and
        searches that differ end apart in it."""
        values = self.values(places)
        for k, name in enumerate(self.names):
            if name == "mechanics.travel":
                values[:, k] *= np.sqrt(forces)
            elif not name.startswith(UNSCALED):
                values[:, k] *= forces * (walls if name == "mechanics.contact_stiffness" else 1.0)
        return self.place(values)

    def prior(self, places: Array) -> Array:
        """What the priors add to the costs of rigs at places (n × free)."""
        values, total = _coordinates(self.values(places), self.log), np.zeros(len(places))
        for column, entry in zip(values.T, self.free, strict=True):
            if entry.prior is not None and entry.sigma:
                middle = np.log(entry.prior) if entry.log else entry.prior
                total += WEAK * ((column - middle) / entry.sigma) ** 2
        return total

    def misses(self, places: Array) -> Array:
        """How far rigs at places (n × free) are from what was measured beside the trials, in
        standard deviations (n × measured)."""
        rigs = [dict(zip(RIG, row, strict=True)) for row in self.rigs(places).tolist()]
        found = [
            [(GAUGES[name].of(rig) - value) / sd for name, (value, sd) in self.measured.items()]
            for rig in rigs
        ]
        return np.array(found).reshape(len(places), len(self.measured))

    def settings(self, place: Array) -> dict[str, Any]:
        """All keys of the rig at a place, as overrides of a scene."""
        found: dict[str, Any] = {SUSPENSION: self.law}
        found |= {key: entry.low for key, entry in self.rig_entries.items()}
        found |= dict(zip(self.names, self.values(place).tolist(), strict=True))
        found["friction.mu_k"] = min(found["friction.mu_k"], found["friction.mu_s"])
        if self.law == "repulsion":
            key, least = f"{SUSPENSION}_distance", LEAST_DISTANCE * found["mechanics.travel"]
            found[key] = max(found[key], least * (1.0 + 1e-5))  # its digits in a file
        return found

    def numbers(self, place: Array) -> dict[str, float]:
        """The stepper's numbers of the rig at a place, by name."""
        return dict(zip(RIG, self.rigs(place[None])[0].tolist(), strict=True))


def _coordinates(values: Array, log: Array) -> Array:
    return np.where(log, np.log(np.where(log, values, 1.0)), values)


def read_space(own: Path | None = None) -> Space:
    """The shipped bounds, and those of a file of one's own in their place. Raises BadInput."""
    shipped = _tables(SHIPPED)
    tables = {name: dict(table) for name, table in shipped.items()}
    measured: dict[str, tuple[float, float]] = {}
    if own is not None:
        given = _tables(own)
        entries = given.pop("measured", {}).items()
        measured = {name: _measured(own, name, entry) for name, entry in entries}
        for name, table in given.items():
            for key, entry in table.items():
                if key not in tables[name]:
                    known = ", ".join(tables[name])
                    raise BadInput(f'{own}: [{name}."{plain(key)}"]: this key is none of {known}.')
                tables[name][key] = entry
    path = own or SHIPPED
    laws = _laws(path, tables["rig"].pop(SUSPENSION))
    rig = {key: _entry(path, "rig", key, entry) for key, entry in tables["rig"].items()}
    trial = {key: _entry(path, "trial", key, entry) for key, entry in tables["trial"].items()}
    for key in _SUPPLY:
        if rig[key].free:
            raise BadInput(f'{path}: [rig."{key}"]: this key needs a value; it is not searched.')
    if not any(entry.free for entry in rig.values()):
        raise BadInput(
            f"{path}: no key of the rig has a low and a high: there is nothing to search."
        )
    return Space(rig, trial, path, laws, measured=measured)


def _measured(path: Path, name: str, entry: Any) -> tuple[float, float]:
    """Value and standard deviation of what was measured beside the trials."""
    where = f'{path}: [measured."{plain(name)}"]'
    if name not in GAUGES:
        raise BadInput(f"{where}: this measurement is none of {', '.join(GAUGES)}.")
    if not isinstance(entry, dict) or set(entry) - {"source"} != {"value", "sd"}:
        raise BadInput(f"{where}: it needs a value and a standard deviation sd, and nothing else.")
    for part in ("value", "sd"):
        _number(where, part, entry[part])
    if entry["sd"] <= 0.0:
        raise BadInput(f"{where}: sd = {entry['sd']:g} must be above 0.")
    return float(entry["value"]), float(entry["sd"])


def _number(where: str, name: str, value: Any) -> None:
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise BadInput(f"{where}: {name} = {plain(str(value))} must be a number.")


def _laws(path: Path, entry: Any) -> list[str]:
    """The laws of the suspension that are tried, the first for a start."""
    laws = entry.get("laws") if isinstance(entry, dict) else None
    if not isinstance(laws, list) or not laws or not all(law in [*LAW_KEYS] for law in laws):
        known = ", ".join(f'"{law}"' for law in LAW_KEYS)
        raise BadInput(f'{path}: [rig."{SUSPENSION}"]: laws must be a list of some of {known}.')
    return [*dict.fromkeys(laws)]


def _tables(path: Path) -> dict[str, dict[str, Any]]:
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadInput(f"{path}: cannot be read ({error.strerror}).") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadInput(f"{path}: is no valid TOML: {error}.") from error
    for name, table in content.items():
        if name not in ("rig", "trial", "measured") or not isinstance(table, dict):
            raise BadInput(
                f"{path}: {plain(name)}: there are the tables rig, trial and measured only."
            )
    return content


def _entry(path: Path, table: str, key: str, entry: Any) -> Entry:
    where = f'{path}: [{table}."{key}"]'
    if not isinstance(entry, dict) or set(entry) - _PART_OF_ENTRY:
        wrong = (
            ", ".join(map(plain, set(entry) - _PART_OF_ENTRY)) if isinstance(entry, dict) else ""
        )
        raise BadInput(
            f"{where}: {wrong or 'this'} is none of {', '.join(sorted(_PART_OF_ENTRY))}."
        )
    numbers = {
        name: entry[name] for name in ("value", "low", "high", "prior", "sigma") if name in entry
    }
    for name, value in numbers.items():
        _number(where, name, value)
    given = "value" in entry
    if len(numbers) > 1 if given else not {"low", "high"} <= set(entry):
        raise BadInput(f"{where}: it needs either a value, or low and high.")
    low, high = (float(numbers["value" if given else end]) for end in ("low", "high"))
    if "value" not in entry and not low < high:
        raise BadInput(f"{where}: low = {low:g} must be below high = {high:g}.")
    log = entry.get("scale", "linear") == "log"
    if entry.get("scale", "linear") not in ("log", "linear") or (log and low <= 0.0):
        raise BadInput(f'{where}: scale must be "linear", or "log" with low above 0.')
    if ("prior" in entry) != ("sigma" in entry) or not entry.get("sigma", 1.0) > 0.0:
        raise BadInput(f"{where}: a prior needs a sigma above 0 beside it.")
    if log and not entry.get("prior", 1.0) > 0.0:
        raise BadInput(f'{where}: prior = {entry["prior"]:g} must be above 0 with scale "log".')
    if table == "rig":
        _within_scene(where, key, low, high)
    return Entry(key, low, high, log, entry.get("prior"), entry.get("sigma"))


def _within_scene(where: str, key: str, low: float, high: float) -> None:
    known = next(one for one in keys() if one.full == key)
    assert known.low is not None and known.high is not None
    for name, value in (("low", low), ("high", high)):
        if not known.low <= value <= known.high:
            raise BadInput(f"{where}: {name} = {value:g} must be {known.allowed}.")


def own_bounds(space: Space, frequency: float) -> tuple[Array, Array, Array]:
    """Low and high end of a trial's own numbers, in ``OWN``'s order, and their scales for a fit.

    The phase is not bounded: it is the same again after a period.
    """
    entries = {OWN_KEYS[key]: entry for key, entry in space.trial_entries.items()}
    low = np.array([entries[name].low for name in OWN])
    high = np.array([entries[name].high for name in OWN])
    cycle, rate = OWN.index("phase"), OWN.index("frequency")
    low[rate], high[rate] = low[rate] * frequency, high[rate] * frequency
    scale = high - low
    if scale[cycle] > 0.0:
        low[cycle], high[cycle] = -np.inf, np.inf
    return low, high, scale
