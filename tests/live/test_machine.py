"""The page's machine is that of a run: its binary, parameters, knobs and motion."""

import hashlib
import json
from typing import Any

import numpy as np
import pytest

import build_wasm
import cosim
from cosim.coupling.loop.agenda import agendas
from cosim.mechanics.stickslip import parameters
from cosim.scene import firmware, load
from tests.live.page_in_node import WEB, needs_node, run

SETTINGS = [
    "#scene=paper-limited",
    "#scene=paper-limited&drive.amplitude=6&drive.frequency=30",
    "#scene=reference&circuit.model=limited",
    "#scene=reference&circuit.model=limited&drive.waveform=sine&drive.frequency=40",
    "#scene=trial-05&circuit.model=limited&run.average=ends",
    "#scene=square&circuit.model=limited",
    "#scene=paper-limited&drive.waveform=falling-sawtooth&drive.frequency=50",
    "#scene=paper-limited&coil.polarity=-1&friction.normal_force=1.1",
    "#scene=paper-limited&drive.frequency=80&drive.amplitude=7.9&drive.offset=-2",
    "#scene=paper-limited&drive.pot_max=0.75&drive.pot_frequency=0.625&drive.pot_offset=0.25",
]
EXACT = [SETTINGS[k] for k in (1, 2, 5, 6)]
COLUMNS = {
    **{"current": 1, "z_surface": 3, "z_ram": 4, "z_part": 5, "v_surface": 6, "v_ram": 7},
    **{"v_part": 8, "a_surface": 9, "friction_force": 10, "sticking": 13},
}
"""Of a run, and where the page has them."""
STEPPED = """
const machines = given.map(({ link, times, settled }) => {
  const setting = settingOf(link), setup = setupOf(valuesOf(setting), setting.scene);
  const exports = started(new WebAssembly.Module(bytes));
  const machine = new Machine(exports, DATA.references, setup, 4000);
  let before = null;
  const rows = times.map((time, k) => {
    machine._ok(exports.machine_row(time));
    const row = [...machine.place.subarray(0, OUTPUT_COUNT)];
    if (k === settled) { before = machine.totals()[1]; exports.machine_settle(); }
    return row;
  });
  return { way: machine.totals()[1] - before, setup, rows };
});
return machines;
"""


def test_binary_is_of_these_sources() -> None:
    about = json.loads((WEB / "machine.json").read_text("utf-8"))
    binary = (WEB / "machine.wasm").read_bytes()
    assert about["sources"] == build_wasm.digest(), "run `make wasm`"
    assert about["sha256"] == hashlib.sha256(binary).hexdigest(), "run `make wasm`"


@needs_node
@pytest.mark.physics
@pytest.mark.filterwarnings("ignore")
def test_part_goes_as_far_as_in_a_run() -> None:
    """Stepped to the same times, with inputs set at the same ones."""
    given, scenes = [], []
    for link in SETTINGS:
        scene = load(link, {"run.duration": 0.6, "run.output_step": 1e-4})
        own = scene.run
        agenda = agendas(own.output_step, own.duration, own.settle, (own.duration,), own.shutter)
        pairs = [(t, w) for part in agenda for t, w in zip(part.times, part.what, strict=True)]
        times = [float(t) for t, _ in pairs if 0.0 < t <= own.duration]
        settled = next(float(t) for t, what in pairs if what & 4)
        given.append({"link": link, "times": times, "settled": times.index(settled)})
        scenes.append(scene)
    for link, scene, times, found in zip(
        SETTINGS, scenes, [each["times"] for each in given], run(STEPPED, given), strict=True
    ):
        reals, integers = parameters(scene)
        del reals["normal_force"], reals["tolerance"]
        assert found["setup"]["reals"] == reals, link
        assert found["setup"]["integers"] == integers, link
        span = scene.run.duration - scene.run.settle
        result = cosim.run(scene)
        assert found["way"] / span == pytest.approx(result.summary["v_average"], rel=1e-6), link
        _check_rows(link, result.columns, dict(zip(times, found["rows"], strict=True)))


def _check_rows(link: str, columns: dict[str, Any], rows: dict[float, list[float]]) -> None:
    """The same bits where the corners of the command are at the same bits of time."""
    places = [k for k, time in enumerate(columns["time"].tolist()) if time in rows]
    assert len(places) == 6000
    found = np.array([rows[time] for time in columns["time"][places].tolist()])
    for name, column in COLUMNS.items():
        expected = columns[name][places]
        if link in EXACT:
            assert (found[:, column] == expected).all(), (link, name)
        else:
            within = 1e-9 * np.abs(expected).max()
            np.testing.assert_allclose(found[:, column], expected, atol=within, err_msg=link)


@needs_node
def test_knobs_are_those_of_the_firmware() -> None:
    """Each code of each knob, the other two at some codes of their own."""
    code = """
    return given.map((pots) => {
      const keys = ["pot_max", "pot_frequency", "pot_offset"];
      const changes = Object.fromEntries(keys.map((key, k) => [`drive.${key}`, pots[k]]));
      const values = valuesOf({ scene: "paper-limited", changes });
      const found = ["amplitude", "frequency", "offset"].map((key) => values[`drive.${key}`]);
      return [...found, codesOf(values)];
    });
    """
    count = firmware.COUNTS
    codes = [(k, k * 7 % count, k * 11 % count) for k in range(count)]
    found = run(code, [[k / count for k in each] for each in codes])
    for each, (amplitude, frequency, offset, back) in zip(codes, found, strict=True):
        top, fast, pin = (k / count for k in each)
        assert amplitude == firmware.knob_amplitude(top)
        assert frequency == firmware.knob_frequency(fast)
        assert offset == firmware.knob_offset(pin, amplitude)
        assert tuple(back) == each


@needs_node
def test_marks_are_at_the_begin_of_periods() -> None:
    """Also where the drive is turned within one: the means on the page are over whole periods."""
    code = """
    const setup = setupOf(valuesOf({ scene: "paper-limited", changes: {} }), "paper-limited");
    const exports = started(new WebAssembly.Module(bytes));
    const machine = new Machine(exports, DATA.references, setup, 400);
    const row = new Float64Array(OUTPUT_COUNT), found = [];
    for (let k = 1; k <= 0.3 * RATE; k++) {
      machine.next(row, 0);
      const frequency = given[k];
      if (frequency) machine.turn({ ...setup.drive, frequency });
      for (const [time] of machine.marks()) found.push((time - machine.origin) * machine.frequency);
    }
    return found;
    """
    turned = {str(k): 20.0 + k / 1000 for k in range(3000, 6000, 700)}
    phases = np.array(run(code, turned))
    assert len(phases) >= 6
    np.testing.assert_allclose(phases, np.round(phases), atol=1e-9)
