"""``cosim run``: the files that it writes, and numbers that can be found again from them."""

import json
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import numpy.typing as npt
import pytest
from matplotlib.image import imread

from cosim.cli.main import main
from cosim.mechanics import stickslip
from cosim.scene import Scene, load, to_toml
from cosim.simulation.simulate import simulate
from cosim.toolchain.processes import in_place

Array = npt.NDArray[np.float64]

FILES = {"scene.toml", "waveforms.csv", "waveforms.nc", "summary.json", "figure.png"}

ELECTRIC = ["command [V]", "current [A]", "coil_voltage [V]", "back_emf [V]"]
MECHANIC = [
    "z_surface [m]", "v_surface [m/s]", "a_surface [m/s2]", "z_ram [m]", "v_ram [m/s]",
    "z_part [m]", "v_part [m/s]", "friction_force [N]", "sticking [1]",
]  # fmt: skip

NUMBERS = [
    "v_average", "stick_fraction", "v_surface_max", "v_surface_min", "z_surface_pp",
    "energy_in", "energy_copper", "energy_friction", "energy_impact", "energy_damping",
    "energy_stored", "energy_residual", "wall_time",
]  # fmt: skip
COUNTS = [
    "impacts", "stick_slip_events", "at_wall", "circuit_steps", "circuit_rejected", "fmu_steps",
]  # fmt: skip
ACCELERATIONS = ["a_surface_max", "a_surface_min"]
CAMERA = ["a_camera_max", "a_camera_min"]
DRIVEN = ["transport_per_cycle", "current_max", "current_min", "saturated_fraction"]
LIMITS = {
    "amplifier": {"swing_high_fraction", "swing_low_fraction", "slew_fraction"},
    "limited": {"swing_high_fraction", "swing_low_fraction", "current_limit_fraction"},
    "full": {
        "swing_high_fraction",
        "swing_low_fraction",
        "current_limit_fraction",
        "slew_fraction",
    },
}
WORDS = ["method", "notes", "rests", "run", "versions"]
HEAT = {"coil_heat", "coil_rise_continuous", "coil_rise_lift"}
TOLD = {
    "v_average_error",
    "motion",
    "motion_periods",
    "motion_settled",
    "v_average_settled",
    "v_average_range",
}

RUNS = {
    "reference": ("reference", "run.duration=0.4", "run.settle=0.1"),
    # rows out of step with the staircase of 50 µs
    "full": (
        "reference",
        "circuit.model=full",
        "run.duration=0.15",
        "run.settle=0.06",
        "run.output_step=3e-5",
    ),
    "limited": ("reference", "circuit.model=limited", "run.duration=0.4", "run.settle=0.1"),
    "gripper": (
        *("reference", "coil.count=2", "mechanics.n_surfaces=2", "mechanics.part_mass=0.05"),
        *("drive.amplitude=10", "drive.offset=-2.5", "friction.normal_force=1.4"),
        *("run.duration=0.3", "run.settle=0.1"),
    ),
    "ideal": ("reference", "circuit.model=ideal", "run.duration=0.4", "run.settle=0.1"),
    "held": ("held", "run.duration=0.3", "run.settle=0.1"),
    "rigid": ("reference", "run.duration=0.3", "run.settle=0.1", "mechanics.contact=rigid"),
}


@dataclass
class Run:
    """What a command has written into its folder."""

    folder: Path

    @cached_property
    def scene(self) -> Scene:
        return load(self.folder / "scene.toml")

    @cached_property
    def summary(self) -> dict[str, Any]:
        def refuse(word: str) -> None:
            raise ValueError(f"{word} is not JSON")

        return json.loads((self.folder / "summary.json").read_text(), parse_constant=refuse)

    @cached_property
    def header(self) -> list[str]:
        with open(self.folder / "waveforms.csv", encoding="utf-8") as file:
            return file.readline().rstrip("\n").split(",")

    @cached_property
    def table(self) -> Array:
        return np.loadtxt(self.folder / "waveforms.csv", delimiter=",", skiprows=1)

    def __getitem__(self, name: str) -> Array:
        names = [column.split(" [")[0] for column in self.header]
        return self.table[:, names.index(name)]

    def after(self, name: str) -> Array:
        """A column after settling."""
        return self[name][self["time"] >= self.scene.run.settle - 1e-9]


