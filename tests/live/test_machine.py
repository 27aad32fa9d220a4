"""The page's machine is that of a run: its binary, parameters, knobs and motion."""

import hashlib
import json

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
    "#scene=paper-limited&drive.pot_max=0.75&drive.pot_frequency=0.625&drive.pot_offset=0.25",
]
STEPPED = """
const machines = given.map(({ link, times, settled }) => {
  const setting = settingOf(link), setup = setupOf(valuesOf(setting), setting.scene);
  const exports = started(new WebAssembly.Module(bytes));
  const machine = new Machine(exports, DATA.references, setup, 4000);
  let before = null;
  times.forEach((time, k) => {
    machine.go(time);
    if (k === settled) { before = machine.totals()[1]; exports.machine_settle(); }
  });
  return { way: machine.totals()[1] - before, setup };
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
    for link, scene, found in zip(SETTINGS, scenes, run(STEPPED, given), strict=True):
        reals, integers = parameters(scene)
        del reals["normal_force"], reals["tolerance"]
        assert found["setup"]["reals"] == reals, link
        assert found["setup"]["integers"] == integers, link
        span = scene.run.duration - scene.run.settle
        expected = cosim.run(scene).summary["v_average"]
        assert found["way"] / span == pytest.approx(expected, rel=1e-6), link


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
