"""A setting goes from the page to the command and back without loss; a bad link is refused."""

import json
import random
import re
from pathlib import Path

import pytest

from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.files.resources import circuits
from cosim.live import rigs
from cosim.live.page import _record, opened
from cosim.scene import load, to_link
from cosim.trials.recording import read_recording
from tests.live.page_in_node import needs_node, run

LINKED = "return given.map((setting) => linkOf(setting));"
SET_UP = """
return given.map((link) => {
  const setting = settingOf(link);
  return setupOf(valuesOf(setting), setting.scene);
});
"""
KEYS = ("drive.amplitude", "drive.frequency", "drive.offset", "friction.normal_force")


def settings() -> list[dict[str, object]]:
    """Twenty, of the page's own making: scene, and changes as its knobs leave them."""
    chance = random.Random(5)
    scenes = list(rigs.scenes())
    found: list[dict[str, object]] = []
    for k in range(20):
        changes: dict[str, object] = {"drive.amplitude": chance.uniform(4, 8)}
        changes["friction.normal_force"] = round(chance.uniform(0.2, 1.5), 3)
        changes["coil.polarity"] = chance.choice([-1, 1])
        if k % 3 == 0:
            del changes["drive.amplitude"]
            knobs = ("pot_max", "pot_frequency", "pot_offset")
            changes |= {f"drive.{knob}": chance.randrange(1024) / 1024 for knob in knobs}
        elif k % 3 == 1:
            changes["drive.waveform"] = chance.choice(["sine", "falling-sawtooth", "sawtooth"])
            changes["drive.frequency"] = chance.uniform(5, 90)
            changes["mechanics.contact_stiffness"] = chance.uniform(1e6, 1e8)
        else:
            changes["drive.waveform"] = "steps"
            changes["drive.table"] = [[0, 0.5], [chance.random(), 1e-7], [1, -0.5]]
        found.append({"scene": chance.choice(scenes), "changes": changes})
    return found


@needs_node
@pytest.mark.filterwarnings("ignore")
def test_page_to_command_and_back(capsys: pytest.CaptureFixture[str]) -> None:
    links = run(LINKED, settings())
    printed = []
    for link in links:
        assert main(["run", f"http://127.0.0.1:1/{link}", "--link"]) == 0
        printed.append(capsys.readouterr().out.strip())
    assert run(SET_UP, printed) == run(SET_UP, links)
    for link, again in zip(links, printed, strict=True):
        assert load(again).drive == load(link).drive


def test_options_of_a_command_are_in_the_link() -> None:
    scene = load("paper", ["run.duration=0.5", "coil.count=2", "drive.pot_max=0.5"])
    link = to_link(scene)
    assert link == "#scene=paper&coil.count=2&drive.pot_max=0.5&run.duration=0.5"
    assert load(link) == scene
    # what the command adds lies on top
    assert load(link, ["drive.amplitude=3"]).drive.amplitude == 3.0


def test_link_of_a_scene_file(tmp_path: Path) -> None:
    """The shortest one; and none where a file is needed."""
    path = tmp_path / "mine.toml"
    path.write_text('base = "gripper"\n[drive]\npot_offset = 0.25\n', encoding="utf-8")
    assert to_link(load(path)) == "#scene=gripper&drive.pot_offset=0.25"
    with pytest.raises(BadInput, match="no link"):
        to_link(load("reference", {"friction.normal_force_file": tmp_path / "grip.csv"}))
    assert to_link(load("closed-loop-grasp")) == "#scene=closed-loop-grasp"