def cosim_run(folder: Path, source: str, *overrides: str) -> Run:
    options = [word for override in overrides for word in ("--set", override)]
    assert main(["run", source, *options, "--out", str(folder)]) == 0
    return Run(folder)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Run]:
    folder = tmp_path_factory.mktemp("runs")
    return {name: cosim_run(folder / name, *what) for name, what in RUNS.items()}


@pytest.fixture(params=RUNS)
def run(request: pytest.FixtureRequest, runs: dict[str, Run]) -> Run:
    return runs[request.param]


def is_driven(run: Run) -> bool:
    return run.scene.circuit.model != "none"


# --- files -----------------------------------------------------------------------


def test_exactly_the_five_files(run: Run) -> None:
    assert {path.name for path in run.folder.iterdir()} == FILES
    modes = {path.stat().st_mode for path in run.folder.iterdir()}
    assert len(modes) == 1  # none kept the private mode of a temporary file


def test_csv(run: Run) -> None:
    assert run.header == ["time [s]", *(ELECTRIC if is_driven(run) else []), *MECHANIC]
    step, duration = run.scene.run.output_step, run.scene.run.duration
    assert run.table.shape == (round(duration / step) + 1, len(run.header))
    np.testing.assert_allclose(run["time"], step * np.arange(len(run.table)), rtol=0, atol=1e-12)
    assert np.isfinite(run.table).all()
    assert set(run["sticking"]) <= {0.0, 1.0}


def test_starts_at_rest(run: Run) -> None:
    assert run["z_part"][0] == run["z_surface"][0]
    for name in ("v_surface", "v_ram", "v_part"):
        assert run[name][0] == 0.0


def test_netcdf_holds_the_same(run: Run) -> None:
    with netCDF4.Dataset(run.folder / "waveforms.nc") as file:
        assert [f"{name} [{v.units}]" for name, v in file.variables.items()] == run.header
        for k, variable in enumerate(file.variables.values()):
            assert variable.dimensions == ("time",)
            assert variable.dtype == np.float64
            np.testing.assert_allclose(variable[:], run.table[:, k], rtol=6e-10, atol=0)
        assert file.scene == (run.folder / "scene.toml").read_text(encoding="utf-8")


def test_summary_has_every_key(run: Run) -> None:
    summary = run.summary
    none = set() if is_driven(run) else set(DRIVEN)
    if run.scene.mechanics.contact == "rigid":
        none |= set(ACCELERATIONS)
    for key in {*NUMBERS, *ACCELERATIONS, *CAMERA, *DRIVEN} - none:
        assert type(summary[key]) is float, key
        assert math.isfinite(summary[key]), key
    for key in none:
        assert summary.get(key) is None, key
    for key in COUNTS:
        assert type(summary[key]) is int, key
        assert summary[key] >= 0, key
    known = {*NUMBERS, *COUNTS, *ACCELERATIONS, *CAMERA, *DRIVEN, *WORDS}
    known |= {"slip_up", "slip_down", "slip_by_camera"} & set(summary)
    known |= {"slip_by_surface"} if summary.get("a_surface_min") is not None else set()
    assert HEAT & set(summary) == (HEAT if is_driven(run) else set())
    known |= HEAT
    limits = LIMITS.get(run.scene.circuit.model, set())
    assert set(summary) - known - TOLD == limits
    assert "v_average_error" in summary
    assert all(0.0 <= summary[limit] <= 1.0 for limit in limits)
    assert isinstance(summary["method"], str)
    assert summary["notes"] == []
    assert all(isinstance(version, str) for version in summary["versions"].values())
    assert ("ngspice" in summary["versions"]) == (summary["circuit_steps"] > 0)


@pytest.mark.checked
@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("name", RUNS)
def test_written_scene_repeats_the_run(name: str, runs: dict[str, Run], tmp_path: Path) -> None:
    again = cosim_run(tmp_path, str(runs[name].folder / "scene.toml"))
    for file in ("waveforms.csv", "waveforms.nc", "scene.toml"):
        assert (again.folder / file).read_bytes() == (runs[name].folder / file).read_bytes(), file
    assert again.summary | {"wall_time": 0} == runs[name].summary | {"wall_time": 0}


def test_written_scene_is_the_resolved_one(run: Run) -> None:
    text = (run.folder / "scene.toml").read_text(encoding="utf-8")
    assert to_toml(run.scene) == text


