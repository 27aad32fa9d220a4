"""The printed table says what a reader must know of the numbers."""

import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from cosim.files.resources import circuits
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.waveforms.columns import UNITS
from cosim.waveforms.figure import draw_own
from cosim.waveforms.formats.tracker import laid_over
from cosim.waveforms.quantities import printed
from cosim.waveforms.report import LIMITS, table

SHORT = ["run.duration=0.1", "run.settle=0.05"]
SLOW = ["drive.quantised=true", "drive.loop_time=2.2e-5"]


@pytest.mark.parametrize(
    "overrides, told",
    [
        (SHORT, None),
        (["run.duration=0.1", "run.settle=0.033"], "1.34 periods"),
        ([*SHORT, "run.settle=0.05", "drive.frequency=50.8"], "2.54 periods"),
        # 3000 passes of the firmware's loop, 66 ms
        ([*SLOW, "run.duration=0.198", "run.settle=0.066"], None),
        ([*SLOW, "run.duration=0.2", "run.settle=0.1"], "1.515 periods"),
    ],
)
def test_broken_periods_are_told(overrides: list[str], told: str | None) -> None:
    scene = load("reference", ["circuit.model=ideal", *overrides])
    text = table(scene, simulate(scene).summary, UNITS)
    assert ("truer mean" in text) == (told is not None)
    assert told is None or told in text


@pytest.mark.checked
@pytest.mark.physics
@pytest.mark.parametrize(("periods", "whole"), [(36, True), (38, False)])
def test_periods_that_break_the_motions_repeats_are_told(periods: int, whole: bool) -> None:
    """It repeats every three: the mean over the last three is the truth."""
    scene = load(
        "reference",
        {
            **{"circuit.model": "limited", "drive.frequency": 76, "drive.amplitude": 7},
            **{"run.duration": 1.5, "run.settle": 1.5 - periods / 76, "run.output_step": 1 / 7600},
        },
    )
    result = simulate(scene, checks="usual")
    height = result.columns["z_part"]
    truth = (height[-1] - height[-301]) / (3 / 76)
    assert result.summary["motion_periods"] == 3
    assert (result.summary["v_average"] == pytest.approx(truth, rel=2e-2)) == whole
    told = "38 periods; a multiple of the motion's 3 gives a truer mean"
    assert (told in table(scene, result.summary, UNITS)) != whole


def test_a_slope_is_read_as_that_of_a_trials_record() -> None:
    """Over the record's own length: whole periods would be another reading."""
    broken = ["run.duration=0.1", "run.settle=0.033", "run.average=slope"]
    scene = load("reference", ["circuit.model=ideal", *broken])
    text = table(scene, simulate(scene).summary, UNITS)
    assert "1.34 periods, by the slope in a camera's frames" in text and "truer" not in text


@pytest.mark.parametrize("more", [[], ["circuit.model=full", "drive.pwm_ripple=true"]])
def test_a_cycle_is_one_of_the_real_command(more: list[str]) -> None:
    """As long as from one fall of V1 to the next: 66 ms where 50 ms are commanded."""
    duration = 0.002 if more else 0.198
    overrides = ["circuit.model=ideal", *SLOW, "run.output_step=2.2e-5", "run.settle=0", *more]
    result = simulate(load("reference", [*overrides, f"run.duration={duration}"]))
    if not more:
        time, command = result.columns["time"], result.columns["command"]
        falls = time[1:][np.diff(command) < -1.0]
        assert np.diff(falls) == pytest.approx(0.066, rel=1e-3)
    summary = result.summary
    assert summary["transport_per_cycle"] == pytest.approx(0.066 * summary["v_average"], rel=1e-12)
    assert laid_over(result.scene) == (0.0, pytest.approx(0.066))
    picture = result.plot()
    words = [picture.get_suptitle(), *(axis.get_title(loc="left") for axis in picture.axes)]
    words += [axis.get_title() for axis in picture.axes]
    assert any("sawtooth 15.15 Hz (20 Hz commanded)" in text for text in words)


@pytest.mark.parametrize(("mu", "rows"), [(0.0, ["slip"]), (0.1, ["up", "down"])])
def test_both_ways_share_a_row_where_no_plate_parts_them(mu: float, rows: list[str]) -> None:
    """A row of the budget more only where it says more: from the plate's friction."""
    scene = load("held", {"friction.mu_plate": mu, "run.duration": 0.1})
    said = [
        line.split("beyond")[0].split()
        for line in table(scene, simulate(scene).summary, {}).splitlines()
        if "beyond" in line
    ]
    assert [words[-1] for words in said] == rows


def test_a_large_energy_residual_is_told() -> None:
    scene = load("reference", ["circuit.model=ideal", *SHORT])
    summary = dict(simulate(scene).summary)
    assert "too much" not in table(scene, summary, UNITS)
    assert "too much" in table(scene, summary | {"energy_residual": 0.02}, UNITS)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("home")  # of all netlists: one worker may read them


