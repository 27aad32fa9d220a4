"""Sweeps: what they find, what they make of points that fail, and where they run."""

import json
import os
import re
import sqlite3
import threading
import time
from contextlib import closing
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.io import loadmat

from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.evaluate.evaluator import Evaluator
from cosim.evaluate.point import Outcome, evaluate
from cosim.files.resources import circuits
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.studies.sweep import figure
from cosim.studies.sweep.design import Design, grid, sample
from cosim.studies.sweep.report import fastest, of_ports, table
from cosim.studies.sweep.run import sweep
from cosim.toolchain.processes import in_place
from cosim.toolchain.worker import living
from cosim.waveforms import report

pytestmark = pytest.mark.usefixtures("undrawn")

SHORT = ["run.duration=0.1", "run.settle=0.05"]


def test_closed_form(tmp_path: Path) -> None:
    """The paper's optimal waveform at A = 10: v/(g T) over f_n, from its closed form."""
    table = {2.0: 0.0563076923, 3.0: 0.1832899408, 5.0: 0.3106508876, 8.0: 0.3245602811}
    scene = load("optimal", ["friction.mu_s=0.7", "friction.mu_k=0.6"])
    g, mass = scene.mechanics.gravity, scene.mechanics.part_mass
    forces = [ratio * mass * g for ratio in table]
    data = sweep(scene, {"friction.normal_force": forces}, out=tmp_path, workers=2)
    found = data["v_average"].values * scene.drive.frequency / g
    # As the surface is given per force, the drive's optimum follows the force.
    assert found == pytest.approx(list(table.values()), rel=1e-6)
    assert data.normal_force.attrs["units"] == "N"
    assert data["v_average"].attrs["units"] == "m/s"


def test_agrees_with_single_runs(tmp_path: Path) -> None:
    over = {"drive.amplitude": [6.0, 8.0], "drive.offset": [-1.5, -1.0, -0.5]}
    scene = load("reference", ["circuit.model=ideal", *SHORT])
    data = sweep(scene, over, out=tmp_path, workers=2)
    assert data.sizes == {"amplitude": 2, "offset": 3}
    for amplitude in (6.0, 8.0):
        for offset in (-1.5, -1.0, -0.5):
            values = {"drive.amplitude": amplitude, "drive.offset": offset}
            point = data.sel(amplitude=amplitude, offset=offset)
            alone = simulate(
                load(
                    "reference",
                    ["circuit.model=ideal", *SHORT, *(f"{k}={v}" for k, v in values.items())],
                )
            ).summary
            for name in ("v_average", "stick_fraction", "a_camera_max", "energy_in"):
                assert float(point[name]) == pytest.approx(alone[name], rel=1e-6, abs=1e-12)
            assert int(point["impacts"]) == alone["impacts"]


def test_read_by_others(tmp_path: Path) -> None:
    """The netCDF library, which this project does not write with, reads the same."""
    over = {"drive.frequency": [10.0, 20.0], "drive.amplitude": [3.0, 99.0]}
    scene = load("reference", ["circuit.model=ideal", *SHORT, "drive.quantised=true"])
    data = sweep(scene, over, out=tmp_path, workers=1)
    with netCDF4.Dataset(tmp_path / "sweep.nc") as file:
        assert file["v_average"].dimensions == ("frequency", "amplitude")
        assert file["v_average"].units == "m/s" and file["frequency"].units == "Hz"
        assert file["frequency"].long_name == "Frequency"  # what stands beside an axis
        np.testing.assert_array_equal(file["v_average"][:].filled(np.nan), data["v_average"])
        assert file["failure"][:].tolist() == data["failure"].values.tolist()
    assert np.isnan(data.v_average.sel(amplitude=99.0)).all()
    assert "drive.amplitude = 99" in str(data["failure"].values[0, 1])
    assert xr.load_dataset(tmp_path / "sweep.nc", engine="scipy").identical(data)


