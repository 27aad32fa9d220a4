"""What is wrong with a scene's ports is told in one sentence: file, key, value, what is allowed."""

import os
import re
import zipfile
from pathlib import Path

import pytest

from cosim import run, sweep
from cosim.cli.main import main
from cosim.errors import BeyondModel, SimulationFailed
from cosim.toolchain.processes import in_place
from tests.ports.foreign import recompiled, reworded
from tests.ports.test_coupled import motor

WRONG = {
    "no such output": (
        "rotor.omega",
        "rotor.speed",
        r"Rotor\.fmu: .*rotor\.speed\".*omega",
    ),
    "an input as output": ("rotor.omega", "rotor.u", r"Rotor\.fmu: .*not its input"),
    "no such input": (
        '"rotor.u"',
        '"rotor.v"',
        r"to = \"rotor\.v\" must be one of its inputs",
    ),
    "an element of a number": ('"rotor.u"', '"rotor.u[1]"', r"u has one value, no \[1\]"),
    "no such FMU": ("rotor.omega", "motor.omega", r"\"motor\.omega\" must .* no \[\[fmu\]\] motor"),
    "no such source": ('"Vemf"\n', '"Vemg"\n', r"bridge\.cir: .*\"Vemg\".*did you mean vemf"),
    "no source at all": ('"Vemf"\n', '"Rm"\n', r"bridge\.cir: .*\"Rm\" must be a V or I source"),
    "no such node": ('"v(gp)"', '"v(gpp)"', r"bridge\.cir: .* = \"v\(gpp\)\": .*no node gpp"),
    "a broken expression": (
        '"v(gp)"',
        '"v(gp)*"',
        r"bridge\.cir: circuit\.save = \"v\(gp\)\*\": v\(gp\)\* is no expression",
    ),
    "two in one": ('"v(gp)"', '"v(gp), v(a)"', r"bridge\.cir: .* is no expression"),
    "nothing": ('"v(gp)"', '""', r"circuit\.save = \"\" must be a vector or an expression"),
    "within a device": ('"v(gp)"', '"@d1[id]"', r"\"@d1\[id\]\": .*source of 0 V in series"),
    "no such current": (
        '"i(Vemf)"',
        '"i(Rlost)"',
        r"port\]\] probe = \"i\(Rlost\)\": .*no element of two ends rlost",
    ),
    "a command as probe": ('"v(gp)"', '"v(gp)\\n.control"', r"cannot stand in a netlist"),
    "a parameter": ("J = 2e-4", "K = 2e-4", r"Rotor\.fmu: .*parameters K = 0\.0002"),
    "a parameter's type": ("J = 2e-4", 'J = "x"', r"Rotor\.fmu: .*must be a number"),
    "a .param": ("max_step", "param = { R9 = 1.0 }\nmax_step", r"bridge\.cir: circuit\.param\.R9"),
    "a line": ('to = "rotor.u"', 'to = "rotor.u"\nfeed = "line"', r"canInterpolateInputs"),
    "a feed": ('to = "rotor.u"', 'to = "rotor.u"\nfeed = "now"', r"feed = \"now\" must be one of"),
    "a slope": (
        "scale = 0.05\n[[port]]",
        'scale = 0.05\nslope = "w"\n[[port]]',
        r"\"w\" must be one of its outputs",
    ),
    "a probe's slope": (
        'to = "rotor.u"',
        'to = "rotor.u"\nslope = "w"',
        r"slope = \"w\" is for ports from an output",
    ),
    "no target": ('source = "Vemf"\n', "", r"rotor\.omega -> nothing must have one end: to, an"),
    "a source twice": (
        "[coupling]",
        '[[port]]\nfrom = "rotor.y"\nsource = "vemf"\n[coupling]',
        r"source = \"vemf\" is given twice",
    ),
    "two origins": ("probe =", 'from = "drive"\nprobe =', r"must have either probe or from"),
    "a method": ('"auto"', '"jacobi"', r"coupling\.method = \"jacobi\" must be one of"),
    "a file": ("Rotor.fmu", "Rotor2.fmu", r"fmu\.rotor\.file = .*Rotor2\.fmu\": there is no"),
    "no FMU": ("Rotor.fmu", "bridge.cir", r"bridge\.cir: this is no FMU"),
    "a key": ("source =", "sourec =", r"there is no key \"sourec\" in \[\[port\]\]; did you mean"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_port_is_told_in_one_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    scene = motor(tmp_path)
    old, new, said = WRONG[what]
    text = scene.read_text()
    assert old in text
    scene.write_text(text.replace(old, new))
    with in_place():
        assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err.strip()
    assert told.count("\n") == 0 and told.startswith(f"cosim: {scene}: ")
    assert re.search(said, told), told
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("old", "new", "given", "said"),
    [
        (
            "J = 2e-4",
            "J = [1]",
            "fmu.rotor.B=1e-5",
            r"motor\.toml: \[\[fmu\]\] 1: parameters\.J = \[1\] ",
        ),
        ("J = 2e-4", "J = [1]", "fmu.rotor.B=nan", r"--set: fmu\.rotor\.B = nan must be a number"),
        ("", "", "circuit.param.vdd=3k", r'--set: circuit\.param\.vdd = "3k" must be .* 3e3\.'),
        ("J = 2e-4", "a.J = 2e-4", "run.settle=0", r'parameters\.a = .* in quotes, "a\.J"\.'),
    ],
)
def test_the_origin_of_a_wrong_value_and_how_it_is_written_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, given: str, said: str
) -> None:
    scene = motor(tmp_path)
    scene.write_text(scene.read_text().replace(old, new))
    assert main(["run", str(scene), "--set", given]) == 2
    assert re.search(said, capsys.readouterr().err)


