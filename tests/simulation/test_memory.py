"""The memory of a run does not grow with its duration, where it ends up on disk.

Counted is all that is in RAM at a time, mapped files included.
"""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from cosim.coupling.loop import agenda, lead
from cosim.drive import pieces, straights
from cosim.files import spill as tape
from cosim.scene import load
from cosim.simulation import simulate
from cosim.simulation.elsewhere import on_disk_in
from cosim.toolchain import processes
from cosim.waveforms import storage

pytestmark = pytest.mark.reliability

_RUN = """
import sys
from pathlib import Path
from cosim.cli.main import main
from cosim.toolchain.processes import in_place
with in_place():
    code = main()
lines = Path("/proc/self/status").read_text().splitlines()
print(next(line.split()[1] for line in lines if line.startswith("VmHWM")), file=sys.stderr)
sys.exit(code)
"""


def peak(*overrides: str) -> float:
    """Most memory (MiB) that a process had in RAM that ran `reference`, mapped files included."""
    settings = [word for override in overrides for word in ("--set", override)]
    with TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, "-c", _RUN, "run", "reference", *settings, "--out", folder],
            capture_output=True,
            text=True,
            check=True,
        )
    return float(done.stderr.split()[-1]) / 1024


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory is read from /proc")
@pytest.mark.parametrize(
    ("model", "durations", "rows"),
    [
        ("ideal", (2, 20), 5e-5),
        pytest.param("limited", (20, 200), 5e-5, marks=pytest.mark.slow),
        pytest.param("amplifier", (10, 100), 5e-5, marks=pytest.mark.slow),
        pytest.param("amplifier", (2, 20), 5e-4, marks=pytest.mark.slow),
    ],
)
def test_memory_is_bounded(model: str, durations: tuple[float, float], rows: float) -> None:
    settings = (f"circuit.model={model}", f"run.output_step={rows}")
    short, long = (peak(*settings, f"run.duration={duration}") for duration in durations)
    # All rows, or all points of the circuit, take 50 MiB more and their copies as much again.
    assert long - short < 30.0, f"{short:.1f} MiB for {durations[0]} s, {long:.1f} MiB for more"


CASES = {
    "amplifier": ("reference", ["run.duration=0.2"]),
    "ideal, with eddy currents": (
        "reference",
        [
            "circuit.model=ideal",
            "run.duration=0.2",
            "coil.eddy_inductance=1e-3",
            "coil.eddy_resistance=4",
        ],
    ),
    "limited": ("reference", ["circuit.model=limited", "run.duration=0.2"]),
    "sine": ("reference", ["circuit.model=limited", "drive.waveform=sine", "run.duration=0.07"]),
    "full": ("reference", ["circuit.model=full", "run.duration=0.02"]),
    "two surfaces": ("two-surfaces", ["run.duration=0.1"]),
    "changing grip": ("closed-loop-grasp", ["run.duration=0.1", "run.output_step=1.7e-4"]),
    "a shutter": ("reference", ["circuit.model=ideal", "run.duration=0.2", "run.shutter=0.3"]),
    "many frames to a row": (
        "reference",
        ["circuit.model=ideal", "run.duration=0.5", "run.output_step=0.04"],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_blocks_and_disk_change_nothing(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = load(*CASES[name])
    whole = simulate.simulate(scene)
    monkeypatch.setattr(tape, "IN_MEMORY", 0)
    monkeypatch.setattr(tape, "BLOCK", 97)
    monkeypatch.setattr(agenda, "ENTRIES", 50)
    monkeypatch.setattr(straights, "_TOGETHER", 3)
    monkeypatch.setattr(lead, "_POINTS", 11)
    monkeypatch.setattr(pieces, "PREPARED", 2)
    with on_disk_in(tmp_path), processes.in_place():
        parts = simulate.simulate(scene)
    assert not os.listdir(tmp_path)
    assert list(parts.columns) == list(whole.columns)
    for column, values in whole.columns.items():
        assert values.tobytes() == parts.columns[column].tobytes(), column
    for key, value in whole.summary.items():
        if key == "energy_residual":  # the difference of numbers that are nearly one
            assert parts.summary[key] == pytest.approx(value, abs=1e-12)
        elif isinstance(value, list) and key != "notes":  # None becomes NaN
            found, told = (np.array(each, float) for each in (parts.summary[key], value))
            np.testing.assert_allclose(found, told, rtol=1e-12, err_msg=key)
        elif isinstance(value, float) and key != "wall_time":
            assert parts.summary[key] == pytest.approx(value, rel=1e-12), key
        elif key != "wall_time":
            assert parts.summary[key] == value, key


def test_files_are_those_of_other_writers(monkeypatch: pytest.MonkeyPatch) -> None:
    """The bytes of scipy's netCDF and of numpy's CSV."""
    from io import BytesIO

    from scipy.io import netcdf_file

    monkeypatch.setattr(tape, "BLOCK", 100)
    random = np.random.default_rng(1)
    time_ = np.arange(2345) * 5e-5
    waves = {"time": time_, "z": random.normal(size=2345) * 1e-9, "sticking": np.round(time_)}
    units = {"time": "s", "z": "m", "sticking": "1"}
    long_names = {"time": "time", "sticking": "whether the part sticks to the surface"}
    about = {"title": "fünf", "scene": "a = 1\nb = 2\n"}
    content = BytesIO()
    with netcdf_file(content, "w", version=2) as file:
        for name, text in about.items():
            setattr(file, name, text.encode())
        file.createDimension("time", len(time_))
        for name, values in waves.items():
            variable = file.createVariable(name, "f8", ("time",))
            variable[:] = values
            variable.units = units[name]
            if name in long_names:
                variable.long_name = long_names[name]
        file.flush()
        storage.netcdf(found := BytesIO(), waves, units, about)
        assert found.getvalue() == content.getvalue()
    table = BytesIO()
    header = "time [s],z [m],sticking [1]"
    np.savetxt(
        table, np.column_stack(list(waves.values())), "%.10g", ",", header=header, comments=""
    )
    storage.csv(found := BytesIO(), waves, units)
    assert found.getvalue() == table.getvalue()


def test_disk_that_takes_no_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A full disk is told in one sentence, and is not met as a signal or a half-known run."""
    from cosim.errors import BadInput

    monkeypatch.setattr(tape, "IN_MEMORY", 0)

    class Full:
        def write(self, content: bytes) -> int:
            raise OSError(28, "No space left on device")

    monkeypatch.setattr(tape.tempfile, "TemporaryFile", lambda **_: Full())
    for model in ("amplifier", "ideal"):
        with (
            processes.in_place(),
            tape.on_disk_in(tmp_path),
            pytest.raises(BadInput, match=r"cannot hold the waveforms .*No space left"),
        ):
            simulate.simulate(load("reference", ["run.duration=0.1", f"circuit.model={model}"]))
