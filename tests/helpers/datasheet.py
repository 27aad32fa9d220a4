"""What the circuits must measure, row by row, and the table of what they do.

``check`` holds a measurement against its row and keeps it; ``write`` makes
``results/datasheet.md`` and ``.csv`` of a complete set, which is the same bytes for the same
ngspice. Measured values are rounded to what other versions of ngspice share.
"""

import csv
import io
import os
from dataclasses import dataclass
from pathlib import Path

RESULTS = Path(__file__).resolve().parents[2] / "results"


@dataclass(frozen=True)
class Row:
    quantity: str
    unit: str
    source: str
    expected: float
    tolerance: float
    decimals: int
    """Of the measured value, as written; coarse enough that it is not near a rounding edge."""


LM348, OPA548 = "LM348 data sheet SNOSBT8", "OPA548 data sheet SBOS070D"
SCHEMATIC, FIRMWARE, HAND = "schematic rev 1.0", "firmware", "hand calculation"
RC = "schematic, exponential of the RC"

ROWS = {
    "lm348 gain": Row("LM348 open-loop gain", "dB", LM348, 104.08, 0.02, 2),
    "lm348 gbw": Row("LM348 gain-bandwidth product", "MHz", LM348, 1.0, 0.005, 3),
    "lm348 slew 1": Row("LM348 slew rate, rising", "V/µs", LM348, 0.5, 0.005, 3),
    "lm348 slew -1": Row("LM348 slew rate, falling", "V/µs", LM348, -0.5, 0.005, 3),
    "lm348 swing 1": Row("LM348 output, upper limit at ±18 V", "V", LM348, 15.0, 0.075, 2),
    "lm348 swing -1": Row("LM348 output, lower limit at ±18 V", "V", LM348, -15.0, 0.075, 2),
    "opa548 gain": Row("OPA548 open-loop gain", "dB", OPA548, 98.0, 0.02, 2),
    "opa548 gbw": Row("OPA548 gain-bandwidth product", "MHz", OPA548, 1.0, 0.005, 3),
    "opa548 slew 1": Row("OPA548 slew rate, rising", "V/µs", OPA548, 10.0, 0.1, 2),
    "opa548 slew -1": Row("OPA548 slew rate, falling", "V/µs", OPA548, -10.0, 0.1, 2),
    "loss 0.6": Row("OPA548 swing loss, sourcing 0.6 A", "V", OPA548, 2.1, 0.042, 2),
    "loss 3.0": Row("OPA548 swing loss, sourcing 3 A", "V", OPA548, 3.7, 0.074, 2),
    "loss -0.6": Row("OPA548 swing loss, sinking 0.6 A", "V", OPA548, 1.0, 0.02, 2),
    "loss -3.0": Row("OPA548 swing loss, sinking 3 A", "V", OPA548, 3.3, 0.066, 2),
    **{
        f"limit {name} {sign}": Row(
            f"OPA548 current limit, R_CL = {name}, {way}",
            "A",
            f"{OPA548}: 15000·4.75/(13750 + R_CL)",
            sign * limit,
            2e-3 * limit,
            2 if name == "14.7 kΩ" else 3,  # 2.5045 would lie on the edge of the third
        )
        for name, limit in (
            ("14.7 kΩ", 15000 * 4.75 / (13750 + 14.7e3)),
            ("4.02 kΩ", 15000 * 4.75 / (13750 + 4.02e3)),
            ("57.6 kΩ", 15000 * 4.75 / (13750 + 57.6e3)),
        )
        for sign, way in ((1, "sourcing"), (-1, "sinking"))
    },
    "difference gain": Row(
        "Difference amplifier, V1/(V_offset − V_DAC)", "1", SCHEMATIC, 15 / 4.7, 3e-3, 4
    ),
    "transconductance": Row("Current source, i/V1", "S", SCHEMATIC, 0.25, 2.5e-4, 4),
    "offset corner": Row("Offset filter, −3 dB", "Hz", SCHEMATIC, 15.9155, 0.08, 1),
    "pwm filter": Row("PWM ripple at the filter, duty 1/2, p-p", "V", RC, 0.168813, 1.7e-3, 3),
    "pwm v1": Row("PWM ripple at V1, duty 1/2, p-p", "V", RC, 0.538763, 5.4e-3, 2),
    "pwm filter 272": Row(
        "PWM ripple at the filter, duty 272/1024, p-p", "V", RC, 0.131745, 1.4e-3, 3
    ),
    "dac levels": Row("DAC, levels of a full-scale period at 5 Hz", "1", FIRMWARE, 1024, 0, 0),
    "dac step": Row("DAC, interval of the steps at V1", "µs", FIRMWARE, 50.0, 0.2, 1),
    "dac lsb": Row(
        "DAC, coil current of one code", "mA", "3.3 V/1024 · 15/4.7 / 4 Ω", -2.57127, 0.003, 3
    ),
    "pm carlton": Row("Phase margin, 7.1 Ω, 1.2 mH", "°", HAND, 3.692, 0.02, 2),
    "fc carlton": Row("Unity loop gain, 7.1 Ω, 1.2 mH", "kHz", HAND, 23.0094, 0.05, 1),
    "pm small": Row("Phase margin, 8 Ω, 0.2 mH", "°", HAND, 9.687, 0.02, 2),
    "fc small": Row("Unity loop gain, 8 Ω, 0.2 mH", "kHz", HAND, 56.0163, 0.1, 1),
    "pm nd90": Row(
        "Phase margin, LR2 ND90-8: 7.37 Ω, 0.87 mH + 1.46 mH ∥ 3.83 Ω", "°", HAND, 5.910, 0.02, 2
    ),
    "pm proxy": Row("Phase margin, the same with 4.3 Ω", "°", HAND, 4.723, 0.02, 2),
    "pm lcr 12": Row(
        "Phase margin, 7.1 Ω, 1.2 mH at 100 kHz, of it 1.46 mH ∥ 26.1 Ω", "°", HAND, 12.018, 0.02, 2
    ),
    "pm lcr 22": Row(
        "Phase margin, 7.1 Ω, 1.2 mH at 100 kHz, of it 1.46 mH ∥ 68.6 Ω", "°", HAND, 22.034, 0.02, 2
    ),
    "pm half 12": Row("Phase margin, 7.1 Ω, 0.6 mH + 0.6 mH ∥ 15.2 Ω", "°", HAND, 12.043, 0.02, 2),
    "pm half 22": Row("Phase margin, 7.1 Ω, 0.6 mH + 0.6 mH ∥ 48.2 Ω", "°", HAND, 22.027, 0.02, 2),
    **{
        f"{kind} {case}": Row(
            f"{what}, 7.1 Ω, 1.2 mH, output {text}", unit, HAND, value, tolerance, decimals
        )
        for case, text, margin, decay in (
            ("0", "0 Ω", None, 4665),
            ("6", "6 Ω", 5.669, 7165),
            ("6 10n", "6 Ω, snubber 10 Ω + 10 nF", 5.173, 6537),
            ("6 100n", "6 Ω, snubber 10 Ω + 100 nF", 0.920, 1132),
        )
        for kind, what, unit, value, tolerance, decimals in (
            ("pm snubber", "Phase margin", "°", margin, 0.02, 2),
            ("decay", "Decay rate of the ringing after a flyback", "1/s", decay, 0.01 * decay, -1),
        )
        if value is not None
    },
}