@pytest.mark.parametrize("wrong", ['parameters = 5\nname = "a"', "name = [1]"])
def test_what_is_no_fmu_is_told_whatever_is_set(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: str
) -> None:
    (tmp_path / "own.toml").write_text(f'[[fmu]]\n{wrong}\nfile = "a.fmu"\n', encoding="utf-8")
    assert main(["run", str(tmp_path / "own.toml"), "--set", "fmu.a.J=1"]) == 2
    assert wrong.partition(" ")[0] in capsys.readouterr().err


def test_an_fmu_that_unpacks_outside_itself_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = motor(tmp_path)
    with zipfile.ZipFile(tmp_path / "Rotor.fmu", "a") as archive:
        archive.writestr("../outside.txt", "x")
    assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    assert "outside itself" in capsys.readouterr().err


def test_what_ngspice_cannot_read_has_nothing_to_do_with_steps(tmp_path: Path) -> None:
    scene = motor(tmp_path)
    netlist, odd = (
        tmp_path / "bridge.cir",
        ".param three=3\nBs q 0 V=pwl(three,0,0,10,20)\nRq q 0 1",
    )
    netlist.write_text(netlist.read_text().replace(".end", f"{odd}\n.end"))
    # ngspice has two sentences for it; which it says depends on the circuits that it ran before.
    words = r"t = 0 s.*(not parsed|check of parse tree; failed)"
    with in_place(), pytest.raises(SimulationFailed, match=words) as told:
        run(scene)
    assert "max_step" not in str(told.value)


def test_a_line_of_the_netlist_is_told_by_its_own_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene, netlist = motor(tmp_path), tmp_path / "bridge.cir"
    netlist.write_text(netlist.read_text().replace("Rm a x 1", "Rm a x"))
    with in_place():
        assert main(["run", str(scene)]) == 2
    assert re.match(r"cosim: bridge\.cir:\d+: rm ", capsys.readouterr().err)


@pytest.mark.parametrize("missing", ["Rotor.fmu", "bridge.cir"])
def test_a_sweep_over_a_parameter_tells_a_missing_file_as_a_run_does(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], missing: str
) -> None:
    scene = motor(tmp_path)
    (tmp_path / missing).unlink()
    for command in (["run", str(scene)], ["sweep", str(scene), "--over", "fmu.rotor.J=1,2"]):
        assert main([*command, "--out", str(tmp_path / "out")]) == 2
        told = capsys.readouterr().err
        words = "there is no such file; a path counts from the scene's file, so move the two"
        assert re.match(rf'cosim: {scene}: \S+ = "\S+{missing}": {words} together\.$', told)


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("circuit.param.R9", r"bridge\.cir: \S+R9 must be one of its \.param \(it has vdd\)"),
        ("fmu.rotor.K", r"Rotor\.fmu: fmu\.rotor\.K must be one of its parameters"),
    ],
)
def test_a_sweep_over_what_is_not_there_names_the_option_and_what_its_user_knows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], key: str, said: str
) -> None:
    """The reader has parameters of its own for a filter in s."""
    scene, netlist = motor(tmp_path), tmp_path / "bridge.cir"
    own = "E9 q 0 LAPLACE {V(gp)} {1/(1+1m*s)}\nR9 q 0 1k\n.end"
    netlist.write_text(netlist.read_text().replace(".end", own))
    assert main(["sweep", str(scene), "--over", f"{key}=1,2", "--out", str(tmp_path / "o")]) == 2
    assert re.match(rf"cosim: --over: {tmp_path}/{said}", capsys.readouterr().err)


