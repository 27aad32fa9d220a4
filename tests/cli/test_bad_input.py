"""Any scene file or override loads, or is refused in one sentence; never a traceback."""

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import cosim
from cosim.cli.main import main
from cosim.errors import BadInput
from cosim.scene import KEYS, Scene, list_scenes, load
from tests.helpers import needs
from tests.helpers.examples import examples

pytestmark = pytest.mark.reliability


def complaint(source: str | Path, *overrides: str) -> str:
    with pytest.raises(BadInput) as caught:
        load(source, overrides)
    return checked(caught.value)


def checked(error: BadInput) -> str:
    """The message, if it is one sentence on one line."""
    message = str(error)
    assert error.exit_code == 2
    assert message.isprintable() and len(message) < 600
    assert message.endswith((".", "?"))
    assert "Traceback" not in message and "pydantic" not in message
    return message


FILES = [
    # what the file says; what the sentence must say
    ("[drive]\nfrequency = -1", "drive.frequency = -1 must be a number from 0.01 to 100000 Hz"),
    ("[drive]\nfrequency = true", "drive.frequency = true must be a number"),
    ('[drive]\nfrequency = "20"', 'drive.frequency = "20" must be a number'),
    ("[drive]\nfrequency = nan", "drive.frequency = nan must be a number"),
    ("[drive]\nfrequency = inf", "drive.frequency = inf must be a number"),
    ("[drive]\nfrequency = [20]", "drive.frequency = [20] must be a number"),
    ("[drive]\nfrequency = 2020-01-01", "drive.frequency = 2020-01-01 must be a number"),
    (f"[drive]\nfrequency = 1{'0' * 400}", "must be a number from 0.01"),
    (f"[run]\nduration = 1{'0' * 400}", "must be a number from 1e-06"),
    (f"[run]\nduration = 1{'0' * 4000}", "must be a number from 1e-06"),
    (f"[run]\nduration = 1{'0' * 5000}", "not TOML"),
    ("[drive.frequency]\nx = 1", "drive.frequency = "),
    ("[drive]\nwaveform = 'quad'", 'must be one of "sawtooth", "falling-sawtooth", "sine"'),
    ("[drive]\nwaveform = 'quaid'", "gives the surface its velocity; with it circuit.model"),
    ("[drive]\nfile = 'a.csv'", 'drive.file is for drive.waveform = "file", not for "sawtooth"'),
    ("[drive]\nwaveform = 'sawtoth'", "did you mean sawtooth?"),
    ("[drive]\nwaveform = 3", "drive.waveform = 3 must be one of"),
    ("[drive]\nquantised = 1", "drive.quantised = 1 must be true or false"),
    ("[drive]\nfrequncy = 3", "did you mean drive.frequency?"),
    ("[drive]\ngravity = 3", "did you mean mechanics.gravity?"),
    ("[drive]\nqqqqq = 3", "keys of drive: waveform, "),
    ("[drv]\nfrequency = 3", "did you mean drive?"),
    ("[xyzzy]\n", "tables: drive, circuit"),
    ("frequency = 3", "did you mean drive.frequency?"),
    ("drive = 3", "drive = 3 must be a table"),
    ("[[drive]]\nfrequency = 3", "must be a table"),
    ("base = 'papr'", "did you mean paper?"),
    ("base = 3", "base = 3 must be a built-in scene"),
    ("base = ['paper']", "must be a built-in scene"),
    ("[base]", "must be a built-in scene"),
    ("base = 'paper'\n[name]\nx = 1", "name = "),
    ("name = 3", "name = 3 must be at most 64 letters"),
    ("name = '../../etc'", "name = "),
    ("name = ''", "name = "),
    ("description = 'a\\nb'", None),
    ('description = "a\\nb"', "must be one line"),
    ("[circuit]\nmodel = 'limitd'", "did you mean limited?"),
    (
        "[circuit]\nmodel = 'spice'",
        'must be one of "full", "amplifier", "limited", "ideal", "auto", "none", "file"',
    ),
    ("[circuit]\nmodel = 'file'", "circuit.netlist must be given together"),
    ("[circuit]\nnetlist = 'a.cir'", 'circuit.model = "file" and circuit.netlist must be given'),
    ("[circuit]\nnetlist = 7", "circuit.netlist = 7 must be the path of a file"),
    ("[circuit]\nswing_loss_high = 18", "must be below circuit.supply = 18 V"),
    ("[coil]\ncount = 1.0", "coil.count = 1.0 must be a whole number from 1 to 16"),
    ("[coil]\ncount = true", "coil.count = true must be a whole number"),
    ("[coil]\neddy_inductance = 1e-3", "coil.eddy_inductance needs coil.eddy_resistance"),
    ("[coil]\neddy_resistance = 1", "coil.eddy_resistance needs coil.eddy_inductance"),
    ("[circuit]\nsnubber_resistance = 10", "needs circuit.snubber_capacitance"),
    ("[circuit]\nsnubber_capacitance = 1e-7", "needs circuit.snubber_resistance"),
    ("[drive]\npwm_ripple = true", 'with it circuit.model = "amplifier" must be "full"'),
    ("[drive]\nloop_time = 22e-6", "drive.loop_time = 2.2e-05 s must be 0, or"),
    (
        "[drive]\nwaveform = 'sine'\nloop_time = 22e-6",
        'for drive.waveform = "sawtooth", not "sine"',
    ),
    ("[mechanics]\ntravel = 0", "mechanics.travel = 0 must be a number from 1e-09 to 1000 m"),
    ("[mechanics]\nrestitution = 1.1", "must be a number from 0 to 1."),
    ("[mechanics]\nn_surfaces = 0", "must be a whole number from 1 to 16"),
    ("[mechanics]\npart_mass = -0.009", "mechanics.part_mass = -0.009 must be"),
    ("[friction]\nlaw = 'lugre'", 'friction.law = "lugre" must be "coulomb"'),
    ("[friction]\nmu_k = 0.8", "friction.mu_k = 0.8 must be at most friction.mu_s = 0.72"),
    ("[friction]\nmu_s = 0.5", "friction.mu_k = 0.59 must be at most friction.mu_s = 0.5"),
    ("[coupling]\nmethod = 'jacoby'", "did you mean jacobi?"),
    ("[coupling]\nmethod = 'iterated'", 'method = "iterated" must be one of "step-locked"'),
    ("[coupling]\nmacro_step = 0", "must be a number from 1e-07 to 1 s"),
    ("[coupling]\norder = 3", "must be a whole number from 0 to 2"),
    ("[run]\nsettle = 2", "run.settle = 2 s must be below run.duration = 2 s"),
    ("[run]\noutput_step = 3", "run.output_step = 3 s must be below run.duration"),
    ("[run]\noutput_step = 1e-9", "must be at least 1e-07 s"),
    ("[drive]\namplitude = -1", "drive.amplitude = -1 must be a number from 0 to 100 V"),
    ("[drive]\nreset_time = 0.05", "below the period of 0.05 s"),
    ("[drive]\nreset_time = 1e-12", "must be 0, or at least 1e-09 s"),
    ("[drive]\nwaveform = 'quaid'\nquantised = true", 'or "pieces", not "quaid"'),
    ("[drive]\nwaveform = 'quaid'\npot_max = 0.5", 'drive.pot_max is for drive.waveform = "saw'),
    ("[drive]\nquantised = true\nfrequency = 2e4", "from 0.1 to 10000 Hz"),
    ("[drive]\npot_max = 1.5", "drive.pot_max = 1.5 must be a number from 0 to 1."),
    ("[drive]\npot_max = 'x'", 'drive.pot_max = "x" must be a number from 0 to 1.'),
    ("[drive]\npot_max = 1\namplitude = 3", "drive.pot_max and drive.amplitude say the same"),
    ("[drive]\npot_frequency = 1\nfrequency = 3", "drive.pot_frequency and drive.frequency"),
    ("[drive]\npot_offset = 1\noffset = 3", "drive.pot_offset and drive.offset"),
    (f"[drive]\npot_offset = 1\namplitude = 1{'0' * 400}", "must be a number from 0 to 100 V"),
    ("[circuit]\nmodel = 'full'\n[drive]\namplitude = 11", "from 0 to 10.53 V with circuit.model"),
    (
        "[circuit]\nmodel = 'full'\n[drive]\noffset = -4.5",
        "drive.offset = -4.5 V must be a number from -4",
    ),
    ("[drive]\nquantised = true\noffset = 7", "to 6.532 V with drive.quantised = true"),
    (
        "[coil]\nresistance = 1e6\ninductance = 1e-9",
        "coil.inductance = 1e-09 H must be at least 0.01 H with coil.resistance = 1e+06 Ohm",
    ),
    (
        "[coil]\nresistance = 1e4\ninductance = 1e-9\n[circuit]\nsense_resistance = 1e4",
        "coil.inductance = 1e-09 H must be at least 2e-09 H with",
    ),
    # broken TOML
    ("[drive]\nfrequency 20", "(at line 2, column 11)"),
    ("[drive]\nfrequency = ", "this is not TOML: Invalid value (at end of document)"),
    ("[drive\n", "(at line 1, column 7)"),
    ("[drive]\n[drive]\n", "(at line 2, column 7)"),
    ("[drive]\nfrequency = 1\nfrequency = 2", "Cannot overwrite a value"),
    ("[drive]\nwaveform = 'sine", "(at end of document)"),
    ("x = " + "[" * 100_000, "not TOML"),
    ("[coil]\ncount = 1" + "0" * 5000, "a whole number in it has thousands of digits"),
    ("base = 0x" + "9" * 5000, "base = an endless number must be a built-in scene"),
    ("a.b.c\x00d = 1", "not TOML"),
]


