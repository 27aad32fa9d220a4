"""What ngspice reads is written anew: nothing of a netlist's own text, and the same circuit."""

import time
from pathlib import Path

import pytest

from cosim.circuit.lint.checks import check
from cosim.circuit.lint.write import written
from cosim.circuit.netlist import prepare
from cosim.errors import BadInput
from cosim.files.resources import circuits
from cosim.scene import Scene, load
from tests.helpers.netlists import read
from tests.helpers.ordinary_netlists import ORDINARY

AMPLIFIER = (circuits() / "amplifier.cir").read_text(encoding="utf-8")


def own(path: Path, *lines: str) -> Scene:
    """A scene with the amplifier's netlist and more lines."""
    head, end, rest = AMPLIFIER.rpartition(".end")
    path.write_text("\n".join((head, *lines, f"{end}{rest}")), encoding="utf-8")
    return load("reference", ["circuit.model=file", f"circuit.netlist={path}"])


def anew(path: Path) -> list[str]:
    top = check(read(path), ())
    every = [written(line, element, {}) for line, element, _ in top.order]
    return "\n".join(every).split("\n")


@pytest.mark.parametrize("name", sorted(ORDINARY))
def test_what_is_written_is_read_as_the_same(name: str, tmp_path: Path) -> None:
    """Written anew it is as it was: nothing is left that the reader and ngspice part otherwise."""
    path = tmp_path / "own.cir"
    path.write_text(ORDINARY[name], encoding="utf-8")
    once = anew(path)
    path.write_text("\n".join(("title", *once, ".end")), encoding="utf-8")
    assert anew(path) == once


@pytest.mark.parametrize("kind", [".func f{0}(x) {{{1}}}", ".param f{0}(x)={{{1}}}"])
@pytest.mark.parametrize("use", ["B9 x9 0 V=f{}(v(v1))", "R8 x9 0 {{1k+f{}(1)}}"])
def test_functions_that_write_out_too_often_are_told_at_once(
    kind: str, use: str, tmp_path: Path
) -> None:
    """Each calls the one before twice: 2 kB that ngspice takes half a minute for."""
    for last, refused in ((5, False), (17, True), (60, True)):
        bodies = ["x*1", *(f"f{k}(x)+f{k}(x)" for k in range(last))]
        lines = [kind.format(k, text) for k, text in enumerate(bodies)]
        began = time.process_time()
        text = "\n".join(("t", *lines, "Vcommand v1 0 1", use.format(last), "R9 x9 0 1k", ".end"))
        path = tmp_path / "own.cir"
        path.write_text(text, encoding="utf-8")
        if refused:
            with pytest.raises(BadInput, match=r"the function f1[0-9] makes \d+ calls, by way of"):
                check(read(path), ())
        else:
            check(read(path), ())
        assert time.process_time() - began < 5.0


def test_functions_that_are_called_too_deep_are_told(tmp_path: Path) -> None:
    lines = [f".func f{k}(x) {{{f'f{k - 1}(x)' if k else 'x'}}}" for k in range(3000)]
    path = tmp_path / "own.cir"
    path.write_text(
        "\n".join(("t", *lines, "Vcommand v1 0 1", "R8 v1 0 {f2999(1)}", ".end")), encoding="utf-8"
    )
    with pytest.raises(BadInput, match="more than 100 deep"):
        check(read(path), ())


GLUED = (
    "vto=1level=8", "vto=1level=8 w=1", "vto=1.level=8", "vto=1e3level=8", "vto=1u level=8",
    "level=8", "level 8", "level = 8", "(level=8)", "level={8}", "level='8'", "level=1+7",
    "level=8.0", "level=08", "level=1 level=8", "level=1level=8", "level=+8", "kp={1}level=8",
    "vto=1,level=8", "vto=1 LEVEL=8", "level=49", "level=1e1",
)  # fmt: skip


@pytest.mark.parametrize("parameters", GLUED)
def test_no_spelling_of_a_level_passes(parameters: str, tmp_path: Path) -> None:
    path = tmp_path / "own.cir"
    scene = own(path, "M9 v1 v1 0 0 m l=1u w=1u", f".model m nmos {parameters}")
    with pytest.raises(BadInput, match=r"level|name=value|blank|cannot be set"):
        prepare(scene)


@pytest.mark.parametrize(
    ("element", "told"),
    [
        ("C9 v1 0 1u Rser=1 m=2", "write a resistor in series"),
        ("R9 v1 0 1 Rpar=1k", "write a resistor in parallel"),
        ("E9 x9 0 v1 0 laplace=s", "write another filter"),
        ("L9 v1 x9 1m ruler=3", "nothing that ngspice knows"),
        ("B9 x9 0 V=1e+5.", r"1e\+5\. is no expression"),  # it computes 6
    ],
)
def test_what_ngspice_would_drop_in_silence_is_told(
    element: str, told: str, tmp_path: Path
) -> None:
    with pytest.raises(BadInput, match=told):
        prepare(own(tmp_path / "own.cir", element, "R7 v1 0 1k", "R6 x9 0 1k", "R5 x9 0 1k"))
