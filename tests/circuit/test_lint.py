"""Netlists of all ordinary forms pass; each mistake is told in one sentence at its line."""

import re
import string
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.circuit.dialect.lines import Line
from cosim.circuit.lint.checks import check
from cosim.circuit.lint.expressions import BEHAVIOURAL, PARAMETRIC
from cosim.circuit.lint.write import written
from cosim.errors import BadInput, plain
from cosim.files.resources import circuits
from tests.helpers import needs
from tests.helpers.examples import examples
from tests.helpers.netlists import read
from tests.helpers.ngspice_alone import run
from tests.helpers.ordinary_netlists import ORDINARY

GOOD = """good
.param k=2
.subckt half in out r=1k
.param local={r*k}
R1 in out {local}
R2 out 0 {r}
.ends half
.model dd d(is=1e-14)
Vcommand v1 0 1
Xh v1 out half r={500*k}
D1 out 0 dd
Lcoil out c1 1m
Vemf c1 s 0
Rs s 0 4
.tran 10u 1m
.end
"""


def checked(folder: Path, text: str | bytes, name: str = "my.cir") -> list[Line]:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    lines = read(path)
    check(lines)
    return lines


def complaint(folder: Path, text: str | bytes) -> str:
    """The sentence that tells of what is wrong with ``text``."""
    with pytest.raises(BadInput) as caught:
        checked(folder, text)
    return sentence(caught.value)


def sentence(error: BadInput) -> str:
    message = str(error)
    assert error.exit_code == 2
    assert message.isprintable() and len(message) < 300
    assert re.match(r"[^:]+:\d+: .*\.$", message), message
    return message


@pytest.mark.parametrize("name", ["amplifier", "full"])
def test_built_in_netlists_pass(name):
    check(read(circuits() / f"{name}.cir"))


@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_netlists_pass(tmp_path, name):
    checked(tmp_path, ORDINARY[name])


@needs.ngspice_library
@pytest.mark.parametrize("name", ORDINARY)
def test_ordinary_netlists_are_correct(tmp_path, name):
    """ngspice runs each to its end, as it stands and as it is written anew: to the same bits."""
    top = check(checked(tmp_path, ORDINARY[name]))
    anew = [written(line, element, {}) for line, element, _ in top.order]
    finals = set()
    for deck in (ORDINARY[name], "\n".join(["* title", *anew, ".tran 10u 2m", ".end"])):
        said = run(deck, tmp_path)
        finals.update(re.findall(r"^.*final = .*$", said, re.MULTILINE))
        if "unable to find definition of model" in said:
            pytest.skip("POLY and TABLE need ngspice's code models, which its library lacks here")
        assert "finished = 2.000000e-03" in said, said[-2000:]
        assert "rror" not in said and "singular" not in said, said[-2000:]
    assert len(finals) == 1


def test_lines_know_where_they_began(tmp_path):
    (tmp_path / "more.inc").write_text("* part\nR2 a 0\n+ 1k ; half\n* between\n\n+ tc1=0\n")
    path = tmp_path / "my.cir"
    path.write_text("My title: µ\n\nR1 a 0 1k\n.include 'more.inc'\n.tran 1u 1m\nV1 a 0 1\n.END\n")
    assert read(path) == [
        Line("* My title:", "my.cir", 1),
        Line("R1 a 0 1k", "my.cir", 3),
        Line("R2 a 0 1k tc1=0", "more.inc", 2),
        Line("V1 a 0 1", "my.cir", 6),
    ]


def test_sections_of_libraries(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "inner.inc").write_text("R3 a 0 3\n")
    (tmp_path / "my.lib").write_text(
        "anything .control\n.LIB tt\nR1 a 0 1\n.include sub/inner.inc\n.endl tt\n"
        ".lib ff\n.shell x\n.lib 'my2.lib' tt\n.endl\n"
    )
    path = tmp_path / "my.cir"
    path.write_text('t\n.lib "my.lib" TT\n.end')
    assert [line.text for line in read(path)[1:]] == ["R1 a 0 1", "R3 a 0 3"]
    path.write_text("t\n.lib my.lib ss\n.end")
    with pytest.raises(BadInput, match="has no section ss"):
        read(path)


def test_text_keeps_its_case_and_line_endings_do_not_matter(tmp_path):
    plain = checked(tmp_path, GOOD)
    assert checked(tmp_path, GOOD.replace("\n", "\r\n")) == plain
    assert checked(tmp_path, "\ufeff" + GOOD) == plain
    assert "Lcoil out c1 1m" in [line.text for line in plain]