NOTES = """\
Measured in `circuits/` by `tests/circuit/test_netlists.py`, which holds each row to its
tolerance and writes this table when all of them hold. Hand calculations do not use ngspice.

**Eddy losses.** The loop gain is GBW/(jf) · 4 Ω/(Z + 4 Ω), so at the crossover the phase margin is
90° less the phase of Z + 4 Ω: it takes *resistance at about 20 kHz*. A branch L2 ∥ R2 gives at most
R2 there. The LR2 numbers of the ND90-8 (R2 = 3.83 Ω, fitted at audio frequencies, corner 417 Hz)
therefore make 4.7…5.9°, hardly more than the plain 3.7°. On the Carlton coil 12…22° come out

- with 1.2 mH as an LCR meter's series inductance at 100 kHz (Le = 1.2 mH less the branch's share):
  L2 = 1.46 mH with R2 = 26.1…68.6 Ω, L2 = 2.4 mH with 25.7…60.7 Ω; below L2 = 0.42 mH not even
  12°, below 1.14 mH not 22°;
- with 1.2 mH in all: Le = L2 = 0.6 mH with R2 = 15.2…48.2 Ω, Le = 0.8 mH (L2 = 0.4 mH) with
  R2 = 21.2 Ω for 12°, 22° never; Le = 0.3 mH (L2 = 0.9 mH) with 7.2…23.3 Ω;
- with a semi-inductance K (jω)^n that reads 1.2 mH at 100 kHz: n = 0.90…0.79 (n = 0.7, usual for
  loudspeakers, 29°).

So 12…22° is what a coil with eddy losses like a loudspeaker's may have, at `coil.eddy_resistance`
of 15…70 Ω; it is not what the ND90-8's LR2 model gives, and nobody has measured the Carlton.

**Snubber.** The schematic has none. With no output resistance it changes only the amplifier's own
current. With one (assumed 6 Ω, open loop; Texas Instruments' remark, not the data sheet's) the
resistance alone damps the current loop, and the snubber undoes that: its capacitance and the output
resistance add lag at 23 kHz. With 10 Ω + 100 nF the loop is unstable from 8.1 Ω of output
resistance on. The data sheet means it for the output stage's own oscillation in the MHz range,
which is not modelled: 10 nF does next to no harm, 100 nF does.
"""