def test_frequencies_last_whole_periods() -> None:
    base = load("reference", ["circuit.model=ideal", "run.duration=0.5", "run.settle=0.25"])
    broken = evaluate(base, {"drive.frequency": 14.0}, False).numbers["v_average"]
    whole = evaluate(base, {"drive.frequency": 14.0}, True).numbers["v_average"]
    # Seven whole periods of 1/14 s, written out by hand.
    known: Any = simulate(
        load(
            "reference",
            [
                "circuit.model=ideal",
                f"run.duration={8 / 14}",
                f"run.settle={4 / 14}",
                "drive.frequency=14",
            ],
        )
    ).summary["v_average"]
    assert whole == pytest.approx(known, rel=1e-8)
    assert abs(broken - known) > 1e-3 * abs(known)


def test_the_last_row_of_whole_periods_is_their_end() -> None:
    """The ram is at its wall there, but not where the scene's own duration ends."""
    own = {"run.duration": 0.63, "run.settle": 0.11, "drive.amplitude": 8.0}
    found = sweep("paper-limited", {"drive.frequency": [20.0, 33.0]}, own)
    whole = own | {"run.duration": 0.7, "drive.frequency": 20.0}
    waves = simulate(load("paper-limited", whole)).waveforms
    travel = load("paper-limited").mechanics.travel
    ram = waves.z_ram - waves.z_surface
    assert ram.sel(time=0.63, method="nearest") < travel < ram[-1]
    assert found.at_wall.sel(frequency=20.0) == 1.0


def test_durations_are_averaged_over_whole_periods() -> None:
    """Motion that repeats has one mean; over three periods and a fifth it is 17 % off."""
    long = sweep("ideal-current", {"drive.offset": [-0.783]}, {"run.duration": 3.0}, workers=1)
    data = sweep("ideal-current", {"run.duration": [0.8, 1.0]}, workers=1)
    assert data.failure.values.tolist() == ["", ""]
    assert data.v_average.values == pytest.approx(float(long.v_average[0]), rel=1e-4)


def test_failures_cost_only_themselves(tmp_path: Path) -> None:
    """Scenes that cannot be, mechanics that give up and a circuit without a solution."""
    netlist = tmp_path / "floating.cir"
    good = circuits() / "examples" / "h_bridge.cir"
    text = good.read_text(encoding="utf-8")
    netlist.write_text(text.replace("\n.end", "\nBno nowhere 0 I = v(nowhere)**2 + 1\n.end"))
    for source, over, lost in (
        # A suspension that pulls the ram through the wall: the mechanics give up.
        (
            ["circuit.model=ideal", *SHORT, "drive.offset=6"],
            {"mechanics.suspension_k2": [0.0, -1e15]},
            1,
        ),
        (["circuit.model=ideal", *SHORT], {"friction.mu_k": [0.5, 0.9]}, 1),
    ):
        data = sweep(
            load("reference", source),
            over,
            out=tmp_path / str(lost) / str(len(over)) / next(iter(over)),
            workers=1,
        )
        assert data["failure"].values.tolist()[0] == ""
        assert data["failure"].values.tolist()[lost] != ""
        assert np.isfinite(data["v_average"].values[0]) and np.isnan(data["v_average"].values[lost])
    scene = load("reference", ["circuit.model=file", f"circuit.netlist={netlist}", *SHORT])
    data = sweep(scene, {"drive.offset": [-1.2]}, out=tmp_path / "circuit", workers=1)
    assert str(data["failure"].values[0]) != ""