IN_B = "Rs s 0 4\nB1 b 0 V="
IN_PARAM = "Rs s 0 4\n.param p="
LIMITER = "limit() is no limiter in ngspice; write max(low, min(high, x))."
BEFORE = "works only where all is known before the run."
FUNCTIONS = [
    # what takes the place of "Rs s 0 4", what the sentence says
    (IN_B + "limit(V(v1),1)", f":15: {LIMITER}"),
    (IN_B + "limit(2*3,1)", f":15: {LIMITER}"),
    (IN_PARAM + "{limit(30,-12)*limit(1,2,3)}", ":15: the function limit takes 3 arguments"),
    (".func f(x) {limit(x,-1,1,2)}\nRs s 0 4\nB1 b 0 V=f(V(v1))", f":14: {LIMITER}"),
    (IN_B + "pow(V(v1))", ":15: the function pow takes 2 arguments, not 1."),
    (IN_B + "max(1,2,3)", ":15: the function max takes 2 arguments, not 3."),
    (IN_B + "{max(1,2,3)}", ":15: the function max takes 2 arguments, not 3."),
    (IN_B + "sin()", ":15: the function sin takes 1 argument, not 0."),
    (IN_B + "sqrt(V(v1,out),2)", ":15: the function sqrt takes 1 argument, not 2."),
    (IN_B + "table(V(v1),0,0,1)", ":15: table() takes a value and at least two points"),
    (IN_B + "table(V(v1),1,0,0,1)", ":15: the x values of table() must rise, 0 comes after 1."),
    (IN_B + "if(V(v1)>0,1)", ":15: the function if takes 3 arguments, not 2."),
    (IN_B + "pwl(V(v1),0,0,1)", ":15: pwl() takes a value and at least two points"),
    (IN_B + "sqr(V(v1))", f":15: the function sqr {BEFORE}"),
    (IN_B + "{sqr(3)}*V(v1)", f":15: the function sqr {BEFORE}"),
    (IN_B + "bessel(V(v1),1)", ":15: the function bessel is not defined."),
    (IN_B + "agauss(V(v1),0,3)", ":15: in a B source agauss() takes plain numbers only"),
    (IN_B + "agauss(2*k,0,3)", ":15: in a B source agauss() takes plain numbers only"),
    (IN_B + "(V(v1)>0 and V(v1)<1) ? 1 : 0", ":15: the parameter and is not defined."),
    (IN_PARAM + "{max(3,2,1)}", ":15: the function max takes 2 arguments, not 3."),
    (IN_PARAM + "{agauss(3,0)}", ":15: the function agauss takes 3 arguments, not 2."),
    (IN_PARAM + "{u(2)}", ":15: the function u works only in B sources."),
    (IN_PARAM + "'if(k>1,2)'", ":15: the function if takes 3 arguments, not 2."),
    ("Rs s 0 {u(2)}", ":14: the function u works only in B sources."),
    ("Rs s 0 4\nE1 e 0 value={sqr(3)}", f":15: the function sqr {BEFORE}"),
    ("Rs s 0 4\nE1 e 0 vol='max(V(v1))'", ":15: the function max takes 2 arguments, not 1."),
    ("Rs s 0 R='4+sqr(V(v1))'", f":14: the function sqr {BEFORE}"),
    (".func f(x) {sqr(x)}\nRs s 0 4\nB1 b 0 V=f(2)", f":14: the function sqr {BEFORE}"),
    (".func f(x) {u(x)}\nRs s 0 {f(4)}", ":14: the function u works only in B sources."),
    (".func f(x) {max(x)}\nRs s 0 {f(4)}", ":14: the function max takes 2 arguments, not 1."),
    (".func f(x) {x+1}\nRs s 0 {f(1,2)}", ":15: the function f takes 1 argument, not 2."),
    (".func f(x) {g(x)}\n.func g(x) {f(x)}\nRs s 0 {f(1)}", " calls itself"),
    (".func f(x) {f(x)+1}\nRs s 0 4", ":14: the function f calls itself"),
    (".func abs(x) {abs(x)}\nRs s 0 4", ":14: the function abs calls itself"),
    (IN_B + "pwl(V(v1),0,0,0,1,2,1)", ":15: the x values of pwl() must rise, 0 comes after 0."),
    (IN_B + "pwl(V(v1),1k,0,{k},1,-2,1,-3m,1,-4m,1)", "must rise, -0.004 comes after -0.003."),
    (IN_B + "pwl(V(v1),0,0,1,1+1)", ":15: the points of pwl() must be plain numbers, or"),
    (IN_B + "pwl(V(v1),0,0,1,-k)", ":15: the points of pwl() must be plain numbers, or"),
    (IN_B + "pwl(V(v1),0,0,1,time)", ":15: the points of pwl() must be plain numbers, or"),
    (IN_B + "V(v1)>0 ? 1", ":15: V(v1)>0 ? 1 must have a : for each ?"),
    (IN_B + "V(v1)>0 ? 1 : 2 : 3", " must have a : for each ?"),
    (IN_PARAM + "{k ? 2}", ":15: {k ? 2} must have a : for each ?"),
    (IN_B + "2*(V(v1),5)", ":15: 2*(V(v1),5) is no expression that ngspice can read: its comma"),
    (IN_B + "max(1,(1,5))", ":15: max(1,(1,5)) is no expression that ngspice can read: its comma"),
]