_measured: dict[str, float] = {}


def check(key: str, measured: float) -> None:
    """Fail unless ``measured`` is within the tolerance of the row; keep it for the table."""
    row = ROWS[key]
    off = abs(float(measured) - row.expected)
    assert off <= row.tolerance, f"{row.quantity}: {measured} {row.unit}, not {row.expected}"
    _measured[key] = float(measured)


def missing() -> list[str]:
    """Rows without a measurement so far."""
    return [key for key in ROWS if key not in _measured]


def _cells() -> list[list[str]]:
    lines = []
    for key, row in ROWS.items():
        found = f"{round(_measured[key], row.decimals) + 0.0:.{max(row.decimals, 0)}f}"
        lines.append(
            [row.quantity, row.unit, row.source, f"{row.expected:.5g}", found,
             f"{row.tolerance:.2g}"]
        )  # fmt: skip
    return lines


def texts() -> dict[str, str]:
    """The files by name."""
    head = ["quantity", "unit", "source", "expected", "measured", "tolerance"]
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(head)
    writer.writerows([cell.strip() for cell in line] for line in _cells())
    lines = ["| " + " | ".join(head) + " |", "|---|---|---|---:|---:|---:|"]
    for line in _cells():
        unit = "" if line[1] == "1" else line[1]
        lines.append("| " + " | ".join([line[0], unit, *line[2:5], "±" + line[5]]) + " |")
    text = "# The circuits against their data sheets\n\n" + "\n".join(lines) + "\n\n" + NOTES
    return {"datasheet.csv": table.getvalue(), "datasheet.md": text}


def write(folder: Path = RESULTS) -> None:
    """Write the complete table, both files or none; files that would not change are left alone."""
    ready: list[tuple[Path, Path]] = []
    try:
        for name, text in texts().items():
            path = folder / name
            if path.is_file() and path.read_bytes() == text.encode():
                continue
            part = folder / f".{name}.{os.getpid()}"
            ready.append((part, path))
            part.write_bytes(text.encode())
        for part, path in ready:
            part.replace(path)
    finally:
        for part, _ in ready:
            part.unlink(missing_ok=True)