@pytest.mark.reliability
@pytest.mark.parametrize(
    ("link", "said"),
    [
        ("#scene=papr", "did you mean paper"),
        ("#scene=", "table.key=value"),
        ("#scene=paper&", "table.key=value"),
        ("#scene=paper&drive.amplitude", "table.key=value"),
        ("#scene=paper&drive.amplitude=", "table.key=value"),
        ("#scene=paper&drive.amplitud=6", "did you mean"),
        ("#scene=paper&drive.amplitude=1e9", "0 to 100 V"),
        ("#scene=paper&drive.amplitude=%22<b>%22", "0 to 100 V"),
        ("#scene=paper&drive.amplitude=6&drive.amplitude=7", "twice"),
        ("#scene=paper&drive.amplitude=6&drive.pot_max=0.5", "twice"),
        ("#scene=paper&name=x", "must be table.key"),
        ("#scene=paper&circuit.netlist=%2Fetc%2Fpasswd", "names a file"),
        ("#scene=paper&drive.file=x.csv", "names a file"),
        ("#scene=%2Fetc%2Fpasswd", "no built-in scene"),
        ("#scene=paper&drive.amplitude=%ff", "0 to 100 V"),
        ("#drive.amplitude=6&#scene=paper", "begin with"),
        ("#scene=paper&" + "a" * 9000, "longer than"),
    ],
)
def test_bad_links(link: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", link]) == 2
    told = capsys.readouterr().err
    assert told.startswith("cosim: ") and told.count("\n") == 1 and said in told


@needs_node
@pytest.mark.parametrize("key", ["circuit.gain_bandwidth=2e6", "circuit.slew_rate=1e6"])
def test_what_the_page_cannot_turn_is_told(key: str) -> None:
    with pytest.raises(BadInput, match=f"the page cannot turn {key.partition('=')[0]}"):
        opened("paper", [key])


def test_parameters_of_an_own_netlist_go_with_it() -> None:
    netlist = circuits() / "examples" / "h_bridge.cir"
    given = [
        "circuit.model=file",
        f"circuit.netlist={netlist}",
        "circuit.param.switch_resistance=2",
        'circuit.save=["v(left)"]',
    ]
    link, known = opened("paper", given)
    assert known["own"]["circuit.param.switch_resistance"] == 2
    assert "param" not in link and "save" not in link  # the page has no curve for it


def test_a_record_with_a_gap_keeps_its_times(tmp_path: Path) -> None:
    """1000 rows a second without 40 to 139: nothing there, and the rest stays where it is."""
    rows = [k for k in range(300) if not 40 <= k < 140]
    text = "time [s],z_surface [m]\n" + "".join(f"{k / 1000},{k * k}e-9\n" for k in rows)
    (tmp_path / "gap.csv").write_text(text, encoding="utf-8")
    shown = _record(read_recording(tmp_path / "gap.csv"))
    heights = shown["waveforms"]["z_surface"]
    assert shown["step"] == pytest.approx(1e-3) and len(heights) == 300
    assert heights[41:139] == [None] * 98
    assert heights[140] == pytest.approx(140**2 * 1e-9) and heights[39] == pytest.approx(
        39**2 * 1e-9
    )


def test_page_refuses_them_too() -> None:
    code = """
    return given.map((link) => {
      try { settingOf(link); } catch (error) { return error.message; }
      return "";
    });
    """
    bad = [
        *("scene=__proto__", "#scene=nothing", "#", "#scene=paper&drive.amplitude=1e9"),
        *("#scene=paper&__proto__.x=1", "#scene=paper&drive.waveform=optimal", "#scene=%"),
        *("#scene=paper&constructor=1", "#scene=paper&drive.table=[[0,9]]", "#a=b&scene=paper"),
        "#scene=paper&coil.count=1.5",
        *(f"#scene=paper&drive.waveform={name}" for name in ("steps", "pieces")),
        "#scene=paper&drive.reset_time=0.06",  # longer than the period
    ]
    assert all(run(code, bad))
    table = "&drive.waveform=steps&drive.table=[[0,0.5],[0.5,-0.5]]"
    assert not any(run(code, [f"#scene=paper{more}" for more in ("", table)]))


@pytest.mark.reliability
def test_scene_that_the_page_cannot_run(tmp_path: Path) -> None:
    for scene in ("optimal", "two-surfaces"):
        with pytest.raises(BadInput, match="the page runs"):
            opened(scene)


def test_a_record_whose_columns_the_user_names(tmp_path: Path) -> None:
    """As `cosim compare` takes them: a camera's rows count down."""
    rows = [f"{k / 1000},{k * k}" for k in range(20)]
    trial, page = tmp_path / "cam.csv", tmp_path / "page.html"
    trial.write_text("\n".join(["t,top", *rows]), encoding="utf-8")
    names = ["--columns", "time=t:s,surface=top:-mm"]
    assert main(["live", "--trial", str(trial), "--out", str(page)]) == 2
    assert main(["live", "--trial", str(trial), *names, "--out", str(page)]) == 0
    record = re.search(r'"record":(\{.*?\}\})', page.read_text("utf-8"))
    assert record and json.loads(record[1])["waveforms"]["z_surface"][3] == pytest.approx(-9e-3)