def test_worker_that_keeps_dying() -> None:
    """A point whose worker dies again and again is a failure; the others do not notice."""
    scene = load("reference", SHORT)
    points = [
        (0, {"run.duration": 2000.0}),
        *((k, {"drive.offset": -0.1 * k}) for k in range(1, 6)),
    ]
    outcomes: dict[int, Outcome] = {}

    def kill() -> None:
        while 0 not in outcomes:
            for worker in [each() for each in list(living.values())]:
                # Only that point takes so long.
                begun = hasattr(worker, "_process")
                if worker is not None and begun and worker.alive and worker.reached > 0.3:
                    worker._process.kill()
            time.sleep(0.05)

    killer = threading.Thread(target=kill)
    killer.start()
    with Evaluator(scene, workers=2) as bench:
        for number, outcome in bench.run(points):
            outcomes[number] = outcome
    killer.join()
    assert re.match(r"The simulation's process died after t = \S+ s \(SIG", outcomes[0].failure)
    assert outcomes[0].machine
    for number, values in points[1:]:
        assert outcomes[number] == evaluate(scene, values, False)


def test_dask(tmp_path: Path) -> None:
    from distributed import LocalCluster

    over = {"drive.offset": [-2.0, 0.0], "drive.frequency": [15.0, 40.0]}
    scene = load("reference", ["circuit.model=ideal", *SHORT])
    here = sweep(scene, over, samples=12, seed=3, out=tmp_path / "here", workers=2)
    running: Any = LocalCluster(
        n_workers=2, threads_per_worker=2, dashboard_address="", host="127.0.0.1"
    )
    with running as cluster:
        there = sweep(
            scene, over, samples=12, seed=3, out=tmp_path / "there", dask=cluster.scheduler_address
        )
    assert there.identical(here)
    assert (tmp_path / "there/sweep.nc").read_bytes() == (tmp_path / "here/sweep.nc").read_bytes()


def test_no_cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosim.evaluate.many.PATIENCE", 0.5)
    with pytest.raises(BadInput, match="no cluster answers"):
        sweep(load("held"), {"friction.mu_s": [0.7]}, out=tmp_path, dask="tcp://127.0.0.1:9")


def test_folder_of_another_sweep(tmp_path: Path) -> None:
    scene = load("held", ["run.duration=0.01"])
    sweep(scene, {"friction.mu_s": [0.7]}, out=tmp_path, workers=1)
    before = (tmp_path / "sweep.nc").read_bytes()
    with pytest.raises(BadInput, match="other work"):
        sweep(scene, {"friction.mu_s": [0.8]}, out=tmp_path, workers=1)
    assert (tmp_path / "sweep.nc").read_bytes() == before
    (tmp_path / "sweep.sqlite").write_bytes(b'{"journal": "torn')
    with pytest.raises(BadInput, match="no store of this version"):
        sweep(scene, {"friction.mu_s": [0.7]}, out=tmp_path, workers=1)


@pytest.mark.parametrize("failure", ["\ud800", "\x1b[2J", 3])
def test_a_failure_that_no_sweep_has_told_is_run_again(failure: object, tmp_path: Path) -> None:
    scene, over = load("held", ["run.duration=0.01"]), {"friction.mu_s": [0.7, 0.8]}
    first = sweep(scene, over, out=tmp_path, workers=1)
    with closing(sqlite3.connect(tmp_path / "sweep.sqlite")) as base, base:
        told = json.dumps({"numbers": {}, "failure": failure, "machine": False})
        base.execute("UPDATE found SET value = ? WHERE key != ''", (told,))
    assert sweep(scene, over, out=tmp_path, workers=1).equals(first)


def test_a_file_with_other_content_is_other_work(tmp_path: Path) -> None:
    """What a sweep has kept does not answer for a force, or a netlist, that was edited since; the
    waveforms that another one left go."""
    force = tmp_path / "force.csv"
    force.write_text("time [s],normal_force [N]\n0,0.5\n1,0.5\n")
    given = {"friction.normal_force_file": str(force), "run.duration": 0.02, "run.settle": 0.0}
    out, old = tmp_path / "out", tmp_path / "out" / "points" / "7.nc"
    old.parent.mkdir(parents=True)
    old.write_bytes(b"of another sweep")

    def swept() -> float:
        over = {"drive.amplitude": [6.0]}
        data = sweep(load("paper-limited", given), over, out=out, workers=1)
        return float(data["v_average"].values[0])

    with in_place():
        first = swept()
        assert swept() == first and not old.exists()
        force.write_text("time [s],normal_force [N]\n0,0.1\n1,0.1\n")
        with pytest.raises(BadInput, match="other work"):
            swept()
        (out / "sweep.sqlite").unlink()
        assert swept() != first


