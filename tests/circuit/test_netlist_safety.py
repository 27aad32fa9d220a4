"""Whatever a netlist holds, ngspice runs no command and opens no file of its choosing.

Each form is tried twice: on ngspice as it stands, to show which are really dangerous in the version
at hand, and on ``read``, which must refuse it or hand on text without it.
"""

import os
import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.circuit.joined import deck
from cosim.circuit.lint.deck import MAX_BYTES
from cosim.errors import BadInput
from cosim.scene import load
from cosim.simulation.simulate import simulate
from tests.helpers import needs
from tests.helpers.examples import examples
from tests.helpers.netlists import read
from tests.helpers.ngspice_alone import run

pytestmark = pytest.mark.reliability

BODY = "V1 1 0 1\nR1 1 0 1\n"
END = ".tran 1u 3u\n.end\n"
FILES = {
    "evil.inc": "R9 1 0 1\n.control\nshell touch marker\n.endc\n",
    "evil.lib": ".lib tt\nR9 1 0 1\n.control\nshell touch marker\n.endc\n.endl tt\n",
    "hash.inc": "R9 1 0 1\n*#shell touch marker\n",
    "title.inc": ".title *ng_script\n*#shell touch marker\n",
}


def control(*commands: str) -> str:
    return "\n".join(["t", BODY + ".control", *commands, ".endc", END])


def line(*lines: str) -> str:
    return "\n".join(["t", BODY + lines[0], *lines[1:], END])


