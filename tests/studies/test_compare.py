"""cosim compare, on made-up recordings whose answer is known, and on the published trials."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import cosim
from cosim.cli.main import main
from cosim.studies.compare.scores import both_sides, explained
from cosim.trials import camera
from cosim.trials.camera import FRAME_RATE, frame_times, hermite, velocities
from cosim.trials.periods import drift, one_period_later, period_of
from cosim.trials.recording import Recording, read_recording

Array = npt.NDArray[np.float64]
MM = 1e3


def write(path: Path, header: str, *columns: Array) -> Path:
    rows = [",".join(f"{x!r}" for x in row) for row in np.array(columns).T.tolist()]
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def run() -> cosim.Result:
    """A run that repeats, with impacts, at 20 Hz."""
    return cosim.run(
        "reference", {"circuit.model": "ideal", "run.duration": 0.8, "run.settle": 0.3}
    )


def compare(run: cosim.Result, recording: Path) -> dict[str, float]:
    """The numbers of a comparison, NaN where there is none."""
    numbers = cosim.compare(run, recording).numbers
    return {name: np.nan if value is None else value for name, value in numbers.items()}


def heights(run: cosim.Result, time: Array, name: str) -> Array:
    """Heights that a recording of the run has, m."""
    at = 0.3125 + time
    return hermite(at, *(run.columns[column] for column in ("time", f"z_{name}", f"v_{name}")))


# --- times -------------------------------------------------------------------


@pytest.mark.parametrize("rate", [500.0, 960.0, 2000.0, None])
def test_a_run_is_found_in_its_own_recording_at_any_rate(
    rate: float | None, run: cosim.Result, tmp_path: Path
) -> None:
    """None: rows that lie unevenly, 0.5 to 1.5 ms apart."""
    steps = np.random.default_rng(1).uniform(0.5e-3, 1.5e-3, 300)
    time = np.arange(0.0, 0.3, 1 / rate) if rate else np.cumsum(steps) - steps[0]
    z = (MM * heights(run, time, body) for body in ("surface", "part"))
    trial = write(tmp_path / "own.csv", "t [s],zp [mm],zo [mm]", time, *z)
    numbers = compare(run, trial)
    assert numbers["start"] == pytest.approx(0.3125, abs=3e-6)
    assert numbers["velocity_r2"] == pytest.approx(1.0, abs=1e-5)
    assert numbers["mean_error_mm"] == pytest.approx(0.0, abs=1e-3)
    assert numbers["rate"] == pytest.approx(1 / np.median(np.diff(time)))
    assert numbers["frequency_measured"] == pytest.approx(20.0, rel=2e-3)
    assert numbers["frequency_simulated"] == pytest.approx(20.0)


def test_without_times_the_rate_of_the_published_trials_is_told(
    run: cosim.Result, tmp_path: Path
) -> None:
    time = np.arange(300) / FRAME_RATE
    z = MM * heights(run, time, "surface")
    timed, untimed = (
        cosim.compare(run, write(tmp_path / "a.csv", header, *columns))
        for header, columns in (("time [s],surface [mm]", (time, z)), ("surface [mm]", (z,)))
    )
    assert untimed.numbers == timed.numbers
    assert "No time column: read at 960 frames/s" in repr(untimed)
    assert "No time column" not in repr(timed)


# --- periods and drift --------------------------------------------------------


@pytest.mark.parametrize("frequency", [9.82, 20.2, 50.8])
def test_the_period_of_a_sharp_signal_with_noise(frequency: float) -> None:
    random = np.random.default_rng(3)
    time = np.sort(random.uniform(0.0, 0.325, 312))
    phase = 2 * np.pi * frequency * time
    v = np.where(np.sin(phase) > 0.8, 1.0, 0.2 * np.sin(6 * phase)) + random.normal(0, 0.05, 312)
    v[[0, 40]] = np.nan
    period = period_of(time, v)
    assert period and 1 / period == pytest.approx(frequency, rel=3e-3)


@pytest.mark.parametrize("every", [2, 4, 8])
def test_the_period_of_a_trial_with_fewer_frames(every: int, trials: Path) -> None:
    """480, 240 and 120 frames/s: what all 960 tell, though the hint is 3 % off."""
    for path in sorted(trials.glob("Trial*.csv")):
        found = read_recording(path)
        period = period_of(found.time, found.signals["v_surface"])
        time, z = found.time[::every], found.signals["z_surface"][::every]
        assert period
        fewer = period_of(time, velocities(time, z), 1.03 * period)
        assert fewer == pytest.approx(period, rel=0.03), path.name


def test_what_does_not_repeat_has_no_period() -> None:
    random = np.random.default_rng(3)
    time = np.arange(400) / FRAME_RATE
    for values in (random.normal(size=400), time, np.exp(-30 * time), np.sin(10 * time)):
        assert period_of(time, values) is None


@pytest.mark.parametrize("periods", [1.3, 3.2, 7.6])
@pytest.mark.parametrize("uneven", [False, True])
def test_drift_is_that_of_whole_periods(periods: float, uneven: bool) -> None:
    period, velocity = 0.05, 1e-3
    time = np.linspace(0.0, periods * period, 600)
    if uneven:
        time += 2e-5 * np.sin(np.arange(600))
    z = velocity * time + 4e-4 * np.sin(2 * np.pi * time / period + 2.0)
    assert drift(time, z, period) == pytest.approx(velocity, rel=5e-3)
    ends = (z[-1] - z[0]) / (time[-1] - time[0])
    assert abs(ends - velocity) > 0.5 * velocity  # what a broken period makes of it
    assert drift(time, z, None) == drift(time, z, 10.0) == pytest.approx(ends)


def test_drift_of_a_recording_of_just_one_period() -> None:
    """A found period may be longer than the recording, within what its search resolves."""
    time = np.arange(961) / 960.0
    z = 0.2 * time + 1e-3 * np.sin(2.0 * np.pi * time)
    for off in (-5e-7, 0.0, 5e-7):
        assert drift(time, z, 1.0 + off) == pytest.approx(0.2, rel=1e-5)


@pytest.mark.parametrize(
    ("number", "frequency", "offset", "force"), [(1, 9.82, 1.0, 0.979), (3, 9.72, 2.6, 0.466)]
)
def test_drift_of_trials_with_few_periods(
    number: int, frequency: float, offset: float, force: float, trials: Path
) -> None:
    """Trials of 3.2 and 2.6 periods: the run drifts by its own mean velocity, and the frequencies
    are those that were found in the trials before.
    """
    whole = {"run.settle": 1.0, "run.duration": 1.0 + 9 / frequency}
    drive = {"drive.frequency": frequency, "drive.amplitude": 7.4, "drive.offset": offset}
    found = cosim.run("reference", whole | drive | {"friction.normal_force": force})
    compared = cosim.compare(found, trials / f"Trial #{number}.csv")
    numbers = compared.numbers
    assert numbers["drift_simulated"] == pytest.approx(found.summary["v_average"], abs=5e-5)
    assert numbers["frequency_measured"] == pytest.approx(frequency, abs=0.05)
    assert (numbers["drift_measured"] or 0.0) > 0
    assert "frequencies differ" not in repr(compared)


def test_frequencies_that_differ_are_told(run: cosim.Result, tmp_path: Path) -> None:
    time = np.arange(300) / FRAME_RATE
    slower = write(
        tmp_path / "a.csv", "time [s],surface [mm]", time, MM * heights(run, 0.9 * time, "surface")
    )
    compared = cosim.compare(run, slower)
    assert compared.numbers["frequency_measured"] == pytest.approx(18.0, rel=2e-3)
    assert compared.numbers["frequency_simulated"] == 20.0
    told = "the recording repeats at 18 Hz, the run is driven at 20 Hz (drive.frequency)"
    assert told in repr(compared)


def test_motion_that_repeats_after_two_periods_is_driven_alike(
    run: cosim.Result, tmp_path: Path
) -> None:
    """A subharmonic, as of every second impact, is at half of the drive's frequency, not apart."""
    time = np.arange(400) / 1000.0
    z = MM * heights(run, time, "surface") + 0.8 * np.sin(2 * np.pi * 10.0 * time)
    compared = cosim.compare(run, write(tmp_path / "a.csv", "time [s],surface [mm]", time, z))
    assert compared.numbers["frequency_measured"] == pytest.approx(10.0, rel=2e-3)
    said = " ".join(compared.found.notes)
    assert "frequencies differ" not in said
    assert "repeats at 10 Hz, after 2 periods of the run's drive" in said