@pytest.mark.parametrize(("new", "words"), FUNCTIONS)
def test_misused_functions_are_told(tmp_path, new, words):
    assert words in complaint(tmp_path, GOOD.replace("Rs s 0 4", new, 1))


def calls(functions: dict[str, int]) -> list[str]:
    """A call of each, with numbers of which it makes a number."""
    return [
        f"{name}({','.join(('2' if name == 'acosh' else '0.5', '2', '3')[:count])})"
        for name, count in functions.items()
    ]


MORE_IN_SOURCES = [
    "pwl(V(v1),0,0,1,k,{k*2},-3)",
    "pow(V(v1,out),2)",
    "{abs (V(v1))}",
    "MAX(V(v1) , lim(V(v1), -1, {min(k, 3)})) tc1={sqr(0)}",
    "agauss({k},1e-3,3)*V(v1)",
    "cut(3*V(v1))",
    "higher(V(v1))",
    "V(v1)>0 && !(V(v1)>1) || V(v1,out)<0 ? V(v1)<2 ? 1 : -1 : (V(v1)>3 ? 0 : 1)",
    "pwl(V(v1),-1m,0,0,1,1e-3,{max(k,1)},1.5E+0,-.3)",
    "pwl(V(v1),0,-{k},(1), -(3))",
]
MORE_IN_PARAMETERS = ["max (sqr(k), 3)", "agauss(2*k, 0, 3)", "twice(sqr(2))"]
MORE = """
.func lim(x,lo,hi) {max(lo, min(hi, x))}
.func limit(x,lo,hi) {lim(x,lo,hi)}
.func cut(x) 'limit(x,-1,1)'
.func twice(x) {sqr(x)*2}
.func step(x) {u(x-1)}
.func higher(x) {step(x)+twice_again(x)}
.func twice_again(x) {x+x}
Rf f 0 R='1+u(V(v1))' tc1={sqr(0)}
Gf f 0 value={abs (V(v1))/1k} m={int(1.5)}
Rg f 0 {sqr(3)}
Vh h 0 dc=max(1,2)
"""


@needs.ngspice_library
@pytest.mark.parametrize(
    ("sources", "given", "others"),
    [
        (calls(BEHAVIOURAL), calls(PARAMETRIC), ""),
        (MORE_IN_SOURCES, MORE_IN_PARAMETERS, MORE),
    ],
)
def test_functions_are_those_of_ngspice(tmp_path, sources, given, others):
    lines = [f"B{i} b{i} 0 V={text}\nRb{i} b{i} 0 1k" for i, text in enumerate(sources)]
    lines += [f".param p{i}={{{text}}}\nRp{i} s 0 {{1k+p{i}}}" for i, text in enumerate(given)]
    deck = GOOD.replace(".tran", "\n".join([others, *lines, ".tran"]), 1)
    checked(tmp_path, deck)
    said = run(deck, tmp_path)
    assert "finished = 1.000000e-03" in said and "rror" not in said, said[-2000:]


