"""Runs a scene with each knob turned a little, on the simplest circuit model that suffices."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from itertools import count
from typing import Any

from cosim.errors import BadInput, SimulationFailed
from cosim.evaluate.evaluator import Evaluator
from cosim.scene import KEYS, Overrides, Scene, load
from cosim.scene.tables import KNOBS
from cosim.search.turns import TURN
from cosim.simulation.fidelity import Fidelity
from cosim.typed import typed
from cosim.waveforms.quantities import with_unit

Settings = dict[str, float]
"""Values of keys, ``table.key``, SI."""


@dataclass(frozen=True)
class Turned:
    """A run of the scene with the changed ``settings``; none for the scene as it is."""

    settings: Settings
    circuit_model: str
    """The circuit model of the run."""
    v_average: float | None
    """m/s; None where the run failed."""
    failure: str = ""
    """Why it failed."""

    def __str__(self) -> str:
        named = (f"{k} = {with_unit(v, KEYS[k].unit)}" for k, v in self.settings.items())
        return ", ".join(named) or "the scene's own setting"


@dataclass(frozen=True)
class Spread:
    """How a small turn of each knob changes v_average; the first run is the scene as it is."""

    runs: list[Turned]

    @property
    def least(self) -> Turned:
        """The run with the least v_average."""
        return min(self.known, key=_speed)

    @property
    def most(self) -> Turned:
        """The run with the greatest v_average."""
        return max(self.known, key=_speed)

    @property
    def known(self) -> list[Turned]:
        """The runs that did not fail."""
        return [run for run in self.runs if run.v_average is not None]

    def summary(self) -> dict[str, Any]:
        """As ``summary.json`` has it, SI."""
        return {
            "turn": TURN,
            "v_average_min": self.least.v_average,
            "at_min": self.least.settings,
            "v_average_max": self.most.v_average,
            "at_max": self.most.settings,
            "runs": [asdict(run) for run in self.runs],
        }

    def __repr__(self) -> str:
        """The lines that ``cosim run --spread`` prints."""
        low, high = (_speed(run) * 1e3 for run in (self.least, self.most))
        ends = "fastest down at", "fastest up at"
        if low * high >= 0.0:
            ends = ("slowest at", "fastest at")[:: 1 if low + high >= 0.0 else -1]
        rows = [
            (f"with a knob ±{TURN * 100:g} %", f"{low:+.3f} … {high:+.3f} mm/s"),
            (f"  {ends[0]}", str(self.least)),
            (f"  {ends[1]}", str(self.most)),
            *(("  failed at", f"{run}: {run.failure}") for run in self.runs if run.failure),
        ]
        return "\n".join(f"  {name:<24}{value}" for name, value in rows)


@typed
def spread(
    scene: Scene | str | os.PathLike[str],
    overrides: Overrides | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda runs: None,
) -> Spread:
    """Run a scene as it is and with each of the three knobs turned by TURN either way.

    The runs are those of `cosim run`; where the scene gives run.settle, they last whole periods, at
    least as long as its own. Where ngspice solves its circuit, all are first made on a circuit
    model that needs no ngspice. The scene itself, the slowest and the fastest turn are then run on
    the scene's own model, and where one of the three differs by more than ``run.tolerance``, all
    others too. ``workers`` runs at once, by default one for each processor; ``progress`` is given
    the number of runs done.

    Of what comes back ``runs`` has each setting's keys and ``v_average``, m/s; ``least`` and
    ``most`` are two of them, and ``summary()`` is what ``summary.json`` gets.

    Raises BadInput for a scene without knobs, SimulationFailed where every run failed.

    >>> found = spread("ideal-current", {"run.duration": 0.1})
    >>> found.least.v_average <= found.runs[0].v_average <= found.most.v_average
    True
    """
    scene = load(scene, overrides)
    settings: list[Settings] = [{}, *turns(scene)]
    fidelity, steps, found = Fidelity.of(scene), count(1), dict[int, Turned]()

    def run(numbers: Iterable[int], circuit: Mapping[str, str | bool]) -> None:
        points = {n: {**settings[n], **circuit} for n in numbers}
        model = str(circuit.get("circuit.model", scene.circuit.model))
        for n, outcome in bench.run(points.items()):
            value = None if outcome.failure else outcome.numbers["v_average"]
            found[n] = Turned(settings[n], model, value, outcome.failure)
            progress(next(steps))

    # Without a run.settle of the scene's own each run averages over whole periods by itself.
    whole = "settle" in scene.run.model_fields_set
    with Evaluator(scene, whole_periods=whole, workers=workers) as bench:
        run(range(len(settings)), fidelity.simple or {})
        if fidelity.simple is not None:
            simple, known = dict(found), [n for n, turn in found.items() if not turn.failure]
            ends = (end(known, key=lambda n: _speed(simple[n])) for end in (min, max) if known)
            first = {0, *ends}
            run(first, {})
            if not all(fidelity.agrees(simple[n].v_average, found[n].v_average) for n in first):
                run([n for n in range(len(settings)) if n not in first], {})
    made = Spread([found[n] for n in sorted(found)])
    if not made.known:
        raise SimulationFailed(f"No setting could be run; the first one: {made.runs[0].failure}")
    return made


def _speed(run: Turned) -> float:
    assert run.v_average is not None
    return run.v_average


def turns(scene: Scene) -> list[Settings]:
    """The settings with one knob turned either way, without those beyond the end of its range.

    A knob that the scene gives as ``pot_…`` is turned by TURN of its whole turn. Amplitude,
    frequency and offset change by TURN of their values, an offset of 0 by TURN of the amplitude.
    Raises BadInput for a scene whose knobs move nothing.
    """
    if scene.has_ports:
        raise BadInput(f"{scene.origin}: --spread turns knobs of the built-in machine.")
    if not scene.rung.driven:
        words = f'circuit.model = "{scene.circuit.model}" has no knobs that --spread could turn.'
        raise scene.bad(words)
    found = []
    for knob, name in KNOBS.items():
        given = getattr(scene.drive, knob) is not None
        full = f"drive.{knob if given else name}"
        value = getattr(scene.drive, knob if given else name)
        size = TURN if given else TURN * abs(value)
        if name == "offset" and not size:
            size = TURN * scene.drive.amplitude
        for place in (value - size, value + size):
            if size and KEYS[full].holds(place):
                found.append({full: float(f"{place:.12g}")})  # a number that can be typed
    return found