def test_figure_shows_something(run: Run) -> None:
    path = run.folder / "figure.png"
    assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    image = imread(path)
    height, width = image.shape[:2]
    assert height > 600 and width > 900
    pixels = (image[..., :3].reshape(-1, 3) * 255).astype(np.uint32) @ [1 << 16, 1 << 8, 1]
    assert len(np.unique(pixels)) > 100
    inked = (pixels != 0xFFFFFF).reshape(height, width)
    for half in np.array_split(inked, 2, axis=1):  # both columns of axes
        for third in np.array_split(half, 3, axis=0):
            assert third.mean() > 0.01


def test_overwrites_an_older_run(tmp_path: Path) -> None:
    quick = ("held", "run.duration=0.02")
    cosim_run(tmp_path, *quick, "run.output_step=1e-3")
    (tmp_path / ".probe").write_text("mine")
    again = cosim_run(tmp_path, *quick, "run.output_step=2e-3")
    assert len(again.table) == 11
    assert {path.name for path in tmp_path.iterdir()} == FILES | {".probe"}
    assert (tmp_path / ".probe").read_text() == "mine"


# --- numbers found again from the waveforms --------------------------------------


def test_averages(run: Run) -> None:
    summary, z_part = run.summary, run.after("z_part")
    span = run.scene.run.duration - run.scene.run.settle
    speed = (z_part[-1] - z_part[0]) / span
    assert summary["v_average"] == pytest.approx(speed, rel=1e-6, abs=1e-9)
    if is_driven(run):
        cycle = speed / run.scene.drive.frequency
        assert summary["transport_per_cycle"] == pytest.approx(cycle, rel=1e-6)
    assert summary["stick_fraction"] == pytest.approx(run.after("sticking").mean(), abs=0.01)


def test_extremes_of_the_surface(run: Run) -> None:
    summary = run.summary
    z, v, a = (run.after(name) for name in ("z_surface", "v_surface", "a_surface"))
    # Rows can only miss the true extremes.
    assert np.ptp(z) <= summary["z_surface_pp"] + 1e-9
    assert summary["z_surface_pp"] == pytest.approx(np.ptp(z), rel=5e-3, abs=1e-9)
    assert summary["v_surface_max"] >= v.max() - 1e-9
    assert summary["v_surface_max"] == pytest.approx(v.max(), rel=0.05, abs=1e-9)
    assert summary["v_surface_min"] <= v.min() + 1e-9
    assert summary["v_surface_min"] == pytest.approx(v.min(), rel=0.05, abs=1e-9)
    if run.scene.mechanics.contact == "compliant":
        assert summary["a_surface_max"] >= a.max() - 1e-6
        assert summary["a_surface_min"] <= a.min() + 1e-6


def test_extremes_begin_where_settling_ends() -> None:
    """Where that is a jump of the drive, too, rounding may put it a little before; and with rows
    far apart the whole start from rest lies within the step that ends there."""
    period = 1.0 / 6.353326
    for periods in (3, 6, 7):
        settle = periods * period
        drive = {
            "drive.frequency": 6.353326,
            "drive.amplitude": 3.922137,
            "drive.offset": -1.570811,
        }
        times = {"run.settle": settle, "run.duration": settle + 0.02}
        model = {"circuit.model": "limited", **drive, **times}
        dense = simulate(load("paper", model | {"run.output_step": 2e-5}))
        coarse = simulate(load("paper", model | {"run.output_step": settle / 1.5}))
        late = dense.columns["time"] > settle
        for name in ("a_surface", "v_surface"):
            after = dense.columns[name][late]
            for end, extreme in (("min", after.min()), ("max", after.max())):
                found = coarse.summary[f"{name}_{end}"]
                assert found == pytest.approx(extreme, rel=0.02), (periods, name, end)


LIVELY = {
    "coil.force_factor": 1.49595, "mechanics.surface_mass": 0.0283171,
    "mechanics.flexure_stiffness": 402.739, "mechanics.flexure_damping": 0.105917,
    "mechanics.suspension_k1": 185.839, "mechanics.suspension_k2": -236781.0,
    "mechanics.suspension_k3": 42359200.0, "mechanics.suspension_damping": 0.00155496,
    "mechanics.travel": 0.00282302, "mechanics.contact_stiffness": 536436.0,
    "mechanics.contact_damping": 0.912818, "friction.mu_plate": 0.258116,
    "friction.mu_k": 0.682407, "circuit.swing_loss_high": 0.0, "circuit.swing_loss_low": 0.0,
    "run.settle": 0.1, "run.duration": 1.0,
}  # fmt: skip
"""A rig whose ram touches its walls often and hardly loses energy there."""