MISTAKES = [
    # the good netlist's text, what takes its place, what the sentence says
    ("Rs s 0 4", "Rs s 0", ":14: rs has no value"),
    ("Rs s 0 4", "T1 s 0 s 0 Z0=50", ":14: t1: write its delay, TD="),
    ("Rs s 0 4", "Rs s 0 tc1=1m", ":14: rs has no value"),
    ("Rs s 0 4", "Rs s", ":14: rs has too few nodes"),
    ("Rs s 0 4", "Rs s 0 four", ":14: rs: four is neither a number nor a model"),
    ("Rs s 0 4", "Rs s 0 2*k", ":14: rs: write {…} around its value, 2*k."),
    ("Rs s 0 4", "Rs s 0 R = 1+V(s)*{k} tc1=0", ":14: rs: write {…} around its value, 1+V(s)*{k}."),
    ("Rs s 0 4", "Rs s 0 4\nC1 s 0 Q=1u*{k}", ":15: c1: write {…} around its value, 1u*{k}."),
    (".tran 10u 1m", ".temp", ":15: .temp must have one temperature in °C, a number or {…}; "),
    (".tran 10u 1m", ".temp 0 85", ":15: .temp 0 85 must have one temperature"),
    (".tran 10u 1m", ".options temp=k", ":15: temp=k must have a number, or a name in {…}."),
    ("Rs s 0 4", "Rs s 0 4\nL1 s 0 1\nK1 Lcoil L1 1.5", ":16: k1 couples by 1.5; it must be from"),
    ("Rs s 0 4", "Rs s 0 dd", ":14: rs: the model dd is of type d"),
    ("Rs s 0 4", "Rs s 0 {four}", ":14: the parameter four is not defined"),
    ("Rs s 0 4", "Rs s 0 '2*four'", ":14: the parameter four is not defined"),
    ("Rs s 0 4", "Rs s 0 r=four", ":14: the parameter four is not defined"),
    ("Rs s 0 4", "Rs s 0 {local}", ":14: the parameter local is not defined"),
    ("Rs s 0 4", "Rs s 0 {f(4)}", ":14: the function f is not defined"),
    ("Rs s 0 4", "Rs s 0 {hertzes}", ":14: the parameter hertzes is not defined"),
    ("Rs s 0 4", "Rs s 0 {4", ":14: { is not closed"),
    ("Rs s 0 4", "Rs s 0 4}", ":14: } closes nothing"),
    ("Rs s 0 4", "Rs s 0 'k", ":14: a quote is not closed"),
    ("Rs s 0 4", "Rs s 0 {min(k,4}", ":14: ( is not closed"),
    ("Rs s 0 4", "Rs s 0 4\nrs s 0 5", ":15: there is a second rs"),
    ("Rs s 0 4", "Rs s 0 4\nC1 s x 1u\nC2 x 0 1u", ":15: the node x has no path for direct"),
    ("Rs s 0 4", "Rs sx 0 4", ":14: the node sx has no other connection"),
    ("Rs s 0 4", "Rs s 0 4\nI1 0 x 1m\nC1 x 0 1u", ":15: the node x has no path"),
    ("Rs s 0 4", "Rs s 0 4\nL1 v1 0 1", ":15: l1 closes a loop"),
    ("Rs s 0 4", "Rs s 0 4\nV1 v1 0 1", ":15: v1 closes a loop"),
    ("Rs s 0 4", "Rs s 0 4\nE1 v1 0 out 0 1", ":15: e1 closes a loop"),
    ("Rs s 0 4", "Rs s 0 4\nB1 0 v1 V=2", ":15: b1 closes a loop"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V=V(nope)", ":15: nothing is connected to the node nope"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V=2*nope", ":15: the parameter nope is not defined"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V=i(Vnope)", ":15: b1: there is no source vnope here"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 2", ":15: b1 has neither"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V=V(v1)*", ":15: V(v1)* is no expression"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V=V(v1) V(out)", ":15: V(v1) V(out) is no expression"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V=V(v1),2", ":15: V(v1),2 is no expression"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V=v((s))", ":15: the function v is not defined"),
    # Read in a time quadratic in the depth: a thousand took 3 s, four thousand 39 s.
    ("Rs s 0 4", "Rs s 0 {" + 120 * "abs( " + "4" + 120 * " )" + "}", ":14: brackets are nested"),
    # ngspice computes x*23 of the first, and gives up for the rest of the process at the others.
    ("Rs s 0 4", "Rs s 0 4\n.func f(x) {x*2} 3\nR9 s 0 {f(1)}", ":15: {x*2} 3 is no expression"),
    ("Rs s 0 4", "Rs s 0 4\n.func f(x y) {x}", ":15: .func f(x y) {x} is no complete .func"),
    ("Rs s 0 4", "Rs s 0 4\n.func f(x) x*w\nR9 s 0 {f(1)}", ":15: the parameter w is not"),
    (
        "Rs s 0 4",
        "Rs s 0 4\n.func f(x) {x*w}\nD9 s 0 dd\n.model dd d(is={f(1)})",
        ":15: the parameter w is not",
    ),
    ("Rs s 0 4", "Rs s 0 {nope=3 ? 1 : 2}", ":14: the parameter nope is not defined"),
    ("Rs s 0 4", "Rs s 0 4\nB1 b 0 V= nope=3", ":15: the parameter nope is not defined"),
    ("Rs s 0 4", "Rs s 0 {4*/k}", ":14: 4*/k is no expression"),
    ("Rs s 0 4", "Rs s 0 4\nE1 e 0 v1 0", ":15: e1 has too few nodes or no value"),
    ("Rs s 0 4", "Rs s 0 4\nF1 0 f Vemf", ":15: f1 has too few words"),
    ("Rs s 0 4", "Rs s 0 4\nF1 0 f Vnope 2", ":15: f1: there is no source vnope here"),
    ("Rs s 0 4", "Rs s 0 4\nK1 Lcoil Lnope 1", ":15: k1: there is no inductor lnope here"),
    ("Rs s 0 4", "Rs s 0 4\nT1 s 0 t 0 td=1n", ":15: t1 has no Z0="),
    ("Rs s 0 4", "Rs s 0 4\nV3 a 0 ten\nR3 a 0 1", ":15: v3: ten is neither"),
    ("Rs s 0 4", "Rs s 0 4\nV3 a 0 external\nR3 a 0 1", ":15: v3 cannot be external"),
    ("Rs s 0 4", "Rs s 0 4\nS1 s 0 v1 0 nope", ":15: s1: no model nope"),
    ("Rs s 0 4", "Rs s 0 4\nS1 s 0 v1 0", ":15: s1 has too few nodes or no model"),
    ("Rs s 0 4", "Rs s 0 4\nQ1 s v1 dd", ":15: q1 has too few nodes or no model"),
    ("Rs s 0 4", "Rs s 0 4\nQ1 s v1 0 dd", ":15: q1: the model dd is of type d"),
    ("Rs s 0 4", "Rs s 0 4\nM1 s v1 0 0 nope", ":15: m1: no model nope"),
    ("Rs s 0 4", "Rs s 0 4\nM1 s g 0 0 mm\n.model mm nmos", ":15: the node g has no path"),
    ("Rs s 0 4", "Rs s 0 4\n.if (k==2)\nR9 s 0 1", ":15: .if has no .endif"),
    ("Rs s 0 4", "Rs s 0 4\n.if (nope)\nR9 s 0 1\n.endif", ":15: the parameter nope"),
    ("Rs s 0 4", "Rs s 0 4\n.endif", ":15: .endif has no .if"),
    ("Rs s 0 4", "Rs s 0 4\n.ends", ":15: .ends has no .subckt"),
    ("Rs s 0 4", "Rs s 0 4\n.param a={b} b={a}", ":15: the parameter "),
    ("Rs s 0 4", "Rs s 0 4\n.param a", ":15: .param gives no name a value"),
    (
        "Rs s 0 4",
        "Rs s 0 4\nD2 s 0 x\n.model x d(is=nope)",
        ":16: the parameter nope is not defined",
    ),
    ("D1 out 0 dd", "D1 out 0 d2", ":11: d1: no model d2 is defined here"),
    ("D1 out 0 dd", "D1 out 0", ":11: d1 has too few nodes or no model"),
    ("out half r", "out halve r", ":10: xh: no subcircuit halve is defined here"),
    ("v1 out half", "v1 half", ":10: xh has 1 nodes, but the subcircuit half has 2"),
    ("v1 out half", "v1 out 0 half", ":10: xh has 3 nodes, but the subcircuit half has 2"),
    ("{500*k}", "{500*nope}", ":10: the parameter nope is not defined"),
    ("{500*k}", "nope", ":10: the parameter nope is not defined"),
    ("{500*k}", "{500*", ":10: { is not closed"),
    (".ends half\n", "", ":3: .subckt half has no .ends"),
    ("R2 out 0", "Xr in out half\nR2 out 0", ":6: half is called 50 deep, perhaps by itself"),
    ("{r*k}", "{r*nope}", ":4: the parameter nope is not defined"),
    ("Vemf c1 s 0", "Vammeter c1 s 0", ":1: the netlist must have"),
    ("Vcommand v1", "Vdac v1", ":1: the netlist must have"),
    (".end\n", "", ":15: the netlist does not end with .end"),
    (".end\n", ".end\nR9 s 0 1\n", ":17: there is text after .end"),
    ("good\n", "good\n+ Rs\n", ":2: the line continues nothing"),
]


