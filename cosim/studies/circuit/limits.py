"""Which limit of a circuit binds: each is lifted alone and in pairs, and turned up and down.

The part slips only where the surface's downward acceleration exceeds mu_s F_n / m_p + g. What keeps
the circuit from giving the commanded current is found by lifting one limit after another, which no
real bench can do.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import combinations
from math import comb, nan

import numpy as np

from cosim.errors import BadInput, SimulationFailed
from cosim.scene import Scene, changed
from cosim.scene.tables import KNOBS
from cosim.simulation.simulate import simulate
from cosim.studies.sweep.batch import runner
from cosim.studies.sweep.pool import workers_asked

Settings = dict[str, float | int]

FACTORS = (0.5, 0.7, 0.85, 1.2, 1.5, 2.0)
"""What each limit is multiplied by when it is turned."""

BINDS, ACTS = 0.03, 0.01
"""Least change of v_average, relative to the ideal current's or the scene's own, whichever is
larger, of a limit that binds, and of one that can be told at all."""

UNTOLD = ("another motion", "could not be lifted")
"""Verdicts for a limit whose effect cannot be determined."""

PAIRED = 4
"""Limits of largest effect that are lifted two at a time."""

TREMBLES = (-3e-4, -1e-4, 1e-4, 3e-4)
"""Relative changes of normal force and coil's force that show how steady v_average is."""


@dataclass(frozen=True)
class Limit:
    """One limit: how a scene is changed to have it ``factor`` times its own, and when it is gone.

    ``rung`` is the circuit in which it is lifted; ``reduced`` says whether it acts in "limited" as
    well, ``factors`` whether it can be turned at all.
    """

    name: str
    turned: Callable[[Scene, float], Settings]
    gone: float
    rung: str = "amplifier"
    reduced: bool = True
    factors: bool = True


def _times(*keys: str) -> Callable[[Scene, float], Settings]:
    def turned(scene: Scene, factor: float) -> Settings:
        tables = scene.as_dict()
        places = [(key, tables[key.split(".")[0]].get(key.split(".")[1])) for key in keys]
        return {key: value * factor for key, value in places if value is not None}

    return turned


def _sense(scene: Scene, factor: float) -> Settings:
    """The same current commanded over another sense resistor."""
    return _times("circuit.sense_resistance", "drive.amplitude", "drive.offset")(scene, factor)


def _back_emf(scene: Scene, factor: float) -> Settings:
    """Another back-EMF, and nothing else.

    A coil of s times less force factor that takes s times the current exerts the same force. With
    resistances and inductances s times smaller it takes the same voltage for the same motion, but
    for the back-EMF, which is s times smaller.
    """
    smaller = _times(
        "coil.force_factor", "circuit.sense_resistance", "coil.resistance", "coil.inductance",
        "coil.eddy_resistance", "coil.eddy_inductance", "circuit.output_resistance",
    )(scene, factor)  # fmt: skip
    return smaller | _times("circuit.current_limit")(scene, 1.0 / factor)


def _steps(scene: Scene, factor: float) -> Settings:
    return {"drive.quantised": factor > 0.0}


LIMITS = (
    Limit("supply voltage", _times("circuit.supply"), 10.0),
    Limit("output's swing loss", _times("circuit.swing_loss_high", "circuit.swing_loss_low"), 0.0),
    Limit("sense resistance", _sense, 0.03),
    Limit("coil resistance", _times("coil.resistance"), 0.01),
    Limit("coil inductance", _times("coil.inductance", "coil.eddy_inductance"), 0.02),
    Limit("back-EMF", _back_emf, 0.02),
    Limit("slew rate", _times("circuit.slew_rate"), 100.0, reduced=False),
    Limit("gain-bandwidth", _times("circuit.gain_bandwidth"), 10.0, reduced=False),
    Limit("current limit", _times("circuit.current_limit"), 100.0, rung="limited", reduced=False),
    Limit("DAC steps", _steps, 0.0, reduced=False, factors=False),
)


@dataclass(frozen=True)
class Motion:
    """Results of a run, SI; NaN where it failed or a rigid wall leaves no number."""

    v_average: float
    fall: float
    """Greatest downward acceleration of the surface, m/s²."""
    saturated: float
    failure: str = ""


