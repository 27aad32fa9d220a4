"""The page in a browser: it runs, asks nobody, and what is turned turns."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import psutil
import pytest

import cosim
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.files.resources import circuits
from cosim.live.page import CIRCUITS, opened
from cosim.live.server import Server
from cosim.scene import load
from tests.helpers import needs
from tests.ports.test_machine import UNSAVED, renamed

AMPLITUDE = """() => {
  let low = Infinity, high = -Infinity;
  for (let row = history_.last - 9600; row <= history_.last; row++) {
    const v = history_.value(row, 0);
    low = Math.min(low, v);
    high = Math.max(high, v);
  }
  return high - low;
}"""
RUNS = "() => history_.last > 3 * 48000 && state.found"
"""Three seconds: the means are of the last one, so the start is over."""


@pytest.fixture
def server() -> Iterator[Server]:
    with Server(*opened("paper-limited")) as found:
        Thread(target=found.serve_forever, daemon=True).start()
        yield found
        found.shutdown()


def test_page_is_one_small_file(tmp_path: Path) -> None:
    assert main(["live", "reference", "--out", str(tmp_path / "page.html")]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]
    text = (tmp_path / "page.html").read_text("utf-8")
    assert len(text.encode()) < 400_000
    assert "connect-src 'none'" in text and "http://" not in text and "https://" not in text


@pytest.mark.filterwarnings("ignore")
def test_page_from_a_file(tab: Any, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    main(["live", "paper", "--set", "drive.amplitude=6", "--out", str(path)])
    tab.goto(path.as_uri())
    tab.wait_for_function(RUNS)
    assert tab.evaluate(AMPLITUDE) == pytest.approx(6.0, rel=2e-3)
    expected = cosim.run("paper-limited", {"drive.amplitude": 6.0}).summary["v_average"]
    assert tab.evaluate("() => state.found.velocity") == pytest.approx(expected, rel=0.01)

    tab.focus("#knob-amplitude")
    tab.keyboard.press("PageDown")  # 40 codes
    tab.wait_for_timeout(1500)
    turned = tab.evaluate("() => state.values['drive.amplitude']")
    assert turned == pytest.approx(6.0 - 40 * 10.53 / 1024, abs=0.01)
    assert tab.evaluate(AMPLITUDE) == pytest.approx(turned, rel=2e-3)
    assert "drive.pot_max=" in tab.url

    measured = [span.partition(":")[0] for span in tab.locator("#measure span").all_inner_texts()]
    assert len({*measured}) == 6, "B−A, and each panel by its name"
    twice = "for (let k = 0; k < 2; k++) $('sound').click();"
    assert tab.evaluate(f"() => {{ {twice} return $('sound').textContent; }}") == "Starting …"
    tab.wait_for_function("() => audio && audio.state === 'running' && history_.last > 4800")
    for wide in (390, 320):
        tab.set_viewport_size({"width": wide, "height": 844})
        assert tab.evaluate("() => document.documentElement.scrollWidth") <= wide
    assert not tab.faults and not tab.inner_text("#fault")
    assert [url for url in tab.asked if not url.startswith(("blob:", "data:"))] == [path.as_uri()]


def test_link_of_a_stranger(tab: Any, tmp_path: Path) -> None:
    """Its words are text, and an unknown setting leaves the page at its own."""
    path = tmp_path / "page.html"
    main(["live", "--out", str(path)])
    tab.goto(f"{path.as_uri()}#scene=<img src=x onerror=alert(1)>")
    tab.wait_for_function(RUNS)
    assert "no scene" in tab.inner_text("#fault") and not tab.faults
    assert tab.locator("img").count() == 0

    tab.goto(f"{path.as_uri()}#scene=paper&drive.amplitude=500")  # in the open page
    tab.wait_for_timeout(300)
    assert "must be a number from 0 to 100" in tab.inner_text("#fault")
    tab.goto(f"{path.as_uri()}#scene=paper&drive.amplitude=5")
    tab.wait_for_timeout(300)
    assert not tab.inner_text("#fault")
    assert tab.evaluate("() => state.values['drive.amplitude']") == 5

    tab.evaluate("() => { location.hash = '#scene=paper&friction.mu_s=0.1'; }")
    tab.wait_for_function("() => document.getElementById('fault').textContent.includes('refused')")


@pytest.mark.filterwarnings("ignore")
def test_the_grip_turns_up_from_any_value(tab: Any, tmp_path: Path) -> None:
    """Also where a scene's is beyond the knob's end of 2 N, which another scene has again."""
    path = tmp_path / "page.html"
    main(["live", "gripper-169g", "--out", str(path)])
    own = load("gripper-169g").friction.normal_force
    assert own > 2.0
    tab.goto(path.as_uri())
    for key, expected in (("ArrowUp", own), ("End", own), ("PageDown", own * (1 - 120 / 1023))):
        tab.press("#knob-grip", key)
        found = tab.evaluate("() => state.values['friction.normal_force']")
        assert found == pytest.approx(expected, abs=1e-3)
    tab.select_option("#scene", "paper")
    tab.press("#knob-grip", "End")
    assert tab.evaluate("() => state.values['friction.normal_force']") == 2.0
    assert not tab.faults


@pytest.mark.reliability
def test_server_answers_its_own_page_alone(server: Server) -> None:
    def asked(path: str, **headers: str) -> int:
        data = b"#scene=optimal" if path.startswith("/run") else None
        request = Request(server.address + path, data, headers)
        try:
            return urlopen(request, timeout=30).status
        except HTTPError as error:
            return error.code

    assert asked("/") == 200
    assert asked("/etc/passwd") == 404
    assert asked("/", Host="example.org") == 404
    assert asked("/run/full") == 404
    assert asked("/run/full", Origin="http://example.org") == 404
    assert asked("/run/other", Origin=server.address) == 404
    assert asked("/run/full", Origin=server.address) == 400


@pytest.mark.parametrize("phase", [0.0, 0.25])
def test_comparison_with_ngspice(tab: Any, server: Server, phase: float) -> None:
    setting = f"scene=paper-limited&drive.amplitude=6&drive.start_phase={phase}"
    tab.goto(f"{server.address}/#{setting}")
    tab.wait_for_function(RUNS)
    tab.click("#compare")
    tab.wait_for_function("() => state.others.length", timeout=120_000)
    there, here = tab.evaluate(
        "() => [1e3 * state.others[0].v_average, 1e3 * state.found.velocity]"
    )
    assert there == pytest.approx(here, abs=0.3)
    assert "difference" in tab.inner_text("#compared") and not tab.faults
    off, size = tab.evaluate("() => state.others[0].off('coil_current', history_)")
    assert off < 0.02 * size, "laid over at another phase"
    camera = tab.inner_text("#told-peak span").replace("−", "-").split()
    told = cosim.run(f"#{setting}").summary
    expected = [told["a_camera_min"], told["a_camera_max"]]
    assert [float(camera[0]), float(camera[2])] == pytest.approx(expected, abs=2.0)
    assert {url.partition("#")[0] for url in tab.asked if url.startswith("http")} == {
        f"{server.address}/",
        f"{server.address}/run/amplifier",
    }


def test_a_page_whose_server_has_gone_says_so(tab: Any, server: Server) -> None:
    tab.goto(server.address)
    tab.wait_for_function(RUNS)
    server.shutdown()
    server.server_close()
    tab.click("#compare")
    tab.wait_for_function("() => !document.getElementById('compare').disabled")
    assert "start cosim live again" in tab.inner_text("#compared")
    assert "fetch" not in tab.inner_text("#compared")


TURNED = """async () => {
  const before = history_.last;
  const { drive } = setupOf(state.values, state.setting.scene);
  const wait = (rows) => new Promise((done) => {
    const look = () => (history_.last > before + rows ? done() : setTimeout(look, 5));
    look();
  });
  await wait(9600);
  // V1 of the drive as it is now, at each row; the last one that had another
  const lines = linesOf(drive, 400);
  let last = before;
  for (let row = before + 1; row <= history_.last; row++) {
    const phase = history_.phase(row) - Math.floor(history_.phase(row));
    const k = lines.findLastIndex(([begin]) => begin <= phase), [begin, start, end] = lines[k];
    const until = k + 1 < lines.length ? lines[k + 1][0] : 1;
    const v1 = start + (end - start) * (phase - begin) / (until - begin);
    const jumps = Math.min(phase, 1 - phase) < 1e-3;
    if (!jumps && Math.abs(history_.value(row, 0) - v1) > 1e-3) last = row;
  }
  return (last - before) / RATE;
}"""
"""Simulated seconds until V1 is that of what has been turned."""


@pytest.mark.parametrize("sound", [False, True])
def test_a_turned_knob_is_heard_at_once(tab: Any, server: Server, sound: bool) -> None:
    tab.goto(f"{server.address}/#scene=paper-limited")
    tab.wait_for_function(RUNS)
    if sound:
        tab.click("#sound")
        tab.wait_for_function("() => audio && audio.state === 'running' && history_.last > 9600")
        assert tab.evaluate("() => audio.baseLatency + audio.outputLatency") <= 0.05
    else:
        tab.select_option("#speed", "0.1")
    tab.focus("#knob-amplitude")
    tab.keyboard.press("PageDown")
    assert tab.evaluate(TURNED) < 0.05
    assert not tab.faults


@pytest.mark.slow
def test_a_minute_of_sound_has_no_gap(tab: Any, server: Server) -> None:
    tab.goto(f"{server.address}/#scene=paper-limited")
    tab.wait_for_function(RUNS)
    tab.click("#sound")
    tab.wait_for_function("() => audio && audio.state === 'running'")
    tab.wait_for_timeout(60_000)
    assert tab.inner_text("#gaps") == "no gap"


SHOWN_MEAN = """async (seconds) => {
  host.post({ kind: "speed", speed: 10 });
  while (history_.last < seconds * RATE) await new Promise((done) => setTimeout(done, 20));
  host.post({ kind: "speed", speed: 0 });
  return [means().velocity, state.marks[0][0], state.marks.at(-1)[0]];
}"""


@pytest.mark.physics
@pytest.mark.filterwarnings("ignore")
def test_mean_velocity_shown_is_that_of_a_run(tab: Any, server: Server) -> None:
    """Over the same whole periods, once the motion repeats."""
    settings = ["", "&drive.amplitude=6&drive.frequency=30", "&drive.amplitude=7&drive.offset=-1.5"]
    settings += ["&coil.polarity=-1&friction.normal_force=1.1", "&friction.normal_force=1.5"]
    settings += ["&drive.waveform=falling-sawtooth&drive.frequency=50"]
    settings += ["&drive.waveform=square&drive.frequency=35&drive.amplitude=5"]
    settings += ["&drive.pot_max=0.75&drive.pot_frequency=0.625&drive.pot_offset=0.25"]
    links = [f"#scene=paper-limited{changes}" for changes in settings]
    links += [f"#scene=reference&circuit.model=limited{more}" for more in ("", "&coil.count=2")]
    for link in links:
        tab.goto(f"{server.address}/{link}")
        tab.wait_for_function("() => history_.last > 0")
        shown, begin, end = tab.evaluate(SHOWN_MEAN, 6)
        period = 1.0 / load(link).drive.frequency
        times = {"run.settle": round(begin / period) * period}
        times |= {"run.duration": round(end / period) * period, "run.output_step": 1e-3}
        expected = cosim.run(load(link, times)).summary["v_average"]
        assert shown == pytest.approx(expected, rel=1e-6), link
    assert not tab.faults


def test_a_record_is_laid_over(tab: Any, tmp_path: Path) -> None:
    """A run's own, as a camera would read it: at the phase where it is the same."""
    run, trial = tmp_path / "run", tmp_path / "<img src=x onerror=alert(1)>.csv"
    settings = ["--set", "run.duration=1.2", "--set", "run.settle=0.2"]
    main(["run", "paper-limited", *settings, "--out", str(run)])
    main(["export", str(run), "--as", "tracker"])
    next(run.glob("*tracker*")).rename(trial)
    path = tmp_path / "page.html"
    assert main(["live", "paper-limited", "--trial", str(trial), "--out", str(path)]) == 0
    tab.goto(path.as_uri())
    tab.wait_for_function(RUNS)
    tab.click("#record")
    off, of = tab.evaluate("() => record.off('v_surface', history_)")
    assert off < 0.25 * of
    assert "<img src=x" in tab.inner_text("#compared")
    tab.wait_for_timeout(300)
    assert not tab.faults and tab.locator("img").count() == 0