@pytest.mark.parametrize(("old", "new", "words"), MISTAKES)
def test_mistakes_are_told(tmp_path, old, new, words):
    assert old in GOOD
    assert words in complaint(tmp_path, GOOD.replace(old, new, 1))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("none.cir", "there is no such file."),
        ("none/my.cir", "there is no such file."),
        ("good.cir/my.cir", "there is no such file."),
        ("folder", "cannot be read (it is a directory)."),
        ("a\0b", "cannot be read (it is no possible file name)."),
        ("x" * 300, "cannot be read (File name too long)."),
    ],
)
def test_missing_netlist_is_told_with_its_whole_path(tmp_path, name, words):
    (tmp_path / "folder").mkdir()
    (tmp_path / "good.cir").write_text(GOOD)
    with pytest.raises(BadInput) as caught:
        read(tmp_path / name)
    path = plain(f"{tmp_path}/{name}")
    assert str(caught.value) == f"{path}: {words}"


def test_no_ground(tmp_path):
    assert "no ground (node 0)" in complaint(
        tmp_path, re.sub(r" 0 ", " g ", GOOD.replace("s 0 4", "s g 4").replace("c1 s 0", "c1 s"))
    )


def test_sources_that_are_required_can_be_chosen(tmp_path):
    path = tmp_path / "my.cir"
    path.write_text("t\nVx a 0 1\nR1 a 0 1\n.end\n")
    check(read(path), (("vx",),))
    check(read(path), ())
    with pytest.raises(BadInput, match="the sources Vy"):
        check(read(path), (("vy",),))


