"""Netlists with random faults: each runs, or is told in a sentence, soon, and leaves no file."""

import random
import warnings
from pathlib import Path

import psutil
import pytest

import cosim
from cosim.errors import CosimError
from cosim.files.resources import circuits

pytestmark = pytest.mark.reliability

EXAMPLES = ["amplifier.cir", "examples/audio_amplifier.cir", "examples/h_bridge.cir"]
PIECES = (
    "{}", "{", "}", "(", ")", "'", "=", " = ", "\n", "\n+ ", "\n* ", ".", " .end\n", "1e999", "-1",
    "0", "nan", "{1/0}", " level=8", "1level=8", " v(out)", "\t", ";", "$ ", "e", "k", "meg", "µ",
    "\0", "\n.include x\n", "\n.control\nquit\n.endc\n", "\nX9 a b nothing\n", "\nR9 out out 0\n",
    "\nE9 x9 0 POLY(2) v1 0 out 0 0 1 2\nR8 x9 0 1k\n",
    "\nG9 0 out TABLE {v(out)} = (0,0) (1,1u)\n",
    " Rser=1", " Cpar=1p", "table(v(v1),0,0,1,1)", "if(", "limit(", "poly(", "4k7", "§", "Ω",
    "\n.meas tran x9 WHEN v(out)=1 rise=last\n", "\n.lib a\\standard.dio\n",
)  # fmt: skip
PATIENCE = 10.0
"""s of CPU time that a netlist may take, beyond the start of a worker."""


def mutated(text: str, dice: random.Random) -> str:
    for _ in range(dice.randint(1, 3)):
        at, to = dice.randrange(len(text)), dice.randrange(len(text))
        length = dice.choice((1, 1, 3, 20, 200))
        kind = dice.randrange(5)
        if kind == 0:
            text = text[:at] + text[at + length :]
        elif kind == 1:
            text = text[:at] + dice.choice(PIECES) + text[at:]
        elif kind == 2:
            text = text[:at] + text[to : to + length] + text[at:]
        elif kind == 3:
            text = text[:at] + chr(dice.randrange(1, 0x180)) + text[at + 1 :]
        else:
            lines = text.split("\n")
            dice.shuffle(chosen := dice.sample(range(len(lines)), min(2, len(lines))))
            lines[chosen[0]], lines[chosen[-1]] = lines[chosen[-1]], lines[chosen[0]]
            text = "\n".join(lines)
    return text


def worked() -> float:
    """CPU seconds of the workers and of this process."""
    every = (psutil.Process(), *psutil.Process().children())
    return sum(sum(one.cpu_times()[:2]) for one in every)


@pytest.mark.parametrize(
    "count", [30, pytest.param(2000, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])]
)
def test_mutations(count: int, tmp_path: Path) -> None:
    dice = random.Random(count)
    own = tmp_path / "own.cir"
    ran = 0
    for number in range(count):
        text = (circuits() / dice.choice(EXAMPLES)).read_text(encoding="utf-8")
        bad = mutated(text, dice)
        own.write_text(bad, encoding="utf-8")
        brief = {"run.duration": 2e-4, "run.settle": 0.0, "run.output_step": 1e-4}
        began = worked()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                cosim.run("paper", {"circuit.model": "file", "circuit.netlist": own, **brief})
                ran += 1
            except CosimError as error:
                assert "\n" not in str(error) and len(str(error)) < 1000, (number, bad)
        assert worked() - began < PATIENCE, (number, bad)
        assert [path.name for path in tmp_path.iterdir()] == ["own.cir"], (number, bad)
    assert 0.05 * count < ran < count