LAID = """(name) => {
  $('record').click();
  const own = (one) => record.points(one, 1, 1, true).length;
  const heights = record.points('z_part', 1, 1, false).map(([, v]) => v).filter(Number.isFinite);
  return [record.off(name, history_), own('z_part'), extent(heights)];
}"""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", ["current", "v_part"])
def test_a_record_without_the_surface_is_laid_over(tab: Any, tmp_path: Path, name: str) -> None:
    """A run's own, a quarter of a period late: at its phase, and its part at the surface."""
    scene = load("paper-limited", {"run.duration": 1.2})
    late = 0.7 + 0.25 / scene.drive.frequency
    waves = cosim.run(scene).waveforms.sel(time=slice(late, None, 50))
    rows = zip(waves.time.values - late, waves[name].values, waves.z_part.values, strict=True)
    heads = {"current": "current [A]", "v_part": "v_part [m/s],z_part [m]"}
    trial, path = tmp_path / "own.csv", tmp_path / "page.html"
    lines = [f"{t},{v},{z if k % 2 else ''}" for k, (t, v, z) in enumerate(rows)]
    if name == "current":
        lines = [line.rpartition(",")[0] for line in lines]
    trial.write_text("\n".join([f"time [s],{heads[name]}", *lines]), encoding="utf-8")
    assert main(["live", "paper-limited", "--trial", str(trial), "--out", str(path)]) == 0
    tab.goto(path.as_uri())
    tab.wait_for_function(RUNS)
    (off, of), points, (low, high) = tab.evaluate(LAID, {"current": "coil_current"}.get(name, name))
    assert off < 0.2 * of and points == 0, "there is no surface on which the part would be"
    if name == "v_part":
        assert -3e-3 < low < high < 1e-3
    tab.select_option("#heights", "slip")
    tab.wait_for_timeout(300)
    assert not tab.faults


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("ported", [pytest.param(False, marks=pytest.mark.slow), True])
def test_an_own_circuit_is_run_by_the_server(tmp_path: Path, ported: bool) -> None:
    """Also one with names of its own, which ports join to the machine."""
    netlist = circuits() / "examples" / "audio_amplifier.cir"
    own = {"circuit.model": "file", "circuit.netlist": str(netlist)}
    if ported:
        (tmp_path / "own.cir").write_text(renamed(netlist))
        (tmp_path / "own.toml").write_text(UNSAVED)
        link, known = opened(str(tmp_path / "own.toml"))
    else:
        link, known = opened("paper", [f"{key}={value}" for key, value in own.items()])
    assert link == "#scene=paper" and [*known] == ["own", "amplifier", "full"]
    with Server(link, known) as found:
        told = found.run(link, known["own"])
        found.server_close()
    times = {"run.settle": 0.7, "run.duration": told["begin"] + 0.3, "run.output_step": 5e-5}
    expected = cosim.run(load("paper", {**own, **times})).waveforms
    rows = expected.v_surface.sel(time=slice(told["begin"] - 1e-9, None)).values
    assert told["waveforms"]["v_surface"][:6000] == pytest.approx(rows[:6000], abs=1e-9)