@pytest.mark.parametrize("linked", [True, False])
def test_waveforms_stay_within_the_sweeps_folder(linked: bool, tmp_path: Path) -> None:
    """Nothing is removed or written where a link leads, nor is the sweep run for nothing."""
    theirs, out = tmp_path / "theirs", tmp_path / "out"
    theirs.mkdir()
    out.mkdir()
    (theirs / "0.nc").write_text("theirs")
    if linked:
        (out / "points").symlink_to(theirs)
    else:
        (out / "points").write_text("theirs")
    for keep in ([], ["z_part"], "z_part"):
        with in_place(), pytest.raises(BadInput, match="points: this is no directory of the sweep"):
            sweep("held", {"friction.mu_s": [0.7]}, {"run.duration": 0.01}, keep=keep, out=out)
    assert [path.read_text() for path in theirs.iterdir()] == ["theirs"]
    assert [*out.iterdir()] == [out / "points"]


def test_keys_with_choices_are_drawn_from_them() -> None:
    over = {"coil.polarity": [-1, 1], "drive.amplitude": [5.0, 8.0]}
    design = sample(over, 12, 0)
    found = [design.point(k)["coil.polarity"] for k in range(12)]
    assert (found.count(-1), found.count(1)) == (6, 6)


def test_latin_hypercube() -> None:
    """Each of N equal parts of each range holds one point; whole numbers stay whole."""
    over = {"drive.frequency": [10.0, 60.0], "mechanics.n_surfaces": [1, 4]}
    design = sample(over, 40, 1)
    assert design == sample(over, 40, 1) != sample(over, 40, 2)
    frequencies = [design.point(k)["drive.frequency"] for k in range(40)]
    assert sorted(int((f - 10.0) / 50.0 * 40) for f in frequencies) == list(range(40))
    counts = [design.point(k)["mechanics.n_surfaces"] for k in range(40)]
    assert {n: counts.count(n) for n in (1, 2, 3, 4)} == dict.fromkeys((1, 2, 3, 4), 10)


def test_last_axis_runs_fastest() -> None:
    design: Design = grid({"drive.frequency": [10.0, 20.0], "drive.offset": [0.0, 1.0, 2.0]})
    assert [tuple(design.point(k).values()) for k in (0, 1, 3)] == [(10, 0), (10, 1), (20, 0)]


BAD = [
    ([], "needs at least one key"),
    (["--over", "drive.offset"], "must be table.key=start:stop:n"),
    (["--over", "drive.ofset=1,2"], "did you mean drive.offset?"),
    (["--over", "offset=1,2"], "did you mean drive.offset?"),
    (["--over", "circuit.model=1,2"], "not a number"),
    (["--over", "drive.offset=1:2"], "start:stop:n"),
    (["--over", "drive.offset=1:2:1"], "start:stop:n"),
    (["--over", "drive.offset=1:2:x"], "start:stop:n"),
    (["--over", "drive.offset=1,x"], "“x” is not a number"),
    (["--over", "drive.offset=1,nan"], "not a number"),
    (["--over", "drive.offset=1,1"], "twice"),
    (["--over", "drive.offset=1,200"], "a number from -100 to 100 V"),
    (["--over", "mechanics.n_surfaces=1.5,2"], "a whole number from 1 to 16"),
    (["--over", "drive.offset=1,2", "--over", "drive.offset=3,4"], "given twice"),
    (
        ["--over", "drive.pot_offset=0,1", "--over", "drive.offset=3,4"],
        "drive.pot_offset and drive.offset say the same thing twice",
    ),
    (["--over", "circuit.param.x=1,2"], "circuit.param.x: moves nothing with circuit.model ="),
    (["--over", "drive.table.9=0,0.5"], "drive.table.9 needs a number, and a drive.table with"),
    (["--over", "coil.polarity=0,1"], "0 must be one of -1, 1"),
    (["--over", "drive.offset=1,2", "--samples", "0"], "--samples 0"),
    (["--over", "drive.offset=1", "--samples", "5"], "needs a range"),
    (["--over", "drive.offset=1,2", "--workers", "0"], "--workers 0"),
    (["--over", "drive.offset=1,2", "--keep", "v_prt"], '"v_prt"; did you mean v_part'),
    (["--over", "drive.offset=0:1:9999", "--over", "drive.amplitude=0:1:9999"], "points"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "words"), BAD)
