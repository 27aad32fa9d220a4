"""The sample of rigs that may be the true one, and for each rig the value that every measurement
would show and the largest robust velocity upwards."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np

from cosim.arrays import Array
from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.store import Store
from cosim.mechanics.stickslip import numbers_of
from cosim.scene import Scene
from cosim.studies.identify.problem.gauges import BIASES, GAUGES, Gauge
from cosim.studies.limits.changes import AS_IT_IS, CHANGES, Settings
from cosim.studies.limits.judge import NUMBER
from cosim.studies.limits.runs import NEEDED, SETTLE, SPAN, Bench
from cosim.studies.limits.search import Candidates, Effort, searched

UP = NUMBER["v_up"]
BY_NAME = {change.name: change for change in CHANGES}
TARGETS = (AS_IT_IS.name, "falling sawtooth")
"""Machines of the targets: as in all measured trials, and with a most promising waveform."""

SPREAD = 0.4
"""Standard deviation of drawn rigs about given ones, as a share of the given rigs' own. On 14 rigs
drawn with 0.35 (0.5) the published trials, their own numbers fitted anew, have a median cost of
0.137 (0.132); on the 14 given ones 0.126."""
TRIES = 100
"""Draws for each rig that is wanted, at most: a draw that no scene allows is discarded."""

KEPT = (*NEEDED, "z_surface_pp")
"""The numbers of a run's summary that films and scores need."""
FILM = (
    Gauge("", "mm/s", 1e3, 1.5e-3, 0.0, lambda told: told["v_average"]),
    Gauge("", "mm", 1e3, 0.0, 0.1, lambda told: told["z_surface_pp"]),
)
"""A rig misses the mean velocity of a trial that it was not fitted to by 1.2 mm/s on average
(``identify.md``), whatever the camera's accuracy; 10 % of the stroke are assumed."""

FILMS = {
    "film, rising sawtooth": (AS_IT_IS.name, AS_IT_IS.name),
    "film, falling sawtooth": ("falling sawtooth", "falling sawtooth"),
    "film, sine": ("sine", "sine"),
    "film, half the grip force": ("half the grip force", AS_IT_IS.name),
    "film, twice the grip force": ("twice the grip force", AS_IT_IS.name),
}
"""For each film the change on film, and that whose best robust setting drives it."""

OWN, OTHERS = Effort(256, 150, 60), Effort(160, 60, 30)
"""Effort of searches on the scene's rig, and on others, which start from its results."""


@dataclass(frozen=True)
class Candidate:
    """A measurement of one number or several; ``how`` describes it in a sentence."""

    name: str
    how: str
    gauges: tuple[Gauge, ...]

    def accuracy(self, values: Array) -> Array:
        """Standard deviations of values (… × gauges), SI."""
        return np.hypot(
            [one.sd for one in self.gauges], values * [one.share for one in self.gauges]
        )


def _filmed(name: str, drive: str) -> str:
    apart = "" if name == drive else f", with {name}"
    return f"film the best robust setting of '{drive}'{apart}: v_average and the surface's stroke"


IMPEDANCE = ("force factor", *(f"resonance{end}" for end in BIASES))
"""Gauges that a single measurement of the coil's impedance yields together."""

CANDIDATES = (
    Candidate(
        "the coil's impedance",
        "the coil's impedance for small tones over frequency, housing held, at 0 and -1 A: its "
        "peaks tell the suspension, and what the free ram adds above them Bl² over its known mass",
        tuple(GAUGES[name] for name in IMPEDANCE),
    ),
    *(Candidate(name, one.how, (one,)) for name, one in GAUGES.items() if name not in IMPEDANCE),
    *(Candidate(name, _filmed(*of), FILM) for name, of in FILMS.items()),
)


@dataclass(frozen=True)
class Sample:
    """The measurements and targets on a sample of rigs."""

    values: list[Array]
    """What each of CANDIDATES would show: rigs × gauges, SI."""
    targets: Array
    """Robust velocities upwards: rigs × TARGETS, m/s."""


def drawn(
    scene: Scene, rigs: Sequence[Settings], count: int, rng: np.random.Generator
) -> list[Settings]:
    """New rigs about the given ``rigs``: each is a given one (the parent), moved by a random linear
    combination of the deviations of all given rigs with the same law and keys from their mean, in
    logarithms where values are above 0. So values and products in which the given rigs agree are
    kept, and mean and covariance are theirs (a smoothed bootstrap)."""
    found: list[Settings] = []
    for number in range(TRIES * count):
        if len(found) == count:
            break
        parent = rigs[int(rng.integers(len(rigs)))]
        words = {key: value for key, value in parent.items() if isinstance(value, str)}
        like = [rig for rig in rigs if rig.keys() == parent.keys() and words.items() <= rig.items()]
        names = [key for key in parent if key not in words]
        x = np.array([[float(rig[key]) for key in names] for rig in like])  # rigs × keys
        log = (x > 0.0).all(axis=0)
        x[:, log] = np.log(x[:, log])
        apart = x - x.mean(axis=0)
        # ``shares @ apart`` has SPREAD² times the covariance; the parent's deviation is shrunk so
        # that both add up to the whole covariance.
        shares = SPREAD * rng.standard_normal(len(like)) / np.sqrt(max(len(like) - 1, 1))
        moved = np.sqrt(1.0 - SPREAD**2) * apart[like.index(parent)] + shares @ apart
        new = x.mean(axis=0) + moved
        values = np.where(log, np.exp(np.where(log, new, 0.0)), new)
        rig = {**words, **dict(zip(names, values.tolist(), strict=True))}
        try:
            Bench.base(scene, rig, f"rig {number}")
        except BadInput:  # a scene does not allow these values: draw again
            continue
        found.append(rig)
    return found