# --- scores -------------------------------------------------------------------


@pytest.mark.parametrize("ends", [(0, 0), (40, 0), (120, 0), (0, 120), (120, 120)])
def test_a_camera_that_runs_before_the_drive_or_after_it(
    ends: tuple[int, int], run: cosim.Result, tmp_path: Path
) -> None:
    """Of a run at 20 Hz in frames 1 ms apart: rests of more than a period are told."""
    time = np.arange(250) / 1000.0
    z = (np.pad(MM * heights(run, time, body), ends, "edge") for body in ("surface", "part"))
    times = np.arange(250 + sum(ends)) / 1000.0
    trial = write(tmp_path / "late.csv", "time [s],surface [mm],part [mm]", times, *z)
    notes = " ".join(cosim.compare(run, trial).found.notes)
    told = [f"rests in its {end} 0.1" in notes for end in ("first", "last")]
    assert told == [rows == 120 for rows in ends] and notes.count("rests") == sum(told)
    table = np.loadtxt(trial, delimiter=",", skiprows=1)
    table[table[:, 1] == table[0, 1], 1] = table[table[:, 1] == table[-1, 1], 1] = np.nan
    write(trial, "time [s],surface [mm],part [mm]", *table.T)
    assert "rests" not in " ".join(cosim.compare(run, trial).found.notes)  # but was not seen


