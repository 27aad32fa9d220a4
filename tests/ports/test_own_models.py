"""Models in C with ``fmu/thin``, joined by ports: what they are given, in closed form."""

import subprocess
from contextlib import closing
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest

from cosim.coupling.ports.strangers import stranger
from cosim.files.resources import compiled_fmus
from cosim.fmus.pack import pack
from cosim.scene import load
from cosim.simulation.simulate import simulate
from cosim.toolchain.libraries import SUFFIX
from cosim.toolchain.processes import in_place

THIN = Path(__file__).parents[2] / "fmu" / "thin"
MODEL = """
#include <math.h>
#include <stdio.h>
#include "model.h"
enum { TIME, U, W, Y, Q, FIXED, EVERY, S };
static const Variable variables[] = {
    {INPUT, "u", "V", 0.0, "Input", 0},
    {INPUT, "w", "V", 0.0, "Input", 0},
    {OUTPUT, "y", "V", 0.0, "u + w, at once", 0},
    {OUTPUT, "q", "V.s", 0.0, "The integral of u", 0},
    {PARAMETER, "fixed", "s", 0.0, "The only step, or 0", 0},
    {PARAMETER, "every", "s", 0.0, "Time between samples, or 0", 0},
    {OUTPUT, "s", "V", 0.0, "How many samples", 0},
};
static void outputs(Run *run) { run->v[Y] = run->v[U] + run->v[W]; }
static int step_by(Run *run, double h)
{
    const double only = run->v[FIXED];
    if (only > 0.0 && fabs(h - only) > 1e-6 * only) {
        snprintf(run->why, 512, "my step is %g s, not %g s", only, h);
        return 0;
    }
    run->v[Q] += h * run->v[U];
    if (run->v[EVERY] > 0.0)
        run->v[S] = floor((run->time + h) / run->v[EVERY] + 1e-6);
    return 1;
}
static const Model sum = {
    .name = "sum", .about = "u + w", .token = "sum-1", .variables = variables, .count = 7,
    .step = 1e-4, .step_by = step_by, .outputs = outputs,
};
const Model *model(const char *resources, char why[512])
{
    (void)resources, (void)why;
    return &sum;
}
"""
SCENE = """
[drive]
waveform = "sine"
frequency = 100.0
amplitude = 2.0
offset = 0.0
[circuit]
model = "file"
netlist = "own.cir"
max_step = 1e-4
[[fmu]]
name = "g"
file = "sum.fmu"
parameters = { PARAMETERS }
PORTS
[[port]]
from = "g.y"
source = "Vx"
[run]
duration = 0.04
settle = 0.02
output_step = 1e-4
"""
RC = "Vin in 0 0\nRin in 0 1k\nVx a 0 0\nR1 a b 1k\nC1 b 0 0.1u\n"
FROM_DRIVE = '[[port]]\nfrom = "drive"\nto = "g.u"'
BY_CIRCUIT = '[[port]]\nfrom = "drive"\nsource = "Vin"\n[[port]]\nprobe = "v(in)"\nto = "g.u"'


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("model")
    (folder / "sum.c").write_text(MODEL)
    path = folder / f"sum{SUFFIX}"
    sources = [folder / "sum.c", *THIN.glob("*.c")]
    subprocess.run(
        [
            "cc",
            "-shared",
            "-fPIC",
            "-O2",
            f"-I{THIN}",
            f"-I{THIN.parent / 'include'}",
            "-o",
            path,
            *sources,
            "-lm",
        ],
        check=True,
    )
    return path