KIND = (
    '<TypeDefinitions><SimpleType name="Kind"><Enumeration><Item name="a" value="1"/>'
    '<Item name="b" value="4"/></Enumeration></SimpleType></TypeDefinitions><ModelVariables>'
    '<ScalarVariable name="kind" valueReference="22" causality="parameter" variability="fixed">'
    '<Enumeration declaredType="Kind" start="1"/></ScalarVariable>'
)
OMEGA = '"omega" valueReference="1"'


@pytest.mark.parametrize(
    ("old", "new", "given", "said"),
    [
        ('start="2e-4"', 'start="2e-4" min="0" max="1"', "J=2.0", r"J = 2\.0 must be from 0 to 1"),
        ('start="2e-4"', 'start="2e-4" min="0"', "J=-1", r"J = -1 must be from 0 to inf"),
        ("<ModelVariables>", KIND, "kind=2", r"kind = 2 must be one of 1, 4"),
        ('start="2e-4"', 'start="x"', "B=1e-4", r"start, min or max of J is no number"),
        (OMEGA, OMEGA.replace("1", "-1"), "B=1e-4", r"valueReference of omega must be from 0 to"),
        (OMEGA, OMEGA.replace("1", f"{1 << 32}"), "B=1e-4", r"valueReference of omega must be"),
        ('index="13"', 'index="99"', "B=1e-4", r"cannot be read \(it does not follow the stand"),
        (
            'modelIdentifier="foreign"',
            'maxOutputDerivativeOrder="x"',
            "B=1e-4",
            r"'x' is not a val",
        ),
        ('"alpha"', '"al&#10;pha"', "B=1e-4", r"name and unit of al pha must be printable"),
    ],
)
def test_what_an_fmu_says_of_its_variables_holds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, given: str, said: str
) -> None:
    scene = motor(tmp_path)
    reworded(tmp_path / "Rotor.fmu", (old, new))
    with in_place():
        assert main(["run", str(scene), "--set", f"fmu.rotor.{given}"]) == 2
    assert re.search(said, capsys.readouterr().err)


ALSO = '<Float64 name="also" valueReference="{}" causality="{}" variability="{}" start="0"/>'


@pytest.mark.parametrize(
    ("place", "causality", "said"),
    [
        (0, "input", "also and u are one input, and have two ports"),
        (2, "parameter", r"parameters also = 1e-05: it is J, which has a value"),
        (6, "output", "two of its outputs have one name"),
    ],
)
def test_two_names_of_one_and_one_name_of_two(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], place: int, causality: str, said: str
) -> None:
    """The last one has replaced the first without a word."""
    scene, varies = motor(tmp_path, version=3), "fixed" if place == 2 else "continuous"
    one = ALSO.format(place, causality, varies)
    one = one.replace('"also"', '"xs[1]"').replace('start="0"', "") if place == 6 else one
    reworded(tmp_path / "Rotor.fmu", ("</ModelVariables>", f"{one}</ModelVariables>"))
    port = '[[port]]\nprobe = "v(gp)"\nto = "rotor.also"\n[coupling]'
    text = scene.read_text()
    text = text.replace("[coupling]", port) if place == 0 else text
    scene.write_text(text.replace("J = 2e-4", "J = 2e-4, also = 1e-5") if place == 2 else text)
    with in_place():
        assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    assert re.search(said, capsys.readouterr().err)


def test_an_fmu_may_work_in_another_folder(tmp_path: Path) -> None:
    """Its resources, say; the results are where they were."""
    recompiled(
        tmp_path,
        ("    m->r[J] = 2e-4", '    chdir("/");\n    m->r[J] = 2e-4'),
        ("#include <math.h>", "#include <math.h>\n#include <unistd.h>"),
    )
    assert len(run(motor(tmp_path), {"run.duration": 1e-3}).columns["time"]) == 21


@pytest.mark.parametrize("size", ["-2", "1048577", "100000000000"])
def test_an_array_that_no_memory_holds_is_refused_where_it_is_needed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], size: str
) -> None:
    scene = motor(tmp_path, version=3)
    extra = f'start="0"><Dimension start="{size}"/></Float64></ModelVariables>'
    local = f'<Float64 name="map" valueReference="99" causality="local" {extra}'
    reworded(tmp_path / "Rotor.fmu", ("</ModelVariables>", local))
    with in_place():
        run(scene, {"run.duration": 1e-4})
        reworded(tmp_path / "Rotor.fmu", ('"local"', '"input"'))
        assert main(["run", str(scene)]) == 2
    assert "Rotor.fmu: map must have from 0 to 1048576 values" in capsys.readouterr().err