def test_a_known_difference(run: cosim.Result, tmp_path: Path) -> None:
    time = np.arange(300) / FRAME_RATE
    surface, part = (heights(run, time, body) for body in ("surface", "part"))
    trial = write(
        tmp_path / "a.csv", "t [s],zp [mm],zo [mm]", time, MM * surface, MM * (part - 2e-3 * time)
    )
    numbers = compare(run, trial)
    assert numbers["drift_error"] == pytest.approx(2e-3, abs=1e-5)
    assert numbers["drift_simulated"] == pytest.approx(run.summary["v_average"], rel=2e-3)
    assert numbers["mean_error_mm"] == pytest.approx(2.0 * time[-1] / 2, rel=0.01)
    assert numbers["kick_simulated"] == pytest.approx(numbers["kick_measured"], rel=0.01)


def test_ceiling_and_baselines_of_a_growing_motion(run: cosim.Result, tmp_path: Path) -> None:
    """v = g^(t/T) sin(2πt/T): a period ago it was v/g, so the forecast misses (1 − 1/g)² of it."""
    growth, period = 1.1, 0.05
    time = np.arange(0.0, 0.3, 1 / 20000.0)
    v = 0.1 * growth ** (time / period) * np.sin(2 * np.pi * time / period)
    file = write(tmp_path / "a.csv", "time [s],velocity [m/s]", time, v)
    numbers = compare(run, file)
    assert numbers["velocity_r2_ceiling"] == pytest.approx(1 - (1 - 1 / growth) ** 2, abs=1e-3)
    assert numbers["velocity_r2_no_motion"] == pytest.approx(1 - np.mean(v**2) / np.var(v))
    slope, at_zero = np.polyfit(time, v, 1)
    left = np.var(v - slope * time - at_zero)
    assert numbers["velocity_r2_straight_line"] == pytest.approx(1 - left / np.var(v))