ENDLESS = "#scene=paper&circuit.max_step=1e-9"


def test_an_endless_run_gives_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """By itself, and sooner when another one waits, which has its answer."""
    told: list[str] = []

    def ask(server: Server) -> None:
        with pytest.raises(BadInput) as refused:
            server.run(ENDLESS, CIRCUITS["amplifier"])
        told.append(str(refused.value))

    monkeypatch.setattr("cosim.live.server.MOST_AWAITED", 0.5)
    with Server(*opened("paper")) as found:
        first = Thread(target=ask, args=(found,))
        first.start()
        while found.asked < 2:  # its own first one, which warms up
            time.sleep(0.01)
        answer = found.run("#scene=paper", CIRCUITS["amplifier"])
        first.join()
        monkeypatch.setattr("cosim.live.server.MOST", 0.2)
        ask(found)
    assert answer["v_average"] != 0.0
    assert len(told) == 2 and all(words.startswith("The run was given up at") for words in told)


@needs.posix
def test_ctrl_c_ends_an_endless_run_at_once() -> None:
    command = [sys.executable, "-m", "cosim", "live", "paper"]
    with subprocess.Popen(
        command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env=os.environ | {"BROWSER": "true"},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:  # fmt: skip
        try:
            assert process.stdout is not None
            address = process.stdout.readline().partition("/#")[0]
            asked = HTTPConnection(address.removeprefix("http://"), timeout=30)
            asked.request("POST", "/run/amplifier", "#scene=paper", {"Origin": address})
            assert asked.getresponse().read().startswith(b'{"v_average":')
            asked.request("POST", "/run/amplifier", ENDLESS, {"Origin": address})
            time.sleep(0.3)
            workers = psutil.Process(process.pid).children()
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=5)
        finally:
            process.kill()
    assert (process.returncode, said) == (130, "cosim: interrupted.\n")
    assert workers and not psutil.wait_procs(workers, timeout=5)[1]