@dataclass
class Study:
    """The limits of one scene. Motions are keyed by the names of the limits."""

    scene: Scene
    own: Motion
    ideal: Motion
    needed: float
    """The paper's mu_s F_n / m_p + g, m/s²."""
    unsteady: float
    """Largest change of v_average, m/s, by TREMBLES."""
    peaks: tuple[float, float]
    """Greatest downward acceleration, m/s²: in all, NaN with rigid walls, which leave no number;
    and while the ram touches no wall."""
    without: dict[str, Motion] = field(default_factory=dict)
    against: dict[str, Motion] = field(default_factory=dict)
    """What ``without`` is to be compared with: ``own``, or the same on the limit's rung."""
    reduced_gain: dict[str, float] = field(default_factory=dict)
    """Change of v_average, m/s, by lifting it on the rung "limited", where it acts there."""
    turned: dict[str, dict[float, Motion]] = field(default_factory=dict)
    pairs: dict[tuple[str, str], Motion] = field(default_factory=dict)
    all_gone: Motion | None = None

    def gain(self, name: str) -> float:
        """Change of v_average, m/s, when the limit is lifted."""
        return self.without[name].v_average - self.against[name].v_average

    def together(self, pair: tuple[str, str]) -> float:
        """How much more, m/s, two limits gain when lifted together than one by one."""
        one, other = pair
        return self.pairs[pair].v_average - self.own.v_average - self.gain(one) - self.gain(other)

    def ranked(self) -> list[str]:
        """Names of the limits: those that can be told first, by the size of their effect."""

        def key(name: str) -> tuple[bool, float]:
            return self.verdict(name) in UNTOLD, -abs(np.nan_to_num(self.gain(name)))

        return sorted(self.without, key=key)

    def verdict(self, name: str) -> str:
        """Whether it binds, in words.

        Where two motions exist side by side the start decides between them: the rungs "amplifier"
        and "limited", which agree else, then land in different ones when a limit is lifted.
        """
        if self.without[name].failure:
            return UNTOLD[1]
        effect = abs(self.gain(name))
        scale = max(abs(self.own.v_average), abs(self.ideal.v_average))
        if effect <= max(ACTS * scale, 2.0 * self.unsteady):
            return "does not matter"
        sure = effect
        if name in self.reduced_gain:
            same = self.reduced_gain[name] * self.gain(name) > 0.0
            sure = min(effect, abs(self.reduced_gain[name])) if same else 0.0
        if sure > BINDS * scale:
            return "binds"
        return "acts a little" if effect <= BINDS * scale else UNTOLD[0]


def runs_in_all(turn: bool) -> int:
    """How many runs a study takes."""
    alone = 3 + 2 * len(TREMBLES) + len(LIMITS) + sum(limit.reduced for limit in LIMITS)
    turned = sum(limit.factors for limit in LIMITS) * len(FACTORS)
    return alone + turn * turned + comb(PAIRED, 2) + 1


def study(scene: Scene, turn: bool, progress: Callable[[], object] = lambda: None) -> Study:
    """Lift each limit of a scene's circuit alone and in pairs and, on request, turn each.

    The circuit is the behavioural amplifier, where all of them but the current limit act; that one
    is lifted on the rung "limited". Raises BadInput for a scene without a drive or circuit of this
    kind, SimulationFailed where the scene itself does not run.
    """
    base, workers = prepared(scene), workers_asked(None)
    runs: list[tuple[str, Settings]] = [("amplifier", {}), ("ideal", {}), ("limited", {})]
    runs += [
        ("amplifier", _times(key)(base, 1.0 + change))
        for key in ("friction.normal_force", "coil.force_factor")
        for change in TREMBLES
    ]
    # Where the scene has no steps, it is itself without the limit, and is run with them.
    factors = {
        limit.name: limit.gone if limit.factors or base.drive.quantised else 1.0 for limit in LIMITS
    }
    runs += [(limit.rung, limit.turned(base, factors[limit.name])) for limit in LIMITS]
    reduced = [limit for limit in LIMITS if limit.reduced]
    runs += [("limited", limit.turned(base, limit.gone)) for limit in reduced]
    places = [(limit, factor) for limit in LIMITS if limit.factors for factor in FACTORS if turn]
    runs += [(limit.rung, limit.turned(base, factor)) for limit, factor in places]
    found = iter(_run(base, runs, workers, progress))

    own, ideal, limited = plain = next(found), next(found), next(found)
    for (rung, _), motion in zip(runs, plain, strict=False):
        if motion.failure:
            raise SimulationFailed(f"With circuit.model = {rung}: {motion.failure}")
    unsteady = max(abs(next(found).v_average - own.v_average) for _ in range(2 * len(TREMBLES)))
    result = Study(scene, own, ideal, needed_acceleration(base), unsteady, _peaks(base))
    for limit in LIMITS:
        there, here = next(found), limited if limit.rung == "limited" else own
        is_gone = factors[limit.name] != limit.gone
        result.without[limit.name] = here if is_gone else there
        result.against[limit.name] = there if is_gone else here
    for limit in reduced:
        result.reduced_gain[limit.name] = next(found).v_average - limited.v_average
    for limit, factor in places:
        row = result.turned.setdefault(limit.name, {1.0: result.against[limit.name]})
        row[factor] = next(found)

    names = [limit.name for limit in LIMITS if limit.rung == "amplifier" and limit.factors]
    here = [name for name in result.ranked() if name in names]
    pairs = list(combinations(here[:PAIRED], 2))
    joint = [("amplifier", _joined(base, chosen)) for chosen in (*pairs, here)]
    found = iter(_run(base, joint, workers, progress))
    result.pairs = dict(zip(pairs, found, strict=False))
    result.all_gone = next(found)
    return result