def test_ceiling_and_baselines_of_the_part(run: cosim.Result, tmp_path: Path) -> None:
    """Steps of 0.1 mm a period, and one of 0.2 mm: what repeats is forecast, the odd one is not."""
    time = np.arange(300) / 1000.0
    steps = np.floor(time / 0.05) + (time >= 0.2)
    part = 0.1 * steps + 3.0
    surface = np.sin(2 * np.pi * time / 0.05)
    file = write(tmp_path / "a.csv", "t [s],zp [mm],zo [mm]", time, surface, part)
    numbers = compare(run, file)
    assert numbers["mean_error_mm_no_motion"] == pytest.approx(np.mean(0.1 * steps))
    line = np.polyval(np.polyfit(time, part, 1), time)
    assert numbers["mean_error_mm_straight_line"] == pytest.approx(np.mean(np.abs(line - part)))
    # 0.6 mm in 5 periods, so 0.12 mm are forecast for each; one of the last five has 0.2 mm.
    wanted = np.mean([0.02, 0.02, 0.02, 0.08, 0.02])
    assert numbers["mean_error_mm_ceiling"] == pytest.approx(wanted, rel=0.03)
    greatest = np.max(0.1 * steps)
    for line in ("", "_ceiling", "_no_motion", "_straight_line"):
        share = 100 * numbers[f"mean_error_mm{line}"] / greatest
        assert numbers[f"mean_error_percent{line}"] == pytest.approx(share)


def test_straight_lines_score_on_the_trials_as_published(
    run: cosim.Result, trials: Path, tmp_path: Path
) -> None:
    """0.144 mm over the ten trials; and a trial forecasts itself better than that."""
    longer = cosim.run(
        "reference", {"circuit.model": "ideal", "run.duration": 0.6, "run.settle": 0.05}
    )
    found = [compare(longer, path) for path in sorted(trials.glob("Trial*.csv"))]
    assert len(found) == 10
    lines = [numbers["mean_error_mm_straight_line"] for numbers in found]
    assert np.mean(lines) == pytest.approx(0.144, abs=0.005)
    assert np.mean([numbers["mean_error_mm_ceiling"] for numbers in found]) < 0.1
    assert min(numbers["velocity_r2_ceiling"] for numbers in found) > 0.6


def test_a_forecast_is_what_was_a_period_ago() -> None:
    time = np.array([0.0, 0.1, 0.25, 0.3, 0.6])
    values = np.array([1.0, np.nan, 3.0, 4.0, 5.0])
    found = one_period_later(time, values, 0.3, gained=0.5)
    np.testing.assert_allclose(found, [np.nan, np.nan, np.nan, 1.5, 4.5])


def test_a_kick_is_not_what_a_gap_hides() -> None:
    """A sine of 0.2 m/s at 20 Hz changes by at most 2 A sin(π f Δt) = 25 mm/s in 1 ms. Over
    a gap of half a period, 25 ms, it changed by 400 mm/s, which were told as the kick."""
    time = np.delete(np.arange(300) / 1000.0, np.arange(1, 25))
    v = {"v_surface": -0.2 * np.cos(2 * np.pi * 20.0 * time)}
    found = both_sides(Recording("sine", time, v, ()), v, (0.05, 0.05))
    kick = next(number for number in found if number.name == "kick")
    largest = 0.4 * np.sin(np.pi * 20.0 / 1000.0)
    assert kick.values == pytest.approx({"measured": largest, "simulated": largest}, rel=1e-3)
    assert "velocity in 1 ms:" in kick.meaning


def test_r2() -> None:
    wanted = np.sin(np.arange(20.0))
    assert explained(wanted, wanted) == 1.0
    assert explained(np.full(20, wanted.mean()), wanted) == pytest.approx(0.0, abs=1e-12)