@pytest.mark.parametrize("climit", [None, 0, 1])
def test_limits_that_a_netlist_does_not_tell_of_are_not_known(
    climit: int | None, home: Path
) -> None:
    """Not 0, nor never."""
    path = circuits() / "examples" / "h_bridge.cir"
    bridge = path.read_text(encoding="utf-8")
    told = re.sub(r"(?m)^Bswing.*\n", "" if climit is None else f"Vc climit 0 {climit}\n", bridge)
    netlist = home / "silent.cir"
    netlist.write_text(told, encoding="utf-8")
    own = ["circuit.model=file", f"circuit.netlist={netlist}", *SHORT, "run.duration=0.06"]
    scene = load("reference", own)
    summary = simulate(scene).summary
    limits = {key for key in summary if key in ("saturated_fraction", *LIMITS)}
    assert limits == (set() if climit is None else {"current_limit_fraction"})
    lines = table(scene, summary, UNITS).splitlines()
    line = next(line for line in lines if "amplifier at a limit" in line)
    assert "not known: the netlist has no node swing" in line and "never" not in line
    assert ("current limit 100 % of the time" in line) == (climit == 1)


def test_rigid_walls_have_no_peak_and_rest_no_sign() -> None:
    rigid = load("reference", ["circuit.model=ideal", *SHORT, "mechanics.contact=rigid"])
    assert "without bound" in table(rigid, simulate(rigid).summary, UNITS)
    held = load("held", SHORT)
    lines = table(held, simulate(held).summary, UNITS).splitlines()
    assert any(line.split() == ["surface", "velocity", "0", "…", "0", "mm/s"] for line in lines)


@pytest.mark.parametrize(
    "still", [["held"], ["paper-limited", "drive.amplitude=0", "drive.offset=0"]]
)
def test_a_figure_in_which_nothing_moves(still: list[str]) -> None:
    """No label is cut off, no axis magnifies rounding, and 0 has no sign."""
    figure = simulate(load(still[0], [*SHORT, *still[1:]])).plot()
    figure.png()
    assert "at 0.00 mm/s" in figure.get_suptitle()
    for axis in figure.axes:
        box = axis.yaxis.label.get_window_extent()
        assert box.x0 >= 0.0 and box.x1 <= figure.bbox.x1
        assert axis.yaxis.get_offset_text().get_text() == ""


@pytest.mark.parametrize("change", ["mechanics.contact=rigid", "drive.phase_deg=270"])
def test_no_legend_lies_on_its_title(change: str) -> None:
    figure = simulate(load("two-surfaces", [*SHORT, change])).plot()
    figure.png()
    heads = 0
    for axis in figure.axes:
        legend, title = axis.get_legend(), axis.get_title(loc="left")
        for text in axis.findobj(Text):
            if legend and title and text.get_text() == title:  # pyright: ignore
                heads += 1
                assert not legend.get_window_extent().overlaps(text.get_window_extent()), title
    assert heads == 6


def test_ports_of_which_all_numbers_are_zero() -> None:
    scene = load("dc-motor")
    whats = ("mean", "rms", "least", "greatest")
    counts = {"circuit_steps": 9, "fmu_steps": 9, "steps_repeated": 0, "wall_time": 1.0}
    counts |= {"method": "redo", "meas.loudest": 0.25}
    zeros = {f"rotor.omega.{what}": 0.0 for what in whats}
    told = table(scene, zeros | counts, {"rotor.omega": "rad/s"})
    assert "1 other is 0 after settling" in told and re.search(r"loudest +0\.25", told)


def test_of_many_waveforms_those_come_first_that_are_asked_for() -> None:
    """Those that ports join, which stand last in the file; the others up to a dozen
    panels and a score of rows."""
    scene = load("closed-grip")
    asked = ["jaw.normal_force", "rig.z_part", "control.out", "Vcommand", "i(Vemf)"]
    names = [*(f"rig.y{k}" for k in range(40)), *asked]
    whats = ("mean", "rms", "least", "greatest")
    summary: dict[str, float | str] = {f"{name}.{what}": 1.0 for name in names for what in whats}
    summary["rig.y39.rms"] = 0.0
    summary |= dict.fromkeys(("circuit_steps", "fmu_steps", "steps_repeated", "wall_time"), 0)
    first, *rows = table(scene, summary, dict.fromkeys(names, "1")).splitlines()
    shown = [*asked, *(f"rig.y{k}" for k in range(15))]
    assert "mean" in first and [row.split()[0] for row in rows[:20]] == shown
    assert rows[20].strip() == "24 more in summary.json; 1 other is 0 after settling"
    waves = {name: np.array([0.0, 1.0]) for name in ("time", *names)}
    figure = draw_own(scene, waves, dict.fromkeys(names, "rad/s2"))
    assert [axis.get_title("left") for axis in figure.axes] == shown[:12]
    assert {axis.get_ylabel() for axis in figure.axes} == {"[rad/s²]"}


@pytest.mark.parametrize(
    ("unit", "words"),
    [("m/s2", "m/s²"), ("kg.m2", "kg.m²"), ("N/m3", "N/m³"), ("N/m1.5", "N/m^1.5"), ("H", "H")],
)
def test_units_are_printed_as_people_write_them(unit: str, words: str) -> None:
    assert printed(unit) == words


def test_heat_that_goes_on_is_told_in_plain_words() -> None:
    scene = load("reference", ["circuit.model=ideal", *SHORT])
    assert "K in continuous use (estimate)" in table(scene, simulate(scene).summary, UNITS)
