"""The drive as the device's firmware outputs it: a C header with one period of DAC codes."""

from io import BytesIO
from textwrap import fill

from cosim.drive.command import shape
from cosim.drive.staircase import Staircase
from cosim.scene import changed
from cosim.scene.firmware import nearest_code, volts
from cosim.waveforms.formats.source import Format, Run, driven, lagging


def write(run: Run, file: BytesIO) -> str:
    """10-bit codes, each for 50 µs, and the code of the offset pin: V1 = 3.191 (V_offset - V_DAC),
    with 3.3 V for the code 1024. The scene is taken with ``drive.quantised``."""
    scene = driven(run, "codes")
    quantised = changed(scene, {"drive.quantised": True, "drive.loop_time": 0.0}, str(run.folder))
    made = shape(quantised)
    assert isinstance(made, Staircase)
    codes, pin = made.codes, nearest_code(made.v_offset)
    header = [
        f"/* {scene.name}: {scene.drive.waveform}, a code every 50 us, {1 / made.period:.6g} Hz */",
        f"#define OFFSET_CODE {pin} /* {volts(pin):.4g} V, PWM */",
        f"#define CODES {len(codes)}",
        "static const unsigned short codes[CODES] = {",
        fill(", ".join(map(str, codes)), 100, initial_indent="    ", subsequent_indent="    "),
        "};\n",
    ]
    file.write("\n".join(header).encode())
    return f"{len(codes)} codes, {1 / made.period:.6g} Hz{lagging(scene)}"


FORMAT = Format("codes", "codes.h", "the drive as the firmware's DAC codes", write)