# --- instruments --------------------------------------------------------------


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize(
    ("header", "column", "scale", "score"),
    [
        ("time [s],velocity [m/s]", "v_surface", 1.0, "velocity_r2"),
        pytest.param(
            *("time [ms],velocity (mm/s)", "v_surface", 1e3, "velocity_r2"),
            marks=pytest.mark.slow,
        ),
        ("time [s],height [µm]", "z_surface", 1e6, "velocity_r2"),
        ("time [s],part [mm]", "z_part", 1e3, "mean_error_mm"),
        ("time [ms],current [mA]", "current", 1e3, "current_r2"),
        pytest.param(
            *("time [s],voltage [V]", "coil_voltage", 1.0, "voltage_r2"), marks=pytest.mark.slow
        ),
    ],
)
def test_what_one_instrument_measured(
    header: str, column: str, scale: float, score: str, run: cosim.Result, tmp_path: Path
) -> None:
    """Rows of the run's own waveforms, from 0.3125 s on."""
    rows = slice(6250, 13000, 3)
    time = run.columns["time"][rows] - run.columns["time"][6250]
    values = scale * run.columns[column][rows]
    written = time * (1e3 if "[ms]" in header else 1.0)
    file, out = write(tmp_path / "a.csv", header, written, values), tmp_path / "out"
    compared = cosim.compare(run, file)
    numbers = compared.numbers
    perfect = 0.0 if score == "mean_error_mm" else 1.0
    assert numbers[score] == pytest.approx(perfect, abs=2e-3)
    assert numbers["start"] == pytest.approx(0.3125, abs=1e-5)
    assert numbers["frequency_measured"] == pytest.approx(20.0, rel=2e-3)
    if column == "v_surface":  # an instrument of velocities sees impacts, which frames smear
        v = run.columns["v_surface"][rows]
        largest = np.abs(v[7:] - v[:-7]).max()  # as far apart as the trials' frames
        assert numbers["kick_simulated"] == pytest.approx(largest, rel=1e-3)
    compared.save(out)
    with open(out / "frames.csv", encoding="utf-8") as table:
        names = {name.split(" ")[0] for name in table.readline().rstrip("\n").split(",")}
    bodies = {"z_surface": {"v_surface"}, "z_part": {"v_part"}}.get(column, set())
    sides = ("measured", "simulated")
    assert names == {"time"} | {f"{n}_{side}" for n in {column} | bodies for side in sides}


def test_a_vibrometer_moves_the_part(run: cosim.Result, tmp_path: Path) -> None:
    """Its file, in units of its own, is a scene's surface as the run's own waveforms are."""
    run.save(tmp_path / "run")
    time, v = (1e3 * run.columns[name] for name in ("time", "v_surface"))
    file = write(tmp_path / "a.csv", "time [ms],velocity [mm/s]", time, v)
    paths = (tmp_path / "run" / "waveforms.csv", file)
    found = [cosim.run("trial", {"drive.file": str(path), "run.duration": 0.5}) for path in paths]
    averages = [one.summary["v_average"] for one in found]
    assert averages[0] == pytest.approx(averages[1], rel=1e-6) and averages[0] > 5e-3


def test_signals_that_the_run_has_not(run: cosim.Result, tmp_path: Path) -> None:
    surface = write(
        tmp_path / "v.csv",
        "time [s],velocity [m/s]",
        *(run.columns[name] for name in ("time", "v_surface")),
    )
    given = cosim.run("trial", {"drive.file": str(surface), "run.duration": 0.5})
    time, part, current = (run.columns[name][:9000] for name in ("time", "z_part", "current"))
    both = write(tmp_path / "a.csv", "time [s],part [m],current [A]", time, part, current)
    compared = cosim.compare(given, both)
    assert "Left out, since the run has none: current of one coil." in repr(compared)
    assert not any("current" in name for name in compared.numbers)
    alone = write(tmp_path / "b.csv", "time [s],current [A]", time, current)
    with pytest.raises(cosim.BadInput, match="the run has no current of one coil"):
        cosim.compare(given, alone)


def test_a_shutter_is_that_of_the_trial(tmp_path: Path) -> None:
    """A trial of a run whose frames were exposed is met by the run with that shutter alone."""
    settings = {"circuit.model": "ideal", "run.duration": 0.6, "run.settle": 0.2}
    blurred, sharp = (
        cosim.run("reference", settings | {"run.shutter": share}) for share in (1.0, 0.0)
    )
    times = frame_times(0.25, 300)
    seen = [camera.heights(sharp.columns, of, times, 1 / FRAME_RATE) for of in ("surface", "part")]
    columns = times - times[0], *(MM * z for z in seen)
    trial = write(tmp_path / "a.csv", "t [s],zp [mm],zo [mm]", *columns)
    met, missed = (compare(run, trial) for run in (blurred, sharp))
    assert 1 - met["velocity_r2"] < 1e-6 < 1e-4 < 1 - missed["velocity_r2"]
    assert met["mean_error_mm"] < 1e-5