@pytest.mark.parametrize("model", ["limited", "ideal"])
def test_what_is_read_within_a_step_is_that_of_its_steps(model: str) -> None:
    """Camera frames and extremes with rows so close that they end on most steps, and with hardly
    any. A step that ends a touch goes on a little past its end, where the wall's clock runs back.
    """
    for amplitude, frequency, offset in (
        *((7.477249, 31.621888, 0.503949), (9.212792, 26.273809, 2.740017)),
        *((5.983746, 46.23805, -1.4175), (4.0, 60.0, -1.0)),
    ):
        drive = {
            "drive.amplitude": amplitude, "drive.frequency": frequency, "drive.offset": offset,
        }  # fmt: skip
        both = [
            simulate(load("paper", {**LIVELY, **drive, "circuit.model": model, **rows})).summary
            for rows in ({"run.output_step": 2e-6}, {"run.output_step": 0.5})
        ]
        for name in ("a_camera_min", "a_camera_max", "a_surface_min", "v_surface_max"):
            assert both[1][name] == pytest.approx(both[0][name], rel=1e-3), (name, drive)


def parabolas(heights: Array) -> Array:
    """Second derivatives of the least-squares parabolas through five frames each, by SciPy."""
    from scipy.signal import savgol_filter  # takes a second, and only this test needs it

    return np.asarray(savgol_filter(heights, 5, 2, deriv=2, delta=1 / 960)[2:-2])


def test_acceleration_as_a_camera_reads_it(run: Run) -> None:
    settings, time = run.scene.run, run["time"]
    first, last = math.ceil(settings.settle * 960 - 1e-9), int(settings.duration * 960 + 1e-9)
    frames = np.arange(first, last + 1) / 960
    # Cubic through the heights and velocities at both ends of a row's interval.
    k = np.clip(np.searchsorted(time, frames, side="right") - 1, 0, len(time) - 2)
    z, v, h = run["z_surface"], run["v_surface"], time[k + 1] - time[k]
    s = (frames - time[k]) / h
    heights = (
        (1 + 2 * s) * (1 - s) ** 2 * z[k]
        + s**2 * (3 - 2 * s) * z[k + 1]
        + h * s * (1 - s) * ((1 - s) * v[k] - s * v[k + 1])
    )
    read = parabolas(heights)
    assert run.summary["a_camera_max"] == pytest.approx(read.max(), rel=0.01, abs=0.5)
    assert run.summary["a_camera_min"] == pytest.approx(read.min(), rel=0.01, abs=0.5)


