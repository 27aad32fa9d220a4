"""Hostile TOML costs no more than its length, and honest TOML is what tomllib makes of it."""

import time
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import BadInput
from cosim.scene import load
from cosim.scene.toml import MOST_PARTS, parse

pytestmark = pytest.mark.reliability

N = 200_000
LONG = ".".join(["a"] * N)
HOSTILE = {
    "key": f"{LONG} = 1",
    "blanks": " . ".join(["a"] * N) + " = 1",
    "quoted": ".".join(['"a"'] * N) + " = 1",
    "literal": ".".join(["'a'"] * N) + " = 1",
    "header": f"[{LONG}]",
    "array of tables": f"[[{LONG}]]",
    "inline": f"drive = {{{LONG} = 1}}",
    "behind five quotes": f'description = """a"""""\n{LONG} = 1',
    "behind a quote in a comment": f'# "\n{LONG} = 1',
    "behind an escaped backslash": f'description = "\\\\"\n{LONG} = 1',
    "never closed": 'description = """' + '\\"""' * N,
    "escapes": '"\\' * N,
    "one word": "a" * 900_000,
    "blanks alone": "a" + " " * 900_000,
    "unknown keys": "[drive]\n" + "".join(f"k{k} = 1\n" for k in range(60_000)),
    "a long unknown key": "[drive]\n" + "frequenc" * 100_000 + " = 1",
    "a long unknown table": "[" + "driv" * 200_000 + "]",
    "a long value": '[drive]\nwaveform = "' + "sawtoot" * 120_000 + '"',
    "brackets": "x = " + "[" * 900_000,
    "tables": "x = [" + "{}," * 300_000 + "]",
}


@pytest.fixture(scope="module")
def harmless() -> float:
    """s that a large file without malice takes."""
    text = "".join(f"[a.b{k}]\n" for k in range(60_000))
    began = time.process_time()
    tomllib.loads(text)
    return time.process_time() - began


@pytest.mark.timeout(120)
@pytest.mark.parametrize("name", HOSTILE)
def test_takes_no_longer_than_its_length(name: str, tmp_path: Path, harmless: float) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(HOSTILE[name], encoding="utf-8")
    began = time.process_time()
    with pytest.raises(BadInput) as caught:
        load(path)
    assert time.process_time() - began < 15 * harmless
    assert len(str(caught.value)) < 1000


@pytest.mark.timeout(120)
def test_an_override_is_no_other_door(harmless: float) -> None:
    began = time.process_time()
    with pytest.raises(BadInput):
        load("paper", ["drive.frequency={" + ".".join(["a"] * 60_000) + "=1}"])
    assert time.process_time() - began < 15 * harmless


BARE = st.text("ab-_1", min_size=1, max_size=3)
WORDS = st.text("a.b.c. \"'#\\=[]", max_size=30)
VALUE = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    WORDS.map(lambda text: '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'),
    WORDS.map(lambda text: "'" + text.replace("'", "") + "'"),
    WORDS.map(lambda text: '"""' + text.replace("\\", "\\\\").replace('"', '\\"') + '"""'),
    WORDS.map(lambda text: "'''\n" + text.replace("'", "") + "'''''"),
)


@given(st.lists(st.tuples(st.lists(BARE, min_size=1, max_size=12), VALUE, WORDS), max_size=6))
def test_only_long_keys_are_refused(lines: list[tuple[list[str], str, str]]) -> None:
    keys = [f"k{number}." + ".".join(parts[1:]) for number, (parts, _, _) in enumerate(lines)]
    text = "\n".join(
        f"{key.rstrip('.')} = {value} # {words}"
        for key, (_, value, words) in zip(keys, lines, strict=True)
    )
    if any(len(parts) > MOST_PARTS for parts, _, _ in lines):
        with pytest.raises(ValueError, match="parts"):
            parse(text)
    else:
        assert parse(text) == tomllib.loads(text)
