"""A run and a tracked trial side by side, as a user asks for it."""

import os
from dataclasses import asdict, dataclass
from pathlib import Path

from cosim.arrays import Array
from cosim.errors import BadInput, plain
from cosim.files.atomic import write_json, write_text
from cosim.files.picture import Picture
from cosim.scene import Scene, load
from cosim.scene.loading import Overrides
from cosim.simulation.rungs.given_surface import surface
from cosim.simulation.simulate import simulate
from cosim.studies.compare.compare import CameraError, Metrics, camera_error, made_of, measure
from cosim.trials.camera import FRAME_RATE, Frames
from cosim.trials.tracked import Trial, read
from cosim.waveforms.figure import PART, SURFACE
from cosim.waveforms.formats.tracker import laid_over
from cosim.waveforms.result import Result
from cosim.waveforms.storage import read_csv, write_csv


@dataclass(frozen=True, eq=False)
class Comparison:
    """A run laid over a trial: ``metrics``, and what the camera sees of both, frame by frame, SI.

    ``camera`` is the camera's own error, where the trial was made of this run.
    """

    run: str
    trial: str
    metrics: Metrics
    simulated: Frames
    measured: Frames
    camera: CameraError | None

    @property
    def numbers(self) -> dict[str, float | None]:
        """The metrics, and the camera's error, by name."""
        return asdict(self.metrics) | (asdict(self.camera) if self.camera else {})

    def plot(self) -> Picture:
        """Heights and velocities of surface and part, simulated and measured."""
        metrics, figure = self.metrics, Picture(13.0, 7.2, "constrained")
        axes = figure.subplots(2, 2, sharex=True)
        dots = {"color": "0.25", "lw": 0.0, "marker": ".", "ms": 3.0, "label": "measured"}
        for column, (body, color) in enumerate((("surface", SURFACE), ("part", PART))):
            line = {"color": color, "lw": 1.4, "label": "simulated"}
            for row, (kind, name) in enumerate((("z", "height"), ("v", "velocity"))):
                axis = axes[row, column]
                for frames, style in ((self.measured, dots), (self.simulated, line)):
                    values = getattr(frames, f"{kind}_{body}")
                    first = values[0] if kind == "z" else 0.0
                    axis.plot(frames.time * 1e3, (values - first) * 1e3, **style)
                axis.grid(alpha=0.25)
                axis.set_ylabel(f"{name} of the {body} [{'mm' if kind == 'z' else 'mm/s'}]")
            axes[1, column].set_xlabel("time [ms]")
        for axis, words in (
            (
                axes[0, 0],
                f"velocity R² {metrics.velocity_r2:.2f}; largest change from frame to frame "
                f"{metrics.kick_simulated * 1e3:.0f} mm/s "
                f"(measured {metrics.kick_measured * 1e3:.0f})",
            ),
            (
                axes[0, 1],
                f"mean error {metrics.mean_error_mm:.3f} mm ({metrics.mean_error_percent:.1f} %); "
                f"drift {metrics.drift_simulated * 1e3:+.1f} mm/s "
                f"(measured {metrics.drift_measured * 1e3:+.1f})",
            ),
        ):
            axis.set_title(words, fontsize=10, loc="left")
        axes[0, 1].legend(loc="upper left", fontsize=8)
        figure.suptitle(f"{self.run} against {self.trial}", fontsize=12)
        return figure

    def save(self, folder: str | os.PathLike[str]) -> None:
        """Write ``compare.json``, ``compare.csv``, ``frames.csv`` and ``compare.png``."""
        out, numbers = Path(folder), self.numbers
        write_json(out / "compare.json", {"run": self.run, "trial": self.trial, **numbers})
        rows = "".join(f"{name},{value!r}\n" for name, value in numbers.items())
        write_text(out / "compare.csv", f"metric,value\n{rows}")
        table = {"time": self.simulated.time}
        for side in ("measured", "simulated"):
            for name in ("z_surface", "v_surface", "z_part", "v_part"):
                table[f"{name}_{side}"] = getattr(getattr(self, side), name)
        units = {"t": "s", "z": "m", "v": "m/s"}
        write_csv(out / "frames.csv", table, {name: units[name[0]] for name in table})
        self.plot().write(out / "compare.png")

    def __repr__(self) -> str:
        width = max(map(len, self.numbers))
        lines = [
            f"  {name:<{width}}  {'not tracked' if value is None else f'{value:.6g}'}"
            for name, value in self.numbers.items()
        ]
        if self.camera:
            lines.append(
                "This trial is the run's own. Both sides went through the same camera: "
                "mean_error_mm is what the digits of the file make, and camera_… is the error that "
                "the camera alone makes, the run's rows against straight lines between the frames."
            )
        return "\n".join(lines)


def compare(
    run: Result | Scene | str | os.PathLike[str],
    trial: str | os.PathLike[str],
    overrides: Overrides | None = None,
) -> Comparison:
    """Compare a run with a tracked trial (a CSV), both through the trial's camera.

    ``run`` is a result, a folder that ``Result.save`` wrote, or a scene, which is then run, with
    ``overrides`` for its keys, long enough to cover the trial. Where in its period the run meets
    the trial's first frame is chosen so that the surfaces' velocities agree best.

    Raises BadInput for files that cannot be read, and for a run that is too short.
    """
    measured = read(Path(trial))
    name, waveforms, scene = _run(run, overrides, measured)
    start, period = laid_over(scene)
    shutter = scene.run.shutter
    metrics, simulated, frames = measure(waveforms, measured, start, period, shutter)
    own = made_of(waveforms, measured, start, shutter)
    camera = camera_error(waveforms, measured, start) if own else None
    return Comparison(name, measured.name, metrics, simulated, frames, camera)


def _run(
    run: Result | Scene | str | os.PathLike[str], overrides: Overrides | None, trial: Trial
) -> tuple[str, dict[str, Array], Scene]:
    """The run's name, its waveforms and its scene."""
    folder = None if isinstance(run, Result | Scene) else Path(run)
    if isinstance(run, Result) or (folder and folder.is_dir()):
        name = run.scene.name if isinstance(run, Result) else str(run)
        if overrides:
            raise BadInput(f"--set cannot change {plain(name)}, which is a finished run.")
        if isinstance(run, Result):
            return name, run.columns, run.scene
        return name, read_csv(Path(name) / "waveforms.csv"), load(Path(name) / "scene.toml")
    name = run.name if isinstance(run, Scene) else str(run)
    scene = load(run, overrides)
    span = len(trial.time) / FRAME_RATE + 1.0 / scene.drive.frequency
    longer = {"duration": max(scene.run.duration, scene.run.settle + span)}
    if scene.drive.waveform == "file":
        longer = {"duration": float(surface(scene).times[-1]), "settle": 0.0}
    scene = scene.model_copy(update={"run": scene.run.model_copy(update=longer)})
    return name, simulate(scene).columns, scene