def test_a_shutter_shows_the_mean_of_its_exposure(tmp_path: Path) -> None:
    """Against the mean of rows far denser than what the camera takes of a run with impacts."""
    dense, shutter = 200, 0.75
    scene = ("reference", "circuit.model=ideal", "run.duration=0.2", "run.settle=0.05")
    rows = f"run.output_step={1 / (960 * dense)!r}"
    sharp = cosim_run(tmp_path / "sharp", *scene, rows)
    blurred = cosim_run(tmp_path / "blurred", *scene, f"run.shutter={shutter}")
    z, half = sharp["z_surface"], round(dense * shutter / 2)
    frames = range(math.ceil((0.05 * 960 * dense + half) / dense), (len(z) - half - 1) // dense + 1)
    means = [np.trapezoid(z[dense * k - half : dense * k + half + 1]) / (2 * half) for k in frames]
    for name, extreme in (("max", np.max), ("min", np.min)):
        found = blurred.summary[f"a_camera_{name}"]
        assert found == pytest.approx(extreme(parabolas(np.array(means))), rel=1e-3)
    # The drop is blurred: it reads less steep.
    assert blurred.summary["a_camera_min"] > 0.995 * sharp.summary["a_camera_min"]
    assert blurred.summary["v_average"] == pytest.approx(sharp.summary["v_average"], rel=1e-6)


def test_current_and_energy(run: Run) -> None:
    if not is_driven(run):
        assert run.summary["energy_in"] == run.summary["energy_copper"] == 0.0
        return
    summary, count = run.summary, run.scene.coil.count
    # The summary sees every step of the circuit, the rows only some.
    highest, lowest = run.after("current").max(), run.after("current").min()
    assert highest - 1e-9 <= summary["current_max"] <= highest + 2e-2
    assert lowest - 2e-2 <= summary["current_min"] <= lowest + 1e-9
    assert 0.0 <= summary["saturated_fraction"] <= 1.0
    total = count * run["current"]
    sense = run.scene.circuit.sense_resistance * total**2
    power = run["coil_voltage"] * total + sense
    assert summary["energy_in"] == pytest.approx(np.trapezoid(power, run["time"]), rel=0.01)
    heat = sense + count * run.scene.coil.resistance * run["current"] ** 2
    assert summary["energy_copper"] == pytest.approx(np.trapezoid(heat, run["time"]), rel=0.01)


def test_energy_balances(run: Run) -> None:
    summary = run.summary
    assert summary["energy_residual"] < 1e-4
    spent = sum(summary[f"energy_{kind}"] for kind in ("copper", "friction", "impact", "damping"))
    assert spent <= summary["energy_in"] * (1 + 1e-4) + 1e-12


def test_back_emf_is_that_of_the_ram_in_its_actuator(run: Run) -> None:
    if is_driven(run):
        moved = run["v_ram"] - run["v_surface"]
        emf = run.scene.coil.force_factor * moved
        np.testing.assert_allclose(run["back_emf"], emf, rtol=0, atol=1e-9)


def test_undriven_part_hangs_still(runs: dict[str, Run]) -> None:
    held = runs["held"]
    assert np.ptp(held["z_part"]) < 1e-10  # m; what mechanics.tolerance allows
    assert held.summary["stick_fraction"] == 1.0
    assert held.summary["impacts"] == held.summary["stick_slip_events"] == 0
    weight = held.scene.mechanics.part_mass * held.scene.mechanics.gravity
    # The flexures' force is as exact as the height is: some 1e-8 mm at the default tolerance.
    np.testing.assert_allclose(held["friction_force"], weight, rtol=1e-7)


# --- whole runs against each other -----------------------------------------------


@pytest.mark.parametrize("model", ["amplifier", "limited"])
def test_both_fmi_versions_agree(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = load("reference", ["run.duration=0.12", f"circuit.model={model}"])
    third = simulate(scene)
    monkeypatch.setattr(stickslip, "FMI", 2)
    with in_place():
        second = simulate(scene)
    for name, values in third.columns.items():
        np.testing.assert_allclose(second.columns[name], values, rtol=1e-12, atol=1e-12)
    assert second.summary["v_average"] == pytest.approx(third.summary["v_average"], rel=1e-12)


def test_two_coils_on_two_surfaces_are_one_twice() -> None:
    """At half the sense resistor and twice the part, each actuator sees what a single one does."""
    short = ["run.duration=0.15", "run.settle=0.05", "circuit.reltol=1e-5", "circuit.max_step=2e-5"]
    one = simulate(load("reference", short))
    twice = [
        "coil.count=2", "mechanics.n_surfaces=2", "mechanics.part_mass=0.018",
        "circuit.sense_resistance=2",
    ]  # fmt: skip
    two = simulate(load("reference", short + twice))
    # The circuits' steps differ, and what ngspice has lies between them: 2e-3 from finer runs.
    within = {"current": 3e-3, "coil_voltage": 3e-3}
    for name in ("current", "coil_voltage", "z_surface", "z_ram", "z_part", "friction_force"):
        scale = np.abs(one.columns[name]).max()
        np.testing.assert_allclose(
            two.columns[name] / scale,
            one.columns[name] / scale,
            rtol=0,
            atol=within.get(name, 1e-3),
        )
    for name in ("energy_in", "energy_copper", "energy_friction", "energy_damping"):
        assert two.summary[name] == pytest.approx(2 * float(one.summary[name]), rel=1e-3)  # type: ignore
    assert two.summary["energy_residual"] < 1e-4  # type: ignore


@pytest.mark.parametrize("model", ["ideal", "limited", "amplifier"])
@pytest.mark.parametrize(
    "changes",
    [
        ("coil.eddy_inductance=1e-3", "coil.eddy_resistance=5"),
        ("coil.eddy_inductance=2e-4", "coil.eddy_resistance=50", "coil.count=2"),
        ("drive.waveform=sine",),
        ("drive.waveform=square", "drive.amplitude=4"),
        ("drive.reset_time=2e-3",),
        ("drive.quantised=true",),
        ("coil.b1=50", "coil.b2=-1e4"),
        ("friction.mu_plate=0.05",),
    ],
    ids=lambda changes: ",".join(changes) if isinstance(changes, tuple) else None,
)
def test_energy_balances_with_other_coils_and_commands(
    model: str, changes: tuple[str, ...]
) -> None:
    scene = load("reference", ["run.duration=0.12", f"circuit.model={model}", *changes])
    # Of each small step of the staircase ngspice sees the first microsecond roughly.
    rough = 3e-4 if scene.drive.quantised else 1e-4
    allowed = {"ideal": 1e-6, "limited": 1e-9, "amplifier": rough}[model]
    assert simulate(scene).summary["energy_residual"] < allowed  # type: ignore


def test_sine_command() -> None:
    scene = load("reference", ["run.duration=0.12", "drive.waveform=sine", "drive.amplitude=6"])
    waves = simulate(scene).columns
    time = waves["time"][1:]
    expected = -1.2 + 3.0 * np.sin(2 * np.pi * 20 * time)
    np.testing.assert_allclose(waves["command"][1:], expected, rtol=0, atol=1e-5)
    late = time > 0.01  # the amplifier lags by its loop's small phase only
    np.testing.assert_allclose(waves["current"][1:][late], expected[late] / 4, atol=5e-3)


def test_square_command() -> None:
    changes = ["run.duration=0.12", "drive.waveform=square", "drive.amplitude=4"]
    waves = simulate(load("reference", changes)).columns
    phase = waves["time"] * 20 % 1
    near = np.minimum(phase, np.minimum(np.abs(phase - 0.5), 1 - phase)) < 0.02
    expected = np.where(phase < 0.5, 0.8, -3.2)
    np.testing.assert_allclose(waves["command"][~near], expected[~near], atol=1e-9)
    settled = np.minimum(phase % 0.5, 0.5) > 0.1  # 5 ms after each edge
    np.testing.assert_allclose(waves["current"][settled], expected[settled] / 4, atol=5e-3)


def test_finer_circuit_gives_the_same_average() -> None:
    short = ["run.duration=0.8", "run.settle=0.4"]
    usual = simulate(load("reference", short))
    circuit = usual.scene.circuit
    fine = [f"circuit.max_step={circuit.max_step / 4}", f"circuit.reltol={circuit.reltol / 10}"]
    finer = simulate(load("reference", short + fine))
    assert finer.summary["circuit_steps"] > 1.5 * usual.summary["circuit_steps"]  # type: ignore
    expected = pytest.approx(finer.summary["v_average"], rel=1e-3)
    assert usual.summary["v_average"] == expected


@pytest.mark.parametrize("method", ["jacobi", "mean-current", "companion"])
def test_macro_steps_end_with_the_run(method: str) -> None:
    """Also where that is in the midst of a macro step."""
    overrides = ["drive.frequency=33", "run.duration=0.3", "run.output_step=1e-3"]
    overrides += [f"coupling.method={method}", "coupling.macro_step=2e-4"]
    result = simulate(
        load("reference", [*overrides, "circuit.reltol=1e-3", "circuit.max_step=1e-4"])
    )
    assert result.columns["time"][-1] == pytest.approx(0.3)
    assert len(result.columns["time"]) == 301


def test_progress_goes_from_start_to_end() -> None:
    told: list[float] = []
    simulate(load("reference", ["run.duration=0.02"]), progress=told.append)
    assert told[0] == 0.0
    assert told[-1] == pytest.approx(0.02, rel=1e-9)
    assert told == sorted(told)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        # The part falls past a surface at rest.
        (
            "optimal",
            ("drive.waveform=sine", "drive.velocity_amplitude=0", "friction.normal_force=0"),
        ),
        # All hangs so lightly that the bodies move within the solver's tolerances.
        ("held", ("mechanics.gravity=1e-9", "mechanics.suspension_k1=10000")),
        ("ideal-current", ("drive.amplitude=0", "drive.offset=0", "mechanics.gravity=0")),
        # Let go without weight and damping: the lift's energy goes to and fro.
        (
            "held",
            (
                *("mechanics.initial_lift=1e-4", "mechanics.gravity=0", "friction.normal_force=0"),
                *("mechanics.flexure_damping=0", "mechanics.suspension_damping=0"),
            ),
        ),
    ],
)
def test_no_energy_is_missing_at_rest(name: str, changes: tuple[str, ...]) -> None:
    scene = load(name, ["run.duration=0.05", "run.settle=0.01", *changes])
    assert simulate(scene).summary["energy_residual"] < 1e-5  # type: ignore