# --- the command --------------------------------------------------------------


def test_command_prints_and_writes_units_and_meanings(
    tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    folder = tmp_path / "run"
    assert main(["run", "ideal-current", "--set", "run.duration=0.8", "--out", str(folder)]) == 0
    time = np.arange(200) / FRAME_RATE
    columns = time, 0.4 * np.sin(126 * time), 10.0 * time
    trial = write(tmp_path / "t.csv", "t [s],zp [mm],zo [mm]", *columns)
    out = tmp_path / "out"
    capsys.readouterr()
    assert main(["compare", str(folder), str(trial), "--out", str(out)]) == 0
    names = {path.name for path in out.iterdir()}
    assert names == {"compare.json", "compare.csv", "frames.csv", "compare.png"}
    numbers = json.loads((out / "compare.json").read_text())
    assert numbers["drift_measured"] == pytest.approx(0.01, rel=1e-6)
    with open(out / "compare.csv", encoding="utf-8", newline="") as file:
        rows = {row["name"]: row for row in csv.DictReader(file)}
    assert set(rows) == set(numbers) - {"run", "trial", "understood", "notes"}
    said = capsys.readouterr().out
    assert re.search(r"drift \[mm/s\] +\| 10 ", said)
    for name, row in rows.items():
        assert float(row["value"]) == numbers[name]
        assert row["unit"] in ("mm", "%", "1", "Hz", "m/s", "1/s", "s")
        printed = name.removesuffix("_measured").removesuffix("_simulated")
        for line in ("_ceiling", "_no_motion", "_straight_line"):
            printed = printed.removesuffix(line)
        assert f"{printed} [{row['unit'].replace('m/s', 'mm/s')}]" in said
        assert row["meaning"].partition("; of")[0] in said
        assert not row["meaning"].startswith("the same")  # as which other row?


@pytest.mark.parametrize(
    "arguments, told",
    [
        (["paper", "gone.csv"], "gone.csv"),
        (["nosuch", "t.csv"], "nosuch"),
        (["run", "t.csv", "--set", "run.duration=1"], "finished run"),
        ([".", "t.csv"], "there is no run in this folder"),
        (["paper", "unit.csv"], "the unit mm is not m/s"),
        (["held", "foo.csv"], "no column is understood (found: foo, bar)"),
    ],
)
def test_bad_input(
    arguments: list[str],
    told: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run").mkdir()
    time = np.arange(50) / FRAME_RATE
    write(tmp_path / "t.csv", "t [s],zp [mm],zo [mm]", time, 0.0 * time, 0.0 * time)
    write(tmp_path / "unit.csv", "time [s],velocity [mm]", time, time)
    write(tmp_path / "foo.csv", "foo,bar", time, time)
    assert main(["compare", *arguments]) == 2
    said = capsys.readouterr().err
    assert told in said and said.count("\n") == 1
    assert not (tmp_path / "results").exists()


def test_a_run_that_is_too_short(run: cosim.Result, tmp_path: Path) -> None:
    time = np.arange(0.0, 0.6, 1e-3)
    trial = write(tmp_path / "a.csv", "time [s],surface [mm]", time, np.sin(126 * time))
    with pytest.raises(cosim.BadInput, match=r"to cover the 600 rows of a: .* at least 0.9 s"):
        cosim.compare(run, trial)


# --- the camera ---------------------------------------------------------------


def test_interpolation_is_exact_for_cubics() -> None:
    time = np.linspace(0.0, 1.0, 11)
    at = np.linspace(0.0, 1.0, 57)
    z, v = 2 * time**3 - time**2 + 0.5, 6 * time**2 - 2 * time
    np.testing.assert_allclose(hermite(at, time, z, v), 2 * at**3 - at**2 + 0.5, atol=1e-14)


def test_differences() -> None:
    time = np.arange(20) / FRAME_RATE
    v = velocities(time, 3.0 * time**2)
    assert np.isnan(v[[0, -1]]).all()
    np.testing.assert_allclose(v[1:-1], 6.0 * time[1:-1], atol=1e-9)