def test_dac_and_offset_serve_for_the_command(tmp_path):
    two = "Vdac v1 0 1\nVoffset off 0 1\nRoff off 0 1"
    checked(tmp_path, GOOD.replace("Vcommand v1 0 1", two))


def test_subcircuits_that_explode_are_refused(tmp_path):
    levels = [".subckt s0 a\nR1 a 0 1\nR2 a 0 1\n.ends"]
    levels += [f".subckt s{i} a\nX1 a s{i - 1}\nX2 a s{i - 1}\n.ends" for i in range(1, 40)]
    text = GOOD.replace(".tran", "\n".join([*levels, "Xbig s s39", ".tran"]))
    assert "expand to more than" in complaint(tmp_path, text)


POOL = GOOD + string.printable + "µ\u2028\x85\x00\ufeff{}'()=.+*$;"


@examples(400)
@given(
    st.sampled_from([GOOD, *ORDINARY.values()]),
    st.lists(
        st.tuples(
            st.floats(0, 1),
            st.integers(0, 12),
            st.text(st.sampled_from(sorted(set(POOL))), max_size=6),
        ),
        min_size=1,
        max_size=8,
    ),
)
def test_mutations_pass_or_are_told(tmp_path_factory, text, cuts):
    folder = tmp_path_factory.getbasetemp()
    for where, length, put in cuts:
        place = int(where * len(text))
        text = text[:place] + put + text[place + length :]
    passes_or_is_told(folder, text.encode())


@examples(200)
@given(st.sampled_from([GOOD, *ORDINARY.values()]), st.randoms(use_true_random=False))
def test_shuffled_words_pass_or_are_told(tmp_path_factory, text, random):
    lines = text.split("\n")
    for _ in range(4):
        place = random.randrange(1, len(lines))
        found = lines[place].split()
        random.shuffle(found)
        lines[place] = " ".join(found[: random.randint(0, 9)])
    passes_or_is_told(tmp_path_factory.getbasetemp(), "\n".join(lines).encode())


@examples(200)
@given(st.binary(max_size=200))
def test_any_bytes_pass_or_are_told(tmp_path_factory, data):
    passes_or_is_told(tmp_path_factory.getbasetemp(), b"t\n" + data + b"\n.end\n")


def passes_or_is_told(folder: Path, data: bytes) -> None:
    try:
        checked(folder, data)
    except BadInput as error:
        sentence(error)


def test_names_are_told_as_they_are_written(tmp_path):
    with pytest.raises(BadInput, match=r"kröte.cir:1: the netlist does not end"):
        checked(tmp_path, "x", "kröte.cir")
    with pytest.raises(BadInput, match=r"a\\x1b\\nb.cir:1: "):
        checked(tmp_path, "x", "a\x1b\nb.cir")