def run(
    folder: Path, library: Path, ports: str, settings: dict[str, Any], given: str = "", rc: str = RC
) -> Any:
    pack(library, folder / "sum.fmu", 2)
    if settings.pop("strict", False):
        with ZipFile(folder / "sum.fmu") as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        about = files["modelDescription.xml"].decode()
        word = 'canHandleVariableCommunicationStepSize="'
        assert f'{word}true"' in about
        files["modelDescription.xml"] = about.replace(f'{word}true"', f'{word}false"').encode()
        with ZipFile(folder / "sum.fmu", "w") as archive:
            for name, content in files.items():
                archive.writestr(name, content)
    (folder / "own.cir").write_text(f"own\n{rc}.end\n")
    text = SCENE.replace("PARAMETERS", given).replace("PORTS", ports)
    (folder / "own.toml").write_text(text)
    with in_place():
        return simulate(load(folder / "own.toml", settings))


CHAIN = """
[[fmu]]
name = "b"
file = "sum.fmu"
[[port]]
from = "drive"
to = "b.w"
[[port]]
from = "b.y"
to = "g.u"
"""


@pytest.mark.parametrize(
    ("method", "ports"),
    [
        ("redo", FROM_DRIVE),
        ("redo", BY_CIRCUIT),
        ("auto", FROM_DRIVE),
        ("auto", CHAIN),
        ("macro-steps", CHAIN),
    ],
)
def test_what_is_fed_through_from_the_drive_does_not_lag(
    tmp_path: Path, library: Path, method: str, ports: str
) -> None:
    """Half a step of 0.1 ms would be 0.03 of the amplitude."""
    given = {"coupling.method": method}
    columns = run(tmp_path, library, ports, given).columns
    true = np.sin(2.0 * np.pi * 100.0 * columns["time"])
    assert np.abs(columns["g.y"] - true).max() < 2e-3


@pytest.mark.parametrize("ports", [FROM_DRIVE, BY_CIRCUIT])
@pytest.mark.parametrize("step", [1e-3, 2.5e-3, 5e-3])
def test_a_mean_over_a_macro_step_carries_the_integral(
    tmp_path: Path, library: Path, ports: str, step: float
) -> None:
    """(1 - cos ωt)/ω, of which these steps meet the greatest value."""
    given = {"coupling.method": "macro-steps", "coupling.macro_step": step}
    columns = run(tmp_path, library, ports, given).columns
    assert columns["g.q"].max() == pytest.approx(1.0 / (np.pi * 100.0), rel=2e-3)


SAMPLED = """
[[fmu]]
name = "c"
file = "sum.fmu"
parameters = { every = 1e-3 }
[[port]]
from = "c.s"
to = "g.u"
slope = "held"
"""


@pytest.mark.parametrize("step", [2.5e-4, 1e-3])
def test_a_sampled_output_is_held_into_another_fmu(
    tmp_path: Path, library: Path, step: float
) -> None:
    """s = k from k ms on. Half a macro step of lead would take away that much of the delay of a
    sampled loop, and here add up to 11 % of the integral in 10 ms, the sum of 0 to 9 times 1 ms."""
    given = {"coupling.method": "macro-steps", "coupling.macro_step": step}
    columns = run(tmp_path, library, SAMPLED, given).columns
    assert columns["c.s"][100] == pytest.approx(10.0)
    assert columns["g.q"][100] == pytest.approx(0.045, rel=1e-9)


def test_outputs_are_those_of_the_start_values(tmp_path: Path, library: Path) -> None:
    columns = run(tmp_path, library, FROM_DRIVE, {}, "w = 0.25").columns
    assert columns["g.y"][0] == 0.25


@pytest.mark.parametrize("given", ["", "u = 5.0"])
def test_a_start_value_of_an_input_that_is_fed(tmp_path: Path, library: Path, given: str) -> None:
    """The FMU is a resistor of 1 kΩ: 1 V over 3 kΩ."""
    rc = "V1 in 0 1\nR1 in a 1k\nVx a b 0\nC1 b 0 1n\nR2 b 0 1k\n"
    ports = '[[port]]\nprobe = "i(Vx)"\nto = "g.u"\nscale = 1000.0'
    result = run(tmp_path, library, ports, {"coupling.method": "redo"}, given, rc)
    assert result.summary["i(Vx).mean"] == pytest.approx(1.0 / 3e3, rel=1e-4)


