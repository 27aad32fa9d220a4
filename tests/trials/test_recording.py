"""Reading what any instrument measured: names and units, times, and what is told of them."""

from pathlib import Path

import numpy as np
import pytest

import cosim
from cosim.errors import BadInput
from cosim.trials.recording import read_recording
from cosim.trials.tracked import read_platform, trial_files
from cosim.waveforms import formats

ROWS = np.arange(12)


def write(path: Path, header: str, *columns: np.ndarray) -> Path:
    rows = [",".join(f"{x!r}" for x in row) for row in np.array(columns).T.tolist()]
    path.write_text("\n".join([header, *rows]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "signal", "unit"),
    [
        ("velocity [m/s]", "v_surface", 1.0),
        ("Velocity (mm/s)", "v_surface", 1e-3),
        ("v_surface [µm/s]", "v_surface", 1e-6),  # the micro sign
        ("height [μm]", "z_surface", 1e-6),  # the Greek letter
        ("displacement [um]", "z_surface", 1e-6),
        ("part [cm]", "z_part", 1e-2),
        ("vzo [mm/s]", "v_part", 1e-3),
        ("current [A]", "current", 1.0),
        ("Coil current [mA]", "current", 1e-3),
        ("voltage [mV]", "coil_voltage", 1e-3),
        ("coil_voltage [V]", "coil_voltage", 1.0),
        ("command [V]", "command", 1.0),
    ],
)
def test_names_and_units(header: str, signal: str, unit: float, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", f"time [ms],{header}", 2.5 * ROWS + 7, ROWS**2 + 0.5)
    found = read_recording(path)
    np.testing.assert_allclose(found.time, 2.5e-3 * ROWS, atol=1e-15)  # from the first row on
    np.testing.assert_allclose(found.signals[signal], unit * (ROWS**2 + 0.5), rtol=1e-15)
    others = {"z_surface": {"v_surface"}, "z_part": {"v_part"}}.get(signal, set())
    assert set(found.signals) == {signal} | others
    assert found.notes == ()


@pytest.mark.parametrize(
    ("header", "asked"), [("time [1/240 s]", ""), ("frame", "time=frame:1/240 s")]
)
def test_frames_are_counted(header: str, asked: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", f"{header},surface [mm]", ROWS + 100.0, ROWS**2)
    found = read_recording(path, asked)
    np.testing.assert_allclose(found.time, ROWS / 240, atol=1e-15)
    np.testing.assert_allclose(found.signals["v_surface"][1:-1], 2 * 0.24 * ROWS[1:-1])
    with pytest.raises(BadInput, match=r"the unit 1/0 s is not s.*nor 1/960 s or the like"):
        read_recording(path, f"time={header.split()[0]}:1/0 s")


def test_velocities_of_uneven_heights_are_central_differences(tmp_path: Path) -> None:
    time = np.cumsum(1.0 + ROWS % 3)
    path = write(tmp_path / "a.csv", "time [ms],height [mm]", time, 3.0 * time)
    v = read_recording(path).signals["v_surface"]
    assert np.isnan(v[[0, -1]]).all()
    np.testing.assert_allclose(v[1:-1], 3.0)  # mm/ms


def test_heights_with_a_single_velocity_are_heights_alone(tmp_path: Path) -> None:
    """Of a part seen in three rows in turn, and then in every third: a KeyError ended it."""
    seen = np.where((ROWS < 3) | (ROWS % 3 == 2), 1.0 * ROWS**2, np.nan)
    found = read_recording(write(tmp_path / "a.csv", "time [s],part [mm]", ROWS, seen))
    assert set(found.signals) == {"z_part"}
    np.testing.assert_allclose(found.signals["z_part"], 1e-3 * seen)


def test_what_is_taken_for_granted_is_told(tmp_path: Path) -> None:
    found = read_recording(write(tmp_path / "a.csv", "velocity [m/s]", ROWS))
    np.testing.assert_allclose(found.time, ROWS / 960)
    assert found.signals["v_surface"][-1] == 11.0
    (rate,) = found.notes
    assert "960 frames/s" in rate
    header = "time [s],velocity [m/s],temperature [K]"
    (unknown,) = read_recording(write(tmp_path / "b.csv", header, ROWS, ROWS, ROWS)).notes
    assert unknown.startswith("Left out, not understood: temperature [K]. Understood are: time;")
    assert unknown.endswith("To compare, --columns surface=NAME names others.")


def test_rounded_times_of_a_trial_are_made_even(tmp_path: Path) -> None:
    even = np.arange(300) / 960
    path = write(tmp_path / "a.csv", "t [s],surface [mm]", np.round(even, 8), 1.0 + even)
    np.testing.assert_array_equal(read_recording(path).time, even)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("time [s],foo [V]", "no column to compare: write what each is and its unit"),
        ("time [s],foo [V]", "--columns time=t:s,surface=top:mm,part=cube:mm. Left out, not"),
        ("time [s],foo [V]", "not understood: foo [V]. Understood are: time; z_surface or surface"),
        ("when,foo", "no column is understood (found: when, foo): write what each is"),
        ("when,foo", "part=cube:mm. Understood are: time; z_surface"),
        ("time [s],velocity [mm]", "column velocity [mm]: the unit mm is not m/s, mm/s, µm/s"),
        ("time [furlong],velocity [mm/s]", "column time [furlong]: the unit furlong is not s"),
        ("velocity [m/s],v_surface [m/s]", "velocity [m/s] and v_surface [m/s] are the same"),
    ],
)
def test_bad_headers(header: str, words: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", header, ROWS, ROWS)
    with pytest.raises(BadInput) as caught:
        read_recording(path)
    told = str(caught.value)
    assert words in told and told.startswith(f"{path}: ") and "\n" not in told


def test_gaps(tmp_path: Path) -> None:
    """A velocity or a height may be missing here and there: as a height, so its differences."""
    gap = np.where(ROWS == 5, np.nan, ROWS)
    found = read_recording(write(tmp_path / "a.csv", "time [s],velocity [m/s]", ROWS, gap))
    np.testing.assert_array_equal(found.signals["v_surface"], gap)
    found = read_recording(write(tmp_path / "b.csv", "time [s],height [m]", ROWS, gap))
    np.testing.assert_array_equal(found.signals["z_surface"], gap)
    assert np.flatnonzero(np.isnan(found.signals["v_surface"])).tolist() == [0, 4, 6, 11]
    assert found.understood["columns"]["z_surface"]["missing"] == 1
    none = np.full(12, np.nan)
    with pytest.raises(BadInput, match=r"column current \[A\]: it has fewer than two values"):
        read_recording(write(tmp_path / "c.csv", "time [s],current [A]", ROWS, none))
    with pytest.raises(BadInput, match="fewer than two velocities of the surface"):
        read_platform(write(tmp_path / "d.csv", "time [s],velocity [m/s]", ROWS, none))


def test_a_surface_alone(tmp_path: Path) -> None:
    """What moves a scene's surface needs a time, and one of its height and velocity."""
    time, surface = read_platform(
        write(tmp_path / "a.csv", "time [ms],velocity [mm/s]", 4 * ROWS, 5.0 * ROWS)
    )
    np.testing.assert_allclose(time, 4e-3 * ROWS)
    np.testing.assert_allclose(surface.v, 5e-3 * ROWS)
    with pytest.raises(BadInput, match="no column with the time"):
        read_platform(write(tmp_path / "b.csv", "velocity [mm/s]", ROWS))
    with pytest.raises(BadInput, match="no column with the surface's motion"):
        read_platform(write(tmp_path / "c.csv", "time [s],current [A]", ROWS, ROWS))


def test_no_published_trial_is_told_a_flaw(trials: Path) -> None:
    for path in trial_files(trials):
        found = read_recording(path)
        assert not found.notes and not found.understood["gaps"], path


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("scene", ["trial-06", "quaid", "held"])
def test_no_run_is_told_a_flaw(scene: str, tmp_path: Path) -> None:
    """One that rests on a wall in the end, one that repeats from frame to frame, one at rest."""
    cosim.run(scene).save(tmp_path)
    formats.export(formats.read(tmp_path), ["tracker"], tmp_path)
    found = read_recording(tmp_path / "tracker.csv")
    assert not found.notes and not found.understood["gaps"]