@pytest.mark.parametrize(("text", "part"), FILES, ids=[text[:40] for text, _ in FILES])
def test_file(text: str, part: str | None, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    if part is None:
        load(path)
        return
    message = complaint(path)
    assert message.startswith(str(path))
    assert part in message


OVERRIDES = [
    ("run.duration=-1", "--set: run.duration = -1 must be"),
    ("run.duration=", "has no value"),
    ("run.duration", "must be table.key=value"),
    ("duration=3", "did you mean run.duration?"),
    ("=3", "must be table.key=value"),
    ("", "must be table.key=value"),
    (".=3", "must be table.key=value"),
    ("run.=3", "must be table.key=value"),
    ("run.duration.x=3", 'no key "run.duration.x"'),
    ("runs.duration=3", "did you mean run?"),
    ("run.durations=3", "did you mean run.duration?"),
    ("run.duration=abc", 'run.duration = "abc" must be a number'),
    ("run.duration=1 2", 'run.duration = "1 2" must be a number'),
    ("run.duration=1\nsettle = 3", "must be a number"),
    ('run.duration="3"', 'run.duration = "3" must be a number'),
    ("run.duration={x=1}", "must be a number"),
    ("run.duration=" + "[" * 100_000, "must be a number"),
    ("run.duration=" + "9" * 100_000, "must be a number"),
    ("drive.quantised=yes", 'drive.quantised = "yes" must be true or false'),
    ("circuit.model=ampliflier", "did you mean amplifier?"),
    ("friction.mu_k=0.8", "--set: friction.mu_k = 0.8 must be at most"),
    ("circuit.model=\x1b[31m", "must be one of"),
]


@pytest.mark.parametrize(("text", "part"), OVERRIDES, ids=[text[:40] for text, _ in OVERRIDES])
def test_override(text: str, part: str) -> None:
    message = complaint("paper", text)
    assert message.startswith("--set")
    assert part in message


def test_the_layer_at_fault_is_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("[friction]\nmu_k = 0.7\n[run]\nduration = 3\n", encoding="utf-8")
    assert complaint(path, "friction.mu_s=0.6").startswith("--set: friction.mu_k = 0.7")
    path.write_text("[friction]\nmu_k = 0.8\n", encoding="utf-8")
    assert complaint(path, "run.duration=1").startswith(f"{path}: friction.mu_k = 0.8")


@pytest.mark.parametrize(
    ("source", "part"),
    [
        ("papre", "did you mean the built-in scene paper?"),
        ("xyzzy", "built-in: paper, "),
        ("", "no built-in scene"),
        ("paper.toml", "did you mean the built-in scene paper?"),
        ("no/such/file.toml", "there is no such file"),
        ("../scenes/paper", "there is no such file; did you mean the built-in scene paper?"),
        ("a\x00b", "it is no possible file name"),
        ("a\udcffb", "there is no"),
        ("x" * 5000, "cannot be read"),
        ("/dev/null/x", "cannot be read"),
        ("two\nlines", "there is no"),
    ],
)
def test_source(source: str, part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert part in complaint(source)


NONE, OWN = '[circuit]\nmodel = "none"', '[circuit]\nmodel = "file"\nnetlist = "{}.cir"\n'
STILL = 'circuit.model = "none" '


@pytest.mark.parametrize(
    ("command", "file", "option", "words"),
    [
        ("chart limits", NONE, "circuit.model=none", STILL + "has no limits to change;"),
        (
            *("chart limits", '[drive]\nwaveform = "sine"', "drive.waveform=sine"),
            'drive.waveform = "sine" has no knobs to search.',
        ),
        ("chart ladder", NONE, "circuit.model=none", STILL + "is no rung of the ladder;"),
        (
            *("tune --minimise=v_average", NONE + '\n[drive]\nwaveform = "optimal"', ""),
            'drive.waveform = "optimal" has no knobs; name what to tune',
        ),
        ("run --spread", NONE, "circuit.model=none", STILL + "has no knobs that"),
        (
            *("run", OWN.format("own") + "param = { zz = 3 }", "circuit.param.zz=3"),
            "own.cir: circuit.param.zz must be one of its .param",
        ),
        ("sweep", OWN.format("own"), "circuit.param.zz=1,2", "own.cir: circuit.param.zz must be"),
        ("run", OWN.format("no"), "", 'no.cir": there is no such file'),
    ],
)
def test_a_fault_is_told_with_the_scenes_file_or_the_option(
    command: str,
    file: str,
    option: str,
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["new", "own.toml", "--kind=circuit"]) == 0
    Path("own.toml").write_text(f'base = "paper-limited"\n{file}\n')
    how, by_file = ("--over" if command == "sweep" else "--set"), command != "sweep"
    found = [[]] * by_file + [[how, option]] * bool(option)
    for more in found:
        base = "paper-limited" if more and "param" not in option else "own.toml"
        capsys.readouterr()
        assert main([*command.split(), base, *more]) == 2
        said = capsys.readouterr().err
        assert said.startswith(f"cosim: {more[0] if more else 'own.toml'}: ") and words in said


def test_directory(tmp_path: Path) -> None:
    assert complaint(tmp_path) == f"{tmp_path}: cannot be read (it is a directory)."


@needs.posix
def test_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    assert "not a regular file" in complaint(tmp_path / "pipe.toml")


def test_unreadable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:  # a mode of 0 would not stop root
        raise PermissionError(13, "Permission denied")

    path = tmp_path / "secret.toml"
    path.touch()
    monkeypatch.setattr("cosim.files.reader.open", refuse, raising=False)
    assert complaint(path) == f"{path}: cannot be read (Permission denied)."


def test_link_to_itself(tmp_path: Path) -> None:
    path = tmp_path / "loop.toml"
    path.symlink_to(path)
    assert "cannot be read" in complaint(path)


@pytest.mark.parametrize(
    ("raw", "part"),
    [
        ("description = 'µ'".encode("latin-1"), "line 1: this is not UTF-8 text"),
        (b"[run]\n\xff", "line 2: this is not UTF-8 text"),
        ("[run]".encode("utf-16"), "this is not UTF-8 text"),
        (bytes(range(256)), "not"),
        (b"#" * (1 << 20) + b"#", "larger than 1.04858 MB"),
    ],
)
def test_bytes(raw: bytes, part: str, tmp_path: Path) -> None:
    path = tmp_path / "bytes.toml"
    path.write_bytes(raw)
    assert part in complaint(path)


@pytest.mark.parametrize("raw", [b"", b"\xef\xbb\xbf[run]\r\nduration = 3\r\n", b"# only this"])
def test_odd_but_good_bytes(raw: bytes, tmp_path: Path) -> None:
    path = tmp_path / "bytes.toml"
    path.write_bytes(raw)
    assert isinstance(load(path), Scene)


def loads_or_complains(source: str, overrides: list[str]) -> None:
    try:
        assert isinstance(load(source, overrides), Scene)
    except BadInput as error:
        checked(error)


MARKS = ["[", "]", "=", ".", "\n", '"', "'", "{", "}", ",", "#", " ", "1", "-", "e", "true", "nan"]
WORDS = [
    "base",
    "name",
    "paper",
    *{key.table for key in KEYS.values()},
    *{key.name for key in KEYS.values()},
]
TOML_LIKE = st.lists(st.sampled_from(MARKS + sorted(WORDS)), max_size=30).map("".join)


@examples(300)
@given(raw=st.one_of(st.binary(max_size=200), TOML_LIKE.map(str.encode)))
def test_any_file(raw: bytes) -> None:
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "any.toml"
        path.write_bytes(raw)
        loads_or_complains(str(path), [])


VALUE = st.one_of(
    st.text(max_size=30), TOML_LIKE, st.floats().map(repr), st.integers().map(repr),
    st.sampled_from(["true", "false", "full", "none", "sine", "rigid"]),
)  # fmt: skip
OPTION = st.one_of(
    st.text(max_size=30),
    st.builds("{}={}".format, st.sampled_from([key.full for key in KEYS.values()]), VALUE),
)


@examples(250)
@given(scene=st.sampled_from(list_scenes()), options=st.lists(OPTION, max_size=4))
def test_any_override(scene: tuple[str, str], options: list[str]) -> None:
    loads_or_complains(scene[0], options)


DIGITS = "9" * 5000
LONG_NUMBERS = [
    ["run", "held", f"--set=drive.frequency={DIGITS}"],
    ["run", "held", f"--set=coil.count={DIGITS}"],
    ["run", "held", f"--set=coil.count=0x{DIGITS}"],
    ["run", "held", f"--set=circuit.model=0x{DIGITS}"],
    ["run", "held", f"--set=drive.waveform=[0x{DIGITS}]"],
    ["sweep", "held", f"--over=friction.mu_s=0.7:0.8:{DIGITS}"],
    ["sweep", "held", f"--over=friction.mu_s={DIGITS}"],
    ["sweep", "held", "--over=friction.mu_s=0.7:0.8:1000", "--over=drive.offset=0:1:1001"],
    ["sweep", "held", f"--over=mechanics.n_surfaces=1:{DIGITS}:3"],
    ["sweep", "held", "--over=friction.mu_s=0.7:0.8:3", f"--samples={DIGITS}"],
    ["sweep", "held", "--over=friction.mu_s=0.7:0.8:3", "--samples=3", f"--seed=-{DIGITS[:4000]}"],
    ["sweep", "held", "--over=friction.mu_s=0.7:0.8:3", f"--workers={DIGITS[:4000]}"],
    ["tune", "ideal-current", "--maximise=v_average", f"--budget={DIGITS[:4000]}"],
    ["tune", "held", "--maximise=v_average", f"--over=friction.mu_s={DIGITS}:{DIGITS}"],
    ["tune", "held", "--maximise=v_average", f"--seed=-{DIGITS[:4000]}"],
]


@pytest.mark.parametrize("words", LONG_NUMBERS, ids=lambda words: f"{words[0]} {words[-1][:20]}")
def test_endless_numbers(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, f"--out={tmp_path}"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("cosim: ") and told.count("\n") == 1 and len(told) < 2500
    assert not list(tmp_path.iterdir())


def test_a_file_of_another_ending_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "heavy.toml").touch()
    for name in ("heavy", "heavy.tml"):
        assert complaint(name).endswith("did you mean heavy.toml?")


def test_an_empty_name_is_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As that of a variable of the shell that nobody has set."""
    monkeypatch.chdir(tmp_path)
    assert main(["run", "held", "--out", ""]) == 2
    told = 'cosim: --out "": must name a folder (. is the one you are in).\n'
    assert capsys.readouterr().err == told and not any(tmp_path.iterdir())


@pytest.mark.parametrize("words", [["live"], ["show", "a.csv"], ["fmu", "ssp", "paper"]])
@pytest.mark.parametrize("name", ["x.txt", "x", "", ".", "/"])
def test_a_file_to_write_tells_its_kind(
    words: list[str],
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("x\n1\n", encoding="utf-8")
    assert main([*words, "--out", name]) == 2
    ending = ".ssp" if "ssp" in words else ".html"
    assert capsys.readouterr().err == f'cosim: --out "{name}": must end in {ending}.\n'
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


@needs.posix
def test_what_a_kill_left_goes_with_the_next_single_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("x\n1\n", encoding="utf-8")
    old = tmp_path / ".cosim-left.html"
    for words in (["new", "a.toml"], ["show", "a.csv"], ["live", "paper", "--out", "a.html"]):
        old.touch()
        os.utime(old, (0, 0))
        assert main(words) == 0
        assert not old.exists()


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (("tuen",), "did you mean tune? (see cosim --help)."),
        (("chart", "limit"), "did you mean limits? (see cosim chart --help)."),
    ],
)
def test_a_misspelled_command(
    words: tuple[str, ...], hint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words]) == 2
    assert capsys.readouterr().err.strip().endswith(hint)


def test_a_trial_before_its_scene(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="a table is no run; the run's folder or the scene"):
        cosim.compare(tmp_path / "Trial.csv", tmp_path / "x")