EXECUTED = {
    # Each leaves a file behind when ngspice 39 loads and runs it.
    "control": control("shell touch marker"),
    "mixed case": control("SheLL touch marker").replace(".control", ".CoNTRol"),
    "white space": control(" \tshell touch marker").replace(".control", " \t .control"),
    "after a lone carriage return": line("\r.control", "shell touch marker", ".endc"),
    "after a form feed": line("\f.control", "shell touch marker", ".endc"),
    "after a vertical tab": line("\v.control", "shell touch marker", ".endc"),
    "CRLF": control("shell touch marker").replace("\n", "\r\n"),
    "comment that commands": line("*#shell touch marker"),
    "comment that commands, spaced": line("*# shell touch marker"),
    "comment that commands, indented": line("  *#shell touch marker"),
    "script by its first line": f"*ng_script\n*#shell touch marker\n{END}",
    "script by its title": f"t\n{BODY}.title *ng_script\nshell touch marker\n{END}",
    "include": line(".include evil.inc"),
    "include in the title": f".include evil.inc\n{BODY}{END}",
    "library": line(".lib evil.lib tt"),
    "include with a comment that commands": line(".inc 'hash.inc'"),
    "backticks": control("echo `touch marker`"),
    "redirection": control("echo hello > marker"),
    "unixcom": control("set unixcom", "touch marker"),
    "write": control("run", "write marker"),
    "wrdata": control("run", "wrdata marker v(1)"),
    "print to a file": control("run", "print v(1) > marker"),
    "listing to a file": control("listing > marker"),
    "source": control("source evil.inc"),
    "cd": control("shell mkdir there", "cd there", "shell touch marker"),
    "BSIM log": line("M1 1 1 0 0 mm", ".model mm nmos level=8"),
    "BSIM log, no equals sign": line("M1 1 1 0 0 mm", ".model mm nmos level 8"),
    "BSIM log, continued": line("M1 1 1 0 0 mm", ".model mm", "+nmos(", "+level", "+=", "+8)"),
}
FORMS = EXECUTED | {
    # Dangerous in some version, by ngspice's manual or source, or too close to what is.
    "continued control": line(".con", "+trol", "shell touch marker", ".endc"),
    "control after the end": f"t\n{BODY}{END}.control\nshell touch marker\n.endc\n",
    "endc alone": line(".endc"),
    "command before the circuit": line("*#pre_shell touch marker"),
    "pre_ in control": control("pre_shell touch marker"),
    "bare pre_osdi": line("pre_osdi evil.osdi"),
    "osdi": line(".osdi evil.osdi"),
    "pre_osdi": line(".pre_osdi evil.osdi"),
    "hdl": line('.hdl "evil.va"'),
    "verilog": line('.verilog "evil.v"'),
    "code model": line(".codemodel ./evil.cm"),
    "exec": line(".exec touch marker"),
    "shell": line(".shell touch marker"),
    "bang": line("! touch marker"),
    "bare bang": line("!touch marker"),
    "at": line("@touch marker"),
    "system": line(".system touch marker"),
    "source card": line(".source evil.inc"),
    "load": line(".load evil.raw"),
    "write card": line(".write marker"),
    "wrdata card": line(".wrdata marker v(1)"),
    "script later": line("*ng_script", "shell touch marker"),
    "script with parameters": f"*NG_Script_With_Params\nshell touch marker\n{END}",
    "script behind a mark": f"\ufeff*ng_script\nshell touch marker\n{END}",
    "file source": line("A1 %v([o]) src", '.model src filesource (file="evil.inc")'),
    "process": line("A1 [1] 1 null p", '.model p d_process (process_file="./evil")'),
    "state machine": line("A1 [1] 1 null [2] s", '.model s d_state (state_file="evil.inc")'),
    "digital source": line("A1 [2] s", '.model s d_source (input_file="evil.inc")'),
    "cosimulation": line("A1 [1] [2] c", '.model c d_cosim (simulation="./evil.so")'),
    "table": line("A1 1 2 3 t", '.model t table2d (file="evil.inc")'),
    "model alone": line(".model src filesource (amploffset=[0])"),
    "Verilog-A": line("N1 1 0 m", ".model m resistor_va r=1"),
    "digital of PSpice": line("U1 inv $G_DPWR $G_DGND a b D0_GATE IO_STD"),
    "device simulator": line("D1 1 0 m", ".model m numd level=1", "+ output rootfile=marker"),
    "initial state from a file": line("D1 1 0 m ic.file=evil.inc", ".model m d"),
    "PWL from a file": line("V2 2 0 PWL FILE=evil.inc", "R2 2 0 1"),
    "PWL from a file, brackets": line("V2 2 0 pwl(file = evil.inc)", "R2 2 0 1"),
    "sound": line("V2 2 0 wavefile=evil.wav chan=0", "R2 2 0 1"),
    "table from a file": line('E1 2 0 table {V(1)} file="evil.inc"', "R2 2 0 1"),
    "debugging files": line(".options ngdebug"),
    "option of a path": line(".options sourcepath=/tmp"),
    "option of a raw file": line(".option rawfile=marker"),
    "option in disguise": line(".options reltol=1e-3,rawfile=marker"),
    "expression in BSIM's level": line("M1 1 1 0 0 mm", ".model mm nmos level={8}"),
    "absolute include": line(".include /etc/passwd"),
    "include above": line(".include ../evil.inc"),
    "include above, deep": line(".include sub/../../evil.inc"),
    "home": line(".include ~/evil.inc"),
    "variable": line(".include $HOME/evil.inc"),
    "variable in braces": line(".include ${inputdir}/evil.inc"),
    "URL": line(".include http://example.org/evil.inc"),
    "drive": line(r".include C:\evil.inc"),
    "backslash": line(r".include sub\evil.inc"),
    "command in a name": line(".include `echo evil.inc`"),
    "quoted twice": line(".include \"a\" 'evil.inc'"),
    "no name": line(".include"),
    "folder": line(".include ."),
    "absent": line(".include absent.inc"),
    "itself": line(".include my.cir"),
    "library above": line(".lib ../evil.lib tt"),
    "title included": line(".include title.inc"),
    "shell continuation": line("R3 1 0 \\\\", "1"),
    "string": line('.param x="touch marker"'),
    "NUL": line("R3 1 0 1\0", ".control"),
    "line separator": line("R3 1 0 1\u2028.control\u2028shell touch marker"),
    "paragraph separator": line("R3 1 0 1 ; \u2029.control"),
    "next line": line("R3 1 0 1\x85.control"),
    "file separator": line("R3 1 0 1\x1c.control"),
    "zero width": line(".con\u200btrol", "shell touch marker"),
    "right to left": line("R3 1 0 1 ; \u202e.control"),
    "full width": line("．ｃｏｎｔｒｏｌ", "shell touch marker"),
    "look-alike": line(".\u0441ontrol", "shell touch marker"),
    "no-break space": line("\u00a0.control", "shell touch marker"),
    "other directive": line(".sub x"),
    "only a dot": line("."),
    "two dots": line("..control"),
}