def prepared(scene: Scene) -> Scene:
    """The scene on the rung "amplifier", its knobs resolved into volts and hertz."""
    if not scene.rung.on_ladder:
        raise BadInput(
            f'scene {scene.name}: circuit.model = "{scene.circuit.model}" has no limits to lift; '
            'it must be "full", "amplifier", "limited", "ideal" or "auto".'
        )
    drive = scene.drive
    settings = {f"drive.{knob}": None for knob in KNOBS} | {
        f"drive.{key}": getattr(drive, key) for key in KNOBS.values()
    }
    own = {"circuit.model": "amplifier", "drive.pwm_ripple": False}
    return changed(scene, settings | own, f"scene {scene.name}")


def needed_acceleration(scene: Scene) -> float:
    """mu_s F_n / m_p + g, m/s²: downwards, where the part begins to slip (the paper, section 2)."""
    friction, mechanics = scene.friction, scene.mechanics
    pull = friction.mu_s * friction.normal_force * mechanics.n_surfaces
    return pull / mechanics.part_mass + mechanics.gravity


def _peaks(base: Scene) -> tuple[float, float]:
    result = simulate(base)
    waves, low = result.columns, result.summary["a_surface_min"]
    apart = np.abs(waves["z_ram"] - waves["z_surface"]) < base.mechanics.travel
    counted = apart & (waves["time"] >= base.run.settle)
    peak = nan if low is None else -float(str(low))
    return peak, -float(waves["a_surface"][counted].min())


def _joined(base: Scene, names: Iterable[str]) -> Settings:
    """The settings without all of the limits."""
    scene, settings = base, Settings()
    for limit in LIMITS:
        if limit.name in names:
            found = limit.turned(scene, limit.gone)
            scene = changed(scene, found, limit.name)
            settings |= found
    return settings


def _run(
    base: Scene, runs: list[tuple[str, Settings]], workers: int, progress: Callable[[], object]
) -> list[Motion]:
    """What each (rung, settings) comes to, in their order."""
    motions: dict[int, Motion] = {}
    for rung in dict.fromkeys(rung for rung, _ in runs):
        scene = changed(base, {"circuit.model": rung}, "rung")
        points = [(number, values) for number, (own, values) in enumerate(runs) if own == rung]
        with runner(scene, workers, whole_periods=True) as pool:
            for number, outcome in pool.run(points):
                found = outcome.numbers
                motions[number] = Motion(
                    found.get("v_average", nan),
                    -found.get("a_surface_min", nan),
                    found.get("saturated_fraction", nan),
                    outcome.failure,
                )
                progress()
    return [motions[number] for number in range(len(runs))]


def name_of(scene: Scene) -> str:
    """The drive and the walls of a scene, for headings."""
    drive = scene.drive
    return (
        f"{drive.frequency:.4g} Hz, {drive.amplitude:.3g} Vpp, {drive.offset:+.3g} V, "
        f"{scene.mechanics.contact}"
    )