def whole(scene: Scene, rigs: Sequence[Settings]) -> list[Settings]:
    """The scene's own rig, then the others, all completed to the same keys by scene values."""
    names = dict.fromkeys(key for rig in rigs for key in rig)
    own = {key: value for key in names if (value := scene.value(key)) is not None}
    return [own, *({**own, **rig} for rig in rigs)]


def gauged_on(scene: Scene) -> list[list[float]]:
    """The values that each measurement by gauges shows on the rig of a scene, SI. A current beyond
    the range of the device's own source is clipped: the measurement shows only that it is beyond.
    """
    rig, ends = numbers_of(scene), held_currents(scene)

    def shown(gauge: Gauge) -> float:
        value = gauge.of(rig)
        return float(np.clip(value, *ends)) if gauge.unit == "A" else value

    return [[*map(shown, one.gauges)] for one in CANDIDATES if one.name not in FILMS]


def held_currents(scene: Scene) -> tuple[float, float]:
    """The least and the most current that the device's source can hold in each coil, A: limited by
    its output's swing, and by its current limit."""
    coil, circuit = scene.coil, scene.circuit
    around, limit = coil.resistance + scene.sense, circuit.current_limit  # Ohm of the loop; A
    low, high = circuit.swing_loss_low - circuit.supply, circuit.supply - circuit.swing_loss_high
    return max(low / around, -limit / coil.count), min(high / around, limit / coil.count)


_Found = tuple[Candidates, float]
"""Candidates of a search, and the robust velocity upwards (m/s) of the best."""


def sample(
    scene: Scene,
    rigs: Sequence[Settings],
    store: Store,
    open_: Callable[[Scene], Evaluator],
    seed: int,
    told: Callable[[str], object],
) -> Sample:
    """The measurements and targets on ``rigs``, of which the first is the scene's own; ``store``
    keeps them rig by rig, ``open_`` makes the evaluator of a rig. Rigs on which no setting moves
    the part upwards, or on which a gauge would be exact, are left out. Raises BadInput where
    nothing moves upwards on the first."""

    def ask(number: int, names: Iterable[str], effort: Effort) -> dict[str, _Found]:
        base = Bench.base(scene, rigs[number], f"rig {number}")
        with open_(base) as evaluator:
            bench = Bench(base, evaluator, UP)
            return {
                name: _robust(bench, name, effort, [seed, number], own.get(name)) for name in names
            }

    own: dict[str, Candidates] = {}
    drives = dict.fromkeys(drive for _, drive in FILMS.values())
    found = store.once("drives", lambda: ask(0, drives, OWN))
    own |= {name: candidates for name, (candidates, _) in found.items()}
    for name, (_, speed) in found.items():
        if not speed > 0.0:
            raise BadInput(f"{scene.origin}: {name}: no setting of the knobs moves it upwards.")
    told("the scene's own rig")
    targets, values = [], []
    for number, rig in enumerate(rigs):
        base = Bench.base(scene, rig, f"rig {number}")

        def speeds_of(number: int = number) -> list[float]:
            each = ask(number, TARGETS, OTHERS) if number else found
            return [each[name][1] for name in TARGETS]

        shown = store.once(f"films {number}", lambda base=base: _films(base, open_, own))
        speeds = store.once(f"rig {number}", speeds_of)
        gauged = gauged_on(base)
        told(f"rig {number}")
        readings = [*gauged, *shown]  # by candidate, then by gauge
        # An accuracy that is a share of a value of 0 would make the measurement exact.
        both = zip(CANDIDATES, readings, strict=True)
        sound = all((one.accuracy(np.array(some)) > 0.0).all() for one, some in both)
        if sound and np.isfinite([*speeds, *(value for film in shown for value in film)]).all():
            targets.append(speeds)
            values.append(readings)
    columns = [np.array(column) for column in zip(*values, strict=True)]
    return Sample(columns, np.array(targets))


def _robust(
    bench: Bench, name: str, effort: Effort, seed: list[int], own: Candidates | None
) -> _Found:
    """The candidates of a change for the robust velocity upwards, and that velocity, m/s."""
    machine = BY_NAME[name].machine(bench.scene)
    candidates = searched(bench, machine, effort, seed, own)
    points = candidates["robust"][UP][:1]
    speed = float(bench.over_turns(machine)(np.array(points))[0][0, UP]) if points else nan
    return candidates, speed


def _films(
    base: Scene, open_: Callable[[Scene], Evaluator], own: Mapping[str, Candidates]
) -> list[list[float]]:
    """The values of FILM in each of FILMS on a rig, SI; NaN where the run fails."""
    runs = [
        BY_NAME[name].machine(base).at(np.array(own[drive]["robust"][UP][0]), SETTLE, SPAN)
        | {"run.solver": "fast"}
        for name, drive in FILMS.values()
    ]
    with open_(base) as evaluator:
        outcomes = evaluator.outcomes(runs)
    return [[nan if one.failure else gauge.of(one.numbers) for gauge in FILM] for one in outcomes]