@pytest.mark.parametrize("duration", [0.04, 0.0405])
def test_an_fmu_of_fixed_steps_is_given_no_others(
    tmp_path: Path, library: Path, duration: float
) -> None:
    """Neither where the drive jumps, every 33.3 ms, nor at the end."""
    given = {"coupling.method": "auto", "coupling.macro_step": 1e-3, "strict": True}
    given |= {"drive.waveform": "sawtooth", "drive.frequency": 30.0, "run.duration": duration}
    result = run(tmp_path, library, BY_CIRCUIT, given, "fixed = 1e-3")
    assert result.summary["method"] == "macro-steps" and result.summary["fmu_steps"] == 40


def test_steps_of_its_own_are_told(tmp_path: Path, library: Path) -> None:
    given = {"coupling.method": "step-locked"}
    (note,) = run(tmp_path, library, "", given, "every = 1e-3").summary["notes"]
    assert "outputs of g changed in only 40 of " in note and "mostly of 0.001 s" in note


def test_what_it_feeds_through_is_said(tmp_path: Path, library: Path) -> None:
    """In both versions; so `auto` repeats steps by itself, as exact as one netlist."""
    for version, first in ((2, 2), (3, 1)):
        pack(library, tmp_path / "sum.fmu", version)
        about = ZipFile(tmp_path / "sum.fmu").read("modelDescription.xml").decode()
        outputs = about.partition("<ModelStructure>")[2].partition("<InitialUnknown")[0]
        assert outputs.count("dependencies") == 1
        assert f'dependencies="{first} {first + 1}"' in outputs
    rc = "V1 in 0 1\nR1 in a 1k\nVx a b 0\nC1 b 0 1n\nR2 b 0 1k\n"
    ports = '[[port]]\nprobe = "i(Vx)"\nto = "g.u"\nscale = 1000.0'
    result = run(tmp_path, library, ports, {}, "", rc)
    assert result.summary["method"] == "redo"
    assert result.summary["i(Vx).mean"] == pytest.approx(1.0 / 3e3, rel=1e-4)


CIRCLE = """
[[fmu]]
name = "b"
file = "sum.fmu"
[[fmu]]
name = "c"
file = "sum.fmu"
parameters = { every = 1e-3 }
[[port]]
from = "b.y"
to = "g.u"
scale = -0.4
[[port]]
from = "g.y"
to = "b.u"
[[port]]
from = "drive"
to = "b.w"
scale = 1e-15
[[port]]
from = "b.y"
to = "c.w"
[[port]]
from = "c.s"
to = "g.w"
slope = "held"
"""


def test_a_jump_tells_nothing_of_what_agrees_already(tmp_path: Path, library: Path) -> None:
    """y = s - 0.4 (y + 1e-15 drive) in a circle, of which s jumps by 1 every ms. What agreed before
    s was right has hardly moved, so it must not learn from s how it responds."""
    given = {"coupling.method": "redo", "run.duration": 2.5e-3, "run.settle": 0.0}
    columns = run(tmp_path, library, CIRCLE, given).columns
    assert columns["c.s"][-1] == 2.0
    assert columns["g.y"][1:] == pytest.approx(columns["c.s"][1:] / 1.4, rel=1e-4, abs=1e-9)


@pytest.mark.parametrize("h", [100.0, 1e7])
def test_a_step_of_any_length_ends_where_the_jaw_rests(h: float) -> None:
    """2 N/A press the spring. More of its own steps than an int holds lead through 1e7 s."""
    jaw = stranger(str(compiled_fmus()[0] / "jaw"))
    with closing(jaw.instance({"current": 0.6})) as made:
        made.raw.doStep(0.0, h)
        (force,) = made.raw.getFloat64([jaw.variables["normal_force"].reference])
    assert force == pytest.approx(1.2, rel=1e-9)
