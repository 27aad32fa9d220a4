"""The drive as others play it: the firmware's codes, and a source that plain ngspice reads."""

import re
from math import pi, sin
from pathlib import Path

import pytest

from cosim.cli.main import main
from tests.helpers.ngspice_alone import run

pytestmark = pytest.mark.usefixtures("undrawn")

STEPS = "drive.table=[[0, 0.5], [0.25, -0.5], [0.75, 0.0]]"
SHAPES = {
    "steps": lambda phase: 0.5 if phase < 0.25 else -0.5 if phase < 0.75 else 0.0,
    "falling-sawtooth": lambda phase: 0.5 - phase,
    "sine": lambda phase: 0.5 * sin(2 * pi * phase),
}
"""The levels of a shape over the phase, in closed form."""


def exported(folder: Path, form: str, shape: str, *settings: str) -> str:
    """What the export of 50 Hz, 8 V peak-to-peak and -1.2 V wrote."""
    sets = ["drive.frequency=50", "drive.amplitude=8", "drive.offset=-1.2", "run.duration=0.05"]
    sets += [f"drive.waveform={shape}", *settings]
    sets += [STEPS] * (shape == "steps")
    words = [word for one in sets for word in ("--set", one)]
    assert main(["run", "ideal-current", *words, "--out", str(folder)]) == 0
    assert main(["export", str(folder), "--as", form]) == 0
    (path,) = folder.glob("codes.h" if form == "codes" else "command.cir")
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("shape", SHAPES)
def test_codes_make_the_command(shape: str, tmp_path: Path) -> None:
    text = exported(tmp_path, "codes", shape)
    (listed,) = re.findall(r"codes\[CODES\] = \{(.*?)\};", text, re.DOTALL)
    codes = [int(code) for code in re.findall(r"\d+", listed)]
    defined = dict(re.findall(r"#define (\w+) (\d+)", text))
    assert int(defined["CODES"]) == len(codes) == 400  # 20 ms in steps of 50 us
    volt = 15 / 4.7 * 3.3 / 1024  # of a code at V1
    for k, code in enumerate(codes):
        made = volt * (int(defined["OFFSET_CODE"]) - code)
        # Half a code each: of the step, the amplitude and the pin.
        assert made == pytest.approx(-1.2 + 8.0 * SHAPES[shape](k / 400), abs=1.5 * volt)
    assert min(codes) >= 0 and max(codes) <= 1023


def test_codes_of_the_firmware_s_own_sawtooth(tmp_path: Path) -> None:
    """Its counter falls by the maximum times the share of the period in a step, truncated."""
    text = exported(tmp_path, "codes", "sawtooth")
    (listed,) = re.findall(r"codes\[CODES\] = \{(.*?)\};", text, re.DOTALL)
    maximum = round(8.0 * 4.7 / 15 / 3.3 * 1024)
    assert [int(c) for c in re.findall(r"\d+", listed)] == [
        maximum * (400 - k) // 400 for k in range(400)
    ]


@pytest.mark.parametrize("shape", SHAPES)
def test_plain_ngspice_plays_the_source(shape: str, tmp_path: Path) -> None:
    """The current into 1 Ohm at the end of a run is V1 there."""
    text = exported(tmp_path, "pwl", shape)
    for end in (0.0021, 0.0069, 0.0152, 0.0263):
        deck = f"Drive\n{text}R1 v1 0 1\n.tran 1e-5 {end} 0 1e-5\n.end\n"
        (final,) = re.findall(r"final = (\S+)", run(deck, tmp_path))
        phase = end * 50.0 % 1.0
        assert -float(final) == pytest.approx(-1.2 + 8.0 * SHAPES[shape](phase), abs=2e-3)


@pytest.mark.parametrize(
    ("end", "settings"),
    [
        (0.04, ("run.duration=0.0400000005",)),
        (0.1, ("run.duration=0.1", "drive.quantised=true", "drive.start_time=0.0013")),
    ],
)
def test_times_of_the_source_rise_also_where_a_run_ends_in_a_jump(
    end: float, settings: tuple[str, ...], tmp_path: Path
) -> None:
    """Half a nanosecond after it, as 2/f, rounded, may be; by rounding alone after a late drive."""
    text = exported(tmp_path, "pwl", "falling-sawtooth", *settings)
    times = [float(time) for time in re.findall(r"^\+ (\S+) \S", text, re.MULTILINE)]
    assert times == sorted(set(times)) and times[-1] == pytest.approx(end, abs=1e-9)


def test_the_ripple_that_a_source_leaves_out_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Half a volt at V1: the source has the mean of the offset pin."""
    words = ["reference", "--set", "circuit.model=full", "--set", "run.duration=0.04"]
    for ripple in ("false", "true"):
        ripples = ["--set", f"drive.pwm_ripple={ripple}", "--out", str(tmp_path)]
        assert main(["run", *words, *ripples]) == 0
        assert main(["export", str(tmp_path), "--as", "pwl"]) == 0
        told = "without the ripple of drive.pwm_ripple" in capsys.readouterr().out
        assert told == (ripple == "true")


def test_the_drive_of_one_of_two_surfaces_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file has one drive: a player must know by how much the second source lags."""
    words = ["two-surfaces", "--set", "drive.phase_deg=70", "--set", "run.duration=0.1"]
    assert main(["run", *words, "--out", str(tmp_path)]) == 0
    assert main(["export", str(tmp_path), "--as", "codes,pwl"]) == 0
    assert capsys.readouterr().out.count("of the first surface; the second lags by 70°") == 2


def test_a_run_without_a_coil_has_no_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "optimal", "--out", str(tmp_path)]) == 0
    for form in ("codes", "pwl"):
        assert main(["export", str(tmp_path), "--as", form]) == 2
        assert f'{form} needs a run with a coil, not one with circuit.model = "none"' in (
            capsys.readouterr().err
        )
