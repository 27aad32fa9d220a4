"""Runs a scene with each knob turned a little, on the cheapest circuit that suffices."""

import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from cosim.errors import BadInput, SimulationFailed
from cosim.evaluate.evaluator import Evaluator
from cosim.scene import Scene, changed, keys, load
from cosim.scene.loading import Overrides
from cosim.scene.tables import KNOBS
from cosim.simulation.choose_rung import WITHOUT_NGSPICE, relative_error, without_ngspice
from cosim.waveforms.quantities import with_unit

UNITS = {key.full: key.unit for key in keys()}

TURN = 0.01
"""Of a knob's whole turn, or of the value that a scene gives instead of it."""

Settings = dict[str, float]
"""Values of keys, ``table.key``, SI."""


@dataclass(frozen=True)
class Turned:
    """A run with ``settings`` on top of the scene's own; without any, the scene as it is."""

    settings: Settings
    circuit_model: str
    """Which circuit was run."""
    v_average: float | None
    """m/s; None where the run failed."""
    failure: str = ""
    """Why it failed."""

    def __str__(self) -> str:
        named = (f"{k} = {with_unit(v, UNITS[k])}" for k, v in self.settings.items())
        return ", ".join(named) or "the scene's own setting"


@dataclass(frozen=True)
class Spread:
    """What a small turn of each knob makes of v_average; ``runs`` begin with the scene itself."""

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
        rows = [
            (f"with a knob ±{TURN * 100:g} %", f"{low:+.3f} … {high:+.3f} mm/s"),
            ("  slowest at", str(self.least)),
            ("  fastest at", str(self.most)),
            *(("  failed at", f"{run}: {run.failure}") for run in self.runs if run.failure),
        ]
        return "\n".join(f"  {name:<24}{value}" for name, value in rows)


def spread(
    scene: Scene | str | os.PathLike[str],
    overrides: Overrides | None = None,
    *,
    workers: int | None = None,
    progress: Callable[[int], None] = lambda runs: None,
) -> Spread:
    """Run a scene as it is and with each of the three knobs turned a hundredth either way.

    The runs last whole periods, at least as long as the scene's own. Where ngspice solves its
    circuit, all are made without it first, on the rung "limited"; the scene itself and the two
    ends are then run as they are. Where one of these is off by more than ``run.tolerance``, so are
    the others. (The rung "ideal" is hardly cheaper, and blind to what the limits of the amplifier
    do at a turn's other end.) ``workers`` processes, by default one for each processor;
    ``progress`` is told the runs done.

    Raises BadInput for a scene without knobs, SimulationFailed where every run failed.

    >>> found = spread("ideal-current", {"run.duration": 0.1})
    >>> found.least.v_average <= found.runs[0].v_average <= found.most.v_average
    True
    """
    scene = load(scene, overrides)
    every: list[Settings] = [{}, *turns(scene)]
    done = 0

    def run(numbers: Iterable[int], circuit: Mapping[str, str | bool]) -> dict[int, Turned]:
        nonlocal done
        found: dict[int, Turned] = {}
        points: dict[int, dict[str, float | str]] = {}
        model = str(circuit.get("circuit.model", scene.circuit.model))
        for n in numbers:
            try:
                changed(scene, {**every[n], **circuit}, "--spread")
            except BadInput as error:
                found[n] = Turned(every[n], model, None, str(error))
            else:
                points[n] = {**every[n], **circuit}
        for n, outcome in bench.run(points.items()):
            value = None if outcome.failure else outcome.numbers["v_average"]
            found[n] = Turned(every[n], model, value, outcome.failure)
            done += 1
            progress(done)
        return found

    numbers = set(range(len(every)))
    with Evaluator(scene, whole_periods=True, workers=workers) as bench:
        if without_ngspice(scene) is None:
            found = run(numbers, {})
        else:
            found = run(numbers, WITHOUT_NGSPICE)
            known = [n for n, one in found.items() if one.v_average is not None]
            ends = {0, *(end(known, key=lambda n: _speed(found[n])) for end in (min, max) if known)}
            exact = run(ends, {})
            if any(_off(found[n], exact[n]) > scene.run.tolerance for n in ends):
                exact |= run(numbers - ends, {})
            found |= exact
    made = Spread([found[n] for n in sorted(found)])
    if not made.known:
        raise SimulationFailed(f"No setting could be run; the first one: {made.runs[0].failure}")
    return made


def _speed(run: Turned) -> float:
    assert run.v_average is not None
    return run.v_average


def _off(simple: Turned, exact: Turned) -> float:
    """Relative error of the simpler circuit's v_average; without bound where either failed."""
    if simple.v_average is None or exact.v_average is None:
        return float("inf")
    return relative_error(simple.v_average, exact.v_average)


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