def test_bad_input(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["sweep", "held", *arguments, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1
    assert not out.exists() or not os.listdir(out)


@pytest.mark.parametrize(
    "velocities, ways",
    [([0.0, -1e-16], []), ([1e-3, 0.0, 4e-7], ["up"]), ([-1e-3, 1e-16, 1e-3], ["up", "down"])],
)
def test_what_stays_is_not_fastest(velocities: list[float], ways: list[str]) -> None:
    """Neither by rounding, nor where the slowest point of those that go up stays."""
    found = fastest(xr.Dataset({"v_average": ("point", velocities)}))
    assert [way for way, _ in found] == ways


def test_a_waveform_that_the_scene_lacks_is_refused_before_its_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A surface of given motion has no ram: that was found after all points, which were left."""
    over = ["optimal", "--over", "friction.mu_k=0.5,0.6", "--keep", "z_part,z_ram"]
    assert main(["sweep", *over, "--out", str(tmp_path / "out")]) == 2
    assert 'the runs have no "z_ram" (they have time, z_surface' in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["sweep", "ideal-current", "--set", "run.duration=0.1", "--workers", "2"]
    over = ["--over", "drive.offset=-2:0:3", "--over", "drive.amplitude=6,8"]
    assert main([*arguments, *over, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "6 points, 0 failed" in said and "fastest up" in said
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.nc", "sweep.sqlite", "figure.png"}


@pytest.mark.slow
def test_motion_at_the_fastest_and_at_random_points_is_told() -> None:
    """The gripper's flexures ring for seconds: means over the first one are not the later ones. The
    rig of the trials has settled by then."""
    over = {"drive.amplitude": [5.0, 7.0, 9.0, 10.0], "drive.frequency": [30.0, 48.0, 60.0]}
    settings = {"circuit.model": "limited", "run.duration": 1.0, "run.settle": 0.5}
    rings, later = (
        sweep("gripper", over, settings | times)
        for times in ({}, {"run.duration": 24.0, "run.settle": 12.0})
    )
    off = np.abs(rings.v_average - later.v_average) > 0.02 * np.abs(later.v_average)
    assert off.mean() > 0.3
    assert "reads the start at 3 of them" in rings.attrs["motion_at_random"]
    assert "  motion at points at random: " in table(rings)
    settled = sweep("paper-limited", {"drive.amplitude": [6.4, 6.5, 6.6, 6.7]})
    assert settled.attrs["motion_fastest_up"].startswith("repeats every period, to 0.1 % from 0.")
    assert settled.attrs["motion_at_random"] == "regular 1; the mean reads the start at 0 of them"


def test_no_point_could_be_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A failed simulation, exit code 3; the failures with their reasons are kept."""
    over = ["--over", "drive.phase_deg=0:90:2", "--set", "run.duration=0.1"]
    assert main(["sweep", "reference", *over, "--workers", "1", "--out", str(tmp_path)]) == 3
    assert "No point could be run; the first one: --over: " in capsys.readouterr().err
    assert (tmp_path / "sweep.nc").exists()


def test_what_ports_join_and_save_keeps_comes_first() -> None:
    """As in the table of a run, whatever else the FMU has: its gap is no port's."""
    short = {"run.duration": 0.01, "run.settle": 0.001}
    data = sweep("relay", {"circuit.reltol": [5e-5]}, short)
    result = simulate(load("relay", short))
    printed = report.table(result.scene, result.summary, result.units).splitlines()
    told = [line.split(" [")[0].strip() for line in printed if " [" in line]
    ranked = [name for name in of_ports(data) if name.removesuffix(".mean") in told]
    assert ranked == [f"{name}.mean" for name in told] and len(told) > 8


def test_a_figure_of_ones_own_circuit_is_about_the_first_port() -> None:
    resistance = xr.DataArray(
        [0.5, 1.0, 2.0], dims="R", attrs={"key": "circuit.param.R", "units": "?"}
    )
    means = {
        "rotor.omega.mean": ("R", [100.0, 90.0, np.nan]),
        "Vemf.mean": ("R", [5.0, 1.0, np.nan], {"units": "V"}),
    }
    failure = {"failure": ("R", ["", "", "no such circuit"])}
    drawn = figure.draw(xr.Dataset(means | failure, {"R": resistance}), "motor")
    said = "rotor.omega.mean from 90 at circuit.param.R = 1 to 100 at circuit.param.R = 0.5"
    assert drawn.get_suptitle().replace("\n", " ") == f"motor: {said} 3 points, 1 failed (×)"
    first = drawn.axes[0]
    assert first.get_xlabel() == "circuit.param.R"
    assert [axis.get_title("left") for axis in drawn.axes] == ["rotor.omega.mean", "Vemf.mean [V]"]
    assert [line.get_marker() for line in first.lines] == [".", "x"]  # one failed


def test_a_sweep_of_ones_own_circuit_over_two_keys_is_a_map_and_a_range() -> None:
    keys = {"R": [0.5, 1.0, 2.0], "drop": [1.0, 3.0]}
    speed = np.array([[4.0, 9.0], [5.0, np.nan], [6.0, 1.0]])
    data = xr.Dataset(
        {
            "rotor.omega.mean": (tuple(keys), speed, {"units": "rad/s"}),
            "failure": (tuple(keys), np.where(np.isfinite(speed), "", "no")),
        },
        {name: (name, at, {"key": f"t.{name}", "units": "?"}) for name, at in keys.items()},
        {"title": "motor"},
    )
    said = "from 1 rad/s at t.R = 2, t.drop = 3 to 9 rad/s at t.R = 0.5, t.drop = 3"
    assert f"rotor.omega.mean     {said}" in table(data)
    drawn = figure.draw(data, "motor")
    assert said in drawn.get_suptitle().replace("\n", " ")
    colours = np.asarray(drawn.axes[0].collections[0].get_array()).reshape(3, 2)
    assert np.nan_to_num(colours.astype(float)).tolist() == np.nan_to_num(speed).tolist()


@pytest.mark.parametrize(
    ("least", "told", "stays"),
    [(-1e-3, True, False), (0.0, True, True), (1e-4, False, False), (4e-5, True, True)],
)
def test_a_map_tells_what_its_black_lines_and_dashes_are(
    least: float, told: bool, stays: bool
) -> None:
    keys = {"a": [1.0, 2.0], "b": [1.0, 2.0]}
    data = xr.Dataset(
        {
            "v_average": (tuple(keys), [[least, 3e-3], [2e-3, 4e-3]], {"units": "m/s"}),
            "failure": (tuple(keys), [["", ""], ["", ""]]),
        },
        {name: (name, at, {"key": f"t.{name}", "units": "?"}) for name, at in keys.items()},
        {"title": "map"},
    )
    drawn = figure.draw(data, "map")
    assert ("black lines: ±0.05 mm/s" in drawn.get_suptitle()) == told
    assert ("dashes: the part stays" in drawn.get_suptitle()) == stays
    assert (len(drawn.axes[0].collections) > 1) == told


@pytest.mark.parametrize(
    ("values", "ends"),
    [([1e5, 1e6, 1e7], [4.5, 7.5]), ([100.0, 200.0, 300.0], None), ([-2.0, 1.0, 4e3], None)],
)
def test_values_that_go_up_by_ratios_stand_at_equal_distances(
    values: list[float], ends: list[float] | None
) -> None:
    """On curves and on maps, whose cells reach half a ratio beyond the outer ones."""
    keys = {"a": values, "b": [1.0, 2.0]}
    about = {name: (name, at, {"key": f"t.{name}", "units": "?"}) for name, at in keys.items()}
    v, failure = np.arange(6.0).reshape(3, 2), np.full((3, 2), "")
    data = xr.Dataset(
        {"v_average": (tuple(keys), v), "failure": (tuple(keys), failure)}, about, {"title": "x"}
    )
    scale = "log" if ends else "linear"
    assert figure.draw(data.isel(b=[0]), "curve").axes[0].get_xscale() == scale
    drawn = figure.draw(data, "map").axes[0]
    assert (drawn.get_xscale(), drawn.get_yscale()) == ("linear", scale)
    if ends is not None:
        np.testing.assert_allclose(np.log10(drawn.get_ylim()), ends, atol=1e-9)


def test_a_kill_leaves_no_older_figure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the numbers and the figure of another sweep, whose journal is gone."""
    (tmp_path / "figure.png").write_bytes(b"old")
    monkeypatch.setattr("cosim.studies.sweep.figure.draw", lambda *_: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        sweep("held", {"coil.count": [1]}, {"run.duration": 0.01}, out=tmp_path, workers=1)
    assert {path.name for path in tmp_path.iterdir()} == {"sweep.nc", "sweep.sqlite"}


def test_a_sweep_in_other_programs_forms(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What pandas and SciPy read back is what the dataset has."""
    data = sweep(
        load("held", ["run.duration=0.02"]),
        {"friction.mu_s": [0.72, 0.8], "drive.pot_max": [0.4, 0.5, 0.6]},
        out=tmp_path,
    )
    assert main(["export", str(tmp_path), "--as", "csv,mat"]) == 0
    assert "6 points" in capsys.readouterr().out
    rows = pd.read_csv(tmp_path / "sweep.csv")
    assert rows["z_surface_pp [m]"].to_numpy() == pytest.approx(data.z_surface_pp.values.ravel())
    assert rows["pot_max"].tolist() == [0.4, 0.5, 0.6] * 2
    found = loadmat(tmp_path / "sweep.mat", squeeze_me=True, struct_as_record=False)["sweep"]
    assert found.stick_fraction.tolist() == data.stick_fraction.values.ravel().tolist()
    assert main(["export", str(tmp_path), "--as", "wav"]) == 2
    assert 'of a sweep "wav" must be one of csv, parquet, mat' in capsys.readouterr().err


def test_a_figure_of_four_keys_says_what_it_leaves_out() -> None:
    """It is the map of the first two, with the others as at the best point."""
    keys = {"a": 2, "b": 6, "c": 2, "d": 2}
    v = np.full(tuple(keys.values()), 0.001)
    v[1, 2, 0, 1] = 0.02
    data = xr.Dataset(
        {"v_average": (tuple(keys), v), "failure": (tuple(keys), np.full(v.shape, ""))},
        {
            name: (name, np.arange(n), {"key": f"t.{name}", "units": "1"})
            for name, n in keys.items()
        },
        {"title": "four"},
    )
    drawn = figure.draw(data, "four")
    said = drawn.get_suptitle().replace("\n", " ")
    assert "; drawn at t.c = 0, t.d = 1, the best" in said
    colours = drawn.axes[0].collections[0].get_array()
    assert np.argwhere(np.asarray(colours).reshape(2, 6) == 20.0).tolist() == [[1, 2]]