def test_an_ssp_of_own_fmus_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fmu", "ssp", str(motor(tmp_path)), "--out", str(tmp_path / "m.ssp")]) == 2
    assert "without an [[fmu]]" in capsys.readouterr().err
    assert not (tmp_path / "m.ssp").exists()


def test_an_fmu_for_one_instance_is_not_that_of_two(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two would be one: what it computes may lie in static variables."""
    scene = motor(tmp_path)
    reworded(
        tmp_path / "Rotor.fmu",
        ("<CoSimulation ", '<CoSimulation canBeInstantiatedOnlyOncePerProcess="true" '),
    )
    with in_place():
        run(scene, {"run.duration": 1e-4})
        second = '[[fmu]]\nname = "other"\nfile = "Rotor.fmu"\n[[port]]'
        scene.write_text(scene.read_text().replace("[[port]]", second, 1))
        port = '[[port]]\nfrom = "rotor.omega"\nto = "other.u"\n[coupling]'
        scene.write_text(scene.read_text().replace("[coupling]", port))
        assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    assert re.search(r"Rotor\.fmu: \[\[fmu\]\] rotor, other .*Once", capsys.readouterr().err)


@pytest.mark.parametrize("kind", ["deflated", "lzma", "a pipe", "a NUL", "too long"])
def test_what_is_no_file_of_an_fmu_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    scene, path = motor(tmp_path), tmp_path / "Rotor.fmu"
    if kind == "a pipe":
        path.unlink()
        os.mkfifo(path)
    elif kind in ("a NUL", "too long"):
        name = "a\\u0000.fmu" if kind == "a NUL" else f"{'a' * 300}.fmu"
        scene.write_text(scene.read_text().replace("Rotor.fmu", name))
    else:
        method = zipfile.ZIP_LZMA if kind == "lzma" else zipfile.ZIP_DEFLATED
        with zipfile.ZipFile(path, "w", method) as archive:
            archive.writestr("modelDescription.xml", "x" * 1000 + "".join(map(chr, range(32, 99))))
        content = bytearray(path.read_bytes())
        content[60:100] = bytes(each ^ 0x5A for each in content[60:100])
        path.write_bytes(content)
    with in_place():
        assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err.strip()
    said = '.fmu": there is no such file' if kind == "a NUL" else ".fmu: "
    assert (told.count("\n") == 0 and said in told) or kind == "too long"
    assert not (tmp_path / "out").exists()


def test_a_crash_is_exit_code_three(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = motor(tmp_path)
    given = ["--set", "fmu.rotor.crash_at=1e-3", "--set", "run.duration=2e-3"]
    assert main(["run", str(scene), *given, "--out", str(tmp_path / "out")]) == 3
    told = capsys.readouterr().err.strip()
    assert told.count("\n") == 0 and "died after t = " in told


def test_a_crash_before_the_first_step_is_told_as_that(tmp_path: Path) -> None:
    recompiled(tmp_path, ("    m->r[J] = 2e-4", "    abort(); m->r[J] = 2e-4"))
    with pytest.raises(SimulationFailed, match=r"died before its first step \(SIGABRT"):
        run(motor(tmp_path))


@pytest.mark.checked
@pytest.mark.parametrize(
    ("function", "end"),
    [
        ("int fmi2Terminate", "{ abort(); }"),
        pytest.param("void fmi2FreeInstance", "{ exit(5); }", marks=pytest.mark.slow),
    ],
)
def test_a_crash_at_its_end_costs_no_results(tmp_path: Path, function: str, end: str) -> None:
    body = "{ free(m); }" if "Free" in function else "{ return !m; }"
    recompiled(tmp_path, (f"{function}(void *m) {body}", f"{function}(void *m) {end}"))
    with pytest.warns(BeyondModel, match="all was computed when .* was lost"):
        result = run(motor(tmp_path), {"run.duration": 1e-3})
    (note,) = result.summary["notes"]
    assert ("SIGABRT" if "abort" in end else "exit code 5") in note
    assert "rotor.omega.mean_error" in result.summary and len(result.columns["time"]) == 21
    data = sweep(tmp_path / "motor.toml", {"fmu.rotor.J": [1e-4, 2e-4]}, {"run.duration": 1e-3})
    assert (data["failure"] == "").all()


@pytest.mark.parametrize(
    ("target", "said"), [("own", ""), ("../../../own", "leads outside"), ("/etc", "leads outside")]
)
def test_a_link_within_an_fmu_is_a_link(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], target: str, said: str
) -> None:
    scene, path = motor(tmp_path), tmp_path / "Rotor.fmu"
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    (library,) = (name for name in files if name.startswith("binaries"))
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", files["modelDescription.xml"])
        archive.writestr(f"{library.rpartition('/')[0]}/own", files[library])
        link = zipfile.ZipInfo(library)
        link.create_system, link.external_attr = 3, 0o120777 << 16
        archive.writestr(link, target)
    with in_place():
        given = ["--set", "run.duration=1e-4", "--out", str(tmp_path / "out")]
        assert main(["run", str(scene), *given]) == (2 if said else 0)
    assert said in capsys.readouterr().err


LOG_2, LOG_3 = (f'm->log{n}({z}0, 3, 0, "no licence\\n here")' for n, z in ((2, "0, "), (3, "")))
ENTER_2 = "int fmi2EnterInitializationMode(void *m) { return !m; }"


@pytest.mark.parametrize(
    ("version", "old", "new"),
    [
        (2, "calls->logger;", f"calls->logger; {LOG_2}; return NULL;"),
        (3, "m->log3 = log;", f"m->log3 = log; {LOG_3}; return NULL;"),
        (2, ENTER_2, f"int fmi2EnterInitializationMode(Model *m) {{ return {LOG_2}, 3; }}"),
    ],
)
def test_why_an_fmu_cannot_begin_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], version: int, old: str, new: str
) -> None:
    recompiled(tmp_path, (old, new))
    with in_place():
        assert main(["run", str(motor(tmp_path, version=version))]) == 2
    told = capsys.readouterr().err
    assert re.search(r"Rotor\.fmu: the FMU cannot be initialised: no licence\s+here\.$", told), told


def test_an_fmu_that_needs_its_tool_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recompiled(tmp_path, ("m->log2 = calls->logger;", "return NULL;"))
    scene, tool = motor(tmp_path), 'needsExecutionTool="true"'
    reworded(tmp_path / "Rotor.fmu", ("<CoSimulation ", f"<CoSimulation {tool} "))
    with in_place():
        assert main(["run", str(scene), "--out", str(tmp_path / "out")]) == 2
    assert "Failed to instantiate model); it needs its tool, which" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (2, "it discards .*; one that takes steps of one length alone needs .*macro-steps"),
        (3, "an error"),
        (4, "a fatal error"),
        (5, "background"),
    ],
)
def test_an_fmu_that_fails_without_a_word(tmp_path: Path, status: int, said: str) -> None:
    recompiled(tmp_path, ("m->time = time + h;", f"if (time > 1e-4) return {status};"))
    with (
        in_place(),
        pytest.raises(SimulationFailed, match=rf"FMU rotor failed at t = .*: .*{said}"),
    ):
        run(motor(tmp_path))


def test_macro_steps_have_one_length_to_the_bit(tmp_path: Path) -> None:
    """Times are sums of steps, so that the difference of two is none of them."""
    recompiled(tmp_path, ("m->time = time + h;", "if (h != 3e-4) return 2;"))
    scene = motor(tmp_path, fixed=True)
    given = {"coupling.macro_step": 3e-4, "run.duration": 0.03}
    with in_place():
        assert run(scene, given).summary["fmu_steps"] == 100


@pytest.mark.parametrize("command", ["sweep", "tune"])
@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("fmu.rotor.K", r"--over: .*Rotor\.fmu: fmu\.rotor\.K must .* \(it has J, B, "),
        ("fmu.motor.J", r"fmu\.motor\.J: there is no such FMU \(known: rotor\)"),
        ("circuit.param.X", r"bridge\.cir: circuit\.param\.X must .* \(it has vdd\)"),
        ("circuit.param", r"circuit\.param: this key is not a number"),
    ],
)
def test_a_key_of_a_study_that_is_not_there_is_told_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str, key: str, said: str
) -> None:
    scene, tune = motor(tmp_path), command == "tune"
    given = ["--over", f"{key}=1:2" if tune else f"{key}=1,2", "--out", str(tmp_path / "out")]
    with in_place():
        named = ["--maximise", "rotor.omega.mean"] if tune else []
        assert main([command, str(scene), *given, *named]) == 2
    told = capsys.readouterr().err.strip()
    assert told.count("\n") == 0 and re.search(said, told), told
    assert not (tmp_path / "out").exists()