@pytest.fixture
def folder(tmp_path):
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    return tmp_path


def put(folder: Path, text: str | bytes) -> Path:
    path = folder / "my.cir"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refused(path: Path) -> str:
    with pytest.raises(BadInput, match=r"^[^:]+:\d+: .*\.$") as caught:
        read(path)
    assert str(caught.value).isprintable() and len(str(caught.value)) < 300
    return str(caught.value)


@needs.ngspice_library
@pytest.mark.parametrize("name", EXECUTED)
def test_these_forms_are_really_dangerous(folder, name):
    """Version 39 was seen to obey each of them; a later one may do so less, never unseen."""
    before = set(os.listdir(folder))
    run(EXECUTED[name], folder)
    if set(os.listdir(folder)) == before:
        pytest.skip("this ngspice does not")


@needs.ngspice_library
def test_several_forms_are_really_dangerous(folder):
    for name in ("control", "comment that commands", "include", "script by its title"):
        run(EXECUTED[name], folder)
        assert (folder / "marker").exists(), name
        (folder / "marker").unlink()


@pytest.mark.parametrize("name", FORMS)
def test_every_form_is_refused(folder, name):
    refused(put(folder, FORMS[name]))


@pytest.mark.parametrize("coding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_every_form_is_refused_in_every_coding(folder, coding):
    for name, text in FORMS.items():
        assert refused(put(folder, text.encode(coding))), name


HIDDEN = {
    # What another dialect's words might carry past the checks.
    "table of a file": line("B9 2 0 V=table(v(1), 0, 0, 1, file)", "R9 2 0 1"),
    "table of backticks": line("B9 2 0 V=table(v(1), 0, 0, 1, `touch marker`)", "R9 2 0 1"),
    "polynomial of backticks": line("E9 2 0 POLY(1) 1 0 0 `ls`", "R9 2 0 1"),
    "polynomial of a string": line('E9 2 0 POLY(1) 1 0 0 "ls"', "R9 2 0 1"),
    "parasite of backticks": line("C9 1 0 1u Rser=`ls`"),
    "parasite of a string": line('C9 1 0 1u Rser="ls"'),
    "unnamed string": line('C9 1 0 1u mfg="a" "b"'),
    "maker of a file": line('C9 1 0 1u mfg="a" file=b'),
    "section sign": line(".con§trol", "shell touch marker"),
    "ohms": line(".c\u2126ntrol", "shell touch marker"),
    "own models": line(".lib C:\\x\\standard.dio"),
    "own models, above": line(".lib ../standard.bjt"),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_no_dialect_hides_a_word(folder, name):
    (folder / "standard.dio").write_text(FILES["evil.inc"])
    (folder / "standard.bjt").symlink_to("/etc/passwd")
    refused(put(folder, HIDDEN[name]))


MEASURED = [
    "v(1)`ls`",
    'par("ls")',
    "file=x",
    "v(1) > marker",
    "'v(1)\\x'",
    "v(1)µ",
    "{p}",
    "i(r77)",
]


@pytest.mark.parametrize("words", MEASURED)
def test_no_measurement_hides_a_word(folder, words):
    path = put(folder, line(f".meas tran x AVG {words}"))
    with pytest.raises(BadInput, match=r"^my\.cir:4: "):
        deck(path, ["V1"], [], {}, 1e-3, 1e-5, 1e-6, False, {})


@pytest.mark.parametrize(
    "data",
    [
        b"t\nR1 a 0 1\xe9\n.end\n",
        b"t\nR1 a 0 1\xc0\xae\n.end\n",
        "t\nR1 a 0 1\n.control\n.end\n".encode("utf-16"),
        "t\nR1 a 0 1\n.control\n.end\n".encode("utf-16-be"),
        "t\nR1 a 0 1\n.end\n".encode("utf-16-le")[:-1],
        "t\nR1 a 0 1\u2028.control\n.end\n".encode("utf-16-le"),
        b"t\nR1 a 0 " + b"1" * 10_000 + b"\n.end\n",
        b"t\nV1 a 0 PWL(" + b"1 " * 200_000 + b")\n.end\n",
        pytest.param(b"t\n" + b"R1 a 0 1\n" * 100_001 + b".end\n", marks=pytest.mark.slow),
        b"",
        b"t",
    ],
    ids=[
        "latin",
        "overlong",
        "utf-16",
        "16-be",
        "16-cut",
        "16-separator",
        "word",
        "line",
        "lines",
        "empty",
        "title",
    ],
)
def test_odd_and_huge_files_are_refused(tmp_path, data):
    refused(put(tmp_path, data))


def test_links_out_of_the_folder_are_refused(tmp_path):
    secret = tmp_path / "secret.inc"
    secret.write_text("R9 a 0 1\n")
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "link.inc").symlink_to(secret)
    (inner / "up").symlink_to(tmp_path)
    (inner / "loop.inc").symlink_to(inner / "loop.inc")
    for name in ("link.inc", "up/secret.inc", "loop.inc"):
        refused(put(inner, f"t\n.include {name}\n.end\n"))
    (inner / "real.inc").write_text("R9 a 0 1\n")
    (inner / "near.inc").symlink_to(inner / "real.inc")
    assert len(read(put(inner, "t\n.include near.inc\n.end\n"))) == 2


@needs.posix
def test_pipes_and_devices_are_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    refused(put(tmp_path, "t\n.include pipe\n.end\n"))
    for path in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
        with pytest.raises(BadInput) as caught:
            read(path)
        kind = "a directory" if path == tmp_path else "not a regular file"
        assert str(caught.value) == f"{path}: cannot be read (it is {kind})."
    large = put(tmp_path, b"t\n" + b"*" * MAX_BYTES + b"\n.end\n")
    with pytest.raises(BadInput, match="larger than 4 MB"):
        read(large)
    (tmp_path / "large.inc").write_bytes(b"*" * (MAX_BYTES - 10))
    assert "larger than" in refused(put(tmp_path, "t\n.include large.inc\n.end\n"))


def test_includes_that_grow_or_circle_are_refused(tmp_path):
    for i in range(30):
        (tmp_path / f"{i}.inc").write_text(f".include {i + 1}.inc\n" * 2)
    (tmp_path / "30.inc").write_text("R1 a 0 1\n")
    assert "deep" in refused(put(tmp_path, "t\n.include 0.inc\n.end\n"))
    (tmp_path / "a.inc").write_text(".include b.inc\n")
    (tmp_path / "b.inc").write_text(".include a.inc\n")
    assert "includes itself" in refused(put(tmp_path, "t\n.include a.inc\n.end\n"))
    for i in range(8):
        (tmp_path / f"w{i}.inc").write_text(f".include w{i + 1}.inc\n" * 30)
    (tmp_path / "w8.inc").write_text("* " + "x" * 5000)
    assert "larger" in refused(put(tmp_path, "t\n.include w0.inc\n.end\n"))
    (tmp_path / "w8.inc").write_text("* small\n")  # but read 30⁸ times
    said = refused(put(tmp_path, "t\n.include w0.inc\n.end\n"))
    assert "files are included more than 1000 times" in said


@pytest.mark.parametrize(
    "title",
    ["My circuit", "", "*#shell touch marker", 'µ `x` \\ "q"', ".title KiCad", "# x", "@ $ !"],
)
def test_titles_are_made_harmless(tmp_path, title):
    first = read(put(tmp_path, f"{title}\nR1 a 0 1\n.end\n"))[0].text
    assert first.startswith("* ") and first.isascii() and not set(first) & set('`\\"#@$!')


def test_what_is_handed_on_has_no_comment_and_no_dropped_line(folder):
    text = line("R3 1 0 1 ; .control", "* .control", "*####", ".save all", ".plot tran v(1)", ".op")
    assert [found.text for found in read(put(folder, text))] == [
        "* t", "V1 1 0 1", "R1 1 0 1", "R3 1 0 1",
    ]  # fmt: skip


HARMLESS = {
    # Words that are commands elsewhere, but elements, or part of one, where they stand.
    "switch": line("shell touch marker"),
    "switch of the right length": line("shell 1 0 touch 0 marker"),
    "current-controlled switch": line("write marker v(1)"),
    "coil": line("load marker 1"),
    "source": line("echo hello > marker"),
    "continued comment": line("*", "+#shell touch marker"),
    "continued after a comment": line("R3 1 0 1 ; x", "+ *#shell touch marker"),
    "comment like a rule": line("*#####", "* #"),
    "text in an expression": line("R3 1 0 {!0 + 1}"),
    "commanding title": f"*#shell touch marker\n{BODY}{END}",
}


@needs.ngspice_library
@pytest.mark.parametrize("name", HARMLESS)
def test_what_passes_does_nothing(folder, name):
    before = {*os.listdir(folder), "my.cir"}
    lines = read(put(folder, HARMLESS[name]))
    run("\n".join([*(found.text for found in lines), END]), folder)
    assert set(os.listdir(folder)) == before


FORBIDDEN = [
    ".control", ".endc", ".shell", ".codemodel", ".hdl", ".osdi", ".pre_osdi", ".verilog", ".exec",
    ".system", ".write", "*ng_script", "*#shell", "*#write", "a1 b c d", "n1 b c d",
    ".include /etc/passwd", ".include ../x", ".lib ../x y", ".model x filesource (a=1)",
    ".model x numd level=1", ".model x nmos level=14", ".options ngdebug", "!ls",
    "v1 a b pwl file=x", "pre_osdi x",
]  # fmt: skip


@examples(500)
@given(
    st.sampled_from(FORBIDDEN),
    st.randoms(use_true_random=False),
    st.text(" \t", max_size=5),
    st.text(" \t", max_size=5),
    st.sampled_from(["\n", "\r\n"]),
    st.booleans(),
)
def test_no_case_and_no_white_space_hides_a_word(
    tmp_path_factory, word, dice, before, after, ending, included
):
    folder = tmp_path_factory.getbasetemp()
    hidden = "".join(dice.choice((c.lower(), c.upper())) for c in word)
    hidden = before + spread(hidden, dice) + after
    if included:
        (folder / "hidden.inc").write_bytes(f"R1 1 0 1{ending}{hidden}{ending}".encode())
        hidden = ".include hidden.inc"
    refused(put(folder, ending.join(["t", "V1 1 0 1", hidden, "R2 1 0 1", ".end", ""])))


def spread(text: str, dice: random.Random) -> str:
    """The text with its spaces lengthened or, but in comments, continued on another line."""
    if text.startswith("*"):
        return text
    spaces = [" ", "\t ", "   ", "\n+ ", " ; hidden\n* hidden\n\n +"]
    return "".join(dice.choice(spaces) if c == " " else c for c in text)


SECRETS = [
    "secret-token\nsecret-password\n",
    "root:secret:0:0\nnews:secret:9:9:/usr/sbin/secret\n",
    "secret\n.secret\n",
    ".control secret\n",
    "secret\n.include secret\n",
    "secret\n*ng_script secret\n.endl\n.ends secret",
    "secret\n\x01secret",
]


@pytest.mark.parametrize("text", SECRETS)
def test_a_file_that_is_no_netlist_is_not_echoed(tmp_path, text):
    """A stranger's scene can name any file that the user may read."""
    (tmp_path / "any").write_text(text)
    assert "secret" not in refused(tmp_path / "any")
    for scene in (
        ["trial", f"drive.file={tmp_path / 'any'}"],
        ["held", f"friction.normal_force_file={tmp_path / 'any'}"],
    ):
        with pytest.raises(BadInput) as caught:
            simulate(load(scene[0], scene[1:]))
        assert "secret" not in str(caught.value)
